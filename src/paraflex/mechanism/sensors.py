"""Sensors: named quantities that are measured in a run and are outputs of a linear model."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

from paraflex.arguments import CheckedFields, given_as
from paraflex.errors import InputError
from paraflex.limits import of_size
from paraflex.mechanism.joints import GROUND, PointRef
from paraflex.mechanism.quantities import AT_JOINT, finite, optional, said

# Kinds of sensors by their names in files.
SENSOR_KINDS: dict[str, type[Sensor]] = {}


def _axis(*words: str, angle: bool = True) -> Callable[[Any, str], None]:
    """Return a check that an axis is one of the words, or an angle [rad] if angles are admissible."""
    quoted = ", ".join(f'"{word}"' for word in words)
    remedy = f"give {quoted} or an angle in rad" if angle else f"give one of {quoted}"

    def check(value: Any, field: str) -> None:
        if isinstance(value, str) and value in words:
            return
        if not (angle and hasattr(value, "__float__")) or getattr(value, "ndim", 0):
            raise InputError("not an axis", field=field, value=value, remedy=remedy)
        of_size(value, field)  # pyright: ignore[reportArgumentType]

    return check


@given_as("a sensor", "a sensor of any kind, say Encoder")
@dataclass(frozen=True)
class Sensor(CheckedFields):
    """Ideal sensor without error or delay: the base class of all kinds.

    A subclass such as `class Encoder(Sensor, kind="encoder", units=("rad", "m"))` defines a kind of sensor for files,
    results and linear models.

    Attributes
    ----------
    name : str
        Name of the sensor.
    kind : str
        Name of the kind in files.
    units : tuple of str
        SI unit of the readings; for a sensor at a joint that at a joint which turns, then that at one which slides.
    """

    _table = "sensor"

    name: str
    kind: ClassVar[str]
    units: ClassVar[tuple[str, ...]]

    def __init_subclass__(cls, *, kind: str = "", units: tuple[str, ...] = ()) -> None:
        super().__init_subclass__()
        if kind:
            cls.kind, cls.units = kind, units
            SENSOR_KINDS[kind] = cls

    def unit(self, slides: bool) -> str:
        """Return the SI unit of the readings; `slides` is whether the coordinate of the joint is a travel."""
        return self.units[-1 if slides else 0]


@dataclass(frozen=True)
class Encoder(Sensor, kind="encoder", units=("rad", "m")):
    """Angle [rad] or travel [m] of a joint: second body relative to the first, slopes of beams included."""

    joint: str = field(metadata=AT_JOINT)


@dataclass(frozen=True)
class Tachometer(Sensor, kind="tachometer", units=("rad/s", "m/s")):
    """Rate of a joint's angle [rad/s] or travel [m/s], slopes of beams included."""

    joint: str = field(metadata=AT_JOINT)


@dataclass(frozen=True)
class PointSensor(Sensor):
    """Component of the motion of a named point: the base class of position, velocity and acceleration sensors.

    Attributes
    ----------
    point : PointRef
        Point whose motion is measured.
    axis : "x", "y" or float
        Axis of the measurement; a number is its angle to the x axis [rad].
    body : str
        Body in whose frame the axis is fixed, so that the axis turns with the body; the ground by default. The frame of
        a beam is that of its reference condition and does not follow the slope at the point. Velocities and
        accelerations are absolute; positions are relative to the origin of the frame.
    """

    point: PointRef = field(metadata=said('"body.point"'))
    axis: Literal["x", "y"] | float = field(
        metadata=said('"x", "y" or the angle of its axis against the x axis in rad', _axis("x", "y"))
    )
    body: str = optional(GROUND, "the body in whose frame the axis is fixed, by default the ground")

    @property
    def direction(self) -> tuple[float, float]:
        """Unit vector of the axis in the frame."""
        return unit_vector(self.axis)


