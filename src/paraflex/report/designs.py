"""Many designs in a page: which are looked at closely, which are drawn at all, and their numbers as columns."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from paraflex.errors import InputError
from paraflex.plots.designs import DesignTable, read_designs
from paraflex.plots.labels import METRIC_NAMES
from paraflex.plots.responses import undominated
from paraflex.report.curves import unit_for
from paraflex.report.page import Column
from paraflex.report.text import symbol

# Rows drawn at most, runs looked at closely, the best of the first metric and of the front among them.
MOST_ROWS, MOST_RUNS, _BEST, _FRONT = 5000, 8, 3, 2
# Metrics whose fronts are kept whatever is left out, and reasons of failures that are told.
_FRONTS, _REASONS = 8, 12
_COMPLETE = "complete"
_NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?")
# A metric that spans so much is drawn on a logarithmic axis, and a range that is logarithmic itself.
_WIDE, _WIDE_RANGE = 50.0, 10.0


@dataclass(frozen=True)
class Studied:
    """The rows of a study.

    Attributes
    ----------
    table : DesignTable
    run, design : (rows,) array of int
    status, reason : (rows,) array of str
    """

    table: DesignTable
    run: NDArray[np.int64]
    design: NDArray[np.int64]
    status: NDArray[np.str_]
    reason: NDArray[np.str_]

    @property
    def counts(self) -> dict[str, int]:
        """How many runs ended how."""
        return dict(Counter(self.status.tolist()))

    @property
    def judged(self) -> list[str]:
        """The metrics that designs are chosen by; none where none varies."""
        if not self.table.complete.any():
            return []
        try:
            return self.table.judged_by(None, len(self.table.metrics))
        except InputError:
            known = [name for name, values in self.table.metrics.items() if np.isfinite(values).any()]
            return known[:1]

    def only(self, rows: NDArray[np.intp]) -> Studied:
        """Some of the rows, by their numbers."""
        parts = {name: getattr(self, name)[rows] for name in ("run", "design", "status", "reason")}
        return replace(self, table=self.table.only(rows), **parts)  # pyright: ignore[reportArgumentType]

    def values(self, row: int) -> tuple[float, ...]:
        """The numbers of a row's design, in the order of the parameters."""
        return tuple(float(values[row]) for values in self.table.parameters.values())

    def label(self, row: int) -> str:
        """What a run is called: its design's number, its mode, and its path where there are several."""
        several = len(set(self.table.path.tolist())) > 1
        return f"#{self.design[row]} {self.table.mode[row]}" + (f" {self.table.path[row]}" if several else "")


class Picked(NamedTuple):
    """A run that is looked at closely, and what it is best in."""

    row: int
    why: tuple[str, ...]


