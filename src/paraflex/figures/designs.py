"""Table of many designs, with parameters, metrics and status, read from the files of a study, and charts of it."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from paraflex.arrays import Array, Indices, Mask, NDArray
from paraflex.campaign import read_tables
from paraflex.errors import InputError, suggestion
from paraflex.formatting import NO_VALUE, axis_unit, text_symbol
from paraflex.results.metrics import JOINT, METRICS, MOTOR, metric_label
from paraflex.seals import damaged
from .charts import Axis, Chart, Curve, Mark, is_wide, look, stairs
from .entry import figure
from .selection import place_of
from .tables import Table, table_of

# Metrics by which designs are not chosen: those of the solver, and those for which smaller is not always better.
_NOT_JUDGED = tuple(metric.name for metric in METRICS.values() if metric.of_solver or not metric.ranked)
_OF_SOLVER = tuple(metric.name for metric in METRICS.values() if metric.of_solver)
_OF_MEMBERS = tuple(f"{metric.name}." for metric in METRICS.values() if metric.each in (MOTOR, JOINT))
_OF_A_RUN = ("run", "design", "path", "mode", "status", "reason")
_FIRST_COLUMNS, _LAST = ("run", "id", "design", "path", "mode"), ("status", "reason", "time_reached")
# A metric whose relative change is smaller counts as constant.
_NOT_VARIED = 1e-9
# Smallest number of runs for a map over two parameters.
_FEWEST = 4
# Ratio of values from which the axis of a metric is logarithmic.
_WIDE = 50.0
_MARKS: tuple[Mark, ...] = ("dot", "square", "cross", "ring")
# Largest numbers of columns and rows of panels.
_MOST_PARAMETERS, _MOST_METRICS = 3, 3
# Largest number of parameter values with a median each; more values are divided into this number of groups.
_MEDIAN_GROUPS = 12
# Largest number of listed reasons for failures, and the numbers in which they may differ.
_MOST_REASONS, _NUMBER = 12, re.compile(r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?")


@dataclass(frozen=True)
class DesignTable:
    """Table of the runs of many designs.

    Attributes
    ----------
    parameters, metrics : mapping of str to (runs,) array
        Columns by name; NaN where a run has no value.
    units : mapping of str to str
        SI units of parameters and metrics.
    run, design : (runs,) array of int
        Numbers of each run and of its design.
    path, mode, status, reason : (runs,) array of str
        Path and actuation mode of each run, its status, and the reason for a failure.
    logarithmic : frozenset of str
        Parameters whose range is logarithmic.
    """

    parameters: Mapping[str, Array]
    metrics: Mapping[str, Array]
    units: Mapping[str, str]
    run: Indices
    design: Indices
    path: NDArray[np.str_]
    mode: NDArray[np.str_]
    status: NDArray[np.str_]
    reason: NDArray[np.str_]
    logarithmic: frozenset[str] = frozenset()

    @cached_property
    def complete(self) -> Mask:
        """Whether each run is complete, as an array (runs,)."""
        return self.status == "complete"

    def only(self, rows: Mask | NDArray[np.intp]) -> "DesignTable":
        """Return the table restricted to some rows, given as a mask or as indices."""
        columns = (self.parameters, self.metrics)
        parameters, metrics = ({name: values[rows] for name, values in column.items()} for column in columns)
        rest = {name: getattr(self, name)[rows] for name in _OF_A_RUN}
        return replace(self, parameters=parameters, metrics=metrics, **rest)

    def in_modes(self, modes: Sequence[str]) -> "DesignTable":
        """Return the table restricted to some actuation modes."""
        known = list(dict.fromkeys(self.mode.tolist()))
        for mode in modes:
            place_of(mode, known, "mode")
        return self.only(np.isin(self.mode, list(modes)))

    @cached_property
    def series_rows(self) -> dict[tuple[str, str], NDArray[np.intp]]:
        """Rows of the complete runs of each pair of path and mode."""
        found: dict[tuple[str, str], list[int]] = {}
        for row in np.flatnonzero(self.complete):
            found.setdefault((str(self.path[row]), str(self.mode[row])), []).append(int(row))
        return {pair: np.array(rows) for pair, rows in found.items()}

    @property
    def series(self) -> "dict[tuple[str, str], DesignTable]":
        """Complete runs of each pair of path and mode."""
        return {pair: self.only(rows) for pair, rows in self.series_rows.items()}

    def judged_by(self, names: Sequence[str] | None, most: int) -> list[str]:
        """Return the requested metrics; by default at most `most` of those that vary.

        Metrics by which designs are chosen take precedence over others.

        Raises
        ------
        InputError
            A requested metric is not in the table, or no metric varies.
        """
        for name in names or ():
            if name not in self.metrics:
                raise InputError(
                    "not a metric of these results", field="metric", value=name,
                    remedy=suggestion(name, list(self.metrics)),
                )  # fmt: skip
        if names:
            return list(names)
        if not self._varying:
            raise InputError("no metric varies", field="metric", remedy="run more designs, or wider ranges")
        return self._varying[:most]

    @cached_property
    def _varying(self) -> list[str]:
        """Metrics that vary: those by which designs are chosen, if any, else all but those of the solver.

        Metrics of single motors and joints are used only if there are no others.
        """
        varying = [name for name in self.metrics if self._varies(name) and name.partition(".")[0] not in _OF_SOLVER]
        varying = [name for name in varying if _is_judged(name)] or varying
        return [name for name in varying if not name.startswith(_OF_MEMBERS)] or varying

    @property
    def judged(self) -> list[str]:
        """Metrics by which designs are chosen (smaller is better) and which vary; the first one if none varies."""
        if self._varying or not self.complete.any():
            return [name for name in self._varying if _is_judged(name)]
        known = (name for name, values in self.metrics.items() if np.isfinite(values).any())
        return list(filter(_is_judged, known))[:1]

    def values(self, row: int) -> tuple[float, ...]:
        """Return the parameter values of a row's design, in the order of the parameters."""
        return tuple(float(values[row]) for values in self.parameters.values())

    def label(self, row: int) -> str:
        """Return the label of a run: number of its design, its mode if it has one, its path if there are several."""
        several = len(set(self.path.tolist())) > 1
        return " ".join(filter(None, [f"#{self.design[row]}", str(self.mode[row]), str(self.path[row]) * several]))

    @property
    def varied(self) -> list[str]:
        """Parameters that vary among the runs; all of them if none varies."""
        spread = [name for name, values in self.parameters.items() if np.unique(values).size > 1]
        return spread or list(self.parameters)

    @property
    def spans_plane(self) -> bool:
        """Whether two parameters or more vary, in enough runs of the first path and mode for a map over two of them."""
        return len(self.varied) > 1 and any(one.run.size >= _FEWEST for one in list(self.series.values())[:1])

    def axis(self, name: str) -> Axis:
        """Return the axis of a parameter or metric."""
        unit = self.units.get(name, "") or "1"
        if name in self.parameters:
            values, label, log = self.parameters[name], name.replace("_", " "), name in self.logarithmic
        else:
            values, label = np.where(self.complete, self.metrics[name], np.nan), column_label(name)
            log = not (values <= 0.0).any() and is_wide(values, _WIDE)
        return Axis(text_symbol(label), unit, log=log, shown=axis_unit(unit, values))

    def column(self, name: str) -> Array:
        """Return the values of a parameter or metric in SI units."""
        return self.parameters[name] if name in self.parameters else self.metrics[name]

    def labelled(self, name: str) -> tuple[str, float]:
        """Return the axis label of a parameter or metric, and the factor of its values to the unit of the label."""
        axis = self.axis(name)
        unit = axis.unit_for(self.column(name))
        return axis.label(unit), unit.factor

    def series_name(self, pair: tuple[str, str]) -> str:
        """Return a distinctive name of the runs of a path and mode."""
        path, mode = pair
        several = len(set(self.path.tolist())) > 1
        return ", ".join([path] * several + [f"mode {mode}"] * bool(mode)) or "runs"

    def _varies(self, name: str) -> bool:
        values = self.metrics[name][self.complete]
        values = values[np.isfinite(values)]
        return values.size > 1 and float(np.ptp(values)) > _NOT_VARIED * float(np.max(np.abs(values)))


