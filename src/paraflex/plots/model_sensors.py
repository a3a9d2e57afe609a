"""Marks of sensors in a model drawing: their positions and the axes or angles that they measure."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from paraflex.arrays import Array
from paraflex.mechanism import GROUND, AssumedModesBeam, FlexibleBeam
from paraflex.mechanism.sensors import Location, Sensor
from paraflex.results.posed import Posed
from .marks import round_arrow, straight_arrow
from .scene import Limits
from .signs import Arrow

# Look of a sensor's mark.
SENSOR: dict[str, Any] = {"marker": "D", "markersize": 3.6, "markeredgewidth": 1.0, "linestyle": "none"}
# Length of the arrow of an axis and radius of that of an angle, as shares of the picture's larger side; start angle and
# sweep of the latter [rad], and relative size of the heads.
_AXIS, _RADIUS = 0.055, 0.02
_FROM, _BY, _HEAD = -0.7, 1.6, 0.45


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
        line, head = round_arrow(place[None], _RADIUS * limits.size, _FROM, np.array([_BY]), limits, _HEAD)
    else:
        line, head = straight_arrow(place[None], (place + _AXIS * limits.size * axis)[None], limits, _HEAD)
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
