"""`paraflex compare`: two runs side by side."""

import time
from pathlib import Path

from paraflex.figures.comparison import motion_table, number_table, setting_table
from paraflex.folders import RUN_COMPARISON
from paraflex.results.comparison import RunComparison, compare
from paraflex.writing import write_json
from .commands.requests import flagged
from .commands.results import CompareRequest
from .ending import print_location, print_results
from .replacing import hold_results
from .tables import PlainConsole, in_own_units, print_table


def compare_command(request: CompareRequest) -> None:
    """Compare two runs, print the differences and, with --out, write them to files."""
    began = time.perf_counter()
    with flagged(request):
        found = compare(request.first, request.second, request.modes)
    in_own_units(found.data[0])
    if request.out is not None:
        with hold_results(request.out, RUN_COMPARISON, force=request.force) as folder:
            from paraflex.plots.compare import save_overlays

            # The numbers are written first: a failure while figures are drawn does not lose them.
            with folder.replaced() as new:
                write_json(new / "compare.json", found.to_dict())
            with folder.added_files() as new:
                save_overlays(found, new / "figures")
    print_results(found.to_dict(), lambda out: print_compared(out, found), as_json=request.json, findings=())
    if request.out is not None:
        print_location(began, "numbers and figures", Path(request.out), as_json=request.json)


def print_compared(console: PlainConsole, found: RunComparison) -> None:
    """Print the differences: settings, then the numbers and motions of each mode."""
    console.print_lines(f"first: {found.names[0]}\nsecond: {found.names[1]}")
    console.print_lines(*found.notes)
    if found.settings:
        print_table(console, setting_table(found))
    else:
        console.print("The same settings and versions")
    for mode in found.modes:
        whose = f", mode {mode}" if mode else ""
        numbers = [pair for pair in found.numbers if pair.mode == mode]
        differing = [pair for pair in numbers if pair.first != pair.second]
        alike = len(numbers) - len(differing)
        if differing:
            title = f"Numbers that differ{whose}" + (f" ({alike} others are the same)" if alike else "")
            print_table(console, number_table(differing, title))
        else:
            console.print_lines(f"All {alike} numbers are the same{whose}")
        print_table(console, motion_table(found, mode, f"Motions{whose}: largest difference"))
