"""`paraflex run`: read, plan, simulate every mode under a progress bar, write, report."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from typing import Any

from rich.console import Console
from rich.progress import TimeElapsedColumn

from paraflex.campaign import OnProgress, Progress
from paraflex.checks import check_planned
from paraflex.cli.bars import bars
from paraflex.cli.collected import collected
from paraflex.cli.commands.runs import RunRequest
from paraflex.cli.ending import exit_code, tell
from paraflex.cli.integration import check_stops, given_flags, integration_options, integration_parameters
from paraflex.cli.motion import run_motion
from paraflex.cli.replacing import hold_results
from paraflex.cli.request import (
    asked_model,
    at_fault,
    find_modes,
    find_path,
    flagged,
    plan_study,
    with_frames,
)
from paraflex.cli.tables import failures, loads, plain_console, print_study, validity, warn_of
from paraflex.cli.writing import write_drawn_run, write_numbers
from paraflex.compilation import compile_kernels
from paraflex.elastodynamics import simulate_ked
from paraflex.errors import InputError
from paraflex.files import Model
from paraflex.folders import RUN, ResultsFolder
from paraflex.integrators import IntegrationOptions
from paraflex.kinematics import Path
from paraflex.mechanism import ActuationMode, Geometry, Mechanism, finite_segments, proportional_segments
from paraflex.results.doubts import keep_findings, verdict_of
from paraflex.studies import Simulator, TrackingStudy
from paraflex.tracking import TrackingRun, TrackingTask, simulate


def run_command(request: RunRequest) -> int:
    """Run a study and write its results; the exit code."""
    console = plain_console(stderr=True)
    model = asked_model(request.model)
    _check_fidelity(request)
    options = integration_options(request, model.study)
    how = {} if request.ked else integration_parameters(options, request.stop_at)
    if not model.paths and request.path is None:
        mechanism = _without_path(model, request)
        check_stops(mechanism, options, request.stop_at)
        return run_motion(request, model, mechanism, options, console, how)
    along = find_path(model, request.path)
    modes = find_modes(model, request.modes)
    # Every check that needs no computing comes before the first minute is spent.
    with hold_results(request.out, RUN, force=request.force) as folder:
        return _run_along(request, model, along, modes, options, how, folder)


def _run_along(
    request: RunRequest,
    model: Model,
    along: tuple[Path, str],
    modes: list[ActuationMode],
    options: IntegrationOptions,
    how: dict[str, Any],
    folder: ResultsFolder,
) -> int:
    """Run along a path, and its name; write results into a folder that is held."""
    console, (path, path_name) = plain_console(stderr=True), along
    mechanism = asked_mechanism(model, request)
    if request.segments is None:
        check_stops(mechanism, options, request.stop_at)
    stiff = request.rigid or request.ked or request.segments is not None
    compile_kernels(Geometry.LINEAR if stiff else mechanism.geometry, console.print)
    began = time.perf_counter()
    task = plan_study(model, mechanism, path, path_name, request.plan, request.after)
    if request.segments is not None:
        task = task.in_segments(proportional_segments(mechanism, request.segments))
        check_stops(task.mechanism, options, request.stop_at)
    parameters = _parameters(model, path_name, modes, task, how, request)
    doubts = check_planned(model, task, path_name, modes, request.plan.assembly)
    study = TrackingStudy(
        task, modes, options, parameters, _method(request, options), model.study.error, warning=False, findings=doubts
    )
    try:
        with _progress(console, task, modes) as report:
            result = study.run(on_progress=report)
    except InputError as error:
        warn_of(console, collected(doubts))
        raise at_fault(error, model) from None
    if result.data is None:
        warn_of(console, collected(doubts))
        failures(console, result)
        return exit_code(False, interrupted=result.interrupted)
    keep_findings(result.data, collected(verdict_of(result.data)))
    summary = result.to_dict()
    write_numbers(result.data, summary, folder)

    def show(out: Console) -> None:
        print_study(out, summary, task, _model_name(request, mechanism))
        validity(out, {name: mode.get("validity") for name, mode in summary["modes"].items()})
        loads(out, {name: mode.get("loads", {}) for name, mode in summary["modes"].items()})

    tell(summary, show, as_json=request.json)
    try:
        write_drawn_run(result.data, folder, request, began)
    finally:
        failures(console, result)
    return exit_code(result.complete, interrupted=result.interrupted)


def _method(request: RunRequest, options: IntegrationOptions) -> Simulator | None:
    """How each mode is run where it is not by the study's own way."""
    if request.ked:
        return simulate_ked
    if not request.balanced:
        return None

    def from_equilibrium(task: TrackingTask, mode: str | ActuationMode, *, on_progress=None) -> TrackingRun:
        return simulate(task.balanced(mode), mode, options=options, on_progress=on_progress, warning=False)

    return from_equilibrium


