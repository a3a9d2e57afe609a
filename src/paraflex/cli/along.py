"""`paraflex run` along paths: each path in every requested mode, with a results folder of its own."""

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any

from rich.progress import TimeElapsedColumn

from paraflex.actuation.allocation import check_mode
from paraflex.campaign import OnProgress, Progress
from paraflex.checks import check_planned
from paraflex.compilation import compile_all_kernels, compile_kernels
from paraflex.control import ControllerDescription, simulate_controlled
from paraflex.designs.measure import metrics_of
from paraflex.elastodynamics import simulate_ked
from paraflex.errors import ActuationError, InputError, SingularActuationError
from paraflex.fem import ReferenceCondition
from paraflex.files import Model
from paraflex.files.library import errors_elsewhere
from paraflex.folders import ResultsFolder
from paraflex.integrators import IntegrationOptions
from paraflex.mechanism import ActuationMode, Curvature, Geometry, Mechanism, proportional_segments
from paraflex.paths import Path
from paraflex.reduced_bodies import AUTO, Reduction, reduced_task
from paraflex.results.findings import keep_findings, verdict_of
from paraflex.results.metrics import PATH
from paraflex.studies.tracking import Simulator, StudyResult, TrackingStudy
from paraflex.tracking import TrackingRun, TrackingTask, simulate
from .bars import bars
from .collected import apart, collected
from .commands.requests import flagged
from .commands.runs import RunRequest
from .ending import drawing, exit_code, print_results, where, write_numbers
from .integration import kept_coordinates, locating_reduction, run_parameters
from .request import acting_controllers, command_provenance, controller_arguments, located_error, plan_study
from .run_lines import failures, print_beside, print_runs
from .stops import check_stops
from .tables import PlainConsole, warn_of


@dataclass(frozen=True)
class _Along:
    """Study planned along a path, and the folder of its results.

    Its lines of output begin with `whose`, which is empty for a single path.
    """

    path: str
    study: TrackingStudy
    folder: ResultsFolder
    whose: str = ""


def run_along(
    request: RunRequest,
    model: Model,
    mechanism: Mechanism,
    paths: Mapping[str, tuple[Path, ResultsFolder]],
    modes: list[ActuationMode],
    options: IntegrationOptions,
) -> int:
    """Run along paths and write results into the folders held for them; return the exit code."""
    console = PlainConsole(stderr=True)
    if request.segments is None:
        check_stops(mechanism, options, request.stop_at)
    controllers = acting_controllers(model, request)
    stiff = request.rigid or request.ked or request.segments is not None
    elsewhere = _errors_elsewhere(request, model)
    other = _in_other_geometry(mechanism) if elsewhere else None
    if other is None:
        compile_kernels(Geometry.LINEAR if stiff else mechanism.geometry, console.print)
    else:
        compile_all_kernels(console.print)
    began = time.perf_counter()
    planned = []
    # All paths are planned first, so that one that cannot be followed is refused before any run.
    for name, (path, folder) in paths.items():
        task, full, reduction = requested_tasks(request, model, mechanism, (path, name), modes, options)
        if request.segments is not None:
            check_stops(task.mechanism, options, request.stop_at)
        _check_mode(request, model, task, modes)
        with flagged(request, first=True):
            metrics_of(request.metrics, model.study.error, task.mechanism, PATH, float(task.motion.t[-1]))
        run = {
            "path": name,
            "modes": [mode.name for mode in modes],
            "duration": float(task.motion.t[-1]),
            "samples": int(task.motion.t.size),
            "after": task.after.value,
            "error": model.study.error,
            "controllers": controller_arguments(model, controllers),
        }
        kept = kept_coordinates(request, model.study)
        parameters = command_provenance(model, run | run_parameters(request, task.mechanism, options, kept))
        findings = check_planned(model, task, name, modes, request.plan.assembly)
        method, error = own_method(request, options, controllers), model.study.error
        study = TrackingStudy(
            task, modes, options, parameters, method, error, warning=False, findings=findings, full=full,
            reduction=reduction, metrics=request.metrics,
            beside=None if other is None else task.remodelled(other), elsewhere=elsewhere,
        )  # fmt: skip
        planned.append(_Along(name, study, folder, f'path "{name}": ' if len(paths) > 1 else ""))
    return _run(request, model, planned, _model_name(request, mechanism), began)


def _check_mode(request: RunRequest, model: Model, task: TrackingTask, modes: Sequence[ActuationMode]) -> None:
    """Check that the only mode can drive the mechanism somewhere; one of several fails without the others."""
    if len(modes) > 1:
        return
    try:
        check_mode(task.effort, modes[0])
    except SingularActuationError:
        return
    except ActuationError as error:
        field, source = ("--mode", "") if request.modes else (f"mode.{modes[0].name}", model.source)
        raise InputError(error.problem, field=field, remedy=error.remedy, source=source) from error


def _errors_elsewhere(request: RunRequest, model: Model) -> dict[str, dict[str, dict[str, float]]]:
    """Return errors from other sources for the study of a library mechanism; empty if anything about it is changed."""
    same = ("model", "modes", "out", "force", "drawn", "json")
    plain = RunRequest(**{name: getattr(request, name) for name in same})
    return errors_elsewhere(model.text) if request == plain and not model.settings else {}


