"""The start of a motion, by names: deflections, velocities, or all coordinates of bodies."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

from paraflex.arguments import CheckedFields, checked_arguments
from paraflex.errors import InputError
from paraflex.mechanism.bodies import RigidBody
from paraflex.mechanism.joints import PointRef
from paraflex.mechanism.laws import AngleLaw, ConstantSpeed
from paraflex.mechanism.mechanism import Mechanism
from paraflex.mechanism.phases import joint_value
from paraflex.mechanism.poses import Pose, approximate_poses, placed_poses
from paraflex.mechanism.quantities import known


@dataclass(frozen=True)
class Deflection(CheckedFields):
    """Displacement of a point of a beam from the tangent at the first end; None leaves it to the others.

    Of a body of given shapes, off its place in the body frame.

    Attributes
    ----------
    axial, transverse : float, optional
        Stretch and displacement across [m]; what bending takes from the length comes on top in second-order geometry.
    slope : float, optional
        [rad]
    """

    _table = "deflection"

    axial: float | None = None
    transverse: float | None = None
    slope: float | None = None


@dataclass(frozen=True)
class BodyValues(CheckedFields):
    """All coordinates of a body, or their rates.

    Attributes
    ----------
    x, y, phi : float
        Of the body frame [m, rad], or [m/s, rad/s].
    flexible : tuple of float, optional
        Its own flexible coordinates: those its reference condition leaves of the nodes', `modes.vectors @ eta` of the
        modal ones. Zeros where None.
    """

    _table = "coordinates"

    x: float
    y: float
    phi: float
    flexible: tuple[float, ...] | None = None


@dataclass(frozen=True)
class Start(CheckedFields):
    """The given part of the start of a motion.

    Attributes
    ----------
    deflection : mapping of str to mapping of str to Deflection
        Of points, by body and point: the shape is that of least elastic energy.
    angular : mapping of str to float
        Rates of bodies' angles [rad/s].
    point : mapping of PointRef to (x, y)
        Velocities of points in the ground frame [m/s]. What these and the joints leave open has least kinetic energy,
        with links that do not begin to bend.
    coordinates, rates : mapping of str to BodyValues
        Taken as they are.
    """

    _table = "start"

    deflection: Mapping[str, Mapping[str, Deflection]] = field(default_factory=dict)
    angular: Mapping[str, float] = field(default_factory=dict)
    point: Mapping[PointRef, tuple[float, float]] = field(default_factory=dict)
    coordinates: Mapping[str, BodyValues] = field(default_factory=dict)
    rates: Mapping[str, BodyValues] = field(default_factory=dict)

    @property
    def places(self) -> bool:
        """Whether it gives coordinates, and not velocities alone."""
        return bool(self.deflection or self.coordinates)


def standing(mechanism: Mechanism, assembly: str | None = None, start: Start | None = None) -> Mechanism:
    """The mechanism with prescribed motions that begin where an assembly stands, if their start is not given.

    Bodies whose coordinates a start gives stand there.
    """
    poses: dict[str, Pose] = {}
    if mechanism.assemblies and mechanism.prescribed:
        chosen = mechanism.assembly(assembly)
        poses = approximate_poses(mechanism, chosen) | placed_poses(mechanism, chosen)
    given = {} if start is None else start.coordinates
    poses |= {name: Pose(values.phi, (values.x, values.y)) for name, values in given.items()}
    return begun_at(mechanism, lambda joint: joint_value(mechanism, mechanism.joint(joint), poses) or 0.0)


def begun_at(mechanism: Mechanism, value: Callable[[str], float], time: float = 0.0) -> Mechanism:
    """The mechanism with prescribed motions whose start is not given at the values of their joints at a time [s]."""

    def begun(law: AngleLaw, joint: str) -> AngleLaw:
        if isinstance(law, ConstantSpeed) and law.from_assembly:
            return replace(law, angle=value(joint) - time * law.speed)
        return law

    prescribed = tuple(replace(one, law=begun(one.law, one.joint)) for one in mechanism.prescribed)
    return mechanism if prescribed == mechanism.prescribed else replace(mechanism, prescribed=prescribed)


@checked_arguments()
def check_start(mechanism: Mechanism, start: Start) -> None:
    """Check that a start names bodies and points that exist, and gives each number once.

    Raises
    ------
    InputError
        It names the field under "start".
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
