"""Texts and units of figures and pages: symbols of names, signs of modes, prefixes of units."""

from __future__ import annotations

import math
import re
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from paraflex.results.metrics import metric_label
from paraflex.units import STRESS, DisplayUnit

_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_LOWERED = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")
_GREEK = {
    "alpha": "α", "beta": "β", "gamma": "γ", "delta": "δ", "theta": "θ", "phi": "φ", "psi": "ψ", "tau": "τ",
    "omega": "ω",
}  # fmt: skip


_CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f]")
# Longest name or unit that is shown whole.
_LONGEST = 200
# Values of a figure below this, in any unit, are rounding errors.
ROUNDING = 1e-12


class Quantity(NamedTuple):
    """Quantity of an axis: name, symbol (empty if it has none) and unit."""

    name: str
    symbol: str
    unit: str


# Quantities of all axes; {} in a symbol stands for the direction.
QUANTITIES = {
    "time": Quantity("time", "$t$", "s"),
    "angle": Quantity("angle", r"$\varphi$", "rad"),
    "angular_velocity": Quantity("angular velocity", r"$\dot\varphi$", "rad/s"),
    "angular_acceleration": Quantity("angular acceleration", r"$\ddot\varphi$", "rad/s²"),
    "position": Quantity("displacement", "${}$", "mm"),
    "velocity": Quantity("velocity", r"$\dot {}$", "m/s"),
    "acceleration": Quantity("acceleration", r"$\ddot {}$", "m/s²"),
    "displacement": Quantity("displacement", "", "mm"),
    "slope": Quantity("slope", "", "rad"),
    "error": Quantity("error", "", "mm"),
    "distance": Quantity("distance", "", "mm"),
    "speed": Quantity("speed", "", "m/s"),
    "magnitude": Quantity("acceleration", "", "m/s²"),
    "torque": Quantity("torque", r"$\tau$", "N m"),
    "force": Quantity("force", "", "N"),
    "moment": Quantity("moment", "", "N m"),
    "power": Quantity("power", "", "W"),
    "travel": Quantity("travel", "", "m"),
    "stress": Quantity("stress", "", STRESS.name),
    "place": Quantity("distance from the first end", "", "m"),
    "energy": Quantity("energy", "", "J"),
    "condition": Quantity("condition number", "", "1"),
    "flexible": Quantity("modal coordinate", r"$\eta$", "mm kg$^{1/2}$"),
    "wall_time": Quantity("wall time", "", "s"),
}


def axis_label(quantity: str, *, unit: str | None = None, direction: str = "", short: bool = False) -> str:
    """Return the label of an axis, "torque τ [N m]"; dimensionless quantities have no brackets.

    Parameters
    ----------
    quantity : str
        Key of `QUANTITIES`.
    unit : str, optional
        Unit of the shown values; by default the quantity's own.
    direction : str
        Direction "x" or "y" that is inserted into the symbol.
    short : bool
        Whether to omit the name if there is a symbol, as below a title that names the quantity.
    """
    described = QUANTITIES[quantity]
    mark = described.symbol.replace("{}", direction)
    text = " ".join(part for part in ("" if short and mark else described.name, mark) if part)
    unit = described.unit if unit is None else unit
    return text if unit == "1" else f"{text} [{unit[:_LONGEST]}]"


def metric_name(metric: str) -> str:
    """Return the label of a metric: "RMS tracking error"; "peak torque of tau1" for a metric of one motor."""
    return plain(metric_label(metric))


def effort_label(units: str) -> str:
    """Return the axis label of motor efforts: torques, forces of linear motors, or both."""
    if units in ("N m", "N"):
        return axis_label("torque" if units == "N m" else "force")
    return f"torque, force [{units}]"


_PREFIXES = {
    "m": (DisplayUnit("mm", 1e3), DisplayUnit("µm", 1e6), DisplayUnit("nm", 1e9)),
    "rad": (DisplayUnit("rad", 1.0), DisplayUnit("mrad", 1e3), DisplayUnit("µrad", 1e6)),
    "Pa": (DisplayUnit("GPa", 1e-9), STRESS),
    "N/m": (DisplayUnit("kN/mm", 1e-6), DisplayUnit("N/mm", 1e-3), DisplayUnit("N/m", 1.0)),
    "m/N": (DisplayUnit("mm/N", 1e3), DisplayUnit("µm/N", 1e6), DisplayUnit("nm/N", 1e9)),
}
# Smallest peak for which a unit is used; GPa, with a bound of its own, is for moduli, stresses are in MPa.
_LEAST, _LEAST_OF = 0.1, {"GPa": 2.0}


