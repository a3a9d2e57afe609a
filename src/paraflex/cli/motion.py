"""`paraflex run` of a mechanism without a path, under its loads, prescribed angles and given torques."""

import time
import warnings
from collections.abc import Sequence
from dataclasses import asdict, replace

from rich.progress import TimeElapsedColumn

from paraflex.checks import check
from paraflex.compilation import compile_kernels_for
from paraflex.control import ControllerDescription
from paraflex.designs.measure import metric_figures, metrics_of
from paraflex.designs.own_motion import own_run
from paraflex.dynamics import State, build_system, standing_system
from paraflex.dynamics.state import nearest_state
from paraflex.errors import ControllerError, InputError, IntegrationError, ResultWarning, ValidityWarning, renamed
from paraflex.figures.controllers import controller_table
from paraflex.figures.reduction import reduced_words
from paraflex.files import Model, StudyDefaults
from paraflex.findings import DONE_STATUSES
from paraflex.folders import RUN
from paraflex.formatting import number, output_unit, quantity
from paraflex.integrators import IntegrationOptions
from paraflex.mechanism import Mechanism
from paraflex.mechanism.masses import check_masses
from paraflex.motion import MotionRun, state_at
from paraflex.reduced_bodies import AUTO, reduced_mechanism, size_of
from paraflex.results import motion_dataset, motion_summary
from paraflex.results.findings import validity_line
from paraflex.results.metrics import MOTION, keep_metrics
from paraflex.results.reduced_runs import compared_with_full
from .bars import late_bar
from .collected import collected
from .commands.options import PlanChoice
from .commands.requests import flagged
from .commands.runs import RunRequest
from .ending import drawing, exit_code, print_location, print_results, write_numbers
from .integration import kept_coordinates, locating_reduction, run_parameters
from .replacing import hold_results
from .request import acting_controllers, command_provenance, controller_arguments, locating_errors
from .run_lines import load_lines, metric_lines
from .tables import PlainConsole, print_table

# Largest number of singular positions listed.
_MOST_TIMES = 4
# Largest number of points listed at the end of a run.
_MOST_POINTS = 20
# Coordinates below this share of the largest are rounding errors.
_ROUNDING = 1e-12


def run_motion(request: RunRequest, model: Model, mechanism: Mechanism, options: IntegrationOptions) -> int:
    """Run a mechanism's own motion and write results; return the exit code."""
    with locating_errors(model):
        check_masses(mechanism)
    study = own_motion(model, request.plan)
    if request.modes:
        raise InputError(
            "a model without a path has no actuation modes, its torques are given",
            field="--mode", value=request.modes[0],
            remedy="add a [path.NAME] table, or give torques in [study]",
        )  # fmt: skip
    if request.after is not None:
        raise InputError(
            "the model has no path after which motors could be held",
            field="--after",
            value=request.after,
            remedy="leave it out",
        )
    kept = kept_coordinates(request, study)
    if kept == AUTO:
        raise InputError(
            "as few coordinates as the tolerance allows are chosen from a planned path, and there is none",
            field="study.reduced" if request.reduced is None else "--reduced", value=AUTO,
            remedy="leave it out, or give a number where beams are flexible",
        )  # fmt: skip
    with flagged(request, first=True):
        metrics_of(request.metrics, study.error, mechanism, MOTION, study.duration)
    with hold_results(request.out, RUN, force=request.force) as folder:
        console, model = PlainConsole(stderr=True), replace(model, study=study)
        compile_kernels_for(mechanism, console.print)
        began = time.perf_counter()
        controllers = acting_controllers(model, request)
        full = _simulate(console, model, mechanism, options, controllers, balanced=request.balanced)
        run = full
        # A full run that failed is no reference for a reduced one.
        if kept is not None and full.solution.status in DONE_STATUSES:
            with locating_reduction(request):
                few = reduced_mechanism(full, int(kept))
            start = None
            if not request.balanced:
                start = nearest_state(build_system(few), full.system, _first(full))
            run = _simulate(console, model, few, options, controllers, balanced=request.balanced, start=start)
        requested = {
            "duration": study.duration,
            "samples": study.samples,
            "controllers": controller_arguments(model, controllers),
        }
        parameters = command_provenance(model, requested | run_parameters(request, mechanism, options, kept))
        seen = check(model, assembly=request.plan.assembly)
        data = motion_dataset(run, options=options, parameters=parameters, findings=collected(seen))
        if run is not full:
            sizes = [size_of(one.system, _first(one)) for one in (run, full)]
            data = compared_with_full(data, motion_dataset(full, options=options), *sizes)
        if request.metrics:
            keep_metrics(data, {"": metric_figures(run, request.metrics)})
        summary = motion_summary(data)
        finished, interrupted = run.solution.status in DONE_STATUSES, run.solution.status == "interrupted"
        try:
            with drawing(data, folder, request.drawn):
                write_numbers(data, summary, folder)
                print_results(summary, lambda out: _report(out, summary), as_json=request.json)
        finally:
            if not finished:
                message = run.solution.message
                console.print_lines(f"{message}; results until then are kept" if interrupted else f"error: {message}")
        print_location(began, "results", folder.path, request.drawn, as_json=request.json)
        return exit_code(finished, interrupted=interrupted)


