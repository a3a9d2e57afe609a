"""Text of numbers, units and symbols: one rule for tables, tiles, messages and axes.

`number` writes plain ASCII, for terminals and files; `typeset` turns such a text into that of pages and figures.
"""

import math
import re
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache

import numpy as np

from .arrays import ArrayLike
from .errors import InputError
from .units import QUANTITIES, STRESS, DisplayUnit, unit_named, unit_of, unknown_unit

# Text for a value that does not exist.
NO_VALUE = "-"
# Magnitudes from which and below which numbers are written without powers of ten.
_SMALLEST_PLAIN, _LARGEST_PLAIN = 1e-3, 1e6
# Share of the magnitude of its terms below which a difference is a rounding error.
_ROUNDING = 16.0 * sys.float_info.epsilon
# Values below this, in any unit, are rounding errors.
ROUNDING = 1e-12

_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_UNRAISED = {ord("²"): "^2", ord("³"): "^3"}
_LOWERED = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")
GREEK = {
    "alpha": "α", "beta": "β", "gamma": "γ", "delta": "δ", "theta": "θ", "phi": "φ", "psi": "ψ", "tau": "τ",
    "omega": "ω", "eta": "η",
}  # fmt: skip
_CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f]")
# Number of letters up to which a name beside a chart is shown whole.
_SHORT = 40
# Longest name or unit that is shown whole.
LONGEST = 200
_POWER = re.compile(r"\^(-?\d+)")
# Number of digits from which those of whole numbers are separated in groups of three.
_GROUPED = 5
# Numbers within a text, with the parts that are typeset.
_WRITTEN = re.compile(r"(?<![\w.])(-)?(\d+(?:\.\d*)?)(?:e([+-]\d+))?(?![\w])")

# Output units that a user has chosen, by quantity.
_output: dict[str, DisplayUnit] = {}
_PREFIXES = {
    "m": (DisplayUnit("mm", 1e3), DisplayUnit("µm", 1e6), DisplayUnit("nm", 1e9)),
    "rad": (DisplayUnit("rad", 1.0), DisplayUnit("mrad", 1e3), DisplayUnit("µrad", 1e6)),
    "Pa": (DisplayUnit("GPa", 1e-9), STRESS),
    "m √kg": (DisplayUnit("mm √kg", 1e3), DisplayUnit("µm √kg", 1e6)),
    "N/m": (DisplayUnit("kN/mm", 1e-6), DisplayUnit("N/mm", 1e-3), DisplayUnit("N/m", 1.0)),
    "N": (DisplayUnit("kN", 1e-3), DisplayUnit("N", 1.0)),
    "N m": (DisplayUnit("kN m", 1e-3), DisplayUnit("N m", 1.0)),
    "W": (DisplayUnit("kW", 1e-3), DisplayUnit("W", 1.0)),
    "m/N": (DisplayUnit("mm/N", 1e3), DisplayUnit("µm/N", 1e6), DisplayUnit("nm/N", 1e9)),
}
# Magnitudes from which and below which values of several have a common unit with few zeros and digits.
_FEW_ZEROS, _FEW_DIGITS = 0.01, 1e4
# Smallest peak for which a unit is used; GPa is for moduli, stresses are in MPa.
_LEAST, _LEAST_OF = 0.1, {"GPa": 2.0, "kN/mm": 1.0, "kN": 10.0, "kN m": 10.0, "kW": 10.0}


def number(
    value: float | None,
    digits: int = 4,
    *,
    factor: float = 1.0,
    beside: float = 0.0,
    missing: str = NO_VALUE,
    infinite: str = "inf",
    padded: bool = False,
) -> str:
    """Format a value times a factor with some significant digits: "0.377", "43708", "1.2e-05".

    Integer digits are all written up to a million; larger numbers and those below 0.001 have an exponent.

    Parameters
    ----------
    value : float, optional
        Value to format.
    digits : int
        Number of significant digits.
    factor : float
        Factor of the value, such as a change of units.
    beside : float
        Magnitude of the quantities whose difference or part the value is; a value within their rounding is "0".
    missing, infinite : str
        Texts for a value that is None or NaN, and for an infinite one.
    padded : bool
        Whether trailing zeros are kept, so that numbers of a column have equally many digits.
    """
    if value is None or math.isnan(value):
        return missing
    if math.isinf(factor * value):
        # A number beyond all in its unit is not known.
        return infinite if math.isinf(value) else missing
    if value == 0.0 or (math.isfinite(beside) and abs(value) < _ROUNDING * beside):
        return "0"
    value = factor * value
    # A number that is rounded up to the next power of ten is written as that power.
    size = abs(float(f"{value:.{digits - 1}e}"))
    if size >= 10.0 ** (digits - 1) and size < _LARGEST_PLAIN:
        return f"{value:.0f}"
    if not _SMALLEST_PLAIN <= size < _LARGEST_PLAIN:
        mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
        return f"{mantissa if padded or '.' not in mantissa else mantissa.rstrip('0').rstrip('.')}e{exponent}"
    return f"{value:#.{digits}g}" if padded else f"{value:.{digits}g}"


