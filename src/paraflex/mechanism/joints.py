"""Joints between named points, prescribed joint angles, and motors at joints.

The two bodies of a joint are ordered. The joint coordinate is that of body b relative to body a, angles positive
anticlockwise. Joint loads in results act from body a on body b: the force at point b in the ground frame and the moment
about point b, positive anticlockwise (`dynamics.joint_loads`). A positive torque or force of a motor acts on body b
such that the coordinate increases.
"""

from dataclasses import dataclass, field, fields
from enum import Enum
from typing import Any, ClassVar, Literal

from paraflex.arguments import CheckedFields, checked_arguments, named_in_errors
from paraflex.errors import InputError, within
from .profiles import TimeProfile, check_motion
from .quantities import AT_JOINT, JointThat, enter_kind, field_metadata, finite, known, optional, positive

GROUND = "ground"


@named_in_errors("a point", 'a point, "body.point", say "link1.B1"')
@dataclass(frozen=True, order=True)
class PointRef(CheckedFields):
    """Named point of a body or of the ground, written "link1.B1" or "ground.A1" in files."""

    _table = "point"

    body: str
    point: str

    @classmethod
    def taken_from(cls, given: object, field: str) -> "PointRef | None":
        """Return the point of "body.point" or of the two names; None for anything else."""
        if isinstance(given, str):
            return cls.parse(given, str(field))
        if isinstance(given, tuple | list) and len(given) == 2:
            return cls(given[0], given[1])
        return None

    @classmethod
    @checked_arguments()
    def parse(cls, text: str, field: str = "point") -> "PointRef":
        """Parse "body.point".

        Raises
        ------
        InputError
            The text is not of this form.
        """
        body, dot, point = text.partition(".")
        if not (dot and body and point):
            raise InputError("not a point", field=field, value=text, remedy='write "body.point", say "link1.B1"')
        return cls(body, point)

    @property
    def on_ground(self) -> bool:
        """Whether the point is fixed in the ground frame."""
        return self.body == GROUND

    def __str__(self) -> str:
        return f"{self.body}.{self.point}"


class AtEnd(Enum):
    """Action of a run when a point that slides along a beam reaches the beam's end.

    ERROR (default)
        The run fails and keeps the result computed until then.
    STOP
        The run ends there without failing, as at a limit of the joint.
    WARN
        The run continues with extrapolated deflections, and the result has a finding.
    IGNORE
        The run continues with extrapolated deflections, without a finding.
    """

    ERROR = "error"
    STOP = "stop"
    WARN = "warn"
    IGNORE = "ignore"


# Kinds of joints by their names in files.
JOINT_KINDS: "dict[str, type[Joint]]" = {}
_SYMBOLS = {("points",): "pin", ("points", "angle"): "weld", ("axis", "angle"): "slider", ("axis",): "slot"}


class _Directions:
    """Default values of the fields that a kind of joint does not define."""

    direction: float = 0.0
    angle: float = 0.0
    length: float | None = 0.0
    at_end: AtEnd = AtEnd.IGNORE


@named_in_errors("a joint", "a joint of any kind, say RevoluteJoint")
@dataclass(frozen=True)
class Joint(CheckedFields, _Directions):
    """Joint between point a of one body and point b of another: the base class of all kinds.

    A subclass such as `class SlotJoint(Joint, kind="slot", holds=("axis",))` defines a kind of joint for files,
    equations, drawings and checks. The metadata of its own fields (`direction`, `angle` and others) describe them in
    files.

    Attributes
    ----------
    name : str
        Name of the joint.
    a, b : PointRef
        Points of the first and the second body.
    kind : str
        Name of the kind in files.
    holds : tuple of str
        Constraints of the joint: "points", points a and b coincide (two rows); "axis", point b stays on an axis through
        point a at `direction` relative to body a (one row); "angle", body b keeps the angle `angle` relative to body a
        (one row); "distance", points a and b keep the distance `length` (one row).
    follows_beam : bool
        Whether the axis is the deformed centre line of the beam of point a; otherwise the axis turns with the material
        at a.
    symbol : str
        Symbol in drawings, a name of `plots.marks.SYMBOLS`; by default that of the joint with the same constraints, or
        the name of the kind; without such a symbol only its place is drawn.
    slides, moves : bool
        Whether the joint coordinate is a travel along the axis [m] and not the angle of b relative to a [rad]; whether
        this coordinate is free.
    """

    _table = "joint"

    name: str
    a: PointRef
    b: PointRef
    kind: ClassVar[str]
    holds: ClassVar[tuple[str, ...]]
    follows_beam: ClassVar[bool]
    symbol: ClassVar[str]
    slides: ClassVar[bool]
    moves: ClassVar[bool]

    def __init_subclass__(
        cls, *, kind: str, holds: tuple[str, ...], symbol: str = "", follows_beam: bool = False
    ) -> None:
        super().__init_subclass__()
        if unknown := set(holds) - {"points", "axis", "angle", "distance"}:
            raise TypeError(f'{cls.__name__} holds {min(unknown)!r}: give "points", "axis", "angle" or "distance"')
        enter_kind(JOINT_KINDS, kind, cls, "joint")
        cls.kind, cls.holds, cls.follows_beam = kind, holds, follows_beam
        cls.slides = "axis" in holds
        cls.moves = cls.slides or not {"angle", "distance"}.intersection(holds)
        cls.symbol = symbol or _SYMBOLS.get(holds, kind)

    def check_moves(self, field: str, does: JointThat = "moves") -> None:
        """Check that the joint has the motion that `does` requires: a free angle, a free travel, either, or none.

        Raises
        ------
        InputError
            The joint has no free coordinate, as a weld, or one of the other kind.
        """
        if does == "exists":
            return
        if not self.moves:
            why = {"points": "does not move", "distance": "joint has no angle or travel to act on"}
            problem = f"a {self.kind} {why.get(self.holds[0], 'does not turn')}"
            raise InputError(problem, field=field, value=self.name, remedy="name another joint")
        if does != "moves" and self.slides != (does == "slides"):
            has, lacks = ("a travel", "an angle") if self.slides else ("an angle", "a travel")
            problem = f"a {self.kind} joint has {has} and not {lacks}"
            raise InputError(problem, field=field, value=self.name, remedy=f"name a joint that {does}")


