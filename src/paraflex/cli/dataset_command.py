"""Commands that make one dataset: it is printed, and written with figures and a report where that is asked for."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import xarray as xr
from rich.console import Console

from paraflex.cli.commands.options import FilesChoice
from paraflex.cli.ending import say_where, tell
from paraflex.cli.replacing import hold_results
from paraflex.findings import Finding


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
    doubts : iterable of Finding, optional
        Those of the summary by default.
    """

    kind: str
    files: tuple[str, str]
    summary: Callable[[xr.Dataset], dict[str, Any]]
    show: Callable[[Console, xr.Dataset], None]
    doubts: Iterable[Finding] | None = None

    def run(self, chosen: FilesChoice, make: Callable[[], xr.Dataset]) -> xr.Dataset:
        """Make the dataset, the folder for it held before; print and write it."""
        began = time.perf_counter()
        if chosen.out is None:
            return self._tell(chosen, make())
        with hold_results(chosen.out, self.kind, force=chosen.force) as folder:
            data = self._tell(chosen, make())
            from paraflex.cli.writing import write_drawn, write_numbers

            write_numbers(data, self.summary(data), folder, self.files)
            write_drawn(data, folder, chosen.drawn)
        if not chosen.json:
            say_where(began, "numbers", folder.path, chosen.drawn)
        return data

    def _tell(self, chosen: FilesChoice, data: xr.Dataset) -> xr.Dataset:
        tell(self.summary(data), lambda out: self.show(out, data), as_json=chosen.json, doubts=self.doubts)
        return data
