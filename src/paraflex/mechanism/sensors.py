"""Sensors: named quantities that are measured in a run and are outputs of a linear model."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, Literal, Protocol

import numpy as np

from paraflex.arguments import CheckedFields, named_in_errors
from paraflex.arrays import Numbers
from paraflex.errors import InputError
from paraflex.limits import of_size
from .bodies import AssumedModesBeam, Body, FlexibleBeam
from .joints import GROUND, Joint, PointRef
from .quantities import AT_JOINT, enter_kind, field_metadata, finite, known, optional

# Kinds of sensors by their names in files.
SENSOR_KINDS: "dict[str, type[Sensor]]" = {}


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


class SensorInputs(Protocol):
    """Quantities of a mechanism in motion at k instants, from which sensors read.

    Vectors are in the ground frame. All may be complex, for derivatives by complex steps: use no absolute values, norms
    or comparisons of them.
    """

    def coordinate(self, joint: str) -> Numbers:
        """Angle [rad] or travel [m] of a joint (k,)."""
        ...

    def rate(self, joint: str) -> Numbers:
        """Rate of a joint's angle [rad/s] or travel [m/s] (k,)."""
        ...

    def position(self, point: PointRef) -> Numbers:
        """Position of a material point (k, 2) [m]."""
        ...

    def velocity(self, point: PointRef) -> Numbers:
        """Velocity of a material point (k, 2) [m/s]."""
        ...

    def acceleration(self, point: PointRef) -> Numbers:
        """Acceleration of a material point (k, 2) [m/s^2]."""
        ...

    def displacement(self, point: PointRef) -> Numbers:
        """Elastic displacement along x and y [m] and rotation [rad] (k, 3) of a point in the frame of its body."""
        ...

    def origin(self, body: str) -> Numbers:
        """Position of the origin of a body's frame (k, 2) [m]."""
        ...

    def angle(self, body: str) -> Numbers:
        """Angle of a body's frame (k,) [rad]."""
        ...

    def strain(self, beam: str, at: float | str, distance: float | None) -> Numbers:
        """Axial strain of a beam (k,) at a point or distance from its first end, and one from the neutral axis [m].

        By default in the outermost fibre.
        """
        ...

    def force(self, joint: str) -> Numbers:
        """Force of a joint's first body on its second (k, 2) [N]."""
        ...

    def moment(self, joint: str) -> Numbers:
        """Moment of a joint's first body on its second (k,) [N m]."""
        ...

    def axis(self, joint: str) -> Numbers:
        """Unit vector (k, 2) of the axis of a sliding joint, or along the rod of a distance joint, tension positive."""
        ...


class SensedMembers(Protocol):
    """Members of a mechanism by which a sensor is checked."""

    @property
    def bodies(self) -> tuple[Body, ...]:
        """All bodies."""
        ...

    @cached_property
    def points(self) -> Mapping[str, Mapping[str, object]]:
        """Named points by body, the ground among them."""
        ...

    def body(self, name: str) -> Body:
        """Return the body of a name."""
        ...

    def joint(self, name: str) -> Joint:
        """Return the joint of a name."""
        ...


@dataclass(frozen=True)
class Location:
    """Place of a sensor, a joint, a named point or a section of a beam, and the direction that it measures along.

    Attributes
    ----------
    joint : str
        Joint that it is at; empty for another place.
    point : PointRef, optional
        Point that it is at.
    at : float or str, optional
        Section of the beam `frame` that it is in: distance from the first end [m], or a named point.
    axis : (float, float) or "own", optional
        Unit vector in the frame; "own" for the axis of its joint, or of its beam there. None for an angle or a moment.
    frame : str
        Body in whose frame it measures.
    """

    joint: str = ""
    point: PointRef | None = None
    at: float | str | None = None
    axis: tuple[float, float] | Literal["own"] | None = None
    frame: str = GROUND

    def along(self, points: Mapping[str, float]) -> float:
        """Distance from the first end of the beam with these points [m]."""
        assert self.at is not None
        return points[self.at] if isinstance(self.at, str) else self.at


