"""Units of quantities: factors to SI units, dimensions, and parsing of quantities such as "80 mm" within a text."""

import math
import re
from difflib import get_close_matches
from fractions import Fraction
from functools import cache
from typing import Literal, NamedTuple, get_args

# Exponents of metre, kilogram, second, radian and ampere. Angles have a dimension, so that rpm differs from 1/s.
Dimension = tuple[int, int, int, int, int]
PLAIN: Dimension = (0, 0, 0, 0, 0)
ANGLE: Dimension = (0, 0, 0, 1, 0)


class DisplayUnit(NamedTuple):
    """Unit for display: its name, and the factor from SI units."""

    name: str
    factor: float


# Unit of every stress that is printed or drawn; moduli may be in GPa.
STRESS = DisplayUnit("MPa", 1e-6)
PERCENT = DisplayUnit("%", 100.0)
# What motors and prescribed motions apply, by unit.
EFFORTS = {"N m": "torque", "N": "force"}
# Unit of the rate of a joint, by the unit of the effort that drives it.
RATES = {"N m": "rad/s", "N": "m/s"}


class Unit(NamedTuple):
    """Unit with its exact value in SI units, `factor` times pi to the power `pi`, and its dimension."""

    factor: Fraction
    pi: int
    dimension: Dimension

    def times(self, other: "Unit", power: int) -> "Unit":
        """Return the product with a power of another unit."""
        dimension = tuple(one + power * two for one, two in zip(self.dimension, other.dimension, strict=True))
        return Unit(self.factor * other.factor**power, self.pi + power * other.pi, dimension)  # type: ignore[arg-type]

    def in_si(self, number: str) -> float:
        """Convert a number of this unit to SI units, rounded once (without pi): 1.1 mm is the float 0.0011."""
        try:
            return float(Fraction(number) * self.factor) * math.pi**self.pi
        except OverflowError:
            return math.inf


# Units of most machine descriptions; an unknown unit with one wrong letter is more likely one of these.
_COMMON = ("mm", "cm", "kg", "ms", "kN", "deg", "rad", "rpm", "MPa", "GPa")
_ONE = Unit(Fraction(1), 0, PLAIN)


def _unit(
    factor: str | int | Fraction, m: int = 0, kg: int = 0, s: int = 0, rad: int = 0, A: int = 0, *, pi: int = 0
) -> Unit:
    return Unit(Fraction(factor), pi, (m, kg, s, rad, A))


_PREFIXES = {"G": "1e9", "M": "1e6", "k": "1e3", "m": "1e-3", "u": "1e-6", "µ": "1e-6", "μ": "1e-6", "n": "1e-9"}
# Units with prefixes, and units without.
_PREFIXED = {
    "m": _unit(1, m=1),
    "g": _unit("1e-3", kg=1),
    "s": _unit(1, s=1),
    "rad": _unit(1, rad=1),
    "N": _unit(1, m=1, kg=1, s=-2),
    "Nm": _unit(1, m=2, kg=1, s=-2),
    "Pa": _unit(1, m=-1, kg=1, s=-2),
    "J": _unit(1, m=2, kg=1, s=-2),
    "W": _unit(1, m=2, kg=1, s=-3),
    "Hz": _unit(1, s=-1),
    "A": _unit(1, A=1),
    "V": _unit(1, m=2, kg=1, s=-3, A=-1),
    "ohm": _unit(1, m=2, kg=1, s=-3, A=-2),
    "H": _unit(1, m=2, kg=1, s=-2, A=-2),
}
_SINGLE = {
    "cm": _unit("1e-2", m=1),
    "in": _unit("0.0254", m=1),
    "t": _unit(1000, kg=1),
    "min": _unit(60, s=1),
    "h": _unit(3600, s=1),
    "deg": _unit("1/180", rad=1, pi=1),
    "°": _unit("1/180", rad=1, pi=1),
    "rev": _unit(2, rad=1, pi=1),
    "rpm": _unit("1/30", s=-1, rad=1, pi=1),
    "Nmm": _unit("1e-3", m=2, kg=1, s=-2),
    "bar": _unit("1e5", m=-1, kg=1, s=-2),
    # A pound-force per square inch.
    "psi": _unit(Fraction("4.4482216152605") / Fraction("0.0254") ** 2, m=-1, kg=1, s=-2),
}  # fmt: skip
UNITS: dict[str, Unit] = (
    _PREFIXED
    | {prefix + name: unit._replace(factor=unit.factor * Fraction(factor)) for name, unit in _PREFIXED.items()
       for prefix, factor in _PREFIXES.items()}
    | _SINGLE
)  # fmt: skip

_NUMBER = r"(?<![\w.])(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,3})?"
_POWERS = {"²": 2, "³": 3, "⁴": 4}


def _factor(group: str) -> str:
    """Return the pattern of a known unit and its power; `group` opens capturing or non-capturing groups for both."""
    known = "|".join(map(re.escape, sorted(UNITS, key=len, reverse=True)))
    return rf"{group}{known})(?![^\W²³⁴]|\()(?:\s*\^\s*{group}-?\d)|{group}[²³⁴]))?"


