"""Scenes as SVG elements: still, or animated in browsers by lists of values over time (SMIL)."""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from types import EllipsisType

import numpy as np

from paraflex.arrays import Array, Indices
from paraflex.figures.shapes import figure_of, travelled
from paraflex.formatting import printable
from paraflex.mechanism import Mechanism
from paraflex.results.drawing import assembled_data
from .marks import LOOKS, Mark, moving_marks, still_marks
from .scene import Limits, Scene, is_plate, scene
from .themes import PAGE, Theme

# Distance from the chord below which points of a line are omitted [pixels].
_STRAIGHT = 0.15
# Larger side of a sketch [pixels].
_SKETCH = 320.0
# Widths of links, and radii of a pin and the end-effector [units].
_LINK, _PIN, _TIP = 4.0, 3.2, 2.6


@dataclass(frozen=True)
class Pen:
    """Position and style of a scene on a page.

    Attributes
    ----------
    corner : (x, y)
        Position of the scene's origin [pixels].
    scale : float
        Scale of the scene [pixels/m].
    unit : float
        Unit of line widths and radii [pixels].
    look : Theme
        Colours.
    seconds : float
        Duration of the film [s]; zero (default) for a still picture.
    keys : array of int, optional
        Numbers of the scene's times that are shown; all by default.
    """

    corner: tuple[float, float]
    scale: float
    unit: float
    look: Theme
    seconds: float = 0.0
    keys: Indices | EllipsisType = ...

    def pixels(self, places: Array) -> Array:
        """Return positions (f, ..., 2) [m] as positions on the page at the shown times [pixels]."""
        return places[self.keys] * [self.scale, -self.scale] + self.corner


def sketch(mechanism: Mechanism) -> str:
    """Return an SVG of the first assembly in the colours of its page; empty if the assembly gives no positions."""
    data = assembled_data(mechanism)
    if data is None:
        return ""
    shown = scene(data, np.zeros(1))
    limits, scale = shown.limits, _SKETCH / shown.limits.size
    pen = Pen((-scale * limits.left, scale * limits.top), scale, 0.9, PAGE)
    width, height = scale * (limits.right - limits.left), scale * (limits.top - limits.bottom)
    parts = [_mark(mark, pen) for mark in still_marks(shown, limits)] + moving_elements(shown, limits, pen)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="{height:.0f}" '
        f'viewBox="0 0 {width:.1f} {height:.1f}" role="img" '
        f'aria-label="{escape(printable(mechanism.name))} as assembled" '
        f'style="color: inherit; max-width: 100%">{"".join(parts)}</svg>'
    )


def moving_elements(shown: Scene, limits: Limits, pen: Pen) -> list[str]:
    """Return the elements of all parts but ground and desired path, back to front; a scene of one time is still."""
    look, out = pen.look, []
    out += [_trail(trail, pen) for trail in shown.trails]
    faint = f'fill="none" stroke="{look.faint}" {_wide(1.3, pen)}'
    out += [_line(places, faint, "", pen) for places in shown.stiff.values()]
    for number, (name, places) in enumerate(shown.bodies.items()):
        drawn, colour = figure_of(places), look.link(number)
        if drawn.shape[1] == 1:
            out.append(_dot(places[:, 0], _LINK, f'fill="{colour}"', name, pen))
            continue
        fill = f'fill="{colour}" fill-opacity="0.25"' if is_plate(drawn[0]) else 'fill="none"'
        stroke = f'stroke="{colour}" {_wide(_LINK, pen)} stroke-linecap="round" stroke-linejoin="round"'
        out.append(_line(drawn, f"{fill} {stroke}", name, pen))
    out += [_mark(mark, pen) for mark in moving_marks(shown, limits)]
    out += [_dot(trail, _TIP, f'fill="{look.trail}"', "", pen) for trail in shown.trails]
    return [line for line in out if line]


