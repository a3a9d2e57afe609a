"""Linear models requested by commands: of a model at rest or in motion, or of the runs of stored results."""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from paraflex.checks import BALANCED
from paraflex.compilation import compile_kernels_for
from paraflex.dynamics import State, build_system, pose_at_rest, standing_system, undeformed
from paraflex.errors import ActuationError, AssemblyError, InputError
from paraflex.files import Model, library_names
from paraflex.files.fields import number_in
from paraflex.formatting import number, quantity
from paraflex.linear import LinearModel, linearise
from paraflex.mechanism import ActuationMode, Mechanism
from paraflex.motion import UNBALANCED, MotionRun, simulate_motion
from paraflex.paths import pose_at
from paraflex.results.linear_data import motors_of
from paraflex.tracking import TrackingRun, TrackingTask
from .commands.models import LinearRequest
from .commands.options import PlanChoice
from .commands.requests import flagged
from .request import (
    check_time,
    command_provenance,
    conflict,
    find_modes,
    find_path,
    locating_errors,
    of_assembly,
    plan_study,
    requested_model,
)
from .tables import PlainConsole

Motion = TrackingTask | TrackingRun | MotionRun
ALL, START = "all", "start"
# Largest number of instants of a motion: each is an eigenvalue problem for every mode.
_MOST_MOMENTS = 10_000
# Number of samples of a run without a path.
_SAMPLES = 1001


class RequestedModels(NamedTuple):
    """Linear models, one for each mode, with the motions that they are about (none at rest) and their provenance."""

    models: list[LinearModel]
    motions: Sequence[Motion]
    modes: list[ActuationMode]
    ports: dict[str, Any]
    parameters: dict[str, Any]
    model: Model


def requested_models(request: LinearRequest, command: str) -> Callable[[], RequestedModels]:
    """Return a function that computes the linear models, after all checks that need no computation."""
    _check(request)
    name = request.model.name
    if Path(name).suffix == ".nc" or (Path(name).is_dir() and name not in library_names()):
        return _of_results(request, command)
    model = requested_model(request.model)
    modes = _modes(model, request)
    return lambda: _models(model, modes, request, command)


def _of_results(request: LinearRequest, command: str) -> Callable[[], RequestedModels]:
    """Return a function that computes linear models about the runs of a results folder, which it repeats."""
    given = {"--set": request.model.settings, "--pose": request.pose, "--balanced": request.balanced,
             "--path": request.path, "--assembly": request.assembly}  # fmt: skip
    for flag, value in given.items():
        if value:
            raise InputError(
                "has no effect on results, which are already computed", field=flag, value=str(value),
                remedy="leave it out, or name the model",
            )  # fmt: skip
    from .repeated import repeated_runs  # imports the reports, which rebuild the command of a run

    model, runs = repeated_runs(request.model.name, [] if ALL in request.modes else request.modes)

    def models() -> RequestedModels:
        found = list(runs)
        modes = [run.mode if isinstance(run, TrackingRun) else _everything(model.mechanism) for run in found]
        made = _models(model, modes, request, command, found)
        made.parameters["run"]["results"] = request.model.name
        return made

    return models


def _check(request: LinearRequest) -> None:
    """Check the options that need no model."""
    moving = {"--at": request.at, "--along": request.along, "--path": request.path}
    for flag, value in moving.items():
        if value is None:
            continue
        for other, given in (("--pose", request.pose), ("--balanced", request.balanced or None)):
            if given is not None:
                raise conflict(f"is about a motion, {other} about rest", flag, value)
    if request.at is not None:
        check_time(request.at)
    if request.along is not None and not 2 <= request.along <= _MOST_MOMENTS:
        raise InputError(
            "not a valid number of times",
            field="--along",
            value=request.along,
            remedy=f"give from 2 to {_MOST_MOMENTS}",
        )
    if request.pose is not None and request.assembly is not None:
        raise conflict("names the pose as --pose does", "--assembly", request.assembly)


