"""Commands that produce one dataset: it is printed and, if requested, written with figures and a report."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import xarray as xr
from rich.console import Console

from paraflex.cli.commands.options import FilesChoice
from paraflex.cli.ending import print_location, print_results
from paraflex.cli.replacing import hold_results
from paraflex.findings import Finding
from paraflex.folders import RESULT_KINDS


@dataclass(frozen=True)
class DatasetCommand:
    """Output of a command that produces one dataset.

    Attributes
    ----------
    kind : str
        Kind of the dataset, one of `paraflex.folders.RESULT_KINDS`.
    summary : callable
        Function that returns the dataset as plain numbers.
    show : callable
        Function that prints tables of the dataset to a console.
    findings : iterable of Finding, optional
        Findings printed before the tables; by default those of the summary's verdict.
    """

    kind: str
    summary: Callable[[xr.Dataset], dict[str, Any]]
    show: Callable[[Console, xr.Dataset], None]
    findings: Iterable[Finding] | None = None

    def run(self, chosen: FilesChoice, make: Callable[[], xr.Dataset]) -> xr.Dataset:
        """Make the dataset, print it and, if a folder is given, write it there; the folder is held beforehand."""
        began = time.perf_counter()
        if chosen.out is None:
            return self._print(chosen, make())
        kind = RESULT_KINDS[self.kind]
        with hold_results(chosen.out, kind.folder, force=chosen.force) as folder:
            data = self._print(chosen, make())
            from paraflex.cli.writing import write_drawn, write_numbers

            write_numbers(data, self.summary(data), folder, (kind.data, kind.files[0]))
            write_drawn(data, folder, chosen.drawn)
        if not chosen.json:
            print_location(began, "numbers", folder.path, chosen.drawn)
        return data

    def _print(self, chosen: FilesChoice, data: xr.Dataset) -> xr.Dataset:
        print_results(self.summary(data), lambda out: self.show(out, data), as_json=chosen.json, findings=self.findings)
        return data
