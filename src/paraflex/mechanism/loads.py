"""Forces on a mechanism besides those of motors: springs and dampers at joints, forces and torques."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import ClassVar

from paraflex.arguments import CheckedFields, given_as
from paraflex.mechanism.joints import PointRef
from paraflex.mechanism.quantities import AT_JOINT, finite, not_negative, positive, said


@dataclass(frozen=True)
class TorsionalSpring(CheckedFields):
    """A linear spring at a revolute joint: torque -stiffness (angle of body b less that of body a, less rest) on b.

    Like a motor it acts on the material at the joint. Stiffness in N m/rad, rest in rad.
    """

    _table = "spring"

    name: str
    joint: str = field(metadata=AT_JOINT)
    stiffness: float = field(metadata=said("the stiffness in N m/rad", positive, "N m/rad, or N/m"))
    rest: float = field(default=0.0, metadata=said("the joint's angle at which the spring is free in rad", finite))


@dataclass(frozen=True)
class TorsionalDamper(CheckedFields):
    """Viscous friction at a revolute joint: torque -coefficient (rate of body b less that of body a) on b.

    Like a motor it acts on the material at the joint. Coefficient in N m s/rad.
    """

    _table = "damper"

    name: str
    joint: str = field(metadata=AT_JOINT)
    coefficient: float = field(metadata=said("the coefficient in N m s/rad", positive, "N m s/rad, or N s/m"))


@dataclass(frozen=True)
class JointFriction(CheckedFields):
    """Dry friction at a joint, regularised: force or torque -limit tanh(rate / speed) against the joint's rate.

    It acts as a damper of limit / speed below that speed and as Coulomb's friction well above it.

    Attributes
    ----------
    name : str
    joint : str
    limit : float
        [N m] at a revolute joint, [N] at a prismatic joint or slot.
    speed : float
        At which three quarters of the limit are reached [rad/s or m/s].
    """

    _table = "friction"

    name: str
    joint: str = field(metadata=AT_JOINT)
    limit: float = field(metadata=said("the friction torque in N m, or force in N", positive, "N m, or N"))
    speed: float = field(
        metadata=said("the speed below which it acts as a damper in rad/s or m/s", positive, "rad/s, or m/s")
    )


@dataclass(frozen=True)
class LinearSpring(CheckedFields):
    """A spring with a damper between two points, at most one of them on the ground.

    It pulls with stiffness (distance - length) + damping (rate of the distance). Explicit in Newton's iteration: very
    stiff ones dictate the step.

    Attributes
    ----------
    name : str
    a, b : PointRef
    stiffness : float
        [N/m]
    length : float
        Free length [m].
    damping : float
        [N s/m]
    """

    _table = "linear_spring"

    name: str
    a: PointRef
    b: PointRef
    stiffness: float = field(metadata=said("the stiffness in N/m", not_negative, "N/m"))
    length: float = field(default=0.0, metadata=said("the free length in m", not_negative, "m"))
    damping: float = field(default=0.0, metadata=said("the damping in N s/m", not_negative, "N s/m"))


@dataclass(frozen=True)
class PointForce(CheckedFields):
    """A constant force [N] at a named point of a body, given in the ground frame."""

    _table = "load"
    kind: ClassVar[str] = "force"
    unit: ClassVar[str] = "N"

    name: str
    point: PointRef = field(metadata=said('"body.point"'))
    force: tuple[float, float] = field(metadata=said("[x, y] in the ground frame in N", finite))

    @property
    def size(self) -> float:
        """Magnitude of the force [N]."""
        return math.hypot(*self.force)


@dataclass(frozen=True)
class AppliedTorque(CheckedFields):
    """A constant torque [N m] on the material at a named point of a body."""

    _table = "load"
    kind: ClassVar[str] = "torque"
    unit: ClassVar[str] = "N m"

    name: str
    point: PointRef = field(metadata=said('"body.point"'))
    torque: float = field(metadata=said("the torque in N m", finite))

    @property
    def size(self) -> float:
        """Magnitude of the torque [N m]."""
        return abs(self.torque)


Load = PointForce | AppliedTorque
given_as("a load")(Load)
