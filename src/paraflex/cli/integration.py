"""Settings of a run from options or the model's [study]: method, steps, constraints, number of coordinates."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from typing import Any, Literal

from paraflex.errors import InputError
from paraflex.files import StudyDefaults
from paraflex.integrators import IntegrationOptions, Treatment
from paraflex.mechanism import Mechanism
from paraflex.reduced_bodies import AUTO
from .commands.requests import flags
from .commands.runs import RunRequest
from .request import conflict
from .stops import number_in_option, parse_event

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
    return name.strip(), number_in_option(value, "--method-parameter", text)


def run_parameters(
    request: RunRequest, mechanism: Mechanism, options: IntegrationOptions, reduced: int | str | None
) -> dict[str, Any]:
    """Return the settings of a run, for provenance; `mechanism` is the one that ran."""
    found = {
        "rigid": request.rigid,
        "segments": request.segments,
        "reduced": reduced,
        "ked": request.ked,
        "balanced": request.balanced,
        "assembly": request.plan.assembly,
        "max_steps": request.max_steps,
        "geometry": mechanism.geometry.value,
    } | asdict(request.frames)
    if request.metrics:
        found["metrics"] = list(request.metrics)
    if request.ked:  # its steps are fixed
        return found
    return found | {
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
        "stop_at": list(request.stop_at),
    }


def reduced_option(request: RunRequest) -> int | Literal["auto"] | None:
    """Return the number of flexible coordinates requested, "auto", or None."""
    text = request.reduced
    if text is None or text == AUTO:
        return text
    if not re.fullmatch(r"\d+", text, re.ASCII):
        remedy = f"give a number, {AUTO} for as few as the tolerance allows, or 0 for all"
        raise InputError("no number of flexible coordinates", field="--reduced", value=text, remedy=remedy)
    return int(text)


def kept_coordinates(request: RunRequest, study: StudyDefaults) -> int | Literal["auto"] | None:
    """Return the number of flexible coordinates that a run keeps, as requested or set in the study; None for all."""
    if request.rigid or request.ked or request.segments is not None:
        return None
    return (study.reduced if request.reduced is None else reduced_option(request)) or None


@contextmanager
def locating_reduction(request: RunRequest) -> Iterator[None]:
    """Name the option or field in errors of a reduction."""
    try:
        yield
    except InputError as error:
        if error.field not in ("coordinates", "mechanism"):
            raise
        raise error.at("study.reduced" if request.reduced is None else "--reduced") from None