def _in_other_geometry(mechanism: Mechanism) -> Mechanism | None:
    """Return a mechanism of linear beams with the default geometry and frames of beams; None for any other."""
    if mechanism.geometry is not Geometry.LINEAR:
        return None
    frames = mechanism.with_beams(reference=ReferenceCondition.PINNED, curvature=Curvature.SEPARATE)
    return frames.with_geometry(Geometry.SECOND_ORDER)


def requested_tasks(
    request: RunRequest,
    model: Model,
    mechanism: Mechanism,
    along: tuple[Path, str],
    modes: Sequence[ActuationMode],
    options: IntegrationOptions,
) -> tuple[TrackingTask, TrackingTask | None, Reduction | None]:
    """Plan a path as it is run: with all coordinates, in finite segments, or with few coordinates.

    The second task is the plan with all coordinates, to be run for comparison, if a number of coordinates is requested.
    """
    task = plan_study(model, mechanism, *along, request.plan, request.after)
    if request.segments is not None:
        return task.in_segments(proportional_segments(mechanism, request.segments)), None, None
    kept = kept_coordinates(request, model.study)
    if kept is None:
        return task, None, None
    with locating_reduction(request):
        few, reduction = reduced_task(task, kept, options.tolerance_for(task.system), modes)
    return few, None if kept == AUTO else task, reduction


def _run(request: RunRequest, model: Model, planned: Sequence[_Along], fidelity: str, began: float) -> int:
    """Run along one path after the other; return the exit code.

    If a later path fails, the results of earlier ones are kept and printed.
    """
    console, alone, places = PlainConsole(stderr=True), len(planned) == 1, []
    # Results by path, and the same as plain values, which take a while to make.
    done: dict[str, StudyResult] = {}
    numbers: dict[str, dict[str, Any]] = {}

    def show(out: PlainConsole) -> None:
        results = {"" if alone else path: result for path, result in done.items()}
        plain = {"" if alone else path: one for path, one in numbers.items()}
        print_runs(out, results, plain, planned[0].study.task, fidelity)

    try:
        for along in planned:
            with apart():
                result, plain = _simulated(console, model, along)
                if result.data is None:
                    done[along.path], numbers[along.path] = result, plain
                    failures(console, result, along.whose)
                else:
                    with _drawing(console, request, along, result):
                        write_numbers(result.data, plain, along.folder)
                        done[along.path], numbers[along.path] = result, plain
                        if alone:
                            if not request.json:
                                print_beside(PlainConsole(), result.data)
                            print_results(plain, show, as_json=request.json)
                        else:
                            warn_of(PlainConsole(stderr=request.json), verdict_of(result.data), along.whose)
                    places.append(where(began, "results", along.folder.path, request.drawn))
            if result.interrupted:
                break
            began = time.perf_counter()
    finally:
        if done and not alone:
            print_results({"paths": numbers}, show, as_json=request.json, findings=())
        if not request.json:
            console.print_lines(*places)
    well = len(done) == len(planned) and all(result.complete for result in done.values())
    return exit_code(well, interrupted=any(result.interrupted for result in done.values()))


def _simulated(console: PlainConsole, model: Model, along: _Along) -> tuple[StudyResult, dict[str, Any]]:
    """Run all modes along a path, and return their results, also as plain values."""
    try:
        with _progress(console, along) as report:
            result = along.study.run(on_progress=report)
    except InputError as error:
        warn_of(console, collected(along.study.findings), along.whose)
        raise located_error(error, model) from None
    if result.data is None:
        warn_of(console, collected(along.study.findings), along.whose)
    else:
        keep_findings(result.data, collected(verdict_of(result.data)))
    return result, result.to_dict()


@contextmanager
def _drawing(console: PlainConsole, request: RunRequest, along: _Along, result: StudyResult) -> Iterator[None]:
    """Draw while the block writes the numbers, and print which modes failed."""
    assert result.data is not None
    try:
        with drawing(result.data, along.folder, request.drawn):
            yield
    finally:
        failures(console, result, along.whose)


def own_method(
    request: RunRequest, options: IntegrationOptions, controllers: Sequence[ControllerDescription]
) -> Simulator | None:
    """Return the simulator of each mode; None for the study's default."""
    if request.ked:
        return simulate_ked
    if controllers:
        return partial(simulate_controlled, controllers=controllers, options=options, balanced=request.balanced)
    if not request.balanced:
        return None

    def from_equilibrium(task: TrackingTask, mode: str | ActuationMode, *, on_progress=None) -> TrackingRun:
        return simulate(task.balanced(mode), mode, options=options, on_progress=on_progress, warning=False)

    return from_equilibrium


def _model_name(request: RunRequest, mechanism: Mechanism) -> str:
    if request.rigid:
        return "rigid"
    if request.ked:
        return "kineto-elastodynamics"
    return f"{mechanism.geometry.value} geometry" if request.segments is None else "finite segments"


@contextmanager
def _progress(console: PlainConsole, along: _Along) -> Iterator[OnProgress]:
    """Show a progress bar for each mode; yield the callback that updates them."""
    task = along.study.task
    end = float(task.motion.t[-1])
    with bars(console, "{task.completed:.3f}/{task.total:.3f} s", TimeElapsedColumn()) as progress:
        names = [task.mode(mode).name for mode in along.study.modes]
        of_mode = {name: progress.add_task(f"{along.whose}{name}", total=end, start=False) for name in names}

        def report(at: Progress) -> None:
            progress.start_task(of_mode[at.doing])
            progress.update(of_mode[at.doing], completed=at.done)

        yield report