@named_in_errors("a sensor", "a sensor of any kind, say Encoder")
@dataclass(frozen=True)
class Sensor(CheckedFields, ABC):
    """Ideal sensor without error or delay: the base class of all kinds.

    A subclass such as `class Encoder(Sensor, kind="encoder", units=("rad", "m"))` defines a kind of sensor: its methods
    `read` and `location`, and `check` and `unit` if the defaults do not apply, are all that files, runs, linear models,
    drawings and controllers use.

    Attributes
    ----------
    name : str
        Name of the sensor, unique in its mechanism.
    kind : str
        Name of the kind in files.
    units : tuple of str
        SI unit of readings; for a sensor at a joint that of an angle, then that of a travel.
    rigid : bool
        Whether the rigid motion alone gives the reading, such as an angle, so that a plan has it.
    """

    _table = "sensor"

    name: str
    kind: ClassVar[str]
    units: ClassVar[tuple[str, ...]]
    rigid: ClassVar[bool] = True

    def __init_subclass__(cls, *, kind: str = "", units: tuple[str, ...] = (), rigid: bool | None = None) -> None:
        super().__init_subclass__()
        cls.rigid = cls.rigid if rigid is None else rigid
        if isinstance(units, str):
            raise TypeError(f'{cls.__name__} has units={units!r}, a text: write units=("{units}",)')
        if kind:
            if not units and cls.unit is Sensor.unit:
                raise TypeError(f"{cls.__name__} has no unit: give the class units=, or a method `unit`")
            enter_kind(SENSOR_KINDS, kind, cls, "sensor")
            cls.kind, cls.units = kind, units

    @abstractmethod
    def read(self, moving: SensorInputs) -> Numbers:
        """Return the readings (k,) for a mechanism in motion."""

    @property
    @abstractmethod
    def location(self) -> Location:
        """Place of the sensor and the direction that it measures along."""

    @property
    def fixed_point(self) -> tuple[PointRef, tuple[float, float]] | None:
        """Point whose position along a fixed axis is the reading, and the axis; None for any other reading."""
        return None

    def check(self, mechanism: SensedMembers, field: str) -> None:
        """Check that the mechanism has what is measured; names of joints and points are checked before.

        Raises
        ------
        InputError
            The mechanism lacks it; the message begins with `field`.
        """

    def on_part(self, body: str, at: float) -> "Sensor":
        """Return the same sensor on a part of its beam, for a section in a beam of several frames.

        Parameters
        ----------
        body : str
            Part of the beam.
        at : float
            Distance of the section from the first end of the part [m].

        Raises
        ------
        InputError
            The kind of sensor cannot be moved.
        """
        raise InputError(
            "measures in a beam of several frames", field=f"sensor.{self.name}", value=self.location.frame,
            remedy="give the beam one frame, or the sensor's class a method `on_part`",
        )  # fmt: skip

    def unit(self, slides: bool) -> str:
        """Return the SI unit of readings.

        Parameters
        ----------
        slides : bool
            Whether the sensor's joint has a travel instead of an angle.
        """
        return self.units[-1 if slides else 0]


@dataclass(frozen=True)
class _JointSensor(Sensor):
    """Motion of a joint: the base class of encoders and tachometers."""

    joint: str = field(metadata=AT_JOINT)

    @property
    def location(self) -> Location:
        """See `Sensor.location`."""
        return Location(joint=self.joint, axis="own")


@dataclass(frozen=True)
class Encoder(_JointSensor, kind="encoder", units=("rad", "m")):
    """Angle [rad] or travel [m] of a joint: second body relative to the first, slopes of beams included."""

    def read(self, moving: SensorInputs) -> Numbers:
        """See `Sensor.read`."""
        return moving.coordinate(self.joint)


