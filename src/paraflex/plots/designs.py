"""Table of many designs, with parameters, metrics and status, read from the files of a study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paraflex.campaign import read_tables
from paraflex.errors import InputError, suggestion
from paraflex.plots.labels import display_unit, metric_name
from paraflex.plots.selection import place_of
from paraflex.results.metrics import JOINT, METRICS, MOTOR
from paraflex.seals import damaged

Array = NDArray[np.float64]

# Metrics by which designs are not chosen: those of the solver, and those for which smaller is not always better.
_NOT_JUDGED = tuple(metric.name for metric in METRICS.values() if metric.of_solver or not metric.ranked)
_OF_SOLVER = tuple(metric.name for metric in METRICS.values() if metric.of_solver)
_OF_MEMBERS = tuple(f"{metric.name}." for metric in METRICS.values() if metric.each in (MOTOR, JOINT))
_OF_A_RUN = ("run", "design", "path", "mode", "status", "reason")
_FIRST_COLUMNS, _LAST = ("run", "id", "design", "path", "mode"), ("status", "reason", "time_reached")
# A metric whose relative change is smaller counts as constant.
_NOT_VARIED = 1e-9


@dataclass(frozen=True)
class DesignTable:
    """Table of the runs of many designs.

    Attributes
    ----------
    parameters, metrics : mapping of str to (runs,) array
        Columns by name; NaN where a run has no value.
    units : mapping of str to str
        Units of the metrics.
    run, design : (runs,) array of int
        Numbers of each run and of its design.
    path, mode, status, reason : (runs,) array of str
        Path and actuation mode of each run, its status, and the reason for a failure.
    """

    parameters: Mapping[str, Array]
    metrics: Mapping[str, Array]
    units: Mapping[str, str]
    run: NDArray[np.int64]
    design: NDArray[np.int64]
    path: NDArray[np.str_]
    mode: NDArray[np.str_]
    status: NDArray[np.str_]
    reason: NDArray[np.str_]

    @cached_property
    def complete(self) -> NDArray[np.bool_]:
        """Whether each run is complete, as an array (runs,)."""
        return self.status == "complete"

    def only(self, rows: NDArray[np.bool_] | NDArray[np.intp]) -> DesignTable:
        """Return the table restricted to some rows, given as a mask or as indices."""
        columns = (self.parameters, self.metrics)
        parameters, metrics = ({name: values[rows] for name, values in column.items()} for column in columns)
        rest = {name: getattr(self, name)[rows] for name in _OF_A_RUN}
        return replace(self, parameters=parameters, metrics=metrics, **rest)

    def in_modes(self, modes: Sequence[str]) -> DesignTable:
        """Return the table restricted to some actuation modes."""
        known = list(dict.fromkeys(self.mode.tolist()))
        for mode in modes:
            place_of(mode, known, "mode")
        return self.only(np.isin(self.mode, list(modes)))

    @property
    def series(self) -> dict[tuple[str, str], DesignTable]:
        """Complete runs of each pair of path and mode."""
        done = self.only(self.complete)
        pairs = dict.fromkeys(zip(done.path.tolist(), done.mode.tolist(), strict=True))
        return {pair: done.only((done.path == pair[0]) & (done.mode == pair[1])) for pair in pairs}

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
        # Metrics of single motors and joints are used only if there are no others.
        varying = [name for name in self.metrics if self._varies(name) and name.partition(".")[0] not in _OF_SOLVER]
        varying = [name for name in varying if _is_judged(name)] or varying
        chosen = ([name for name in varying if not name.startswith(_OF_MEMBERS)] or varying)[:most]
        if not chosen:
            raise InputError("no metric varies", field="metric", remedy="run more designs, or wider ranges")
        return chosen

    @property
    def judged(self) -> list[str]:
        """Metrics by which designs are chosen (smaller is better) and which vary; the first one if none varies."""
        if not self.complete.any():
            return []
        try:
            found = self.judged_by(None, len(self.metrics))
        except InputError:
            found = [name for name, values in self.metrics.items() if np.isfinite(values).any()]
            return [name for name in found if _is_judged(name)][:1]
        return [name for name in found if _is_judged(name)]

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

    def labelled(self, metric: str) -> tuple[str, float]:
        """Return the axis label of a metric and the factor that converts its values to the unit of the label."""
        unit, factor = display_unit(self.units.get(metric, ""), self.metrics[metric])
        printed = metric_name(metric)
        return (f"{printed} [{unit}]" if unit not in ("", "1") else printed), factor

    def _varies(self, name: str) -> bool:
        values = self.metrics[name][self.complete]
        values = values[np.isfinite(values)]
        return values.size > 1 and float(np.ptp(values)) > _NOT_VARIED * float(np.max(np.abs(values)))


def _is_judged(column: str) -> bool:
    return column.partition(".")[0] not in _NOT_JUDGED


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
    columns = {name: table[name].to_numpy().astype(float) for name in (*names[first:last], *judged)}
    units = {field.name: (field.metadata or {}).get(b"unit", b"").decode() for field in table.schema}
    texts = {key: np.array([*map(str, table[key].to_pylist())], str) for key in ("path", "mode", "status", "reason")}
    designs = DesignTable(
        parameters={name: columns[name] for name in names[first:last]},
        metrics={name: columns[name] for name in judged},
        units={name: units[name] for name in judged},
        run=table["run"].to_numpy().astype(int),
        design=table["design"].to_numpy().astype(int),
        **texts,
    )
    order = np.argsort(designs.run, kind="stable")
    return designs if np.array_equal(order, np.arange(order.size)) else designs.only(order)


def in_conflict(table: DesignTable, judged: Sequence[str]) -> list[str]:
    """Return the first metric and the one with which its Pareto fronts are longest; fewer if there are not two."""
    if len(judged) < 2:
        return list(judged)
    first, *others = judged
    series = table.series.values()

    def length(other: str) -> int:
        return sum(undominated(runs.metrics[first], runs.metrics[other]).size for runs in series)

    return [first, max(others, key=length)]


def undominated(x: Array, y: Array) -> NDArray[np.intp]:
    """Return the indices of the points (x, y) that no other point dominates (smaller is better), sorted by x."""
    order = np.lexsort((y, x))
    least = np.minimum.accumulate(y[order])
    better = np.concatenate([[True], y[order][1:] < least[:-1]]) if order.size else np.zeros(0, dtype=bool)
    return order[better]
