"""`paraflex report`: the report of stored results."""

from importlib import import_module
from pathlib import Path

import xarray as xr

from paraflex.errors import InputError
from paraflex.folders import RESULT_KINDS
from paraflex.report import Page, save_page
from paraflex.results.kinds import kind_of
from paraflex.results.storage import open_results, results_file
from .commands.results import ReportRequest
from .tables import PlainConsole, in_own_units


def report_command(request: ReportRequest) -> None:
    """Write the report of stored results."""
    study = study_of(Path(request.results))
    file = study / "results.parquet" if study is not None else results_file(request.results)
    target = file.with_name("report.html") if request.output is None else Path(request.output)
    if target.is_dir():
        target = target / "report.html"
    if target.exists() and not request.force:
        raise InputError("already exists", field=str(target), remedy="give --force to overwrite it, or --output FILE")
    if study is None:
        save_page(page_of(in_own_units(open_results(file)), file.parent), target)
    else:
        save_study_report(study, PlainConsole(stderr=True), target)
    PlainConsole(stderr=True).print_lines(f"report in {target}")


def study_of(results: Path) -> Path | None:
    """Return the folder of a study of many designs, given by its name or by a file in it; None if it is not one."""
    from paraflex.campaign import STUDY

    folder = results.parent if results.is_file() and results.suffix in (".parquet", ".json") else results
    return folder if (folder / STUDY).is_file() else None


def save_study_report(folder: Path, console: PlainConsole, target: Path | None = None) -> None:
    """Write the report of a study's folder, and print the steps that take time."""
    from paraflex.studies.sweeps.report import study_page

    page = study_page(folder, console.print_lines)
    save_page(page, folder / "report.html" if target is None else target)


def page_of(data: xr.Dataset, folder: Path) -> Page:
    """Return the report of a dataset and of the summary in its folder."""
    kind = RESULT_KINDS[kind_of(data)]
    kind.refuse("page", str(folder))
    module, _, function = (kind.page or "kind_page.kind_page").partition(".")
    page = getattr(import_module(f"paraflex.report.{module}"), function)
    return page(data, folder) if kind.with_folder else page(data)
