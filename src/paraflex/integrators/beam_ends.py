"""Points that reach the ends of their beams: refused at the start, detected in a run, reported after it."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from paraflex.arrays import Array
from paraflex.dynamics import State, System
from paraflex.errors import InputError, Moment, UnreachablePathError
from paraflex.findings import Finding
from paraflex.mechanism import AtEnd
from .event_functions import EventFunction, beam_end_functions
from .events import BeamEnd

if TYPE_CHECKING:
    from .crossing import Crossing


@dataclass(frozen=True)
class Departure:
    """Point that reaches the end of its beam, with the time [s]."""

    function: EventFunction
    time: float


class BeamEnds:
    """Events of a run at the ends of beams, and the points that have left their beams.

    Parameters
    ----------
    system : System
        System of the run.
    start : State
        Initial state.

    Raises
    ------
    InputError
        A point is off its beam at the start, and its joint does not let the run go on.
    """

    def __init__(self, system: System, start: State) -> None:
        self._left: tuple[Departure, ...] = ()
        within = []
        for function in beam_end_functions(system):
            if function.inside(start.q[None])[0] > 0.0:
                within.append(function)
            elif function.ends_run:
                raise _off_at_start(function, start.time, start.q)
            else:
                self._left += (Departure(function, start.time),)
        self.functions: tuple[EventFunction, ...] = tuple(within)

    def after_crossing(
        self, crossing: "Crossing", functions: Sequence[EventFunction]
    ) -> "tuple[tuple[EventFunction, ...], Crossing | None]":
        """Return the events that remain after a crossing, and the crossing that ends the run in this step or None."""
        # Plans check their motions without running anything.
        from .crossing import first_crossing

        left, found = tuple(functions), crossing
        while found is not None and not found.function.ends_run:
            self._left += (Departure(found.function, found.t),)
            left = tuple(function for function in left if function is not found.function)
            found = first_crossing(left, found.before, found.after)
        return left, found

    def findings(self, q: Array) -> tuple[Finding, ...]:
        """Return a finding for each point that left its beam; the samples q (k, n) give its distance."""
        return tuple(_finding(one, one.function.value(q)) for one in self._left)


# Remedy for a point at the end of its beam if the joint has at_end = "error".
STAY_ON_BEAM = 'lengthen the beam, or let the run go on with at_end = "warn"'


def leave_beam(system: System, t: Array, q: Array, v: Array) -> tuple[Finding, ...]:
    """Return findings on points that leave their beams in a motion at samples t, q, v, with cubics between samples.

    Raises
    ------
    UnreachablePathError
        A point leaves a beam whose joint has at_end = "error".
    """
    departures = list(_departures(system, t, q, v))
    for one, k in departures:
        end = one.function.event
        assert isinstance(end, BeamEnd)
        if end.at_end is AtEnd.ERROR:
            moment = Moment(one.time, k)
            raise UnreachablePathError(_planned(end, one.function.value(q)), moment, remedy=STAY_ON_BEAM)
    return _continuing(departures, q)


def beyond_ends(system: System, t: Array, q: Array, v: Array) -> tuple[Finding, ...]:
    """Return findings on points that continue beyond the ends of their beams, in a motion at samples t, q, v."""
    return _continuing(_departures(system, t, q, v), q)


def end_of_motion(system: System, t: Array, q: Array, v: Array) -> Departure | None:
    """Return the first point to reach the end of its beam in a motion at samples t, q, v, if that ends it, else None.

    Raises
    ------
    InputError
        The point is off its beam at the start.
    """
    ending = [(one, k) for one, k in _departures(system, t, q, v) if one.function.ends_run]
    for one, k in ending:
        if k == 0:
            raise _off_at_start(one.function, one.time, q[0])
    return min((one for one, _ in ending), key=lambda one: one.time, default=None)


def _continuing(departures: Iterable[tuple[Departure, int]], q: Array) -> tuple[Finding, ...]:
    return tuple(_finding(one, one.function.value(q)) for one, _ in departures if not one.function.ends_run)


def _departures(system: System, t: Array, q: Array, v: Array) -> Iterator[tuple[Departure, int]]:
    """Yield points that leave their beams in a motion, each with the first sample outside."""
    for function in beam_end_functions(system):
        outside = np.nonzero(function.inside(q) <= 0.0)[0]
        if outside.size:
            k = int(outside[0])
            yield Departure(function, float(t[0]) if k == 0 else _first_outside(function, t, q, v, k)), k


def _first_outside(function: EventFunction, t: Array, q: Array, v: Array, k: int) -> float:
    """Return the time at which a motion reaches a bound between its samples k - 1 and k."""
    path = scipy.interpolate.CubicHermiteSpline(t[k - 1 : k + 1], q[k - 1 : k + 1], v[k - 1 : k + 1])

    def inside(time: float) -> float:
        return float(function.inside(path(time)[None])[0])

    return float(scipy.optimize.brentq(inside, t[k - 1], t[k]))


def _planned(end: BeamEnd, places: Array) -> str:
    far = places[np.argmax(np.abs(places - 0.5 * end.length))]
    return (
        f"the path takes joint {end.joint} as far as {far:.6g} m from the first end of its beam {end.beam}, which is "
        f'{end.length:.6g} m long (at_end = "error"): it comes to the end'
    )


def _off_at_start(function: EventFunction, time: float, q: Array) -> InputError:
    end = function.event
    assert isinstance(end, BeamEnd)
    place = float(function.value(q[None])[0])
    return InputError(
        f"its point is off the beam at the start, t = {time:.6g} s: {place:.6g} m from the first end of "
        f"{end.beam}, which is {end.length:.6g} m long",
        field=f"joint.{end.joint}",
        remedy='start within the beam, lengthen it, or let the run go on with at_end = "warn"',
    )


def _finding(one: Departure, places: Array) -> Finding:
    end = one.function.event
    assert isinstance(end, BeamEnd)
    beyond = np.maximum(-places, places - end.length)
    far = f", as far as {places[np.argmax(beyond)]:.6g} m from its first end" if np.max(beyond, initial=0.0) > 0 else ""
    return Finding(
        "slider-off-beam",
        f"joint.{end.joint}",
        f"its point leaves {end.beam}, {end.length:.6g} m long, at t = {one.time:.6g} s{far}: deflections there are "
        "extrapolated",
        'lengthen the beam, or end runs there with at_end = "stop" or "error"',
    )