def typeset(text: str) -> str:
    """Return a text as pages print it: "1.2e-05" as "1.2 × 10⁻⁵", "m/s^2" as "m/s²", a minus sign, a dash for none."""
    if text in ("inf", "-inf"):
        return text.replace("inf", "∞").replace("-", "−")
    return "–" if text == NO_VALUE else _WRITTEN.sub(_typeset, superscripts(text))


def superscripts(text: str) -> str:
    """Return a text with its powers as superscripts: "m/s^2" as "m/s²"."""
    return _POWER.sub(lambda found: raised(int(found[1])), text)


def _typeset(found: re.Match[str]) -> str:
    sign, digits, exponent = found.groups()
    if digits.isdecimal() and len(digits) >= _GROUPED and not exponent:
        digits = f"{int(digits):,}".replace(",", "\N{THIN SPACE}")
    power = f" × 10{raised(int(exponent))}" if exponent else ""
    return ("−" if sign else "") + digits + power


def quantity(value: float, unit: str, shown: DisplayUnit | None = None, digits: int = 3, *, padded: bool = True) -> str:
    """Format a value in a suitable unit, or in a given one: "0.377 mm"."""
    shown = shown or display_unit(unit, value)
    return f"{number(value, digits, factor=shown.factor, padded=padded)} {shown.name}".rstrip()


def error_text(error: float | None, factor: float = 1.0) -> str:
    """Format an error times a factor with one digit, to be written behind its value: " ± 600"; empty if it is None."""
    return "" if error is None else f" ± {number(float(f'{factor * error:.0e}'), 1)}"


def speed_text(speed: float, unit: str, digits: int = 4) -> str:
    """Format a speed in m/s or rad/s; the latter also in rpm, as a value given without a unit may have been in rpm."""
    turns = f", {number(speed, digits, factor=30.0 / math.pi)} rpm" if unit == "rad/s" else ""
    return f"{number(speed, digits)} {unit}{turns}".rstrip()


def count(value: float | None) -> str:
    """Format a whole number: "43708"; a dash if there is none."""
    return NO_VALUE if value is None or not math.isfinite(value) else str(int(value))


def logarithmic_number(value: float) -> str:
    """Format a number of a logarithmic axis: plain from 0.001 up to below 10⁴, else as "10⁻⁵" or "2·10⁻⁵"."""
    if value < 0.0:
        return f"−{logarithmic_number(-value)}"
    if value == 0.0 or 0.999e-3 <= value < 0.999e4:
        return f"{value:g}"
    exponent = math.floor(math.log10(value) + 1e-9)
    digits = f"{value / 10.0**exponent:.3g}"
    return ("" if digits == "1" else f"{digits}·") + f"10{raised(exponent)}"


def raised(exponent: int) -> str:
    """Return an exponent in superscripts: "⁻⁵"."""
    return str(exponent).translate(_RAISED)


# Units


def display_unit(unit: str, values: ArrayLike) -> DisplayUnit:
    """Return the unit in which the largest length, angle, stress, stiffness or compliance has few digits.

    Other units are returned unchanged.
    """
    largest, choices = peak(values), display_units(unit)
    if len(choices) == 1:
        return choices[0]
    if largest == 0.0:
        return next(choice for choice in choices if choice.name not in _LEAST_OF)
    fits = (one for one in choices if largest * one.factor >= _LEAST_OF.get(one.name, _LEAST))
    return next(fits, choices[-1])


def axis_unit(unit: str, values: ArrayLike) -> DisplayUnit:
    """Return the unit of `display_unit` for an axis; very large or small numbers are in powers of a thousand of others.

    Numbers without a unit up to 2e9 are "in 10⁹".
    """
    shown, size = display_unit(unit, values), peak(values)
    if unit in _PREFIXES or shown.name != unit or size == 0.0 or 1e-3 <= size < 1e5:
        return shown
    exponent = 3 * math.floor(math.log10(size) / 3.0)
    return DisplayUnit(f"10{raised(exponent)} {'' if unit == '1' else shown.name}".rstrip(), 10.0**-exponent)


def display_units(unit: str) -> tuple[DisplayUnit, ...]:
    """Return all units in which a quantity of an SI unit may be shown, the largest first: its output unit alone."""
    chosen = bool(_output) and _quantity_in(unit) in _output
    return _PREFIXES[unit] if unit in _PREFIXES and not chosen else (output_unit(unit),)


def output_unit(unit: str) -> DisplayUnit:
    """Return the output unit of quantities with an SI unit, see `output_units`; the SI unit if there is none."""
    chosen = _output.get(_quantity_in(unit)) if _output else None
    return chosen or DisplayUnit(unit[:LONGEST], 1.0)


