"""`paraflex indices`: which parameters a metric depends on, over their whole ranges."""

from __future__ import annotations

import json
from dataclasses import dataclass

from rich.progress import BarColumn, Progress, TextColumn

from paraflex.cli.request import COMPLETE, INTERRUPTED, study_folder
from paraflex.cli.search import plain_table
from paraflex.cli.tables import number, plain_console, warn_of
from paraflex.compilation import compile_kernels_for
from paraflex.plots import save_search_figures
from paraflex.studies import IndicesResult, SweepProgress, load_indices, sobol_indices


@dataclass(frozen=True)
class IndicesRequest:
    """What `paraflex indices` was asked for."""

    study: str
    output: str | None
    metrics: list[str]
    samples: int | None
    seed: int | None
    engine: str
    workers: int | None
    cluster: str | None
    json: bool


def indices_command(request: IndicesRequest) -> int:
    """Do what is left of the runs, and say the indices; the exit code."""
    console = plain_console(stderr=True)
    study = load_indices(request.study, request.metrics, request.samples, request.seed)
    folder = study_folder(request.study, request.output)
    compile_kernels_for(study.sweep.model().mechanism, console.print)
    columns = (TextColumn("{task.description}", markup=False), BarColumn(), TextColumn("{task.completed}/{task.total}"))
    with Progress(*columns, console=console, transient=not console.is_terminal, refresh_per_second=4) as progress:
        bar = progress.add_task(study.sweep.name, total=study.sweep.runs)

        def tell(at: SweepProgress) -> None:
            progress.update(bar, completed=at.done)

        result = sobol_indices(
            study, folder, engine=request.engine, workers=request.workers, cluster=request.cluster, on_progress=tell
        )
    if not result.sweep.finished:
        console.print(f"so far: {result.sweep.table}; the same command goes on from there", soft_wrap=True)
        return INTERRUPTED
    save_search_figures(result.figures(), folder / "figures")
    verdict = study.sweep.setting.verdict()
    warn_of(console if request.json else plain_console(), verdict)
    if request.json:
        print(json.dumps(result.figures() | {"verdict": verdict.to_dict()}, indent=2))
    else:
        _report(result)
        console.print(f"indices: {result.table}; every run: {result.sweep.table}", soft_wrap=True)
    return COMPLETE


def _report(result: IndicesResult) -> None:
    table = plain_table("Sobol indices and half the width of their intervals of 95 %")
    for heading in ("metric", "path", "mode", "parameter"):
        table.add_column(heading, no_wrap=True)
    for heading in ("first", "±", "total", "±"):
        table.add_column(heading, justify="right", no_wrap=True)
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
