"""Sketch of a mechanism in one pose, from positions alone, and the desired path in the workspace (Fig. 11)."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from paraflex.arrays import Array
from paraflex.errors import InputError
from paraflex.figures.selection import names_of, samples
from paraflex.figures.shapes import along, figure_of
from paraflex.formatting import number, text_symbol
from paraflex.results.outlines import figure_order
from .drawing import FOOT, HEAD, Sketch, bare, caption, draw_load_keys, draw_scale_bar
from .given import drawn
from .labels import plain
from .layout import MM, ONE_COLUMN, finish_plane, page_width, panels
from .marks import moving_marks, still_marks
from .named import Name, place_names
from .scene import DrawnJoint, Scene, default_magnification, limits_of, run_times, scene, select
from .style import BLACK, BLUE, points
from .themes import theme

# Largest number of joints that are named in a small drawing, and size of the names [pt].
_MOST_NAMED, _TEXT = 24, 6.0
_START: dict[str, Any] = {
    "color": BLACK, "linestyle": "none", "marker": "s", "markersize": 4.5, "zorder": 4.0, "label": "start",
}  # fmt: skip


@drawn
def desired_path(data: xr.Dataset) -> Figure:
    """Plot the desired path of the end-effector, and the mechanism in its start pose (Fig. 11)."""
    path = 1e3 * data["end_effector_desired"].isel(mode=0).transpose("time", "axis").values
    figure, grid = panels(1, 1, width=ONE_COLUMN)
    axes: Axes = grid[0, 0]
    axes.set_aspect("equal")
    axes.set_xlabel("$x$ [mm]")
    axes.set_ylabel("$y$ [mm]")
    axes.plot(*path.T, color=BLUE, linewidth=1.3, zorder=2.6, label="desired path")
    _draw_direction(axes, path)
    axes.plot(*path[0], **_START)
    names, taken = _draw_mechanism(axes, data)
    finish_plane(figure, axes)
    place_names(axes, names, [*taken, path], points("font.size"))
    return figure


@drawn
def mechanism_drawing(
    data: xr.Dataset,
    mode: str | None = None,
    time: float | None = None,
    magnify: float | None = None,
    *,
    model: str | None = None,
    width: float = 84.0,
    theme_name: str = "light",
    point: str | None = None,
) -> Figure:
    """Draw the mechanism at one time, with the end-effector's trail up to that time and its desired path.

    Parameters
    ----------
    time : float, optional
        Time of the drawing [s]; the middle of the run by default.
    magnify : float, optional
        Magnification of deflections: joints stay in place, links bend more. The default is a round number at which
        bending is visible.
    model : str, optional
        Model of a verification; the reference model by default.
    width : float
        Width of the figure [mm].
    theme_name : str
        Theme of colours, "light" (default) or "dark".
    point : str, optional
        Point "body.point" whose trail is drawn in place of the end-effector's.
    """
    look, width = theme(theme_name), page_width(width)
    run = select(data, mode, model)
    first, last = run_times(run)
    time = 0.5 * (first + last) if time is None else time
    if not first <= time <= last:
        raise InputError("outside the run", field="time", value=time, remedy=f"choose it from {first:g} to {last:g} s")
    until = run["time"].values
    magnify = default_magnification([run]) if magnify is None else magnify
    shown = scene(run, np.append(until[until < time], time), magnify, [] if point is None else [point])
    limits, aspect = shown.limits.filling(0.4, 1.25)
    height = width * aspect + HEAD + FOOT
    figure = Figure(figsize=(width * MM, height * MM), facecolor=look.ground)
    axes = bare(figure.add_axes((0.0, FOOT / height, 1.0, 1.0 - (HEAD + FOOT) / height)), limits)
    sketch = Sketch(axes, shown, limits, look, width=0.5)
    sketch.show(len(shown.time) - 1)
    stations = dict(zip(names_of(run, "point"), run["point_station"].values.tolist(), strict=True))
    effector = point or run.attrs.get("end_effector_point")
    names = {station: name for name, station in reversed(stations.items())}
    _name_marks(sketch, [effector] if effector else [names.get(station, "") for station in shown.followed])
    draw_scale_bar(figure, sketch.limits, look, (0.98, 1.5 / height), 6.5)
    draw_load_keys(figure, shown, sketch.limits, look, (0.02, 2.5 / height), 6.5)
    title = [shown.mechanism, *([f"mode {plain(shown.mode)}"] if shown.mode else [])]
    figure.text(0.02, 0.985, ", ".join(title), va="top", color=look.ink, fontsize=7.0)
    figure.text(
        0.98,
        0.985,
        f"t = {number(time, 3, padded=True)} s, {caption(shown)}",
        va="top",
        ha="right",
        color=look.ink,
        fontsize=7.0,
    )
    return figure


def _name_marks(sketch: Sketch, followed: Sequence[str]) -> None:
    """Write the names of joints, if there are few, and of the points with trails, at the scene's last time."""
    shown, look = sketch.scene, sketch.look
    joints = [joint for joint in shown.joints if np.isfinite(joint.place[-1]).all()]
    drawn = [figure_of(places[-1:])[0] for places in shown.bodies.values()]
    drawn += [mark.places[-1] for mark in (*still_marks(shown, sketch.limits), *moving_marks(shown, sketch.limits))]
    names = [Name(text_symbol(joint.name), joint.place[-1:], look.ink) for joint in joints]
    names = names if len(names) <= _MOST_NAMED else []
    for name, trail in zip(followed, shown.trails, strict=False):
        if np.isfinite(trail[-1]).all():
            names.insert(0, Name(name, trail[-1:], look.trail, bold=True))
            drawn.append(trail)
    place_names(sketch.axes, names, drawn, _TEXT)


