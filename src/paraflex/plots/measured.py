"""Figure of the readings of sensors."""

from __future__ import annotations

import xarray as xr
from matplotlib.figure import Figure

from paraflex.errors import InputError
from paraflex.figures.selection import names_of, one_run
from paraflex.formatting import display_unit
from paraflex.plots.given import drawn
from paraflex.plots.labels import symbol
from paraflex.plots.runs import draw_curves, finish_over_time, largest_columns, listed_panels
from paraflex.results.sensors import sensor_groups


@drawn
def sensors(data: xr.Dataset, mode: str | None = None) -> Figure:
    """Plot the readings of sensors over time, one panel for each unit; at most the seven largest of each."""
    run = one_run(data, mode)
    groups = sensor_groups(run)
    if not groups:
        raise InputError(
            "no readings of sensors in these results", field="figure", value="sensors",
            remedy="add [sensor.NAME] tables to the model, and run it again",
        )  # fmt: skip
    figure, axes = listed_panels(len(groups))
    for panel, (quantity, unit, readings) in zip(axes.flat, groups, strict=False):
        names, shown = names_of(readings, "sensor"), display_unit(unit, readings.values)
        largest = largest_columns(readings.values)
        draw_curves(panel, run, {symbol(names[k]): shown.factor * readings.values[:, k] for k in largest})
        unit_shown = shown.name.replace("^2", "²")
        # Low panels have no room for more.
        panel.set_ylabel(f"[{unit_shown}]" if axes.shape[1] > 1 else f"{quantity} [{unit_shown}]")
    return finish_over_time(figure, axes, data, panel_height=40.0)
