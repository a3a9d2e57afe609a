"""Actuation modes by their names, their signs or their motors."""

from __future__ import annotations

from collections.abc import Sequence

from paraflex.arguments import checked_arguments
from paraflex.errors import InputError
from paraflex.mechanism.mechanism import Mechanism
from paraflex.mechanism.members import ActuationMode
from paraflex.mechanism.quantities import known

# The paper prints circled signs; some keyboards and many PDFs give these instead of plain ASCII.
_SIGNS = str.maketrans({"⊕": "+", "⊖": "-", "−": "-", "–": "-"})


@checked_arguments()
def mode_of_signs(mechanism: Mechanism, signs: str) -> ActuationMode:
    """The mode a sign string names, one sign a motor: "+" active, "-" passive (Table 1).

    Raises
    ------
    InputError
        Any other character, or a wrong number of them.
    """
    plain = signs.translate(_SIGNS)
    names = [motor.name for motor in mechanism.motors]
    if len(plain) != len(names) or set(plain) - {"+", "-"}:
        raise InputError(
            "not an actuation mode",
            field="mode",
            value=signs,
            remedy=f"write one + or - for each of the {len(names)} motors ({', '.join(names)}), or motor names",
        )
    return ActuationMode(plain, tuple(name for name, sign in zip(names, plain, strict=True) if sign == "+"))


@checked_arguments()
def mode_of_motors(mechanism: Mechanism, names: Sequence[str]) -> ActuationMode:
    """The mode in which just these motors are active, named by its sign string.

    Raises
    ------
    InputError
        An unknown motor, or one named twice.
    """
    motors = [motor.name for motor in mechanism.motors]
    for name in names:
        known(name, motors, "mode", "motor")
    if len(set(names)) != len(names):
        raise InputError("a motor is named twice", field="mode", value=",".join(names), remedy="name each once")
    return mode_of_signs(mechanism, "".join("+" if name in names else "-" for name in motors))


@checked_arguments()
def parse_mode(mechanism: Mechanism, text: str) -> ActuationMode:
    """Read a mode: its name in the mechanism, signs ("+-+-"), or motor names ("tau1,tau5")."""
    for mode in mechanism.modes:
        if text == mode.name:
            return mode
    names = [part.strip() for part in text.split(",")]
    if all(name in {motor.name for motor in mechanism.motors} for name in names):
        return mode_of_motors(mechanism, names)
    return mode_of_signs(mechanism, text.strip())
