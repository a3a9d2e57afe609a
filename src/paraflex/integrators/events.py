"""Events that end a run: a joint at its limit, the deflection of a link at its limit, a nearby singular position."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from paraflex.arguments import CheckedFields, named_in_errors
from paraflex.errors import InputError
from paraflex.mechanism import AtEnd, FlexibleBeam, Mechanism, RigidBody
from paraflex.mechanism.quantities import known


@dataclass(frozen=True)
class JointLimit(CheckedFields):
    """Limits of a joint: the run ends when its coordinate reaches one of them.

    Attributes
    ----------
    joint : str
        Name of the joint.
    low, high : float
        Lower and upper limit, either may be infinite. Limits of a revolute joint are angles [rad]: that of body b less
        that of body a, slopes of beams included, counted through whole turns from the angles at the start. Limits of a
        joint that slides are travels [m].
    """

    joint: str
    low: float = -math.inf
    high: float = math.inf

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.low < self.high or (math.isinf(self.low) and math.isinf(self.high)):
            raise InputError(
                "the lower limit is not below the upper one, or both are missing", field=f"limit of joint {self.joint}",
                value=(self.low, self.high), remedy="give a lower limit, a higher upper one, or one of them",
            )  # fmt: skip

    def __str__(self) -> str:
        return f"joint {self.joint}"


@dataclass(frozen=True)
class DeflectionLimit(CheckedFields):
    """Limit of the deflection of a link.

    Attributes
    ----------
    body : str
        Name of the flexible body.
    limit : float
        Largest deflection [m], measured from the chord, the line from the first end to the last, for any reference
        condition. It is evaluated at ends and quarters of every element; for a modal body at its points, from their
        undeformed positions relative to the line from the first to the last.
    """

    body: str
    limit: float

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (math.isfinite(self.limit) and self.limit > 0.0):
            raise InputError(
                "must be positive", field=f"deflection limit of {self.body}", value=self.limit,
                remedy="give a length in metres",
            )  # fmt: skip

    def __str__(self) -> str:
        return f"deflection of {self.body}"


@dataclass(frozen=True)
class SingularDistance(CheckedFields):
    """Limit of the distance from a singular position.

    Attributes
    ----------
    distance : float
        Dimensionless distance between 0 and 1: see `dynamics.SingularityMeasure`.
    motors : tuple of str
        Names of motors held, for a Type II singularity of these motors; empty for a singularity of the constraints.
    """

    distance: float
    motors: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 < self.distance < 1.0:
            raise InputError(
                "not between 0 and 1", field="distance from singular positions", value=self.distance,
                remedy="choose it from 0 (singular) to 1 (all constraints independent), say 0.05",
            )  # fmt: skip

    def __str__(self) -> str:
        held = f" of {', '.join(self.motors)}" if self.motors else ""
        return f"singular position{held}"


@dataclass(frozen=True)
class BeamEnd:
    """Ends of the beam along which a joint slides, an event of every run unless the joint ignores it.

    Attributes
    ----------
    joint : str
        Name of the joint.
    beam : str
        Name of the beam.
    length : float
        Length of the beam [m].
    at_end : AtEnd
        Action of the run at the end.
    """

    joint: str
    beam: str
    length: float
    at_end: AtEnd

    def __str__(self) -> str:
        return f"joint {self.joint} at the end of {self.beam}"


Event = JointLimit | DeflectionLimit | SingularDistance
named_in_errors("an event")(Event)


def beam_ends(mechanism: Mechanism) -> tuple[BeamEnd, ...]:
    """Return the ends of the beams along which joints slide, without joints that ignore them."""
    found = []
    for joint in mechanism.joints:
        if joint.at_end is not AtEnd.IGNORE:
            beam = mechanism.body(joint.a.body)
            assert isinstance(beam, FlexibleBeam)
            found.append(BeamEnd(joint.name, beam.name, beam.length, joint.at_end))
    return tuple(found)


def check_events(mechanism: Mechanism, events: Sequence[Event]) -> None:
    """Check that a mechanism can have these events.

    Raises
    ------
    InputError
        A name is not one of the mechanism's, a joint cannot move, or a body cannot bend.
    """
    for event in events:
        if isinstance(event, JointLimit):
            known(event.joint, [joint.name for joint in mechanism.joints], "events", "joint")
            mechanism.joint(event.joint).check_moves("events")
        elif isinstance(event, DeflectionLimit):
            known(event.body, [body.name for body in mechanism.bodies], "events", "body")
            body = mechanism.body(event.body)
            if isinstance(body, RigidBody) or not body.flexible:
                raise InputError("a rigid body does not bend", field="events", value=event.body, remedy="leave it out")
        elif isinstance(event, SingularDistance):
            for name in event.motors:
                known(name, [motor.name for motor in mechanism.motors], "events", "motor")
        else:
            raise InputError(
                "not an event", field="events", value=event,
                remedy="give JointLimit, DeflectionLimit or SingularDistance",
            )  # fmt: skip
