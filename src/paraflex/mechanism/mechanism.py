"""Mechanism: its members, checked on construction, and variants with other bodies."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from paraflex.arguments import checked_arguments, named_in_errors, refused
from paraflex.display import Shown
from paraflex.errors import InputError, as_enum
from paraflex.fem import ReferenceCondition
from paraflex.late import save_file
from .bodies import Body, ComponentModes, Curvature, FlexibleBeam, RigidBody, given_shapes
from .checks import check_mechanism
from .members import Geometry, Members
from .payload import Payload, loaded, together
from .phases import with_phases
from .quantities import known
from .spring_laws import with_spring_laws
from .tracks import with_meshes


@named_in_errors("a mechanism", "a Mechanism, or the model that paraflex.load reads")
@dataclass(frozen=True)
class Mechanism(Members, Shown):
    """Planar mechanism of rigid and flexible bodies, checked on construction.

    Attributes
    ----------
    name : str
        Name of the mechanism.
    ground : mapping
        Named points fixed in the ground frame [m].
    bodies : tuple of RigidBody, FlexibleBeam, AssumedModesBeam or ModalBody
        Bodies of the mechanism, at least one.
    joints : tuple of Joint
        Joints of any kind: RevoluteJoint, PrismaticJoint, SlotJoint, SlidingJoint, WeldJoint,
        DistanceJoint.
    motors : tuple of Motor
        Motors, in the order of the signs of an actuation mode such as "+-+-".
    prescribed : tuple of PrescribedAngle
        Joint angles prescribed as functions of time.
    springs : tuple of TorsionalSpring
        Springs at joints.
    dampers : tuple of TorsionalDamper
        Viscous dampers at joints.
    frictions : tuple of JointFriction
        Dry friction at joints.
    linear_springs : tuple of LinearSpring
        Springs with dampers between points.
    loads : tuple of PointForce or AppliedTorque
        Applied forces and torques.
    sensors : tuple of Sensor
        Sensors of any kind: Encoder, Tachometer, PositionSensor, VelocitySensor, AccelerationSensor, StrainGauge,
        JointForceSensor, DeflectionSensor. They do not act on the mechanism.
    gears : tuple of Gear
        Gears, each with its phase.
    sums : tuple of SumRelation
        Relations of two or more joints, each with its phase.
    actuators : tuple of Actuator
        Gears, rotors, windings and amplifiers of motors. A motor without an actuator applies the commanded torque.
    gravity : (x, y)
        Gravitational acceleration in the ground frame [m/s^2]; zero by default.
    end_effector : EndEffector, optional
        Point whose motion is the task.
    assemblies : tuple of Assembly
        Assemblies of the mechanism; the first is the default.
    modes : tuple of ActuationMode
        Actuation modes to choose from by default; any other set of motors may be requested.
    geometry : Geometry or str
        Geometry of the flexible beams: "second-order" by default, "linear" in the paper.
    description : str
        Description of the mechanism for its readers.
    payload : Payload or None
        Payload that `with_payload` has added to the body of the end-effector, for drawings and tables.
    bases : mapping of str to (own, kept) nested sequence
        Reduced basis of each body named: retained flexible coordinates as combinations of all coordinates that its
        reference condition leaves, see `reduce_bodies`.
    cut : Cut or None
        Mechanism as described by the user, if this one was derived from it for computation: with finite segments,
        beams in several frames or rotors.

    Raises
    ------
    InputError
        The members are inconsistent: see `mechanism.checks`.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        check_mechanism(self)
        object.__setattr__(self, "bodies", with_meshes(self))
        # The checks have cached the bodies by name.
        self.__dict__.pop("_bodies_by_name", None)
        for field, members in (with_phases(self) | with_spring_laws(self)).items():
            object.__setattr__(self, field, members)
        self.__dict__.pop("joints_by_name", None)

    def save(self, path: str | Path) -> None:
        """Write the model file of this mechanism, from which `load` reads an equal mechanism; see `Model.save`."""
        save_file(self, path)

    @classmethod
    def from_source(cls, given: object) -> "Mechanism":
        """Return the mechanism of a model, or the given mechanism.

        Raises
        ------
        InputError
            The argument is neither a mechanism nor a model.
        """
        taken = given if isinstance(given, cls) else cls.taken_from(given)
        if taken is None:
            raise refused(given, "mechanism", "a mechanism", "give a Mechanism, or the model that paraflex.load reads")
        return taken

    @checked_arguments()
    def with_bodies(self, bodies: Iterable[Body]) -> "Mechanism":
        """Return the mechanism with the given bodies in place of those of the same names."""
        new = {body.name: body for body in bodies}
        return replace(self, bodies=tuple(new.get(body.name, body) for body in self.bodies))

    @checked_arguments()
    def with_payload(self, payload: Payload) -> "Mechanism":
        """Return the mechanism with a payload at its end-effector, in addition to the mass that the body there has.

        A rigid body receives the combined mass, centre of mass and moment of inertia. A beam receives a lump at the
        point, or a heavier one. The matrices of a body given by matrices are updated.

        Raises
        ------
        InputError
            There is no end-effector, or the payload has an offset on a flexible body.
        """
        effector = self.end_effector
        if effector is None:
            raise InputError("there is no end-effector to carry it", field="payload", remedy="name the end-effector")
        carrying = self.with_bodies([loaded(self.body(effector.point.body), effector.point.point, payload)])
        return replace(carrying, payload=together(self.payload, payload))

    @checked_arguments()
    def rigid(self, names: Sequence[str] | None = None) -> "Mechanism":
        """Return the mechanism with the named bodies rigid, by default all: the RDM of Remark 3.

        Raises
        ------
        InputError
            A name is not that of a body.
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
        reduction: ComponentModes | str | None = None,
    ) -> "Mechanism":
        """Return the mechanism with another mesh, reference condition, curvature or reduction of every flexible beam.

        Parameters
        ----------
        elements : int, optional
            Number of elements per span, the same for all spans; by default unchanged, as all that follow.
        reference : ReferenceCondition or str, optional
            Reference condition of the floating frames.
        curvature : Curvature or str, optional
            Continuity of the curvature at lumped moments of inertia.
        modes : int, optional
            Number of modes of lowest frequency that each beam, and each other flexible body, retains.
        reduction : ComponentModes or str, optional
            Reduction of the beams: "modal" or "craig-bampton".

        Raises
        ------
        InputError
            A mesh, condition or curvature is given and a flexible body has user-defined shapes, or it is unknown.
        """
        reference = None if reference is None else as_enum(ReferenceCondition, reference, "reference")
        curvature = None if curvature is None else as_enum(Curvature, curvature, "curvature")
        chosen = {"elements": elements, "reference": reference, "curvature": curvature}
        changes: dict[str, Any] = {name: value for name, value in chosen.items() if value is not None}
        for what in changes:
            self._refuse_given_shapes(what)
        if reduction is not None:
            changes |= {"reduction": as_enum(ComponentModes, reduction, "reduction")}
            changes |= {} if modes is None else {"modes": modes}
        beams = [body for body in self.bodies if isinstance(body, FlexibleBeam)]
        changed = self.with_bodies(replace(beam, **changes) for beam in beams) if changes else self
        if modes is None:
            return changed
        bodies = [body for body in changed.bodies if not isinstance(body, RigidBody)]
        return changed.with_bodies(replace(body, modes=modes) for body in bodies)

    @checked_arguments()
    def refined(self, factor: int) -> "Mechanism":
        """Return the mechanism with `factor` times as many elements on every span of its flexible beams.

        Raises
        ------
        InputError
            A flexible body has user-defined shapes and hence no elements, and the factor is not 1.
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
    def with_geometry(self, geometry: Geometry | str) -> "Mechanism":
        """Return the mechanism with linear or second-order geometry of its flexible beams.

        Raises
        ------
        InputError
            The geometry is neither of the two.
        """
        return replace(self, geometry=as_enum(Geometry, geometry, "geometry"))
