"""Placement of names in a drawing, clear of one another and of the drawn lines."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes

from paraflex.arrays import Array, Indices
from paraflex.figures.shapes import along, travelled

# Widths of a regular and of a bold letter, and height of a line, in font sizes.
_LETTER, _BOLD, _LINE = 0.62, 0.69, 1.3
# Number of directions, and distances from the anchor [pt], in which candidate positions are tried.
_DIRECTIONS = 16
_DISTANCES = (4.0, 7.0, 12.0, 18.0, 26.0, 38.0)
# Distance from which a line connects the name to its anchor [pt].
_FAR = 12.0
# Costs of covering another name, of covering a drawn point, of leaving the panel, and of each point [pt] of distance.
_ON_NAME, _ON_PLACE, _OUTSIDE, _AWAY = 400.0, 6.0, 1000.0, 0.35
# Spacing of the sampled points of drawn lines [pt].
_STEP = 3.0


@dataclass(frozen=True)
class Name:
    """Name to be placed: text, anchors (n, 2) in data coordinates, the preferred one first, and look."""

    text: str
    places: Array
    colour: str
    bold: bool = False


def place_names(axes: Axes, names: Sequence[Name], drawn: Sequence[Array], size: float) -> None:
    """Write names of a size [pt], each where it covers least of the previous names and of the drawn lines (n, 2)."""
    figure = axes.figure
    assert figure is not None
    per_point = figure.dpi / 72.0

    def to_points(places: Array) -> Array:
        return np.asarray(axes.transData.transform(places)) / per_point

    taken = np.concatenate([_sampled(to_points(line)) for line in drawn if len(line)] or [np.zeros((0, 2))])
    box = np.array(axes.get_window_extent().extents) / per_point
    boxes = np.zeros((0, 4))
    for name in names:
        half = 0.5 * size * np.array([(_BOLD if name.bold else _LETTER) * len(name.text) + 0.6, _LINE])
        anchors = to_points(name.places)
        centres, gaps, of = _candidates(anchors, half)
        cost = _AWAY * gaps + 1.5 * of + _covered(centres, half, taken, boxes, box)
        best = int(np.argmin(cost))
        centre = centres[best]
        boxes = np.vstack([boxes, [*(centre - half), *(centre + half)]])
        _write(axes, name, centre * per_point, name.places[of[best]] if gaps[best] >= _FAR else None, size)


def _candidates(anchors: Array, half: Array) -> tuple[Array, Array, Indices]:
    """Return candidate centres (c, 2) around anchors (n, 2), gaps (c,) between box and anchor [pt], and anchors (c,).

    The anchors of the candidates are given by their indices.
    """
    angle = np.linspace(0.0, 2.0 * np.pi, _DIRECTIONS, endpoint=False)
    towards = np.column_stack([np.cos(angle), np.sin(angle)])
    # Distance from the centre of a box to its edge in each direction.
    with np.errstate(divide="ignore"):
        edge = np.min(half / np.abs(np.where(np.abs(towards) > 1e-9, towards, 1e-12)), axis=1)
    parts = [(anchors[:, None] + (edge + gap)[:, None] * towards) for gap in _DISTANCES]
    centres = np.stack(parts)  # (gaps, anchors, directions, 2)
    gaps = np.broadcast_to(np.array(_DISTANCES)[:, None, None], centres.shape[:3])
    of = np.broadcast_to(np.arange(len(anchors))[None, :, None], centres.shape[:3])
    return centres.reshape(-1, 2), gaps.ravel(), of.ravel()


def _covered(centres: Array, half: Array, taken: Array, boxes: Array, panel: Array) -> Array:
    """Return the cost (c,) of what the boxes around the centres cover."""
    low, high = centres - half, centres + half
    within = [(taken[:, k] > low[:, None, k] - 1.0) & (taken[:, k] < high[:, None, k] + 1.0) for k in range(2)]
    inside = np.count_nonzero(within[0] & within[1], axis=1)
    wide = np.minimum(high[:, None, 0], boxes[:, 2]) - np.maximum(low[:, None, 0], boxes[:, 0])
    tall = np.minimum(high[:, None, 1], boxes[:, 3]) - np.maximum(low[:, None, 1], boxes[:, 1])
    over = np.sum(np.maximum(wide, 0.0) * np.maximum(tall, 0.0), axis=1) / (4.0 * half[0] * half[1])
    out = np.any((low < panel[:2]) | (high > panel[2:]), axis=1)
    return _ON_PLACE * inside + _ON_NAME * over + _OUTSIDE * out


def _sampled(line: Array) -> Array:
    """Return closely spaced points along a line (n, 2) [pt]."""
    line = line[np.isfinite(line).all(axis=1)]
    if len(line) < 2:
        return line
    count = min(max(2, int(travelled(line)[-1] / _STEP)), 2000)
    return along(line, np.linspace(0.0, 1.0, count))


def _write(axes: Axes, name: Name, centre: Array, leads_to: Array | None, size: float) -> None:
    x, y = axes.transData.inverted().transform(centre)
    if leads_to is not None:
        axes.plot([x, leads_to[0]], [y, leads_to[1]], color=name.colour, linewidth=0.45, alpha=0.6, zorder=4.9)
    axes.text(
        x, y, name.text, color=name.colour, fontsize=size, ha="center", va="center", zorder=5.0, parse_math=False,
        fontweight="bold" if name.bold else "normal",
        bbox={"facecolor": axes.get_facecolor(), "edgecolor": "none", "alpha": 0.75, "pad": 0.4},
    )  # fmt: skip
