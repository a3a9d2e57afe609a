"""A film as one SVG file that plays by itself in browsers: shapes as lists of values in time (SMIL)."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np
from numpy.typing import NDArray

from paraflex.plots.drawing import caption, is_plate
from paraflex.plots.labels import mode_label, three_digits
from paraflex.plots.scene import (
    PIN,
    Limits,
    Scene,
    block,
    common_limits,
    figure_of,
    ground_of,
    scale_bar,
    square,
    support,
    zigzag,
)
from paraflex.plots.themes import Theme

Array = NDArray[np.float64]

# Key frames a second of the film; browsers go on evenly between them.
_KEYS = 25.0
_MOST_KEYS = 400
# Parts of the height above and below the drawing, and the height of text as a part of it.
_HEAD, _FOOT, _TEXT = 0.11, 0.1, 0.028
_NAMED = 9
_FONTS = "system-ui, DejaVu Sans, Helvetica, Arial, sans-serif"
# Points of a line this near to it are left out [pixels].
_STRAIGHT = 0.15


def animated_svg(scenes: Sequence[Scene], size: tuple[int, int], look: Theme, speed: float) -> str:
    """The text of an SVG file; several scenes stand side by side.

    Parameters
    ----------
    scenes : sequence of Scene
        At the same times.
    size : (width, height)
        [pixels]; the picture scales with its place on a page.
    look : Theme
    speed : float
        Of the film against time.
    """
    width, height = size
    time = scenes[0].time
    duration = max(float(time[-1] - time[0]) / speed, 1e-3)
    chosen = np.unique(np.linspace(0, time.size - 1, min(time.size, _MOST_KEYS, round(duration * _KEYS) + 1)).round())
    keys = chosen.astype(int)
    panel = width / len(scenes), height * (1.0 - _HEAD - _FOOT)
    limits = common_limits(list(scenes)).fitted(panel[0] / panel[1])
    first, text = scenes[0], _TEXT * height
    named = ", ".join(mode_label(shown.mode) for shown in scenes if shown.mode)
    title = f"{first.mechanism}{', mode ' + named if named else ''}: {caption(first)}"
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}" '
        f'style="max-width:100%;max-height:100vh" role="img" font-family="{_FONTS}" font-size="{text:.1f}">',
        f"<title>{escape(title)}</title>",
        f'<rect width="{width}" height="{height}" fill="{look.ground}"/>',
        *(
            line
            for k, shown in enumerate(scenes)
            for line in _Panel(shown, limits, (k * panel[0], _HEAD * height), panel, look, duration, keys).lines()
        ),
        *_frame(scenes, limits, size, panel[0], look, speed, duration, text),
        "</svg>",
    ]
    return "\n".join(parts) + "\n"


class _Panel:
    """One scene in pixels."""

    def __init__(
        self,
        shown: Scene,
        limits: Limits,
        corner: tuple[float, float],
        size: tuple[float, float],
        look: Theme,
        duration: float,
        keys: NDArray[np.int64],
    ) -> None:
        self.shown, self.limits, self.look, self.duration, self.keys = shown, limits, look, duration, keys
        self.corner, self.size = np.array(corner), size
        self.scale = size[0] / (limits.right - limits.left)
        # Lines grow with the picture.
        self.unit = min(size[0], size[1]) / 430.0

    def lines(self) -> list[str]:
        """All of it, from the back to the front."""
        return [*self._still(), *self._moving()]

    def _still(self) -> list[str]:
        out, grounds = [], [ground_of(joint, self.limits) for joint in self.shown.joints if joint.grounded]
        grounds += [support(place, self.limits) for place in self.shown.anchors]
        outlines = [line for lines, _ in grounds for line in lines]
        strokes = [stroke for _, hatches in grounds for stroke in hatches]
        for pieces, wide in ((outlines, 1.4), (strokes, 0.9)):
            if pieces:
                path = "".join("M" + "L".join(_points(self._pixels(piece))) for piece in pieces)
                out.append(f'<path d="{path}" fill="none" stroke="{self.look.earth}" {self._wide(wide)}/>')
        if self.shown.desired is not None:
            path = " ".join(_points(self._pixels(_thin(self.shown.desired))))
            out.append(
                f'<polyline points="{path}" fill="none" stroke="{self.look.desired}" {self._wide(1.3)} '
                f'stroke-dasharray="{4 * self.unit:.1f} {3 * self.unit:.1f}"/>'
            )
        return out

    def _moving(self) -> list[str]:
        shown, look, out = self.shown, self.look, []
        if shown.trail is not None:
            out.append(self._trail(shown.trail))
        for places in shown.stiff.values():
            out.append(self._line(places, f'fill="none" stroke="{look.faint}" {self._wide(1.3)}'))
        for number, places in enumerate(shown.bodies.values()):
            colour = look.link(number)
            drawn = len(figure_of(places[0]))
            if drawn == 1:
                out.append(self._circle(places[:, 0], 4.2, f'fill="{colour}"'))
                continue
            fill = f'fill="{colour}" fill-opacity="0.25"' if is_plate(figure_of(places[0])) else 'fill="none"'
            look_of = f'{fill} stroke="{colour}" {self._wide(4.0)} stroke-linecap="round" stroke-linejoin="round"'
            out.append(self._line(places[:, :drawn], look_of))
        for ends in shown.springs:
            out.append(self._line(zigzag(ends, self.limits), f'fill="none" stroke="{look.earth}" {self._wide(1.2)}'))
        face = f'fill="{look.ground}" stroke="{look.ink}" {self._wide(1.4)}'
        for joint in shown.joints:
            if joint.slides:
                out.append(self._line(block(joint, self.limits), face))
            if joint.kind == "weld":
                out.append(self._line(square(joint.place, self.limits), f'fill="{look.ink}"'))
        for joint in shown.joints:
            if joint.kind in ("pin", "slot", "sliding"):
                out.append(self._circle(joint.place, 3.2, face))
        if shown.trail is not None:
            out.append(self._circle(shown.trail, 2.6, f'fill="{look.trail}"'))
        return [line for line in out if line]

    def _line(self, places: Array, look: str) -> str:
        if places.shape[1] < 2:
            return ""
        pixels = self._pixels(places[self.keys])
        pixels = pixels[:, _corners(pixels)]
        frames = [" ".join(_points(frame)) for frame in pixels]
        return f'<polyline points="{frames[0]}" {look}>{self._animate("points", frames)}</polyline>'

    def _circle(self, places: Array, radius: float, look: str) -> str:
        pixels = self._pixels(places[self.keys])
        x, y = ([f"{value:.1f}" for value in column] for column in pixels.T)
        size = max(radius * self.unit, 0.6 * PIN * self.limits.size * self.scale)
        moves = "" if len({*x}) == len({*y}) == 1 else self._animate("cx", x) + self._animate("cy", y)
        return f'<circle cx="{x[0]}" cy="{y[0]}" r="{size:.1f}" {look}>{moves}</circle>'

    def _trail(self, places: Array) -> str:
        """The whole trail, uncovered as far as it is passed."""
        pixels = self._pixels(places[self.keys])
        steps = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(pixels, axis=0), axis=1))])
        if steps[-1] < 0.5:
            return ""
        covered = [f"{value:.1f}" for value in steps[-1] - steps]
        return (
            f'<polyline points="{" ".join(_points(pixels))}" fill="none" stroke="{self.look.trail}" {self._wide(1.6)} '
            f'stroke-dasharray="{steps[-1]:.1f} {steps[-1] + 9.0:.1f}" stroke-dashoffset="{covered[0]}">'
            f"{self._animate('stroke-dashoffset', covered)}</polyline>"
        )

    def _animate(self, name: str, values: list[str]) -> str:
        if len(set(values)) == 1:
            return ""
        return (
            f'<animate attributeName="{name}" dur="{self.duration:.3f}s" repeatCount="indefinite" '
            f'values="{";".join(values)}"/>'
        )

    def _wide(self, width: float) -> str:
        return f'stroke-width="{width * self.unit:.2f}"'

    def _pixels(self, places: Array) -> Array:
        flat = (places - [self.limits.left, self.limits.top]) * [self.scale, -self.scale]
        return flat + self.corner


def _frame(
    scenes: Sequence[Scene],
    limits: Limits,
    size: tuple[int, int],
    panel: float,
    look: Theme,
    speed: float,
    duration: float,
    text: float,
) -> list[str]:
    """Titles, names of links, scale bar, and a line along which time runs."""
    (width, height), first = size, scenes[0]
    margin, out = 0.6 * text, []

    def write(x: float, y: float, words: str, colour: str, anchor: str = "start", extra: str = "") -> None:
        out.append(
            f'<text x="{x:.1f}" y="{y:.1f}" fill="{colour}" text-anchor="{anchor}"{extra}>{escape(words)}</text>'
        )

    write(margin, 1.5 * text, first.mechanism, look.ink)
    for k, shown in enumerate(scenes):
        if shown.mode:
            write((k + 0.5) * panel, 3.0 * text, f"mode {mode_label(shown.mode)}", look.ink, "middle")
    names = list(first.bodies)
    if len(names) <= _NAMED:
        # Letters are some two thirds of their size wide; three between names.
        widths = 0.55 * text * np.array([len(name) + 3.0 for name in names])
        widths *= min(1.0, 0.96 * width / widths.sum())
        places = 0.5 * (width - widths.sum()) + np.cumsum(widths) - 0.5 * widths
        for i, (name, place) in enumerate(zip(names, places, strict=True)):
            write(
                place,
                height - 2.45 * text,
                name,
                look.link(i),
                "middle",
                f' font-size="{0.8 * text:.1f}" font-weight="bold"',
            )
    write(
        margin,
        height - 0.7 * text,
        f"{caption(first)}, speed × {speed:g}",
        look.earth,
        extra=f' font-size="{0.85 * text:.1f}"',
    )
    length, name = scale_bar(limits)
    bar = length * panel / (limits.right - limits.left)
    right, low = width - margin, height - 0.6 * text
    out.append(
        f'<path d="M{right - bar:.1f} {low:.1f}H{right:.1f}" stroke="{look.ink}" stroke-width="{0.14 * text:.1f}"/>'
    )
    write(right - 0.5 * bar, low - 0.4 * text, name, look.ink, "middle", f' font-size="{0.85 * text:.1f}"')
    # SMIL cannot count: a bar fills as time passes.
    start, end, y = width - margin - 9.0 * text, width - margin, 1.15 * text
    begin, last = (three_digits(float(first.time[k])) for k in (0, -1))
    out.append(f'<path d="M{start:.1f} {y:.1f}H{end:.1f}" stroke="{look.faint}" stroke-width="{0.2 * text:.1f}"/>')
    out.append(
        f'<path d="M{start:.1f} {y:.1f}H{end:.1f}" stroke="{look.ink}" stroke-width="{0.2 * text:.1f}" '
        f'stroke-dasharray="{end - start:.1f}"><animate attributeName="stroke-dashoffset" dur="{duration:.3f}s" '
        f'repeatCount="indefinite" values="{end - start:.1f};0"/></path>'
    )
    write(start - 0.5 * text, 1.5 * text, f"t = {begin} s", look.ink, "end")
    write(end, 2.5 * text, f"{last} s", look.ink, "end", f' font-size="{0.85 * text:.1f}"')
    return out


def _points(pixels: Array) -> list[str]:
    return [f"{x:.1f},{y:.1f}" for x, y in pixels]


def _corners(pixels: Array) -> list[int]:
    """The points of a line (f, s, 2) that it is not straight without, in one picture at least."""
    kept = [0]
    for last in range(2, pixels.shape[1]):
        start = pixels[:, kept[-1], None]
        chord = pixels[:, last, None] - start
        arms = pixels[:, kept[-1] + 1 : last] - start
        across = np.abs(chord[..., 0] * arms[..., 1] - chord[..., 1] * arms[..., 0])
        if np.any(across > _STRAIGHT * np.linalg.norm(chord, axis=-1)) or np.any(np.sum(chord * arms, axis=-1) < 0.0):
            kept.append(last - 1)
    return [*kept, pixels.shape[1] - 1]


def _thin(places: Array, most: int = 400) -> Array:
    """So many points of a path, its corners kept as nearly as they fall."""
    return places[:: max(1, len(places) // most)]