@dataclass(frozen=True)
class Tachometer(_JointSensor, kind="tachometer", units=("rad/s", "m/s")):
    """Rate of a joint's angle [rad/s] or travel [m/s], slopes of beams included."""

    def read(self, moving: SensorInputs) -> Numbers:
        """See `Sensor.read`."""
        return moving.rate(self.joint)


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

    point: PointRef = field(metadata=field_metadata('"body.point"'))
    axis: Literal["x", "y"] | float = field(
        metadata=field_metadata('"x", "y" or the angle of its axis against the x axis in rad', _axis("x", "y"))
    )
    body: str = optional(GROUND, "the body in whose frame the axis is fixed, by default the ground")

    @property
    def location(self) -> Location:
        """See `Sensor.location`."""
        return Location(point=self.point, axis=unit_vector(self.axis), frame=self.body)

    def check(self, mechanism: SensedMembers, field: str) -> None:
        """See `Sensor.check`."""
        known(self.body, mechanism.points, f"{field}.body", "body")

    def _component(self, vector: Numbers, moving: SensorInputs) -> Numbers:
        """Component of vectors (k, 2) along the axis."""
        ex, ey = unit_vector(self.axis)
        if self.body == GROUND:
            return ex * vector[:, 0] + ey * vector[:, 1]
        angle = moving.angle(self.body)
        c, s = np.cos(angle), np.sin(angle)
        return (c * ex - s * ey) * vector[:, 0] + (s * ex + c * ey) * vector[:, 1]


@dataclass(frozen=True)
class PositionSensor(PointSensor, kind="position", units=("m",)):
    """Position of a point along an axis, from the origin of the frame in which the axis is fixed [m]."""

    def read(self, moving: SensorInputs) -> Numbers:
        """See `Sensor.read`."""
        place = moving.position(self.point)
        return self._component(place if self.body == GROUND else place - moving.origin(self.body), moving)

    @property
    def fixed_point(self) -> tuple[PointRef, tuple[float, float]] | None:
        """See `Sensor.fixed_point`."""
        return (self.point, unit_vector(self.axis)) if self.body == GROUND else None


@dataclass(frozen=True)
class VelocitySensor(PointSensor, kind="velocity", units=("m/s",)):
    """Component of a point's absolute velocity along an axis [m/s]."""

    def read(self, moving: SensorInputs) -> Numbers:
        """See `Sensor.read`."""
        return self._component(moving.velocity(self.point), moving)


@dataclass(frozen=True)
class AccelerationSensor(PointSensor, kind="acceleration", units=("m/s^2",)):
    """Component of a point's absolute acceleration along an axis [m/s^2].

    An accelerometer fixed to a link has that link as its `body`. A real one measures the acceleration minus that of
    gravity; this reading does not include gravity.
    """

    def read(self, moving: SensorInputs) -> Numbers:
        """See `Sensor.read`."""
        return self._component(moving.acceleration(self.point), moving)


@dataclass(frozen=True)
class StrainGauge(Sensor, kind="strain", units=("1",), rigid=False):
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

    body: str = field(metadata=field_metadata("the name of a beam"))
    at: float | str = field(
        metadata=field_metadata("a named point of the beam, or the distance from its first end in m")
    )
    distance: float | None = optional(
        None,
        "the distance from the neutral axis in m, positive on the side of the y axis, by default that of the "
        "outermost fibre",
        finite,
    )

    def read(self, moving: SensorInputs) -> Numbers:
        """See `Sensor.read`."""
        return moving.strain(self.body, self.at, self.distance)

    @property
    def location(self) -> Location:
        """See `Sensor.location`."""
        return Location(at=self.at, axis="own", frame=self.body)

    def on_part(self, body: str, at: float) -> Sensor:
        """See `Sensor.on_part`."""
        return replace(self, body=body, at=at)

    def check(self, mechanism: SensedMembers, field: str) -> None:
        """See `Sensor.check`."""
        known(self.body, mechanism.points, f"{field}.body", "body")
        beams = {body.name: body for body in mechanism.bodies if isinstance(body, FlexibleBeam | AssumedModesBeam)}
        known(self.body, beams, f"{field}.body", "beam", "strain is measured on beams")
        beam = beams[self.body]
        if isinstance(self.at, str):
            known(self.at, beam.points, f"{field}.at", "point of the beam")
        else:
            finite(self.at, f"{field}.at")
            if not 0.0 <= self.at <= beam.length:
                raise InputError(
                    "the place lies beyond the beam's end", field=f"{field}.at", value=self.at,
                    remedy=f"choose it between 0 and the length {beam.length:g} m",
                )  # fmt: skip
        sections = beam.section if isinstance(beam.section, tuple) else (beam.section,)
        if self.distance is None and any(section.outer_fibre is None for section in sections):
            raise InputError(
                "the outermost fibre of the section is not known", field=f"{field}.distance",
                remedy="give the distance from the neutral axis in m, or the section's outer_fibre",
            )  # fmt: skip