def animated(name: str, values: Sequence[str], seconds: float) -> str:
    """Return an element that animates an attribute through values at equal intervals, repeatedly; empty if constant."""
    if len(set(values)) == 1:
        return ""
    return (
        f'<animate attributeName="{name}" dur="{seconds:.3f}s" repeatCount="indefinite" values="{";".join(values)}"/>'
    )


def _mark(mark: Mark, pen: Pen) -> str:
    kind = LOOKS[mark.look]
    fill = getattr(pen.look, kind.fill) if kind.fill else "none"
    look = f'class="{mark.look}" fill="{fill}" stroke="{getattr(pen.look, kind.stroke)}" {_wide(kind.width, pen)}'
    if kind.dashed:
        look += f' stroke-dasharray="{5.0 * pen.unit:.1f} {3.0 * pen.unit:.1f}"'
    if mark.places.shape[1] == 1:
        return _dot(mark.places[:, 0], _PIN, look, mark.name, pen)
    return _line(mark.places, look, mark.name, pen)


def _line(places: Array, look: str, name: str, pen: Pen) -> str:
    """Return the element of a line; a line with gaps becomes a still path."""
    pixels = pen.pixels(places)
    if np.isnan(pixels).any():
        pieces = np.split(pixels[0], np.flatnonzero(np.isnan(pixels[0, :, 0])))
        lines = [_points(piece[~np.isnan(piece[:, 0])]) for piece in pieces]
        return f'<path d="{"".join("M" + "L".join(line) for line in lines if line)}" {look}/>' if any(lines) else ""
    frames = [" ".join(_points(frame)) for frame in pixels[:, _corners(pixels)]]
    inside = _title(name) + animated("points", frames, pen.seconds)
    return f'<polyline points="{frames[0]}" {look}>{inside}</polyline>'


def _dot(places: Array, radius: float, look: str, name: str, pen: Pen) -> str:
    pixels = pen.pixels(places)
    if np.isnan(pixels).any():
        return ""
    x, y = ([f"{value:.1f}" for value in column] for column in pixels.T)
    inside = _title(name) + animated("cx", x, pen.seconds) + animated("cy", y, pen.seconds)
    return f'<circle cx="{x[0]}" cy="{y[0]}" r="{radius * pen.unit:.1f}" {look}>{inside}</circle>'


def _trail(places: Array, pen: Pen) -> str:
    """Return the element of the whole trail, which is uncovered over time."""
    pixels = pen.pixels(places)
    steps = travelled(pixels)
    if steps[-1] < 0.5:
        return ""
    covered = [f"{value:.1f}" for value in steps[-1] - steps]
    return (
        f'<polyline points="{" ".join(_points(pixels))}" fill="none" stroke="{pen.look.trail}" {_wide(1.6, pen)} '
        f'stroke-dasharray="{steps[-1]:.1f} {steps[-1] + 9.0:.1f}" stroke-dashoffset="{covered[0]}">'
        f"{animated('stroke-dashoffset', covered, pen.seconds)}</polyline>"
    )


def _title(name: str) -> str:
    return f"<title>{escape(printable(name))}</title>" if name else ""


def _wide(width: float, pen: Pen) -> str:
    return f'stroke-width="{width * pen.unit:.2f}"'


def _points(pixels: Array) -> list[str]:
    return [f"{x:.1f},{y:.1f}" for x, y in pixels]


def _corners(pixels: Array) -> list[int]:
    """Return the indices of the points of a line (f, s, 2) at which it is not straight in at least one picture."""
    kept = [0]
    for last in range(2, pixels.shape[1]):
        start = pixels[:, kept[-1], None]
        chord = pixels[:, last, None] - start
        arms = pixels[:, kept[-1] + 1 : last] - start
        across = np.abs(chord[..., 0] * arms[..., 1] - chord[..., 1] * arms[..., 0])
        if np.any(across > _STRAIGHT * np.linalg.norm(chord, axis=-1)) or np.any(np.sum(chord * arms, axis=-1) < 0.0):
            kept.append(last - 1)
    return [*kept, pixels.shape[1] - 1]
