"""Drawing of a mechanism by Matplotlib: links with true or magnified deflections, joints, ground, springs, paths."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon

from paraflex.figures.shapes import figure_of
from .layout import MM, TWO_COLUMNS, page_width
from .marks import LOOKS, by_look, key_arrow, moving_marks, still_marks
from .scene import Limits, Scene, common_limits, is_plate, scale_bar
from .themes import Theme

# Largest number of bodies whose names fit under a picture.
_MOST_NAMED = 9
# Room above and below a drawing, and above a panel of several [mm].
HEAD, FOOT, _PANEL_HEAD = 5.0, 5.5, 4.5
# Width of links [pt], and diameters of a body at a single place, a pin and the end-effector.
_LINK, _DOT, PIN_SIZE, _TIP = 3.4, 7.0, 5.4, 4.2
# Shortest line as a share of the picture: Agg draws no line of zero length, nor one that it snaps to a single pixel.
_SHORTEST_LINE = 2e-3


class Sketch:
    """Drawing of a scene on Matplotlib axes: fixed parts are drawn once, moving parts are updated for each picture."""

    def __init__(self, axes: Axes, shown: Scene, limits: Limits, look: Theme, width: float = 1.0) -> None:
        self.scene = shown
        self.look = look
        self.axes = axes
        self.limits = limits
        self._width = width
        for kind, marks in by_look(still_marks(shown, limits)).items():
            ground = self._symbols(kind, 1.0)
            ground.set_label(f"_{kind}")
            ground.set_verts([mark.places[0] for mark in marks], closed=False)
        if shown.desired is not None:
            self._line(look.desired, 1.1, 1.5, linestyle=(0, (3, 2))).set_data(*shown.desired.T)
        self._colours = {name: look.link(i) for i, name in enumerate(shown.bodies)}
        self._trails: list[Line2D] = [self._line(look.trail, 1.3, 2.2) for _ in shown.trails]
        self._stiff = self._polygons("none", look.faint, 1.2, 2.4)
        self._plates = self._polygons("none", "none", 0.0, 2.6)
        self.links: LineCollection = LineCollection([], zorder=3.0, capstyle="round", joinstyle="round")
        self.links.set(clip_on=False, in_layout=False, snap=False)
        axes.add_collection(self.links, autolim=False)
        self._moving = by_look(moving_marks(shown, limits))
        self.marks: dict[str, Line2D | PolyCollection] = {
            kind: self._dots(look.ground, look.ink, PIN_SIZE, LOOKS[kind].width, 3.9)
            if marks[0].places.shape[1] == 1
            else self._symbols(kind, 3.1)
            for kind, marks in self._moving.items()
        }
        self._head = self._dots(look.trail, look.ground, _TIP, 0.7, 4.2)

    @property
    def artists(self) -> list[Artist]:
        """Artists of the moving parts, from the back to the front."""
        moving = [*self._trails, self._stiff, self._plates, self.links, *self.marks.values(), self._head]
        return sorted(moving, key=lambda artist: artist.get_zorder())

    def show(self, i: int) -> None:
        """Update all moving parts to the scene's time number `i`."""
        bodies = {name: figure_of(places[i]) for name, places in self.scene.bodies.items()}
        # A body at a single place is drawn as a dot: a line so short that only its round ends are visible.
        dot = [[0.0, 0.0], [_SHORTEST_LINE * self.limits.size, 0.0]]
        self.links.set_segments([places if len(places) > 1 else places + dot for places in bodies.values()])
        self.links.set_linewidth([self._width * (_LINK if len(one) > 1 else _DOT) for one in bodies.values()])
        self.links.set_color(list(self._colours.values()))
        plates = {name: places for name, places in bodies.items() if is_plate(places)}
        self._plates.set_verts([*plates.values()], closed=False)
        self._plates.set_facecolor([to_rgba(self._colours[name], 0.25) for name in plates])
        self._stiff.set_verts([places[i] for places in self.scene.stiff.values()], closed=False)
        for kind, artist in self.marks.items():
            places = [mark.places[i] for mark in self._moving[kind]]
            if isinstance(artist, Line2D):
                artist.set_data(*np.concatenate(places).T)
            else:
                artist.set_verts(places, closed=False)
        for line, trail in zip(self._trails, self.scene.trails, strict=True):
            line.set_data(*trail[: i + 1].T)
        if self.scene.trails:
            self._head.set_data(*np.stack([trail[i] for trail in self.scene.trails]).T)

    def _line(self, colour: str, width: float, zorder: float, **look: Any) -> Line2D:
        (line,) = self.axes.plot([], [], color=colour, linewidth=width * self._width, zorder=zorder, **look)
        line.set(clip_on=False, in_layout=False)
        return line

    def _dots(self, face: str, edge: str, size: float, width: float, zorder: float) -> Line2D:
        return self._line(
            face, 0.0, zorder, linestyle="none", marker="o", markersize=size * self._width, markeredgecolor=edge,
            markeredgewidth=width * self._width,
        )  # fmt: skip

    def _symbols(self, kind: str, zorder: float) -> PolyCollection:
        fill, stroke, width, dashed = LOOKS[kind]
        face = getattr(self.look, fill) if fill else "none"
        symbols = self._polygons(face, getattr(self.look, stroke), width, zorder + 0.1 * list(LOOKS).index(kind))
        if dashed:
            symbols.set_linestyle((0, (5.0, 3.0)))
        return symbols

    def _polygons(self, face: str, edge: str, width: float, zorder: float) -> PolyCollection:
        polygons = PolyCollection(
            [], closed=False, facecolors=face, edgecolors=edge, linewidths=width * self._width, zorder=zorder,
            capstyle="round", joinstyle="round", clip_on=False, in_layout=False,
        )  # fmt: skip
        self.axes.add_collection(polygons, autolim=False)
        return polygons


