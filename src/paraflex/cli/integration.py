"""Integration settings of a command: method, steps, constraints and events from flags or the model's [study]."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from paraflex.cli.commands.requests import conflict, flags
from paraflex.cli.commands.runs import RunRequest
from paraflex.errors import InputError
from paraflex.files import StudyDefaults
from paraflex.files.expressions import ExpressionError, evaluate
from paraflex.files.fields import check_unit
from paraflex.integrators import (
    DeflectionLimit,
    Event,
    IntegrationOptions,
    JointLimit,
    SingularDistance,
    Treatment,
    check_events,
)
from paraflex.mechanism import Mechanism
from paraflex.units import quantities_in

# Fields of a request that `IntegrationOptions` also has, and fields that kineto-elastodynamics does not use.
_OPTIONS = (
    "tolerance",
    "tolerance_per",
    "control",
    "alpha",
    "beta",
    "max_steps",
    "method",
    "step",
    "constraints",
    "automatic_gains",
)
_OF_STEPS = (*_OPTIONS, "parameters", "stop_at", "balanced", "after")
# Units of the limits of events; which of its two a joint has is known with the mechanism.
_OF_JOINT, _OF_DEFLECTION = ("rad", "m"), ("m",)
_SPECS = "joint:NAME=LOW..HIGH, deflection:BODY=METRES or singular=DISTANCE"


def given_flags(request: RunRequest) -> dict[str, object]:
    """Return the given flags on start, integration and end of a run, with their values."""
    flag = flags(request)
    values = {flag[name]: getattr(request, name) for name in _OF_STEPS}
    listed = {name: value[0] if isinstance(value, list) and value else value for name, value in values.items()}
    return {name: value for name, value in listed.items() if value not in (None, False, [])}


def integration_options(request: RunRequest, study: StudyDefaults) -> IntegrationOptions:
    """Return the options of the command line, completed by those of the study; errors name the flag."""
    given: dict[str, Any] = {name: getattr(request, name) for name in _OPTIONS}
    given["parameters"] = dict(_parameter(text) for text in request.parameters)
    given["events"] = tuple(parse_event(text) for text in request.stop_at)
    try:
        options = study.integration(given)
    except InputError as error:
        flag = flags(request)[error.field.split(".")[0]]
        value = error.field.partition(".")[2] + f"={error.value}" if "." in error.field else error.value
        remedy = error.remedy.replace("constraints = ", "--constraints ")
        raise InputError(error.problem, field=flag, value=value, remedy=remedy) from None
    _check_coefficients(request, options)
    return options


def _check_coefficients(request: RunRequest, options: IntegrationOptions) -> None:
    """Check that Baumgarte coefficients are given only for Baumgarte stabilisation without automatic gains."""
    for flag, value in (("--alpha", request.alpha), ("--beta", request.beta)):
        if value is None:
            continue
        if options.automatic_gains:
            raise conflict("has no effect with --automatic-gains", flag, value)
        if options.treatment is not Treatment.BAUMGARTE:
            raise InputError(
                f"has no effect where {options.treatment.value} keeps the constraints", field=flag, value=value,
                remedy="leave it out, or choose --constraints baumgarte with a method that has it",
            )  # fmt: skip


def _parameter(text: str) -> tuple[str, float]:
    name, sign, value = text.partition("=")
    if not (sign and name.strip()):
        raise InputError(
            "not NAME=VALUE", field="--method-parameter", value=text, remedy='write "spectral_radius=0.8"; '
            "paraflex methods lists the parameters",
        )  # fmt: skip
    return name.strip(), _number(value, "--method-parameter", text)


def parse_event(text: str) -> Event:
    """Read an event: "joint:A1=0.1..80 deg", "deflection:link1=2 mm", "singular=0.05", "singular:tau1,tau5=0.05"."""
    what, sign, value = text.rpartition("=")
    kind, colon, name = (part.strip() for part in what.partition(":"))
    named = bool(colon and name)
    if sign and kind == "joint" and named:
        return _event(JointLimit, text, name, *_range(value, text))
    if sign and kind == "deflection" and named:
        return _event(DeflectionLimit, text, name, _number(value, "--stop-at", text, _OF_DEFLECTION))
    if sign and kind == "singular" and named is bool(colon):
        motors = tuple(motor.strip() for motor in name.split(",")) if named else ()
        return _event(SingularDistance, text, _number(value, "--stop-at", text), motors)
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
    lower = _number(low, "--stop-at", text, _OF_JOINT) if low.strip() else -math.inf
    return lower, _number(high, "--stop-at", text, _OF_JOINT) if high.strip() else math.inf


def _number(value: str, flag: str, text: str, units: tuple[str, ...] = ()) -> float:
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
                        _number(limit, "--stop-at", text, _OF_JOINT[slides : slides + 1])
        except InputError as error:
            problem = f"{error.problem} {error.value}" if error.problem.startswith("unknown") else error.problem
            raise InputError(problem, field="--stop-at", value=text, remedy=error.remedy) from None


def model_parameters(request: RunRequest, mechanism: Mechanism, reduced: int | None) -> dict[str, Any]:
    """Return the settings of a run other than its integration, for provenance; `mechanism` is the one that ran."""
    return {
        "rigid": request.rigid,
        "segments": request.segments,
        "reduced": reduced,
        "ked": request.ked,
        "balanced": request.balanced,
        "assembly": request.plan.assembly,
        "max_steps": request.max_steps,
        "geometry": mechanism.geometry.value,
    } | asdict(request.frames)


def integration_parameters(options: IntegrationOptions, stop_at: Sequence[str]) -> dict[str, Any]:
    """Return the integration settings of a run, for provenance."""
    return {
        "tolerance": options.tolerance,
        "tolerance_per": options.tolerance_per and options.tolerance_per.value,
        "control": options.control and options.control.value,
        "alpha": options.alpha,
        "beta": options.beta,
        "method": options.method.name,
        "method_parameters": options.method.values,
        "step": options.step,
        "constraints": options.treatment.value,
        "automatic_gains": options.automatic_gains,
        "stop_at": list(stop_at),
    }
