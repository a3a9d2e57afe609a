"""Actuation modes, looked up by their names, signs or motors."""

from collections.abc import Sequence
from dataclasses import replace

from paraflex.arguments import checked_arguments
from paraflex.errors import InputError
from .joints import Motor
from .mechanism import Mechanism
from .members import ActuationMode
from .quantities import known

# The paper prints circled signs; some keyboards and many PDFs have these in place of plain ASCII.
_SIGNS = str.maketrans({"⊕": "+", "⊖": "-", "−": "-", "–": "-"})

# Word behind a mode whose motors follow the planned motion.
SERVO = "servo"


@checked_arguments()
def mode_of_signs(mechanism: Mechanism, signs: str) -> ActuationMode:
    """Return the actuation mode of a sign string with one sign per motor: "+" active, "-" passive (Table 1).

    Raises
    ------
    InputError
        The string has another character, or a wrong number of signs.
    """
    plain = signs.translate(_SIGNS)
    names = [motor.name for motor in mechanism.motors]
    if len(plain) != len(names) or set(plain) - {"+", "-"}:
        raise InputError(
            "not an actuation mode",
            field="mode",
            value=signs,
            remedy=f"write one + or - for each of the {len(names)} motors ({', '.join(names)}), or motor names, and "
            f'"{SERVO}" behind them for motors that follow the plan',
        )
    return ActuationMode(plain, tuple(name for name, sign in zip(names, plain, strict=True) if sign == "+"))


@checked_arguments()
def mode_of_motors(mechanism: Mechanism, names: Sequence[str]) -> ActuationMode:
    """Return the actuation mode in which exactly the given motors are active, named by its sign string.

    Raises
    ------
    InputError
        A motor is unknown or named twice.
    """
    motors = [motor.name for motor in mechanism.motors]
    for name in names:
        known(name, motors, "mode", "motor")
    if len(set(names)) != len(names):
        raise InputError("a motor is named twice", field="mode", value=",".join(names), remedy="name each once")
    return mode_of_signs(mechanism, "".join("+" if name in names else "-" for name in motors))


@checked_arguments()
def parse_mode(mechanism: Mechanism, text: str) -> ActuationMode:
    """Return the actuation mode of a text: a name in the mechanism, signs ("+-+-"), or motor names ("tau1,tau5").

    With "servo" behind it, "+-+- servo", the active motors follow the planned motion exactly.
    """
    for mode in mechanism.modes:
        if text == mode.name:
            return mode
    plain, space, last = text.strip().rpartition(" ")
    if space and last == SERVO and not plain.endswith(f" {SERVO}"):
        return following(parse_mode(mechanism, plain))
    names = [part.strip() for part in text.split(",")]
    if all(name in {motor.name for motor in mechanism.motors} for name in names):
        return mode_of_motors(mechanism, names)
    return mode_of_signs(mechanism, text.strip())


def following(mode: ActuationMode) -> ActuationMode:
    """Return the mode of the same motors, which follow the planned motion."""
    return mode if mode.follows else replace(mode, name=f"{mode.name} {SERVO}", follows=True)


def followers(motors: Sequence[Motor], mode: ActuationMode) -> list[Motor]:
    """Return the active ones of motors that hold their joints on the planned motion."""
    return [motor for motor in motors if motor.name in mode.motors and (mode.follows or motor.follows)]


def check_torques(mode: ActuationMode, what: str, motors: Sequence[Motor] = ()) -> None:
    """Check that a mode and these motors give torques, for what cannot hold them on the planned motion.

    Raises
    ------
    InputError
        A motor follows the planned motion.
    """
    following = followers(motors, mode)
    if mode.follows or following:
        field, value, remedy = (
            ("mode", mode.name, f'leave out "{SERVO}"')
            if mode.follows
            else (f"motor.{following[0].name}.follows", "plan", "leave it out")
        )
        raise InputError(
            f"{what} needs given torques, and a motor of this mode follows the planned motion", field=field,
            value=value, remedy=remedy,
        )  # fmt: skip
