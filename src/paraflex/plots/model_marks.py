"""Marks of a model drawing: sensors, loads with their magnitudes, and the first movements of driven joints."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from paraflex.arrays import Array
from paraflex.mechanism import GROUND, AssumedModesBeam, FlexibleBeam
from paraflex.mechanism.sensors import Location, Sensor
from paraflex.results.acting import ActingLoad
from paraflex.results.posed import Posed
from .marks import round_arrow, straight_arrow
from .scene import ARROW, BLOCK, TURN, DrawnJoint, Limits, Scene
from .signs import Arrow

# Length of the shortest arrow of a load relative to that of the largest.
_SHORTEST = 0.35
# Start angle and sweep of the arrow of a torque, then of a first rotation, anticlockwise [rad].
_TURN_FROM, _TURN_BY = -0.4, 1.5 * np.pi
_MOVE_FROM, _MOVE_BY = -0.15, np.pi + 0.3
# Radius of the arrow of a first rotation, increment of the radius for the next arrow at the same place, and half length
# of the arrow of a first translation, as shares of the picture's larger side.
_MOVE, _NEXT, _TRAVEL = 0.028, 0.012, 0.028
_HEAD = 0.6


@dataclass(frozen=True)
class LoadArrow:
    """Arrow of a load.

    Attributes
    ----------
    arrow : Arrow
        Line and head of the arrow.
    name, size : str
        Name of the load, and its magnitude with unit.
    later : bool
        Whether the load does not act at the start.
    named : (k, 2) array
        Positions beside which the name may stand [m].
    """

    arrow: Arrow
    name: str
    size: str
    later: bool
    named: Array


@dataclass(frozen=True)
class Acting:
    """Arrows of loads, and of the first movements of motors and prescribed motions."""

    loads: tuple[LoadArrow, ...]
    moves: tuple[Arrow, ...]


def acting_arrows(posed: Posed, shown: Scene, limits: Limits) -> Acting:
    """Return the arrows of a mechanism at its start pose."""
    acting = posed.acting
    largest = {kind: max((one.largest for one in acting if one.load.kind == kind), default=0.0) for kind in
               ("force", "torque")}  # fmt: skip
    loads = [_load_arrow(posed, one, largest[one.load.kind], limits) for one in acting]
    return Acting(tuple(loads), tuple(_moves(posed, shown, limits)))


def load_places(posed: Posed, size: float) -> Array:
    """Return the tails (n, 2) of the arrows of forces, all of the largest length, in a picture of a size [m]."""
    tails = [np.zeros((0, 2))]
    for one in posed.acting:
        load, shown = one.load, one.shown
        if load.kind == "force" and shown.any():
            tails.append((posed.place(load.point) - ARROW * size * shown / np.linalg.norm(shown))[None])
    return np.concatenate(tails)


def _load_arrow(posed: Posed, one: ActingLoad, largest: float, limits: Limits) -> LoadArrow:
    at, size = posed.place(one.load.point)[None], float(np.linalg.norm(one.shown))
    share = max(_SHORTEST, size / largest) if size else 0.0
    if one.load.kind == "force":
        tail = at - ARROW * limits.size * share * one.shown / (size or 1.0)
        line, head = straight_arrow(tail, at, limits)
        named = np.vstack([0.8 * tail + 0.2 * at, tail])
    else:
        sweep = np.sign(one.shown) * share * _TURN_BY
        line, head = round_arrow(at, TURN * limits.size, _TURN_FROM, sweep, limits)
        named = np.vstack([line[0, 0], line[0, 20], at[0]])
    arrow = Arrow(line[0], head[0], round=one.load.kind != "force")
    return LoadArrow(arrow, one.load.name, one.size, one.later, named)


def _moves(posed: Posed, shown: Scene, limits: Limits) -> list[Arrow]:
    """Return the arrows of joints that begin to move; arrows at the same place are nested."""
    arrows: list[Arrow] = []
    placed: list[Array] = []
    for joint in shown.joints:
        sign = posed.moves.get(joint.name, 0)
        if not sign or joint.name in posed.gaps:
            continue
        # If the second body of the joint is the ground, the visible motion is that of the first.
        sign = -sign if posed.mechanism.joint(joint.name).b.on_ground else sign
        before = sum(bool(np.allclose(joint.place[0], place, atol=1e-6 * limits.size)) for place in placed)
        placed.append(joint.place[0])
        arrows.append(_slide(joint, sign, before, limits) if joint.slides else _turn(joint, sign, before, limits))
    return arrows


def _turn(joint: DrawnJoint, sign: int, before: int, limits: Limits) -> Arrow:
    start = _MOVE_FROM if sign > 0 else _MOVE_FROM + _MOVE_BY
    radius = (_MOVE + before * _NEXT) * limits.size
    line, head = round_arrow(joint.place[:1], radius, start, np.array([sign * _MOVE_BY]), limits, _HEAD)
    return Arrow(line[0], head[0], round=True)


def _slide(joint: DrawnJoint, sign: int, before: int, limits: Limits) -> Arrow:
    along = np.array([[np.cos(joint.direction[0]), np.sin(joint.direction[0])]])
    across = along[:, ::-1] * [-1.0, 1.0]
    # The arrow is on the side away from the ground.
    across = across if across[0, 1] > 0.0 or (across[0, 1] == 0.0 and across[0, 0] < 0.0) else -across
    middle = joint.place[:1] + (0.5 * BLOCK[1] + (before + 1) * _NEXT) * limits.size * across
    half = sign * _TRAVEL * limits.size * along
    line, head = straight_arrow(middle - half, middle + half, limits, _HEAD)
    return Arrow(line[0], head[0])


# Look of a sensor's mark.
SENSOR: dict[str, Any] = {"marker": "D", "markersize": 3.6, "markeredgewidth": 1.0, "linestyle": "none"}
# Length of the arrow of an axis and radius of that of an angle, as shares of the picture's larger side; start angle and
# sweep of the latter [rad], and relative size of the heads.
_AXIS, _RADIUS = 0.055, 0.02
_FROM, _BY, _SENSOR_HEAD = -0.7, 1.6, 0.45


@dataclass(frozen=True)
class SensorMark:
    """Mark of a sensor: kind in words, name, position (2,), and the arrow of the axis or angle that it measures."""

    kind: str
    name: str
    place: Array
    arrow: Arrow


def sensor_marks(posed: Posed, limits: Limits) -> list[SensorMark]:
    """Return the marks of all sensors whose positions are known."""
    marks = [_mark(posed, sensor, limits) for sensor in posed.mechanism.sensors]
    return [mark for mark in marks if np.isfinite(mark.place).all()]


def _mark(posed: Posed, sensor: Sensor, limits: Limits) -> SensorMark:
    place, axis = _place_and_axis(posed, sensor.location)
    if axis is None:
        line, head = round_arrow(place[None], _RADIUS * limits.size, _FROM, np.array([_BY]), limits, _SENSOR_HEAD)
    else:
        line, head = straight_arrow(place[None], (place + _AXIS * limits.size * axis)[None], limits, _SENSOR_HEAD)
    arrow = Arrow(line[0], head[0], round=axis is None)
    return SensorMark(sensor.kind.replace("_", " "), sensor.name, place, arrow)


def _place_and_axis(posed: Posed, location: Location) -> tuple[Array, Array | None]:
    """Return the position (2,) of a sensor and the unit vector along which it measures.

    The position is NaN if it is unknown; the vector is None if an angle or a moment is measured.
    """
    along = None
    if location.at is not None:
        place, along = _along_beam(posed, location)
    elif location.point is not None:
        place = posed.place(location.point)
    else:
        joint = [one.name for one in posed.mechanism.joints].index(location.joint)
        place = posed.data["joint_position"].values[0, joint].astype(float)
        direction = float(posed.data["joint_direction"].values[0, joint])
        along = _turned((1.0, 0.0), direction) if np.isfinite(direction) else None
    if location.axis is None:
        return place, None
    if location.axis == "own":
        return place, along
    return place, _turned(location.axis, 0.0 if location.frame == GROUND else posed.angles[location.frame])


def _along_beam(posed: Posed, location: Location) -> tuple[Array, Array]:
    """Return the position of a section of a beam and the direction of the beam there."""
    data = posed.data
    own = data["station_body"].values == location.frame
    along, places = data["station_place"].values[own, 0], data["shape"].values[0, own].astype(float)
    order = np.argsort(along, kind="stable")
    along, places = along[order], places[order]
    described = posed.mechanism.body(location.frame)
    assert isinstance(described, FlexibleBeam | AssumedModesBeam)
    at = location.along(described.points)
    place = np.array([np.interp(at, along, places[:, k]) for k in range(2)])
    after = int(np.clip(np.searchsorted(along, at, side="right"), 1, len(along) - 1))
    step = places[after] - places[after - 1]
    return place, step / (np.linalg.norm(step) or 1.0)


def _turned(axis: tuple[float, float], angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([c * axis[0] - s * axis[1], s * axis[0] + c * axis[1]])
