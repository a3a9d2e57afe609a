"""Passing a singular position, where for an instant constraints depend on one another.

A row of four-bars falls through the position with all links in line, say. Its coordinates are smooth there, but the
multipliers of the rows that become dependent have a pole: they grow as one over the distance and come back with the
other sign. Newton's iteration cannot follow, for its matrix is that of the start of a step, and a step that is cut has
it nearer to the pole. So where a run fails or creeps, it goes back to where rows were well apart and on, step by step,
to within two steps of the pole. From there the accelerations are extrapolated to the other side and integrated over,
coordinates and velocities are put on the constraints, and the run goes on.

Extrapolation stays on the branch the motion is on. Other branches meet there; the equations cannot tell which one is
meant, smoothness does.
"""

from __future__ import annotations

from collections import deque
from copy import deepcopy
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from paraflex.dynamics import project_position, project_velocity
from paraflex.dynamics.state import point_position
from paraflex.errors import NumericalError
from paraflex.kernel.bodies import system_energy, weight_work
from paraflex.kernel.linear import factor_system, mass_norm
from paraflex.kernel.packed import CONSTRAINT, SPRING, Workspace
from paraflex.kernel.run_state import FINISHED, PAUSED, REJECTED, SAMPLE, STEP, STEPS, TIME, WEIGHT_0, WORK, March

if TYPE_CHECKING:
    from paraflex.integrators.esdirk import Run

Array = NDArray[np.float64]

# How far rows are apart: the independent part of the closest one, as a fraction of the largest it has had. Above the
# first a state is one to go back to, below the second a run that goes on is taken to creep.
_CLEAR, _NEAR = 3e-2, 1e-3
# Accelerations are extrapolated from three states so many steps apart.
_APART = 3
# The run leaps from the last state that is this many steps before the pole, once it is within one more.
_BEFORE = 1.0
# Steps remembered before the pole: those that were cut are short.
_KEPT = 100
# Replayed attempts, as a multiple of those that led to where the run stands; then it is not this that stops it.
_PATIENCE = 2


@dataclass
class Crossings:
    """Looks after singular positions of a run, between slices of its time loop.

    Attributes
    ----------
    run : Run
    tolerance : float
        Of the run [m]; a leap must not be further off.
    passed : list of float
        Times of singular positions passed [s].
    """

    run: Run
    tolerance: float
    passed: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._probe: Workspace = self.run.system.workspace()
        self._rows = self.run.system.packed.rows
        self._largest = np.zeros(self._rows.size)
        # The last two: one may be within a few steps of the pole.
        self._clear: deque[March] = deque(maxlen=2)
        self.look(PAUSED)

    def look(self, code: int) -> int:
        """After a slice that returned `code`: past a singular position if that is what the run meets; the new code."""
        if code == FINISHED or not self._rows.size:
            return code
        apart = self._rows_apart()
        if code == PAUSED and apart > _NEAR:
            if apart > _CLEAR:
                self._clear.append(_copied(self.run.state))
            return code
        return self._pass(code)

    def _rows_apart(self) -> float:
        """How far the closest constraint row is from following from those before it, 0 to 1."""
        system = self.run.system
        factor_system(system.packed, 0.0, self.run.state.q, self._probe)
        diagonal = self._probe.schur[self._rows["start"] + np.arange(self._rows.size) - self._rows["first"]]
        # Diagonals hold reciprocals, zero for dependent rows.
        own = np.divide(1.0, diagonal, out=np.zeros_like(diagonal), where=diagonal > 0.0)
        np.maximum(self._largest, own, out=self._largest)
        kept = (self._largest > 0.0) & (self._rows["kind"] == CONSTRAINT)
        return float(np.min(own[kept] / self._largest[kept], initial=1.0))

    def _pass(self, code: int) -> int:
        """Back to clear ground, on to the pole and over it; the code the run came with, where it cannot be passed."""
        if not self._clear:
            return code
        state, stuck = self.run.state, _copied(self.run.state)
        _restore(state, self._clear[0])
        # One try from here: what stops the run again before clear ground is something else.
        self._clear.clear()
        attempts = _PATIENCE * (_attempts(stuck) - _attempts(state)) + 100
        history: list[_Place] = [self._place()]
        for _ in range(attempts):
            steps = int(state.counts[STEPS])
            if self.run.march(1) != PAUSED:
                break
            if state.counts[STEPS] == steps:
                continue
            history = [*history[-_KEPT:], self._place()]
            leap = _leap(history)
            if leap is not None:
                if not self._over(*leap):
                    break
                return PAUSED
        _restore(state, stuck)
        return code

    def _place(self) -> _Place:
        state = self.run.state
        return _Place(
            float(state.clock[TIME]), state.q.copy(), state.v.copy(), state.stage_a[1, 0].copy(), self._rows_apart()
        )

    def _over(self, behind: list[_Place], pole: float, step: float) -> bool:
        """From the last of the places behind over the pole to as far beyond it; False where that is not accurate."""
        run, state = self.run, self.run.state
        here = behind[-1]
        there = 2.0 * pole - here.t
        if there >= run.stops[run.stops > state.clock[TIME] - step][0]:
            return False
        q, v, _ = _extrapolated(behind, there)
        rough, *_ = _extrapolated(behind, there, degree=1)
        # The rough one is worse by far: what it misses bounds what the other does.
        if not self._length(q - rough) <= self.tolerance:
            return False
        try:
            on = project_position(run.system, run.signals, there, q)
            rate = project_velocity(run.system, run.signals, there, on, v)
        except NumericalError:
            return False
        if not self._length(on - q) <= self.tolerance:
            return False
        self._land(behind, there, on, rate, step)
        self.passed.append(pole)
        return True

    def _length(self, x: Array) -> float:
        return float(mass_norm(self.run.system.packed, self._probe, x))

    def _land(self, behind: list[_Place], t: float, q: Array, v: Array, step: float) -> None:
        """Go on from (t, q, v), with the samples of the leap and its work."""
        run, state, here = self.run, self.run.state, behind[-1]
        power, lam = float(state.power[0]), state.stage_lam[0].copy()
        state.q[:], state.v[:] = q, v
        state.clock[TIME], state.clock[STEP] = t, step
        run.resume()
        work = 0.5 * (t - here.t) * (power + float(state.power[0]))
        i, out = int(state.counts[SAMPLE]), run.samples
        while i < out.times.size and out.times[i] <= t:
            x = (out.times[i] - here.t) / (t - here.t)
            out.q[i], out.v[i], out.a[i] = _extrapolated(behind, out.times[i])
            # Forces of springs are smooth; what the pole does to constraint forces no interpolation tells.
            out.lam[i] = np.where(self._rows["kind"] == CONSTRAINT, np.nan, (1.0 - x) * lam + x * state.stage_lam[0])
            self._note_energy(i, float(state.clock[WORK]) + x * work)
            i += 1
        state.counts[SAMPLE] = i
        state.clock[WORK] += work

    def _note_energy(self, i: int, work: float) -> None:
        system, out, points = self.run.system, self.run.samples, self._probe.points
        kinetic, strain = system_energy(system.packed, out.q[i], out.v[i], points)
        springs = self._rows["kind"] == SPRING
        strain += 0.5 * float(self._rows["compliance"][springs] @ out.lam[i, springs] ** 2)
        for spring in system.mechanism.linear_springs:
            a, b = (point_position(system, out.q[i], ref) for ref in (spring.a, spring.b))
            strain += 0.5 * spring.stiffness * (float(np.linalg.norm(b - a)) - spring.length) ** 2
        work += weight_work(system.packed, out.q[i], points) - self.run.state.clock[WEIGHT_0]
        out.energy[i] = kinetic, strain, work


