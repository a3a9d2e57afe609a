"""Figures that compare two runs by curves in common panels."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from numpy.typing import NDArray

from paraflex.arguments import checked_arguments
from paraflex.errors import InputError
from paraflex.plots.catalogue import CatalogueFigure
from paraflex.plots.labels import ROUNDING, display_unit, peak, plain, symbol
from paraflex.plots.layout import label_outer_time, lay_out, panels
from paraflex.plots.planned import PlannedFigure
from paraflex.plots.save import write_figures
from paraflex.plots.selection import one_run
from paraflex.plots.style import PAIR, journal_style
from paraflex.results.comparison import MotionPair, RunComparison

# Largest number of panels of a figure.
_MOST = 6
_COMPONENTS = ("x", "y")


@checked_arguments()
def overlaid_motion(comparison: RunComparison, name: str, mode: str = "") -> Figure:
    """Plot a quantity of two runs over time, one panel for each of the parts that differ most.

    Parameters
    ----------
    comparison : RunComparison
        Comparison of the two runs, from `paraflex.compare`.
    name : str
        Compared variable: "end_effector", "torque", "angle", "deflection", "strain_energy", ...
    mode : str
        Actuation mode that both runs have; empty (the default) for runs without a path.

    Returns
    -------
    matplotlib.figure.Figure

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
    # Parts that are at rest in both runs have no panel, unless all are.
    pairs = [pair for pair in pairs if peak([pair.first, pair.second]) > ROUNDING] or pairs
    # The parts that differ most, as many as there are panels, in the order of the mechanism.
    chosen = sorted(pairs, key=lambda pair: -np.nan_to_num(pair.difference))[:_MOST]
    curves = [each for pair in pairs if pair in chosen for each in _curves(pair, runs)][:_MOST]
    unit = display_unit(pairs[0].unit, np.concatenate([values for _, each in curves for values in each]))
    with journal_style():
        figure, axes = panels(len(curves), 1)
        for panel, (title, values) in zip(axes[:, 0], curves, strict=True):
            for run, own, label, look in zip(runs, values, comparison.names, PAIR, strict=True):
                panel.plot(run["time"].values, unit.factor * own, label=plain(label), **look)
            panel.set_title(title)
            panel.set_ylabel("" if unit.name == "1" else f"[{unit.name}]")
            if not peak(np.concatenate(values)):
                panel.set_ylim(-1.0, 1.0)
            panel.set_xlim(0.0, max(float(run["time"].values[-1]) for run in runs))
        label_outer_time(axes)
        return lay_out(figure, axes, panel_height=38.0 if len(curves) < _MOST else 26.0)


def save_overlays(comparison: RunComparison, folder: Path) -> list[Path]:
    """Write figures of all compared motions in all modes as PNG and return the files."""
    drawn = []
    for name, mode in dict.fromkeys((pair.name, pair.mode) for pair in comparison.motions):
        listed = CatalogueFigure(f"overlaid_{name}", "curves of two runs")
        drawn.append(PlannedFigure(listed, mode, partial(overlaid_motion, comparison, name, mode)))
    return write_figures(drawn, folder, ("png",), dpi=200.0, force=True)


def _curves(pair: MotionPair, runs: list[xr.Dataset]) -> list[tuple[str, list[NDArray[np.float64]]]]:
    """Return titles and the values of both runs: one pair for a scalar, two for a point or a force (x and y)."""
    title = pair.name.replace("_", " ") + (f" {symbol(pair.part)}" if pair.part else "")
    values = []
    for run in runs:
        own = run[pair.name]
        dim = next((str(each) for each in own.dims if each not in ("time", "axis")), None)
        values.append((own if dim is None else own.sel({dim: pair.part})).transpose("time", ...).values)
    if values[0].ndim == 1:
        return [(title, values)]
    return [(f"{title}, {axis}", [each[:, k] for each in values]) for k, axis in enumerate(_COMPONENTS)]
