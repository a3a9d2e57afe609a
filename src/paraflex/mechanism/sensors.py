"""Sensors: named quantities that a run measures and a linear model has as outputs."""

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
    """Check of an axis: one of some words, or an angle [rad] if it may be one."""
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
    """A quantity of a mechanism in motion, measured without error or delay: the base of all kinds.

    A subclass is a kind, `class Encoder(Sensor, kind="encoder", units=("rad", "m"))`; files, results and linear models
    know it by that.

    Attributes
    ----------
    name : str
    kind : str
        The name in files.
    units : tuple of str
        SI unit of its readings; of a sensor at a joint that of an angle, then that of a travel.
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
        """The SI unit of its readings; `slides` says whether its joint has a travel."""
        return self.units[-1 if slides else 0]


@dataclass(frozen=True)
class Encoder(Sensor, kind="encoder", units=("rad", "m")):
    """Angle [rad] or travel [m] of a joint: of its second body against its first, slopes of beams included."""

    joint: str = field(metadata=AT_JOINT)


@dataclass(frozen=True)
class Tachometer(Sensor, kind="tachometer", units=("rad/s", "m/s")):
    """Rate of a joint's angle [rad/s] or travel [m/s], slopes of beams included."""

    joint: str = field(metadata=AT_JOINT)


@dataclass(frozen=True)
class PointSensor(Sensor):
    """A component of the motion of a named point: what position, velocity and acceleration sensors have in common.

    Attributes
    ----------
    point : PointRef
    axis : "x", "y" or float
        Along which it measures, an angle against the x axis [rad].
    body : str
        In whose frame the axis is fixed and turns; the ground's by default. A beam's frame is that of its reference
        condition and does not follow the slope at the point. What is measured is the component of the absolute
        velocity or acceleration; of a position that against the origin of the frame.
    """

    point: PointRef = field(metadata=said('"body.point"'))
    axis: Literal["x", "y"] | float = field(
        metadata=said('"x", "y" or the angle of its axis against the x axis in rad', _axis("x", "y"))
    )
    body: str = optional(GROUND, "the body in whose frame the axis is fixed, by default the ground")

    @property
    def direction(self) -> tuple[float, float]:
        """Unit vector of its axis in the frame."""
        return unit_vector(self.axis)


@dataclass(frozen=True)
class PositionSensor(PointSensor, kind="position", units=("m",)):
    """Place of a point along an axis, from the origin of the frame that the axis is fixed in [m]."""


@dataclass(frozen=True)
class VelocitySensor(PointSensor, kind="velocity", units=("m/s",)):
    """Component of a point's absolute velocity along an axis [m/s]."""


@dataclass(frozen=True)
class AccelerationSensor(PointSensor, kind="acceleration", units=("m/s^2",)):
    """Component of a point's absolute acceleration along an axis [m/s^2].

    An accelerometer fixed to a link has that link as its `body`. It also senses weight, which is not in this reading:
    it shows the acceleration less that of free fall.
    """


@dataclass(frozen=True)
class StrainGauge(Sensor, kind="strain", units=("1",)):
    """Axial strain of a beam, positive in tension: N / E A - distance M / E I, with M = E I w''.

    Attributes
    ----------
    body : str
        A beam, or a bar of assumed modes. Held rigid it has no strain.
    at : float or str
        Distance from the beam's first end [m], or one of its named points. Where the moment or the section jumps, what
        is measured is on the side of the last end.
    distance : float, optional
        From the neutral axis, positive on the side of the y axis [m]; by default that of the outermost fibre.
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
        """Distance from the first end [m] of a beam with these points."""
        return points[self.at] if isinstance(self.at, str) else self.at


@dataclass(frozen=True)
class JointForceSensor(Sensor, kind="joint_force"):
    """Component of what a joint's first body does to its second: a force [N], or the moment [N m].

    It acts at the joint's point of the second body and is of all that is in the joint: constraints, motors, springs,
    dampers, friction, gears.

    Attributes
    ----------
    joint : str
    axis : "x", "y", "along", "moment" or float
        In the ground frame, an angle against its x axis [rad]; "along" the axis of a joint that slides, or of
        the rod of a distance joint, its tension; the "moment" about the point, positive anticlockwise.
    """

    joint: str = field(metadata=said("the name of a joint", joint="exists"))
    axis: Literal["x", "y", "along", "moment"] | float = field(
        metadata=said(
            '"x", "y", "along", "moment" or the angle of its axis in the ground frame in rad',
            _axis("x", "y", "along", "moment"),
        )
    )

    def unit(self, slides: bool) -> str:
        """See `Sensor.unit`."""
        return "N m" if self.axis == "moment" else "N"


@dataclass(frozen=True)
class DeflectionSensor(Sensor, kind="deflection"):
    """Displacement of a material point in the frame of its body, from its place in the undeformed one.

    Attributes
    ----------
    point : PointRef
    axis : "x", "y" or "angle"
        Of the body's frame [m], or the turn of the material there, a beam's slope [rad].
    """

    point: PointRef = field(metadata=said('"body.point"'))
    axis: Literal["x", "y", "angle"] = field(
        metadata=said('"x", "y" or "angle"', _axis("x", "y", "angle", angle=False))
    )

    def unit(self, slides: bool) -> str:
        """See `Sensor.unit`."""
        return "rad" if self.axis == "angle" else "m"


def unit_vector(axis: str | float) -> tuple[float, float]:
    """The direction of an axis given as "x", "y" or an angle [rad]."""
    if isinstance(axis, str):
        return (1.0, 0.0) if axis == "x" else (0.0, 1.0)
    return math.cos(axis), math.sin(axis)
