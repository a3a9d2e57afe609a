"""Figures of controllers: their torques and readings."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from paraflex.errors import InputError
from paraflex.plots.given import drawn
from paraflex.plots.labels import display_unit, symbol
from paraflex.plots.runs import finish_over_time, largest_columns, listed_panels
from paraflex.plots.selection import names_of, one_run
from paraflex.plots.style import BLACK, COLOURS, look_of
from paraflex.results.controllers import (
    APPLIED,
    INPUT,
    OUTPUT,
    READINGS,
    REQUESTED,
    SAMPLE,
    ControllerData,
    controllers_of,
)

_WANTED = {"linestyle": (0, (1, 1)), "linewidth": 0.8}
_LIMIT = {"color": "0.5", "linestyle": (0, (5, 1.5)), "linewidth": 0.7, "zorder": 1.0}
_WORDS = {"rad": "angle", "m": "position", "rad/s": "rate", "m/s": "speed", "N m": "torque", "N": "force"}


class _Panel(NamedTuple):
    """Content of a panel: torques or readings of one controller that share a unit."""

    controller: ControllerData
    dim: str
    names: list[str]
    unit: str


@drawn
def controllers(data: xr.Dataset, mode: str | None = None) -> Figure:
    """Plot the torques of every controller before and after limits, and its readings; at most seven of each unit."""
    run = one_run(data, mode)
    found = [each for one in controllers_of(run) for each in _panels(one)]
    if not found:
        raise InputError(
            "no controllers in these results", field="figure", value="controllers",
            remedy="run it with --controller, or with [study] controllers in the model",
        )  # fmt: skip
    figure, axes = listed_panels(len(found))
    for panel, shown in zip(axes.flat, found, strict=False):
        (_draw_torques if shown.dim == OUTPUT else _draw_readings)(panel, shown)
        words = "readings" if shown.dim == INPUT else "torques" if shown.unit == "N m" else "forces"
        panel.set_title(f"{shown.controller.name}: {words}", loc="left")
    axes.flat[0].plot([], [], color=BLACK, label="acts")
    axes.flat[0].plot([], [], color=BLACK, label="wanted by the law", **_WANTED)
    return finish_over_time(figure, axes, data, panel_height=40.0)


def _panels(one: ControllerData) -> Iterator[_Panel]:
    """Yield the panels of a controller: torques, then readings, each by unit; signals that a mode lacks are omitted."""
    for dim, variable in ((OUTPUT, APPLIED), (INPUT, READINGS)):
        names = [name for name in names_of(one.data, dim)
                 if np.isfinite(one.data[variable].sel({dim: name}).values).any()]  # fmt: skip
        for unit in dict.fromkeys(one.units[name] for name in names):
            yield _Panel(one, dim, [name for name in names if one.units[name] == unit], unit)


def _largest(shown: _Panel, variable: str) -> list[str]:
    """Return the names of the signals with the largest peaks, in their original order."""
    values = shown.controller.data[variable].sel({shown.dim: shown.names}).transpose(..., shown.dim).values
    return [shown.names[k] for k in largest_columns(values)]


def _draw_torques(panel: Axes, shown: _Panel) -> None:
    """Draw applied torques, held from the end of the delay to the next sample, and the law's own at their samples.

    A limit is drawn as a line where an applied torque reaches it.
    """
    one = shown.controller
    times = one.data[SAMPLE].values
    for k, name in enumerate(_largest(shown, APPLIED)):
        given, wanted = (one.data[variable].sel({OUTPUT: name}).values for variable in (APPLIED, REQUESTED))
        panel.step(times + one.delay, given, where="post", label=symbol(name), **look_of(k))
        panel.step(times, wanted, where="post", color=COLOURS[k % len(COLOURS)], **_WANTED)
        for bound in one.limits[name]:
            if bound is not None and np.any(given == bound):
                panel.axhline(bound, **_LIMIT)
    panel.set_ylabel(f"{_WORDS[shown.unit]} [{shown.unit}]")


def _draw_readings(panel: Axes, shown: _Panel) -> None:
    one = shown.controller
    names = _largest(shown, READINGS)
    values = one.data[READINGS].sel({INPUT: names}).transpose(SAMPLE, INPUT).values
    unit = display_unit(shown.unit, values)
    for k, name in enumerate(names):
        panel.step(one.data[SAMPLE].values, unit.factor * values[:, k], where="post", label=symbol(name), **look_of(k))
    panel.set_ylabel(f"{_WORDS.get(shown.unit, 'reading')} [{unit.name}]")
