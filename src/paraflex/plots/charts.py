"""Figures of charts for print: each figure of the catalogue as a plotting function, drawn by Matplotlib.

Scales are linear, logarithmic with numbers at powers of ten, symmetrical logarithmic, or lists of names. Numbers are
plain text because the layout computes their width from that of the digits.
"""

import inspect
import math
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any, Literal

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, LogLocator, MaxNLocator, NullFormatter, NullLocator

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array
from paraflex.errors import InputError
from paraflex.figures.abscissae import drawn_over
from paraflex.figures.catalogue import all_figures, figures_of_kind
from paraflex.figures.charts import TIME, Axis, Chart, Curve, is_logarithmic, joined, symmetrical_numbers
from paraflex.figures.entry import Figure as CatalogueFigure, prepared
from paraflex.figures.selection import default_mode, names_of, prototype_pair
from paraflex.formatting import ROUNDING, logarithmic_number, peak, shortened
from paraflex.units import DisplayUnit
from .given import drawn
from .labels import mathematics, plain
from .layout import ONE_COLUMN, TWO_COLUMNS, figure_width, finish_plane, is_narrow, label_outer_time, lay_out, panels
from .style import ink, journal_style, line_colours, shade

# Height of a line in a list of names [mm].
LIST_LINE = 5.5
# Share by which an axis with marks is longer than its values.
BESIDE = 0.06
# Decades of a vertical logarithmic axis shown below its largest value.
_DECADES = 9.0
# Ratio of data above which only powers of ten are numbered; numbers side by side need more room.
_WIDE = {"x": 40.0, "y": 200.0}
# Difference, in the unit of the axis, below which data are constant up to rounding.
_NOTHING = 1e-9
# Steps of ticks of angles, times a power of ten [deg].
_DEGREES = [1, 1.5, 2, 3, 4.5, 6, 9, 10]
_ZERO: dict[str, Any] = {"color": "0.7", "linewidth": 0.5, "zorder": 0.5}


def set_scale(
    panel: Axes, direction: Literal["x", "y"], axis: Axis, values: Array, unit: DisplayUnit, *, marked: bool = False
) -> None:
    """Set scale, limits and lines of an axis; if all of its values are `marked`, there is room beside them."""
    own, set_limits = getattr(panel, f"{direction}axis"), getattr(panel, f"set_{direction}lim")
    set_kind = getattr(panel, f"set_{direction}scale")
    if axis.linear_below:
        set_kind("symlog", linthresh=axis.linear_below * unit.factor, linscale=0.5)
        own.set_major_locator(FixedLocator((unit.factor * symmetrical_numbers(axis)).tolist()))
        own.set_major_formatter(_written)
    elif is_logarithmic(axis, values):
        set_kind("log")
        several = own.get_data_interval()[1] > _WIDE[direction] * own.get_minpos()
        own.set_major_locator(LogLocator(numticks=12) if several else LogLocator(subs=(1.0, 2.0, 5.0)))
        own.set_major_formatter(_written)
        own.set_minor_formatter(NullFormatter())
        positive = values[np.isfinite(values) & (values > 0.0)]
        if direction == "y":
            own.set_minor_locator(NullLocator())
            top = positive.max()
            set_limits(max(0.5 * np.percentile(positive, 0.5), top * 10.0**-_DECADES), 2.0 * top)
        else:
            margin = (positive.max() / positive.min()) ** BESIDE if marked else 1.0
            set_limits(positive.min() / margin, positive.max() * margin)
    elif axis.extent:
        # Data that vary by less than a millionth of the extent appear constant.
        scale, (low, high) = unit.factor * axis.extent, own.get_data_interval()
        if not high - low > max(1e-6 * scale, _NOTHING):  # also true of axes without data
            middle = 0.5 * (low + high) if math.isfinite(low) and max(abs(low), abs(high)) > _NOTHING else 0.0
            half = 0.052 * scale if scale > _NOTHING else 1.04
            set_limits(middle - half, middle + half)
    if unit.name == "deg" and own.get_scale() == "linear":
        own.set_major_locator(MaxNLocator(steps=_DEGREES))
    if axis.low is not None:
        set_limits(unit.factor * axis.low, None)
    if axis.high is not None:
        set_limits(None, unit.factor * axis.high)
    if axis.ticks:
        own.set_ticks(unit.factor * np.asarray(axis.ticks))
    if axis.zero:
        (panel.axhline if direction == "y" else panel.axvline)(0.0, **_ZERO)


