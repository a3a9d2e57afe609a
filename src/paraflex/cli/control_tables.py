"""Table and lines that `paraflex control compare` prints."""

from __future__ import annotations

from collections.abc import Iterator

import xarray as xr
from rich.console import Console

from paraflex.cli.tables import print_table
from paraflex.figures.laws import law_table
from paraflex.results.metrics import VALIDITY
from paraflex.studies.law_comparison import LawComparison


def print_laws(console: Console, result: LawComparison) -> None:
    """Print a row for each law in each mode, and reasons of those that failed or are doubtful."""
    print_table(console, law_table(result.data))
    for line in (*_reasons(result), *_doubtful(result)):
        console.print(line, soft_wrap=True)
    if result.interrupted:
        console.print("interrupted before all laws had run: the same command starts over", soft_wrap=True)


def _reasons(result: LawComparison) -> Iterator[str]:
    """Yield the reasons why laws failed or are doubtful in a mode; cases with the same reason share a line."""
    alike = dict[tuple[str, str], list[str]]()
    for name, cell in _cells(result):
        if reason := str(cell["reason"].item()):
            alike.setdefault((str(cell["status"].item()), reason), []).append(name)
    for (status, reason), names in alike.items():
        yield f"{'; '.join(names)}: {status}, {reason}"


def _doubtful(result: LawComparison) -> Iterator[str]:
    """Yield a line with the laws and modes that bend links beyond what the model can describe, if any."""
    if names := [name for name, cell in _cells(result) if cell[VALIDITY] > 1.0]:
        yield f"beyond what the model can describe ({VALIDITY} above 1): {'; '.join(names)}"


def _cells(result: LawComparison) -> Iterator[tuple[str, xr.Dataset]]:
    for law in result.laws:
        for mode in result.modes:
            yield f"{law} in {mode}", result.data.sel(law=law, mode=mode)
