"""Marks of sensors in a model drawing: their positions and the axes or angles that they measure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paraflex.mechanism import GROUND, AssumedModesBeam, FlexibleBeam
from paraflex.mechanism.sensors import (
    DeflectionSensor,
    JointForceSensor,
    PointSensor,
    Sensor,
    StrainGauge,
    unit_vector,
)
from paraflex.plots.marks import round_arrow, straight_arrow
from paraflex.plots.scene import Limits
from paraflex.plots.signs import Arrow
from paraflex.results.posed import Posed

Array = NDArray[np.float64]

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
    place, axis = _place(posed, sensor), _axis(posed, sensor)
    if axis is None:
        line, head = round_arrow(place[None], _RADIUS * limits.size, _FROM, np.array([_BY]), limits, _HEAD)
    else:
        line, head = straight_arrow(place[None], (place + _AXIS * limits.size * axis)[None], limits, _HEAD)
    arrow = Arrow(line[0], head[0], round=axis is None)
    return SensorMark(sensor.kind.replace("_", " "), sensor.name, place, arrow)


def _place(posed: Posed, sensor: Sensor) -> Array:
    """Return the position (2,) of a sensor; NaN if it is unknown."""
    if isinstance(sensor, StrainGauge):
        return _along_beam(posed, sensor)[0]
    if isinstance(sensor, PointSensor | DeflectionSensor):
        return posed.place(sensor.point)
    joint = _joint(posed, sensor)
    return np.full(2, np.nan) if joint is None else posed.data["joint_position"].values[0, joint].astype(float)


def _axis(posed: Posed, sensor: Sensor) -> Array | None:
    """Return the unit vector along which a sensor measures; None if it measures an angle or a moment."""
    if isinstance(sensor, StrainGauge):
        return _along_beam(posed, sensor)[1]
    if isinstance(sensor, PointSensor):
        return _turned(sensor.direction, 0.0 if sensor.body == GROUND else posed.angles[sensor.body])
    if isinstance(sensor, DeflectionSensor):
        return None if sensor.axis == "angle" else _turned(unit_vector(sensor.axis), posed.angles[sensor.point.body])
    if isinstance(sensor, JointForceSensor) and sensor.axis not in ("along", "moment"):
        return _turned(unit_vector(sensor.axis), 0.0)
    if isinstance(sensor, JointForceSensor) and sensor.axis == "moment":
        return None
    joint = _joint(posed, sensor)
    direction = np.nan if joint is None else float(posed.data["joint_direction"].values[0, joint])
    return _turned((1.0, 0.0), direction) if np.isfinite(direction) else None


def _joint(posed: Posed, sensor: Sensor) -> int | None:
    """Return the index of a sensor's joint; None for a user-defined kind of sensor without a joint."""
    names, name = [joint.name for joint in posed.mechanism.joints], getattr(sensor, "joint", None)
    return names.index(name) if name in names else None


def _along_beam(posed: Posed, gauge: StrainGauge) -> tuple[Array, Array]:
    """Return the position of a `StrainGauge` and the direction of its beam there."""
    data = posed.data
    own = data["station_body"].values == gauge.body
    along, places = data["station_place"].values[own, 0], data["shape"].values[0, own].astype(float)
    order = np.argsort(along, kind="stable")
    along, places = along[order], places[order]
    described = posed.mechanism.body(gauge.body)
    assert isinstance(described, FlexibleBeam | AssumedModesBeam)
    at = gauge.place(described.points)
    place = np.array([np.interp(at, along, places[:, k]) for k in range(2)])
    after = int(np.clip(np.searchsorted(along, at, side="right"), 1, len(along) - 1))
    step = places[after] - places[after - 1]
    return place, step / (np.linalg.norm(step) or 1.0)


def _turned(axis: tuple[float, float], angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([c * axis[0] - s * axis[1], s * axis[0] + c * axis[1]])