# Operators between units. The * is left out, as a parameter or the time t may follow it; /t is time, not tonnes.
_OPERATOR = r"\s*/\s*(?!t\b)|\s*·\s*|\s+"
# A number followed by a unit; a quotient of units may begin with 1.
_QUANTITY = re.compile(rf"({_NUMBER})\s*((?:1\s*/\s*)?{_factor('(?:')}(?:(?:{_OPERATOR}){_factor('(?:')})*)")
_FACTOR = re.compile(rf"({_OPERATOR}|^){_factor('(')}")
_BEHIND_NUMBER = re.compile(rf"{_NUMBER}\s*([^\W\d]\w*)")


class NumberWithUnit(NamedTuple):
    """Number with a unit in a text: its start and end, its value in SI units, and its unit as written."""

    start: int
    end: int
    value: float
    unit: str


@cache
def unit_named(text: str) -> Unit:
    """Return the unit of a text such as "mm", "N m/rad" or "1/s"; each / divides by the next factor alone."""
    unit = _ONE
    for found in _FACTOR.finditer(text.removeprefix("1")):
        power = int(found[3] or _POWERS.get(found[4], 1))
        unit = unit.times(UNITS[found[2]], -power if "/" in found[1] else power)
    return unit


def unit_of(text: str) -> Unit | None:
    """Return the unit that a text names, or None if it is not a unit."""
    return unit_named(text.strip()) if _QUANTITY.fullmatch(f"1 {text.strip()}") else None


def quantities_in(text: str) -> list[NumberWithUnit]:
    """Return the numbers with units in a text, in their order."""
    return [
        NumberWithUnit(*found.span(), unit_named(found[2]).in_si(found[1]), found[2])
        for found in _QUANTITY.finditer(text)
    ]


def without_quantities(text: str) -> str:
    """Return a text with each number with a unit replaced by a space."""
    return _QUANTITY.sub(" ", text)


def divisors_in(unit: str) -> set[str]:
    """Return the names in a unit that follow a /, where a parameter of an expression could stand as well."""
    return {found[2] for found in _FACTOR.finditer(unit) if "/" in found[1]}


def unknown_unit(text: str) -> tuple[str, str] | None:
    """Return the first word after a number in a text that is not a unit, and a remedy; None if there is none."""
    for found in _BEHIND_NUMBER.finditer(text):
        if found[1] not in UNITS:
            near = list(dict.fromkeys([*_mistyped(found[1]), *get_close_matches(found[1], UNITS, n=1)]))
            near = near or [unit for unit in UNITS if unit.casefold() == found[1].casefold()]
            meant = " or ".join(f'"{each}"' for each in near)
            return found[1], f"did you mean {meant}?" if near else 'write units like "mm^2", "N m/rad" or "rpm"'
    return None


def _mistyped(word: str) -> list[str]:
    """Return the common units that differ from a word in exactly one letter."""
    alike = (each for each in _COMMON if len(each) == len(word) > 1)
    return [each for each in alike if sum(one != other for one, other in zip(each, word, strict=True)) == 1]


# Units of the fields of model files, as written in their descriptions.
FIELD_UNITS = (
    "kg m^2", "kg/m^3", "kg m", "kg", "N m s/rad", "N m/rad/s", "N m/rad", "N s/m", "N m/s", "N m/A", "N m", "N/m/s",
    "N/m", "N/s", "m/s^2", "m^4", "m^2", "m/s", "rad/s", "rad/m", "rad", "Pa", "Hz", "1/s", "V s/rad", "V", "ohm", "m",
    "s", "N", "A", "H",
)  # fmt: skip

# Quantities that have an output unit, and their SI units.
QuantityName = Literal[
    "length", "angle", "time", "mass", "force", "torque", "stress", "velocity", "angular_velocity", "acceleration",
    "angular_acceleration", "frequency", "stiffness", "angular_stiffness",
]  # fmt: skip
_SI = ("m", "rad", "s", "kg", "N", "N m", "Pa", "m/s", "rad/s", "m/s^2", "rad/s^2", "Hz", "N/m", "N m/rad")
QUANTITIES: dict[str, str] = dict(zip(get_args(QuantityName), _SI, strict=True))

# Units of travel, torque, stiffness and speed at a sliding joint, by their units at a revolute joint.
WHERE_IT_SLIDES = {
    "N m/rad": "N/m", "N m s/rad": "N s/m", "N m": "N", "rad": "m", "rad/s": "m/s", "rad/N/m": "m/N",
}  # fmt: skip


def dimension_text(dimension: Dimension) -> str:
    """Return the SI unit of a dimension, as the fields of files spell it where they have it."""
    for unit in (*FIELD_UNITS, "rad/s^2", "W"):
        if unit_named(unit).dimension == dimension:
            return unit
    powers = zip(("kg", "m", "s", "rad", "A"), (dimension[k] for k in (1, 0, 2, 3, 4)), strict=True)
    return " ".join(name if power == 1 else f"{name}^{power}" for name, power in powers if power) or "1"