def bare(axes: Axes, limits: Limits) -> Axes:
    """Set the limits of axes, hide their frame and ticks, and return them."""
    axes.set_xlim(limits.left, limits.right)
    axes.set_ylim(limits.bottom, limits.top)
    axes.set_axis_off()
    return axes


def pictures(
    rows: Mapping[str, Sequence[tuple[Scene, str]]],
    look: Theme,
    columns: int,
    width: float,
    aspects: tuple[float, float],
) -> tuple[Figure, Limits]:
    """Draw the last time of scenes side by side, with the links of earlier times pale; return figure and limits.

    Parameters
    ----------
    rows : mapping of str to sequence of (Scene, str)
        Scenes with their titles, by the heading above them; an empty heading takes no room.
    look : Theme
        Colours.
    columns : int
        Number of panels side by side.
    width : float
        Width of links relative to that in a film.
    aspects : (float, float)
        Smallest and largest height of a panel relative to its width.
    """
    shown = [one for row in rows.values() for one, _ in row]
    limits, aspect = common_limits(shown).filling(*aspects)
    page = page_width(TWO_COLUMNS)
    tall = page / columns * aspect
    lines = {heading: -(-len(row) // columns) for heading, row in rows.items()}
    top = height = sum(count * (tall + _PANEL_HEAD) + (HEAD if heading else 0.0) for heading, count in lines.items())
    figure = Figure(figsize=(page * MM, height * MM), facecolor=look.ground)
    for heading, row in rows.items():
        if heading:
            figure.text(0.01, (top - 0.8) / height, heading, va="top", fontsize=8.0, color=look.ink, fontweight="bold")
            top -= HEAD
        for k, (one, title) in enumerate(row):
            line, column = divmod(k, columns)
            bottom = (top - (line + 1) * (tall + _PANEL_HEAD)) / height
            axes = bare(figure.add_axes((column / columns, bottom, 1.0 / columns, tall / height)), limits)
            for places in one.bodies.values():
                for earlier in places[:-1]:
                    axes.plot(*earlier.T, color=look.faint, linewidth=0.7, zorder=1.0, clip_on=False)
            Sketch(axes, one, limits, look, width).show(one.time.size - 1)
            axes.set_title(title, fontsize=8.0, color=look.ink, pad=1.0)
        top -= lines[heading] * (tall + _PANEL_HEAD)
    return figure, limits


def draw_scale_bar(
    figure: Figure, limits: Limits, look: Theme, corner: tuple[float, float], size: float, share: float = 1.0
) -> None:
    """Draw a scale bar of a round length that ends at a corner of the figure.

    `share` is the share of the figure's width that shows the limits.
    """
    length, name = scale_bar(limits)
    right, bottom = corner
    left = right - share * length / (limits.right - limits.left)
    figure.add_artist(
        Line2D([left, right], [bottom, bottom], color=look.ink, linewidth=0.22 * size, solid_capstyle="butt")
    )
    figure.text(0.5 * (left + right), bottom + 0.008, name, color=look.ink, fontsize=size, ha="center", va="bottom")


def draw_load_keys(
    figure: Figure,
    shown: Scene,
    limits: Limits,
    look: Theme,
    corner: tuple[float, float],
    size: float,
    share: float = 1.0,
) -> None:
    """Draw arrows of the largest force and torque with their magnitudes, in a row from a corner of the figure.

    `share` is the share of the figure's width that shows the limits.
    """
    x, y = corner
    # Shares of the figure per metre; the width of letters is estimated as in `name_links`.
    scale = share / (limits.right - limits.left)
    up = scale * figure.get_figwidth() / figure.get_figheight()
    for kind, text in shown.load_keys.items():
        line, head = key_arrow(kind, limits)
        first, last = (float(end(np.concatenate([line, head])[:, 0])) for end in (np.min, np.max))
        left = x - scale * first
        line, head = (np.array([left, y]) + np.array([scale, up]) * places for places in (line, head))
        figure.add_artist(Line2D(*line.T, color=look.trail, linewidth=0.2 * size))
        figure.add_artist(Polygon(head, color=look.trail))
        x += scale * (last - first) + 0.5 * size / 72.0 / figure.get_figwidth()
        figure.text(x, y, text, color=look.trail, fontsize=size, va="center", parse_math=False)
        x += (len(text) + 2.0) * size / 72.0 * 0.6 / figure.get_figwidth()


def caption(shown: Scene) -> str:
    """Return the text that states the magnification of deflections."""
    if shown.magnified == 1.0:
        return "true deflections"
    return "links drawn stiff" if shown.magnified == 0.0 else f"deflections × {shown.magnified:g}"


def name_links(figure: Figure, shown: Scene, look: Theme, size: float, y: float) -> None:
    """Write the names of the bodies in their colours, in a row; none if there is no room for all of them."""
    names = list(shown.bodies)
    if len(names) > _MOST_NAMED:
        return
    # The width of a letter is two thirds of its size, as a share of the figure's width; names are three letters apart.
    letter = size / 72.0 * 0.68 / figure.get_figwidth()
    widths = letter * np.array([len(name) + 3.0 for name in names])
    widths *= min(1.0, 0.94 / widths.sum())
    places = 0.5 - 0.5 * widths.sum() + np.cumsum(widths) - 0.5 * widths
    for i, (name, x) in enumerate(zip(names, places, strict=True)):
        figure.text(
            x, y, name, color=look.link(i), fontsize=size, ha="center", va="center", fontweight="bold",
            parse_math=False,
        )  # fmt: skip
