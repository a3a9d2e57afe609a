"""A mechanism as its file says it, before anything runs: names, joints by kind, motors, springs, loads, path."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import FancyArrowPatch
from numpy.typing import NDArray

from paraflex.mechanism import GROUND, Load, Mechanism, PointForce, PointRef, TabulatedLaw
from paraflex.plots.drawing import Sketch
from paraflex.plots.labels import three_digits
from paraflex.plots.layout import TWO_COLUMNS, page_width
from paraflex.plots.marks import moving_marks, still_marks
from paraflex.plots.named import Name, place_names
from paraflex.plots.scene import Limits, Scene, common_limits, figure_of, limits_of, scene
from paraflex.plots.style import journal_style
from paraflex.plots.themes import Theme, theme
from paraflex.results.posed import Posed

Array = NDArray[np.float64]

_MM = 1.0 / 25.4
# Room round the panel: left, right, below with the legend, above with the title [mm].
_LEFT, _RIGHT, _BELOW, _ABOVE = 13.0, 2.5, 15.5, 8.0
_FLATTEST, _TALLEST = 0.36, 0.85
# Most bodies and joints named: beyond that names would hide what they name.
_MOST_BODIES, _MOST_JOINTS, _MOST_MOTORS = 40, 60, 24
_TEXT = 7.5
# Length of arrows of loads and weight, and radius of those of torques, as parts of the picture.
_ARROW, _TURN = 0.12, 0.045
_OPEN = "#c8102e"
_GAP: dict[str, Any] = {"color": _OPEN, "linewidth": 1.3, "linestyle": (0, (3, 2)), "marker": "x", "markersize": 5.0}
_PAYLOAD: dict[str, Any] = {"marker": "s", "markersize": 11.0, "markeredgewidth": 1.2, "linestyle": "none"}
_START: dict[str, Any] = {"marker": "s", "markersize": 7.0, "markerfacecolor": "none", "linestyle": "none"}
# Kinds of joints in the legend by their symbols: words, marker, its size [pt], and what it is filled with.
_KINDS: dict[str, tuple[str, Any, float, str]] = {
    "pin": ("revolute", "o", 5.0, "ground"),
    "weld": ("weld", "s", 4.0, "ink"),
    "slider": ("prismatic", (4, 0, 45), 8.0, "ground"),
    "slot": ("slot", "$⊡$", 8.0, "ink"),
    "sliding": ("slides along a beam", "$⊡$", 8.0, "ink"),
}


def model_drawing(posed: Posed, *, width: float = TWO_COLUMNS, theme_name: str = "light") -> Figure:
    """A mechanism at the pose it starts from.

    Parameters
    ----------
    posed : Posed
        See `results.posed`.
    width : float
        [mm]
    theme_name : str
        "light" or "dark".
    """
    look, mechanism = theme(theme_name), posed.mechanism
    with journal_style():
        shown = _scene(posed)
        figure, axes, limits = _panel(shown, page_width(width), look)
        sketch = Sketch(axes, shown, limits, look, width=0.62)
        sketch.show(0)
        drawn = _drawn_places(shown, limits)
        drawn += _draw_path(axes, posed, look)
        drawn += _draw_loads(axes, posed, limits, look)
        drawn += _draw_gravity(axes, mechanism, limits, look)
        axes.plot(*np.array([*mechanism.ground.values()]).reshape(-1, 2).T, "+", color=look.earth, markersize=4.0)
        _draw_gaps(axes, posed)
        if posed.payload is not None:
            # Above links, below the marks of joints and the end-effector.
            axes.plot(*posed.payload, **_PAYLOAD, **_payload_colours(look), zorder=3.05)
            drawn.append(posed.payload[None])
        named = _body_names(shown, look) + _joint_names(posed, shown, look) + _other_names(posed, shown, limits, look)
        place_names(axes, named, drawn, _TEXT)
        _legend(figure, posed, shown, look)
        _title(figure, posed, look)
    return figure


def _scene(posed: Posed) -> Scene:
    """The scene of the start; the trail is the end-effector alone."""
    shown = scene(posed.data, posed.data["time"].values, 1.0)
    ground = {joint.name: posed.mechanism.ground[ref.point] for joint in posed.mechanism.joints
              for ref in (joint.a, joint.b) if ref.on_ground}  # fmt: skip
    # The support of an open joint is not where its body is.
    anchors = [np.array(ground[name]) for name in posed.gaps if name in ground]
    joints = [replace(joint, grounded=joint.grounded and joint.name not in posed.gaps) for joint in shown.joints]
    places = np.array([*ground.values(), *([] if posed.desired is None else posed.desired)]).reshape(-1, 2)
    if len(places):
        shown = replace(shown, limits=common_limits([shown, replace(shown, limits=limits_of(places))]))
    shown = replace(shown, desired=posed.desired, joints=tuple(joints), anchors=(*shown.anchors, *anchors))
    return shown if posed.mechanism.end_effector is not None else replace(shown, trail=None, followed=None)


def _panel(shown: Scene, width: float, look: Theme) -> tuple[Figure, Axes, Limits]:
    limits = shown.limits
    inside = width - _LEFT - _RIGHT
    aspect = float(np.clip((limits.top - limits.bottom) / (limits.right - limits.left), _FLATTEST, _TALLEST))
    limits = limits.fitted(1.0 / aspect)
    height = inside * aspect + _BELOW + _ABOVE
    figure = Figure(figsize=(width * _MM, height * _MM), facecolor=look.ground)
    axes = figure.add_axes((_LEFT / width, _BELOW / height, inside / width, inside * aspect / height))
    axes.set_facecolor(look.ground)
    axes.set_xlim(limits.left, limits.right)
    axes.set_ylim(limits.bottom, limits.top)
    axes.set_xlabel("$x$ [m]", color=look.ink)
    axes.set_ylabel("$y$ [m]", color=look.ink)
    axes.grid(color=look.faint, linewidth=0.4, alpha=0.5)
    axes.tick_params(colors=look.ink, length=0.0)
    for spine in axes.spines.values():
        spine.set_color(look.faint)
    return figure, axes, limits


def _drawn_places(shown: Scene, limits: Limits) -> list[Array]:
    """Lines that names keep clear of, at the start."""
    bodies = [figure_of(places)[0] for places in shown.bodies.values()]
    marks = [mark.places[0] for mark in (*still_marks(shown, limits), *moving_marks(shown, limits))]
    return [*bodies, *marks]


def _draw_path(axes: Axes, posed: Posed, look: Theme) -> list[Array]:
    """Where the path begins, and heads of arrows along it; the path itself is the scene's."""
    path = posed.desired
    if path is None:
        return []
    axes.plot(*path[0], **_START, markeredgecolor=look.desired, zorder=3.6)
    for share in (0.2, 0.5, 0.8) if np.ptp(path, axis=0).any() else ():
        _arrow(axes, _along(path, share - 0.01), _along(path, share + 0.01), look.desired, 8.0)
    return [path]