def _written(value: float, _: int) -> str:
    return logarithmic_number(value)


def list_lines(panel: Axes, names: Sequence[str]) -> None:
    """Label the lines of a panel with names, from the top down."""
    panel.set_yticks(range(len(names)), [plain(name) for name in names])
    panel.set_ylim(len(names) - 0.4, -0.6)


# Largest number of panels for members below one another in a figure of one column, and of those of designs.
_MOST_BELOW, _MOST_STACKED = 12, 4
# Kinds of results whose figures may have curves over time.
_OF_RUNS = ("tracking", "motion", "verification")
_MARKS = {"ring": "o", "cross": "x", "square": "s", "dot": "o", "triangle": "^", "diamond": "D"}
# Number of marks from which they are smaller; sizes of few, of many and of faint marks, and of squares on curves [pt].
_MANY, _SIZE, _SMALL, _FAINT, _SQUARE = 30, 4.0, 2.8, 2.4, 3.0
# Heights of the thinnest bars, and of one of several marks beside a name [mm].
_THINNEST, _MARK_LINE = 1.8, 2.6
# Dashes by their numbers in a look.
_DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1, 1)), (0, (5, 1.5, 1, 1.5)), (0, (9, 2)))
_DESIRED: dict[str, Any] = {"linestyle": (0, (4, 2)), "linewidth": 0.8, "zorder": 2.5}
_STOPPED: dict[str, Any] = {
    "linestyle": "none", "marker": "x", "markersize": 4.5, "markeredgewidth": 1.2, "zorder": 3.0,
    "label": "the run stopped",
}  # fmt: skip
_LEVEL: dict[str, Any] = {"color": "0.5", "linestyle": (0, (5, 1.5)), "linewidth": 0.7, "zorder": 1.0}


class _Cell:
    """Panel of a printed figure: a chart with the run and the choice that it shows, and its title."""

    def __init__(self, chart: Chart, run: int | None, choice: int | None, title: str) -> None:
        self.chart, self.run, self.choice, self.title = chart, run, choice, title

    @property
    def curves(self) -> list[Curve]:
        """Curves of the panel: those of other runs are left out if a run is selected."""
        found = self.chart.shown(self.run, self.choice)
        return [curve for curve in found
                if self.run is None or curve.shown is not None or curve.run in (None, self.run)]  # fmt: skip


