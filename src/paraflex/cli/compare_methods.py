"""`paraflex compare-methods`: time, work and error of every integration method on one motion."""

import time
from typing import Any

from paraflex.compilation import compile_kernels_for
from paraflex.dynamics import build_system, consistent_state
from paraflex.errors import InputError, renamed
from paraflex.figures.methods import tables
from paraflex.files import Model
from paraflex.folders import COMPARISON
from paraflex.formatting import number
from paraflex.integrators import METHODS, find_method
from paraflex.mechanism import standing
from paraflex.studies import Case, ComparisonOptions, ComparisonStudy, motion_case, tracking_case
from .bars import counting
from .commands.requests import flagged
from .commands.runs import CompareMethodsRequest
from .ending import exit_code, print_location, print_results, write_drawn
from .motion import own_motion, start_of
from .replacing import hold_results
from .request import command_provenance, find_mode, find_path, locating_errors, plan_study, requested_model
from .tables import PlainConsole, print_table


def compare_methods_command(request: CompareMethodsRequest) -> int:
    """Run all methods, write their time, work and errors; return the exit code."""
    model = requested_model(request.model)
    options = _options(request)
    with renamed("--method"):
        methods = [find_method(name).name for name in request.methods or METHODS]
    # All checks that need no computation come before the long runs.
    mode = _mode(model, request)
    with hold_results(request.out, COMPARISON, force=request.force) as folder:
        console = PlainConsole(stderr=True)
        compile_kernels_for(model.mechanism, console.print)
        began = time.perf_counter()
        if mode is None:
            case = _motion(model, request)
        else:
            path, name = find_path(model, request.path)
            case = tracking_case(plan_study(model, model.mechanism, path, name, request.plan), mode)
        requested = {"limit": options.limit, "repetitions": options.repetitions}
        requested |= {"tolerances": list(options.tolerances), "steps": list(options.steps), "case": case.name}
        study = ComparisonStudy(case, methods, options, command_provenance(model, requested))
        with counting(console) as report:
            comparison = study.run(on_progress=report)
        summary = comparison.to_dict()
        if comparison.measurements:
            comparison.save_in(folder)
        print_results(summary, lambda out: print_comparison(out, summary), as_json=request.json, findings=())
        if comparison.measurements:
            write_drawn(summary, folder)
            print_location(began, "numbers and figure", folder.path, as_json=request.json)
        done = any(run.status == "complete" for run in comparison.measurements)
        return exit_code(done, interrupted=comparison.interrupted)


def _options(request: CompareMethodsRequest) -> ComparisonOptions:
    default = ComparisonOptions()
    with flagged(request):
        return ComparisonOptions(
            # With --step and without --tol, only fixed steps are compared.
            tolerances=tuple(request.tolerances) or (() if request.steps else default.tolerances),
            steps=tuple(request.steps),
            limit=default.limit if request.limit is None else request.limit,
        )


def _mode(model: Model, request: CompareMethodsRequest) -> str | None:
    """Return the mode to compare in: the requested one, or the study's with most motors; None without a path."""
    if model.paths or request.path is not None:
        return find_mode(model, [] if request.mode is None else [request.mode]).name
    if request.mode is not None:
        raise InputError(
            "a model without a path has no actuation modes, its torques are given",
            field="--mode", value=request.mode,
            remedy="leave it out, or add a [path.NAME] table",
        )  # fmt: skip
    return None


def _motion(model: Model, request: CompareMethodsRequest) -> Case:
    study = own_motion(model, request.plan)
    mechanism = standing(model.mechanism, study.assembly, model.start)
    assert study.duration is not None
    with locating_errors(model):
        start = start_of(model, mechanism, study.assembly, balanced=False)
        if start is None:
            start = consistent_state(build_system(mechanism), mechanism.assembly(study.assembly))
        return motion_case(mechanism, study.duration, samples=study.samples, torques=study.torques, start=start)


def print_comparison(console: PlainConsole, summary: dict[str, Any]) -> None:
    """Print errors and work of every run, time of every method to reach an error, failures, and the fastest method."""
    reference = summary["reference"]
    if reference is None:
        return
    console.print_lines(
        f"{summary['mechanism']}, {summary['case']}, {number(summary['duration'])} s. Errors are distances from "
        f"{reference['method']} at {number(reference['tolerance'])} m, known to "
        f"{number(reference['uncertainty'], 1)} m (the distance of {reference['check_method']} at "
        f"{number(reference['check_tolerance'])} m)."
    )
    for table in tables(summary):
        print_table(console, table)
    _print_reasons(console, summary["methods"])
    fastest = [f"{level} m {name}" for level, name in summary["fastest"].items() if name is not None]
    if fastest:
        console.print_lines(f"Fastest: {', '.join(fastest)}")


def _print_reasons(console: PlainConsole, methods: dict[str, Any]) -> None:
    for name, method in methods.items():
        for run in method["runs"]:
            where = f" at {_setting(run)}" if _setting(run) else ""
            if run["status"] != "complete":
                console.print_lines(f"{name}{where}: {run['status']}, {run['reason']}")
            for text in run["warnings"]:
                console.print_lines(f"{name}{where}: warning: {text}")


def _setting(run: dict[str, Any]) -> str:
    if run["step"] is not None:
        return f"{number(run['step'])} s"
    return "" if run["tolerance"] is None else f"{number(run['tolerance'])} m"
