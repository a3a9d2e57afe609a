"""End of a command: output of its results, and exit code."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from rich.console import Console

from paraflex.cli import COMPLETE, FAILURE, signals
from paraflex.cli.commands.options import DrawnChoice
from paraflex.cli.tables import plain_console, warn_of
from paraflex.findings import Finding


def exit_code(well: bool, *, interrupted: bool) -> int:
    """Return the exit code of a command that succeeded, failed or was interrupted."""
    if interrupted:
        return signals.exit_code()
    return COMPLETE if well else FAILURE


def print_results(
    numbers: dict[str, Any],
    show: Callable[[Console], None],
    *,
    as_json: bool,
    findings: Iterable[Finding] | None = None,
) -> None:
    """Print results as JSON or as tables, preceded by the findings that make them doubtful (on stderr for JSON).

    Parameters
    ----------
    numbers : dict
        Results in plain values.
    show : callable
        Function that prints tables to a console.
    as_json : bool
        Whether to print JSON instead of tables.
    findings : iterable of Finding, optional
        Findings to print; by default those of the verdict in `numbers`.
    """
    out = plain_console()
    if findings is None:
        findings = map(Finding.from_dict, numbers["verdict"]["findings"])
    warn_of(plain_console(stderr=True) if as_json else out, findings)
    if as_json:
        print(json.dumps(numbers, indent=2))
    else:
        show(out)


def print_location(began: float, what: str, folder: Path, drawn: DrawnChoice | None = None) -> None:
    """Print the last line of a command: elapsed time, and folder of the results."""
    plain_console(stderr=True).print(where(began, what, folder, drawn), soft_wrap=True)


def where(began: float, what: str, folder: Path, drawn: DrawnChoice | None = None) -> str:
    """Return a line with the time since `began`, the results `what` and their folder."""
    if drawn is not None:
        what += ", figures" if drawn.figures else ""
        what += " and report.html" if drawn.report else ""
    return f"{time.perf_counter() - began:.1f} s; {what} in {folder}"
