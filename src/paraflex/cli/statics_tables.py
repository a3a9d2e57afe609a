"""Tables that `paraflex statics` prints: the steps, and details of the last one."""

from __future__ import annotations

import math

import numpy as np
import xarray as xr
from rich.console import Console

from paraflex.cli.tables import print_tables
from paraflex.figures.equilibria import (
    buckling_words,
    is_stressed,
    last_tables,
    lowest_frequencies,
    no_buckling,
    step_table,
)
from paraflex.formatting import number, quantity
from paraflex.results.statics_data import statics_summary


def print_statics(out: Console, data: xr.Dataset) -> None:
    """Print equilibria: a table of steps, details of the last one, then frequencies, buckling, stress and validity."""
    summary = statics_summary(data)
    points = len(summary["limit_points"])
    also = f", {points} limit point{'s' * (points > 1)}" if points else ""
    out.print(f"{data.attrs['mechanism']}: {data.sizes['step']} equilibria{also}", soft_wrap=True)
    print_tables(out, [*([step_table(data)] if data.sizes["step"] > 1 else []), *last_tables(data)])
    for line in _lines(data, summary):
        out.print(line, soft_wrap=True)


def _lines(data: xr.Dataset, summary: dict) -> list[str]:
    lines = []
    last = data.isel(step=-1)
    for name, word in lowest_frequencies(data).items():
        kept = "moved coordinates released" if word == "free" else "held and moved coordinates fixed"
        values = last[name].values[np.isfinite(last[name].values)]
        known = ", ".join(map(number, values))
        kept += ", 0 for growing motions" if np.any(values == 0.0) else ""
        lines.append(f"{'free ' if word == 'free' else ''}frequencies: {known} Hz, {kept}")
    if words := buckling_words(data):
        lines.append(f"buckling at {words}")
    elif words := no_buckling(data):
        lines.append(words)
    if is_stressed(data):
        body = int(np.nanargmax(data["stress_max"].values))
        one = data.isel(body=body)
        safety = float(one["safety_factor"])
        also = "" if math.isnan(safety) else f"; safety factor {number(safety, 3)}"
        lines.append(
            f"largest stress {quantity(float(one['stress_max']), 'Pa', digits=4)} in {one['body'].item()} at "
            f"{quantity(float(one['stress_place']), 'm')}, step {int(one['stress_step'])}{also}"
        )
    if data.sizes["step"] > 1 and summary["validity"] is not None and summary["validity"]["holds"]:
        lines.append(f"validity: {summary['validity']['verdict']}")
    if summary["status"] != "complete":
        lines.append(f"error: {summary['message']}")
    return lines
