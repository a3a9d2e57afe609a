"""Drawing of a model before it runs: names, joints by kind, drives, loads, sensors and path."""

from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import FancyArrowPatch

from paraflex.arrays import Array
from paraflex.figures.shapes import along, figure_of
from paraflex.formatting import number as number_text, printable
from paraflex.mechanism import GROUND, Mechanism, PointRef
from paraflex.results.posed import Posed
from .drawing import Sketch
from .layout import MM, TWO_COLUMNS, page_width
from .marks import moving_marks, still_marks
from .model_marks import SENSOR, Acting, SensorMark, acting_arrows, load_places, sensor_marks
from .named import Name, place_names
from .scene import Limits, Scene, common_limits, limits_of, scene
from .signs import arrow_sign, draw_arrow, joint_sign, sign_legend
from .style import journal_style
from .themes import Theme, theme

_MM_OF_POINT = 25.4 / 72.0
# Room around the panel: left, right, below with the legend, above with the title [mm].
_LEFT, _RIGHT, _BELOW, _ABOVE = 13.0, 2.5, 15.5, 8.0
_FLATTEST, _TALLEST = 0.36, 0.85
# Largest numbers of members that are named: more names would hide the drawing.
_MOST_BODIES, _MOST_JOINTS, _MOST_MOTORS, _MOST_SENSORS, _MOST_POINTS = 40, 60, 24, 40, 40
_TEXT = 7.5
# Length of the arrow of gravity as a share of the picture.
_WEIGHT = 0.09
_OPEN = "#c8102e"
_GAP: dict[str, Any] = {"color": _OPEN, "linewidth": 1.3, "linestyle": (0, (3, 2)), "marker": "x", "markersize": 5.0}
_PAYLOAD: dict[str, Any] = {"marker": "s", "markersize": 11.0, "markeredgewidth": 1.2, "linestyle": "none"}
_START: dict[str, Any] = {"marker": "s", "markersize": 7.0, "markerfacecolor": "none", "linestyle": "none"}
# Names of kinds of joints in the legend, by symbol.
_KINDS = {
    "pin": "revolute", "weld": "weld", "slider": "prismatic", "slot": "slot", "sliding": "slides along a beam",
    "rod": "rod without mass",
}  # fmt: skip
# Width of dots and lines relative to those of a film.
_WIDTH = 0.62
# Width of an entry of the legend without its text [pt], and height of each further row [mm].
_ENTRY, _ROW = 30.0, 6.0