def _is_judged(column: str) -> bool:
    return column.partition(".")[0] not in _NOT_JUDGED


def column_label(metric: str) -> str:
    """Return the label of a metric: "RMS tracking error"; "peak torque of τ₁" for a metric of one motor."""
    return metric_label(metric, text_symbol)


def read_designs(files: Sequence[Path]) -> DesignTable:
    """Read the table of a study from the files of its folder that `tables_of` finds, in the order of the runs."""
    table = read_tables(files)
    if not {*_FIRST_COLUMNS, *_LAST} <= set(table.column_names):
        raise InputError(
            "not a table of designs", field=str(files[0]), remedy="name a results.parquet that paraflex wrote"
        )
    try:
        return _in_order(table)
    except (KeyError, TypeError, ValueError) as error:
        raise damaged(files[0], "not a table of numbers", "delete it and run the same command again") from error


def _in_order(table: Any) -> DesignTable:
    names = table.column_names
    first, last = names.index("mode") + 1, names.index("status")
    judged = [name for name in names[last:] if name not in _LAST and not name.startswith("slope.")]
    own = (*names[first:last], *judged)
    columns = {name: table[name].to_numpy().astype(float) for name in own}
    units = {field.name: (field.metadata or {}).get(b"unit", b"").decode() for field in table.schema}
    texts = {key: np.array([*map(str, table[key].to_pylist())], str) for key in ("path", "mode", "status", "reason")}
    designs = DesignTable(
        parameters={name: columns[name] for name in names[first:last]},
        metrics={name: columns[name] for name in judged},
        units={name: units[name] for name in own},
        run=table["run"].to_numpy().astype(int),
        design=table["design"].to_numpy().astype(int),
        **texts,  # pyright: ignore[reportArgumentType]
    )
    order = np.argsort(designs.run, kind="stable")
    return designs if np.array_equal(order, np.arange(order.size)) else designs.only(order)


