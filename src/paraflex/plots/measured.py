"""Readings of sensors."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from paraflex.errors import InputError
from paraflex.plots.given import drawn
from paraflex.plots.labels import display_unit, peak, symbol
from paraflex.plots.layout import panels
from paraflex.plots.runs import MOST_LINES, draw_curves, finish_over_time
from paraflex.plots.selection import names_of, one_run
from paraflex.results.sensors import sensor_groups

# Panels below one another.
_MOST_ROWS = 4


@drawn
def sensors(data: xr.Dataset, mode: str | None = None) -> Figure:
    """Reading of every sensor in time, a panel for each unit; at most the seven largest of each."""
    run = one_run(data, mode)
    groups = sensor_groups(run)
    if not groups:
        raise InputError(
            "no readings of sensors in these results", field="figure", value="sensors",
            remedy="add [sensor.NAME] tables to the model, and run it again",
        )  # fmt: skip
    columns = 1 if len(groups) <= _MOST_ROWS else 2
    figure, axes = panels(-(-len(groups) // columns), columns)
    for panel in axes.flat[len(groups) :]:
        panel.set_visible(False)
    for panel, (quantity, unit, readings) in zip(axes.flat, groups, strict=False):
        names, shown = names_of(readings, "sensor"), display_unit(unit, readings.values)
        order = np.argsort([-peak(each) for each in readings.values.T], kind="stable")[:MOST_LINES]
        draw_curves(panel, run, {symbol(names[k]): shown.factor * readings.values[:, k] for k in sorted(order)})
        unit_shown = shown.name.replace("^2", "²")
        # Low panels have no room for more.
        panel.set_ylabel(f"[{unit_shown}]" if columns > 1 else f"{quantity} [{unit_shown}]")
    return finish_over_time(figure, axes, data, panel_height=40.0)
