"""Common parts of the commands that search for designs: run, progress bar, output, figures, exit code."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from rich.console import Console

from paraflex.campaign import Progress
from paraflex.cli import signals
from paraflex.cli.bars import bars
from paraflex.cli.commands.studies import SearchRequest
from paraflex.cli.ending import exit_code, print_results
from paraflex.cli.tables import plain_console, print_table
from paraflex.compilation import compile_kernels_for
from paraflex.figures.search import tables
from paraflex.formatting import number, quantity
from paraflex.plots import save_figures
from paraflex.studies.optimisation.identify import IdentificationResult
from paraflex.studies.optimisation.optimise import OptimisationResult
from paraflex.studies.optimisation.study import DesignStudy

R = TypeVar("R", OptimisationResult, IdentificationResult)
Report = Callable[[Console, R], None]


def search_command(request: SearchRequest, study: DesignStudy[R], report: Report[R], what: str) -> int:
    """Run or continue a search, print its result and write its figures; return the exit code."""
    console = plain_console(stderr=True)
    compile_kernels_for(study.base.model().mechanism, console.print)
    result = _with_bar(console, study, request, what)
    if result.interrupted and not result.values:
        console.print("interrupted before the first design was done")
        return signals.exit_code()
    numbers = result.to_dict()
    verdict = study.base.setting.verdict()

    def show(out: Console) -> None:
        for table in tables(numbers, result.units):
            print_table(out, table)
        report(out, result)
        _print_ending(console, result, request.folder)

    more = {"folder": str(result.folder), "fresh": result.fresh, "verdict": verdict.to_dict()}
    print_results(numbers | more, show, as_json=request.json, findings=verdict)
    if not result.interrupted:
        save_figures(numbers, request.folder / "figures")
    return exit_code(bool(result.values), interrupted=result.interrupted)


def _with_bar(console: Console, study: DesignStudy[R], request: SearchRequest, what: str) -> R:
    with bars(console, "{task.completed} designs, at most {task.total}", "{task.fields[best]}") as progress:
        bar = progress.add_task(study.name, total=study.search.evaluations, best="")

        def show_progress(at: Progress) -> None:
            best = "" if at.best is None else f"{what} {number(at.best)}"
            progress.update(bar, completed=at.done, best=best)

        return study.run(request.folder, workers=request.workers.chosen, on_progress=show_progress)


def _print_ending(console: Console, result: OptimisationResult | IdentificationResult, folder: Path) -> None:
    out = plain_console()
    failed = f", {result.failed} of them failed" if result.failed else ""
    out.print(f"{result.evaluations} designs{failed}; {result.stopped}")
    for reason in result.reasons[:1]:
        console.print(f"a design that failed: {reason}", soft_wrap=True)
    console.print(f"{result.fresh} designs in {quantity(result.seconds, 's', padded=False)} now")
    if result.interrupted:
        console.print(f"interrupted; so far: {result.table}; the same command continues from there", soft_wrap=True)
    else:
        console.print(f"every run: {result.table}; the best mechanism: {folder / 'best.toml'}", soft_wrap=True)