def _first(run: MotionRun) -> State:
    return State(0.0, run.solution.q[0], run.solution.v[0])


def _simulate(
    console: PlainConsole,
    model: Model,
    mechanism: Mechanism,
    options: IntegrationOptions,
    controllers: Sequence[ControllerDescription],
    *,
    balanced: bool = False,
    start: State | None = None,
) -> MotionRun:
    study = model.study
    try:
        with (
            locating_errors(model),
            late_bar(console, mechanism.name, study.duration, TimeElapsedColumn()) as update,
            warnings.catch_warnings(),
        ):
            begun = start or start_of(model, mechanism, study.assembly, balanced=balanced) or study.assembly
            # The table and the summary report these findings.
            warnings.simplefilter("ignore", ValidityWarning)
            warnings.simplefilter("ignore", ResultWarning)
            return own_run(
                mechanism, study, controllers, start=begun, options=options,
                on_progress=lambda reached: update(completed=reached),
            )  # fmt: skip
    except (IntegrationError, ControllerError) as error:
        return error.partial


def own_motion(model: Model, chosen: PlanChoice) -> StudyDefaults:
    """Return the study of a model without a path, with the options of the command in place of its own."""
    study = model.study.filled(**asdict(chosen))
    if study.duration is None:
        raise InputError(
            "the model has no path, and its run has no duration",
            field="--duration",
            remedy="give it in seconds",
        )
    return study


def start_of(model: Model, mechanism: Mechanism, assembly: str | None, *, balanced: bool) -> State | None:
    """Return the start state that the file describes, balanced if requested.

    None stands for the undeformed assembly, moving with its drives.
    """
    if not balanced and model.start is None:
        return None
    with renamed("--balanced", only="balanced"):
        return state_at(standing_system(mechanism, model.start, assembly), model.start, assembly, balanced=balanced)


def _ended(summary: dict) -> str:
    """Describe how a run ended: the time of its end or, after a failure, of the last sample before it."""
    status, steps, time = summary["status"], f"{summary['steps']} steps", summary["final"]["time"]
    if status in DONE_STATUSES:
        return f"{status} at t = {number(time, 6)} s, {steps}"
    return f"{status}, {steps}; " + (
        "no sample was reached" if time is None else f"the last sample is t = {number(time, 6)} s"
    )


def _report(out: PlainConsole, summary: dict) -> None:
    final = summary["final"]
    out.print(f"{summary['mechanism']}: {_ended(summary)}")
    if summary["event"]:
        out.print_lines(summary["message"])
    if (reduced := summary.get("reduction")) is not None:
        out.print_lines(
            f"{reduced_words(reduced)}: points are up to {quantity(reduced['distance'], 'm', digits=2)} from their "
            f"positions in the full run, in {number(summary['wall_time'] / reduced['full_wall_time'], 2)} of its time"
        )
    out.print_lines(*load_lines({"": summary["loads"]}), *metric_lines({"": summary}))
    print_table(out, controller_table({(): summary}))
    out.print("at the end:")
    # Points at which finite segments are connected by the program are left out.
    places = {point: at for point, at in final["point_position"].items() if None not in at and "._" not in point}
    wide = max((abs(x) for at in places.values() for x in at), default=0.0)
    unknown, shown = max(_ROUNDING * wide, summary["constraint_position_max"]), output_unit("m")
    for point, position in list(places.items())[:_MOST_POINTS]:
        x, y = (0.0 if abs(each) < unknown else each for each in position)
        out.print(f"  {point}: ({number(x, 6, factor=shown.factor)}, {number(y, 6, factor=shown.factor)}) {shown.name}")
    if len(places) > _MOST_POINTS:
        out.print(f"  and {len(places) - _MOST_POINTS} more points in results.nc")
    passed = [number(t, 6) for t in summary["singular_positions"]]
    if passed:
        more = f" and {len(passed) - _MOST_TIMES} more" if len(passed) > _MOST_TIMES else ""
        out.print(
            f"passed singular positions at t = {', '.join(passed[:_MOST_TIMES])} s{more}: joint forces have poles there"
        )
    out.print(
        f"largest violation of constraints {number(summary['constraint_position_max'], 2)} m, "
        f"imbalance of energy {number(summary['energy_balance_max'], 2)} J"
    )
    out.print_lines(validity_line({"": summary["validity"]}))
