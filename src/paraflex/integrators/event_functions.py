"""Event functions: a function of the pose for each event, and its bounds."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np

from paraflex.arrays import Array
from paraflex.dynamics import (
    BodyCoordinates,
    SingularityMeasure,
    System,
    across_chord,
    joint_coordinate,
    place_along_beam,
)
from paraflex.errors import InputError
from paraflex.fem import slope_square_integrals
from paraflex.mechanism import AtEnd
from .events import BeamEnd, DeflectionLimit, Event, JointLimit, beam_ends, check_events

# Number of points within an element at which the deflection is evaluated, its last end included.
_PLACES = 4
# Tolerance for a point at the end of its beam, as a fraction of the length: rounding and errors of closure.
_AT_END = 1e-9
# Least number of points for a deflection: two points are always on their chord.
_LEAST_ON_LINE = 3


@dataclass(frozen=True)
class EventFunction:
    """Function of the pose that defines an event, and its bounds.

    Attributes
    ----------
    event : Event or BeamEnd
        Event that the function defines.
    value : callable
        Function that maps poses (k, n) to values (k,).
    low, high : float
        Lower and upper bound, may be infinite.
    unit : str
        Unit of the values, empty for a dimensionless one.
    """

    event: Event | BeamEnd
    value: Callable[[Array], Array]
    low: float
    high: float
    unit: str

    @property
    def ends_run(self) -> bool:
        """Whether the event ends the run."""
        return not (isinstance(self.event, BeamEnd) and self.event.at_end is AtEnd.WARN)

    def inside(self, q: Array) -> Array:
        """Return the distance of poses (k, n) from the bounds (k,), positive inside, zero at the event."""
        value = self.value(q)
        return np.minimum(value - self.low, self.high - value)

    def reached(self, q: Array) -> str:
        """Describe the limit that is reached at a pose (n,)."""
        event, value = self.event, float(self.value(q[None])[0])
        if isinstance(event, JointLimit):
            lower = value - self.low < self.high - value
            side, bound = ("lower", self.low) if lower else ("upper", self.high)
            return f"{event} reached its {side} limit {bound:g} {self.unit}"
        if isinstance(event, BeamEnd):
            place = min(max(value, 0.0), event.length)
            return (
                f"joint {event.joint} came to the end of its beam {event.beam}, {place:.6g} m from its first end "
                f'(at_end = "{event.at_end.value}"),'
            )
        if isinstance(event, DeflectionLimit):
            return f"the {event} reached its limit {self.high:g} {self.unit}"
        return f"a {event} came as near as {self.low:g}"


def event_functions(system: System, q: Array, events: Sequence[Event]) -> tuple[EventFunction, ...]:
    """Return one function for each event, for runs that start at q (n,).

    Raises
    ------
    InputError
        The events are not valid (see `check_events`), or the start is not inside the bounds.
    """
    check_events(system.mechanism, events)
    functions = tuple(_event_function(system, q, event) for event in events)
    for function in functions:
        if not function.inside(q[None])[0] > 0.0:
            value, unit = float(function.value(q[None])[0]), f" {function.unit}" if function.unit else ""
            bounds = {"above": function.low, "below": function.high}
            range_text = " and ".join(f"{side} {x:g}{unit}" for side, x in bounds.items() if math.isfinite(x))
            raise InputError(
                f"the run would start outside the limits of {function.event}", field="events", value=value,
                remedy=f"start {range_text}, or move the limit",
            )  # fmt: skip
    return functions


def beam_end_functions(system: System) -> tuple[EventFunction, ...]:
    """Return functions for the places of points that slide along beams, with bounds 0 and the length of the beam."""
    functions = []
    for end in beam_ends(system.mechanism):
        margin = _AT_END * end.length
        place = partial(place_along_beam, system, end.joint)
        functions.append(EventFunction(end, place, -margin, end.length + margin, "m"))
    return tuple(functions)


def _event_function(system: System, q: Array, event: Event) -> EventFunction:
    if isinstance(event, JointLimit):
        unit = "m" if system.mechanism.slides(event.joint) else "rad"
        return EventFunction(event, _joint_value(system, event.joint), event.low, event.high, unit)
    if isinstance(event, DeflectionLimit):
        return EventFunction(event, _deflection(system, event.body), -math.inf, event.limit, "m")
    return EventFunction(event, SingularityMeasure(system, q, event.motors), event.distance, math.inf, "")


def _joint_value(system: System, joint: str) -> Callable[[Array], Array]:
    """Return a function for the angle or travel of a joint; an angle is linear in the coordinates."""
    if system.mechanism.slides(joint):
        return lambda q: joint_coordinate(system, joint, q).value
    row = joint_coordinate(system, joint, np.zeros((1, system.n))).rows[0]
    return lambda q: q @ row


def _deflection(system: System, name: str) -> Callable[[Array], Array]:
    """Return a function for the largest deflection along a body from its chord."""
    body = system.body(name)
    rest, rows, shortening = deflection_rows(body)
    if len(rest) < _LEAST_ON_LINE or np.all(rest[0] == rest[-1]):
        raise InputError(
            "a deflection is from the line between first and last point, which takes three points", field="events",
            value=name, remedy="give the body a point between, or leave the limit out",
        )  # fmt: skip

    def value(q: Array) -> Array:
        u = q[:, body.flexible]
        places = rest + np.tensordot(u, rows, (1, 2))
        if shortening is not None:
            places[:, :, 0] -= 0.5 * shortening(u)
        return np.max(np.abs(across_chord(places, rest)), axis=1)

    return value


def deflection_rows(body: BodyCoordinates) -> tuple[Array, Array, Callable[[Array], Array] | None]:
    """Return the points for a flexible body's deflection, and their displacement rows in the body frame.

    The points are ends and quarters of the elements of a beam, points along a bar of given shapes, or the points of a
    modal body. The result has their undeformed positions (places, 2) [m], their displacements per modal coordinate
    (places, 2, nf), and in second-order geometry a function that maps modal coordinates (k, nf) to int_0^x (N2' u)^2 dx
    (k, places) [m], else None.
    """
    D, mesh = body.integrals.D, body.mesh
    if mesh is not None:
        inner = [np.linspace(a, b, _PLACES + 1)[1:] for a, b in pairwise(mesh.nodes)]
        x = np.concatenate([mesh.nodes[:1], *inner])
        rows = np.array([mesh.shape_at(float(place))[0] @ D for place in x])
        shortening = None if body.points is None else slope_square_integrals(mesh, D, x)
        return np.column_stack([x, np.zeros_like(x)]), rows, shortening
    points = body.shape.line or tuple(body.shape.points.values())
    rest = np.array([point.x0 for point in points]).reshape(-1, 2)
    return rest, np.array([point.N @ D for point in points]).reshape(-1, 2, body.nf), None
