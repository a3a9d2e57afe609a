"""Events that end a run, as --stop-at names them, and numbers in options."""

import math
from collections.abc import Sequence
from typing import Any

from paraflex.errors import InputError
from paraflex.expressions.evaluate import ExpressionError, evaluate
from paraflex.files.fields import check_unit
from paraflex.integrators import DeflectionLimit, Event, IntegrationOptions, JointLimit, SingularDistance, check_events
from paraflex.mechanism import Mechanism
from paraflex.units import quantities_in

# Units of the limits of events; which of its two a joint has is known with the mechanism.
_OF_JOINT, _OF_DEFLECTION = ("rad", "m"), ("m",)
_SPECS = "joint:NAME=LOW..HIGH, deflection:BODY=METRES or singular=DISTANCE"


def parse_event(text: str) -> Event:
    """Read an event: "joint:A1=0.1..80 deg", "deflection:link1=2 mm", "singular=0.05", "singular:tau1,tau5=0.05"."""
    what, sign, value = text.rpartition("=")
    kind, colon, name = (part.strip() for part in what.partition(":"))
    named = bool(colon and name)
    if sign and kind == "joint" and named:
        return _event(JointLimit, text, name, *_range(value, text))
    if sign and kind == "deflection" and named:
        return _event(DeflectionLimit, text, name, number_in_option(value, "--stop-at", text, _OF_DEFLECTION))
    if sign and kind == "singular" and named is bool(colon):
        motors = tuple(motor.strip() for motor in name.split(",")) if named else ()
        return _event(SingularDistance, text, number_in_option(value, "--stop-at", text), motors)
    raise InputError("not an event", field="--stop-at", value=text, remedy=f"write {_SPECS}")


def _event(kind: type, text: str, *arguments: Any) -> Event:
    try:
        return kind(*arguments)
    except InputError as error:
        raise InputError(error.problem, field="--stop-at", value=text, remedy=error.remedy) from None


def _range(value: str, text: str) -> tuple[float, float]:
    low, dots, high = value.partition("..")
    if not dots or not (low.strip() or high.strip()):
        raise InputError(
            "not a range",
            field="--stop-at",
            value=text,
            remedy="write LOW..HIGH; either may be left out, such as ..1.4",
        )
    lower = number_in_option(low, "--stop-at", text, _OF_JOINT) if low.strip() else -math.inf
    return lower, number_in_option(high, "--stop-at", text, _OF_JOINT) if high.strip() else math.inf


def number_in_option(value: str, flag: str, text: str, units: tuple[str, ...] = ()) -> float:
    """Parse a number, with or without a unit that has the dimension of one of `units`."""
    remedy = f"give one in {' or '.join(units)}, or with a unit" if units else "give one"
    try:
        number = evaluate(value, {}) if quantities_in(value) else float(value)
    except (ValueError, ExpressionError):
        number = math.nan
    if not math.isfinite(number):
        raise InputError(f'"{value.strip()}" is not a number', field=flag, value=text, remedy=remedy)
    try:
        check_unit(value, {}, units, flag, f"it in {' or '.join(units)}" if units else "a number")
    except InputError as error:
        raise InputError(error.problem, field=flag, value=text, remedy=error.remedy) from None
    return number


def check_stops(mechanism: Mechanism, options: IntegrationOptions, stop_at: Sequence[str]) -> None:
    """Check that the events of --stop-at suit the mechanism; errors name the flag."""
    for event, text in zip(options.events, stop_at, strict=True):
        try:
            check_events(mechanism, (event,))
            if isinstance(event, JointLimit):
                slides = mechanism.joint(event.joint).slides
                for limit in text.rpartition("=")[2].split("..", 1):
                    if limit.strip():
                        number_in_option(limit, "--stop-at", text, _OF_JOINT[slides : slides + 1])
        except InputError as error:
            problem = f"{error.problem} {error.value}" if error.problem.startswith("unknown") else error.problem
            raise InputError(problem, field="--stop-at", value=text, remedy=error.remedy) from None
