"""`paraflex compare-methods`: time, work and error of every method of integration on one motion."""

from __future__ import annotations

import json
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from paraflex.cli.compare_tables import print_comparison
from paraflex.cli.motion import start_of
from paraflex.cli.replacing import say_replaced
from paraflex.cli.request import (
    COMPLETE,
    INTERRUPTED,
    TROUBLE,
    StudyRequest,
    at_fault,
    find_modes,
    find_path,
    of_assembly,
    plan_study,
    results_folder,
    write_json,
)
from paraflex.cli.tables import plain_console
from paraflex.compilation import compile_kernels_for
from paraflex.dynamics import build_system, consistent_state
from paraflex.errors import AssemblyError, InputError
from paraflex.files import Model, load
from paraflex.integrators import METHODS
from paraflex.integrators.methods import find_method
from paraflex.studies import Case, ComparisonOptions, MethodComparison, compare_methods, motion_case, tracking_case


@dataclass(frozen=True)
class CompareRequest(StudyRequest):
    """What `paraflex compare-methods` was asked for."""

    methods: list[str]
    tolerances: list[float]
    steps: list[float]
    limit: float | None


def compare_command(request: CompareRequest) -> int:
    """Run all methods, write what they took and how far off they are; the exit code."""
    console = plain_console(stderr=True)
    model = load(request.mechanism)
    options, methods = _options(request), _methods(request)
    # Every check that needs no computing comes before the first minute is spent.
    modes = _modes(model, request)
    folder = results_folder(request.out)
    say_replaced(folder, "comparison of methods")
    compile_kernels_for(model.mechanism, console.print)
    began = time.perf_counter()
    case = _motion(model, request) if modes is None else _tracking(model, request, modes)
    comparison = _run(console, case, methods, options)
    figures = comparison.figures() | {"parameters": _parameters(model, case, options)}
    if comparison.measurements:
        _write(figures, folder)
    if request.json:
        print(json.dumps(figures, indent=2))
    else:
        print_comparison(plain_console(), figures)
        if comparison.measurements:
            console.print(f"{time.perf_counter() - began:.1f} s; numbers and figure in {folder}", soft_wrap=True)
    if comparison.interrupted:
        return INTERRUPTED
    return COMPLETE if any(run.status == "complete" for run in comparison.measurements) else TROUBLE


def _options(request: CompareRequest) -> ComparisonOptions:
    default = ComparisonOptions()
    try:
        return ComparisonOptions(
            # A step alone asks for fixed steps alone.
            tolerances=tuple(request.tolerances) or (() if request.steps else default.tolerances),
            steps=tuple(request.steps),
            limit=default.limit if request.limit is None else request.limit,
        )
    except InputError as error:
        flag = {"tolerances": "--tol", "steps": "--step", "limit": "--limit"}[error.field]
        raise InputError(error.problem, field=flag, value=error.value, remedy=error.remedy) from None


def _methods(request: CompareRequest) -> list[str]:
    try:
        return [find_method(name).name for name in request.methods or METHODS]
    except InputError as error:
        raise InputError(error.problem, field="--method", value=error.value, remedy=error.remedy) from None


def _modes(model: Model, request: CompareRequest) -> str | None:
    """The one mode to compare in: that asked for, or the study's with most motors; None for a model without a path."""
    if model.paths or request.path is not None:
        return max(find_modes(model, request.modes), key=lambda mode: len(mode.motors)).name
    if request.modes:
        raise InputError(
            "a model without a path has no actuation modes, its torques are constant",
            field="--mode", value=request.modes[0],
            remedy="leave it out, or add a [path.NAME] table",
        )  # fmt: skip
    return None


def _tracking(model: Model, request: CompareRequest, mode: str) -> Case:
    path, name = find_path(model, request.path)
    return tracking_case(plan_study(model, model.mechanism, path, name, request), mode)


def _motion(model: Model, request: CompareRequest) -> Case:
    duration = model.study.duration if request.duration is None else request.duration
    if duration is None:
        raise InputError(
            "the model has no path, and nothing says how long it is to run",
            field="--duration",
            remedy="give it in seconds",
        )
    assembly = request.assembly or model.study.assembly
    samples = model.study.samples if request.samples is None else request.samples
    try:
        start = start_of(model, model.mechanism, assembly, balanced=False)
        system = build_system(model.mechanism)
        if start is None:
            start = consistent_state(system, model.mechanism.assembly(assembly))
        return motion_case(model.mechanism, duration, samples=samples, torques=dict(model.study.torques), start=start)
    except AssemblyError as error:
        raise of_assembly(error, model) from error
    except InputError as error:
        raise at_fault(error, model) from None


def _run(console: Console, case: Case, methods: list[str], options: ComparisonOptions) -> MethodComparison:
    columns = (BarColumn(), TextColumn("{task.completed}/{task.total}"), TimeElapsedColumn())
    text = TextColumn("{task.description}", markup=False)
    with Progress(text, *columns, console=console, transient=not console.is_terminal) as progress:
        bar = progress.add_task("", total=None)

        def report(what: str, number: int, total: int) -> None:
            progress.update(bar, description=what, completed=number, total=total)

        return compare_methods(case, methods, options=options, on_progress=report)


def _parameters(model: Model, case: Case, options: ComparisonOptions) -> dict[str, Any]:
    asked = {"mechanism": model.source, "limit": options.limit, "repetitions": options.repetitions}
    return {
        "model": dict(model.parameters),
        "run": asked | {"tolerances": list(options.tolerances), "steps": list(options.steps), "case": case.name},
    }


def _write(figures: dict[str, Any], folder: Path) -> None:
    from paraflex.plots import save_work_precision

    folder.mkdir(parents=True, exist_ok=True)
    write_json(figures, folder / "compare-methods.json")
    save_work_precision(figures, folder / "figures")
