"""Texts of printed figures: mathematics of symbols, labels of axes."""

from __future__ import annotations

import re
from typing import NamedTuple

from paraflex.formatting import GREEK, LONGEST, ROUNDING, printable, text_symbol
from paraflex.results.metrics import metric_label

# Letters of symbols in mathematics.
_LETTERS = {letter: rf"\{name}" for name, letter in GREEK.items()} | {"φ": r"\varphi"}
_DOTS = {"\u0307": r"\dot ", "\u0308": r"\ddot ", "": ""}
_RAISED_BACK = str.maketrans("₀₁₂₃₄₅₆₇₈₉", "0123456789")
# A Greek letter, a Latin one with dots or a number, or one alone before a unit or before a colon at the beginning, as a
# symbol within a text.
_SYMBOL = re.compile(
    rf"(?<![^\W\d_])(?:([{''.join(_LETTERS)}])([\u0307\u0308]?)([₀-₉]*)|([A-Za-z])(?:([\u0307\u0308])([₀-₉]*)|()([₀-₉]+)"
    r"|(?= \[)|(?<=^.)(?=: )))(?![^\W\d_])"
)


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
    return text if unit == "1" else f"{text} [{unit[:LONGEST]}]"


def metric_name(metric: str) -> str:
    """Return the label of a metric: "RMS tracking error"; "peak torque of tau1" for a metric of one motor."""
    return plain(metric_label(metric))


def effort_label(units: str) -> str:
    """Return the axis label of motor efforts: torques, forces of linear motors, or both."""
    if units in ("N m", "N"):
        return axis_label("torque" if units == "N m" else "force")
    return f"torque, force [{units}]"


def three_digits(value: float) -> str:
    """Format a value with three significant digits: 48.0, 0.377, 120; zero and rounding errors give 0."""
    return f"{value:#.3g}".rstrip(".") if not abs(value) < ROUNDING else "0"


def symbol(name: str) -> str:
    """Return a name as shown in figures: "A1" and "tau1" as symbols with a subscript, others unchanged."""
    return mathematics(text_symbol(name))


def mathematics(text: str) -> str:
    """Return a text with its symbols as mathematics: "travel of A₁ [mm]", "τ₁", "φ̇", and a single letter "x"."""
    if len(text) == 1 and text.isascii() and text.isalpha():
        return f"${text}$"
    return _SYMBOL.sub(_mathematics, plain(text))


def _mathematics(found: re.Match[str]) -> str:
    groups = found.groups(default="")
    letter, dots, number = groups[:3] if groups[0] else (groups[3], groups[4], groups[5] or groups[7])
    lower = number.translate(_RAISED_BACK)
    inner = _DOTS[dots] + _LETTERS.get(letter, letter)
    return f"${inner}_{{{lower}}}$" if lower else f"${inner}$"


def plain(name: str) -> str:
    """Return a printable name that Matplotlib does not parse as mathematics."""
    return printable(name).replace("$", r"\$")
