"""Results of a command as files: numbers first, then what is drawn of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import xarray as xr

from paraflex.folders import ResultsFolder
from paraflex.report import Page
from paraflex.results import save_results
from paraflex.writing import write_json


def write_run(data: xr.Dataset, summary: dict[str, Any], folder: ResultsFolder, *, report: bool) -> None:
    """Write results, their summary, figures, and the report if it is wanted."""
    from paraflex.cli.report import page_of

    with folder.replaced() as new:
        save_results(data, new / "results.nc")
        write_json(new / "summary.json", summary)
    write_drawn(data, folder, (lambda: page_of(data, folder.path)) if report else None)


def write_drawn(
    results: xr.Dataset | Mapping[str, Any], folder: ResultsFolder, page: Callable[[], Page] | None = None
) -> None:
    """Add figures, and a report where one is wanted, to results that are written: an interruption costs these alone."""
    from paraflex.plots import save_figures

    with folder.amended() as new:
        save_figures(results, new / "figures")
        if page is not None:
            from paraflex.report import save_page

            save_page(page(), new / "report.html")