def _modes(model: Model, request: LinearRequest) -> list[ActuationMode]:
    """Return the requested modes; for "all" those of the mechanism; by default the one with most motors."""
    mechanism = model.mechanism
    own = list(mechanism.modes) or [_everything(mechanism)]
    chosen = own if ALL in request.modes else find_modes(model, request.modes) if request.modes else None
    if chosen is None:
        chosen = [max(model.modes() or own, key=lambda mode: len(mode.motors))]
    if not (mechanism.motors or request.forces or request.prescribed or mechanism.prescribed):
        raise InputError(
            f"{mechanism.name} has neither motors nor prescribed motions: a linear model of it has no inputs",
            field="--force-at", remedy="name a point at which forces act, such as "
            + next((f"{body.name}.{point}" for body in mechanism.bodies for point in body.points), "BODY.POINT"),
        )  # fmt: skip
    return chosen


def _everything(mechanism: Mechanism) -> ActuationMode:
    motors = tuple(motor.name for motor in mechanism.motors)
    return ActuationMode("all motors" if motors else "no motors", motors)


def _models(
    model: Model,
    modes: list[ActuationMode],
    request: LinearRequest,
    command: str,
    motions: Sequence[Motion] | None = None,
) -> RequestedModels:
    """Return the linear models in all modes: about the given motions, else at rest or about the planned motion."""
    ports = {"forces": request.forces, "prescribed": request.prescribed, "coordinates": request.coordinates}
    parameters = _parameters(model, modes, request, command)
    with flagged(request):
        if motions is None and request.at is None and request.along is None and request.path is None:
            pose = requested_pose(model, request.pose, request.assembly, "--pose")
            models = [_at_rest(model, pose, mode, request.balanced, ports) for mode in modes]
            return RequestedModels(models, [], modes, ports, parameters, model)
        if motions is None:
            motions = [_motion(model, request)] * len(modes)
        pairs = zip(motions, modes, strict=True)
        models = [_in_motion(motion, mode, request.at or 0.0, ports) for motion, mode in pairs]
        return RequestedModels(models, motions, modes, ports, parameters, model)


def moments_along(found: RequestedModels, count: int) -> list[list[LinearModel]]:
    """Return linear models at `count` equidistant instants of the motions, for each mode."""
    motion = found.motions[0]
    times = motion.motion.t if isinstance(motion, TrackingTask) else motion.solution.t
    moments = np.linspace(times[0], times[-1], count).tolist()
    pairs = zip(found.motions, found.modes, strict=True)
    return [[_in_motion(motion, mode, at, found.ports) for at in moments] for motion, mode in pairs]


def requested_pose(model: Model, name: str | None, assembly: str | None, flag: str) -> State:
    """Return the pose at rest that an option names; by default the model's start, or the pose of an assembly."""
    mechanism = model.mechanism
    system = standing_system(mechanism, model.start, assembly or model.study.assembly)
    try:
        if name is not None and "," in name:
            return _at_place(model, name, flag)
        if name in [one.name for one in mechanism.assemblies]:
            return pose_at_rest(standing_system(mechanism, name), None, name)
        if name is not None and (name != START or model.start is None):
            raise InputError("no such pose", field=flag, value=name, remedy=_poses(model))
        return pose_at_rest(system, model.start, assembly or model.study.assembly)
    except AssemblyError as error:
        raise of_assembly(error, model) from error


def _poses(model: Model) -> str:
    names = [one.name for one in model.mechanism.assemblies] + ([START] if model.start is not None else [])
    return f"choose from {', '.join(names)}; or give the end-effector's position, X,Y in m" if names else "leave it out"


