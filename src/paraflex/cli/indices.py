"""`paraflex indices`: dependence of metrics on parameters over their whole ranges, by Sobol indices."""

from __future__ import annotations

from typing import Any

from rich.console import Console

from paraflex.cli import COMPLETE, signals
from paraflex.cli.bars import bars
from paraflex.cli.commands.studies import IndicesRequest
from paraflex.cli.ending import print_results
from paraflex.cli.tables import plain_console, print_table
from paraflex.compilation import compile_kernels_for
from paraflex.figures.search import index_table
from paraflex.plots import save_figures
from paraflex.studies import load_indices
from paraflex.studies.optimisation.indices import IndicesResult


def indices_command(request: IndicesRequest) -> int:
    """Run or continue the study and print the indices; return the exit code."""
    console = plain_console(stderr=True)
    study = load_indices(request.study, request.metrics, request.samples, request.seed)
    compile_kernels_for(study.sweep.model().mechanism, console.print)
    with bars(console, "{task.completed}/{task.total}") as progress:
        bar = progress.add_task(study.sweep.name, total=study.sweep.runs)
        result = study.run(
            request.folder, workers=request.workers.chosen,
            on_progress=lambda at: progress.update(bar, completed=at.done),
        )  # fmt: skip
    if not result.complete:
        console.print(
            f"interrupted; so far: {result.sweep.table}; the same command continues from there", soft_wrap=True
        )
        return signals.exit_code()
    numbers = result.to_dict()
    verdict = study.sweep.setting.verdict()

    def show(out: Console) -> None:
        _report(out, result, numbers)
        console.print(f"indices: {result.table}; every run: {result.sweep.table}", soft_wrap=True)

    print_results(numbers | {"verdict": verdict.to_dict()}, show, as_json=request.json, findings=verdict)
    save_figures(numbers, request.folder / "figures")
    return COMPLETE


def _report(console: Console, result: IndicesResult, found: dict[str, Any]) -> None:
    print_table(console, index_table(found))
    indices = result.indices
    for k, dropped in enumerate(indices["dropped"].values):
        if dropped:
            share = f"{dropped} of {dropped + indices['samples'].values[k]} base samples"
            where = ", ".join(filter(None, (str(indices[name].values[k]) for name in ("metric", "path", "mode"))))
            console.print(f"{where}: {share} left out: not all their runs are complete", soft_wrap=True)
