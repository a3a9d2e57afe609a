"""`paraflex indices`: which parameters a metric depends on, over their whole ranges."""

from __future__ import annotations

import json

from paraflex.campaign import Progress
from paraflex.cli.bars import bars
from paraflex.cli.commands.studies import IndicesRequest
from paraflex.cli.request import COMPLETE, INTERRUPTED
from paraflex.cli.tables import number, plain_console, plain_table, warn_of
from paraflex.compilation import compile_kernels_for
from paraflex.plots import save_search_figures
from paraflex.studies import IndicesResult, load_indices, sobol_indices


def indices_command(request: IndicesRequest) -> int:
    """Do what is left of the runs, and say the indices; the exit code."""
    console = plain_console(stderr=True)
    study = load_indices(request.study, request.metrics, request.samples, request.seed)
    compile_kernels_for(study.sweep.model().mechanism, console.print)
    with bars(console, "{task.completed}/{task.total}") as progress:
        bar = progress.add_task(study.sweep.name, total=study.sweep.runs)

        def tell(at: Progress) -> None:
            progress.update(bar, completed=at.done)

        result = sobol_indices(study, request.folder, on_progress=tell, **request.workers.given)
    if not result.complete:
        console.print(f"so far: {result.sweep.table}; the same command goes on from there", soft_wrap=True)
        return INTERRUPTED
    save_search_figures(result.to_dict(), request.folder / "figures")
    verdict = study.sweep.setting.verdict()
    warn_of(console if request.json else plain_console(), verdict)
    if request.json:
        print(json.dumps(result.to_dict() | {"verdict": verdict.to_dict()}, indent=2))
    else:
        _report(result)
        console.print(f"indices: {result.table}; every run: {result.sweep.table}", soft_wrap=True)
    return COMPLETE


def _report(result: IndicesResult) -> None:
    title = "Sobol indices and half the width of their intervals of 95 %"
    table = plain_table("metric", "path", "mode", "parameter", numbers=("first", "±", "total", "±"), title=title)
    for each in result.indices:
        for row in each.rows():
            keys = ("first", "first_confidence", "total", "total_confidence")
            table.add_row(each.metric, each.path, each.mode, row["parameter"], *(number(row[k], ".3f") for k in keys))
    console = plain_console()
    console.print(table)
    for each in result.indices:
        if each.dropped:
            left_out = (
                f"{each.metric}, {each.path}, {each.mode}: {each.dropped} of {each.dropped + each.samples} base samples"
            )
            console.print(f"{left_out} left out: not all their runs are complete", soft_wrap=True)
