"""The mechanism: its members, checked when it is made, and variants with other bodies."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import Any

from paraflex.arguments import checked_arguments, given_as, refused
from paraflex.display import Shown
from paraflex.errors import InputError, as_enum
from paraflex.fem import ReferenceCondition
from paraflex.mechanism.bodies import Body, BodyReduction, Curvature, FlexibleBeam, RigidBody, given_shapes
from paraflex.mechanism.checks import check_mechanism
from paraflex.mechanism.members import Geometry, Members
from paraflex.mechanism.payload import Payload, loaded, together
from paraflex.mechanism.phases import with_phases
from paraflex.mechanism.quantities import known
from paraflex.mechanism.tracks import with_meshes


@given_as("a mechanism", "a Mechanism, or the model that paraflex.load reads")
@dataclass(frozen=True)
class Mechanism(Members, Shown):
    """A planar mechanism of rigid bodies and flexible beams. Checked when it is made.

    Attributes
    ----------
    name : str
    ground : mapping
        Named points fixed in the ground frame [m].
    bodies : tuple of RigidBody, FlexibleBeam, AssumedModesBeam or ModalBody
    joints : tuple of Joint
        Of any kind: RevoluteJoint, PrismaticJoint, SlotJoint, SlidingJoint, WeldJoint,
        DistanceJoint.
    motors : tuple of Motor
        Their order is that of the signs in a mode such as "+-+-".
    prescribed : tuple of PrescribedAngle
        Joint angles given in time.
    springs : tuple of TorsionalSpring
    dampers : tuple of TorsionalDamper
    frictions : tuple of JointFriction
    linear_springs : tuple of LinearSpring
    loads : tuple of PointForce or AppliedTorque
    sensors : tuple of Sensor
        Of any kind: Encoder, Tachometer, PositionSensor, VelocitySensor, AccelerationSensor, StrainGauge,
        JointForceSensor, DeflectionSensor. They do not act on it.
    gears : tuple of Gear
        Each with its phase.
    sums : tuple of SumRelation
        Relations of two joints and more, each with its phase.
    actuators : tuple of Actuator
        What motors are: gears, rotors, windings and amplifiers. Motors without one give torques as they are asked.
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
    payload : Payload or None
        What `with_payload` has added to the body that carries the end-effector, for drawings and lists.
    bases : mapping of str to (own, kept) nested sequence
        Flexible coordinates that bodies keep, as combinations of all that their reference conditions leave them: see
        `reduce_bodies`.
    cut : Cut or None
        The mechanism as described, of one that was made for computing: of segments, or of beams in several frames.

    Raises
    ------
    InputError
        Anything that does not fit together: see `mechanism.checks`.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        check_mechanism(self)
        object.__setattr__(self, "bodies", with_meshes(self))
        # The checks have looked bodies up by name.
        self.__dict__.pop("_bodies_by_name", None)
        for field, members in with_phases(self).items():
            object.__setattr__(self, field, members)
        self.__dict__.pop("_joints_by_name", None)

    def save(self, path: str | Path) -> None:
        """Write the model file of this mechanism, from which `load` reads an equal one; see `Model.save`."""
        # `files` is above `mechanism`, so it is imported when a file is written.
        import_module("paraflex.files").Model(self).save(path)

    @classmethod
    def made_of(cls, given: object) -> Mechanism:
        """The mechanism of a model, or the mechanism itself.

        Raises
        ------
        InputError
            Anything else.
        """
        taken = given if isinstance(given, cls) else cls.taken_from(given)
        if taken is None:
            raise refused(given, "mechanism", "a mechanism", "give a Mechanism, or the model that paraflex.load reads")
        return taken

    @checked_arguments()
    def with_bodies(self, bodies: Iterable[Body]) -> Mechanism:
        """The same mechanism with other bodies in place of those of the same names."""
        new = {body.name: body for body in bodies}
        return replace(self, bodies=tuple(new.get(body.name, body) for body in self.bodies))

    @checked_arguments()
    def with_payload(self, payload: Payload) -> Mechanism:
        """The mechanism with a payload at its end-effector, in addition to what the body there has.

        A rigid body gets the mass, centre of mass and moment of inertia of both; a beam a lump at the point, or a
        heavier one; a body of given matrices those with the payload.

        Raises
        ------
        InputError
            No end-effector; an offset on a flexible body.
        """
        effector = self.end_effector
        if effector is None:
            raise InputError("there is no end-effector to carry it", field="payload", remedy="name the end-effector")
        carrying = self.with_bodies([loaded(self.body(effector.point.body), effector.point.point, payload)])
        return replace(carrying, payload=together(self.payload, payload))

    @checked_arguments()
    def rigid(self, names: Sequence[str] | None = None) -> Mechanism:
        """The mechanism with the named bodies rigid; with all of them it is the RDM of Remark 3.

        Raises
        ------
        InputError
            If a name is not that of a body.
        """
        for name in names or ():
            known(name, [body.name for body in self.bodies], "rigid", "body")
        bodies = self.bodies if names is None else [self.body(name) for name in names]
        return self.with_bodies(body.as_rigid() for body in bodies if not isinstance(body, RigidBody))

    @checked_arguments()
    def with_beams(
        self,
        *,
        elements: int | None = None,
        reference: ReferenceCondition | str | None = None,
        curvature: Curvature | str | None = None,
        modes: int | None = None,
        reduction: BodyReduction | str | None = None,
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
        reduction : BodyReduction or str, optional
            Of which kind these are of beams: "modal" or "craig-bampton".

        Raises
        ------
        InputError
            Another mesh, condition or curvature for a flexible body of given shapes, or an unknown one.
        """
        reference = None if reference is None else as_enum(ReferenceCondition, reference, "reference")
        curvature = None if curvature is None else as_enum(Curvature, curvature, "curvature")
        asked = {"elements": elements, "reference": reference, "curvature": curvature}
        changes: dict[str, Any] = {name: value for name, value in asked.items() if value is not None}
        for what in changes:
            self._refuse_given_shapes(what)
        if reduction is not None:
            changes |= {"reduction": as_enum(BodyReduction, reduction, "reduction")}
            changes |= {} if modes is None else {"modes": modes}
        beams = [body for body in self.bodies if isinstance(body, FlexibleBeam)]
        changed = self.with_bodies(replace(beam, **changes) for beam in beams) if changes else self
        if modes is None:
            return changed
        bodies = [body for body in changed.bodies if not isinstance(body, RigidBody)]
        return changed.with_bodies(replace(body, modes=modes) for body in bodies)

    @checked_arguments()
    def refined(self, factor: int) -> Mechanism:
        """The mechanism with a multiple of the elements on every span of its flexible beams.

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
        return self.with_bodies(replace(beam, elements=times(beam.counts)) for beam in beams)

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
