"""Initial state of a motion, given by names: deflections, velocities, or all coordinates of bodies."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

from paraflex.arguments import CheckedFields, checked_arguments
from paraflex.errors import InputError
from .bodies import RigidBody
from .joints import PointRef
from .mechanism import Mechanism
from .phases import joint_value
from .poses import Pose, approximate_poses, placed_poses
from .profiles import ConstantSpeed, SpeedProfile, TimeProfile
from .quantities import known, optional


@dataclass(frozen=True)
class Deflection(CheckedFields):
    """Deflection of a point of a beam from the tangent at the first end; components that are None are free.

    The deflection of a body of user-defined shapes is that from the undeformed position in the body frame.

    Attributes
    ----------
    axial, transverse : float, optional
        Stretch and transverse displacement [m], without the foreshortening of second-order geometry.
    slope : float, optional
        Slope [rad].
    """

    _table = "deflection"

    axial: float | None = optional(None, "the displacement along the beam in m")
    transverse: float | None = optional(None, "the displacement across the beam in m")
    slope: float | None = optional(None, "the slope in rad")


@dataclass(frozen=True)
class BodyValues(CheckedFields):
    """Coordinates of a body, or their rates.

    Attributes
    ----------
    x, y, phi : float
        Position and angle of the body frame [m, rad], or their rates [m/s, rad/s].
    flexible : tuple of float, optional
        Flexible coordinates before the modal transformation, `modes.vectors @ eta`: of a beam the nodal coordinates
        that its reference condition leaves free. Zero by default.
    """

    _table = "coordinates"

    x: float
    y: float
    phi: float
    flexible: tuple[float, ...] | None = None


@dataclass(frozen=True)
class Start(CheckedFields):
    """Prescribed part of the initial state of a motion.

    Attributes
    ----------
    deflection : mapping of str to mapping of str to Deflection
        Deflections of points, by body and point; the shape is that of least elastic energy.
    angular : mapping of str to float
        Angular velocities of bodies [rad/s].
    point : mapping of PointRef to (x, y)
        Velocities of points in the ground frame [m/s]. The velocities that these and the joints leave free have least
        kinetic energy, with zero rates of deformation.
    coordinates, rates : mapping of str to BodyValues
        Coordinates of bodies and their rates, used without modification.
    """

    _table = "start"

    deflection: Mapping[str, Mapping[str, Deflection]] = field(default_factory=dict)
    angular: Mapping[str, float] = field(default_factory=dict)
    point: Mapping[PointRef, tuple[float, float]] = field(default_factory=dict)
    coordinates: Mapping[str, BodyValues] = field(default_factory=dict)
    rates: Mapping[str, BodyValues] = field(default_factory=dict)

    @property
    def places(self) -> bool:
        """Whether coordinates are given, and not velocities alone."""
        return bool(self.deflection or self.coordinates)


def standing(mechanism: Mechanism, assembly: str | None = None, start: Start | None = None) -> Mechanism:
    """Return the mechanism with prescribed motions that start at an assembly, unless their start value is given.

    Parameters
    ----------
    mechanism : Mechanism
        Mechanism with prescribed motions.
    assembly : str, optional
        Name of the assembly, by default the first.
    start : Start, optional
        Initial state, whose coordinates take precedence over the assembly for the bodies that it names.
    """
    poses: dict[str, Pose] = {}
    if mechanism.assemblies and mechanism.prescribed:
        chosen = mechanism.assembly(assembly)
        poses = approximate_poses(mechanism, chosen) | placed_poses(mechanism, chosen)
    given = {} if start is None else start.coordinates
    poses |= {name: Pose(values.phi, (values.x, values.y)) for name, values in given.items()}
    return begun_at(mechanism, lambda joint: joint_value(mechanism, mechanism.joint(joint), poses) or 0.0)


def begun_at(mechanism: Mechanism, value: Callable[[str], float], time: float = 0.0) -> Mechanism:
    """Return the mechanism with prescribed motions whose start is not given set to the joint values at a time [s]."""

    def begun(profile: TimeProfile, joint: str) -> TimeProfile:
        if isinstance(profile, ConstantSpeed | SpeedProfile) and profile.from_assembly:
            return profile.begun(value(joint), time)
        return profile

    prescribed = tuple(replace(one, profile=begun(one.profile, one.joint)) for one in mechanism.prescribed)
    return mechanism if prescribed == mechanism.prescribed else replace(mechanism, prescribed=prescribed)


@checked_arguments()
def check_start(mechanism: Mechanism, start: Start) -> None:
    """Check that an initial state refers to existing bodies and points and gives each quantity once.

    Raises
    ------
    InputError
        A check fails; the error gives the field under "start".
    """
    bodies = {body.name: body for body in mechanism.bodies}
    for table in ("deflection", "velocity.angular", "coordinates", "rates"):
        for name in getattr(start, table.rpartition(".")[2]):
            known(name, bodies, f"start.{table}", "body")
    for name, points in start.deflection.items():
        where = f"start.deflection.{name}"
        if isinstance(bodies[name], RigidBody) or not getattr(bodies[name], "flexible", True):
            raise InputError("a rigid body has no deflection", field=where, remedy="name a flexible beam")
        if name in start.coordinates:
            raise InputError("its coordinates are given", field=where, remedy="give one of deflection and coordinates")
        for point in points:
            known(point, bodies[name].points, where, "point")
    for ref in start.point:
        known(ref.body, bodies, "start.velocity.point", "body")
        known(ref.point, bodies[ref.body].points, "start.velocity.point", "point")
    if start.rates and (start.angular or start.point):
        raise InputError(
            "rates and velocity are both given", field="start.rates", remedy="give one of rates and velocity"
        )