@dataclass(frozen=True)
class _Place:
    """Where the run was at the end of a step, and how far the rows were apart."""

    t: float
    q: Array
    v: Array
    a: Array
    apart: float


def _leap(history: list[_Place]) -> tuple[list[_Place], float, float] | None:
    """The places to extrapolate from, the time of the pole ahead and the usual step; None while it is not so near."""
    if len(history) < 2 * _APART + 3:
        return None
    before, last = history[-2], history[-1]
    if not last.apart < before.apart:
        return None
    pole = last.t + (last.t - before.t) * last.apart / (before.apart - last.apart)
    # Steps that were cut are no measure.
    step = float(np.max(np.diff([place.t for place in history[-2 * _APART - 3 :]])))
    if pole - last.t > (_BEFORE + 1.0) * step:
        return None
    here = next((place for place in reversed(history) if pole - place.t >= _BEFORE * step), history[0])
    if here.t - history[0].t < 2 * _APART * step:
        return None
    chosen = [_nearest(history, here.t - k * _APART * step) for k in (2, 1)]
    return [*chosen, here], pole, step


def _nearest(history: list[_Place], t: float) -> _Place:
    return min(history, key=lambda place: abs(place.t - t))


def _extrapolated(behind: list[_Place], t: float, degree: int = 2) -> tuple[Array, Array, Array]:
    """Coordinates, velocities and accelerations at t: those of the last place, with a polynomial for the latter."""
    here = behind[-1]
    places = behind[-degree - 1 :]
    times = np.array([place.t - here.t for place in places])
    # a(s) = sum c_j s^j through the places.
    c = np.linalg.solve(np.vander(times, increasing=True), np.array([place.a for place in places]))
    s = t - here.t
    powers = [s**j for j in range(degree + 3)]
    q = here.q + s * here.v + sum(c[j] * powers[j + 2] / ((j + 1) * (j + 2)) for j in range(degree + 1))
    v = here.v + sum(c[j] * powers[j + 1] / (j + 1) for j in range(degree + 1))
    return q, v, sum((c[j] * powers[j] for j in range(degree + 1)), np.zeros_like(here.a))


def _attempts(state: March) -> int:
    return int(state.counts[STEPS] + state.counts[REJECTED])


def _copied(state: March) -> March:
    return deepcopy(state)


def _restore(state: March, kept: March) -> None:
    for array, value in zip(state, kept, strict=True):
        array[:] = value
