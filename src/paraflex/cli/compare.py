"""`paraflex compare`: two runs side by side."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable
from pathlib import Path

from rich.console import Console
from rich.table import Table

from paraflex.cli import COMPLETE
from paraflex.cli.commands.requests import flagged
from paraflex.cli.commands.results import CompareRequest
from paraflex.cli.ending import print_location, print_results
from paraflex.cli.replacing import hold_results
from paraflex.cli.tables import plain_table, print_titled
from paraflex.folders import RUN_COMPARISON
from paraflex.results.comparison import MotionPair, NumberPair, RunComparison, compare
from paraflex.results.metrics import metric_label
from paraflex.units import printed_unit
from paraflex.writing import write_json

# Largest number of settings printed, and of characters of each value; compare.json has all.
_MOST_SETTINGS, _MOST_LETTERS = 20, 40


def compare_command(request: CompareRequest) -> int:
    """Compare two runs, print the differences and, with --out, write them to files; return the exit code."""
    began = time.perf_counter()
    with flagged(request):
        found = compare(request.first, request.second, request.modes)
    if request.out is not None:
        with hold_results(request.out, RUN_COMPARISON, force=request.force) as folder:
            from paraflex.plots.compare import save_overlays

            # The numbers are written first: a failure while figures are drawn does not lose them.
            with folder.replaced() as new:
                write_json(new / "compare.json", found.to_dict())
            with folder.added_files() as new:
                save_overlays(found, new / "figures")
    print_results(found.to_dict(), lambda out: print_compared(out, found), as_json=request.json, findings=())
    if request.out is not None and not request.json:
        print_location(began, "numbers and figures", Path(request.out))
    return COMPLETE


def print_compared(console: Console, found: RunComparison) -> None:
    """Print the differences: settings, then the numbers and motions of each mode."""
    console.print(f"first: {found.names[0]}\nsecond: {found.names[1]}", soft_wrap=True)
    for note in found.notes:
        console.print(note, soft_wrap=True)
    _print_settings(console, found)
    for mode in found.modes:
        whose = f", mode {mode}" if mode else ""
        numbers = [pair for pair in found.numbers if pair.mode == mode]
        differing = [pair for pair in numbers if pair.first != pair.second]
        alike = len(numbers) - len(differing)
        if differing:
            title = f"Numbers that differ{whose}" + (f" ({alike} others are the same)" if alike else "")
            print_titled(console, title, _numbers(differing))
        else:
            console.print(f"All {alike} numbers are the same{whose}", soft_wrap=True)
        print_titled(console, f"Motions{whose}: largest difference", _motions(found.motions, mode))


def _print_settings(console: Console, found: RunComparison) -> None:
    if not found.settings:
        console.print("The same settings and versions")
        return
    shown = list(found.settings.items())[:_MOST_SETTINGS]
    rows = ([name, *(_short(value) for value in pair)] for name, pair in shown)
    print_titled(console, "Settings that differ", plain_table("setting", "first", "second", rows=rows))
    if len(found.settings) > len(shown):
        console.print(f"and {len(found.settings) - len(shown)} more (--out writes all)")


def _numbers(pairs: Iterable[NumberPair]) -> Table:
    rows = (
        [metric_label(pair.name), *_shown(pair), _percent(pair.relative)]
        for pair in pairs
    )  # fmt: skip
    return plain_table(
        "number", "unit", numbers=("first", "second", "difference", "relative"), rows=rows, wrapped=("number",)
    )


def _motions(pairs: Iterable[MotionPair], mode: str) -> Table:
    """Return a table with the part of each variable that differs most."""
    most: dict[str, MotionPair] = {}
    for pair in pairs:
        if pair.mode == mode and (pair.name not in most or pair.difference > most[pair.name].difference):
            most[pair.name] = pair
    rows = (
        [pair.name.replace("_", " "), pair.part, *_shown(pair), _number(pair.time)]
        for pair in most.values()
    )  # fmt: skip
    heads = ("peak of first", "of second", "difference", "at [s]")
    return plain_table("quantity", "of", "unit", numbers=heads, rows=rows, wrapped=("quantity", "of"))


def _shown(pair: NumberPair | MotionPair) -> list[str]:
    """Return unit, both values and their difference as texts."""
    unit, factor = printed_unit(pair.unit)
    return [unit, *(_number(factor * value) for value in (pair.first, pair.second, pair.difference))]


def _number(value: float) -> str:
    return f"{value:.4g}" if math.isfinite(value) else "-"


def _percent(value: float) -> str:
    return f"{100.0 * value:+.3g} %" if math.isfinite(value) else "-"


def _short(value: object) -> str:
    text = "none" if value is None else str(value)
    return text if len(text) <= _MOST_LETTERS else f"{text[: _MOST_LETTERS - 3]}..."