def in_conflict(table: DesignTable, judged: Sequence[str]) -> list[str]:
    """Return the first metric and the one with which its Pareto fronts are longest; fewer if there are not two."""
    if len(judged) < 2:
        return list(judged)
    first, *others = judged
    return [first, max(others, key=lambda other: sum(rows.size for rows in fronts(table, first, other)))]


def fronts(table: DesignTable, across: str, up: str) -> list[NDArray[np.intp]]:
    """Return the rows of each path and mode that no other row dominates in two metrics."""
    x, y = table.metrics[across], table.metrics[up]
    return [rows[undominated(x[rows], y[rows])] for rows in table.series_rows.values()]


def undominated(x: Array, y: Array) -> NDArray[np.intp]:
    """Return the indices of the finite points (x, y) that no other point dominates (smaller is better), sorted by x."""
    order = np.lexsort((y, x))
    order = order[np.isfinite(x[order]) & np.isfinite(y[order])]
    before = np.minimum.accumulate(np.append(np.inf, y[order]))[:-1]
    return order[y[order] < before]


# Charts


@figure("metrics against parameters", takes="designs", panels="choices", height=42.0)
def response_curves(table: DesignTable, metrics: Sequence[str] | None = None) -> Iterator[Chart]:
    """Yield charts of metrics against parameters: a chart for each parameter, a mark for each run.

    Colours distinguish paths and modes. If one parameter varies, its runs are joined by a line; otherwise the line is
    the median over the other parameters, at each value or in twelve groups of equally many runs.

    Parameters
    ----------
    table : DesignTable
        Runs.
    metrics : sequence of str, optional
        Metrics to show; by default the first three that vary.
    """
    rows = table.judged_by(metrics, _MOST_METRICS)
    axes = [table.axis(metric) for metric in rows]
    for parameter in table.varied[:_MOST_PARAMETERS]:
        curves = []
        for k, (pair, runs) in enumerate(table.series.items()):
            x, name = runs.parameters[parameter], table.series_name(pair)
            order, alone = np.argsort(x, kind="stable"), len(table.varied) == 1
            for choice, metric in enumerate(rows):
                y = runs.metrics[metric]
                if alone:
                    curves.append(_marked(k, name, x[order], y[order], choice=choice, line=True))
                    continue
                middles = _medians(x[order], y[order])
                curves += [_marked(k, "", x, y, choice=choice, faint=True),
                           Curve(f"{name}, median", middles[1], middles[0], look(k), choice=choice)]  # fmt: skip
        yield Chart(f"responses-{parameter}", "", axes, curves, table.axis(parameter), [one.name for one in axes])


