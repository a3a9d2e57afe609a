"""Figures of many designs: metrics over parameters, and the Pareto front of two metrics."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from paraflex.errors import InputError
from paraflex.plots.designs import DesignTable, in_conflict, undominated
from paraflex.plots.given import drawn
from paraflex.plots.labels import plain
from paraflex.plots.layout import ONE_COLUMN, TWO_COLUMNS, is_narrow, lay_out, panels
from paraflex.plots.scales import round_scale, scaled_label
from paraflex.plots.style import look_of

Array = NDArray[np.float64]

_MARKS = ("o", "s", "^", "D", "v", "P", "X")
# Largest numbers of columns and rows of panels.
_MOST_PARAMETERS, _MOST_METRICS = 3, 3
# Largest number of parameter values with a median each; more values are divided into this number of groups.
_MEDIAN_GROUPS = 12


@drawn
def response_curves(table: DesignTable, metrics: Sequence[str] | None = None) -> Figure:
    """Plot metrics over parameters: one row per metric, one column per parameter, one mark per run.

    Colours distinguish paths and modes. If one parameter varies, its runs are joined by a line; otherwise the line is
    the median over the other parameters, at each value or in twelve groups of equally many runs.

    Parameters
    ----------
    metrics : sequence of str, optional
        Metrics to show; by default the first three that vary, or only the first in a figure of one column with several
        parameters.
    """
    columns = table.varied[:_MOST_PARAMETERS]
    rows = table.judged_by(metrics, 1 if is_narrow() and len(columns) > 1 else _MOST_METRICS)
    figure, axes = panels(len(rows), len(columns), width=ONE_COLUMN if len(columns) == 1 else TWO_COLUMNS)
    series = table.series
    for row, metric in zip(axes, rows, strict=True):
        label, factor = table.labelled(metric)
        for panel, parameter in zip(row, columns, strict=True):
            scale = round_scale(table.parameters[parameter])
            for k, (pair, runs) in enumerate(series.items()):
                x, y = runs.parameters[parameter] / scale, factor * runs.metrics[metric]
                _draw_response(panel, x, y, k, _series_name(pair, table), alone=len(table.varied) == 1)
            panel.margins(x=0.05)
            panel.set_xlabel(scaled_label(parameter, scale))
            panel.locator_params(axis="x", nbins=5)
        row[0].set_ylabel(label)
    return lay_out(figure, axes, panel_height=42.0 if len(rows) > 1 else 52.0)


def _draw_response(panel: Axes, x: Array, y: Array, number: int, name: str, *, alone: bool) -> None:
    look = look_of(number)
    mark: dict[str, Any] = {"marker": _MARKS[number % len(_MARKS)], "color": look["color"]}
    order = np.argsort(x, kind="stable")
    if alone:
        panel.plot(x[order], y[order], **look | mark, markersize=2.8, label=name)
        return
    shade = max(0.15, min(0.7, 40.0 / max(x.size, 1)))
    panel.plot(x, y, linestyle="none", **mark, markersize=2.2, markeredgewidth=0.0, alpha=shade)
    middles = _medians(x[order], y[order])
    panel.plot(*middles, **look, linewidth=1.3, label=f"{name}, median")


def _medians(x: Array, y: Array) -> tuple[Array, Array]:
    """Return medians of values sorted by x, at each x or in groups of equal size."""
    values = np.unique(x)
    groups = [x == value for value in values] if values.size <= _MEDIAN_GROUPS else None
    if groups is None:
        split = np.array_split(np.arange(x.size), _MEDIAN_GROUPS)
        return tuple(np.array([np.nanmedian(each[part]) for part in split]) for each in (x, y))  # pyright: ignore[reportReturnType]
    return values, np.array([np.nanmedian(y[part]) for part in groups])


def _series_name(pair: tuple[str, str], table: DesignTable) -> str:
    """Return a distinctive name of the runs of a path and mode."""
    path, mode = pair
    several = len(set(table.path.tolist())) > 1
    return ", ".join([plain(path)] * several + [f"mode {plain(mode)}"] * bool(mode)) or "runs"


@drawn
def pareto_front(table: DesignTable, metrics: Sequence[str] | None = None) -> Figure:
    """Plot two metrics of every design, and the Pareto front of the designs that no other design dominates.

    Parameters
    ----------
    metrics : sequence of str, optional
        Two metrics; by default the first that varies, and the one for which most designs are on the front.
    """
    chosen = table.judged_by(metrics, 2) if metrics else in_conflict(table, table.judged_by(None, len(table.metrics)))
    if len(chosen) != 2:
        raise InputError(
            "a Pareto front is of two metrics", field="metric", value=", ".join(chosen), remedy="name two that vary"
        )
    figure, axes = panels(1, 1, width=ONE_COLUMN)
    panel = axes[0, 0]
    (across, x_factor), (up, y_factor) = (table.labelled(name) for name in chosen)
    for k, (pair, runs) in enumerate(table.series.items()):
        x, y = x_factor * runs.metrics[chosen[0]], y_factor * runs.metrics[chosen[1]]
        known = np.isfinite(x) & np.isfinite(y)
        x, y, name, look = x[known], y[known], _series_name(pair, table), look_of(k)
        mark: dict[str, Any] = {"marker": _MARKS[k % len(_MARKS)], "color": look["color"], "markersize": 2.4}
        panel.plot(x, y, linestyle="none", alpha=0.35, markeredgewidth=0.0, **mark, label=f"{name}, designs")
        front = undominated(x, y)
        panel.plot(
            x[front], y[front], **look | mark | {"markersize": 3.4}, drawstyle="steps-post", label=f"{name}, front"
        )
    panel.margins(0.06)
    panel.set_xlabel(across)
    panel.set_ylabel(up)
    return lay_out(figure, axes, panel_height=58.0)
