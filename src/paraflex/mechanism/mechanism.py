"""The mechanism: bodies, joints, motors, end-effector, assemblies and actuation modes, by name."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import cached_property
from typing import TypeVar

from paraflex.arguments import CheckedFields, checked_arguments, given_as, refused
from paraflex.errors import InputError, as_enum, suggestion
from paraflex.fem import ReferenceCondition
from paraflex.mechanism.bodies import Body, Curvature, FlexibleBeam, RigidBody, given_shapes
from paraflex.mechanism.checks import check_mechanism
from paraflex.mechanism.joints import (
    GROUND,
    AxisJoint,
    Joint,
    Motor,
    PointRef,
    PrescribedAngle,
)
from paraflex.mechanism.loads import JointFriction, LinearSpring, Load, TorsionalDamper, TorsionalSpring

T = TypeVar("T")

TASK_COORDINATES = ("x", "y", "angle")
# The paper prints circled signs; some keyboards and many PDFs give these instead of plain ASCII.
_SIGNS = str.maketrans({"⊕": "+", "⊖": "-", "−": "-", "–": "-"})


@dataclass(frozen=True)
class EndEffector(CheckedFields):
    """The point whose motion is prescribed, and which of its coordinates are the task: "x", "y", "angle", each once."""

    _table = "end_effector"

    _own = ("coordinates",)
    point: PointRef
    coordinates: tuple[str, ...] = ("x", "y")

    def __post_init__(self) -> None:
        super().__post_init__()
        given = self.coordinates
        listed = not isinstance(given, str) and all(name in TASK_COORDINATES for name in given)
        if not (listed and given and len(set(given)) == len(given)):
            raise InputError(
                "not a set of task coordinates",
                field="end_effector.coordinates",
                value=given,
                remedy='choose from "x", "y", "angle", each once',
            )
        object.__setattr__(self, "coordinates", tuple(given))

    @classmethod
    def taken_from(cls, given: object, field: str) -> EndEffector | None:
        """That at a point; None of anything that is none."""
        return cls(PointRef.parse(given, str(field))) if isinstance(given, str) else None


@dataclass(frozen=True)
class Assembly(CheckedFields):
    """One way of putting the mechanism together, given by an approximate angle [rad] of each body.

    The solver closes the loops from there; several assemblies of one mechanism differ in their elbows.

    Attributes
    ----------
    name : str
    angles : mapping of str to float
        Of all bodies, or of those whose angles do not follow from points [rad].
    points : mapping of PointRef to (x, y)
        Approximate places in the ground frame [m].
    """

    _table = "assembly"

    name: str
    angles: Mapping[str, float]
    points: Mapping[PointRef, tuple[float, float]] = field(default_factory=dict)


@dataclass(frozen=True)
class ActuationMode(CheckedFields):
    """A set of active motors; the others turn freely."""

    _table = "mode"

    name: str
    motors: tuple[str, ...]


_MODE = 'a mode by its name, its signs such as "+-+-", or its motors such as "tau1,tau5"'
given_as("an actuation mode", _MODE)(str | ActuationMode)


class Geometry(Enum):
    """How the shape of a beam follows from its flexible coordinates.

    LINEAR
        As in the paper: displacements linear in the coordinates. A bent beam does not get shorter; where axial forces
        are large the answer is wrong, by how much depends on the reference condition.
    SECOND_ORDER
        With the shortening by bending, kept through inertia, joints and their Jacobians: right where axial forces are
        large.
    """

    LINEAR = "linear"
    SECOND_ORDER = "second-order"


@given_as("a mechanism", "a Mechanism, or the model that paraflex.load reads")
@dataclass(frozen=True)
class Mechanism(CheckedFields):
    """A planar mechanism of rigid bodies and flexible beams. Checked when it is made.

    Attributes
    ----------
    name : str
    ground : mapping
        Named points fixed in the ground frame [m].
    bodies : tuple of RigidBody, FlexibleBeam, AssumedModesBeam or ModalBody
    joints : tuple of RevoluteJoint, PrismaticJoint, SlotJoint, SlidingJoint or WeldJoint
    motors : tuple of Motor
        Their order is that of the signs in a mode such as "+-+-".
    prescribed : tuple of PrescribedAngle
        Joint angles given in time.
    springs : tuple of TorsionalSpring
    dampers : tuple of TorsionalDamper
    frictions : tuple of JointFriction
    linear_springs : tuple of LinearSpring
    loads : tuple of PointForce or AppliedTorque
    gravity : (x, y)
        Acceleration of free fall in the ground frame [m/s^2]; none by default.
    end_effector : EndEffector, optional
    assemblies : tuple of Assembly
        The first is the default.
    modes : tuple of ActuationMode
        The modes to choose from by default; any other set of motors may be asked for.
    geometry : Geometry or str
        Of its flexible beams: "second-order" by default, "linear" in the paper.
    description : str

    Raises
    ------
    InputError
        Anything that does not fit together: see `mechanism.checks`.
    """

    name: str
    ground: Mapping[str, tuple[float, float]]
    bodies: tuple[Body, ...]
    joints: tuple[Joint, ...]
    motors: tuple[Motor, ...] = ()
    prescribed: tuple[PrescribedAngle, ...] = ()
    end_effector: EndEffector | None = None
    assemblies: tuple[Assembly, ...] = ()
    modes: tuple[ActuationMode, ...] = ()
    springs: tuple[TorsionalSpring, ...] = ()
    dampers: tuple[TorsionalDamper, ...] = ()
    frictions: tuple[JointFriction, ...] = ()
    linear_springs: tuple[LinearSpring, ...] = ()
    loads: tuple[Load, ...] = ()
    gravity: tuple[float, float] = (0.0, 0.0)
    geometry: Geometry = Geometry.SECOND_ORDER
    description: str = field(default="", compare=False)

    @classmethod
    def taken_from(cls, given: object, field: str = "mechanism") -> Mechanism | None:
        """The mechanism of a model; None of anything else, a task or a run among them."""
        paths, mechanism = getattr(given, "paths", None), getattr(given, "mechanism", None)
        return mechanism if isinstance(paths, Mapping) and isinstance(mechanism, cls) else None

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "geometry", as_enum(Geometry, self.geometry, "geometry"))
        check_mechanism(self)

    @classmethod
    def made_of(cls, given: object) -> Mechanism:
        """A mechanism, or that of a model.

        Raises
        ------
        InputError
            Anything else.
        """
        taken = given if isinstance(given, cls) else cls.taken_from(given)
        if taken is None:
            raise refused(given, "mechanism", "a mechanism", "give a Mechanism, or the model that paraflex.load reads")
        return taken

    def _repr_html_(self) -> str:
        """In notebooks."""
        from paraflex.mechanism.html import mechanism_html

        return mechanism_html(self)

    def body(self, name: str) -> Body:
        """The body of that name; an `InputError` if there is none."""
        return self._by_name("body", name, self._bodies_by_name)

    def joint(self, name: str) -> Joint:
        """The joint of that name; an `InputError` if there is none."""
        return self._by_name("joint", name, self._joints_by_name)

    def _by_name(self, kind: str, name: str, members: Mapping[str, T]) -> T:
        try:
            return members[name]
        except (KeyError, TypeError):
            raise InputError(f"unknown {kind}", field=kind, value=name, remedy=suggestion(name, members)) from None

    @cached_property
    def _bodies_by_name(self) -> dict[str, Body]:
        return {body.name: body for body in self.bodies}

    @cached_property
    def _joints_by_name(self) -> dict[str, Joint]:
        return {joint.name: joint for joint in self.joints}

    @cached_property
    def points(self) -> Mapping[str, Mapping[str, object]]:
        """Named points of every body, and of the ground by its name."""
        return {GROUND: self.ground} | {body.name: body.points for body in self.bodies}

    def motor_units(self) -> tuple[str, ...]:
        """What each motor's torque is counted in: N m, or N where its joint slides."""
        return tuple("N" if isinstance(self.joint(motor.joint), AxisJoint) else "N m" for motor in self.motors)

    def assembly(self, name: str | None = None) -> Assembly:
        """The assembly of that name, or the first.

        Raises
        ------
        InputError
            If there is none.
        """
        known = ", ".join(assembly.name for assembly in self.assemblies) or "none"
        for assembly in self.assemblies:
            if name is None or assembly.name == name:
                return assembly
        raise InputError("unknown assembly", field="assembly", value=name, remedy=f"this mechanism has: {known}")

    @checked_arguments()
    def with_bodies(self, bodies: Iterable[Body]) -> Mechanism:
        """The same mechanism with other bodies in place of those of the same names."""
        new = {body.name: body for body in bodies}
        return replace(self, bodies=tuple(new.get(body.name, body) for body in self.bodies))

    @checked_arguments()
    def rigid(self, names: Sequence[str] | None = None) -> Mechanism:
        """The mechanism with the named bodies rigid, or all of them: then it is the RDM of Remark 3.

        Raises
        ------
        InputError
            If a name is not that of a body.
        """
        names = [body.name for body in self.bodies] if names is None else list(names)
        known = [body.name for body in self.bodies]
        for name in names:
            if name not in known:
                raise InputError("unknown body", field="rigid", value=name, remedy=f"choose from {', '.join(known)}")
        bodies = [self.body(name) for name in names]
        return self.with_bodies(body.as_rigid() for body in bodies if not isinstance(body, RigidBody))

    @checked_arguments()
    def with_beams(
        self,
        *,
        elements: int | None = None,
        reference: ReferenceCondition | str | None = None,
        curvature: Curvature | str | None = None,
        modes: int | None = None,
    ) -> Mechanism:
        """The mechanism with another mesh, reference condition, element variant or reduction on every flexible beam.

        Parameters
        ----------
        elements : int, optional
            Elements per span, the same for all.
        reference : ReferenceCondition or str, optional
        curvature : Curvature or str, optional
        modes : int, optional
            Modes of lowest frequency kept of each, and of each other flexible body.

        Raises
        ------
        InputError
            Another mesh, condition or curvature for a flexible body of given shapes, or an unknown one.
        """
        reference = None if reference is None else as_enum(ReferenceCondition, reference, "reference")
        curvature = None if curvature is None else as_enum(Curvature, curvature, "curvature")
        asked = {"elements": elements, "reference": reference, "curvature": curvature}
        for what in [name for name, value in asked.items() if value is not None]:
            self._refuse_given_shapes(what)
        beams = [body for body in self.bodies if isinstance(body, FlexibleBeam)]
        if elements is not None:
            beams = [replace(beam, elements=elements) for beam in beams]
        if reference is not None:
            beams = [replace(beam, reference=reference) for beam in beams]
        if curvature is not None:
            beams = [replace(beam, curvature=curvature) for beam in beams]
        changed = self.with_bodies(beams)
        if modes is None:
            return changed
        bodies = [body for body in changed.bodies if not isinstance(body, RigidBody)]
        return changed.with_bodies(replace(body, modes=modes) for body in bodies)

    @checked_arguments()
    def refined(self, factor: int) -> Mechanism:
        """The mechanism with so many times the elements on every span of its flexible beams.

        Raises
        ------
        InputError
            A flexible body of given shapes, which has no elements, and a factor other than 1.
        """
        if factor != 1:
            self._refuse_given_shapes("elements")

        def times(elements: int | tuple[int, ...]) -> int | tuple[int, ...]:
            return elements * factor if isinstance(elements, int) else tuple(count * factor for count in elements)

        beams = [body for body in self.bodies if isinstance(body, FlexibleBeam) and body.flexible]
        return self.with_bodies(replace(beam, elements=times(beam.elements)) for beam in beams)

    def _refuse_given_shapes(self, what: str) -> None:
        for name in given_shapes(self.bodies):
            raise InputError(
                "the shapes of this body are given",
                field=f"body.{name}.{what}",
                remedy="change them in the body itself, or leave it out",
            )

    @checked_arguments()
    def with_geometry(self, geometry: Geometry | str) -> Mechanism:
        """The mechanism with linear or second-order geometry of its flexible beams.

        Raises
        ------
        InputError
            Neither of the two.
        """
        return replace(self, geometry=as_enum(Geometry, geometry, "geometry"))