def _draw_loads(axes: Axes, posed: Posed, limits: Limits, look: Theme) -> list[Array]:
    """Forces as arrows to their points, torques as arrows round them."""
    lines = []
    for load in posed.mechanism.loads:
        at = _point(posed, load.point)
        value = _shown_value(load)
        if isinstance(load, PointForce):
            if not value.any():
                continue
            tail = at - _ARROW * limits.size * value / np.linalg.norm(value)
            _arrow(axes, tail, at, look.trail, 11.0, 1.6)
            lines.append(np.array([tail, at]))
        else:
            turn = np.linspace(-0.4, 1.5 * np.pi - 0.4, 40)[:: 1 if value[0] >= 0.0 else -1]
            arc = at + _TURN * limits.size * np.column_stack([np.cos(turn), np.sin(turn)])
            axes.plot(*arc[:-2].T, color=look.trail, linewidth=1.4, zorder=3.7)
            _arrow(axes, arc[-4], arc[-1], look.trail, 10.0, 1.4)
            lines.append(arc)
    return lines


def _shown_value(load: Load) -> Array:
    """Components of a load at the start; where it begins later, when it is largest within the first second."""
    ends = [law.times[-1] for law in load.laws if isinstance(law, TabulatedLaw)]
    values = load.evaluate(np.linspace(0.0, min([1.0, *ends]), 101))
    return values[0] if values[0].any() else values[np.argmax(np.linalg.norm(values, axis=1))]


