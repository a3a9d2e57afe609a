"""Figures of charts for print: each figure of the catalogue as a plotting function, drawn by Matplotlib."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from paraflex.errors import InputError
from paraflex.figures.catalogue import Figure as CatalogueFigure, all_figures, prepared
from paraflex.figures.charts import Axis, Chart, Curve, is_logarithmic, joined, symmetrical_numbers
from paraflex.figures.selection import default_mode, names_of
from paraflex.formatting import logarithmic_number, peak
from paraflex.plots.given import drawn
from paraflex.plots.labels import mathematics
from paraflex.plots.layout import (
    ONE_COLUMN,
    TWO_COLUMNS,
    equal_scales_height,
    figure_width,
    is_narrow,
    label_outer_time,
    lay_out,
    panel_grid,
)
from paraflex.plots.scales import LIST_LINE, list_lines, mark_powers
from paraflex.plots.style import BLACK, COLOURS, SHADE, ZERO, keep_flat
from paraflex.units import DisplayUnit

# Largest number of curves that are distinguishable in one panel.
MOST_LINES = 7
# Decades of a logarithmic axis shown below its largest value.
_DECADES = 9.0
_MARKS = {"ring": "o", "cross": "x", "square": "s", "dot": "o"}
# Height of a bar, as a share of the distance of two names.
_BAR = 0.6
# Dashes by their numbers in a look.
_DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), ":", (0, (5, 1.5, 1, 1.5)), (0, (9, 2)))
_DESIRED: dict[str, Any] = {"color": BLACK, "linestyle": (0, (4, 2)), "linewidth": 0.8, "zorder": 2.5}
_STOPPED: dict[str, Any] = {
    "color": BLACK, "linestyle": "none", "marker": "x", "markersize": 4.5, "markeredgewidth": 1.2, "zorder": 3.0,
    "label": "the run stopped",
}  # fmt: skip
_LEVEL: dict[str, Any] = {"color": "0.5", "linestyle": (0, (5, 1.5)), "linewidth": 0.7, "zorder": 1.0}
# Margin around the curves of a plane as a share of their size, smallest and largest ratio of height to width, and the
# latter for a figure of two columns.
_MARGIN, _FLATTEST, _TALLEST, _TALLEST_WIDE = 0.06, 0.3, 1.3, 0.75


class _Cell:
    """Panel of a printed figure: a chart with the run and the choice that it shows, and its title."""

    def __init__(self, chart: Chart, run: int | None, choice: int | None, title: str) -> None:
        self.chart, self.run, self.choice, self.title = chart, run, choice, title

    @property
    def curves(self) -> list[Curve]:
        """Curves of the panel: those of other runs are left out if a run is selected."""
        found = self.chart.shown(self.run, self.choice)
        return [curve for curve in found if self.run is None or curve.run in (None, self.run)]


@cache
def plotting_function(name: str) -> Callable[..., Figure]:
    """Return the plotting function of a figure of the catalogue: of results or their folder, a mode, and options."""
    entry = all_figures()[name]

    def plot(data: Any, mode: str | None = None, **options: Any) -> Figure:
        if entry.takes == "mode" and mode is None and "mode" in getattr(data, "dims", ()):
            mode = default_mode(data)
        found = prepared(data, mode)
        known = all(variable in found for variable in entry.variables)
        charts = list(entry.charts(found, **options)) if known else []
        if not charts:
            raise InputError("nothing to show in these results", field="figure", value=name, remedy=entry.remedy)
        if not isinstance(found, xr.Dataset) or "time" not in found.dims:
            return print_figure(entry, charts)
        return print_figure(entry, charts, found["time"].values, names_of(found, "mode"))

    own = list(inspect.signature(entry.charts).parameters.values())
    modes = [inspect.Parameter("mode", inspect.Parameter.POSITIONAL_OR_KEYWORD, default=None)]
    plot.__name__ = plot.__qualname__ = name
    plot.__doc__ = f"Plot {entry.shows}.\n\n{inspect.getdoc(entry.charts)}"
    plot.__signature__ = inspect.Signature([own[0], *(modes if entry.takes == "mode" else []), *own[1:]])  # type: ignore[attr-defined]
    return drawn(plot)


def __getattr__(name: str) -> Callable[..., Figure]:
    if name.startswith("_") or name not in all_figures():
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return plotting_function(name)


def print_figure(entry: CatalogueFigure, charts: Sequence[Chart], time: Any = None, runs: Sequence[str] = ()) -> Figure:
    """Draw the charts of a figure.

    Parameters
    ----------
    entry : CatalogueFigure
        Entry of the catalogue, with the layout.
    charts : sequence of Chart
        Charts.
    time : (k,) array, optional
        Times of the runs [s], for curves without abscissae.
    runs : sequence of str
        Names of the runs.
    """
    rows = _cells(entry, charts, runs)
    if len(rows[0]) == 1 and rows[0][0].chart.equal and len(rows) == 1:
        return _plane(rows[0][0], time)
    several = entry.panels == "choices" and len(charts) > 1
    columns = len(charts) if several else _columns(entry, sum(map(len, rows)), charts)
    cells = [cell for row in rows for cell in row]
    figure, axes = panel_grid(
        len(cells), columns, width=ONE_COLUMN if len(cells) == 1 and entry.columns else TWO_COLUMNS
    )
    for panel, cell in zip(axes.flat, cells, strict=False):
        _draw(panel, cell, time)
    if all(cell.chart.over_time for cell in cells):
        label_outer_time(axes)
    names = max(len(chart.axis(None).names) for chart in charts)
    return lay_out(figure, axes, panel_height=LIST_LINE * names + 2.0 if names else entry.height)


def _columns(entry: CatalogueFigure, count: int, charts: Sequence[Chart]) -> int:
    if is_narrow():
        return 1
    return min(entry.columns or (1 if charts[0].over_time else 3), count)


def _cells(entry: CatalogueFigure, charts: Sequence[Chart], runs: Sequence[str]) -> list[list[_Cell]]:
    """Return rows of panels."""
    run = 0 if entry.takes in ("mode", "models") else None
    if entry.panels == "runs":
        return [[_Cell(chart, r, 0, name) for r, name in enumerate(runs)] for chart in charts]
    if entry.panels == "choices":
        members = max(len(chart.choices) - chart.overview for chart in charts)
        return [[_member(chart, run, k) for chart in charts] for k in range(max(members, 1))]
    several = len(charts) > 1
    return [[_Cell(chart, run, 0 if chart.choices else None, chart.title if several else "")] for chart in charts]


def _member(chart: Chart, run: int | None, k: int) -> _Cell:
    """Return the panel of the k-th member of a chart."""
    if not chart.choices:
        return _Cell(chart, run, None, chart.title)
    choice = k + chart.overview
    return _Cell(chart, run, choice, f"{chart.choices[choice]}: {chart.axis(choice).name}")


def _draw(panel: Axes, cell: _Cell, time: Any) -> None:
    """Draw the curves, marks and axes of a panel."""
    chart, curves = cell.chart, cell.curves
    units, axis = chart.shown_units(), chart.axis(cell.choice)
    shown, note = _largest(curves)
    title = ", ".join(filter(None, (cell.title, note)))
    single = len({curve.look.colour for curve in shown if not curve.desired}) == 1
    for curve in shown:
        _draw_curve(panel, curve, time, units.x, units.of(cell.choice), single=single)
    for level in chart.levels:
        panel.axhline(units.of(cell.choice).factor * level, **_LEVEL)
    if chart.over_time and time is not None and time[0] < time[-1]:
        panel.set_xlim(time[0], time[-1])
    values = joined(units.of(cell.choice).factor * np.asarray(curve.y, dtype=float) for curve in shown)
    _set_scale(panel, "y", axis, values, units.of(cell.choice))
    xs = joined(units.x.factor * np.asarray(curve.x, dtype=float) for curve in shown if curve.x is not None)
    _set_scale(panel, "x", chart.x, xs, units.x)
    for span in chart.spans:
        label = span.name if not is_narrow(figure_width(panel)) else span.name.replace("the desired", "the")
        low, high = units.x.factor * span.low, units.x.factor * span.high
        panel.axvspan(low, min(high, panel.get_xlim()[1]), color=SHADE, linewidth=0.0, zorder=0.0, label=label)
    panel.set_title(mathematics(title))
    panel.set_ylabel(mathematics(axis.label(units.of(cell.choice))))
    panel.set_xlabel(mathematics(chart.x.label(units.x)))


def _largest(curves: Sequence[Curve]) -> tuple[list[Curve], str]:
    """Return marks, the lines with the largest peaks (at most `MOST_LINES` names), and "7 of 8, the largest"."""
    peaks: dict[str, float] = {}
    for curve in curves:
        if curve.name and not (curve.desired or curve.mark):
            peaks[curve.name] = max(peaks.get(curve.name, 0.0), peak(curve.y))
    if len(peaks) <= MOST_LINES:
        return list(curves), ""
    left_out = sorted(peaks, key=lambda name: -peaks[name])[MOST_LINES:]
    shown = [curve for curve in curves if curve.desired or curve.name not in left_out]
    return shown, f"{MOST_LINES} of {len(peaks)}, the largest"


def _draw_curve(panel: Axes, curve: Curve, time: Any, x_unit: DisplayUnit, unit: DisplayUnit, *, single: bool) -> None:
    y = unit.factor * np.asarray(curve.y, dtype=float)
    x = time if curve.x is None else x_unit.factor * np.asarray(curve.x, dtype=float)
    colour = BLACK if curve.look.colour is None else COLOURS[curve.look.colour % len(COLOURS)]
    label = mathematics(curve.name) if curve.name else None
    if curve.mark == "bar":
        panel.barh(y, x, height=_BAR, color=colour, linewidth=0.0, label=label)
        return
    if curve.mark:
        style = _DASHES[curve.look.dash] if curve.line else ""
        panel.plot(x, y, linestyle=style, marker=_MARKS[curve.mark], markersize=4.0 * curve.size, color=colour,
                   label=label, markerfacecolor="white" if curve.mark == "ring" else colour)  # fmt: skip
        return
    if curve.desired and single:
        panel.plot(x, y, label=label, **_DESIRED)
        return
    panel.plot(x, y, color=colour, linestyle=_DASHES[curve.look.dash], label=label)
    known = np.flatnonzero(np.isfinite(y))
    if curve.stopped and known.size:
        panel.plot(x[known[-1]], y[known[-1]], **_STOPPED)


def _set_scale(panel: Axes, direction: Any, axis: Axis, values: Any, unit: DisplayUnit) -> None:
    """Set scale, limits and lines of an axis."""
    set_limits = panel.set_ylim if direction == "y" else panel.set_xlim
    if axis.names:
        list_lines(panel, axis.names)
    elif axis.linear_below:
        _symmetrical(panel, direction, axis, unit)
    elif is_logarithmic(axis, values):
        mark_powers(panel, direction)
        positive = values[np.isfinite(values) & (values > 0.0)]
        if direction == "y":
            panel.yaxis.set_minor_locator(NullLocator())
            top = positive.max()
            set_limits(max(0.5 * np.percentile(positive, 0.5), top * 10.0**-_DECADES), 2.0 * top)
        else:
            set_limits(positive.min(), positive.max())
    elif axis.extent:
        keep_flat(panel, unit.factor * axis.extent, direction)
    if axis.low is not None:
        set_limits(unit.factor * axis.low, None)
    if axis.high is not None:
        set_limits(None, unit.factor * axis.high)
    if axis.ticks:
        (panel.set_yticks if direction == "y" else panel.set_xticks)(unit.factor * np.asarray(axis.ticks))
    if axis.zero:
        (panel.axhline if direction == "y" else panel.axvline)(0.0, **ZERO)


def _symmetrical(panel: Axes, direction: str, axis: Axis, unit: DisplayUnit) -> None:
    """Make an axis linear below a magnitude and logarithmic beyond it."""
    own, set_scale = (panel.yaxis, panel.set_yscale) if direction == "y" else (panel.xaxis, panel.set_xscale)
    set_scale("symlog", linthresh=axis.linear_below * unit.factor, linscale=0.5)
    own.set_major_locator(FixedLocator((unit.factor * symmetrical_numbers(axis)).tolist()))
    own.set_major_formatter(FuncFormatter(lambda value, _: logarithmic_number(value)))


def _plane(cell: _Cell, time: Any) -> Figure:
    """Draw the only panel of a figure, with equal scales and a margin, and a minimum size for a line or a point."""
    figure, axes = panel_grid(1, 1, width=ONE_COLUMN)
    panel: Axes = axes[0, 0]
    panel.set_aspect("equal")
    _draw(panel, cell, time)
    box = panel.dataLim
    width, height = ((1.0 + 2.0 * _MARGIN) * extent for extent in (box.width, box.height))
    width = max(width, height / (_TALLEST if is_narrow(ONE_COLUMN) else _TALLEST_WIDE)) or 1.0
    height = max(height, _FLATTEST * width)
    middle_x, middle_y = box.x0 + 0.5 * box.width, box.y0 + 0.5 * box.height
    panel.set_xlim(middle_x - 0.5 * width, middle_x + 0.5 * width)
    panel.set_ylim(middle_y - 0.5 * height, middle_y + 0.5 * height)
    return lay_out(figure, axes, panel_height=equal_scales_height(figure, panel))
