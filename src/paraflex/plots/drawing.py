"""A mechanism drawn: links with their true or magnified deflections, joints, ground, springs, paths."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from paraflex.errors import InputError
from paraflex.plots.given import drawn
from paraflex.plots.labels import mode_label, three_digits
from paraflex.plots.layout import page_width
from paraflex.plots.scene import (
    Limits,
    Scene,
    block,
    figure_of,
    ground_of,
    run_times,
    scale_bar,
    scene,
    select,
    square,
    support,
    zigzag,
)
from paraflex.plots.themes import Theme, theme

Array = NDArray[np.float64]

# Bodies named under a picture; of more there is no room.
_NAMED = 9
_MM = 1.0 / 25.4
# Room above and below a drawing [mm].
_HEAD, _FOOT = 5.0, 5.5


class Sketch:
    """A scene on Matplotlib's axes: what stays is drawn once, what moves is put in place picture by picture."""

    def __init__(self, axes: Axes, shown: Scene, limits: Limits, look: Theme, width: float = 1.0) -> None:
        self.scene, self.look = shown, look
        self.axes, self.limits, self._width = axes, limits, width
        axes.set_xlim(limits.left, limits.right)
        axes.set_ylim(limits.bottom, limits.top)
        axes.set_axis_off()
        self._draw_ground()
        if shown.desired is not None:
            axes.plot(*shown.desired.T, color=look.desired, linewidth=1.1 * width, linestyle=(0, (3, 2)), zorder=1.5)
        self._moving: list[Any] = []
        self._trail = axes.plot([], [], color=look.trail, linewidth=1.3 * width, zorder=2.2)[0]
        names = list(shown.bodies)
        colours = [look.link(i) for i in range(len(names))]
        self._stiff = self._lines(look.faint, 1.2, 2.4)
        self._plates = PolyCollection([], facecolors=[], edgecolors="none", zorder=2.6)
        axes.add_collection(self._plates, autolim=False)
        self._links = self._lines(colours, 3.4, 3.0)
        self._dots = axes.scatter([], [], s=[], zorder=3.0)
        self._springs = self._lines(look.earth, 1.1, 3.1)
        self._blocks = self._polygons(look.ground, look.ink, 1.2, 3.4)
        self._welds = self._polygons(look.ink, look.ink, 0.8, 3.6)
        self._pins = axes.plot(
            [], [], linestyle="none", marker="o", markersize=5.4 * width, color=look.ground,
            markeredgecolor=look.ink, markeredgewidth=1.3 * width, zorder=4.0,
        )[0]  # fmt: skip
        self._head = axes.plot(
            [], [], linestyle="none", marker="o", markersize=4.2 * width, color=look.trail,
            markeredgecolor=look.ground, markeredgewidth=0.7 * width, zorder=4.2,
        )[0]  # fmt: skip
        self._colours = dict(zip(names, colours, strict=True))
        self._sliding = [block(joint, limits) for joint in shown.joints if joint.slides]
        self._welded = [square(joint.place, limits) for joint in shown.joints if joint.kind == "weld"]
        # What slides and turns, turns on a pin; what is welded to a block does neither.
        self._pinned = [joint.place for joint in shown.joints if joint.kind in ("pin", "slot", "sliding")]
        self._zigzags = [zigzag(ends, limits) for ends in shown.springs]

    @property
    def artists(self) -> list[Artist]:
        """What moves."""
        moving = [
            self._trail, self._stiff, self._plates, self._links, self._dots, self._springs, self._blocks, self._welds,
            self._pins, self._head,
        ]  # fmt: skip
        return sorted(moving, key=lambda artist: artist.get_zorder())

    def show(self, i: int) -> None:
        """Put everything where it is at the scene's time of that number."""
        bodies = {name: figure_of(places[i]) for name, places in self.scene.bodies.items()}
        self._links.set_segments([places for places in bodies.values() if len(places) > 1])
        self._links.set_color([self._colours[name] for name, places in bodies.items() if len(places) > 1])
        plates = {name: places for name, places in bodies.items() if is_plate(places)}
        self._plates.set_verts(list(plates.values()))
        self._plates.set_facecolor([(*_rgb(self._colours[name]), 0.25) for name in plates])
        single = {name: places[0] for name, places in bodies.items() if len(places) == 1}
        self._dots.set_offsets(np.array(list(single.values())).reshape(-1, 2))
        self._dots.set_sizes([(7.0 * self._width) ** 2] * len(single))
        self._dots.set_color([self._colours[name] for name in single])
        self._stiff.set_segments([places[i] for places in self.scene.stiff.values() if places.shape[1] > 1])
        self._springs.set_segments([places[i] for places in self._zigzags])
        self._blocks.set_verts([places[i] for places in self._sliding])
        self._welds.set_verts([places[i] for places in self._welded])
        self._pins.set_data(*np.array([places[i] for places in self._pinned]).reshape(-1, 2).T)
        if self.scene.trail is not None:
            self._trail.set_data(*self.scene.trail[: i + 1].T)
            self._head.set_data(*self.scene.trail[i : i + 1].T)

    def _lines(self, colours: Any, width: float, zorder: float) -> LineCollection:
        lines = LineCollection(
            [], colors=colours, linewidths=width * self._width, zorder=zorder, capstyle="round", joinstyle="round"
        )
        self.axes.add_collection(lines, autolim=False)
        return lines

    def _polygons(self, face: str, edge: str, width: float, zorder: float) -> PolyCollection:
        polygons = PolyCollection([], facecolors=face, edgecolors=edge, linewidths=width * self._width, zorder=zorder)
        self.axes.add_collection(polygons, autolim=False)
        return polygons

    def _draw_ground(self) -> None:
        lines, strokes = [], []
        for joint in self.scene.joints:
            if joint.grounded:
                outlines, hatches = ground_of(joint, self.limits)
                lines += outlines
                strokes += list(hatches)
        for place in self.scene.anchors:
            outlines, hatches = support(place, self.limits)
            lines += outlines
            strokes += list(hatches)
        for segments, width in ((lines, 1.2), (strokes, 0.8)):
            self._lines(self.look.earth, width, 1.0).set_segments(segments)


