"""Curves of desired and actual motion, and panels over time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from paraflex.plots.labels import peak, symbol
from paraflex.plots.layout import figure_width, is_narrow, label_outer_time, lay_out, panel_grid, panels
from paraflex.plots.selection import names_of, run_label, samples
from paraflex.plots.style import BLACK, BLUE, SHADE, look_of

DESIRED: dict[str, Any] = {
    "color": BLACK, "linestyle": (0, (4, 2)), "linewidth": 0.8, "zorder": 2.5, "label": "desired",
}  # fmt: skip
_MARK: dict[str, Any] = {"color": BLACK, "linestyle": "none", "markersize": 4.5}
STOPPED: dict[str, Any] = _MARK | {"marker": "x", "markeredgewidth": 1.2, "zorder": 3.0, "label": "the run stopped"}
START: dict[str, Any] = _MARK | {"marker": "s", "zorder": 4.0, "label": "start"}
# Most lines that are distinguishable in one panel.
MOST_LINES = 7
# Most panels below one another in one column.
_MOST_ROWS = 4
# Variables of the end-effector's motion, what they are, and what their values are multiplied by.
END_EFFECTOR = (
    ("end_effector", "position", 1e3),
    ("end_effector_velocity", "velocity", 1.0),
    ("end_effector_acceleration", "acceleration", 1.0),
)


def draw_actual(axes: Axes, run: xr.Dataset, x: ArrayLike, y: ArrayLike, **look: Any) -> None:
    """A curve of a run, with a mark at its end if the run ended before the last sample.

    Its label names the mode; `look` replaces that or any other of the line's properties.
    """
    xs, ys = np.asarray(x), np.asarray(y)
    actual: dict[str, Any] = {"color": BLUE, "linestyle": "-", "label": f"actual, {run_label(run)}"}
    axes.plot(xs, ys, **actual | look)
    last = samples(run) - 1
    if 0 <= last < run.sizes["time"] - 1:
        axes.plot(xs[last], ys[last], **STOPPED)


def draw_curves(axes: Axes, run: xr.Dataset, curves: Mapping[str, NDArray[np.float64]], *, first: int = 0) -> None:
    """Quantities (k,) of a run in time by their labels, each with its own colour and dashes.

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


def listed_panels(count: int) -> tuple[Figure, NDArray[Any]]:
    """So many panels below one another, the first of `axes.flat`; in two columns where one is too long."""
    return panel_grid(count, 1 if count <= _MOST_ROWS else 2)


def largest_columns(values: NDArray[np.float64]) -> list[int]:
    """Columns of values (samples, n) with the largest peaks, no more than are distinguishable, in their own order."""
    order = np.argsort([-peak(each) for each in values.T], kind="stable")
    return sorted(order[:MOST_LINES].tolist())


def shade_rest(axes: Axes, data: xr.Dataset) -> None:
    """Extend the time axis to the whole run and shade the time after the desired motion."""
    time = data["time"].values
    end = float(data.attrs.get("motion_end", time[-1]))
    if time[0] < time[-1]:
        axes.set_xlim(time[0], time[-1])
    if end < time[-1]:
        # In one column the longer words would leave the legend one entry a line.
        label = "after the motion" if is_narrow(figure_width(axes)) else "after the end of the desired motion"
        axes.axvspan(end, time[-1], color=SHADE, linewidth=0.0, zorder=0.0, label=label)


def finish_over_time(figure: Figure, axes: NDArray[Any], data: xr.Dataset, panel_height: float) -> Figure:
    """Lay out panels over time [mm], shade the time after the motion, and name the time axis once per column."""
    for panel in axes.flat:
        shade_rest(panel, data)
    label_outer_time(axes)
    return lay_out(figure, axes, panel_height=panel_height)


def largest_over_time(data: xr.Dataset, run: xr.Dataset, values: NDArray[np.float64], dim: str, label: str) -> Figure:
    """One panel of quantities (time, dim) of a run; if there are too many, those with the largest peaks."""
    peaks = np.array([peak(each) for each in values.T])
    largest = [k for k in largest_columns(values) if peaks[k] > 0.0]
    names = names_of(run, dim)
    figure, axes = panels(1, 1)
    draw_curves(axes[0, 0], run, {symbol(names[k]): values[:, k] for k in largest})
    axes[0, 0].set_ylabel(label)
    kind = "bodies" if dim == "body" else f"{dim}s"
    axes[0, 0].set_title(shown_of(len(largest), int(np.count_nonzero(peaks)), f"largest {kind}"))
    return finish_over_time(figure, axes, data, panel_height=56.0)


def shown_of(shown: int, all_of_them: int, what: str) -> str:
    """Title of a panel that has not room for all: "7 of 8, the fastest joints"; empty if it has."""
    return f"{shown} of {all_of_them}, the {what}" if shown < all_of_them else ""
