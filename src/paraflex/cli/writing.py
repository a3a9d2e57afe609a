"""Files of a command's results: numbers first, then figures and report."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import xarray as xr

from paraflex.cli.commands.options import DrawnChoice
from paraflex.cli.commands.runs import RunRequest
from paraflex.cli.ending import where
from paraflex.errors import OutputError
from paraflex.folders import ResultsFolder
from paraflex.results import save_results
from paraflex.writing import write_json

_LATER = "paraflex plot and paraflex report draw them"
_FIGURES = DrawnChoice(report=False)


def write_numbers(
    data: xr.Dataset,
    summary: dict[str, Any],
    folder: ResultsFolder,
    names: tuple[str, str] = ("results.nc", "summary.json"),
) -> None:
    """Write a dataset and its summary in place of earlier results; the default names are those of a run."""
    with folder.replaced() as new:
        save_results(data, new / names[0])
        write_json(new / names[1], summary)


def write_drawn_run(data: xr.Dataset, folder: ResultsFolder, request: RunRequest, began: float) -> str:
    """Add the requested figures and report of a run; return a line with time and folder."""
    write_drawn(data, folder, request.drawn)
    return where(began, "results", folder.path, request.drawn)


def write_drawn(results: xr.Dataset | Mapping[str, Any], folder: ResultsFolder, drawn: DrawnChoice = _FIGURES) -> None:
    """Add figures, and the report of a dataset, to results already written, which an interruption leaves intact."""
    try:
        with folder.added_files() as new:
            if drawn.figures:
                from paraflex.plots import save_figures  # its import takes a second

                save_figures(results, new / "figures")
            if drawn.report and isinstance(results, xr.Dataset):
                from paraflex.cli.report import page_of, save_page  # as does this one

                save_page(page_of(results, folder.path), new / "report.html")
    except KeyboardInterrupt as interrupt:
        interrupt.args = (f"the numbers are in {folder.path}; {_LATER}",)
        raise
    except OutputError as error:
        remedy = f"the numbers are in {folder.path}: once there is room, {_LATER}"
        raise OutputError(error.problem, field=error.field, remedy=remedy) from error