@cache
def _quantity_in(unit: str) -> str:
    """Return the one of `QUANTITIES` that has a unit; empty if there is none."""
    found = unit_of(unit.translate(_UNRAISED))
    # Frequencies have the dimension of rates of decay, and torques that of energies.
    known = (name for name, si in QUANTITIES.items() if found and unit_named(si).dimension == found.dimension)
    return next((name for name in known if ("Hz" in unit if name == "frequency" else "J" not in unit)), "")


@contextmanager
def output_units(units: Iterable[str], field: str = "units") -> Iterator[None]:
    """Show quantities in units such as "deg" and "mm" within a context, in tables, figures, reports and CSV files.

    It holds for the process. Other quantities are shown in units in which they have few digits; data stay in SI units.
    Errors are those of `checked_units`.
    """
    before, chosen = dict(_output), checked_units((("", unit.strip()) for unit in units), field)
    try:
        _output.update(chosen)
        yield
    finally:
        _output.clear()
        _output.update(before)


def prefer_units(units: Mapping[str, str]) -> None:
    """Set output units by quantity, as [units] of a model's file has them, for quantities that have none."""
    _output.update(checked_units(units.items()) | _output)


def checked_units(units: Iterable[tuple[str, str]], field: str = "units") -> dict[str, DisplayUnit]:
    """Return output units by quantity, from pairs of a quantity ("length"; "" for any) and a unit of it.

    Raise InputError if a unit is unknown, is not one of the quantity or of any, or is the second one of its quantity.
    """
    out: dict[str, DisplayUnit] = {}
    for name, unit in units:
        found = _quantity_in(unit)
        if unit_of(unit) is None:
            problem = "no such unit"
            remedy = (unknown_unit(f"1 {unit}") or ("", 'write a unit such as "mm", "deg/s" or "kN"'))[1]
        elif not found or name not in ("", found):
            problem = f"not a unit of {name or 'a quantity that is shown'}"
            remedy = f'write "{QUANTITIES[name]}"' if name else f"choose from units of {', '.join(QUANTITIES)}"
            if not found and " " in unit:
                remedy = f'separate units by commas, as in "{",".join(unit.split())}"'
        elif found in out:
            problem, remedy = f"a second unit of {found} beside {out[found].name}", "leave one of them out"
        else:
            out[found] = DisplayUnit(unit, 1.0 / unit_named(unit).in_si("1"))
            continue
        raise InputError(problem, field=f"{field}.{name}".rstrip("."), value=unit, remedy=remedy)
    return out


def common_unit(unit: str, values: Iterable[float | None] | ArrayLike, *, beside: float = 0.0) -> DisplayUnit:
    """Return the unit in which all values have few digits, else the unit of the largest.

    Values and `beside` are as for `number`.
    """
    known = np.abs(np.asarray(values if isinstance(values, np.ndarray) else list(values), dtype=float))  # type: ignore[arg-type]
    known = known[np.isfinite(known) & (known > _ROUNDING * beside)]
    if not known.size:
        return display_unit(unit, 0.0)
    least, most = float(known.min()), float(known.max())
    choices, first = display_units(unit), display_unit(unit, most)
    rest = choices[choices.index(first) :]
    fits = (
        one
        for smallest, largest in ((_FEW_ZEROS, _FEW_DIGITS), (_SMALLEST_PLAIN, _LARGEST_PLAIN))
        for one in rest
        if least * one.factor >= smallest and most * one.factor < largest
    )
    return next(fits, first)


def peak(values: ArrayLike) -> float:
    """Return the largest finite magnitude; zero if there is none."""
    magnitudes = np.abs(np.asarray(values, dtype=float))
    return float(np.max(magnitudes, initial=0.0, where=np.isfinite(magnitudes)))


def labelled(name: str, unit: str) -> str:
    """Return the label of an axis or a column, with its unit if it has one: "torque [N m]"."""
    return name if unit in ("1", "") else f"{name} [{superscripts(unit[:LONGEST])}]".lstrip()


# Names


def text_symbol(name: str) -> str:
    """Return a name as shown: "τ₁" for "tau1", "A₁" for "A1", others unchanged."""
    parts = re.fullmatch(r"([A-Za-z]+)[ _]?(\d*)", name)
    if parts and (len(parts[1]) == 1 or parts[1] in GREEK):
        return GREEK.get(parts[1], parts[1]) + parts[2].translate(_LOWERED)
    return name


def printable(text: str) -> str:
    """Return a text without control characters, which no SVG may hold, and cut if it is endless."""
    return _CONTROL.sub("\N{REPLACEMENT CHARACTER}", text if len(text) <= LONGEST else f"{text[:LONGEST]}...")


def shortened(text: str) -> str:
    """Return a name that fits beside a chart: its beginning if it is long."""
    return text if len(text) <= _SHORT else f"{text[:_SHORT]}..."


def is_signs(name: str) -> bool:
    """Return whether the name of a mode consists of the signs of its motors ("+-+-")."""
    return bool(name) and set(name) <= {"+", "-"}
