"""`paraflex sweep` and `paraflex indices`: thousands of runs with varied numbers, continued when called again."""

import time
from typing import Any

from paraflex.campaign import Progress
from paraflex.compilation import compile_kernels_for
from paraflex.designs.measure import beyond_limits, coarse_runs
from paraflex.designs.sweep import SweepResult, SweepStudy
from paraflex.figures.search import index_table
from paraflex.formatting import number, quantity
from paraflex.studies import IndicesResult, load_indices, load_sweep
from . import COMPLETE, signals
from .bars import bars
from .commands.studies import IndicesRequest, SweepRequest
from .ending import exit_code, print_results
from .tables import PlainConsole, in_units_of, print_table


def sweep_command(request: SweepRequest) -> int:
    """Run or continue a sweep; return the exit code."""
    console = PlainConsole(stderr=True)
    study = in_units_of(load_sweep(request.study))
    compile_kernels_for(study.model().mechanism, console.print)
    result = _sweep(console, study, request)
    verdict = study.setting.verdict()
    # In the printed output, findings of the verdict report which parts of paths are run.
    parts = {path: part.to_dict() for path, part in study.setting.parts().items()} if request.json else {}

    figures = {"folder": str(result.folder), "table": str(result.table), **result.to_dict()}
    session = {"fresh": result.fresh, "seconds": result.seconds, "interrupted": result.interrupted}
    more = session | {"part": parts, "verdict": verdict.to_dict()}
    print_results(figures | more, lambda out: _report(out, console, result), as_json=request.json, findings=verdict)
    if request.shard is not None:
        console.print_lines(f"paraflex sweep {request.study} --output {request.folder} joins all parts")
    elif request.report and result.done:
        _write_report(console, result)
    return exit_code(not result.done or bool(result.counts.get("complete")), interrupted=result.interrupted)


def _sweep(console: PlainConsole, study: SweepStudy, request: SweepRequest) -> SweepResult:
    with bars(console, "{task.completed}/{task.total} runs", "{task.fields[pace]}") as progress:
        bar = progress.add_task(study.name, total=None if request.shard else study.runs, pace="", start=False)

        def report(at: Progress) -> None:
            left = "" if at.left is None else f", {_clock(at.left)} left"
            progress.start_task(bar)
            progress.update(bar, completed=at.done, total=at.total, pace=f"{number(at.rate, 3)} runs/s{left}")

        given = {"workers": request.workers.chosen, "limit": request.limit, "shard": request.shard}
        return study.run(request.folder, on_progress=report, **given)


def _write_report(console: PlainConsole, result: SweepResult) -> None:
    """Write the report, unless the sweep was interrupted: the user should not have to wait for it."""
    from paraflex.studies.report import report  # its import takes a while

    if result.interrupted:
        console.print_lines(f"no report: paraflex report {result.folder} writes it")
        return
    report(result, on_progress=console.print_lines).save(result.folder / "report.html")
    console.print_lines(f"report: {result.folder / 'report.html'}")


def _report(out: PlainConsole, console: PlainConsole, result: SweepResult) -> None:
    statuses = ", ".join(f"{number} {status}" for status, number in sorted(result.counts.items()))
    out.print(f"{result.done} of {result.total} runs: {statuses or 'none yet'}")
    if result.beyond:
        out.print_lines(f"warning: {beyond_limits(result.beyond)}")
    if result.coarse:
        out.print_lines(f"warning: {coarse_runs(result.coarse)}")
    if result.fresh:
        console.print(
            f"{result.fresh} of them in {quantity(result.seconds, 's', padded=False)} now, "
            f"{number(result.fresh / result.seconds, 3)} runs/s"
        )
    if result.complete:
        console.print_lines(f"one table: {result.table}")
    else:
        stopped = "interrupted; " if result.interrupted else ""
        console.print_lines(f"{stopped}so far: {result.table}; the same command continues from there")


def _clock(seconds: float) -> str:
    return time.strftime("%H:%M:%S", time.gmtime(seconds)) if seconds < 86_400 else f"{seconds / 86_400:.1f} days"


def indices_command(request: IndicesRequest) -> int:
    """Run or continue the study and print the indices; return the exit code."""
    console = PlainConsole(stderr=True)
    study = load_indices(request.study, request.metrics, request.samples, request.seed)
    in_units_of(study.sweep)
    compile_kernels_for(study.sweep.model().mechanism, console.print)
    with bars(console, "{task.completed}/{task.total}") as progress:
        bar = progress.add_task(study.sweep.name, total=study.sweep.runs)
        result = study.run(
            request.folder, workers=request.workers.chosen,
            on_progress=lambda at: progress.update(bar, completed=at.done),
        )  # fmt: skip
    if not result.complete:
        console.print_lines(f"interrupted; so far: {result.sweep.table}; the same command continues from there")
        return signals.exit_code()
    numbers = result.to_dict()
    verdict = study.sweep.setting.verdict()

    def show(out: PlainConsole) -> None:
        _report_indices(out, result, numbers)
        console.print_lines(f"indices: {result.table}; every run: {result.sweep.table}")

    print_results(numbers | {"verdict": verdict.to_dict()}, show, as_json=request.json, findings=verdict)
    from paraflex.plots import save_figures  # its import takes a second

    save_figures(numbers, request.folder / "figures")
    return COMPLETE


def _report_indices(console: PlainConsole, result: IndicesResult, found: dict[str, Any]) -> None:
    print_table(console, index_table(found))
    indices = result.indices
    for k, dropped in enumerate(indices["dropped"].values):
        if dropped:
            share = f"{dropped} of {dropped + indices['samples'].values[k]} base samples"
            where = ", ".join(filter(None, (str(indices[name].values[k]) for name in ("metric", "path", "mode"))))
            console.print_lines(f"{where}: {share} left out: not all their runs are complete")
