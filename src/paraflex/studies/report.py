"""Report of any results."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from paraflex.arguments import checked_arguments
from paraflex.campaign import STUDY, KeptResult
from paraflex.reports import Page, tracking_page, verification_page
from paraflex.reports.kind_page import page_of
from paraflex.results.given import dataset_of
from paraflex.results.storage import open_results, results_file
from .agreement import Verification
from .sweeps.report import study_page
from .tracking import StudyResult


@checked_arguments()
def report(results: Any, *, on_progress: Callable[[str], None] | None = None) -> Page:
    """Return the report of results, a page that notebooks show and that its method `save` writes.

    Parameters
    ----------
    results : Any
        Run, or runs of one task; result of a study; dataset; linear model; equilibria; or folder or file of results.
    on_progress : callable, optional
        Function called with a description of what takes time: the best designs of a study are simulated again.

    Raises
    ------
    InputError
        No results, or results of a kind that has no report.
    """
    results = results.folder if isinstance(results, KeptResult) else results
    if isinstance(results, str | Path):
        study = study_of(Path(results))
        if study is not None:
            return study_page(study, on_progress)
        return page_of(open_results(results), results_file(results).parent)
    data = dataset_of(results, "results")
    if isinstance(results, Verification):
        return verification_page(data, results.to_dict())
    if isinstance(results, StudyResult):
        return tracking_page(data, results.failed)
    return page_of(data, Path())


def study_of(results: Path) -> Path | None:
    """Return the folder of a study of many designs, given by its name or by a file in it; None if it is not one."""
    folder = results.parent if results.is_file() and results.suffix in (".parquet", ".json") else results
    return folder if (folder / STUDY).is_file() else None
