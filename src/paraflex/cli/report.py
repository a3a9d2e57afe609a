"""`paraflex report`: the report of stored results."""

from pathlib import Path

from paraflex.errors import InputError
from paraflex.reports import save_page
from paraflex.results.storage import open_results, results_file
from paraflex.studies.report import report, study_of
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
    in_own_units(open_results(file) if study is None else None, study)
    console = PlainConsole(stderr=True)
    save_page(report(study or file, on_progress=console.print_lines), target)
    console.print_lines(f"report in {target}")
