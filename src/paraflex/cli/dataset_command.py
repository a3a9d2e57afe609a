"""Commands that make one dataset: it is printed, and written with figures and a report where that is asked for."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import xarray as xr
from rich.console import Console

from paraflex.cli.ending import say_where, tell
from paraflex.cli.replacing import hold_results
from paraflex.findings import Finding

if TYPE_CHECKING:
    # Imported when a page is made: it takes a second.
    from paraflex.report import Page


class DatasetRequest(Protocol):
    """What such a command is asked for besides its models."""

    @property
    def out(self) -> str | None:
        """The folder for its files; none are written without one."""
        ...

    @property
    def force(self) -> bool:
        """Whether results of another kind may be replaced."""
        ...

    @property
    def json(self) -> bool:
        """Whether JSON is printed."""
        ...

    @property
    def report(self) -> bool:
        """Whether a report is written."""
        ...


@dataclass(frozen=True)
class DatasetCommand:
    """Forms of the dataset of a command.

    Attributes
    ----------
    kind : str
        Of its folder of results: see `folders`.
    files : (str, str)
        Of the data and of their summary.
    summary : callable
        The dataset as plain numbers.
    show : callable
        Prints tables of it.
    page : callable
        Its report.
    doubts : iterable of Finding, optional
        Those of the summary by default.
    """

    kind: str
    files: tuple[str, str]
    summary: Callable[[xr.Dataset], dict[str, Any]]
    show: Callable[[Console, xr.Dataset], None]
    page: Callable[[xr.Dataset], Page]
    doubts: Iterable[Finding] | None = None

    def run(self, request: DatasetRequest, make: Callable[[], xr.Dataset]) -> xr.Dataset:
        """Make the dataset, the folder for it held before; print and write it."""
        began = time.perf_counter()
        if request.out is None:
            return self._tell(request, make())
        with hold_results(request.out, self.kind, force=request.force) as folder:
            data = self._tell(request, make())
            from paraflex.cli.writing import write_drawn, write_numbers

            write_numbers(data, self.summary(data), folder, self.files)
            write_drawn(data, folder, (lambda: self.page(data)) if request.report else None)
        if not request.json:
            say_where(began, "numbers, figures", folder.path, report=request.report)
        return data

    def _tell(self, request: DatasetRequest, data: xr.Dataset) -> xr.Dataset:
        tell(self.summary(data), lambda out: self.show(out, data), as_json=request.json, doubts=self.doubts)
        return data
