"""Which run a figure shows, how far it got, and how desired and actual curves are drawn."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import ArrayLike, NDArray

from paraflex.errors import InputError
from paraflex.plots.labels import is_signs, mode_label
from paraflex.plots.layout import figure_width, is_narrow
from paraflex.plots.style import BLACK, BLUE, SHADE, look_of

DESIRED: dict[str, Any] = {
    "color": BLACK,
    "linestyle": (0, (4, 2)),
    "linewidth": 0.8,
    "zorder": 2.5,
    "label": "desired",
}
STOPPED: dict[str, Any] = {
    "color": BLACK,
    "linestyle": "none",
    "marker": "x",
    "markersize": 4.5,
    "markeredgewidth": 1.2,
    "zorder": 3.0,
    "label": "the run stopped",
}
START: dict[str, Any] = {
    "linestyle": "none",
    "marker": "s",
    "markersize": 4.5,
    "color": BLACK,
    "zorder": 4.0,
    "label": "start",
}
# Variables of the end-effector's motion, what they are, and what their values are multiplied by.
END_EFFECTOR = (
    ("end_effector", "position", 1e3),
    ("end_effector_velocity", "velocity", 1.0),
    ("end_effector_acceleration", "acceleration", 1.0),
)


def select_run(data: xr.Dataset, mode: str) -> xr.Dataset:
    """The run of one mode.

    Raises
    ------
    InputError
        No such mode.
    """
    names = [str(name) for name in data["mode"].values]
    if mode not in names:
        raise InputError("no such mode in these results", field="mode", value=mode, remedy="one of " + ", ".join(names))
    return data.isel(mode=names.index(mode))


def default_mode(data: xr.Dataset) -> str:
    """The mode with most active motors where modes are named by their signs; else the first."""
    names = [str(name) for name in data["mode"].values]
    return max(names, key=lambda name: name.count("+")) if all(map(is_signs, names)) else names[0]


def run_label(run: xr.Dataset) -> str:
    """A run's mode for legends."""
    return f"mode {mode_label(str(run['mode'].item()))}"


def one_run(data: xr.Dataset, mode: str | None = None) -> xr.Dataset:
    """The run of a mode, by default of `default_mode`; of results without modes the one there is.

    Raises
    ------
    InputError
        No such mode.
    """
    if "mode" not in data.dims:
        if mode is not None:
            raise InputError(
                "these results have no modes", field="mode", value=mode, remedy="leave it out: motors were not driven"
            )
        return data
    return select_run(data, default_mode(data) if mode is None else mode)


def samples(run: xr.Dataset) -> int:
    """How many samples of a run there are before the end or the first one it did not get to."""
    moving = run["end_effector"] if "end_effector" in run else run["angle"]
    missing = ~np.isfinite(moving.values).all(axis=-1)
    return int(np.argmax(missing)) if missing.any() else missing.size


def draw_actual(axes: Axes, run: xr.Dataset, x: ArrayLike, y: ArrayLike, **look: Any) -> None:
    """A curve of a run, with a mark at its end where the run did not get to the last sample.

    Its label names the mode; `look` replaces that or any other of the line's properties.
    """
    xs, ys = np.asarray(x), np.asarray(y)
    actual: dict[str, Any] = {"color": BLUE, "linestyle": "-", "label": f"actual, {run_label(run)}"}
    axes.plot(xs, ys, **actual | look)
    last = samples(run) - 1
    if 0 <= last < run.sizes["time"] - 1:
        axes.plot(xs[last], ys[last], **STOPPED)


def draw_curves(axes: Axes, run: xr.Dataset, curves: Mapping[str, NDArray[np.float64]], *, first: int = 0) -> None:
    """Quantities (k,) of a run in time by their labels, each in colours and dashes of its own.

    Those that are nowhere a number are left out. `first` is the number of the first look.
    """
    time, last = run["time"].values, samples(run) - 1
    for number, (label, values) in enumerate(curves.items(), start=first):
        if np.isfinite(values).any():
            axes.plot(time, values, label=label, **look_of(number))
            if 0 <= last < time.size - 1:
                axes.plot(time[last], values[last], **STOPPED)


def draw_desired(axes: Axes, x: ArrayLike, y: ArrayLike) -> None:
    """The curve a run should follow."""
    axes.plot(x, y, **DESIRED)


def shade_rest(axes: Axes, data: xr.Dataset) -> None:
    """Span all of the time axis and shade what follows the end of the desired motion."""
    time = data["time"].values
    end = float(data.attrs.get("motion_end", time[-1]))
    axes.set_xlim(time[0], time[-1])
    if end < time[-1]:
        # In one column the longer words would leave the legend one entry a line.
        label = "after the motion" if is_narrow(figure_width(axes)) else "after the end of the desired motion"
        axes.axvspan(end, time[-1], color=SHADE, linewidth=0.0, zorder=0.0, label=label)
