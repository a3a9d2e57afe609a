"""Tables that `paraflex reduce` prints: states needed, frequencies and errors of reduced models."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from rich.console import Console

from paraflex.cli.tables import number, plain_table, print_titled
from paraflex.results.linear_data import HOLDINGS
from paraflex.results.reduction_along import along_heads, along_rows
from paraflex.results.reduction_data import FULL, percent_off

Array = NDArray[np.float64]

# Largest numbers of outputs and of frequencies in a row; reduced.json has all.
_OUTPUTS, _FREQUENCIES = 8, 4


def print_reduction(out: Console, data: xr.Dataset) -> None:
    """Print reduced models: states needed, errors, frequencies, error bounds, and errors along the path."""
    attrs = data.attrs
    until, accuracy = float(attrs["until"]), float(attrs["accuracy"])
    kept, full = int(attrs["kept_states"]), int(attrs["full_states"])
    out.print(f"{attrs['mechanism']}, about {attrs['about']}: {kept} of {full} states", soft_wrap=True)
    outputs = [str(name) for name in data["output"].values][:_OUTPUTS]
    pairs = [(str(mode), str(name)) for mode in data["mode"].values for name in data["reduction"].values]
    needed = ([mode, name, *(_states(data["states"].sel(mode=mode, reduction=name, output=one).item())
                             for one in outputs)] for mode, name in pairs)  # fmt: skip
    print_titled(out, f"States needed for {100.0 * accuracy:.3g} % up to {until:g} Hz",
                 plain_table("mode", "method", numbers=outputs, rows=needed))  # fmt: skip
    errors = ([mode, name, *(f"{data['largest_error'].sel(mode=mode, reduction=name, output=one).item():.1e}"
                             for one in outputs)] for mode, name in pairs)  # fmt: skip
    print_titled(out, f"Largest error with {kept} states up to {until:g} Hz",
                 plain_table("mode", "method", numbers=outputs, rows=errors))  # fmt: skip
    heads = [str(k + 1) for k in range(_FREQUENCIES)]
    table = plain_table("mode", "motors", "states", numbers=heads, rows=_frequency_rows(data))
    print_titled(out, "Frequencies [Hz], with the errors of reduced models below", table)
    for mode, name in pairs:
        bound = float(data["bound"].sel(mode=mode, reduction=name))
        if not math.isnan(bound):
            out.print(f"mode {mode}, {name}: the gain of the error is at most {bound:.3g}", soft_wrap=True)
    if rows := list(along_rows(data)):
        title, stretch = along_heads(data)
        cells = ([*one[:3], *(number(error, ".1e") for error in one[3:6]), one.within] for one in rows)
        heads = ["largest", *HOLDINGS, stretch]
        print_titled(out, title, plain_table("mode", "static shapes", "vibrations", numbers=heads, rows=cells))


def _states(value: float) -> str:
    return "more than 80" if math.isnan(value) else f"{value:.0f}"


def _frequency_rows(data: xr.Dataset) -> Iterator[list[str]]:
    """Yield rows of frequencies with motors free, which all modes share, and with the motors of each mode held."""
    modes = [str(mode) for mode in data["mode"].values]
    held = [("all" if holding == HOLDINGS[0] else mode, mode, holding)
            for holding in HOLDINGS for mode in (modes[:1] if holding == HOLDINGS[0] else modes)]  # fmt: skip
    for shown, mode, holding in held:
        found = data["natural_frequency"].sel(mode=mode, holding=holding)
        for name in map(str, data["variant"].values):
            cells = _cells(found.sel(variant=name).values, found.sel(variant=FULL).values, full=name == FULL)
            if any(cells):
                yield [shown, holding, "all" if name == FULL else name, *cells]


def _cells(values: Array, exact: Array, *, full: bool) -> list[str]:
    cells = []
    for value, right in zip(values[:_FREQUENCIES], exact, strict=False):
        off = "" if full or math.isnan(right) else f"\n{percent_off(value, right)}"
        cells.append("" if math.isnan(value) else f"{value:.4g}{off}")
    return cells