def model_drawing(posed: Posed, *, width: float = TWO_COLUMNS, theme_name: str = "light") -> Figure:
    """Draw a mechanism at its start pose.

    Parameters
    ----------
    posed : Posed
        Mechanism at its start pose, see `results.posed`.
    width : float
        Width of the figure [mm]; two columns of a journal by default.
    theme_name : str
        Theme of colours, "light" (default) or "dark".
    """
    look, mechanism = theme(theme_name), posed.mechanism
    with journal_style():
        shown = posed_scene(posed)
        limits, aspect = shown.limits.filling(_FLATTEST, _TALLEST)
        acting, sensors = acting_arrows(posed, shown, limits), sensor_marks(posed, limits)
        entries = _entries(posed, shown, acting, sensors, limits, look)
        rows = _rows([words for words, _ in entries], page_width(width))
        figure, axes = _panel(limits, aspect, page_width(width), rows, look)
        sketch = Sketch(axes, shown, limits, look, width=_WIDTH)
        sketch.show(0)
        drawn = _drawn_places(shown, limits)
        drawn += _draw_path(axes, posed, look)
        drawn += _draw_acting(axes, acting, look) + _draw_sensors(axes, sensors, look)
        drawn += _draw_gravity(axes, mechanism, limits, look)
        axes.plot(*np.array([*mechanism.ground.values()]).reshape(-1, 2).T, "+", color=look.earth, markersize=4.0)
        _draw_gaps(axes, posed)
        if posed.payload is not None:
            # The payload is above links and below the marks of joints and the end-effector.
            axes.plot(*posed.payload, **_PAYLOAD, **_payload_colours(look), zorder=3.05)
            drawn.append(posed.payload[None])
        points = _named_points(posed, shown, limits)
        axes.plot(*np.array([*points.values()]).reshape(-1, 2).T, "+", color=look.ink, markersize=4.0, zorder=3.06)
        named = _body_names(shown, look) + _joint_names(posed, shown, look) + _other_names(posed, shown, limits, look)
        named += _acting_names(acting, sensors, look)
        named += [Name(name, place[None], look.earth) for name, place in points.items()]
        place_names(axes, named, drawn, _TEXT)
        if entries:
            columns = -(-len(entries) // rows)
            sign_legend(
                figure,
                axes,
                entries,
                ncols=columns,
                fontsize=_TEXT,
                labelcolor=look.ink,
                handlelength=2.0,
                labelspacing=1.2,
                borderpad=0.5,
            )
        _title(figure, posed, look)
    return figure


def posed_scene(posed: Posed) -> Scene:
    """Return the scene of the start pose; without an end-effector it has no trail."""
    shown = scene(posed.data, posed.data["time"].values, 1.0)
    ground = {joint.name: posed.mechanism.ground[ref.point] for joint in posed.mechanism.joints
              for ref in (joint.a, joint.b) if ref.on_ground}  # fmt: skip
    # The ground point of an open joint is not at its body, so its support is drawn as an anchor.
    anchors = [np.array(ground[name]) for name in posed.gaps if name in ground]
    joints = [replace(joint, grounded=joint.grounded and joint.name not in posed.gaps) for joint in shown.joints]
    desired = [] if posed.desired is None else posed.desired
    tails = load_places(posed, shown.limits.size)
    places = np.array([*ground.values(), *desired, *tails]).reshape(-1, 2)
    if len(places):
        shown = replace(shown, limits=common_limits([shown, replace(shown, limits=limits_of(places))]))
    shown = replace(shown, desired=posed.desired, joints=tuple(joints), anchors=(*shown.anchors, *anchors))
    return shown if posed.mechanism.end_effector is not None else replace(shown, trails=(), followed=())


def _rows(words: list[str], width: float) -> int:
    """Return the number of rows of the legend."""
    return max(1, int(np.ceil(sum(0.58 * _TEXT * len(text) + _ENTRY for text in words) * _MM_OF_POINT / width)))


def _panel(limits: Limits, aspect: float, width: float, rows: int, look: Theme) -> tuple[Figure, Axes]:
    inside, below = width - _LEFT - _RIGHT, _BELOW + (rows - 1) * _ROW
    height = inside * aspect + below + _ABOVE
    figure = Figure(figsize=(width * MM, height * MM), facecolor=look.ground)
    axes = figure.add_axes((_LEFT / width, below / height, inside / width, inside * aspect / height))
    axes.set_facecolor(look.ground)
    axes.set_xlim(limits.left, limits.right)
    axes.set_ylim(limits.bottom, limits.top)
    axes.set_xlabel("$x$ [m]", color=look.ink)
    axes.set_ylabel("$y$ [m]", color=look.ink)
    axes.grid(color=look.faint, linewidth=0.4, alpha=0.5)
    axes.tick_params(colors=look.ink, length=0.0)
    for spine in axes.spines.values():
        spine.set_color(look.faint)
    return figure, axes


def _drawn_places(shown: Scene, limits: Limits) -> list[Array]:
    """Return the lines of the start pose that names keep clear of."""
    bodies = [figure_of(places)[0] for places in shown.bodies.values()]
    marks = [mark.places[0] for mark in (*still_marks(shown, limits), *moving_marks(shown, limits))]
    return [*bodies, *marks]


def _draw_path(axes: Axes, posed: Posed, look: Theme) -> list[Array]:
    """Draw the start of the path and arrow heads along it, and return its points; the scene draws the path itself."""
    path = posed.desired
    if path is None:
        return []
    axes.plot(*path[0], **_START, markeredgecolor=look.desired, zorder=3.6)
    for share in (0.2, 0.5, 0.8) if np.ptp(path, axis=0).any() else ():
        _arrow(axes, along(path, (share - 0.01, share + 0.01)), look.desired, 8.0)
    return [path]


def _draw_acting(axes: Axes, acting: Acting, look: Theme) -> list[Array]:
    """Draw the arrows of loads and of first movements, and return their points."""
    for load in acting.loads:
        draw_arrow(axes, load.arrow, _load_looks(load.later, look))
    for arrow in acting.moves:
        draw_arrow(axes, arrow, _move_looks(look))
    return [arrow.outline for arrow in (*(load.arrow for load in acting.loads), *acting.moves)]


def _load_looks(later: bool, look: Theme) -> dict[str, Any]:
    """Return the look of a load's arrow: dashed and pale if the load does not act at the start."""
    looks: dict[str, Any] = {"color": look.trail, "linewidth": 1.6}
    return looks | ({"linestyle": (0, (2.5, 1.5)), "alpha": 0.55} if later else {})


def _move_looks(look: Theme) -> dict[str, Any]:
    return {"color": look.ink, "linewidth": 1.1}


def _draw_sensors(axes: Axes, sensors: list[SensorMark], look: Theme) -> list[Array]:
    """Draw a diamond at each sensor, with the axis along which or the sense in which it measures; return the points."""
    for one in sensors:
        draw_arrow(axes, one.arrow, {"color": look.sensor, "linewidth": 0.9})
        axes.plot(*one.place, **SENSOR, **_sensor_colours(look), zorder=4.3)
    return [np.vstack([one.place, one.arrow.outline]) for one in sensors]


def _draw_gravity(axes: Axes, mechanism: Mechanism, limits: Limits, look: Theme) -> list[Array]:
    """Draw the arrow of gravity in the upper right corner, with its magnitude, and return its points."""
    weight = np.array(mechanism.gravity, dtype=float)
    size = float(np.linalg.norm(weight))
    if not size:
        return []
    room = _WEIGHT * limits.size
    corner = np.array([limits.right - 0.09 * (limits.right - limits.left), limits.top - 0.7 * room])
    ends = np.array([corner - 0.5 * room * weight / size, corner + 0.5 * room * weight / size])
    _arrow(axes, ends, look.earth, 11.0, 1.4)
    axes.annotate(
        f"g = {number_text(size, 3, padded=True)} m/s²", (corner[0], corner[1]), xytext=(-6.0, 0.0),
        textcoords="offset points",
        ha="right", va="center", fontsize=_TEXT - 0.5, color=look.earth,
    )  # fmt: skip
    return [ends, np.array([corner - [0.22 * (limits.right - limits.left), 0.0], corner])]


def _draw_gaps(axes: Axes, posed: Posed) -> None:
    """Draw the gap of each open joint: between its two points, or from one point to the axis on which it should lie."""
    directions = posed.data["joint_direction"].values[0]
    for joint, direction in zip(posed.mechanism.joints, directions, strict=True):
        if joint.name in posed.gaps:
            ends = np.array([posed.place(joint.a), posed.place(joint.b)])
            if joint.slides:
                axis = np.array([np.cos(direction), np.sin(direction)])
                ends[0] += axis * np.dot(ends[1] - ends[0], axis)
            axes.plot(*ends.T, **_GAP, zorder=4.5)


def _body_names(shown: Scene, look: Theme) -> list[Name]:
    if len(shown.bodies) > _MOST_BODIES:
        return []
    names = []
    for number, (body, places) in enumerate(shown.bodies.items()):
        line = figure_of(places)[0]
        line = line[np.isfinite(line).all(axis=1)]
        if len(line):
            anchors = along(line, (0.5, 0.35, 0.65, 0.22, 0.78)) if len(line) > 1 else line
            names.append(Name(body, anchors, look.link(number), bold=True))
    return names


def _joint_names(posed: Posed, shown: Scene, look: Theme) -> list[Name]:
    """Return the names of joints with the members that act at them; of too many joints only those with motors."""
    mechanism = posed.mechanism
    acting: dict[str, list[str]] = {}
    for word, members in (
        ("motor", mechanism.motors), ("prescribed", mechanism.prescribed), ("spring", mechanism.springs),
        ("damper", mechanism.dampers), ("friction", mechanism.frictions),
    ):  # fmt: skip
        for one in members:
            acting.setdefault(one.joint, []).append(f"{word} {one.name}")
    driven = {motor.joint for motor in mechanism.motors}
    few, names = len(shown.joints) <= _MOST_JOINTS, []
    for joint in shown.joints:
        if few or (joint.name in driven and len(driven) <= _MOST_MOTORS):
            text = ", ".join([joint.name, *acting.get(joint.name, [])])
            if joint.name in posed.gaps:
                text += f": open by {posed.gaps[joint.name]}"
            colour = _OPEN if joint.name in posed.gaps else look.ink
            names.append(Name(text, joint.place[:1], colour, bold=joint.name in driven))
    return [name for name in names if np.isfinite(name.places).all()]


def _other_names(posed: Posed, shown: Scene, limits: Limits, look: Theme) -> list[Name]:
    """Return the names of the end-effector, the path, springs, gears, and ground points without a joint."""
    mechanism, names = posed.mechanism, []
    if mechanism.end_effector is not None and shown.trails:
        ref = mechanism.end_effector.point
        names.append(Name(f"end-effector {ref}", shown.trails[0][:1], look.trail, bold=True))
    if posed.desired is not None:
        names.append(Name(f"path {posed.path}", along(posed.desired, (0.3, 0.6, 0.85, 0.05)), look.desired))
    names += [Name(f"spring {name}", ends[0].mean(axis=0)[None], look.earth) for name, ends in shown.springs.items()]
    for gear in shown.gears:
        names.append(Name(f"gear {gear.name}", along(gear.lines[0][0], (0.5, 0.25, 0.75)), look.earth))
    held = [joint.place[0] for joint in shown.joints]
    for name, place in mechanism.ground.items():
        if all(np.linalg.norm(np.subtract(place, at)) > 1e-6 * limits.size for at in held):
            names.append(Name(f"{GROUND}.{name}", np.array([place], dtype=float), look.earth))
    return [name for name in names if np.isfinite(name.places).all()]


def _free_points(mechanism: Mechanism) -> list[PointRef]:
    """Return the points of bodies at which no joint is."""
    held = {str(ref) for joint in mechanism.joints for ref in (joint.a, joint.b)}
    points = [PointRef(body.name, point) for body in mechanism.bodies for point in body.points]
    return [ref for ref in points if str(ref) not in held]


def _named_points(posed: Posed, shown: Scene, limits: Limits) -> dict[str, Array]:
    """Return the positions (2,) of points of bodies that are away from joints and end-effector; none of too many."""
    free = _free_points(posed.mechanism)
    taken = [joint.place[0] for joint in shown.joints] + [trail[0] for trail in shown.trails]
    places = {str(ref): posed.place(ref) for ref in free} if len(free) <= _MOST_POINTS else {}
    return {
        name: place for name, place in places.items()
        if np.isfinite(place).all() and all(np.linalg.norm(place - at) > 1e-6 * limits.size for at in taken)
    }  # fmt: skip


def _acting_names(acting: Acting, sensors: list[SensorMark], look: Theme) -> list[Name]:
    """Return the names of loads, with their magnitudes, and of sensors."""
    loads = [Name(f"{one.name} {one.size}", one.named, look.trail) for one in acting.loads]
    few = sensors if len(sensors) <= _MOST_SENSORS else []
    places = [np.vstack([one.place, one.arrow.line]) for one in few]
    marked = [Name(f"{one.kind} {one.name}", at, look.sensor) for one, at in zip(few, places, strict=True)]
    return loads + marked


def _arrow(axes: Axes, ends: Array, colour: str, scale: float, width: float = 1.0) -> None:
    arrow = FancyArrowPatch(*map(tuple, ends), arrowstyle="-|>", mutation_scale=scale, shrinkA=0.0, shrinkB=0.0)
    arrow.set(color=colour, linewidth=width, zorder=3.7)
    axes.add_patch(arrow)


def _entries(
    posed: Posed, shown: Scene, acting: Acting, sensors: list[SensorMark], limits: Limits, look: Theme
) -> list[tuple[str, Any]]:
    """Return the entries of the legend, text and sign, for all elements that occur in the drawing."""
    entries: list[tuple[str, Any]] = []
    kinds = {joint.kind for joint in shown.joints}
    entries += [(words, joint_sign(kind, limits, look, _WIDTH)) for kind, words in _KINDS.items() if kind in kinds]
    driven = dict.fromkeys(joint.kind for joint in shown.joints if joint.driven)
    motors, prescribed = bool(posed.mechanism.motors), bool(posed.mechanism.prescribed)
    drive = "motor or drive" if motors and prescribed else "motor" if motors else "drive"
    for kind in driven:
        text = drive if len(driven) == 1 or kind == "pin" else f"{drive}, {_KINDS.get(kind, kind)}"
        entries.append((text, joint_sign(kind, limits, look, _WIDTH, driven=True)))
    if acting.moves:
        text = "first movement" if posed.mechanism.motors else "prescribed motion"
        entries.append((text, arrow_sign(acting.moves[0], limits, _move_looks(look))))
    for later, text in ((False, "load"), (True, "load, not yet at the start")):
        load = next((one for one in acting.loads if one.later is later), None)
        if load is not None:
            entries.append((text, arrow_sign(load.arrow, limits, _load_looks(later, look))))
    if sensors:
        entries.append(("sensor", Line2D([], [], **SENSOR, **_sensor_colours(look))))
    if posed.mechanism.end_effector is not None:
        tip = {"marker": "o", "color": look.trail, "markeredgecolor": look.trail, "markersize": 4.2}
        entries.append(("end-effector", Line2D([], [], linestyle="none", **tip)))
    if posed.payload is not None and posed.mechanism.payload is not None:
        carried = Line2D([], [], **_PAYLOAD | {"markersize": 6.5}, **_payload_colours(look))
        entries.append((f"payload {number_text(posed.mechanism.payload.mass)} kg", carried))
    if posed.path:
        entries.append(("path", Line2D([], [], color=look.desired, linewidth=1.0, linestyle=(0, (3, 2)))))
        entries.append(("its start", Line2D([], [], **_START, markeredgecolor=look.desired)))
    if posed.gaps:
        entries.append(("open", Line2D([], [], **_GAP)))
    return entries


def _sensor_colours(look: Theme) -> dict[str, Any]:
    return {"markerfacecolor": look.ground, "markeredgecolor": look.sensor}


def _payload_colours(look: Theme) -> dict[str, Any]:
    return {"markerfacecolor": look.faint, "markeredgecolor": look.ink}


def _title(figure: Figure, posed: Posed, look: Theme) -> None:
    """Write the title: name, pose, and a remark if the loops do not close."""
    height = figure.get_figheight() / MM
    y = 1.0 - 4.0 / height
    figure.text(
        0.012,
        y,
        printable(posed.mechanism.name),
        color=look.ink,
        fontsize=9.0,
        fontweight="bold",
        va="center",
        parse_math=False,
    )
    text = f"assembly {posed.assembly}" if posed.assembly else "as started"
    if posed.gaps:
        text += ", as given: it does not close"
    elif posed.path and not posed.problems:
        text += f", at the start of path {posed.path}"
    left_out = _left_out(posed)
    figure.text(
        0.988, y, text + left_out, color=_OPEN if posed.gaps else look.ink, fontsize=_TEXT, va="center", ha="right",
        parse_math=False,
    )  # fmt: skip


def _left_out(posed: Posed) -> str:
    """Return a remark on the groups of names that the drawing of a large mechanism omits."""
    what = [
        word
        for word, count, most in (
            ("bodies", len(posed.mechanism.bodies), _MOST_BODIES),
            ("joints", len(posed.mechanism.joints), _MOST_JOINTS),
            ("sensors", len(posed.mechanism.sensors), _MOST_SENSORS),
            ("points", len(_free_points(posed.mechanism)), _MOST_POINTS),
        )
        if count > most
    ]
    return f"; names of {' and '.join(what)} left out" if what else ""
