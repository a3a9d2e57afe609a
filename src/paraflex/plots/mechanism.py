"""Sketch of a mechanism in one pose: links, joints, ground points and their names, from positions alone."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.path import Path
from numpy.typing import NDArray

from paraflex.plots.labels import symbol
from paraflex.plots.runs import samples
from paraflex.plots.style import BLACK

Points = NDArray[np.float64]

LINK: dict[str, Any] = {"color": "0.45", "linewidth": 2.2, "solid_capstyle": "round", "zorder": 1.5}
JOINT: dict[str, Any] = {
    "linestyle": "none",
    "marker": "o",
    "markersize": 4.0,
    "markerfacecolor": "white",
    "markeredgecolor": BLACK,
    "markeredgewidth": 0.8,
    "zorder": 3.0,
}
POINT: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 2.5, "color": BLACK, "zorder": 3.0}
# A triangle on a base line, hanging from the pivot.
_SUPPORT = Path(
    [(0.0, 0.0), (-0.7, -1.2), (0.7, -1.2), (0.0, 0.0), (-1.1, -1.2), (1.1, -1.2)],
    [Path.MOVETO, Path.LINETO, Path.LINETO, Path.CLOSEPOLY, Path.MOVETO, Path.LINETO],
)
GROUND: dict[str, Any] = {
    "linestyle": "none",
    "marker": _SUPPORT,
    "markersize": 16.0,
    "markerfacecolor": "0.8",
    "markeredgecolor": BLACK,
    "markeredgewidth": 0.6,
    "zorder": 2.0,
}
IN_LEGEND: dict[str, Any] = {**GROUND, "markersize": 9.0}  # As high as one of its lines.

# Points this near to each other, or moving this little, share of the mechanism's size: constraints hold no better.
_SAME = 1e-4


def draw_mechanism(axes: Axes, data: xr.Dataset, clear_of: Points) -> None:
    """Draw the start pose: every link, its joints, the points that do not move, and the points' names.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
        In mm, with equal scales.
    data : xarray.Dataset
        From `paraflex.results`; the run that got furthest is taken.
    clear_of : array (n, 2)
        Places [mm] names keep away from, besides those of the mechanism.
    """
    run = max((data.isel(mode=k) for k in range(data.sizes["mode"])), key=samples)
    if samples(run) == 0:
        return
    places = 1e3 * run["point_position"].transpose("time", "point", "axis").values[: samples(run)]
    names = [str(name) for name in run["point"].values]
    size = float(np.ptp(places[0], axis=0).max())
    bodies: dict[str, list[int]] = {}
    for k, name in enumerate(names):
        bodies.setdefault(name.rpartition(".")[0], []).append(k)

    outlines = [_outline(places[0, ks]) for ks in bodies.values()]
    for k, outline in enumerate(outlines):
        axes.plot(*outline.T, label="links" if k == 0 else None, **LINK)
    moves = np.ptp(places, axis=0).max(axis=1)
    fixed = moves <= _SAME * size if moves.max() > _SAME * size else np.zeros(len(names), dtype=bool)
    taken = [*map(_sampled, outlines), clear_of]
    if fixed.any():
        axes.plot(*places[0, fixed].T, **GROUND)
        axes.plot([], [], label="ground", **IN_LEGEND)
        axes.update_datalim(places[0, fixed] - [0.0, 0.045 * size])
        taken += [places[0, fixed] - [0.0, depth * size] for depth in (0.02, 0.04)]
    groups = _coincident(places[0], size)
    joints = [group[0] for group in groups if len(group) > 1 or fixed[group[0]]]
    others = [group[0] for group in groups if group[0] not in joints]
    if joints:
        axes.plot(*places[0, joints].T, label="joints", **JOINT)
    if others:
        axes.plot(*places[0, others].T, label="other points", **POINT)
    _name_points(axes, places[0], groups, names, np.vstack(taken))


def _outline(points: Points) -> Points:
    """A link's line through its points, in order along it; a closed line round points that are not on one line."""
    centred = points - points.mean(axis=0)
    _, spread, directions = np.linalg.svd(centred)
    if len(points) < 3 or spread[1] <= 0.02 * spread[0]:
        return points[np.argsort(centred @ directions[0])]
    round_centre = points[np.argsort(np.arctan2(centred[:, 1], centred[:, 0]))]
    return np.vstack([round_centre, round_centre[:1]])


def _sampled(outline: Points) -> Points:
    """Points along a line, close to one another."""
    share = np.linspace(0.0, 1.0, 25)[:, None]
    return np.vstack([a + share * (b - a) for a, b in pairwise(outline)] + [outline[:1]])


def _coincident(points: Points, size: float) -> list[list[int]]:
    """Indices of points, those at one place together."""
    groups: dict[int, list[int]] = {}
    for k, point in enumerate(points):
        first = int(np.argmax(np.linalg.norm(points - point, axis=1) <= _SAME * size))
        groups.setdefault(first, []).append(k)
    return list(groups.values())


def _name_points(axes: Axes, points: Points, groups: list[list[int]], names: list[str], taken: Points) -> None:
    """Write names beside points, each on the side with most room; points at one place share theirs."""
    size = float(np.ptp(points, axis=0).max())
    angles = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    directions = np.column_stack([np.cos(angles), np.sin(angles)])
    for group in groups:
        point = points[group[0]]
        texts = dict.fromkeys(symbol(names[k].rpartition(".")[2]) for k in group)
        candidates = point + 0.055 * size * directions
        room = np.linalg.norm(candidates[:, None] - taken[None], axis=2).min(axis=1)
        best = int(np.argmax(room))
        right, up = directions[best]
        x, y = point + 0.025 * size * directions[best]
        axes.text(
            x,
            y,
            ", ".join(texts),
            ha="left" if right > 0.4 else "right" if right < -0.4 else "center",
            va="bottom" if up > 0.4 else "top" if up < -0.4 else "center",
            zorder=3.5,
        )
        taken = np.vstack([taken, candidates[best]])
        axes.update_datalim([(point + 0.08 * size * directions[best]).tolist()])