@dataclass(frozen=True)
class PositionSensor(PointSensor, kind="position", units=("m",)):
    """Position of a point along an axis, from the origin of the frame in which the axis is fixed [m]."""


@dataclass(frozen=True)
class VelocitySensor(PointSensor, kind="velocity", units=("m/s",)):
    """Component of a point's absolute velocity along an axis [m/s]."""


@dataclass(frozen=True)
class AccelerationSensor(PointSensor, kind="acceleration", units=("m/s^2",)):
    """Component of a point's absolute acceleration along an axis [m/s^2].

    An accelerometer fixed to a link has that link as its `body`. A real one measures the acceleration minus that of
    gravity; this reading does not include gravity.
    """


@dataclass(frozen=True)
class StrainGauge(Sensor, kind="strain", units=("1",)):
    """Axial strain of a beam, positive in tension: N / E A - distance M / E I, with M = E I w''.

    Attributes
    ----------
    body : str
        Name of a beam or a bar of assumed modes. The strain of a rigid one is zero.
    at : float or str
        Distance from the first end of the beam [m], or one of its named points. Where the moment or the section jumps,
        the strain on the side of the last end is measured.
    distance : float, optional
        Distance from the neutral axis, positive on the side of the y axis [m]; by default that of the outermost fibre.
    """

    body: str = field(metadata=said("the name of a beam"))
    at: float | str = field(metadata=said("a named point of the beam, or the distance from its first end in m"))
    distance: float | None = optional(
        None,
        "the distance from the neutral axis in m, positive on the side of the y axis, by default that of the "
        "outermost fibre",
        finite,
    )

    def place(self, points: Mapping[str, float]) -> float:
        """Return the distance from the first end [m] of a beam with the given points."""
        return points[self.at] if isinstance(self.at, str) else self.at


@dataclass(frozen=True)
class JointForceSensor(Sensor, kind="joint_force"):
    """Component of the force [N], or the moment [N m], that the first body of a joint exerts on the second.

    It acts at the joint's point of the second body and includes everything in the joint: constraints, motors, springs,
    dampers, friction and gears.

    Attributes
    ----------
    joint : str
        Name of the joint.
    axis : "x", "y", "along", "moment" or float
        Direction in the ground frame, a number being its angle to the x axis [rad]; "along" the axis of a joint that
        slides or the rod of a distance joint (tension); or the "moment" about the point, positive anticlockwise.
    """

    joint: str = field(metadata=said("the name of a joint", joint="exists"))
    axis: Literal["x", "y", "along", "moment"] | float = field(
        metadata=said(
            '"x", "y", "along", "moment" or the angle of its axis in the ground frame in rad',
            _axis("x", "y", "along", "moment"),
        )
    )

    def unit(self, slides: bool) -> str:
        """Return the SI unit of the readings, see `Sensor.unit`."""
        return "N m" if self.axis == "moment" else "N"


@dataclass(frozen=True)
class DeflectionSensor(Sensor, kind="deflection"):
    """Displacement of a material point in the frame of its body, relative to the undeformed body.

    Attributes
    ----------
    point : PointRef
        Point whose displacement is measured.
    axis : "x", "y" or "angle"
        Axis of the body's frame [m], or the rotation of the material, which is a beam's slope [rad].
    """

    point: PointRef = field(metadata=said('"body.point"'))
    axis: Literal["x", "y", "angle"] = field(
        metadata=said('"x", "y" or "angle"', _axis("x", "y", "angle", angle=False))
    )

    def unit(self, slides: bool) -> str:
        """Return the SI unit of the readings, see `Sensor.unit`."""
        return "rad" if self.axis == "angle" else "m"


def unit_vector(axis: str | float) -> tuple[float, float]:
    """Return the unit vector of an axis given as "x", "y" or an angle [rad]."""
    if isinstance(axis, str):
        return (1.0, 0.0) if axis == "x" else (0.0, 1.0)
    return math.cos(axis), math.sin(axis)
