"""Joints between named points, prescribed joint angles, and motors at joints.

The two bodies of a joint have an order. Its coordinate is that of body b against body a, angles positive anticlockwise,
and results tell what body a does to body b: the force at point b in the ground frame and the moment about point b,
positive anticlockwise (`dynamics.joint_loads`). A motor's positive torque or force acts on body b so that the
coordinate grows.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from enum import Enum
from typing import Any, ClassVar

from paraflex.arguments import CheckedFields, checked_arguments, given_as
from paraflex.errors import InputError
from paraflex.mechanism.laws import AngleLaw, check_motion
from paraflex.mechanism.quantities import AT_JOINT, JointThat, finite, optional, positive, said

GROUND = "ground"


@given_as("a point", 'a point, "body.point", say "link1.B1"')
@dataclass(frozen=True, order=True)
class PointRef(CheckedFields):
    """A named point of a body, or of the ground: written "link1.B1" or "ground.A1" in files."""

    _table = "point"

    body: str
    point: str

    @classmethod
    def taken_from(cls, given: object, field: str) -> PointRef | None:
        """A point from "body.point", or from the two names; None for anything else."""
        if isinstance(given, str):
            return cls.parse(given, str(field))
        if isinstance(given, tuple | list) and len(given) == 2:
            return cls(given[0], given[1])
        return None

    @classmethod
    @checked_arguments()
    def parse(cls, text: str, field: str = "point") -> PointRef:
        """Read "body.point".

        Raises
        ------
        InputError
            If the text is not of this form.
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

    Error:
        It fails, with what was computed until then.
    STOP
        It ends there, as at a limit of the joint, and has not failed.
    WARN
        The run continues with extrapolated deflections, and the result has a finding.
    IGNORE
        It goes on and says nothing.
    """

    ERROR = "error"
    STOP = "stop"
    WARN = "warn"
    IGNORE = "ignore"


# Kinds of joints by their names in files.
JOINT_KINDS: dict[str, type[Joint]] = {}
_SYMBOLS = {("points",): "pin", ("points", "angle"): "weld", ("axis", "angle"): "slider", ("axis",): "slot"}


class _Directions:
    """Default of joints without this field."""

    direction: float = 0.0
    angle: float = 0.0
    length: float | None = 0.0
    at_end: AtEnd = AtEnd.IGNORE


@given_as("a joint", "a joint of any kind, say RevoluteJoint")
@dataclass(frozen=True)
class Joint(CheckedFields, _Directions):
    """A joint between point a of one body and point b of another: the base of all kinds.

    A subclass is a kind, `class SlotJoint(Joint, kind="slot", holds=("axis",))`: files, equations, drawings and checks
    know it by that. Its own fields, `direction`, `angle` and others, say in their metadata what files say of them.

    Attributes
    ----------
    name : str
    a, b : PointRef
    kind : str
        The name in files.
    holds : tuple of str
        "points", which it holds together (two constraints); an "axis" through point a, at `direction` against body a,
        that it keeps point b on (one); the "angle" of body b against body a, kept at `angle` (one); the "distance" of
        point b from point a, kept at `length` (one).
    follows_beam : bool
        Whether its axis is the centre line of a's beam, bent as it is; else it turns with the material at a.
    symbol : str
        How it is drawn: a name of `plots.marks.SYMBOLS`, by default that of a joint which holds the same.
    slides, moves : bool
        Whether its coordinate is a travel along its axis [m], else the angle of b against a [rad]; whether that is
        free.
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
        cls.kind, cls.holds, cls.follows_beam = kind, holds, follows_beam
        cls.slides = "axis" in holds
        cls.moves = cls.slides or not {"angle", "distance"}.intersection(holds)
        cls.symbol = symbol or _SYMBOLS.get(holds, kind)
        JOINT_KINDS[kind] = cls

    def check_moves(self, field: str, does: JointThat = "moves") -> None:
        """Check that the joint has a free angle or travel, or the one that is required, if any is.

        Raises
        ------
        InputError
            It has none, as a weld, or the other.
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
    """Points that the fields of a member name."""
    return {each.name: at for each in fields(member) if isinstance(at := getattr(member, each.name), PointRef)}


@dataclass(frozen=True)
class RevoluteJoint(Joint, kind="revolute", holds=("points",)):
    """A joint at which two points coincide: p_b - p_a = 0.

    The joint's angle is that of body b relative to body a (or to the ground), each turned by the slope of its
    beam at the joint.
    """


_DIRECTION = said("the angle of its axis against the first body in rad", finite)
_LENGTH = said("the distance that it keeps in m, by default as the first assembly stands", positive, "m")
_ANGLE = said("the angle of the second body against the first in rad", finite)


@dataclass(frozen=True)
class PrismaticJoint(Joint, kind="prismatic", holds=("axis", "angle")):
    """Body b slides along an axis that body a carries, and does not turn against it.

    The axis goes through point a, at `direction` against body a's x axis there (against the ground's, on the ground);
    on a beam it turns with the slope at a. The joint's coordinate is its travel: how far point b is along the axis [m].

    Attributes
    ----------
    direction : float
        Of the axis against body a [rad].
    angle : float
        Of body b against body a, constant [rad]; slopes of beams included.
    """

    direction: float = field(default=0.0, metadata=_DIRECTION)
    angle: float = field(default=0.0, metadata=_ANGLE)


@dataclass(frozen=True)
class SlotJoint(Joint, kind="slot", holds=("axis",)):
    """A pin in a slot: point b stays on an axis through point a of body a, and body b turns freely.

    The axis is that of a `PrismaticJoint`, and so is the joint's coordinate.
    """

    direction: float = field(default=0.0, metadata=_DIRECTION)


@dataclass(frozen=True)
class SlidingJoint(Joint, kind="sliding", holds=("axis",), symbol="sliding", follows_beam=True):
    """Point b slides along the centre line of a deformed beam, and body b turns freely.

    Point a says which beam. The joint's coordinate is how far point b is beyond point a along the x axis of the beam's
    frame [m]. Deflections are taken where the point stands in the undeformed beam, as a linear theory does.

    Attributes
    ----------
    at_end : AtEnd or str
        What a run does where point b comes to an end of the beam; a value is taken for the member.
    """

    at_end: AtEnd = optional(  # noqa: RUF009 - a field
        AtEnd.ERROR, 'where a sliding point comes to the end of its beam: "error", "stop", "warn" or "ignore"'
    )


@dataclass(frozen=True)
class WeldJoint(Joint, kind="weld", holds=("points", "angle")):
    """Two points coincide, and body b has a constant angle [rad] against body a, slopes of beams included."""

    angle: float = field(default=0.0, metadata=_ANGLE)


@dataclass(frozen=True)
class DistanceJoint(Joint, kind="distance", holds=("distance",), symbol="rod"):
    """A massless rod between pins: points a and b keep their distance, |p_b - p_a| = length.

    The bodies turn freely. The multiplier of its row is the axial force of the rod [N], tension positive.

    Attributes
    ----------
    length : float, optional
        Of the rod [m]. By default as the first assembly stands; a mechanism has the number.
    """

    length: float | None = field(default=None, metadata=_LENGTH)


@dataclass(frozen=True)
class PrescribedAngle(CheckedFields):
    """A rheonomic constraint: the angle of a revolute joint follows a law in time."""

    _table = "prescribed"

    name: str
    joint: str = field(metadata=AT_JOINT)
    law: AngleLaw

    def __post_init__(self) -> None:
        super().__post_init__()
        try:
            check_motion(self.law)
        except InputError as error:
            raise error.within(f"prescribed.{self.name}") from None


@dataclass(frozen=True)
class Motor(CheckedFields):
    """A motor at a revolute joint; positive torque turns body b of the joint relative to body a.

    The torque acts on the material at the joint: on the body's angle and on the slope of the beam there.
    """

    _table = "motor"

    name: str
    joint: str = field(metadata=AT_JOINT)
