"""`paraflex verify`: one mechanism at every fidelity and in other engines, compared."""

from __future__ import annotations

import time
from dataclasses import asdict
from pathlib import Path

from rich.console import Console

from paraflex.cli.agreement import print_agreement
from paraflex.cli.bars import counting
from paraflex.cli.commands.runs import VerifyRequest
from paraflex.cli.ending import Unwritten, exit_code, say_where, tell
from paraflex.cli.replacing import say_replaced
from paraflex.cli.request import (
    find_mode,
    find_modes,
    find_path,
    flagged,
    plan_study,
    results_folder,
    with_frames,
)
from paraflex.cli.tables import plain_console
from paraflex.compilation import compile_kernels
from paraflex.engines import ENGINES
from paraflex.errors import InputError, suggestion
from paraflex.files import load
from paraflex.mechanism import Geometry
from paraflex.studies import FIDELITIES, Verification, VerificationOptions, VerificationStudy, check_model


def verify_command(request: VerifyRequest) -> int:
    """Run all models, write what they say of each other; the exit code."""
    console = plain_console(stderr=True)
    model = load(request.model.name)
    path, path_name = find_path(model, request.path)
    modes = find_modes(model, request.modes) if request.modes else [find_mode(model, [])]
    options, mechanism = _options(request), with_frames(model.mechanism, request.frames)
    models = _models(request)
    for name in models:
        check_model(name, mechanism)
    folder = results_folder(request.out)
    say_replaced(folder, "verification")
    for geometry in Geometry:
        if geometry is Geometry.LINEAR or "second-order" in models:
            compile_kernels(geometry, console.print)
    began = time.perf_counter()
    task = plan_study(model, mechanism, path, path_name, request.plan)
    parameters = {
        "model": dict(model.parameters),
        "run": {"mechanism": model.source, "path": path_name, "modes": [mode.name for mode in modes]}
        | asdict(request.frames)
        | asdict(options)
        | {"method": options.method.name, "method_parameters": options.method.values},
    }
    study = VerificationStudy(task, modes, models, options, parameters, model.study.error)
    with counting(console) as report:
        verification = study.run(on_progress=report)
    summary, unwritten = verification.to_dict(), Unwritten()
    if any(runs.base for by_model in verification.runs.values() for runs in by_model.values()):
        verification.save(folder)
        _draw(verification, summary, folder, unwritten, report=request.report)

    def show(out: Console) -> None:
        for mode in summary["modes"]:
            print_agreement(out, summary, mode)
        say_where(began, "numbers, figures", folder, report=request.report)

    tell(summary, show, as_json=request.json)
    for mode, by_model in verification.runs.items():
        for name, runs in by_model.items():
            if runs.failure:
                console.print(f'error: mode "{mode}", {name}: {runs.failure}', soft_wrap=True)
    unwritten.say()
    return exit_code(verification.complete, interrupted=verification.interrupted)


def _options(request: VerifyRequest) -> VerificationOptions:
    for flag, value in (("--tol", request.tolerance), ("--segments", request.segments)):
        if value is not None and not 0 < value < float("inf"):
            raise InputError("must be positive", field=flag, value=value, remedy="leave it out for the default")
    given = {name: getattr(request, name) for name in ("method", "tolerance", "segments")}
    with flagged(request):
        return VerificationOptions(**{name: value for name, value in given.items() if value is not None})


def _models(request: VerifyRequest) -> list[str]:
    for flag, names, known in (("--model", request.fidelities, FIDELITIES), ("--engine", request.engines, ENGINES)):
        for name in names:
            if name not in known:
                raise InputError(f"unknown {flag[2:]}", field=flag, value=name, remedy=suggestion(name, known))
    return list(dict.fromkeys([*(request.fidelities or FIDELITIES), *request.engines]))


def _draw(verification: Verification, summary: dict, folder: Path, unwritten: Unwritten, *, report: bool) -> None:
    from paraflex.plots import save_figures

    data = verification.data
    assert data is not None
    with unwritten.kept():
        save_figures(data, folder / "figures")
    if report:
        from paraflex.report import save_page, verification_page

        with unwritten.kept():
            save_page(verification_page(data, summary), folder / "report.html")
