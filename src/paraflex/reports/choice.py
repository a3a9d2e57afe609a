"""Choice of the runs of a study that a report shows in motion, and of those that it draws in charts."""

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from paraflex.arrays import NDArray
from paraflex.figures.designs import DesignTable, column_label, fronts, in_conflict, undominated

# Largest number of rows drawn and of runs in motion, and number of the latter that are on the front.
MOST_ROWS, MOST_RUNS, _FRONT = 5000, 8, 2
# Places of the runs in motion that are best in the first metric, in words.
_PLACES = ("", ", second", ", third")
# Number of metrics whose fronts are always kept.
_FRONTS = 8


class Picked(NamedTuple):
    """Run shown in motion: its row, and the metrics in which it is best."""

    row: int
    why: tuple[str, ...]


def best_runs(designs: DesignTable) -> list[Picked]:
    """Choose the runs to show in motion, at most eight; smaller metrics are better.

    They are the three best designs by the first metric, the best one by it of each mode, up to two from the middle of
    the Pareto front of two metrics, and the best by each other metric.
    """
    judged = designs.judged
    if not judged:
        return []
    first, *others = judged
    why: dict[int, list[str]] = {}
    for place, row in enumerate(_least(designs, first)[: len(_PLACES)]):
        why.setdefault(row, []).append(f"{column_label(first)}{_PLACES[place]}")
    best = next(iter(why))
    for name, row in _least_of_series(designs, first).items():
        if row == best:
            continue
        if row in why or len(why) < MOST_RUNS - _FRONT:
            why.setdefault(row, []).append(f"{column_label(first)} in {name}")
    pair = in_conflict(designs, designs.judged)
    if len(pair) == 2:
        for row in _knees(designs, *pair):
            if len(why) < MOST_RUNS:
                why.setdefault(row, []).append(f"front of {column_label(pair[0])} and {column_label(pair[1])}")
    for name in others:
        row = _least(designs, name)[0]
        if row in why or len(why) < MOST_RUNS:
            why.setdefault(row, []).append(column_label(name))
    return [Picked(row, tuple(reasons)) for row, reasons in why.items()]


def drawn_rows(designs: DesignTable, kept: Sequence[int], most: int = MOST_ROWS) -> NDArray[np.intp]:
    """Return the rows to draw: all complete ones or, of more than `most`, a random sample.

    The sample always includes the rows `kept` and the fronts of each pair of the first metrics.
    """
    complete = np.flatnonzero(designs.complete)
    if complete.size <= most:
        return complete
    chosen = dict.fromkeys(int(row) for row in kept)
    pair, names = in_conflict(designs, designs.judged), designs.judged[:_FRONTS]
    for two in [tuple(pair), *combinations(names, 2)]:
        if len(two) == 2 and len(chosen) < most:
            chosen |= dict.fromkeys(int(row) for rows in fronts(designs, *two) for row in rows)
    # The default front comes first, so it is kept if there are too many.
    held = np.array(list(chosen)[:most], dtype=np.intp)
    others = np.setdiff1d(complete, held)
    lot = np.random.default_rng(0).choice(others, size=most - held.size, replace=False)
    return np.sort(np.concatenate([held, lot]))


def _least(designs: DesignTable, metric: str) -> list[int]:
    """Return the best row of every design, sorted by a metric, the smallest first."""
    values = np.where(designs.complete, designs.metrics[metric], np.inf)
    order = np.argsort(values, kind="stable")
    order = order[np.isfinite(values[order])]
    _, first = np.unique(designs.design[order], return_index=True)
    return [int(row) for row in order[np.sort(first)]]


def _least_of_series(designs: DesignTable, metric: str) -> dict[str, int]:
    """Return the row with the smallest metric for each path and mode, if there are several of these."""
    out = {}
    pairs = designs.series_rows
    for (path, mode), rows in pairs.items() if len(pairs) > 1 else ():
        values = designs.metrics[metric][rows]
        if np.isfinite(values).any():
            # Word joiners keep the signs of a mode on one line.
            signs = "\u2060".join(mode)
            name = signs if len({one[0] for one in pairs}) == 1 else f"{signs} {path}"
            out[name] = int(rows[np.nanargmin(values)])
    return out


def _knees(designs: DesignTable, across: str, up: str) -> list[int]:
    """Return the inner runs of the front nearest to the corner of both minima, in units of the front's extent."""
    x, y = (np.where(designs.complete, designs.metrics[name], np.nan) for name in (across, up))
    front = undominated(x, y)
    if front.size < 3:
        return []
    inner = front[1:-1]
    away = np.hypot(*((v[inner] - v[front].min()) / max(float(np.ptp(v[front])), 1e-300) for v in (x, y)))
    return [int(row) for row in inner[np.argsort(away, kind="stable")[:_FRONT]]]
