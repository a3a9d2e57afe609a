"""Building blocks of figures of runs: curves of desired and actual motion, and panels over time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from paraflex.figures.selection import names_of, run_label, samples
from paraflex.formatting import peak
from paraflex.plots.labels import symbol
from paraflex.plots.layout import figure_width, is_narrow, label_outer_time, lay_out, panels
from paraflex.plots.style import BLACK, BLUE, SHADE, look_of

DESIRED: dict[str, Any] = {
    "color": BLACK, "linestyle": (0, (4, 2)), "linewidth": 0.8, "zorder": 2.5, "label": "desired",
}  # fmt: skip
_MARK: dict[str, Any] = {"color": BLACK, "linestyle": "none", "markersize": 4.5}
STOPPED: dict[str, Any] = _MARK | {"marker": "x", "markeredgewidth": 1.2, "zorder": 3.0, "label": "the run stopped"}
START: dict[str, Any] = _MARK | {"marker": "s", "zorder": 4.0, "label": "start"}
# Largest number of lines that are distinguishable in one panel.
MOST_LINES = 7


def draw_actual(axes: Axes, run: xr.Dataset, x: ArrayLike, y: ArrayLike, **look: Any) -> None:
    """Draw a curve of a run, with a mark at its end if the run ended before the last sample.

    The label names the mode; `look` overrides it and any other property of the line.
    """
    xs, ys = np.asarray(x), np.asarray(y)
    actual: dict[str, Any] = {"color": BLUE, "linestyle": "-", "label": f"actual, {run_label(run)}"}
    axes.plot(xs, ys, **actual | look)
    last = samples(run) - 1
    if 0 <= last < run.sizes["time"] - 1:
        axes.plot(xs[last], ys[last], **STOPPED)


def draw_curves(axes: Axes, run: xr.Dataset, curves: Mapping[str, NDArray[np.float64]], *, first: int = 0) -> None:
    """Draw quantities (k,) of a run over time by their labels, each with its own colour and dashes.

    Quantities without finite values are omitted. `first` is the number of the first look.
    """
    time, last = run["time"].values, samples(run) - 1
    for number, (label, values) in enumerate(curves.items(), start=first):
        if np.isfinite(values).any():
            axes.plot(time, values, label=label, **look_of(number))
            if 0 <= last < time.size - 1:
                axes.plot(time[last], values[last], **STOPPED)


def draw_desired(axes: Axes, x: ArrayLike, y: ArrayLike) -> None:
    """Draw the curve that a run should follow."""
    axes.plot(x, y, **DESIRED)


def largest_columns(values: NDArray[np.float64]) -> list[int]:
    """Return the columns of values (samples, n) with the largest peaks, at most `MOST_LINES`, in their own order."""
    order = np.argsort([-peak(each) for each in values.T], kind="stable")
    return sorted(order[:MOST_LINES].tolist())


def shade_rest(axes: Axes, data: xr.Dataset) -> None:
    """Extend the time axis to the whole run and shade the time after the desired motion."""
    time = data["time"].values
    end = float(data.attrs.get("motion_end", time[-1]))
    if time[0] < time[-1]:
        axes.set_xlim(time[0], time[-1])
    if end < time[-1]:
        # In one column the longer text would force the legend to one entry per line.
        label = "after the motion" if is_narrow(figure_width(axes)) else "after the end of the desired motion"
        axes.axvspan(end, time[-1], color=SHADE, linewidth=0.0, zorder=0.0, label=label)


def finish_over_time(figure: Figure, axes: NDArray[Any], data: xr.Dataset, panel_height: float) -> Figure:
    """Lay out panels over time, `panel_height` in mm.

    The time after the desired motion is shaded, and the time axis is labelled once per column.
    """
    for panel in axes.flat:
        shade_rest(panel, data)
    label_outer_time(axes)
    return lay_out(figure, axes, panel_height=panel_height)


def largest_over_time(data: xr.Dataset, run: xr.Dataset, values: NDArray[np.float64], dim: str, label: str) -> Figure:
    """Plot quantities (time, dim) of a run in one panel; if there are too many, those with the largest peaks."""
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
    """Return the title of a panel that shows a selection, "7 of 8, the fastest joints"; empty if it shows all."""
    return f"{shown} of {all_of_them}, the {what}" if shown < all_of_them else ""
