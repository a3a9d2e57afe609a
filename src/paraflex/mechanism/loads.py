"""Forces on a mechanism other than those of motors: springs, dampers, friction, applied forces and torques."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar, Self

import numpy as np

from paraflex.arguments import CheckedFields, named_in_errors
from paraflex.arrays import Array
from paraflex.errors import InputError, within
from .joints import PointRef
from .laws import ForceLaw
from .profiles import ConstantSpeed, TimeProfile, marks
from .quantities import AT_JOINT, field_metadata, finite, not_negative, optional, positive


@dataclass(frozen=True)
class TorsionalSpring(CheckedFields):
    """Spring at a joint: torque -stiffness (joint angle - rest) on body b, the angle being that of b less a.

    The spring acts on the material at the joint, as a motor does. Stiffness in N m/rad, rest in rad, or N/m and m at a
    joint that slides. A mechanism holds a law of a spring as a load of the same name, with the opposite on body a.

    Attributes
    ----------
    name : str
        Name of the spring.
    joint : str
        Name of the joint.
    stiffness : float
        Stiffness [N m/rad or N/m]; 0 by default.
    rest : float
        Angle [rad] or travel [m] at which the spring is free; 0 by default.
    torque : ForceLaw, optional
        Characteristic of the spring, an additional torque [N m] or force [N] on body b, such as "-k * JOINT.angle**3".
        A joint that slides has to slide on the ground.
    """

    _table = "spring"

    name: str
    joint: str = field(metadata=AT_JOINT)
    stiffness: float = optional(0.0, "the stiffness in N m/rad", not_negative, "N m/rad, or N/m")
    rest: float = optional(0.0, "the joint's angle at which the spring is free in rad", finite)
    torque: ForceLaw | None = optional(
        None, "the torque on the joint's second body in N m, an expression of its NAME.angle, NAME.rate and others"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.torque is None and not self.stiffness:
            remedy = "give the stiffness in N m/rad, or N/m, or a torque"
            raise InputError("gives no torque", field=f"spring.{self.name}", remedy=remedy)


@dataclass(frozen=True)
class TorsionalDamper(CheckedFields):
    """Viscous damper at a joint: torque -coefficient (rate of body b less that of body a) on b.

    The damper acts on the material at the joint, as a motor does. Coefficient in N m s/rad, or N s/m at a joint that
    slides.
    """

    _table = "damper"

    name: str
    joint: str = field(metadata=AT_JOINT)
    coefficient: float = field(metadata=field_metadata("the coefficient in N m s/rad", positive, "N m s/rad, or N s/m"))


@dataclass(frozen=True)
class JointFriction(CheckedFields):
    """Regularised dry friction at a joint: force or torque -limit tanh(rate / speed).

    Friction acts as a viscous damper of limit / speed below that speed, and as Coulomb friction well above it.

    Attributes
    ----------
    name : str
        Name of the friction law.
    joint : str
        Name of the joint.
    limit : float
        Coulomb friction, torque [N m] at a revolute joint, force [N] at a joint that slides.
    speed : float
        Regularisation speed, at which three quarters of the limit are reached [rad/s or m/s].
    """

    _table = "friction"

    name: str
    joint: str = field(metadata=AT_JOINT)
    limit: float = field(metadata=field_metadata("the friction torque in N m, or force in N", positive, "N m, or N"))
    speed: float = field(
        metadata=field_metadata("the speed below which it acts as a damper in rad/s or m/s", positive, "rad/s, or m/s")
    )


@dataclass(frozen=True)
class LinearSpring(CheckedFields):
    """Spring with a damper between two points, at most one of them on the ground.

    The tensile force is stiffness (distance - length) + damping (rate of the distance) + force. It has no part in the
    Jacobian of Newton's iteration, so very stiff springs limit the step size.

    Attributes
    ----------
    name : str
        Name of the spring.
    a, b : PointRef
        Points that the spring connects.
    stiffness : float
        Stiffness [N/m].
    length : float
        Free length [m]; 0 by default.
    damping : float
        Damping coefficient [N s/m]; 0 by default.
    force : ForceLaw, optional
        Characteristic of the spring, a tensile force [N] such as "k * (NAME.length - l0)**3", without the time, or a
        constant one.
    """

    _table = "linear_spring"

    name: str
    a: PointRef
    b: PointRef
    stiffness: float = optional(0.0, "the stiffness in N/m", not_negative)
    length: float = optional(0.0, "the free length in m", not_negative)
    damping: float = optional(0.0, "the damping in N s/m", not_negative)
    force: ForceLaw | None = optional(
        None, "the tensile force in N, an expression of its NAME.length and NAME.length_rate, joints and points"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        place = f"linear_spring.{self.name}"
        if self.force is not None and self.force.in_time:
            problem, remedy = "contains the time, on which springs do not depend", "drop t from it"
            raise InputError(problem, field=f"{place}.force", value=self.force.text, remedy=remedy)
        if self.force is None and not (self.stiffness or self.damping):
            raise InputError("gives no force", field=place, remedy="give a stiffness, a damping or a force")

    @property
    def laws(self) -> tuple[ForceLaw, ...]:
        """Return the characteristic, if there is one."""
        return () if self.force is None else (self.force,)

    def moved(self, points: Mapping[PointRef, PointRef]) -> Self:
        """Return the spring with the points of its characteristic replaced by others."""
        return self if self.force is None else replace(self, force=self.force.moved(points))


InTime = float | TimeProfile
named_in_errors(
    "a number or a profile in time",
    "a number, or a profile in time: PiecewiseProfile, TabulatedProfile, ExpressionProfile",
)(InTime)
named_in_errors("two numbers or profiles in time", "[x, y], each a number or a profile in time")(tuple[InTime, InTime])


InMotion = float | TimeProfile | ForceLaw
named_in_errors("a number, a profile in time or a law", "a number, a profile in time, or a ForceLaw over the motion")(
    InMotion
)
named_in_errors("two numbers, profiles or laws", "[x, y], each a number, a profile in time or a ForceLaw")(
    tuple[InMotion, InMotion]
)
# The time itself, a signal of laws that contain it.
_CLOCK = ConstantSpeed(0.0, 1.0)


def _finite_or_profile(values: InMotion | tuple[InMotion, ...], field: str) -> None:
    """Check that numbers are finite; profiles are checked on evaluation."""
    several = values if isinstance(values, tuple) else (values,)
    finite([each for each in several if not isinstance(each, TimeProfile | ForceLaw)], field)


def value_in_time(given: InTime, t: Array) -> Array:
    """Return a constant, or the value of a profile, at times t [s]."""
    return given.evaluate(t)[0] if isinstance(given, TimeProfile) else np.full(t.shape, given)


@dataclass(frozen=True)
class _Load(CheckedFields):
    """Base class of loads."""

    _table = "load"
    kind: ClassVar[str]
    unit: ClassVar[str]

    name: str
    point: PointRef = field(metadata=field_metadata('"body.point"'))
    reaction: PointRef | None = field(
        default=None, kw_only=True, metadata=field_metadata("the point of another body that the opposite acts on")
    )

    @property
    def points(self) -> tuple[PointRef, ...]:
        """Points on which the load acts: its own, and that of its reaction."""
        return (self.point,) if self.reaction is None else (self.point, self.reaction)

    @property
    def components(self) -> tuple[InMotion, ...]:
        """Force along x and y in the ground frame [N], or the torque [N m]."""
        given = getattr(self, self.kind)
        return given if isinstance(given, tuple) else (given,)

    @property
    def laws(self) -> tuple[ForceLaw, ...]:
        """Components that are laws over the motion."""
        return tuple(each for each in self.components if isinstance(each, ForceLaw))

    @property
    def profiles(self) -> tuple[TimeProfile, ...]:
        """Profiles in time of components, and the time itself for laws that contain it, in their order."""
        found = (_CLOCK if isinstance(each, ForceLaw) and each.in_time else each for each in self.components)
        return tuple(each for each in found if isinstance(each, TimeProfile))

    def moved(self, points: Mapping[PointRef, PointRef]) -> Self:
        """Return the load with the points of its laws replaced by others, where `points` has them."""
        if not self.laws:
            return self
        parts = [each.moved(points) if isinstance(each, ForceLaw) else each for each in self.components]
        return replace(self, **{self.kind: tuple(parts) if len(parts) > 1 else parts[0]})

    def evaluate(self, t: Array) -> Array:
        """Evaluate the components at times t (k,) [s]: (k, 2) of a force [N], (k, 1) of a torque [N m].

        A law over the motion has no value at a time alone, NaN.

        Raises
        ------
        InputError
            A profile does not cover a time or is not finite there.
        """
        with within(f"load.{self.name}"):
            each = [value_in_time(np.nan if isinstance(one, ForceLaw) else one, t) for one in self.components]
        return np.stack(each, axis=1)

    def largest(self, t: Array) -> float:
        """Return the largest magnitude at times t [s] and at the knots and table rows between them [N, N m]."""
        within = [time for profile in self.profiles for time in marks(profile) if np.min(t) <= time <= np.max(t)]
        return float(np.max(np.linalg.norm(self.evaluate(np.concatenate([t, within])), axis=1)))


@dataclass(frozen=True)
class PointForce(_Load):
    """Force [N] at a named point of a body, in the ground frame: numbers, profiles in time, or laws."""

    kind: ClassVar[str] = "force"
    unit: ClassVar[str] = "N"

    force: tuple[InMotion, InMotion] = field(
        metadata=field_metadata(
            "[x, y] in the ground frame in N, numbers or expressions of the time t, joints and points",
            _finite_or_profile,
        )
    )


@dataclass(frozen=True)
class AppliedTorque(_Load):
    """Torque [N m] on the material at a named point of a body, a number, a profile in time or a law."""

    kind: ClassVar[str] = "torque"
    unit: ClassVar[str] = "N m"

    torque: InMotion = field(
        metadata=field_metadata(
            "the torque in N m, a number or an expression of the time t, joints and points", _finite_or_profile
        )
    )


Load = PointForce | AppliedTorque
named_in_errors("a load")(Load)
