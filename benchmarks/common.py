"""What the benchmarks share: one thread, the machine they ran on, the search for a setting, tables, JSON."""

from __future__ import annotations

import argparse
import json
import os
import re
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, TypeVar

_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
_PACKAGES = ("paraflex", "numpy", "scipy", "numba", "llvmlite", "exudyn", "mujoco")

# What the documentation shows; other results go to `benchmarks/results`.
MEASURED = Path(__file__).parent / "measured"

Setting = TypeVar("Setting")


def single_thread() -> None:
    """Start this script anew with one thread for every library; they read this when they are first imported."""
    if any(os.environ.get(name) != "1" for name in _THREADS):
        os.environ.update(dict.fromkeys(_THREADS, "1"))
        os.execv(sys.executable, [sys.executable, *sys.argv])


def command_line(description: str | None) -> argparse.ArgumentParser:
    """What all benchmarks take: `--write` puts their JSON where the documentation shows it."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--write", dest="folder", action="store_const", const=MEASURED, help="into benchmarks/measured, for the docs"
    )
    return parser


def conditions() -> dict[str, Any]:
    """Machine, load, versions and command of these measurements."""
    from paraflex.studies.comparison import machine

    return {
        "command": " ".join(["python", *sys.argv]),
        "date": time.strftime("%Y-%m-%d", time.gmtime()),
        "machine": machine(),
        "load": os.getloadavg() if hasattr(os, "getloadavg") else None,
        "loop_of_python": reference_loop(),
        "versions": {name: _version(name) for name in _PACKAGES},
    }


def reference_loop() -> float:
    """Seconds for a million additions in a loop, the least of five: how fast, and how busy, the machine is now."""

    def loop() -> float:
        total = 0
        began = time.perf_counter()
        for i in range(1_000_000):
            total += i
        return time.perf_counter() - began

    return min(loop() for _ in range(5))


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def least_time(call: Callable[[], Any], repeats: int) -> float:
    """Least wall time of so many calls [s], after one that is not counted: what others do on the machine only adds."""
    call()
    times = []
    for _ in range(repeats):
        began = time.perf_counter()
        call()
        times.append(time.perf_counter() - began)
    return min(times)


@dataclass(frozen=True)
class Trial:
    """A setting that was tried: how far off it is [m], and what it took [s]; an infinite error where it fails."""

    error: float
    seconds: float


def coarsest_within(
    settings: Iterable[Setting], attempt: Callable[[Setting], Trial], target: float
) -> tuple[Setting, Trial] | None:
    """The first of settings, coarse to fine, within a target together with the next finer one.

    One that is within it while the next finer is not was lucky, and is passed over.
    """
    before = None
    for setting in settings:
        trial = attempt(setting)
        if trial.error <= target and before is not None:
            return before
        before = (setting, trial) if trial.error <= target else None
    return before


def growth(sizes: Sequence[float], values: Sequence[float]) -> tuple[float, float]:
    """Factor c and exponent p of values = c sizes^p, least squares of logarithms."""
    import numpy as np

    exponent, logarithm = np.polyfit(np.log(sizes), np.log(values), 1)
    return float(np.exp(logarithm)), float(exponent)


def table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Rows in columns as wide as they need, the first to the left, the others to the right."""
    lines = [list(headings), *map(list, rows)]
    widths = [max(len(line[k]) for line in lines) for k in range(len(headings))]
    return "\n".join(
        "  ".join(
            text.ljust(w) if k == 0 else text.rjust(w) for k, (text, w) in enumerate(zip(line, widths, strict=True))
        )
        for line in lines
    )


def markdown(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """The same as a table of Markdown."""
    lines = [list(headings), ["---"] + ["---:"] * (len(headings) - 1), *map(list, rows)]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def write_page(text: str, page: Path) -> None:
    """Replace what stands on a page between the two marks for what was measured."""
    begin, end = "<!-- measured: begin -->", "<!-- measured: end -->"
    before = page.read_text(encoding="utf-8")
    pattern = re.compile(f"{re.escape(begin)}.*{re.escape(end)}", re.DOTALL)
    if not pattern.search(before):
        raise ValueError(f"{page} has no part between {begin} and {end}")
    page.write_text(pattern.sub(lambda _: f"{begin}\n\n{text}\n\n{end}", before), encoding="utf-8")


def write_json(name: str, values: dict[str, Any], folder: str | Path | None = None) -> Path:
    """Measurements with their conditions, as FOLDER/NAME.json; `benchmarks/results` by default."""
    where = Path(folder) if folder is not None else Path(__file__).parent / "results"
    where.mkdir(parents=True, exist_ok=True)
    file = where / f"{name}.json"
    file.write_text(json.dumps({**conditions(), **values}, indent=2) + "\n", encoding="utf-8")
    print(f"written to {file}")
    return file
