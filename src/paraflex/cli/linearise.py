"""`paraflex linearise`: linear models of a mechanism in its actuation modes, their poles and zeros."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from paraflex.cli import COMPLETE
from paraflex.cli.commands.models import LineariseRequest
from paraflex.cli.commands.requests import flagged
from paraflex.cli.dataset_command import DatasetCommand
from paraflex.cli.linear_models import AskedModels, asked_models, moments_along
from paraflex.cli.tables import plain_table, print_titled
from paraflex.results.linear_data import linear_dataset
from paraflex.results.linear_summary import (
    MAP_WORDS,
    about,
    common_poles,
    linear_summary,
    motors_of_mode,
    oscillations,
    poles_of,
    remarks,
    roots,
    zeros_of,
)

Complex = NDArray[np.complex128]
Row = tuple[str, str, Complex]
# Largest number of oscillations, and of poles or zeros, in a row; linear.json has all.
_OSCILLATIONS, _SHOWN = 6, 4
# A smaller damping ratio is a rounding error.
_ROUNDING = 1e-7


def linearise_command(request: LineariseRequest) -> int:
    """Linearise in every mode, print poles and zeros and, with --out, write files; return the exit code."""
    make = asked_models(request, "linearise")
    _COMMAND.run(request.files, lambda: _data(make(), request))
    return COMPLETE


def _data(found: AskedModels, request: LineariseRequest) -> xr.Dataset:
    with flagged(request):
        along = [] if request.along is None else moments_along(found, request.along)
        return linear_dataset(found.models, along=along, parameters=found.parameters)


def print_linear(out: Console, data: xr.Dataset) -> None:
    """Print linear models: frequencies and damping ratios, poles, zeros and remarks."""
    modes = [str(mode) for mode in data["mode"].values]
    states, held = data.sizes["state"], held_rows(data)
    out.print(f"{data.attrs['mechanism']}, {about(data)}: {states} states", soft_wrap=True)
    count = min(_OSCILLATIONS, max(len(oscillations(poles)) for _, _, poles in held))
    if count:
        damped = any(_percent(one.damping_ratio) for _, _, poles in held for one in oscillations(poles)[:count])
        title = "Frequencies [Hz]" + (", damping ratios below [%]" if damped else "")
        print_titled(out, title, _frequencies(held, count, damped))
    if all(one.on_axis for _, _, poles in held for one in roots(poles)):
        zero = int(np.count_nonzero(held[0][2] == 0.0))
        free = f"; {zero} at zero" + (" with motors free" if len(held) > 1 else "") if zero else ""
        out.print(f"All poles are on the imaginary axis, 2 pi times these frequencies{free}")
    else:
        print_titled(out, "Poles", _roots(held, ("mode", "motors")))
    maps = [str(name) for name in data["map"].values]
    rows = [(mode, MAP_WORDS[name], zeros_of(data, mode, name)) for name in maps for mode in modes]
    if rows:
        print_titled(out, "Zeros", _roots(rows, ("mode", "of")))
    if any(one.right for _, _, values in (*held, *rows) for one in roots(values)):
        out.print("* in the right half plane")
    for sentence in remarks(data):
        out.print(sentence, soft_wrap=True)


def held_rows(data: xr.Dataset) -> list[Row]:
    """Return rows of mode, state of its motors ("free", "held", or "none" if it has none), and poles.

    If the poles with motors free are the same in all modes, they have one row, "all".
    """
    modes = [str(mode) for mode in data["mode"].values]
    common = common_poles(data)
    rows = [("all", "free", common)] if common is not None else [
        (mode, "free" if motors_of_mode(data, mode) else "none", poles_of(data, mode, "free")) for mode in modes
    ]  # fmt: skip
    return rows + [(mode, "held", poles_of(data, mode, "held")) for mode in modes if motors_of_mode(data, mode)]


def _frequencies(rows: Sequence[Row], count: int, damped: bool) -> Table:
    def cells(poles: Complex) -> list[str]:
        texts = [f"{one.frequency:.4g}" + (f"\n{_percent(one.damping_ratio) or '0'}" if damped else "")
                 for one in oscillations(poles)[:count]]  # fmt: skip
        return texts + [""] * (count - len(texts))

    heads = [str(k + 1) for k in range(count)]
    return plain_table(
        "mode", "motors", numbers=heads, rows=([mode, held, *cells(poles)] for mode, held, poles in rows)
    )


def _percent(ratio: float) -> str:
    """Return a damping ratio in percent; empty if it is a rounding error."""
    return f"{100.0 * ratio:.2g}" if abs(ratio) > _ROUNDING else ""


def _roots(rows: Sequence[Row], heads: tuple[str, str]) -> Table:
    """Return a table of the lowest poles or zeros of each row, and how many more there are."""

    def text(values: Complex) -> str:
        found = roots(values)
        more = f", and {len(found) - _SHOWN} more" if len(found) > _SHOWN else ""
        return ", ".join(one.text for one in found[:_SHOWN]) + more if found else "none"

    lines = ([mode, which, text(values)] for mode, which, values in rows)
    return plain_table(*heads, "lowest", rows=lines, wrapped=("lowest",))


_COMMAND = DatasetCommand("linear", linear_summary, print_linear, doubts=())
