"""One pose of a mechanism as the page draws it: links, symbols and names in metres."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from paraflex.arrays import Array, Numbers
from paraflex.errors import ParaflexError
from paraflex.mechanism import GROUND, Body, LumpedMass, Mechanism, PointRef
from paraflex.mechanism.poses import Pose, local_points
from paraflex.plots.marks import LOOKS, moving_marks, still_marks, support
from paraflex.plots.model_drawing import posed_scene
from paraflex.plots.model_marks import acting_arrows, sensor_marks
from paraflex.plots.scene import Limits, Scene, is_plate
from paraflex.results.posed import Posed
from .sheet import Sheet

# Digits behind the point of a position on the page [m].
_DIGITS = 7
# Margin around the points of a sheet without bodies [m].
_AROUND = 0.15


def picture(shown: Posed, view: Limits | None = None) -> dict[str, Any]:
    """Return a pose for the page.

    Parameters
    ----------
    shown : Posed
        Pose of the mechanism.
    view : Limits, optional
        Part of the plane that the page shows, by which symbols are sized; by default that of the mechanism.
    """
    scene = posed_scene(shown)
    limits = view or scene.limits
    mechanism = shown.mechanism
    effector = mechanism.end_effector
    return {
        "limits": [scene.limits.left, scene.limits.bottom, scene.limits.right, scene.limits.top],
        "bodies": [[name, *_body(places[0])] for name, places in scene.bodies.items()],
        "marks": _marks(shown, scene, limits),
        "points": [[str(ref), *_pair(shown.place(ref))] for ref in all_points(mechanism)],
        "joints": _joints(mechanism, scene),
        "effector": None if effector is None else str(effector.point),
        "lumps": [[f"{body.name}.{lump.point}", lump.mass] for body in mechanism.bodies for lump in _lumps(body)],
        "path": [] if shown.desired is None else _line(shown.desired),
        "open": dict(shown.gaps),
        "problems": list(shown.problems),
        "angles": {name: round(angle, 9) for name, angle in shown.angles.items()},
        "frames": {body.name: _frame(shown, body) for body in mechanism.bodies},
    }


def ground_picture(text: str, view: Limits | None = None) -> dict[str, Any] | None:
    """Return the points of the ground of a file without bodies; None if it has none."""
    try:
        sheet = Sheet(text)
        ground = {name: sheet.place(f"{GROUND}.{name}", "") for name in sheet.names("ground")}
    except ParaflexError:
        return None
    if not ground:
        return None
    xs, ys = zip(*ground.values(), strict=True)
    limits = Limits(min(xs) - _AROUND, max(xs) + _AROUND, min(ys) - _AROUND, max(ys) + _AROUND)
    marks = []
    for place in ground.values():
        lines, strokes = support(np.array(place), view or limits)
        marks += [["still", "ground", "", _line(line)] for line in lines]
        marks += [["still", "hatching", "", _line(line)] for line in strokes]
    return {
        "limits": [limits.left, limits.bottom, limits.right, limits.top], "bodies": [], "marks": marks,
        "points": [[f"{GROUND}.{name}", *_pair(np.array(place))] for name, place in ground.items()], "joints": [],
        "effector": None, "lumps": [], "path": [], "open": {}, "problems": [], "angles": {}, "frames": {},
    }  # fmt: skip


def all_points(mechanism: Mechanism) -> Iterable[PointRef]:
    """Yield the points of the ground and of all bodies."""
    yield from (PointRef(GROUND, name) for name in mechanism.ground)
    yield from (PointRef(body.name, name) for body in mechanism.bodies for name in body.points)


def looks() -> dict[str, list[Any]]:
    """Return the looks of symbols: names of colours of fill and line, width of the line, whether it is dashed."""
    return {name: list(look) for name, look in LOOKS.items()}


def _joints(mechanism: Mechanism, scene: Scene) -> list[list[Any]]:
    motors = {motor.joint: motor.name for motor in mechanism.motors}
    drives = {drive.joint: drive.name for drive in mechanism.prescribed}
    kinds = {joint.name: joint.kind for joint in mechanism.joints}
    return [
        [joint.name, kinds[joint.name], *_pair(joint.place[0]), motors.get(joint.name, ""), drives.get(joint.name, "")]
        for joint in scene.joints
    ]


def _marks(shown: Posed, scene: Scene, limits: Limits) -> list[list[Any]]:
    """Return look, name and line of all symbols, back to front; links are drawn before the first that moves."""
    still = [["still", mark.look, mark.name, _line(mark.places[0])] for mark in still_marks(scene, limits)]
    moving = [["moving", mark.look, mark.name, _line(mark.places[0])] for mark in moving_marks(scene, limits)]
    acting = acting_arrows(shown, scene, limits)
    arrows = [(one.arrow, one.name) for one in acting.loads] + [(arrow, "") for arrow in acting.moves]
    for arrow, name in arrows:
        moving += [["moving", "load", name, _line(arrow.line)], ["moving", "head", "", _line(arrow.head)]]
    for mark in sensor_marks(shown, limits):
        moving += [["moving", "sensor", mark.name, _line(mark.place[None])]]
        moving += [["moving", "sensor", "", _line(mark.arrow.line)], ["moving", "sensor", "", _line(mark.arrow.head)]]
    return still + moving


def _frame(shown: Posed, body: Body) -> list[float]:
    """Return origin and angle of a body's frame."""
    point, (x, y) = next(iter(local_points(body).items()))
    angle, place = shown.angles.get(body.name, 0.0), shown.place(PointRef(body.name, point))
    turned = Pose(angle, (0.0, 0.0)).place_of((x, y))
    return [*_pair(place - np.array(turned)), round(angle, 9)]


def _lumps(body: Body) -> Sequence[LumpedMass]:
    return getattr(body, "lumps", ())


def _body(places: Array) -> tuple[list[Any], bool]:
    return _line(places), is_plate(places)


def _pair(place: Array) -> list[float]:
    return [round(float(place[0]), _DIGITS), round(float(place[1]), _DIGITS)]


def _line(places: Numbers) -> list[Any]:
    """Return the points of a line; gaps are null."""
    whole = np.asarray(np.isfinite(places).all(axis=-1))
    rounded = np.round(places, _DIGITS).tolist()
    return [point if known else None for point, known in zip(rounded, whole.tolist(), strict=True)]