def _without_path(model: Model, request: RunRequest) -> Mechanism:
    if request.ked:
        raise InputError("the model has no path to prescribe", field="--ked", remedy="add a [path.NAME] table")
    mechanism = asked_mechanism(model, request)
    if request.segments is None:
        return mechanism
    if model.start is not None:
        raise InputError(
            "the file's [start] speaks of links that are not cut", field="--segments", value=request.segments,
            remedy="leave one of them out",
        )  # fmt: skip
    return finite_segments(mechanism, proportional_segments(mechanism, request.segments)).mechanism


def _check_fidelity(request: RunRequest) -> None:
    """The four fidelities and finite segments exclude one another; KED has a step of its own."""
    chosen = {
        "--rigid": request.rigid,
        "--segments": request.segments is not None,
        "--ked": request.ked,
        "--geometry": request.geometry is not None,
    }
    asked = [flag for flag, given in chosen.items() if given]
    if len(asked) > 1:
        raise InputError("cannot be combined", field=asked[0], value=" ".join(asked), remedy="choose one of them")
    for name, given in asdict(request.frames).items():
        if given is not None and (request.rigid or request.segments is not None):
            raise InputError(
                f"means nothing with {asked[0]}", field=f"--{name}", value=given, remedy="leave one of them out"
            )
    if request.segments is not None and request.segments < 1:
        raise InputError("must be positive", field="--segments", value=request.segments, remedy="say 8")
    for flag, value in given_flags(request).items():
        if request.ked:
            remedy = "its steps are fixed, its start undeformed, its motors held"
            raise InputError("means nothing with --ked", field=flag, value=value, remedy=remedy)


def _model_name(request: RunRequest, mechanism: Mechanism) -> str:
    if request.rigid:
        return "rigid"
    if request.ked:
        return "kineto-elastodynamics"
    return f"{mechanism.geometry.value} geometry" if request.segments is None else "finite segments"


def asked_mechanism(model: Model, request: RunRequest) -> Mechanism:
    """The mechanism at the fidelity asked for."""
    mechanism = model.mechanism.rigid() if request.rigid else model.mechanism
    mechanism = with_frames(mechanism, request.frames)
    if request.geometry is None:
        return mechanism
    with flagged(request):
        return mechanism.with_geometry(request.geometry)


def _parameters(
    model: Model, path: str, modes: list[ActuationMode], task: TrackingTask, how: dict, request: RunRequest
) -> dict:
    return {
        "model": dict(model.parameters),
        "run": {
            "mechanism": model.source,
            "set": dict(model.settings),
            "path": path,
            "modes": [mode.name for mode in modes],
            "duration": float(task.motion.t[-1]),
            "samples": int(task.motion.t.size),
            "rigid": request.rigid,
            "segments": request.segments,
            "ked": request.ked,
            "balanced": request.balanced,
            "after": task.after.value,
            "error": model.study.error,
            "geometry": task.mechanism.geometry.value,
        }
        | asdict(request.frames)
        | how,
    }


@contextmanager
def _progress(console: Console, task: TrackingTask, modes: list[ActuationMode]) -> Iterator[OnProgress]:
    """A bar of each mode."""
    end = float(task.motion.t[-1])
    with bars(console, "{task.completed:.3f}/{task.total:.3f} s", TimeElapsedColumn()) as progress:
        of_mode = {mode.name: progress.add_task(mode.name, total=end, start=False) for mode in modes}

        def report(at: Progress) -> None:
            progress.start_task(of_mode[at.doing])
            progress.update(of_mode[at.doing], completed=at.done)

        yield report
