"""The runs of many that a report shows in motion, and those that it draws."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from paraflex.plots.designs import DesignTable, in_conflict, undominated
from paraflex.report.designs import metric_name

# Rows drawn at most, runs looked at closely, the best of the first metric and of the front among them.
MOST_ROWS, MOST_RUNS, _BEST, _FRONT = 5000, 8, 3, 2
# Metrics whose fronts are kept whatever is left out.
_FRONTS = 8


class Picked(NamedTuple):
    """A run shown in motion, and the metrics in which it is best."""

    row: int
    why: tuple[str, ...]


def best_runs(designs: DesignTable) -> list[Picked]:
    """Runs to show in motion: best designs by the first metric, the best by each other, some of the front of two.

    Three by the first metric, the best by it of each mode, up to two from the middle of the front, eight in all at
    most; less is better.
    """
    judged = designs.judged
    if not judged:
        return []
    first, *others = judged
    why: dict[int, list[str]] = {}
    for place, row in enumerate(_least(designs, first)[:_BEST]):
        why.setdefault(row, []).append(f"{metric_name(first)}{'' if place == 0 else f', {_nth(place + 1)}'}")
    best = next(iter(why))
    for name, row in _least_of_series(designs, first).items():
        if row == best:
            continue
        if row in why or len(why) < MOST_RUNS - _FRONT:
            why.setdefault(row, []).append(f"{metric_name(first)} in {name}")
    pair = in_conflict(designs, designs.judged)
    if len(pair) == 2:
        for row in _knees(designs, *pair):
            if len(why) < MOST_RUNS:
                why.setdefault(row, []).append(f"front of {metric_name(pair[0])} and {metric_name(pair[1])}")
    for name in others:
        row = _least(designs, name)[0]
        if row in why or len(why) < MOST_RUNS:
            why.setdefault(row, []).append(metric_name(name))
    return [Picked(row, tuple(reasons)) for row, reasons in why.items()]


def drawn_rows(designs: DesignTable, kept: Sequence[int], most: int = MOST_ROWS) -> NDArray[np.intp]:
    """Rows that are drawn: all complete ones, or if there are too many a random sample.

    Kept whatever is left out are the rows named and the fronts of every two of the first metrics.
    """
    complete = np.flatnonzero(designs.complete)
    if complete.size <= most:
        return complete
    chosen = dict.fromkeys(int(row) for row in kept)
    pair, names = in_conflict(designs, designs.judged), designs.judged[:_FRONTS]
    for two in [tuple(pair), *combinations(names, 2)]:
        if len(two) == 2 and len(chosen) < most:
            chosen |= dict.fromkeys(int(row) for rows in fronts(designs, *two) for row in rows)
    # The default front stands first among those kept.
    held = np.array(list(chosen)[:most], dtype=np.intp)
    others = np.setdiff1d(complete, held)
    lot = np.random.default_rng(0).choice(others, size=most - held.size, replace=False)
    return np.sort(np.concatenate([held, lot]))


def fronts(designs: DesignTable, across: str, up: str) -> list[NDArray[np.intp]]:
    """Rows of each path and mode that no other row dominates in two metrics."""
    x, y = designs.metrics[across], designs.metrics[up]
    out = []
    for path, mode in designs.series:
        own = (designs.path == path) & (designs.mode == mode) & designs.complete & np.isfinite(x) & np.isfinite(y)
        rows = np.flatnonzero(own)
        out.append(rows[undominated(x[rows], y[rows])])
    return out


def _least(designs: DesignTable, metric: str) -> list[int]:
    """Rows by a metric, the least first, the best of every design only."""
    values = np.where(designs.complete, designs.metrics[metric], np.inf)
    order = np.argsort(values, kind="stable")
    order = order[np.isfinite(values[order])]
    _, first = np.unique(designs.design[order], return_index=True)
    return [int(row) for row in order[np.sort(first)]]


def _least_of_series(designs: DesignTable, metric: str) -> dict[str, int]:
    """The row with the least of a metric for each path and mode, if there are several."""
    out = {}
    pairs = list(designs.series)
    for path, mode in pairs if len(pairs) > 1 else []:
        own = (designs.path == path) & (designs.mode == mode) & designs.complete
        values = np.where(own, designs.metrics[metric], np.inf)
        if np.isfinite(values).any():
            # Word joiners: signs of a mode stay on one line.
            signs = "\u2060".join(mode)
            name = signs if len({one[0] for one in pairs}) == 1 else f"{signs} {path}"
            out[name] = int(np.nanargmin(values))
    return out


def _knees(designs: DesignTable, across: str, up: str) -> list[int]:
    """The runs of the front nearest the corner of both least values, scaled by the front's extent."""
    x, y = (np.where(designs.complete, designs.metrics[name], np.nan) for name in (across, up))
    known = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
    front = known[undominated(x[known], y[known])]
    if front.size < 3:
        return []
    inner = front[1:-1]
    away = np.hypot(*((v[inner] - v[front].min()) / max(float(np.ptp(v[front])), 1e-300) for v in (x, y)))
    return [int(row) for row in inner[np.argsort(away, kind="stable")[:_FRONT]]]


def _nth(number: int) -> str:
    return {2: "second", 3: "third"}.get(number, f"{number}th")