def display_unit(unit: str, values: ArrayLike) -> DisplayUnit:
    """Return the unit in which the largest length, angle, stress, stiffness or compliance has few digits.

    Other units are returned unchanged.
    """
    largest, choices = peak(values), display_units(unit)
    if largest == 0.0:
        return next(choice for choice in choices if choice.name not in _LEAST_OF)
    fits = (one for one in choices if largest * one.factor >= _LEAST_OF.get(one.name, _LEAST))
    return next(fits, choices[-1])


def display_units(unit: str) -> tuple[DisplayUnit, ...]:
    """Return all units in which a quantity of an SI unit may be shown, the largest first."""
    return _PREFIXES.get(unit, (DisplayUnit(unit[:_LONGEST], 1.0),))


def peak(values: ArrayLike) -> float:
    """Return the largest finite magnitude; zero if there is none."""
    magnitudes = np.abs(np.asarray(values, dtype=float))
    return float(np.max(magnitudes, initial=0.0, where=np.isfinite(magnitudes)))


def three_digits(value: float) -> str:
    """Format a value with three significant digits: 48.0, 0.377, 120; zero and rounding errors give 0."""
    return f"{value:#.3g}".rstrip(".") if not abs(value) < ROUNDING else "0"


def power_of_ten(value: float) -> str:
    """Format a power of ten with superscripts, "10⁻⁵", and any other value as a plain number."""
    exponent = round(math.log10(value)) if value > 0.0 else 0
    if not math.isclose(value, 10.0**exponent, rel_tol=1e-9):
        return f"{value:g}"
    return f"10{raised(exponent)}"


def raised(exponent: int) -> str:
    """Return an exponent in superscripts: "⁻⁵"."""
    return str(exponent).translate(_RAISED)


def logarithmic_number(value: float) -> str:
    """Format a number of a logarithmic axis: plain from 0.001 up to below 10⁴, else as "10⁻⁵" or "2·10⁻⁵"."""
    if value <= 0.0 or 0.999e-3 <= value < 0.999e4:
        return f"{value:g}"
    exponent = math.floor(math.log10(value) + 1e-9)
    digits = f"{value / 10.0**exponent:.3g}"
    return ("" if digits == "1" else f"{digits}·") + f"10{raised(exponent)}"


def symbol(name: str) -> str:
    """Return a name as shown in figures: "A1" and "tau1" as symbols with a subscript, others unchanged."""
    letters, number = _parted(name)
    if len(letters) != 1 and letters not in _GREEK:
        return plain(text_symbol(name))
    letter = letters if len(letters) == 1 else rf"\{letters}"
    return rf"${letter}_{{{number}}}$" if number else f"${letter}$"


def text_symbol(name: str) -> str:
    """Return a name as shown on pages: "τ₁" for "tau1", "A₁" for "A1", others unchanged."""
    letters, number = _parted(name)
    if len(letters) == 1 or letters in _GREEK:
        return _GREEK.get(letters, letters) + number.translate(_LOWERED)
    return name


def _parted(name: str) -> tuple[str, str]:
    """Split a name into its letters and its number; both are empty if it has another form."""
    parts = re.fullmatch(r"([A-Za-z]+)[ _]?(\d*)", name)
    return (parts[1], parts[2]) if parts else ("", "")


def printable(text: str) -> str:
    """Return a text without control characters, which no SVG may hold, and cut if it is endless."""
    return _CONTROL.sub("\N{REPLACEMENT CHARACTER}", text if len(text) <= _LONGEST else f"{text[:_LONGEST]}...")


def plain(name: str) -> str:
    """Return a printable name that Matplotlib does not parse as mathematics."""
    return printable(name).replace("$", r"\$")


def is_signs(name: str) -> bool:
    """Return whether the name of a mode consists of the signs of its motors ("+-+-")."""
    return bool(name) and set(name) <= {"+", "-"}
