"""`paraflex verify`: one mechanism at every fidelity and in other engines, compared."""

from __future__ import annotations

import json
import time
from dataclasses import asdict, dataclass
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from paraflex.cli.agreement import print_agreement
from paraflex.cli.replacing import say_replaced
from paraflex.cli.request import (
    COMPLETE,
    INTERRUPTED,
    TROUBLE,
    StudyRequest,
    find_modes,
    find_path,
    plan_study,
    report_too,
    results_folder,
    with_frames,
    write_json,
)
from paraflex.cli.tables import plain_console, warn_of_doubts
from paraflex.compilation import compile_kernels
from paraflex.engines import ENGINES
from paraflex.errors import InputError, suggestion
from paraflex.files import load
from paraflex.integrators import find_method
from paraflex.mechanism import ActuationMode, Geometry
from paraflex.results import save_results
from paraflex.simulate import TrackingTask
from paraflex.studies import FIDELITIES, Verification, VerificationOptions, agreement, check_model, verify


@dataclass(frozen=True)
class VerifyRequest(StudyRequest):
    """What `paraflex verify` was asked for."""

    engines: list[str]
    fidelities: list[str]
    segments: int | None
    tolerance: float | None = None
    method: str | None = None
    reference: str | None = None
    curvature: str | None = None


def verify_command(request: VerifyRequest) -> int:
    """Run all models, write what they say of each other; the exit code."""
    console = plain_console(stderr=True)
    model = load(request.mechanism)
    path, path_name = find_path(model, request.path)
    modes = find_modes(model, request.modes)
    if not request.modes:
        modes = [max(modes, key=lambda mode: len(mode.motors))]
    options, mechanism = _options(request), with_frames(model.mechanism, request.reference, request.curvature)
    models = _models(request)
    for name in models:
        check_model(name, mechanism)
    folder = results_folder(request.out)
    say_replaced(folder, "verification")
    for geometry in Geometry:
        if geometry is Geometry.LINEAR or "second-order" in models:
            compile_kernels(geometry, console.print)
    began = time.perf_counter()
    task = plan_study(model, mechanism, path, path_name, request)
    verification = _run(console, task, modes, models, options)
    parameters = {
        "model": dict(model.parameters),
        "run": {"mechanism": model.source, "path": path_name, "modes": [mode.name for mode in modes]}
        | {"reference": request.reference, "curvature": request.curvature}
        | asdict(options),
    }
    figures = agreement(verification, model.study.error) | {"parameters": parameters}
    if any(runs.base for by_model in verification.runs.values() for runs in by_model.values()):
        _write(verification, figures, parameters, folder, report=request.report)
    warn_of_doubts(console if request.json else plain_console(), figures)
    if request.json:
        print(json.dumps(figures, indent=2))
    else:
        out = plain_console()
        for mode in figures["modes"]:
            print_agreement(out, figures, mode)
        console.print(f"{time.perf_counter() - began:.1f} s; numbers, figures{report_too(request)} in {folder}")
    for mode, by_model in verification.runs.items():
        for name, runs in by_model.items():
            if runs.failure:
                console.print(f'error: mode "{mode}", {name}: {runs.failure}', soft_wrap=True)
    if verification.interrupted:
        return INTERRUPTED
    return COMPLETE if verification.complete else TROUBLE


def _options(request: VerifyRequest) -> VerificationOptions:
    for flag, value in (("--tol", request.tolerance), ("--segments", request.segments)):
        if value is not None and not 0 < value < float("inf"):
            raise InputError("must be positive", field=flag, value=value, remedy="leave it out for the default")
    default = VerificationOptions()
    try:
        method = find_method(default.method if request.method is None else request.method).name
    except InputError as error:
        raise InputError(error.problem, field="--method", value=error.value, remedy=error.remedy) from None
    return VerificationOptions(
        method=method,
        tolerance=default.tolerance if request.tolerance is None else request.tolerance,
        segments=default.segments if request.segments is None else request.segments,
    )


def _models(request: VerifyRequest) -> list[str]:
    for flag, names, known in (("--model", request.fidelities, FIDELITIES), ("--engine", request.engines, ENGINES)):
        for name in names:
            if name not in known:
                raise InputError(f"unknown {flag[2:]}", field=flag, value=name, remedy=suggestion(name, known))
    return list(dict.fromkeys([*(request.fidelities or FIDELITIES), *request.engines]))


def _run(
    console: Console, task: TrackingTask, modes: list[ActuationMode], models: list[str], options: VerificationOptions
) -> Verification:
    columns = (BarColumn(), TextColumn("{task.completed}/{task.total}"), TimeElapsedColumn())
    text = TextColumn("{task.description}", markup=False)
    with Progress(text, *columns, console=console, transient=not console.is_terminal) as progress:
        bar = progress.add_task("", total=None)

        def report(what: str, number: int, total: int) -> None:
            progress.update(bar, description=what, completed=number, total=total)

        return verify(task, modes, models=models, options=options, on_progress=report)


def _write(verification: Verification, figures: dict, parameters: dict, folder: Path, *, report: bool) -> None:
    from paraflex.plots import save_agreement_figures

    folder.mkdir(parents=True, exist_ok=True)
    write_json(figures, folder / "verify.json")
    data = verification.dataset(parameters=parameters, error=figures["error"])
    save_results(data, folder / "verify.nc")
    save_agreement_figures(data, folder / "figures")
    if report:
        from paraflex.report import save_page, verification_page

        save_page(verification_page(data, figures), folder / "report.html")