def _draw_direction(axes: Axes, path: Array) -> None:
    """Draw arrow heads along a path at one, three, five and seven eighths of its length."""
    if not np.ptp(path, axis=0).any():
        return
    for share in (0.125, 0.375, 0.625, 0.875):
        tail, head = along(path, (share - 0.01, share + 0.01))
        axes.annotate(
            "",
            xytext=tail,
            xy=head,
            arrowprops={"arrowstyle": "-|>", "color": BLUE, "mutation_scale": 9.0, "shrinkA": 0.0, "shrinkB": 0.0},
            zorder=2.7,
        )


_LOOK = replace(theme("light"), ink=BLACK, earth=BLACK, links=("#737373",))
# Millimetres per metre, and number of samples of a run from which the travel of sliding joints is found.
_MM, _POSES = 1e3, 61
# Variables of a scene that are lengths.
_LENGTHS = ("shape", "shape_base", "joint_position", "joint_base", "spring_position", "gear_radius",
            "end_effector_desired")  # fmt: skip
# Line width relative to that of a film.
_WIDTH = 0.68

# Distance below which points coincide or are at rest, as a share of the mechanism's size: constraints hold no better.
_SAME = 1e-4


def _draw_mechanism(axes: Axes, data: xr.Dataset) -> tuple[list[Name], list[Array]]:
    """Draw the start pose: every link, its joints and the points that do not move; of the run with most samples.

    Return the names of points, one for those that coincide, and the lines that names keep clear of (n, 2) [mm].
    """
    run = max((data.isel(mode=k) for k in range(data.sizes["mode"])), key=samples)
    if samples(run) == 0:
        return [], []
    places = _MM * run["point_position"].transpose("time", "point", "axis").values[: samples(run)]
    names = names_of(run, "point")
    start, size = places[0], float(np.ptp(places[0], axis=0).max())
    moves = np.ptp(places, axis=0).max(axis=1)
    fixed = moves <= _SAME * size if moves.max() > _SAME * size else np.zeros(len(names), dtype=bool)
    groups = _coincident(start, size)
    joined = [group[0] for group in groups if len(group) > 1 or fixed[group[0]]]
    joints = [DrawnJoint(names[k], "pin", bool(fixed[k]), start[None, k], np.full(1, np.nan)) for k in joined]
    shown = _of_shapes(run) if "shape" in run and "joint_kind" in run else _scene(start, names, tuple(joints))
    sketch = Sketch(axes, shown, shown.limits, _LOOK, _WIDTH)
    sketch.show(0)
    sketch.links.set_label("links")
    if "pin" in sketch.marks:
        sketch.marks["pin"].set_label("joints")
    grounds = [mark.places[0] for mark in still_marks(shown, shown.limits)]
    if grounds:
        axes.plot([], [], label="ground", linestyle="none", marker="^", markerfacecolor="none", markeredgecolor=BLACK)
    others = [group[0] for group in groups if group[0] not in joined]
    if others:
        axes.plot(*start[others].T, "o", label="other points", markersize=2.5, color=BLACK, zorder=3.0)
    marks = [mark.places[0] for mark in moving_marks(shown, shown.limits)]
    taken = [*(figure_of(places[:1])[0] for places in shown.bodies.values()), *grounds, *marks]
    everywhere = np.vstack([start, *taken])
    axes.update_datalim(everywhere[np.isfinite(everywhere).all(axis=1)])
    texts = [dict.fromkeys(text_symbol(names[k].rpartition(".")[2]) for k in group) for group in groups]
    named = [Name(", ".join(text), start[group[:1]], BLACK) for text, group in zip(texts, groups, strict=True)]
    return named, taken


def _of_shapes(run: xr.Dataset) -> Scene:
    """Return the scene of the start pose in mm, with rails as long as the travel of the run."""
    in_mm = run.assign({name: _MM * run[name].astype(float) for name in _LENGTHS if name in run})
    return replace(scene(in_mm, np.linspace(*run_times(run), _POSES)), trails=(), desired=None, loads=())


def _scene(points: Array, names: list[str], joints: tuple[DrawnJoint, ...]) -> Scene:
    """Return a scene whose bodies are the figures formed by their points, at one time."""
    bodies: dict[str, list[int]] = {}
    for k, name in enumerate(names):
        bodies.setdefault(name.rpartition(".")[0], []).append(k)
    outlines = {name: points[None, ks][:, figure_order(points[ks])] for name, ks in bodies.items()}
    return Scene(
        mechanism="", mode="", time=np.zeros(1), magnified=1.0, bodies=outlines, stiff={}, joints=joints, springs={},
        gears=(), anchors=(), followed=(), trails=(), desired=None, reached=0.0, limits=limits_of(points),
    )  # fmt: skip


def _coincident(points: Array, size: float) -> list[list[int]]:
    """Return the indices of points, grouped by position."""
    groups: dict[int, list[int]] = {}
    for k, point in enumerate(points):
        first = int(np.argmax(np.linalg.norm(points - point, axis=1) <= _SAME * size))
        groups.setdefault(first, []).append(k)
    return list(groups.values())