def read_studied(files: Sequence[Path]) -> Studied:
    """The rows of a study, from `results.parquet` or from its parts.

    Raises
    ------
    InputError
        A file that cannot be read, or is none of ours.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = read_designs(files)
    told = pa.concat_tables([pq.read_table(file, columns=["run", "design", "status", "reason"]) for file in files])
    texts = {name: np.array(told[name].to_pylist(), dtype=str) for name in ("status", "reason")}
    studied = Studied(table, told["run"].to_numpy(), told["design"].to_numpy(), **texts)
    order = np.argsort(studied.run, kind="stable")
    return studied if np.array_equal(order, np.arange(order.size)) else studied.only(order)


def best_runs(studied: Studied) -> list[Picked]:
    """Runs to look at closely: best designs by the first metric, the best by each other, some of the front of two.

    Three by the first metric, the best by it of each mode, up to two from the middle of the front, eight in all at
    most; less is better.
    """
    judged = studied.judged
    if not judged:
        return []
    first, *others = judged
    why: dict[int, list[str]] = {}
    for place, row in enumerate(_least(studied, first)[:_BEST]):
        why.setdefault(row, []).append(f"{metric_name(first)}{'' if place == 0 else f', {_nth(place + 1)}'}")
    for name, row in _least_of_series(studied, first).items():
        if row in why or len(why) < MOST_RUNS - _FRONT:
            why.setdefault(row, []).append(f"{metric_name(first)} in {name}")
    pair = in_conflict(studied)
    if len(pair) == 2:
        for row in _knees(studied, *pair):
            if len(why) < MOST_RUNS:
                why.setdefault(row, []).append(f"front of {metric_name(pair[0])} and {metric_name(pair[1])}")
    for name in others:
        row = _least(studied, name)[0]
        if row in why or len(why) < MOST_RUNS:
            why.setdefault(row, []).append(metric_name(name))
    return [Picked(row, tuple(reasons)) for row, reasons in why.items()]


def in_conflict(studied: Studied) -> list[str]:
    """The first metric that varies, and the one with which most runs are on the front; fewer where there are not two.

    As `plots.pareto_front` chooses them.
    """
    first, *others = studied.judged or [""]
    if not others:
        return [first] if first else []
    series = studied.table.series.values()

    def length(other: str) -> int:
        return sum(undominated(runs.metrics[first], runs.metrics[other]).size for runs in series)

    return [first, max(others, key=length)]


def drawn_rows(studied: Studied, kept: Sequence[int], most: int = MOST_ROWS) -> NDArray[np.intp]:
    """Rows that are drawn: all complete ones, or where there are too many a part of them evenly chosen by lot.

    Kept whatever is left out are the rows named and the fronts of every two of the first metrics.
    """
    complete = np.flatnonzero(studied.table.complete)
    if complete.size <= most:
        return complete
    chosen = dict.fromkeys(int(row) for row in kept)
    pair, names = in_conflict(studied), studied.judged[:_FRONTS]
    for two in [tuple(pair), *combinations(names, 2)]:
        if len(two) == 2 and len(chosen) < most:
            chosen |= dict.fromkeys(int(row) for rows in fronts(studied, *two) for row in rows)
    # The default front stands first among those kept.
    held = np.array(list(chosen)[:most], dtype=np.intp)
    others = np.setdiff1d(complete, held)
    lot = np.random.default_rng(0).choice(others, size=most - held.size, replace=False)
    return np.sort(np.concatenate([held, lot]))


def fronts(studied: Studied, across: str, up: str) -> list[NDArray[np.intp]]:
    """Rows of each path and mode that no other is below in one metric without being above in the other."""
    table = studied.table
    x, y = table.metrics[across], table.metrics[up]
    out = []
    for path, mode in table.series:
        own = (table.path == path) & (table.mode == mode) & table.complete & np.isfinite(x) & np.isfinite(y)
        rows = np.flatnonzero(own)
        out.append(rows[undominated(x[rows], y[rows])])
    return out


def columns(
    studied: Studied, rows: NDArray[np.intp], units: Mapping[str, str], logarithmic: Sequence[str]
) -> list[Column]:
    """Parameters that vary and metrics of some rows, as the page draws them.

    Parameters
    ----------
    studied : Studied
    rows : array of int
    units : mapping of str to str
        Of parameters.
    logarithmic : sequence of str
        Parameters whose range is.
    """
    table, judged = studied.table, studied.judged
    out = []
    for name in table.varied:
        values = table.parameters[name]
        unit, factor = shown_unit(units.get(name, ""), values)
        log = name in logarithmic and _is_wide(values, _WIDE_RANGE)
        out.append(Column(name, symbol(name.replace("_", " ")), unit, factor * values[rows], parameter=True, log=log))
    rest = [name for name in table.metrics if name not in judged]
    for name in [*judged, *rest]:
        values = np.where(table.complete, table.metrics[name], np.nan)
        if not np.isfinite(values).any():
            continue
        unit, factor = shown_unit(table.units.get(name, ""), values)
        out.append(Column(name, metric_name(name), unit, factor * values[rows], log=_is_wide(values, _WIDE)))
    return out


def shown_unit(unit: str, values: NDArray[np.float64]) -> tuple[str, float]:
    """The unit that values are shown in, and what they are multiplied by; "" of those without one."""
    if unit in ("", "1"):
        return "", 1.0
    name, factor = unit_for(unit, values)
    return name.replace("^2", "²").replace("^3", "³").replace("^4", "⁴"), factor


def metric_name(metric: str) -> str:
    """What a metric is called: "RMS tracking error"; "peak torque of τ₁" of one motor's."""
    name, dot, motor = metric.partition(".")
    return METRIC_NAMES.get(name, name.replace("_", " ").replace("rms ", "RMS ")) + (
        f" of {symbol(motor)}" if dot else ""
    )


def reasons(studied: Studied) -> list[tuple[str, str, int]]:
    """Why runs are not complete: status, one of the reasons, and how many have one like it but for its numbers."""
    groups: dict[tuple[str, str], list[str]] = {}
    for status, reason in zip(studied.status.tolist(), studied.reason.tolist(), strict=True):
        if status != _COMPLETE:
            groups.setdefault((status, _NUMBER.sub("#", reason)), []).append(reason)
    most = sorted(groups.items(), key=lambda group: -len(group[1]))
    told = [(status, texts[0], len(texts)) for (status, _), texts in most[:_REASONS]]
    left = sum(len(texts) for _, texts in most[_REASONS:])
    return [*told, *([("", "other reasons; the table has them", left)] if left else [])]


def _least(studied: Studied, metric: str) -> list[int]:
    """Rows by a metric, the least first, the best of every design only."""
    values = np.where(studied.table.complete, studied.table.metrics[metric], np.inf)
    order = np.argsort(values, kind="stable")
    order = order[np.isfinite(values[order])]
    _, first = np.unique(studied.design[order], return_index=True)
    return [int(row) for row in order[np.sort(first)]]


def _least_of_series(studied: Studied, metric: str) -> dict[str, int]:
    """The row with the least of a metric of each path and mode, where there are several."""
    table, out = studied.table, {}
    pairs = list(table.series)
    for path, mode in pairs if len(pairs) > 1 else []:
        own = (table.path == path) & (table.mode == mode) & table.complete
        values = np.where(own, table.metrics[metric], np.inf)
        if np.isfinite(values).any():
            name = mode if len({one[0] for one in pairs}) == 1 else f"{mode} {path}"
            out[name] = int(np.nanargmin(values))
    return out


def _knees(studied: Studied, across: str, up: str) -> list[int]:
    """Of the front of all runs the ones nearest the corner of both least values, scaled by the front's extent."""
    x, y = (np.where(studied.table.complete, studied.table.metrics[name], np.nan) for name in (across, up))
    known = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
    front = known[undominated(x[known], y[known])]
    if front.size < 3:
        return []
    inner = front[1:-1]
    away = np.hypot(*((v[inner] - v[front].min()) / max(float(np.ptp(v[front])), 1e-300) for v in (x, y)))
    return [int(row) for row in inner[np.argsort(away, kind="stable")[:_FRONT]]]


def _is_wide(values: NDArray[np.float64], share: float) -> bool:
    known = values[np.isfinite(values)]
    return bool(known.size and known.min() > 0.0 and known.max() > share * known.min())


def _nth(number: int) -> str:
    return {2: "second", 3: "third"}.get(number, f"{number}th")