def is_plate(places: Array) -> bool:
    """Whether the stations (s, 2) that `figure_of` gives are a closed figure."""
    return len(places) > 3 and bool(np.all(places[0] == places[-1]))


def draw_scale_bar(
    figure: Figure, limits: Limits, look: Theme, corner: tuple[float, float], size: float, share: float = 1.0
) -> None:
    """A bar of a round length that ends at a corner of the figure; `share` of its width shows the limits."""
    length, name = scale_bar(limits)
    right, bottom = corner
    left = right - share * length / (limits.right - limits.left)
    figure.add_artist(
        Line2D([left, right], [bottom, bottom], color=look.ink, linewidth=0.22 * size, solid_capstyle="butt")
    )
    figure.text(0.5 * (left + right), bottom + 0.008, name, color=look.ink, fontsize=size, ha="center", va="bottom")


def caption(shown: Scene) -> str:
    """What is magnified."""
    if shown.magnified == 1.0:
        return "true deflections"
    return "links drawn stiff" if shown.magnified == 0.0 else f"deflections × {shown.magnified:g}"


@drawn
def mechanism_drawing(
    data: xr.Dataset,
    mode: str | None = None,
    time: float | None = None,
    magnify: float = 1.0,
    *,
    model: str | None = None,
    width: float = 84.0,
    theme_name: str = "light",
) -> Figure:
    """The mechanism at a time, with its end-effector's trail until then and its desired path.

    Parameters
    ----------
    data : xarray.Dataset
        Of a run, with a path or without, or of a verification.
    mode : str, optional
        Actuation mode; the first by default.
    time : float, optional
        [s]; half way by default.
    magnify : float
        How many times deflections are drawn: joints stay where they are, links bend more.
    model : str, optional
        Of a verification; the reference by default.
    width : float
        [mm]
    theme_name : str
        "light" or "dark".

    Raises
    ------
    InputError
        No such mode, model or theme, a time outside the run, or results without shapes.
    """
    look, width = theme(theme_name), page_width(width)
    run = select(data, mode, model)
    first, last = run_times(run)
    time = 0.5 * (first + last) if time is None else time
    if not first <= time <= last:
        raise InputError("outside the run", field="time", value=time, remedy=f"choose it from {first:g} to {last:g} s")
    until = run["time"].values
    shown = scene(run, np.append(until[until < time], time), magnify)
    limits = shown.limits
    aspect = float(np.clip((limits.top - limits.bottom) / (limits.right - limits.left), 0.4, 1.25))
    height = width * aspect + _HEAD + _FOOT
    figure = Figure(figsize=(width * _MM, height * _MM), facecolor=look.ground)
    axes = figure.add_axes((0.0, _FOOT / height, 1.0, 1.0 - (_HEAD + _FOOT) / height))
    sketch = Sketch(axes, shown, limits.fitted(1.0 / aspect), look, width=0.5)
    sketch.show(len(shown.time) - 1)
    draw_scale_bar(figure, sketch.limits, look, (0.98, 1.5 / height), 6.5)
    told = [shown.mechanism, *([f"mode {mode_label(shown.mode)}"] if shown.mode else [])]
    figure.text(0.02, 0.985, ", ".join(told), va="top", color=look.ink, fontsize=7.0)
    figure.text(
        0.98, 0.985, f"t = {three_digits(time)} s, {caption(shown)}", va="top", ha="right", color=look.ink, fontsize=7.0
    )
    return figure


def name_links(figure: Figure, shown: Scene, look: Theme, size: float, y: float) -> None:
    """Names of the bodies in their colours, in a row."""
    names = list(shown.bodies)
    if len(names) > _NAMED:
        return
    # Letters are two thirds of their size wide, as shares of the figure's width; three between names.
    letter = size / 72.0 * 0.68 / figure.get_figwidth()
    widths = letter * np.array([len(name) + 3.0 for name in names])
    widths *= min(1.0, 0.94 / widths.sum())
    places = 0.5 - 0.5 * widths.sum() + np.cumsum(widths) - 0.5 * widths
    for i, (name, x) in enumerate(zip(names, places, strict=True)):
        figure.text(
            x, y, name, color=look.link(i), fontsize=size, ha="center", va="center", fontweight="bold",
            parse_math=False,
        )  # fmt: skip


def _rgb(colour: str) -> tuple[float, float, float]:
    return tuple(int(colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5))  # type: ignore[return-value]