def _draw_gravity(axes: Axes, mechanism: Mechanism, limits: Limits, look: Theme) -> list[Array]:
    """An arrow in the upper right corner, with its size."""
    weight = np.array(mechanism.gravity, dtype=float)
    size = float(np.linalg.norm(weight))
    if not size:
        return []
    room = 0.75 * _ARROW * limits.size
    corner = np.array([limits.right - 0.09 * (limits.right - limits.left), limits.top - 0.7 * room])
    ends = np.array([corner - 0.5 * room * weight / size, corner + 0.5 * room * weight / size])
    _arrow(axes, ends[0], ends[1], look.earth, 11.0, 1.4)
    axes.annotate(
        f"g = {three_digits(size)} m/s²", (corner[0], corner[1]), xytext=(-6.0, 0.0), textcoords="offset points",
        ha="right", va="center", fontsize=_TEXT - 0.5, color=look.earth,
    )  # fmt: skip
    return [ends, np.array([corner - [0.22 * (limits.right - limits.left), 0.0], corner])]


def _draw_gaps(axes: Axes, posed: Posed) -> None:
    """Both points of a joint that is open, or one and the axis it should be on, and the gap between them."""
    directions = posed.data["joint_direction"].values[0]
    for joint, direction in zip(posed.mechanism.joints, directions, strict=True):
        if joint.name in posed.gaps:
            ends = np.array([_point(posed, joint.a), _point(posed, joint.b)])
            if joint.slides:
                along = np.array([np.cos(direction), np.sin(direction)])
                ends[0] += along * np.dot(ends[1] - ends[0], along)
            axes.plot(*ends.T, **_GAP, zorder=4.5)


def _body_names(shown: Scene, look: Theme) -> list[Name]:
    if len(shown.bodies) > _MOST_BODIES:
        return []
    names = []
    for number, (body, places) in enumerate(shown.bodies.items()):
        line = figure_of(places)[0]
        line = line[np.isfinite(line).all(axis=1)]
        if len(line):
            along = [_along(line, share) for share in (0.5, 0.35, 0.65, 0.22, 0.78)] if len(line) > 1 else line
            names.append(Name(body, np.array(along), look.link(number), bold=True))
    return names


def _along(line: Array, share: float) -> Array:
    """The place at a share of a line's length."""
    travelled = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    return np.array([np.interp(share * travelled[-1], travelled, line[:, k]) for k in range(2)])


def _joint_names(posed: Posed, shown: Scene, look: Theme) -> list[Name]:
    """Names of joints with what acts at them; those with motors where there are too many."""
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
    """The end-effector, the path, springs, gears, loads, and points that no joint names."""
    mechanism, names = posed.mechanism, []
    if mechanism.end_effector is not None and shown.trail is not None:
        ref = mechanism.end_effector.point
        names.append(Name(f"end-effector {ref}", shown.trail[:1], look.trail, bold=True))
    if posed.desired is not None:
        corners = np.array([_along(posed.desired, share) for share in (0.3, 0.6, 0.85, 0.05)])
        names.append(Name(f"path {posed.path}", corners, look.desired))
    names += [Name(f"spring {name}", ends[0].mean(axis=0)[None], look.earth) for name, ends in shown.springs.items()]
    for gear in shown.gears:
        line = gear.lines[0][0]
        names.append(Name(f"gear {gear.name}", np.array([_along(line, s) for s in (0.5, 0.25, 0.75)]), look.earth))
    for load in mechanism.loads:
        at = _point(posed, load.point)
        value = _shown_value(load)
        if isinstance(load, PointForce) and value.any():
            at = at - 0.8 * _ARROW * limits.size * value / np.linalg.norm(value)
        names.append(Name(f"load {load.name}", at[None], look.trail))
    held = [joint.place[0] for joint in shown.joints]
    for name, place in mechanism.ground.items():
        if all(np.linalg.norm(np.subtract(place, at)) > 1e-6 * limits.size for at in held):
            names.append(Name(f"{GROUND}.{name}", np.array([place], dtype=float), look.earth))
    return [name for name in names if np.isfinite(name.places).all()]