@cache
def plotting_function(name: str) -> Callable[..., Figure]:
    """Return the plotting function of a figure: of results or their folder, a mode, models, and options."""
    entry = all_figures()[name]
    assert entry.charts is not None
    own = list(inspect.signature(entry.charts).parameters.values())
    kinds: dict[str, Any] = {"mode": str | None, "models": Sequence[str] | None}
    chosen = {"mode": ["mode"], "models": ["mode", "models"]}.get(entry.takes, [])
    more = [inspect.Parameter(one, inspect.Parameter.POSITIONAL_OR_KEYWORD, default=None, annotation=kinds[one])
            for one in chosen]  # fmt: skip
    abscissa = inspect.Parameter("over", inspect.Parameter.KEYWORD_ONLY, default=TIME.name, annotation=str)
    last = [abscissa] if any(name in figures_of_kind(kind) for kind in _OF_RUNS) else []
    shown = inspect.Signature([own[0], *more, *own[1:], *last])

    def plot(*args: Any, **given: Any) -> Figure:
        options = shown.bind(*args, **given).arguments
        over = options.pop(abscissa.name, TIME.name)
        data = options.pop(own[0].name, None)
        mode, models = (options.pop(one, None) if one in chosen else None for one in ("mode", "models"))
        if chosen and mode is None and "mode" in getattr(data, "dims", ()):
            mode = default_mode(data)
        if "models" in chosen and models is None:
            models = prototype_pair(data)
        found = prepared(data, mode, models)
        lacking = [one for one in entry.variables if one not in found]
        if lacking and not isinstance(found, xr.Dataset):
            raise KeyError(lacking[0])
        charts = entry.describe(found, **{**entry.defaults(found), **options}) if entry.has_variables(found) else []
        if not charts:
            raise InputError(entry.missing[0], field="figure", value=name, remedy=entry.missing[1])
        if over != TIME.name:
            charts = drawn_over(charts, found, over)
        if not isinstance(found, xr.Dataset) or "time" not in found.dims:
            return print_figure(entry, charts)
        # Runs of a verification are those of all models in the first mode, then in the next one.
        return print_figure(entry, charts, found["time"].values, names_of(found, "mode"), found.sizes.get("model", 1))

    plot.__name__ = plot.__qualname__ = name
    # Annotations are evaluated where they are written.
    plot.__module__ = entry.charts.__module__
    plot.__doc__ = f"Plot {entry.shows}.\n\n{inspect.getdoc(entry.charts)}"
    plot.__signature__ = shown  # type: ignore[attr-defined]
    return drawn(plot) if entry.takes != "nothing" else journal_style()(checked_arguments()(plot))


def __getattr__(name: str) -> Callable[..., Figure]:
    if name.startswith("_") or name not in all_figures():
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return plotting_function(name)


def print_figure(
    entry: CatalogueFigure, charts: Sequence[Chart], time: Any = None, modes: Sequence[str] = (), each: int = 1
) -> Figure:
    """Draw the charts of a figure.

    Parameters
    ----------
    entry : CatalogueFigure
        Entry of the catalogue, with the layout.
    charts : sequence of Chart
        Charts.
    time : (k,) array, optional
        Times of the runs [s], for curves without abscissae.
    modes : sequence of str
        Modes of the runs.
    each : int
        Number of runs in each mode.
    """
    rows = _cells(entry, charts, {mode: each * k for k, mode in enumerate(modes)})
    if len(rows) == len(rows[0]) == 1 and rows[0][0].chart.equal:
        return _plane(rows[0][0], time, entry.curves)
    cells = [cell for row in rows for cell in row]
    columns = _columns(entry, len(cells), charts)
    figure, axes = panels(len(cells), columns, width=ONE_COLUMN if len(cells) == 1 and entry.columns else TWO_COLUMNS)
    for k, (panel, cell) in enumerate(zip(axes.flat, cells, strict=False)):
        # Panels side by side share the names on their axes.
        named = k % columns == 0 or cell.chart.axis(None).names != cells[k - 1].chart.axis(None).names
        _draw(panel, cell, time, entry.curves, named=named)
    if entry.shared:
        _share_scales(axes)
    if entry.panels == "choices":
        _label_rows(axes)
    if all(cell.chart.over_time for cell in cells):
        for panel in axes.flat:
            panel.set_xlabel("")
        label_outer_time(axes)
    if entry.panels != "charts":
        _label_rows(axes)
    return lay_out(figure, axes, panel_height=max(map(_list_height, charts)) or entry.height)


def _label_rows(axes: Any) -> None:
    """Remove the label of the vertical axis from panels beside one with the same label."""
    for row in axes:
        for panel in row[1:]:
            if panel.get_ylabel() == row[0].get_ylabel():
                panel.set_ylabel("")


def _list_height(chart: Chart) -> float:
    """Return the height of a panel that lists names, with room for all marks and bars of each [mm]; 0 without names."""
    names = len(chart.axis(None).names)
    bars = [_THINNEST / one.thickness for one in chart.curves if one.mark == "bar"]
    return max(LIST_LINE, _MARK_LINE * _marks(chart) + 1.5, *bars) * names + 2.0 if names else 0.0


def _marks(chart: Chart) -> int:
    """Return the number of marks beside each name of a list."""
    return sum(curve.mark not in ("", "bar") and bool(curve.name and np.size(curve.y)) for curve in chart.curves)