@checked_arguments()
def mode_of_signs(mechanism: Mechanism, signs: str) -> ActuationMode:
    """The mode a sign string names, one sign a motor: "+" active, "-" passive (Table 1).

    Raises
    ------
    InputError
        Any other character, or a wrong number of them.
    """
    plain = signs.translate(_SIGNS)
    names = [motor.name for motor in mechanism.motors]
    if len(plain) != len(names) or set(plain) - {"+", "-"}:
        raise InputError(
            "not an actuation mode",
            field="mode",
            value=signs,
            remedy=f"write one + or - for each of the {len(names)} motors ({', '.join(names)}), or motor names",
        )
    return ActuationMode(plain, tuple(name for name, sign in zip(names, plain, strict=True) if sign == "+"))


@checked_arguments()
def mode_of_motors(mechanism: Mechanism, names: Sequence[str]) -> ActuationMode:
    """The mode in which just these motors are active, named by its sign string.

    Raises
    ------
    InputError
        An unknown motor, or one named twice.
    """
    known = [motor.name for motor in mechanism.motors]
    for name in names:
        if name not in known:
            raise InputError("unknown motor", field="mode", value=name, remedy=f"choose from {', '.join(known)}")
    if len(set(names)) != len(names):
        raise InputError("a motor is named twice", field="mode", value=",".join(names), remedy="name each once")
    return mode_of_signs(mechanism, "".join("+" if name in names else "-" for name in known))


@checked_arguments()
def parse_mode(mechanism: Mechanism, text: str) -> ActuationMode:
    """Read a mode: its name in the mechanism, signs ("+-+-"), or motor names ("tau1,tau5")."""
    for mode in mechanism.modes:
        if text == mode.name:
            return mode
    names = [part.strip() for part in text.split(",")]
    if all(name in {motor.name for motor in mechanism.motors} for name in names):
        return mode_of_motors(mechanism, names)
    return mode_of_signs(mechanism, text.strip())