@figure("two metrics of every design, and the Pareto front", takes="designs", columns=1, height=58.0)
def pareto_front(table: DesignTable, metrics: Sequence[str] | None = None) -> Iterator[Chart]:
    """Yield the chart of two metrics of every design, and the Pareto front of designs that no other one dominates.

    Parameters
    ----------
    table : DesignTable
        Runs.
    metrics : sequence of str, optional
        Two metrics; by default the first that varies, and the one for which most designs are on the front.
    """
    chosen = table.judged_by(metrics, 2) if metrics else in_conflict(table, table.judged_by(None, len(table.metrics)))
    if len(chosen) != 2:
        raise InputError(
            "a Pareto front is of two metrics", field="metric", value=", ".join(chosen), remedy="name two that vary"
        )
    curves = []
    for k, (pair, runs) in enumerate(table.series.items()):
        x, y = (runs.metrics[name] for name in chosen)
        front, name = undominated(x, y), table.series_name(pair)
        corners = stairs(x[front], y[front])
        curves += [_marked(k, f"{name}, designs", x, y, faint=True), Curve("", corners[1], corners[0], look(k)),
                   _marked(k, f"{name}, front", x[front], y[front])]  # fmt: skip
    across, up = map(table.axis, chosen)
    yield Chart("pareto", "Pareto front", up, curves, across)


def _marked(k: int, name: str, x: Array, y: Array, **more: Any) -> Curve:
    """Return the marks of the k-th series of runs."""
    return Curve(name, y, x, look(k), mark=_MARKS[k % len(_MARKS)], **more)


def _medians(x: Array, y: Array) -> tuple[Array, Array]:
    """Return medians of values sorted by x, at each x or in groups of equal size."""
    values = np.unique(x)
    if values.size <= _MEDIAN_GROUPS:
        return values, np.array([np.nanmedian(y[x == value]) for value in values])
    split = np.array_split(np.arange(x.size), _MEDIAN_GROUPS)
    across, up = (np.array([np.nanmedian(each[part]) for part in split]) for each in (x, y))
    return across, up


# Tables


def failure_table(table: DesignTable) -> Table:
    """Return the table of the reasons why runs are not complete; reasons that differ only in numbers are one row."""
    groups: dict[tuple[str, str], list[str]] = {}
    for status, reason in zip(table.status.tolist(), table.reason.tolist(), strict=True):
        if status != "complete":
            groups.setdefault((status, _NUMBER.sub("#", reason)), []).append(reason)
    most = sorted(groups.items(), key=lambda group: -len(group[1]))
    rows = [(status or NO_VALUE, len(texts), texts[0]) for (status, _), texts in most[:_MOST_REASONS]]
    if left := sum(len(texts) for _, texts in most[_MOST_REASONS:]):
        rows.append((NO_VALUE, left, "other reasons; the table has them"))
    heads = [("status", ""), ("runs", ""), ("reason", "one of those alike")]
    return table_of("Runs that are not complete", heads, rows)
