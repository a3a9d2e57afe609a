"""`paraflex sweep`: thousands of runs of a mechanism with varied numbers, continued when called again."""

from __future__ import annotations

import time
from pathlib import Path

from rich.console import Console

from paraflex.campaign import Progress
from paraflex.cli.bars import bars
from paraflex.cli.commands.studies import SweepRequest
from paraflex.cli.ending import exit_code, print_results
from paraflex.cli.tables import plain_console
from paraflex.compilation import compile_kernels_for
from paraflex.designs.measure import beyond_limits, coarse_runs
from paraflex.designs.sweep import SweepResult, SweepStudy
from paraflex.formatting import number, quantity
from paraflex.studies import load_sweep


def sweep_command(request: SweepRequest) -> int:
    """Run or continue a sweep; return the exit code."""
    console = plain_console(stderr=True)
    study = load_sweep(request.study)
    folder = request.folder
    compile_kernels_for(study.model().mechanism, console.print)
    result = _sweep(console, study, folder, request)
    verdict = study.setting.verdict()
    # In the printed output, findings of the verdict report which parts of paths are run.
    parts = {path: part.to_dict() for path, part in study.setting.parts().items()} if request.json else {}

    figures = {"folder": str(result.folder), "table": str(result.table), **result.to_dict()}
    session = {"fresh": result.fresh, "seconds": result.seconds, "interrupted": result.interrupted}
    more = session | {"part": parts, "verdict": verdict.to_dict()}
    print_results(figures | more, lambda _: _report(console, result), as_json=request.json, findings=verdict)
    if request.report and result.done:
        _write_report(console, folder, result)
    return exit_code(not result.done or bool(result.counts.get("complete")), interrupted=result.interrupted)


def _sweep(console: Console, study: SweepStudy, folder: Path, request: SweepRequest) -> SweepResult:
    with bars(console, "{task.completed}/{task.total} runs", "{task.fields[pace]}") as progress:
        bar = progress.add_task(study.name, total=study.runs, pace="", start=False)

        def report(at: Progress) -> None:
            left = "" if at.left is None else f", {_clock(at.left)} left"
            progress.start_task(bar)
            progress.update(bar, completed=at.done, pace=f"{number(at.rate, 3)} runs/s{left}")

        return study.run(folder, workers=request.workers.chosen, on_progress=report, limit=request.limit)


def _write_report(console: Console, folder: Path, result: SweepResult) -> None:
    """Write the report, unless the sweep was interrupted: the user should not have to wait for it."""
    from paraflex.cli.report import save_study_report

    if result.interrupted:
        console.print(f"no report: paraflex report {folder} writes it", soft_wrap=True)
        return
    save_study_report(folder, console)
    console.print(f"report: {folder / 'report.html'}", soft_wrap=True)


def _report(console: Console, result: SweepResult) -> None:
    statuses = ", ".join(f"{number} {status}" for status, number in sorted(result.counts.items()))
    plain_console().print(f"{result.done} of {result.total} runs: {statuses or 'none yet'}")
    if result.beyond:
        plain_console().print(f"warning: {beyond_limits(result.beyond)}", soft_wrap=True)
    if result.coarse:
        plain_console().print(f"warning: {coarse_runs(result.coarse)}", soft_wrap=True)
    if result.fresh:
        console.print(
            f"{result.fresh} of them in {quantity(result.seconds, 's', padded=False)} now, "
            f"{number(result.fresh / result.seconds, 3)} runs/s"
        )
    if result.complete:
        console.print(f"one table: {result.table}", soft_wrap=True)
    else:
        stopped = "interrupted; " if result.interrupted else ""
        console.print(f"{stopped}so far: {result.table}; the same command continues from there", soft_wrap=True)


def _clock(seconds: float) -> str:
    return time.strftime("%H:%M:%S", time.gmtime(seconds)) if seconds < 86_400 else f"{seconds / 86_400:.1f} days"
