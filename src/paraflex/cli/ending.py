"""Results of a command: printed, and written with figures and a report; and its exit code."""

import json
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, nullcontext
from pathlib import Path
from typing import Any

import xarray as xr

from paraflex.campaign.workers import sharing_out
from paraflex.errors import OutputError
from paraflex.findings import Finding
from paraflex.folders import RESULT_KINDS, ResultsFolder
from paraflex.results import save_results
from paraflex.results.kinds import kind_of
from paraflex.writing import write_json
from . import COMPLETE, FAILURE, signals
from .commands.options import DrawnChoice, FilesChoice
from .replacing import hold_results
from .tables import PlainConsole, warn_of

_LATER = "paraflex plot and paraflex report draw them"
_FIGURES = DrawnChoice(report=False)


def exit_code(well: bool, *, interrupted: bool) -> int:
    """Return the exit code of a command that succeeded, failed or was interrupted."""
    if interrupted:
        return signals.exit_code()
    return COMPLETE if well else FAILURE


def print_results(
    numbers: dict[str, Any],
    show: Callable[[PlainConsole], None],
    *,
    as_json: bool,
    findings: Iterable[Finding] | None = None,
) -> None:
    """Print numbers as JSON, or tables by `show`, after findings (stderr for JSON), by default those of the verdict."""
    out = PlainConsole()
    if findings is None:
        findings = map(Finding.from_dict, numbers["verdict"]["findings"])
    warn_of(PlainConsole(stderr=True) if as_json else out, findings)
    if as_json:
        print(json.dumps(numbers, indent=2))
    else:
        show(out)


def print_location(began: float, what: str, folder: Path, drawn: DrawnChoice | None = None, *, as_json: bool) -> None:
    """Print the last line of a command, unless it prints JSON: elapsed time, and folder of the results."""
    if not as_json:
        PlainConsole(stderr=True).print_lines(where(began, what, folder, drawn))


def where(began: float, what: str, folder: Path, drawn: DrawnChoice | None = None) -> str:
    """Return a line with the time since `began`, the results `what` and their folder."""
    if drawn is not None:
        what += ", figures" if drawn.figures else ""
        what += " and report.html" if drawn.report else ""
    return f"{time.perf_counter() - began:.1f} s; {what} in {folder}"


def write_numbers(data: xr.Dataset, summary: dict[str, Any], folder: ResultsFolder) -> None:
    """Write a dataset and its summary in place of earlier results."""
    kind = RESULT_KINDS[kind_of(data)]
    with folder.replaced() as new:
        save_results(data, new / kind.data)
        write_json(new / kind.files[0], summary)


def write_drawn(results: xr.Dataset | Mapping[str, Any], folder: ResultsFolder, drawn: DrawnChoice = _FIGURES) -> None:
    """Add figures, and the report of a dataset, to results already written, which an interruption leaves intact."""
    with drawing(results, folder, drawn):
        pass


@contextmanager
def drawing(
    results: xr.Dataset | Mapping[str, Any], folder: ResultsFolder, drawn: DrawnChoice = _FIGURES
) -> Iterator[None]:
    """Draw figures while the block writes the results, then add them, and the report of a dataset, to the results."""
    with ExitStack() as stack:
        place, finish = folder.path, None
        if drawn.figures:
            from paraflex.plots.save import figure_calls  # its import takes a second

            place = stack.enter_context(folder.drawn_files())
            finish = stack.enter_context(sharing_out(figure_calls(results, place / "figures")))
        yield
        try:
            with folder.added_files() as new:
                if drawn.report and isinstance(results, xr.Dataset):
                    from paraflex.reports.kind_page import page_of  # as does this one

                    page_of(results, folder.path).save(new / "report.html")
                if finish is not None:
                    finish()
                    if (place / "figures").exists():
                        (place / "figures").replace(new / "figures")
        except KeyboardInterrupt as interrupt:
            interrupt.args = (f"the numbers are in {folder.path}; {_LATER}",)
            raise
        except OutputError as error:
            field = error.field.replace(str(place), str(folder.path))
            remedy = f"the numbers are in {folder.path}: once there is room, {_LATER}"
            raise OutputError(error.problem, field=field, remedy=remedy) from error


def give_dataset(
    kind: str,
    make: Callable[[], xr.Dataset],
    summary: Callable[[xr.Dataset], dict[str, Any]],
    show: Callable[[PlainConsole, xr.Dataset], None],
    chosen: FilesChoice,
    findings: Iterable[Finding] | None = None,
) -> xr.Dataset:
    """Make the dataset of a command, print it and, if a folder is given, write it there; return it.

    Parameters
    ----------
    kind : str
        Kind of the dataset, one of `paraflex.folders.RESULT_KINDS`.
    make : callable
        Function that makes the dataset, called when the folder is held.
    summary : callable
        Function that returns the dataset as plain numbers.
    show : callable
        Function that prints tables of the dataset to a console.
    chosen : FilesChoice
        Folder, and what is drawn and printed.
    findings : iterable of Finding, optional
        Findings printed before the tables; by default those of the summary's verdict.
    """
    began, place = time.perf_counter(), RESULT_KINDS[kind].folder
    with nullcontext() if chosen.out is None else hold_results(chosen.out, place, force=chosen.force) as folder:
        data = make()
        numbers = summary(data)
        print_results(numbers, lambda out: show(out, data), as_json=chosen.json, findings=findings)
        if folder is not None:
            with drawing(data, folder, chosen.drawn):
                write_numbers(data, numbers, folder)
    if folder is not None:
        print_location(began, "numbers", folder.path, chosen.drawn, as_json=chosen.json)
    return data
