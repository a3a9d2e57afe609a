"""Pace of a run: a run whose steps become so small that it would hardly end is stopped early."""

import math
from collections import deque

import numpy as np

from paraflex.dynamics import SingularityMeasure, System
from paraflex.mechanism import RigidBody
from .run import Instant
from .watch import Breakdown

# Default limit of the number of steps of a run.
MOST_STEPS = 10_000_000
# A run that would need this many times the allowed steps is stopped early; the margin is for runs that become faster.
_STEPS_MARGIN = 5.0
# Without a limit from the user, a run is also stopped if it would need this many steps and has become slower by this
# factor. The library's mechanisms take at most 45 thousand steps with their own options, 260 thousand at 1e-7 m by
# TR-BDF2, and none becomes more than 25 times slower.
_SLOW_STEPS, _TIMES_SLOWER = 1_000_000, 100.0
# Number of first steps that are left out of the pace, as they are small.
_FIRST_STEPS = 200
# A singular position nearer than this is reported.
_NEAR_SINGULAR = 1e-2
# Largest number of beams without damping that are listed by name.
_NAMED = 3


class Pace:
    """Attempted steps and times reached, in a window of the last attempts.

    Parameters
    ----------
    start, end : float
        Start and end of the run [s].
    most : int or None
        Largest number of steps that the user allows; None for the default limits.
    window : int
        Number of attempts over which the pace is computed: seconds of computing for a dozen bodies.
    """

    def __init__(self, start: float, end: float, most: int | None, window: int) -> None:
        self._start, self._end, self._most, self._window = start, end, most, window
        self._looks: deque[tuple[int, float]] = deque([(0, start)])
        self._usual = math.inf

    @property
    def most(self) -> int:
        """Number of steps after which the run is stopped."""
        return MOST_STEPS if self._most is None else self._most

    @property
    def step(self) -> float:
        """Mean step size attempted in the window [s]."""
        (first, then), (last, now) = self._looks[0], self._looks[-1]
        return (now - then) / max(1, last - first)

    @property
    def expected(self) -> float:
        """Expected number of steps of the whole run at the pace of the window; infinite if time does not advance."""
        attempts, now = self._looks[-1]
        return attempts + (self._end - now) / self.step if self.step > 0.0 else math.inf

    def look(self, attempts: int, now: float) -> bool:
        """Record the progress of the run; return whether it should be stopped."""
        self._looks.append((attempts, now))
        while attempts - self._looks[1][0] >= self._window:
            self._looks.popleft()
        if attempts >= _FIRST_STEPS and now > self._start:
            self._usual = min(self._usual, attempts / (now - self._start))
        if attempts - self._looks[0][0] < self._window:
            return False
        if self.expected > _STEPS_MARGIN * self.most:
            return True
        return self._most is None and self.expected > _SLOW_STEPS and self.step * self._usual * _TIMES_SLOWER < 1.0


def too_slow(system: System, now: Instant, start: np.ndarray, pace: Pace, jumps: np.ndarray) -> Breakdown:
    """Return the reason for stopping a run early and the remedy.

    The reason has the size of its steps, the fastest body, and the inputs that jumped before.
    """
    needed = f"about {pace.expected:.2g}" if math.isfinite(pace.expected) else "infinitely many"
    excited = _excited(system, now, jumps)
    remedy = (
        "give beams damping, say damping = { ratios = [0.01] }, or let jumps rise over some milliseconds; else choose"
        if excited
        else "choose a motion that turns links more slowly,"
    )
    return Breakdown(
        f"steps are down to {pace.step:.2g} s, and at this pace the run would need {needed} of them: "
        f"{_fastest(system, now)}{_singular(system, now, start)}{excited}; given up",
        f"{remedy} a coarser tolerance, or allow more steps (max_steps)",
    )


def _excited(system: System, now: Instant, jumps: np.ndarray) -> str:
    """Return a remark on the last jump of loads or torques before now, if there are beams without damping."""
    before = jumps[jumps <= now.t]
    beams = [body for body in system.mechanism.bodies if not isinstance(body, RigidBody) and body.damping is None]
    if not before.size or not beams:
        return ""
    named = ", ".join(body.name for body in beams[:_NAMED]) + (" and others" if len(beams) > _NAMED else "")
    return f"; loads or torques jumped at t = {before[-1]:.6g} s, and the vibrations since in {named} have no damping"


def _fastest(system: System, now: Instant) -> str:
    """Describe the body with the largest acceleration, of its angle or of its position over its size, and its speed."""
    parts = [(i, j) for i in range(len(system.bodies)) for j in range(3)]
    columns = [system.bodies[i].offset + j for i, j in parts]
    worst = int(np.argmax(np.abs(now.a[columns]) / system.units[columns]))
    body, turns = system.bodies[parts[worst][0]], parts[worst][1] == 2
    place = [body.angle] if turns else list(range(body.position.start, body.position.stop))
    speed, acceleration = (float(np.linalg.norm(x[place])) for x in (now.v, now.a))
    what, unit = ("turns", "rad") if turns else ("moves", "m")
    return f"{body.name} {what} at {speed:.3g} {unit}/s and accelerates by {acceleration:.2g} {unit}/s^2"


def _singular(system: System, now: Instant, start: np.ndarray) -> str:
    """Return a remark on the distance from a singular position of the constraints, if one is near."""
    measure = float(SingularityMeasure(system, start)(now.q[None])[0])
    return f", {measure:.1g} from a singular position of the constraints" if measure < _NEAR_SINGULAR else ""
