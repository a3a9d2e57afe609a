"""Members of a mechanism, looked up by name."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from typing import Self

from paraflex.arguments import CheckedFields, checked_arguments, named_in_errors
from paraflex.errors import InputError
from .actuators import Actuator
from .bodies import Body
from .cut import Cut
from .gears import Gear, Relation, SumRelation
from .groups import Group, group, grouped
from .joints import GROUND, Joint, Motor, PointRef, PrescribedAngle, points_named
from .laws import ForceLaw
from .loads import AppliedTorque, JointFriction, LinearSpring, Load, PointForce, TorsionalDamper, TorsionalSpring
from .payload import Payload
from .quantities import field_metadata, joints_named, known, optional
from .sensors import SENSOR_KINDS, Sensor

TASK_COORDINATES = ("x", "y", "angle")


@dataclass(frozen=True)
class EndEffector(CheckedFields):
    """Point whose motion is the task, and its task coordinates: any of "x", "y" and "angle", each once."""

    _table = "end_effector"

    _own = ("coordinates",)
    point: PointRef = field(metadata=field_metadata('"body.point"'))
    coordinates: tuple[str, ...] = optional(("x", "y"), 'task coordinates from "x", "y", "angle"')

    def __post_init__(self) -> None:
        super().__post_init__()
        given = self.coordinates
        listed = isinstance(given, list | tuple) and all(name in TASK_COORDINATES for name in given)
        if not (listed and given and len(set(given)) == len(given)):
            raise InputError(
                "not a set of task coordinates",
                field="end_effector.coordinates",
                value=given,
                remedy='choose from "x", "y", "angle", each once',
            )
        object.__setattr__(self, "coordinates", tuple(given))

    @classmethod
    def taken_from(cls, given: object, field: str) -> "EndEffector | None":
        """Return the end-effector at a point given as "body.point"; None for anything else."""
        return cls(PointRef.parse(given, str(field))) if isinstance(given, str) else None


@dataclass(frozen=True)
class Assembly(CheckedFields):
    """Assembly of the mechanism, given by an approximate angle of each body.

    The solver closes the loops from there. Several assemblies of a mechanism differ in the configuration of its elbows.

    Attributes
    ----------
    name : str
        Name of the assembly.
    angles : mapping of str to float
        Approximate angles of all bodies, or of those whose angles do not follow from points [rad].
    points : mapping of PointRef to (x, y)
        Approximate positions of points in the ground frame [m].
    """

    _table = "assembly"

    name: str
    angles: Mapping[str, float] = field(default_factory=dict)
    points: Mapping[PointRef, tuple[float, float]] = field(default_factory=dict)


@dataclass(frozen=True)
class ActuationMode(CheckedFields):
    """Named set of active motors; all other motors are passive and exert no torque.

    Attributes
    ----------
    name : str
        Name of the mode.
    motors : tuple of str
        Active motors.
    follows : bool
        Whether active motors hold their joints on the planned motion, as ideal servo drives do, instead of giving the
        planned torques.
    """

    _table = "mode"

    name: str
    motors: tuple[str, ...]
    follows: bool = False


_MODE = 'a mode by its name, its signs such as "+-+-", or its motors such as "tau1,tau5"'
named_in_errors("an actuation mode", _MODE)(str | ActuationMode)


class Geometry(Enum):
    """Order of a beam's displacements in its flexible coordinates.

    LINEAR
        Displacements linear in the coordinates, as in the paper. Foreshortening is neglected: results are wrong where
        axial forces are large, with an error that depends on the reference condition.
    SECOND_ORDER
        Displacements with the foreshortening by bending, included in inertia, joints and their Jacobians. Results are
        correct where axial forces are large.
    """

    LINEAR = "linear"
    SECOND_ORDER = "second-order"


@named_in_errors("a mechanism", "a Mechanism, or the model that paraflex.load reads")
@dataclass(frozen=True)
class Members(CheckedFields):
    """Members of a mechanism, looked up by name: the unchecked base of `Mechanism`, which describes the fields.

    A field with a `group` in its metadata is a group of members. Files, checks, engines and tables iterate over these.
    """

    name: str
    ground: Mapping[str, tuple[float, float]]
    bodies: tuple[Body, ...] = field(metadata={"group": Group("body", "body", plural="bodies", engines=True)})
    joints: tuple[Joint, ...] = field(metadata={"group": Group("joint", "joint", engines=True)})
    motors: tuple[Motor, ...] = group("motor", "motor", engines=True)
    prescribed: tuple[PrescribedAngle, ...] = group("prescribed", "prescribed angle")
    end_effector: EndEffector | None = None
    assemblies: tuple[Assembly, ...] = group("assembly", "assembly", plural="assemblies", engines=True)
    modes: tuple[ActuationMode, ...] = group("mode", "actuation mode", engines=True)
    springs: tuple[TorsionalSpring, ...] = group("spring", "spring", TorsionalSpring, engines=True, resists=True)
    dampers: tuple[TorsionalDamper, ...] = group("damper", "damper", TorsionalDamper, resists=True)
    frictions: tuple[JointFriction, ...] = group("friction", "friction law", JointFriction, resists=True)
    linear_springs: tuple[LinearSpring, ...] = group(
        "linear_spring", "spring between points", LinearSpring, plural="springs between points", resists=True
    )
    gears: tuple[Gear, ...] = group("gear", "gear", Gear, engines=True)
    sums: tuple[SumRelation, ...] = group("relation", "relation", SumRelation)
    loads: tuple[Load, ...] = group("load", "load", PointForce, AppliedTorque)
    actuators: tuple[Actuator, ...] = group("actuator", "actuator", Actuator, engines=True)
    sensors: tuple[Sensor, ...] = group("sensor", "sensor", *SENSOR_KINDS.values(), engines=True, measures=True)
    gravity: tuple[float, float] = (0.0, 0.0)
    geometry: Geometry = Geometry.SECOND_ORDER
    description: str = field(default="", compare=False)
    # The body that carries it includes it, so it takes no part in comparison, saving and simulation.
    payload: Payload | None = field(default=None, compare=False, repr=False)
    # Reduced bases (own, kept) of bodies by name, from a reduction along a motion.
    bases: Mapping[str, tuple[tuple[float, ...], ...]] = field(default_factory=dict, repr=False)
    # Present if this mechanism was derived from another one for computation.
    cut: Cut | None = field(default=None, compare=False, repr=False)

    @property
    def described(self) -> Self:
        """Mechanism as the user described it: this one, unless it was derived from another one for computation."""
        return self if self.cut is None else self.cut.whole

    @classmethod
    def taken_from(cls, given: object, field: str = "mechanism") -> Self | None:
        """Return the mechanism of a model; None for anything else, such as a task or a run."""
        paths, mechanism = getattr(given, "paths", None), getattr(given, "mechanism", None)
        return mechanism if isinstance(paths, Mapping) and isinstance(mechanism, cls) else None

    def body(self, name: str) -> Body:
        """Return the body of a name; raise an `InputError` if there is none."""
        known(name, self._bodies_by_name, "body", "body")
        return self._bodies_by_name[name]

    def joint(self, name: str) -> Joint:
        """Return the joint of a name; raise an `InputError` if there is none."""
        known(name, self.joints_by_name, "joint", "joint")
        return self.joints_by_name[name]

    @cached_property
    def _bodies_by_name(self) -> dict[str, Body]:
        return {body.name: body for body in self.bodies}

    @cached_property
    def joints_by_name(self) -> dict[str, Joint]:
        """Joints by name."""
        return {joint.name: joint for joint in self.joints}

    @property
    def relations(self) -> tuple[Relation, ...]:
        """Gears and all other members that relate the coordinates of joints."""
        return tuple(one for group, members in grouped(self) if group.relates for one in members)

    @cached_property
    def points(self) -> Mapping[str, Mapping[str, object]]:
        """Named points of every body and of the ground, by the name of the body or "ground"."""
        return {GROUND: self.ground} | {body.name: body.points for body in self.bodies}

    @cached_property
    def joints_at(self) -> Mapping[str, list[Joint]]:
        """Joints at every body and at the ground, in the order of the mechanism."""
        found: dict[str, list[Joint]] = {name: [] for name in self.points}
        for joint in self.joints:
            for name in dict.fromkeys((joint.a.body, joint.b.body)):
                found[name].append(joint)
        return found

    @property
    def points_used(self) -> set[PointRef]:
        """Points that a joint, a spring, a load, another member or the end-effector refers to."""
        used = {point for _, members in grouped(self) for one in members for point in points_named(one).values()}
        return used if self.end_effector is None else used | {self.end_effector.point}

    def points_of(self, law: ForceLaw) -> list[PointRef]:
        """Return the points on whose motion a law depends, those of its joints and springs included."""
        springs, points = {one.name: one for one in self.linear_springs}, list[PointRef]()
        for one in law.quantities.values():
            between = springs[one.spring] if one.spring else self.joint(one.joint) if one.joint else None
            points += [one.point] if one.point else [] if between is None else [between.a, between.b]
        return points

    @checked_arguments()
    def reached(self, start: str, past: str = "") -> set[str]:
        """Return the bodies that joints connect with a body or the ground, itself included, not by way of `past`."""
        known(start, self.joints_at, "start", "body")
        seen, waiting = {start, past}, [start]
        while waiting:
            for joint in self.joints_at[waiting.pop()]:
                new = {joint.a.body, joint.b.body} - seen
                seen |= new
                waiting += new
        return seen - {past}

    def slides(self, joint: str) -> bool:
        """Return whether the coordinate of the named joint is a travel, not an angle."""
        return self.joint(joint).slides

    def motor_units(self) -> tuple[str, ...]:
        """Return the units of the motors' torques: N m, or N where the joint slides."""
        return tuple("N" if self.slides(motor.joint) else "N m" for motor in self.motors)

    def sensor_units(self) -> tuple[str, ...]:
        """Return the units of the sensors' readings."""
        return tuple(self.sensor_unit(sensor) for sensor in self.sensors)

    @checked_arguments()
    def sensor_unit(self, sensor: Sensor) -> str:
        """Return the unit of a sensor's readings, which may depend on whether its joint turns or slides."""
        return sensor.unit(any(self.slides(joint) for _, joint, _ in joints_named(sensor)))

    def assembly(self, name: str | None = None) -> Assembly:
        """Return the assembly of a name, by default the first.

        Raises
        ------
        InputError
            There is no such assembly.
        """
        names = ", ".join(assembly.name for assembly in self.assemblies)
        for assembly in self.assemblies:
            if name is None or (isinstance(name, str) and assembly.name == name):
                return assembly
        if not names:
            remedy = "add an [assembly.NAME] table with estimates of coordinates"
            field = "assembly" if name else "assembly.NAME"
            raise InputError("the mechanism has none", field=field, value=name, remedy=remedy)
        raise InputError("unknown assembly", field="assembly", value=name, remedy=f"this mechanism has: {names}")
