"""Common parts of commands that simulate a study: model, paths, modes, controllers, plan, and errors."""

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from typing import Any

from paraflex.control.laws.described import NONE, ControllerDescription
from paraflex.errors import AssemblyError, InconsistentConstraintsError, InputError, UnreachablePathError, renamed
from paraflex.files import Model, generator_names, library_names, load, load_path
from paraflex.files.outside import may_be_outside
from paraflex.files.overlay import value_of
from paraflex.formatting import prefer_units
from paraflex.mechanism import ActuationMode, Mechanism
from paraflex.paths import Path as EndEffectorPath
from paraflex.tracking import TrackingTask
from paraflex.validity import likely_cause
from . import BAD_INPUT
from .commands.options import FramesChoice, ModelChoice, PlanChoice
from .commands.requests import flagged
from .commands.runs import RunRequest
from .tables import PlainConsole


def requested_model(choice: ModelChoice) -> Model:
    """Load the requested model, with the values of --set."""
    found = {}
    for text in choice.settings:
        name, equals, value = text.partition("=")
        if name.strip() and equals and not value.strip():
            raise InputError("has no value", field=f"--set {name.strip()}", remedy=f'write "{name.strip()}=0.3"')
        if not (name.strip() and equals):
            raise InputError("not FIELD=VALUE", field="--set", value=text, remedy='write "link1.length=0.3"')
        found[name.strip()] = value_of(value.strip())
    model = load(choice.name, set=found)
    prefer_units(model.parameters.get("units", {}))
    return model


def without_model(command: str) -> int:
    """Print the mechanisms of the library and the ways to run one's own; return the exit code."""
    console, names = PlainConsole(stderr=True), library_names()
    console.print_lines(f"error: no model is named; paraflex {command} NAME takes a mechanism of the library:")
    width = max(map(len, names))
    console.print_lines(*(f"  {name:<{width}}  {load(name).mechanism.description}" for name in names))
    console.print_lines(
        f"or one of any size: {', '.join(generator_names())}",
        f"paraflex {command} FILE.toml takes your own; paraflex new NAME writes such a file to edit",
    )
    return BAD_INPUT


def command_provenance(model: Model, run: Mapping[str, Any]) -> dict[str, Any]:
    """Return the provenance of a command: parameters of the model, its file, --set and the settings of the run."""
    source = {"mechanism": model.source, "set": dict(model.settings)}
    if may_be_outside():
        source["allow_outside"] = True
    return {"model": dict(model.parameters), "run": source | dict(run)}


def with_frames(mechanism: Mechanism, frames: FramesChoice) -> Mechanism:
    """Return the mechanism with the requested frames and curvature of all beams; None leaves them unchanged."""
    with flagged(frames):
        return mechanism.with_beams(reference=frames.reference, curvature=frames.curvature)


def find_path(model: Model, name: str | None) -> tuple[EndEffectorPath, str]:
    """Return a path of the model or of a file, and its name."""
    if name is not None and name not in model.paths and name.endswith(".toml"):
        return load_path(name), name
    name = model.path_name(name)
    return model.paths[name], name


def find_paths(model: Model, names: Sequence[str]) -> dict[str, EndEffectorPath]:
    """Return the requested paths of the model or of files by name; by default the study's first, or the model's."""
    found = {}
    for name in names or (None,):
        path, called = find_path(model, name)
        if called in found:
            raise InputError("is named twice", field="--path", value=called, remedy="name each path once")
        found[called] = path
    return found


def find_modes(model: Model, names: list[str]) -> list[ActuationMode]:
    """Return the requested modes, or the study's."""
    with renamed("--mode"):
        modes = model.modes(names)
    if not modes:
        raise InputError(
            "no actuation mode to run",
            field="--mode",
            remedy="name one (paraflex modes lists what there is), or add [study] modes to the file",
        )
    return list(modes)


def acting_controllers(model: Model, request: RunRequest) -> tuple[ControllerDescription, ...]:
    """Return the requested controllers, or the study's."""
    with locating_errors(model):
        found = model.acting(request.controllers)
    if found and request.ked:
        raise InputError(
            "has no effect with --ked, which holds motors on the rigid motion", field="--controller",
            value=found[0].name, remedy=f"give --controller {NONE}",
        )  # fmt: skip
    if found and not model.paths and not request.paths and model.study.torques:
        raise InputError(
            "given torques and controllers cannot act in the same run", field="study.torques",
            value=", ".join(model.study.torques), remedy=f"leave one of them out, or give --controller {NONE}",
            source=model.source,
        )  # fmt: skip
    return found


def controller_arguments(model: Model, acting: Sequence[ControllerDescription]) -> list[str]:
    """Return the controllers of a run as values of --controller."""
    return [one.name for one in acting] or ([NONE] if model.study.controllers else [])


def find_mode(model: Model, names: list[str]) -> ActuationMode:
    """Return the mode with most motors, of those requested or of the study."""
    return max(find_modes(model, names), key=lambda mode: len(mode.motors))


def plan_study(
    model: Model,
    mechanism: Mechanism,
    path: EndEffectorPath,
    path_name: str,
    chosen: PlanChoice,
    after: str | None = None,
) -> TrackingTask:
    """Plan the study along a path; errors name the option or field at fault."""
    with locating_errors(model):
        try:
            return model.plan(path, mechanism=mechanism, **asdict(chosen), after=after, warning=False)
        except UnreachablePathError as error:
            raise InputError(error.problem, field=f"path.{path_name}", remedy=error.remedy) from error


def check_time(at: float) -> None:
    """Check that the value of --at is a time at which a motion may be."""
    if not (math.isfinite(at) and at >= 0.0):
        raise InputError("not a time of the motion", field="--at", value=at, remedy="give it in s, not negative")


@contextmanager
def locating_errors(model: Model) -> Iterator[None]:
    """Convert errors of input, assembly and start in the context to errors that name the option or file at fault."""
    try:
        yield
    except AssemblyError as error:
        raise of_assembly(error, model) from error
    except InconsistentConstraintsError as error:
        field = "prescribed" if model.mechanism.prescribed else "start"
        raise InputError(error.problem, field=field, remedy=error.remedy, source=model.source) from error
    except InputError as error:
        raise located_error(error, model) from error.__cause__


def of_assembly(error: AssemblyError, model: Model) -> InputError:
    """Return the error of a mechanism that cannot be assembled, naming the model's file."""
    # Links that are far too soft bend, instead of moving, when the loops are closed.
    remedy = likely_cause(model.mechanism) or error.remedy
    return InputError(error.problem, field="assembly", remedy=remedy, source=model.source)


def located_error(error: InputError, model: Model) -> InputError:
    """Return the same error, naming the option it came from or else the model's file."""
    flags = {
        "duration": "--duration",
        "samples": "--samples",
        "tolerance": "--tol",
        "method": "--method",
        "controllers": "--controller",
        "assembly": "--assembly",
        "after": "--after",
        "events": "--stop-at",
    }
    if error.field in flags:
        return error.at(flags[error.field])
    return error.in_file(model.source)


def conflict(problem: str, flag: str, value: object) -> InputError:
    """Return the error of an option that does not go with another."""
    return InputError(problem, field=flag, value=value, remedy="leave one of them out")
