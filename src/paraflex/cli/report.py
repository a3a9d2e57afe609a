"""`paraflex report`: the report of stored results."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import xarray as xr
from rich.console import Console

from paraflex.cli.commands.results import ReportRequest
from paraflex.cli.tables import plain_console
from paraflex.errors import InputError
from paraflex.folders import check_listed
from paraflex.report import (
    Page,
    linear_page,
    motion_page,
    reduction_page,
    save_page,
    statics_page,
    tracking_page,
    verification_page,
)
from paraflex.results.kinds import kind_of
from paraflex.results.storage import open_results, results_file
from paraflex.writing import read_json

# Page functions of the kinds of results that need nothing but their dataset.
_PAGES = {"motion": motion_page, "linear": linear_page, "statics": statics_page, "reduction": reduction_page}


def report_command(request: ReportRequest) -> None:
    """Write the report of stored results."""
    study = study_of(Path(request.results))
    file = study / "results.parquet" if study is not None else results_file(request.results)
    target = file.with_name("report.html") if request.output is None else Path(request.output)
    if target.is_dir():
        target = target / "report.html"
    if target.exists() and not request.force:
        raise InputError("is there already", field=str(target), remedy="say --force to write over it, or --output FILE")
    if study is None:
        save_page(page_of(open_results(file), file.parent), target)
    else:
        save_study_report(study, plain_console(stderr=True), target)
    plain_console(stderr=True).print(f"report in {target}", soft_wrap=True)


def study_of(results: Path) -> Path | None:
    """Return the folder of a study of many designs, given by its name or by a file in it; None if it is not one."""
    from paraflex.campaign import STUDY

    folder = results.parent if results.is_file() and results.suffix in (".parquet", ".json") else results
    return folder if (folder / STUDY).is_file() else None


def save_study_report(folder: Path, console: Console, target: Path | None = None) -> None:
    """Write the report of a study's folder, and print the steps that take time."""
    from paraflex.studies.sweeps.report import study_page

    page = study_page(folder, lambda doing: console.print(doing, soft_wrap=True))
    save_page(page, folder / "report.html" if target is None else target)


def page_of(data: xr.Dataset, folder: Path) -> Page:
    """Return the report of a dataset and of the files in its folder."""
    kind = kind_of(data)
    if kind == "verification":
        return verification_page(data, _beside(folder / "verify.json"))
    if kind in _PAGES:
        return _PAGES[kind](data)
    if kind == "laws":
        raise InputError(
            "a comparison of control laws has no report", field=str(folder),
            remedy="laws.csv has its table, and paraflex plot draws law_comparison",
        )  # fmt: skip
    summary = folder / "summary.json"
    modes = _beside(summary)["modes"] if summary.is_file() else {}
    # Modes that could not start are in the summary only.
    failed = {name: mode.get("message", "") for name, mode in modes.items() if name not in data["mode"].values}
    return tracking_page(data, failed)


def _beside(file: Path) -> dict[str, Any]:
    numbers = read_json(file)
    check_listed(file, "run the command again")
    if not isinstance(numbers.get("modes"), dict):
        raise InputError("is no summary that paraflex wrote", field=str(file), remedy="run the command again")
    return numbers
