"""`paraflex run`: check of the request, then runs along paths or of the mechanism's own motion."""

from collections.abc import Iterable
from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path

from paraflex.errors import InputError
from paraflex.files import Model
from paraflex.folders import RUN
from paraflex.mechanism import Mechanism, finite_segments, proportional_segments
from paraflex.mechanism.actuation_modes import following
from paraflex.writing import portable_name
from .along import run_along
from .commands.requests import flagged
from .commands.runs import RunRequest
from .integration import given_flags, integration_options, reduced_option
from .motion import run_motion
from .replacing import hold_results
from .request import conflict, find_modes, find_paths, requested_model, with_frames, without_model
from .stops import check_stops


def run_command(request: RunRequest) -> int:
    """Run a study and write its results; return the exit code. Without a model, print what can be run."""
    if request.model.given is None:
        return without_model("run")
    model = requested_model(request.model)
    _check_fidelity(request)
    options = integration_options(request, model.study)
    if not model.paths and not request.paths:
        mechanism = _without_path(model, request)
        check_stops(mechanism, options, request.stop_at)
        return run_motion(request, model, mechanism, options)
    paths, modes = find_paths(model, request.paths or model.study.paths), find_modes(model, request.modes)
    if request.servo:
        modes = list(dict.fromkeys([*modes, *map(following, modes)]))
    # All checks that need no computation come before the long runs.
    with ExitStack() as held:
        followed = {
            name: (paths[name], held.enter_context(hold_results(folder, RUN, force=request.force)))
            for name, folder in _folders(paths, Path(request.out)).items()
        }
        return run_along(request, model, requested_mechanism(model, request), followed, modes, options)


def _folders(paths: Iterable[str], out: Path) -> dict[str, Path]:
    """Return the results folder of each path: the requested one, or a folder in it for each of several paths."""
    paths = list(paths)
    if len(paths) == 1:
        return {paths[0]: out}
    named = {path: portable_name(Path(path).stem if path.endswith(".toml") else path) for path in paths}
    for path, name in named.items():
        same = [other for other, its in named.items() if its.casefold() == name.casefold()]
        if len(same) > 1:
            raise InputError(
                f"results of {' and '.join(same)} would lie in one folder, {out / name}", field="--path", value=path,
                remedy="rename one of them, or run them one by one with --out"
            )  # fmt: skip
    return {path: out / name for path, name in named.items()}


def _without_path(model: Model, request: RunRequest) -> Mechanism:
    for flag, given in (("--ked", request.ked), ("--servo", request.servo)):
        if given:
            raise InputError("the model has no path to prescribe", field=flag, remedy="add a [path.NAME] table")
    mechanism = requested_mechanism(model, request)
    if request.segments is None:
        return mechanism
    if model.start is not None:
        raise conflict("the file's [start] refers to links that are not cut", "--segments", request.segments)
    return finite_segments(mechanism, proportional_segments(mechanism, request.segments)).mechanism


def _check_fidelity(request: RunRequest) -> None:
    """Check that at most one fidelity is requested, and that the other options go with it.

    Kineto-elastodynamics (KED) has its own fixed steps, hence no options on integration.
    """
    if request.servo and request.ked:
        raise conflict("has no effect with --ked, which holds motors on the rigid motion", "--servo", request.servo)
    chosen = {
        "--rigid": request.rigid,
        "--segments": request.segments is not None,
        "--ked": request.ked,
        "--geometry": request.geometry is not None,
    }
    requested = [flag for flag, given in chosen.items() if given]
    if len(requested) > 1:
        raise InputError(
            "cannot be combined", field=requested[0], value=" ".join(requested), remedy="choose one of them"
        )
    if reduced_option(request) and any(flag != "--geometry" for flag in requested):
        raise conflict(f"has no effect with {requested[0]}", "--reduced", request.reduced)
    for name, given in asdict(request.frames).items():
        if given is not None and (request.rigid or request.segments is not None):
            raise conflict(f"has no effect with {requested[0]}", f"--{name}", given)
    if request.segments is not None and request.segments < 1:
        raise InputError("must be positive", field="--segments", value=request.segments, remedy="give 8")
    for flag, value in given_flags(request).items():
        if request.ked:
            remedy = "its steps are fixed, its start undeformed, its motors held"
            raise InputError("has no effect with --ked", field=flag, value=value, remedy=remedy)


def requested_mechanism(model: Model, request: RunRequest) -> Mechanism:
    """Return the mechanism at the requested fidelity."""
    mechanism = model.mechanism.rigid() if request.rigid else model.mechanism
    mechanism = with_frames(mechanism, request.frames)
    if request.geometry is None:
        return mechanism
    with flagged(request):
        return mechanism.with_geometry(request.geometry)
