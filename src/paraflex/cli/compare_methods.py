"""`paraflex compare-methods`: time, work and error of every integration method on one motion."""

from __future__ import annotations

import time
from typing import Any

from rich.console import Console

from paraflex.cli.bars import counting
from paraflex.cli.commands.requests import flagged
from paraflex.cli.commands.runs import CompareMethodsRequest
from paraflex.cli.ending import exit_code, say_where, tell
from paraflex.cli.motion import own_motion, start_of
from paraflex.cli.replacing import hold_results
from paraflex.cli.request import asked_model, asked_of, blaming, find_mode, find_path, plan_study
from paraflex.cli.tables import number, plain_console, plain_table, print_titled
from paraflex.cli.writing import write_drawn
from paraflex.compilation import compile_kernels_for
from paraflex.dynamics import build_system, consistent_state
from paraflex.errors import InputError, renamed
from paraflex.files import Model
from paraflex.folders import COMPARISON, ResultsFolder
from paraflex.integrators import METHODS
from paraflex.integrators.methods import DEFAULT_METHOD, find_method, title_of
from paraflex.mechanism import standing
from paraflex.studies import Case, ComparisonOptions, ComparisonStudy, motion_case, tracking_case

_KEPT = {
    "gap\n[m]": "constraint_position_max",
    "its rate\n[m/s]": "constraint_velocity_max",
    "energy\n[J]": "energy_balance_max",
}
_COUNTS = {
    "steps\n": "steps",
    "rejected\n": "rejected",
    "Newton\niter.": "newton_iterations",
    "factor-\nings": "factorisations",
    "evalu-\nations": "evaluations",
}
_SETTING = "tol. [m],\nstep [s]"


def compare_methods_command(request: CompareMethodsRequest) -> int:
    """Run all methods, write their time, work and errors; return the exit code."""
    model = asked_model(request.model)
    options = _options(request)
    with renamed("--method"):
        methods = [find_method(name).name for name in request.methods or METHODS]
    # All checks that need no computation come before the long runs.
    mode = _mode(model, request)
    with hold_results(request.out, COMPARISON, force=request.force) as folder:
        return _compare(request, model, mode, methods, options, folder)


def _compare(
    request: CompareMethodsRequest,
    model: Model,
    mode: str | None,
    methods: list[str],
    options: ComparisonOptions,
    folder: ResultsFolder,
) -> int:
    """Run all methods in a mode, None without a path; write results into the held folder and return the exit code."""
    console = plain_console(stderr=True)
    compile_kernels_for(model.mechanism, console.print)
    began = time.perf_counter()
    if mode is None:
        case = _motion(model, request)
    else:
        path, name = find_path(model, request.path)
        case = tracking_case(plan_study(model, model.mechanism, path, name, request.plan), mode)
    asked = {"limit": options.limit, "repetitions": options.repetitions}
    asked |= {"tolerances": list(options.tolerances), "steps": list(options.steps), "case": case.name}
    study = ComparisonStudy(case, methods, options, asked_of(model, asked))
    with counting(console) as report:
        comparison = study.run(on_progress=report)
    summary = comparison.to_dict()
    if comparison.measurements:
        comparison.save_in(folder)
    tell(summary, lambda out: print_comparison(out, summary), as_json=request.json, doubts=())
    if comparison.measurements:
        write_drawn(summary, folder)
        if not request.json:
            say_where(began, "numbers and figure", folder.path)
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
    with blaming(model):
        start = start_of(model, mechanism, study.assembly, balanced=False)
        if start is None:
            start = consistent_state(build_system(mechanism), mechanism.assembly(study.assembly))
        return motion_case(mechanism, study.duration, samples=study.samples, torques=study.torques, start=start)


def print_comparison(console: Console, summary: dict[str, Any]) -> None:
    """Print errors and work of every run, time of every method to reach an error, failures, and the fastest method."""
    reference = summary["reference"]
    if reference is None:
        return
    console.print(
        f"{summary['mechanism']}, {summary['case']}, {summary['duration']:g} s. Errors are distances from "
        f"{reference['method']} at {reference['tolerance']:g} m, known to {reference['uncertainty']:.0e} m "
        f"(the distance of {reference['check_method']} at {reference['check_tolerance']:g} m).",
        soft_wrap=True,
    )
    done = {
        name: [run for run in method["runs"] if run["status"] == "complete"]
        for name, method in summary["methods"].items()
    }
    if any(done.values()):
        _print_tables(console, summary, [(name, run) for name, runs in done.items() for run in runs])
    _print_reasons(console, summary["methods"])
    fastest = [f"{level} m {name}" for level, name in summary["fastest"].items() if name is not None]
    if fastest:
        console.print(f"Fastest: {', '.join(fastest)}", soft_wrap=True)


def _print_tables(console: Console, summary: dict[str, Any], done: list[tuple[str, dict[str, Any]]]) -> None:
    """Print the tables of the complete runs, each of which comes with the name of its method."""
    uncertainty = summary["reference"]["uncertainty"]
    precision = (
        [
            name,
            _setting(run),
            f"{run['error']:.1e}" if run["error"] > uncertainty else f"<{uncertainty:.0e}",
            f"{run['wall_time']:.3g}",
            *(number(run[key], ".1e") for key in _KEPT.values()),
        ]
        for name, run in done
    )
    table = plain_table("method", numbers=(_SETTING, "error\n[m]", "wall\n[s]", *_KEPT), rows=precision)
    print_titled(console, "Error, time, violation of constraints, imbalance of energy", table)
    work = ([name, _setting(run), *(str(run[key]) for key in _COUNTS.values())] for name, run in done)
    print_titled(console, "Work", plain_table("method", numbers=(_SETTING, *_COUNTS), rows=work))
    levels, methods = list(summary["fastest"]), {name: summary["methods"][name] for name, _ in done}
    times = (
        [name, *(number(one["time_to_reach"][level], ".3g") for level in levels), number(one["relative_time"], ".2f")]
        for name, one in methods.items()
    )
    relative = f"x {title_of(DEFAULT_METHOD)}"
    table = plain_table("method", numbers=(*(f"{level} m" for level in levels), relative), rows=times)
    print_titled(console, "Wall time to an error [s]; the last column at 1e-5 m", table)


def _print_reasons(console: Console, methods: dict[str, Any]) -> None:
    for name, method in methods.items():
        for run in method["runs"]:
            where = f" at {_setting(run)}" if _setting(run) else ""
            if run["status"] != "complete":
                console.print(f"{name}{where}: {run['status']}, {run['reason']}", soft_wrap=True)
            for text in run["warnings"]:
                console.print(f"{name}{where}: warning: {text}", soft_wrap=True)


def _setting(run: dict[str, Any]) -> str:
    if run["step"] is not None:
        return f"{run['step']:g} s"
    return "" if run["tolerance"] is None else f"{run['tolerance']:g}"
