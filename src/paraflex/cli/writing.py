"""The files of a run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import xarray as xr

from paraflex.cli.ending import Unwritten
from paraflex.results import save_results
from paraflex.writing import write_json


def write_run(data: xr.Dataset, summary: dict[str, Any], folder: Path, *, report: bool) -> Unwritten:
    """Write results, their summary, figures, and the report if it is wanted; what became of the last two."""
    from paraflex.plots import save_figures

    unwritten = Unwritten()
    folder.mkdir(parents=True, exist_ok=True)
    save_results(data, folder / "results.nc")
    write_json(folder / "summary.json", summary)
    with unwritten.kept():
        save_figures(data, folder / "figures")
    if report:
        from paraflex.cli.report import page_of
        from paraflex.report import save_page

        with unwritten.kept():
            save_page(page_of(data, folder), folder / "report.html")
    return unwritten