def _columns(entry: CatalogueFigure, count: int, charts: Sequence[Chart]) -> int:
    if len(charts) > 1 and entry.panels != "charts":
        return len(charts) if entry.panels == "choices" else count // len(charts)
    if entry.panels == "runs":
        return 2 if count == 4 or (is_narrow() and count > 1) else min(count, entry.columns or 3)
    if is_narrow():
        return 1
    return min(count, entry.columns or (1 if charts[0].over_time else 3))


def _share_scales(axes: Any) -> None:
    """Set the same vertical limits for all panels of a row, symmetrical about zero."""
    for row in axes:
        values = [line.get_ydata() for panel in row if panel.get_visible() for line in panel.lines]
        largest = peak(joined(values))
        for panel in row:
            panel.set_ylim(*((-1.08 * largest, 1.08 * largest) if largest > ROUNDING else (-1.0, 1.0)))


def _cells(entry: CatalogueFigure, charts: Sequence[Chart], runs: Mapping[str, int]) -> list[list[_Cell]]:
    """Return rows of panels; `runs` are the first runs of all modes."""
    run = 0 if entry.takes in ("mode", "models") else None
    several = len(charts) > 1 or entry.takes == "run"
    if entry.panels == "runs":
        return [[_Cell(chart, r, 0, _title_of_run(chart, k, name, several)) for k, (name, r) in enumerate(runs.items())]
                for chart in charts]  # fmt: skip
    if entry.panels == "choices":
        members = max(1, *(len(chart.choices) - chart.overview for chart in charts))
        members = min(members, entry.members or members)
        if is_narrow():
            below = _MOST_STACKED if entry.takes == "designs" else _MOST_BELOW
            members = min(members, max(1, below // len(charts)))
        return [[_member(chart, run, k) for chart in charts] for k in range(members)]
    return [[_Cell(chart, run, 0 if chart.choices else None, chart.title if several else "")] for chart in charts]


def _title_of_run(chart: Chart, k: int, name: str, several: bool) -> str:
    # Without the name that the axis has: "from the desired position".
    title = (chart.title[:1].lower() + chart.title[1:]).removeprefix(chart.axis(None).name).strip()
    words = [name, *([title] if several else []), *chart.of_runs[k : k + 1]]
    return ": ".join(filter(None, words))


def _member(chart: Chart, run: int | None, k: int) -> _Cell:
    """Return the panel of the k-th member of a chart."""
    if not chart.choices:
        names = {curve.name for curve in chart.curves if not curve.desired}
        return _Cell(chart, run, None, f"{names.pop()}: {chart.axis(None).name}" if len(names) == 1 else chart.title)
    choice = k + chart.overview
    title, name = shortened(chart.choices[choice]), chart.axis(choice).name
    return _Cell(chart, run, choice, "" if title == name else f"{title}: {name}" if name else title)


def _draw(panel: Axes, cell: _Cell, time: Any, most: int, *, named: bool = True) -> None:
    """Draw the curves, marks and axes of a panel."""
    chart, curves = cell.chart, cell.curves
    units, axis = chart.shown_units(), chart.axis(cell.choice)
    unit = units.of(cell.choice)
    shown, note = _largest(curves, most)
    title = ", ".join(filter(None, (cell.title, note)))
    single = len({curve.look.colour for curve in shown if not (curve.desired or curve.mark)}) == 1
    for curve in shown:
        _draw_curve(panel, curve, time, units.x, unit, single=single)
    for level in chart.levels:
        panel.axhline(unit.factor * level, **_LEVEL)
    if chart.over_time and time is not None and time[0] < time[-1]:
        panel.set_xlim(time[0], time[-1])
    if not chart.over_time and any(curve.mark for curve in shown):
        panel.margins(x=BESIDE)
    set_scale(panel, "y", axis, joined(unit.factor * np.asarray(curve.y, dtype=float) for curve in shown), unit)
    xs = joined(units.x.factor * np.asarray(curve.x, dtype=float) for curve in shown if curve.x is not None)
    set_scale(panel, "x", chart.x, xs, units.x, marked=bool(shown) and all(curve.mark for curve in shown))
    for span in chart.spans:
        label = span.name if not is_narrow(figure_width(panel)) else span.name.replace("the desired", "the")
        low, high = units.x.factor * span.low, units.x.factor * span.high
        panel.axvspan(low, min(high, panel.get_xlim()[1]), color=shade(), linewidth=0.0, zorder=0.0, label=label)
    if axis.names:
        list_lines(panel, [shortened(name) for name in axis.names] if named else [""] * len(axis.names))
        for line in range(len(axis.names) - 1 if _marks(chart) > 1 else 0):
            panel.axhline(line + 0.5, color="0.85", linewidth=0.5, zorder=0.5)
    if axis.names or panel.get_xscale() == panel.get_yscale() == "log":
        panel.grid(axis="x" if axis.names else "both", color="0.9", linewidth=0.4)
    panel.set_title(mathematics(title))
    panel.set_ylabel(mathematics(axis.label(unit, short=cell.title.endswith(f": {axis.name}"))))
    panel.set_xlabel(mathematics(chart.x.label(units.x)))


def _largest(curves: Sequence[Curve], most: int) -> tuple[list[Curve], str]:
    """Return marks, the lines with the largest peaks (at most `most` names), and "7 of 8, the largest"."""
    peaks: dict[str, float] = {}
    for curve in curves:
        if curve.name and not (curve.desired or curve.mark):
            peaks[curve.name] = max(peaks.get(curve.name, 0.0), peak(curve.y))
    if len(peaks) <= most:
        return list(curves), ""
    left_out = sorted(peaks, key=lambda name: -peaks[name])[most:]
    kept = [curve for curve in curves if curve.desired or curve.name not in left_out]
    return kept, f"{most} of {len(peaks)}, the largest"


def _draw_curve(panel: Axes, curve: Curve, time: Any, x_unit: DisplayUnit, unit: DisplayUnit, *, single: bool) -> None:
    y = unit.factor * np.asarray(curve.y, dtype=float)
    x = time if curve.x is None else x_unit.factor * np.asarray(curve.x, dtype=float)
    colours = line_colours()
    colour = ink() if curve.look.colour is None else colours[curve.look.colour % len(colours)]
    label = mathematics(curve.name) if curve.name else None
    if curve.mark == "bar":
        panel.barh(y, x, height=curve.thickness, color=colour, linewidth=0.0, label=label)
        return
    if curve.mark:
        size = _SQUARE if curve.mark == "square" else _SIZE if y.size <= _MANY else _SMALL
        pale: dict[str, Any] = {}
        if curve.faint:
            size, pale = _FAINT, {"alpha": max(0.15, min(0.6, 40.0 / max(y.size, 1))), "markeredgewidth": 0.6}
        panel.plot(x, y, linestyle=_DASHES[curve.look.dash] if curve.line else "", marker=_MARKS[curve.mark],
                   color=colour, label=label, markersize=curve.size * size, clip_on=curve.mark != "cross" or not y.size,
                   markerfacecolor="white" if curve.mark == "ring" else colour, **pale)  # fmt: skip
        return
    if curve.desired and (single or curve.look.colour is None):
        panel.plot(x, y, label=label, color=ink(), **_DESIRED)
        return
    panel.plot(x, y, color=colour, linestyle=_DASHES[curve.look.dash], label=label)
    known = np.flatnonzero(np.isfinite(y))
    if curve.stopped and known.size:
        panel.plot(x[known[-1]], y[known[-1]], color=ink(), **_STOPPED)


def _plane(cell: _Cell, time: Any, most: int) -> Figure:
    """Draw the only panel of a figure, with equal scales and a margin, and a minimum size for a line or a point."""
    figure, axes = panels(1, 1, width=ONE_COLUMN)
    panel: Axes = axes[0, 0]
    panel.set_aspect("equal")
    _draw(panel, cell, time, most)
    return finish_plane(figure, panel)
