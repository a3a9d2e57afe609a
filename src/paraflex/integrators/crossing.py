"""Marching to the first event: detected within each step and located there, with the state at the event."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy

from paraflex.arrays import Array
from paraflex.dynamics import State
from paraflex.kernel.bodies import weight_work
from paraflex.kernel.packed import make_scratch
from paraflex.kernel.run_state import PAUSED, Samples
from .event_functions import EventFunction
from .native import NativeRun, prepare
from .options import IntegrationOptions
from .run import Instant, Problem, Run

# Fractions of a step at which events are checked, its end last; an excursion between two of them is missed.
_PLACES = np.array([0.25, 0.5, 0.75, 1.0])
# Events are checked within a step if the distance from the bounds is at most this many times its changes in this step
# and the previous one: a parabola that turns within the step changes in one of them by more than its excursion.
_NEAR_BOUND = 4.0
# Accuracy of the location of an event, as a fraction of the step.
_EVENT_ACCURACY = 1e-13


@dataclass(frozen=True)
class Crossing:
    """Event within a step.

    Attributes
    ----------
    function : EventFunction
        Event function that crosses a bound.
    before, after : Instant
        Ends of the step.
    fraction : float
        Fraction of the step at which the event occurs.
    """

    function: EventFunction
    before: Instant
    after: Instant
    fraction: float

    @property
    def t(self) -> float:
        """Time of the event [s]."""
        return self.before.t + self.fraction * (self.after.t - self.before.t)

    @property
    def reached(self) -> str:
        """Description of the limit that was reached."""
        return self.function.reached(_poses(self.before, self.after, self.fraction)[0])

    @property
    def message(self) -> str:
        """Description of the limit that was reached, with the time."""
        return f"{self.reached} at t = {self.t:.6g} s"


def advance(run: Run, functions: Sequence[EventFunction], attempts: int) -> tuple[int, Crossing | None]:
    """March by a number of attempted steps, or to the first event in them.

    Returns the code of the last step, and the event or None.
    """
    if not functions:
        return run.march(attempts), None
    code, before = PAUSED, run.now()
    inside = _inside(functions, before)
    change = np.full(inside.size, np.inf)
    for _ in range(attempts):
        code = run.march(1)
        after = run.now()
        if after.t > before.t:
            then, last_change = inside, change
            inside = _inside(functions, after)
            change = np.abs(inside - then)
            near = np.minimum(inside, then) <= _NEAR_BOUND * (change + last_change)
            found = first_crossing([function for function, x in zip(functions, near, strict=True) if x], before, after)
            if found is not None:
                return code, found
        if code != PAUSED:
            break
        before = after
    return code, None


def _inside(functions: Sequence[EventFunction], instant: Instant) -> Array:
    """Return the distance of each function from its bounds, positive inside."""
    return np.array([function.inside(instant.q[None])[0] for function in functions])


def first_crossing(functions: Sequence[EventFunction], before: Instant, after: Instant) -> Crossing | None:
    """Return the first event of a step that starts inside all bounds, or None."""
    found = []
    for function in functions:
        outside = np.nonzero(function.inside(_poses(before, after, _PLACES)) <= 0.0)[0]
        if outside.size:
            last = float(_PLACES[outside[0]])
            first = float(_PLACES[outside[0] - 1]) if outside[0] else 0.0
            found.append(Crossing(function, before, after, _root(function, before, after, first, last)))
    return min(found, key=lambda crossing: crossing.fraction, default=None)


def samples_until(run: Run, crossing: Crossing) -> Samples:
    """Return the samples before an event, and the state at the event as the last one.

    Positions and velocities are interpolated by cubics through both ends of the step; accelerations and multipliers
    follow from the equations of motion.
    """
    problem, x = run.problem, crossing.fraction
    taken = run.samples.times[: run.reached]
    kept = slice(0, int(np.searchsorted(taken, crossing.t)))
    before = crossing.before
    first = _begun_at(problem, before.t, before.q, before.v)
    # Accelerations jump with the inputs; the step began with the accelerations after the jump.
    before = replace(before, a=first.samples.a[0])
    middle, last = (_begun_at(problem, *_state(before, crossing.after, part)) for part in (0.5 * x, x))
    # Simpson's rule is accurate, as powers jump only at the ends of steps.
    powers = [one.state.power[0] for one in (first, middle, last)]
    width = crossing.t - before.t
    work = before.work + width / 6.0 * (powers[0] + 4.0 * powers[1] + powers[2])
    packed = problem.system.packed
    scratch, end = make_scratch(packed), last.samples
    work += weight_work(packed, end.q[0], scratch) - weight_work(packed, problem.initial.q, scratch)
    end.energy[0, 2] = work
    joined: list[Any] = [np.concatenate([old[kept], new]) for old, new in zip(run.samples, end, strict=True)]
    return Samples(*joined)


def _begun_at(problem: Problem, t: float, q: Array, v: Array) -> NativeRun:
    """Return a run started from a state, used only for its first sample and the power there."""
    moment = {"times": np.array([t]), "stops": np.array([t + problem.span]), "stored": np.ones(1, dtype=bool)}
    here = replace(problem, initial=State(t, q, v), **moment)
    begun = prepare(here, IntegrationOptions(alpha=0.0, beta=0.0))
    begun.start()
    return begun


def _state(before: Instant, after: Instant, x: float) -> tuple[float, Array, Array]:
    """Return time, positions and velocities at a fraction of a step, by cubics."""
    h = after.t - before.t
    v = _cubic(before.v, before.a, after.v, after.a, h, x)
    return before.t + x * h, _cubic(before.q, before.v, after.q, after.v, h, x), v


def _poses(before: Instant, after: Instant, fractions: Array | float) -> Array:
    """Return positions (k, n) at fractions of a step."""
    x = np.atleast_1d(fractions)[:, None]
    return _cubic(before.q, before.v, after.q, after.v, after.t - before.t, x)


def _cubic(y0: Array, dy0: Array, y1: Array, dy1: Array, h: float, x: Array | float) -> Array:
    """Return the cubic with values y and derivatives dy at both ends of an interval h, at fractions x of it."""
    y = 1.0 - x
    return y * y * ((1.0 + 2.0 * x) * y0 + h * x * dy0) + x * x * ((1.0 + 2.0 * y) * y1 - h * y * dy1)


def _root(function: EventFunction, before: Instant, after: Instant, first: float, last: float) -> float:
    """Return the fraction of a step at which the bound is reached, between a fraction inside and one outside."""

    def inside(x: float) -> float:
        return float(function.inside(_poses(before, after, x))[0])

    return float(scipy.optimize.root_scalar(inside, bracket=(first, last), method="brentq", xtol=_EVENT_ACCURACY).root)