def points_named(member: Any) -> dict[str, PointRef]:
    """Return the points that a member refers to, by the names of its fields."""
    return {each.name: at for each in fields(member) if isinstance(at := getattr(member, each.name), PointRef)}


@dataclass(frozen=True)
class RevoluteJoint(Joint, kind="revolute", holds=("points",)):
    """Revolute joint, at which two points coincide: p_b - p_a = 0.

    The joint angle is that of body b relative to body a (or to the ground), each including the slope of its beam at
    the joint.
    """


_DIRECTION = field_metadata("the angle of its axis against the first body in rad", finite)
_LENGTH = field_metadata("the constant distance in m, by default that of the first assembly", positive)
_ANGLE = field_metadata("the angle of the second body against the first in rad", finite)


@dataclass(frozen=True)
class PrismaticJoint(Joint, kind="prismatic", holds=("axis", "angle")):
    """Prismatic joint: body b slides along an axis of body a and does not rotate relative to it.

    The axis passes through point a at the angle `direction` to the x axis of body a, or of the ground; on a beam it
    turns with the slope at a. The joint coordinate is the travel of point b along the axis from point a [m].

    Attributes
    ----------
    direction : float
        Angle of the axis relative to body a [rad]; 0 by default.
    angle : float
        Constant angle of body b relative to body a, including slopes of beams [rad]; 0 by default.
    """

    direction: float = field(default=0.0, metadata=_DIRECTION)
    angle: float = field(default=0.0, metadata=_ANGLE)


@dataclass(frozen=True)
class SlotJoint(Joint, kind="slot", holds=("axis",)):
    """Pin in a slot: point b stays on an axis through point a of body a, and body b rotates freely.

    Axis, `direction` [rad] and joint coordinate are defined as those of a `PrismaticJoint`.
    """

    direction: float = field(default=0.0, metadata=_DIRECTION)


@dataclass(frozen=True)
class SlidingJoint(Joint, kind="sliding", holds=("axis",), symbol="sliding", follows_beam=True):
    """Sliding joint: point b slides along the centre line of a deformed beam, and body b rotates freely.

    Point a identifies the beam. The joint coordinate is the distance of point b from point a along the x axis of the
    beam's frame [m]. Deflections are evaluated at this position in the undeformed beam, as in linear theory.

    Attributes
    ----------
    at_end : AtEnd or str
        Action of a run when point b reaches an end of the beam; an error by default.
    """

    at_end: AtEnd = optional(
        AtEnd.ERROR, 'where a sliding point comes to the end of its beam: "error", "stop", "warn" or "ignore"'
    )


@dataclass(frozen=True)
class WeldJoint(Joint, kind="weld", holds=("points", "angle")):
    """Weld: points a and b coincide, and body b has a constant angle to body a, slopes of beams included [rad]."""

    angle: float = field(default=0.0, metadata=_ANGLE)


@dataclass(frozen=True)
class DistanceJoint(Joint, kind="distance", holds=("distance",), symbol="rod"):
    """Massless rod between two pins: points a and b keep their distance, |p_b - p_a| = length.

    The bodies rotate freely. The multiplier of the constraint row is the axial force of the rod [N], tension positive.

    Attributes
    ----------
    length : float, optional
        Length of the rod [m]; by default the distance in the first assembly, which a mechanism fills in.
    """

    length: float | None = field(default=None, metadata=_LENGTH)


@dataclass(frozen=True)
class PrescribedAngle(CheckedFields):
    """Rheonomic constraint: the angle or travel of a joint follows a given function of time."""

    _table = "prescribed"

    name: str
    joint: str = field(metadata=AT_JOINT)
    profile: TimeProfile

    def __post_init__(self) -> None:
        super().__post_init__()
        with within(self.place):
            check_motion(self.profile)

    @property
    def place(self) -> str:
        """Name of the motion in messages."""
        return f"prescribed.{self.name}"


@dataclass(frozen=True)
class Motor(CheckedFields):
    """Motor at a joint that turns or slides; a positive torque or force moves body b relative to body a.

    The torque acts on the material at the joint: on the body's angle and on the slope of the beam there.

    Attributes
    ----------
    name : str
        Name of the motor.
    joint : str
        Joint that it moves.
    follows : "plan", optional
        Makes the motor hold its joint on the planned motion where it is active, as an ideal servo drive does, instead
        of giving its planned torque.
    """

    _table = "motor"

    name: str
    joint: str = field(metadata=AT_JOINT)
    follows: Literal["plan"] | None = optional(None, '"plan" for a motor that holds its joint on the planned motion')

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.follows is not None:
            known(self.follows, ["plan"], f"motor.{self.name}.follows", "motion to follow")
