"""Tables that `paraflex compare-methods` prints."""

from __future__ import annotations

from typing import Any

from rich.console import Console

from paraflex.cli.tables import print_table
from paraflex.figures.methods import tables
from paraflex.formatting import number


def print_comparison(console: Console, summary: dict[str, Any]) -> None:
    """Print errors and work of every run, time of every method to reach an error, failures, and the fastest method."""
    reference = summary["reference"]
    if reference is None:
        return
    console.print(
        f"{summary['mechanism']}, {summary['case']}, {number(summary['duration'])} s. Errors are distances from "
        f"{reference['method']} at {number(reference['tolerance'])} m, known to "
        f"{number(reference['uncertainty'], 1)} m (the distance of {reference['check_method']} at "
        f"{number(reference['check_tolerance'])} m).",
        soft_wrap=True,
    )
    for table in tables(summary):
        print_table(console, table)
    _print_reasons(console, summary["methods"])
    fastest = [f"{level} m {name}" for level, name in summary["fastest"].items() if name is not None]
    if fastest:
        console.print(f"Fastest: {', '.join(fastest)}", soft_wrap=True)


def _print_reasons(console: Console, methods: dict[str, Any]) -> None:
    for name, method in methods.items():
        for run in method["runs"]:
            where = f" at {_setting(run)}" if _setting(run) else ""
            if run["status"] != "complete":
                console.print(f"{name}{where}: {run['status']}, {run['reason']}", soft_wrap=True)
            for text in run["warnings"]:
                console.print(f"{name}{where}: warning: {text}", soft_wrap=True)


def _setting(run: dict[str, Any]) -> str:
    if run["step"] is not None:
        return f"{number(run['step'])} s"
    return "" if run["tolerance"] is None else f"{number(run['tolerance'])} m"