def _point(posed: Posed, ref: PointRef) -> Array:
    """Place of a point at the start."""
    if ref.on_ground:
        return np.array(posed.mechanism.ground[ref.point], dtype=float)
    data = posed.data
    station = int(data["point_station"].values[list(data["point"].values).index(str(ref))])
    return data["shape"].values[0, station].astype(float)


def _arrow(axes: Axes, tail: Any, head: Any, colour: str, scale: float, width: float = 1.0) -> None:
    arrow = FancyArrowPatch(tuple(tail), tuple(head), arrowstyle="-|>", mutation_scale=scale, shrinkA=0.0, shrinkB=0.0)
    arrow.set(color=colour, linewidth=width, zorder=3.7)
    axes.add_patch(arrow)


def _legend(figure: Figure, posed: Posed, shown: Scene, look: Theme) -> None:
    """The symbols that occur."""
    kinds = {joint.kind for joint in shown.joints}
    plain: dict[str, Any] = {"linestyle": "none", "markeredgecolor": look.ink, "color": look.ink}
    entries = [
        Line2D([], [], **plain, label=text, marker=marker, markersize=size, markerfacecolor=getattr(look, fill))
        for kind, (text, marker, size, fill) in _KINDS.items()
        if kind in kinds
    ]
    if posed.mechanism.motors:
        motor: dict[str, Any] = {
            "marker": "o",
            "markerfacecolor": look.ground,
            "markersize": 6.5,
            "markeredgewidth": 3.0,
        }
        entries.append(Line2D([], [], **plain | motor, label="motor"))
    if posed.mechanism.end_effector is not None:
        tip: dict[str, Any] = {"marker": "o", "color": look.trail, "markeredgecolor": look.trail, "markersize": 4.2}
        entries.append(Line2D([], [], **plain | tip, label="end-effector"))
    if posed.payload is not None and posed.mechanism.payload is not None:
        label = f"payload {posed.mechanism.payload.mass:.4g} kg"
        entries.append(Line2D([], [], **_PAYLOAD | {"markersize": 6.5}, **_payload_colours(look), label=label))
    if posed.path:
        entries.append(Line2D([], [], color=look.desired, linewidth=1.0, linestyle=(0, (3, 2)), label="path"))
        entries.append(Line2D([], [], **_START, markeredgecolor=look.desired, label="its start"))
    if posed.gaps:
        entries.append(Line2D([], [], **_GAP, label="open"))
    if entries:
        figure.legend(
            handles=entries, loc="lower center", ncols=len(entries), fontsize=_TEXT, labelcolor=look.ink,
            handlelength=1.6, bbox_to_anchor=(0.5, 0.0),
        )  # fmt: skip


def _payload_colours(look: Theme) -> dict[str, Any]:
    return {"markerfacecolor": look.faint, "markeredgecolor": look.ink}


def _title(figure: Figure, posed: Posed, look: Theme) -> None:
    """Name, pose and, where the loops do not close, which joints are open."""
    height = figure.get_figheight() / _MM
    y = 1.0 - 4.0 / height
    figure.text(
        0.012, y, posed.mechanism.name, color=look.ink, fontsize=9.0, fontweight="bold", va="center", parse_math=False
    )
    said = f"assembly {posed.assembly}" if posed.assembly else "as started"
    if posed.gaps:
        said += ", as given: it does not close"
    elif posed.path and not posed.problems:
        said += f", at the start of path {posed.path}"
    left_out = _left_out(posed)
    figure.text(
        0.988, y, said + left_out, color=_OPEN if posed.gaps else look.ink, fontsize=_TEXT, va="center", ha="right",
        parse_math=False,
    )  # fmt: skip


def _left_out(posed: Posed) -> str:
    """Which names a large mechanism is drawn without."""
    what = [
        word
        for word, count, most in (
            ("bodies", len(posed.mechanism.bodies), _MOST_BODIES),
            ("joints", len(posed.mechanism.joints), _MOST_JOINTS),
        )
        if count > most
    ]
    return f"; names of {' and '.join(what)} left out" if what else ""