@dataclass(frozen=True)
class JointForceSensor(Sensor, kind="joint_force", rigid=False):
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

    joint: str = field(metadata=field_metadata("the name of a joint", joint="exists"))
    axis: Literal["x", "y", "along", "moment"] | float = field(
        metadata=field_metadata(
            '"x", "y", "along", "moment" or the angle of its axis in the ground frame in rad',
            _axis("x", "y", "along", "moment"),
        )
    )

    def read(self, moving: SensorInputs) -> Numbers:
        """See `Sensor.read`."""
        if self.axis == "moment":
            return moving.moment(self.joint)
        force = moving.force(self.joint)
        if self.axis == "along":
            return np.sum(moving.axis(self.joint) * force, axis=1)
        ex, ey = unit_vector(self.axis)
        return ex * force[:, 0] + ey * force[:, 1]

    @property
    def location(self) -> Location:
        """See `Sensor.location`."""
        if self.axis == "along":
            return Location(joint=self.joint, axis="own")
        return Location(joint=self.joint, axis=None if self.axis == "moment" else unit_vector(self.axis))

    def check(self, mechanism: SensedMembers, field: str) -> None:
        """See `Sensor.check`."""
        joint = mechanism.joint(self.joint)
        if self.axis == "along" and not (joint.slides or "distance" in joint.holds):
            raise InputError(
                f"a {joint.kind} joint has no axis to measure along", field=f"{field}.axis", value=self.axis,
                remedy='give "x", "y", "moment" or an angle in rad',
            )  # fmt: skip

    def unit(self, slides: bool) -> str:
        """Return the SI unit of the readings, see `Sensor.unit`."""
        return "N m" if self.axis == "moment" else "N"


@dataclass(frozen=True)
class DeflectionSensor(Sensor, kind="deflection", rigid=False):
    """Displacement of a material point from its undeformed position, in the frame of its body.

    Attributes
    ----------
    point : PointRef
        Point whose displacement is measured.
    axis : "x", "y" or "angle"
        Axis of the body's frame [m], or the rotation of the material, which is a beam's slope [rad].
    """

    point: PointRef = field(metadata=field_metadata('"body.point"'))
    axis: Literal["x", "y", "angle"] = field(
        metadata=field_metadata('"x", "y" or "angle"', _axis("x", "y", "angle", angle=False))
    )

    def read(self, moving: SensorInputs) -> Numbers:
        """See `Sensor.read`."""
        return moving.displacement(self.point)[:, ("x", "y", "angle").index(self.axis)]

    @property
    def location(self) -> Location:
        """See `Sensor.location`."""
        axis = None if self.axis == "angle" else unit_vector(self.axis)
        return Location(point=self.point, axis=axis, frame=self.point.body)

    def unit(self, slides: bool) -> str:
        """Return the SI unit of the readings, see `Sensor.unit`."""
        return "rad" if self.axis == "angle" else "m"


def unit_vector(axis: str | float) -> tuple[float, float]:
    """Return the unit vector of an axis given as "x", "y" or an angle [rad]."""
    if isinstance(axis, str):
        return (1.0, 0.0) if axis == "x" else (0.0, 1.0)
    return math.cos(axis), math.sin(axis)
