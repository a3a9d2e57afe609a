"""Text and units of the figures: symbols of names, signs of modes, prefixes that suit a range."""

from __future__ import annotations

import math
import re
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_GREEK = ("alpha", "beta", "gamma", "delta", "theta", "phi", "psi", "tau", "omega")


class Quantity(NamedTuple):
    """What an axis shows: its name, its symbol (empty where there is none) and its unit."""

    name: str
    symbol: str
    unit: str


# The one list of what axes are called; {} is a direction.
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
    "torque": Quantity("torque", r"$\tau$", "N m"),
    "force": Quantity("force", "", "N"),
    "energy": Quantity("energy", "", "J"),
    "condition": Quantity("condition number", "", "1"),
    "flexible": Quantity("modal coordinate", r"$\eta$", "mm kg$^{1/2}$"),
    "wall_time": Quantity("wall time", "", "s"),
}


def axis_label(quantity: str, *, unit: str | None = None, direction: str = "", short: bool = False) -> str:
    """Name, symbol and unit of an axis: "torque τ [N m]"; numbers without a unit have no brackets.

    Parameters
    ----------
    quantity : str
        One of `QUANTITIES`.
    unit : str, optional
        That values are shown in, where it is not the quantity's own.
    direction : str
        "x" or "y", of a symbol that has one.
    short : bool
        Whether the symbol is enough, if there is one: below a title that names the quantity.
    """
    described = QUANTITIES[quantity]
    mark = described.symbol.replace("{}", direction)
    text = " ".join(part for part in ("" if short and mark else described.name, mark) if part)
    unit = described.unit if unit is None else unit
    return text if unit == "1" else f"{text} [{unit}]"


# What a metric is called in print; others go by their own names.
METRIC_NAMES = {
    "tracking_rms_motion": "RMS error in the motion",
    "tracking_max_motion": "largest error in the motion",
    "tracking_rms_after": "RMS error after the motion",
    "tracking_max_after": "largest error after the motion",
    "tracking_rms": "RMS tracking error",
    "tracking_max": "largest tracking error",
    "residual_vibration": "residual vibration",
    "drift_speed": "drift after the motion",
    "deflection_max": "largest deflection",
    "peak_torque_max": "peak torque",
    "rms_torque_norm": "RMS torque",
    "motor_energy": "energy of the motors",
    "strain_energy_max": "largest strain energy",
    "kinetic_energy_max": "largest kinetic energy",
    "total_mass": "mass",
    "actuation_condition_max": "largest condition number",
}


def metric_name(metric: str) -> str:
    """What a metric is called in print: "RMS tracking error"; "peak torque of tau1" of one motor's."""
    name, dot, motor = metric.partition(".")
    return plain(METRIC_NAMES.get(name, name.replace("_", " ")) + (f" of {motor}" if dot else ""))


def effort_label(units: str) -> str:
    """Motors that turn give torques, motors that slide forces."""
    if units in ("N m", "N"):
        return axis_label("torque" if units == "N m" else "force")
    return f"torque, force [{units}]"


class DisplayUnit(NamedTuple):
    """A unit to show values in: its name, and what values in SI are multiplied by."""

    name: str
    factor: float


_PREFIXES = {
    "m": (DisplayUnit("mm", 1e3), DisplayUnit("µm", 1e6), DisplayUnit("nm", 1e9)),
    "rad": (DisplayUnit("rad", 1.0), DisplayUnit("mrad", 1e3), DisplayUnit("µrad", 1e6)),
}


def display_unit(unit: str, values: ArrayLike) -> DisplayUnit:
    """The unit for lengths ("m") or angles ("rad") that shows the largest of `values` with few leading zeros."""
    largest, choices = peak(values), _PREFIXES[unit]
    if largest == 0.0:
        return choices[0]
    return next((choice for choice in choices if largest * choice.factor >= 0.1), choices[-1])


def peak(values: ArrayLike) -> float:
    """Largest finite magnitude; zero where there is none."""
    magnitudes = np.abs(np.asarray(values, dtype=float))
    return float(np.max(magnitudes, initial=0.0, where=np.isfinite(magnitudes)))


def three_digits(value: float) -> str:
    """A value to three significant digits: 48.0, 0.377, 120; 0."""
    return f"{value:#.3g}".rstrip(".") if value else "0"


def power_of_ten(value: float) -> str:
    """A power of ten as print shows it: "10⁻⁵"; anything else as a plain number."""
    exponent = round(math.log10(value)) if value > 0.0 else 0
    if not math.isclose(value, 10.0**exponent, rel_tol=1e-9):
        return f"{value:g}"
    return "10" + str(exponent).translate(_RAISED)


def logarithmic_number(value: float) -> str:
    """A number of a logarithmic axis: 0.001 to 5000 plainly, others as "10⁻⁵" or "2·10⁻⁵"."""
    if value <= 0.0 or 0.999e-3 <= value < 0.999e4:
        return f"{value:g}"
    exponent = math.floor(math.log10(value) + 1e-9)
    digits = f"{value / 10.0**exponent:.3g}"
    return ("" if digits == "1" else f"{digits}·") + "10" + str(exponent).translate(_RAISED)


def symbol(name: str) -> str:
    """A name as print shows it: "A1" and "tau1" as symbols with a subscript, "link1" as "link 1", others unchanged."""
    parts = re.fullmatch(r"([A-Za-z]+)[ _]?(\d*)", name)
    if parts is None:
        return name.replace("$", r"\$")
    letters, number = parts.groups()
    if len(letters) == 1 or letters in _GREEK:
        letter = letters if len(letters) == 1 else rf"\{letters}"
        return rf"${letter}_{{{number}}}$" if number else f"${letter}$"
    return f"{letters} {number}".rstrip()


def plain(name: str) -> str:
    """A name that is not read as mathematics."""
    return name.replace("$", r"\$")


def mode_label(name: str) -> str:
    """A mode's name; signs in circles, as the paper writes them, where it is a row of signs."""
    if is_signs(name):
        return name.replace("+", "⊕").replace("-", "⊖")
    return name.replace("$", r"\$")


def is_signs(name: str) -> bool:
    """Whether a mode is named by the signs of its motors ("+-+-")."""
    return bool(name) and set(name) <= {"+", "-"}