def _at_place(model: Model, text: str, flag: str) -> State:
    """Return the undeformed pose with the end-effector at the position X,Y."""
    parts = [part.strip() for part in text.split(",")]
    effector = model.mechanism.end_effector
    if effector is None or not {"x", "y"} <= set(effector.coordinates):
        raise InputError("no end-effector with a position", field=flag, value=text, remedy="name an assembly")
    try:
        x, y = (number_in(part, "m") for part in parts)
    except (InputError, ValueError) as error:
        raise InputError(
            "not a position", field=flag, value=text, remedy='write 0.05,0.314 or "50 mm, 314 mm"'
        ) from error
    try:
        q = pose_at(model.mechanism, (x, y), assembly=model.study.assembly)
    except AssemblyError as error:
        raise InputError(
            "the end-effector cannot reach it", field=flag, value=text, remedy="choose a position within its reach"
        ) from error
    system, rigid = build_system(model.mechanism), build_system(model.mechanism.rigid())
    return undeformed(system, rigid, State(0.0, q, np.zeros(rigid.n)))


def _at_rest(model: Model, pose: State, mode: ActuationMode, balanced: bool, ports: dict[str, Any]) -> LinearModel:
    """Return the linear model about a pose; raise InputError if the mode does not hold the mechanism there."""
    try:
        found = linearise(model.mechanism, mode=mode, start=pose, balanced=balanced, **ports)
    except AssemblyError as error:
        raise InputError(error.cause, field="--balanced", remedy=UNBALANCED) from error
    # Prescribed motions are not free, although they count as motions of zero frequency.
    free = int(np.sum(found.motions(motors_of(found)).frequencies == 0.0)) - found.minimal.driven
    if free and found.unbalanced > BALANCED:
        remain = "one motion remains" if free == 1 else f"{free} motions remain"
        raise InputError(
            f"it does not hold the mechanism in this pose: with its motors held {remain} free, and when released it "
            f"would start with {quantity(found.unbalanced, 'm/s^2', padded=False)}",
            field="--mode", value=mode.name, remedy="name more motors, or give --balanced for a pose in equilibrium",
        )  # fmt: skip
    return found


def _motion(model: Model, request: LinearRequest) -> TrackingTask | MotionRun:
    """Return the planned motion or, for a model without a path, its own run until the requested time."""
    if request.path is not None or model.paths:
        path, name = find_path(model, request.path)
        return plan_study(model, model.mechanism, path, name, PlanChoice(assembly=request.assembly))
    study = model.study
    if study.duration is None:
        raise InputError(
            "the model has neither a path nor a duration of its own motion", field="--at", value=request.at,
            remedy="add [study] duration, or leave --at out",
        )  # fmt: skip
    if request.at is not None and request.at > study.duration:
        raise InputError(
            "is not a time of the motion",
            field="--at",
            value=request.at,
            remedy=f"choose one up to {number(study.duration, 6)} s",
        )
    compile_kernels_for(model.mechanism, PlainConsole(stderr=True).print)
    until = study.duration if request.along is not None or not request.at else request.at
    with locating_errors(model):
        return simulate_motion(
            model.mechanism, until, samples=_SAMPLES, torques=study.torques,
            start=model.start or request.assembly or study.assembly,
            options=study.integration({}),
        )  # fmt: skip


def _in_motion(motion: Motion, mode: ActuationMode, at: float, ports: dict[str, Any]) -> LinearModel:
    try:
        return linearise(motion, mode=mode, at=at, **ports)
    except ActuationError as error:
        raise InputError(
            f"it cannot drive this motion: {error}", field="--mode", value=mode.name, remedy="name a mode that can"
        ) from error


def _parameters(model: Model, modes: Iterable[ActuationMode], request: LinearRequest, command: str) -> dict[str, Any]:
    """Return the provenance of the linear models."""
    names = ("pose", "balanced", "at", "along", "path", "assembly", "forces", "prescribed", "coordinates")
    requested = {name: getattr(request, name) for name in names}
    run = {name: value for name, value in requested.items() if value not in (None, False, [], "motors")}
    return command_provenance(model, {command: True, "modes": [mode.name for mode in modes]} | run)
