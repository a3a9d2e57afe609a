"""Legend signs that look as in the drawing, and arrows."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.legend_handler import HandlerBase
from matplotlib.lines import Line2D
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from matplotlib.transforms import Affine2D, Transform

from paraflex.arrays import Array
from .drawing import PIN_SIZE
from .marks import LOOKS, SYMBOLS, motor, round_arrow, straight_arrow
from .scene import DrawnJoint, Limits
from .themes import Theme

# Length and radius of arrows in a legend, as shares of the picture's larger side, and relative size of their heads.
_LONG, _ROUND, _HEAD = 0.04, 0.014, 0.55
# Start angle and sweep of a round arrow in a legend [rad].
_FROM, _BY = -0.3, 1.3 * np.pi


@dataclass(frozen=True)
class Arrow:
    """Arrow: line (n, 2) and head (4, 2) [m], and whether it goes around a point."""

    line: Array
    head: Array
    round: bool = False

    @property
    def outline(self) -> Array:
        """Points (n, 2) of line and head [m]."""
        return np.vstack([self.line, self.head])


class Sign(NamedTuple):
    """Sign of a legend: lines (n, 2) [m], each with its Matplotlib properties; a single point is drawn as a dot."""

    pieces: tuple[tuple[Array, Mapping[str, Any]], ...]


def joint_sign(kind: str, limits: Limits, look: Theme, width: float, *, driven: bool = False) -> Sign:
    """Return the sign of a kind of joint, or of a motor at one; dots are scaled like those of a `Sketch` of `width`."""
    joint = DrawnJoint("", kind, False, np.zeros((1, 2)), np.array([np.nan if kind in ("pin", "weld") else 0.0]))
    shapes = dict(SYMBOLS[kind]) | ({"motor": motor} if driven else {})
    pieces: list[tuple[Array, Mapping[str, Any]]] = []
    for name in (name for name in LOOKS if name in shapes):
        places, kept = shapes[name](joint, limits)[0], LOOKS[name]
        face = getattr(look, kept.fill) if kept.fill else "none"
        dot = {"marker": "o", "markersize": PIN_SIZE * width, "markeredgewidth": kept.width * width,
               "markerfacecolor": face, "markeredgecolor": getattr(look, kept.stroke)}  # fmt: skip
        line = {"facecolor": face, "edgecolor": getattr(look, kept.stroke), "linewidth": kept.width}
        pieces.append((places, dot if len(places) == 1 else line))
    return Sign(tuple(pieces))


def arrow_sign(arrow: Arrow, limits: Limits, looks: Mapping[str, Any]) -> Sign:
    """Return the sign of an arrow, straight or round like the given one, in the size of the legend."""
    if arrow.round:
        line, head = round_arrow(np.zeros((1, 2)), _ROUND * limits.size, _FROM, np.array([_BY]), limits, _HEAD)
    else:
        half = np.array([[0.5 * _LONG * limits.size, 0.0]])
        line, head = straight_arrow(-half, half, limits, _HEAD)
    return Sign(_arrow_pieces(Arrow(line[0], head[0]), looks))


def draw_arrow(axes: Axes, arrow: Arrow, looks: Mapping[str, Any]) -> None:
    """Draw an arrow; `looks` holds its colour and line width, and optionally dashes and opacity."""
    for places, look in _arrow_pieces(arrow, looks):
        axes.add_patch(PathPatch(Path(places), zorder=3.7, clip_on=False, **look))


def _arrow_pieces(arrow: Arrow, looks: Mapping[str, Any]) -> tuple[tuple[Array, Mapping[str, Any]], ...]:
    common = {"edgecolor": looks["color"], "alpha": looks.get("alpha", 1.0), "joinstyle": "miter"}
    line = common | {"facecolor": "none", "linewidth": looks["linewidth"], "linestyle": looks.get("linestyle", "-")}
    head = common | {"facecolor": looks["color"], "linewidth": 0.4}
    return (arrow.line, line), (arrow.head, head)


class _SignHandler(HandlerBase):
    """Legend handler that draws a sign at the scale of the picture."""

    def __init__(self, scale: float) -> None:
        super().__init__()
        self.scale = scale

    def create_artists(
        self, legend: Legend, orig_handle: Any, xdescent: float, ydescent: float, width: float, height: float,
        fontsize: float, trans: Transform,
    ) -> list[Artist]:  # fmt: skip
        """Create the artists of a sign, as Matplotlib's `HandlerBase.create_artists` requires."""
        middle = Affine2D().scale(self.scale).translate(0.5 * width - xdescent, 0.5 * height - ydescent) + trans
        out: list[Artist] = []
        for places, look in orig_handle.pieces:
            one = Line2D(*places.T, **look) if len(places) == 1 else PathPatch(Path(places), **look)
            one.set_transform(middle)
            out.append(one)
        return out


def sign_legend(figure: Figure, axes: Axes, entries: Sequence[tuple[str, Any]], **settings: Any) -> None:
    """Add a legend below a figure, whose entries are texts with signs or with Matplotlib artists."""
    left, right = axes.get_xlim()
    scale = 72.0 * figure.get_figwidth() * axes.get_position().width / (right - left)
    figure.legend(
        handles=[handle for _, handle in entries], labels=[words for words, _ in entries], loc="lower center",
        bbox_to_anchor=(0.5, 0.0), handler_map={Sign: _SignHandler(scale)}, **settings,
    )  # fmt: skip
