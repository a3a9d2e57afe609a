"""Charts and tables of a comparison of two runs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from paraflex.errors import InputError
from paraflex.formatting import ROUNDING, display_unit, peak, text_symbol
from paraflex.results.metrics import metric_label
from paraflex.units import PERCENT
from .charts import TIME, Axis, Chart, Curve, joined, look
from .selection import one_run
from .tables import Column, Table, in_row_units

if TYPE_CHECKING:
    from paraflex.results.comparison import MotionPair, NumberPair, RunComparison

# Largest number of charts.
_MOST = 6
# Largest number of settings in the table, and of characters of each value; compare.json has all.
_MOST_SETTINGS, _MOST_LETTERS = 20, 40


# Charts


def overlaid_motion(comparison: RunComparison, name: str, mode: str = "") -> Iterator[Chart]:
    """Yield charts of a quantity of both runs over time, one for each of the parts that differ most.

    Parameters
    ----------
    comparison : RunComparison
        Comparison of the two runs, from `paraflex.compare`.
    name : str
        Compared variable: "end_effector", "torque", "angle", "deflection", "strain_energy", ...
    mode : str
        Actuation mode that both runs have; empty (the default) for runs without a path.

    Raises
    ------
    InputError
        The variable is not compared in this mode.
    """
    pairs = [pair for pair in comparison.motions if (pair.name, pair.mode) == (name, mode)]
    if not pairs:
        there = dict.fromkeys(pair.name for pair in comparison.motions)
        raise InputError("not compared", field="name", value=name, remedy=f"one of {', '.join(there)}")
    runs = [one_run(data, mode or None) for data in comparison.data]
    # Parts that are at rest in both runs have no chart, unless all are.
    pairs = [pair for pair in pairs if peak([pair.first, pair.second]) > ROUNDING] or pairs
    # The parts that differ most, as many as there are charts, in the order of the mechanism.
    chosen = sorted(pairs, key=lambda pair: -np.nan_to_num(pair.difference))[:_MOST]
    charts = [chart for pair in pairs if pair in chosen for chart in _charts(comparison, pair, runs)][:_MOST]
    shown = display_unit(pairs[0].unit, joined(curve.y for chart in charts for curve in chart.curves))
    for chart in charts:
        named = "" if len(charts) > 1 else chart.title
        yield replace(chart, y=Axis(named, pairs[0].unit, shown=shown))


def _charts(comparison: RunComparison, pair: MotionPair, runs: Sequence[xr.Dataset]) -> Iterator[Chart]:
    """Yield one chart of a scalar, two of a point or a force (x and y)."""
    title = pair.name.replace("_", " ") + (f" {text_symbol(pair.part)}" if pair.part else "")
    values = []
    for run in runs:
        own = run[pair.name]
        dim = next((str(each) for each in own.dims if each not in ("time", "axis")), None)
        values.append((own if dim is None else own.sel({dim: pair.part})).transpose("time", ...).values)
    for k, suffix in enumerate([""] if values[0].ndim == 1 else [", x", ", y"]):
        curves = [
            Curve(label, own if own.ndim == 1 else own[:, k], run["time"].values, look(r))
            for r, (run, own, label) in enumerate(zip(runs, values, comparison.names, strict=True))
        ]
        yield Chart(f"{pair.name}-{pair.part}-{k}", f"{title}{suffix}", Axis("", pair.unit), curves, TIME)


# Tables


def setting_table(found: RunComparison) -> Table:
    """Return the table of the settings that differ, the first ones if there are many."""
    names = list(found.settings)
    return Table("Settings that differ", [
        Column("setting", names),
        *(Column(word, [_short(found.settings[name][k]) for name in names])
          for k, word in enumerate(("first", "second"))),
    ]).thinned(range(len(names))[:_MOST_SETTINGS])  # fmt: skip


def number_table(pairs: Sequence[NumberPair], title: str) -> Table:
    """Return the table of scalars of both runs."""
    values = [Column(word, [getattr(pair, word) for pair in pairs]) for word in ("first", "second", "difference")]
    relative = Column("relative", [pair.relative for pair in pairs], digits=3, shown=PERCENT)
    names = Column("number", [metric_label(pair.name) for pair in pairs])
    return Table(title, [names, *in_row_units(values, [pair.unit for pair in pairs]), relative])


def motion_table(found: RunComparison, mode: str, title: str) -> Table:
    """Return the table of the part of each variable that differs most in a mode."""
    most: dict[str, MotionPair] = {}
    for pair in found.motions:
        if pair.mode == mode and (pair.name not in most or pair.difference > most[pair.name].difference):
            most[pair.name] = pair
    pairs = list(most.values())
    values = [Column(head, [getattr(pair, word) for pair in pairs]) for head, word in (
        ("peak of first", "first"), ("of second", "second"), ("difference", "difference"),
    )]  # fmt: skip
    return Table(title, [
        Column("quantity", [pair.name.replace("_", " ") for pair in pairs]),
        Column("of", [pair.part for pair in pairs]),
        *in_row_units(values, [pair.unit for pair in pairs]),
        Column("at", [pair.time for pair in pairs], "s"),
    ])  # fmt: skip


def _short(value: object) -> str:
    text = "none" if value is None else str(value)
    return text if len(text) <= _MOST_LETTERS else f"{text[: _MOST_LETTERS - 3]}..."
