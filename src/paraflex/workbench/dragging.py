"""Descent of a rigid pose towards a target of one of its points, along the closed loops and inside its assembly."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy

from paraflex.arrays import Array
from paraflex.dynamics import System
from paraflex.kernel.constraints import constraint_values
from paraflex.kernel.packed import Scratch, Signals, make_scratch
from .branches import MARGIN, Guard

# Longest step of the target [sizes of the mechanism], their largest number, and iterations for a step and at the end.
_STEP, _MOST_STEPS, _ON_THE_WAY, _AT_THE_END = 0.1, 24, 4, 60
# Longest and shortest step, and step of the finite differences for second derivatives [sizes of the mechanism, rad].
_LONGEST, _SHORTEST, _DIFFERENCE = 0.2, 1e-11, 1e-6
# A target nearer than this is reached [sizes of the mechanism].
REACHED = 1e-9
# Largest residual of closed loops [sizes of the mechanism, rad], iterations with one factor, and factors.
_CLOSED, _CHORDS, _FACTORS = 1e-13, 6, 4
# Part of the distance that a straight step may leave; others follow the curvature.
_FALL = 0.7
# Part of its margin that a guard may lose by curvature.
_SPARE = 0.7
# Slopes and curvatures below these, relative to the distance, are zero; weight of violated guards beside the distance.
_LEVEL, _FLAT, _WEIGHT = 1e-10, 1e-6, 10.0


class Slope(NamedTuple):
    """Slope and curvature of half the squared distance from the target, in the free motions at a pose."""

    free: Array
    inverse: Array
    gradient: Array
    curvature: Array


@dataclass(frozen=True)
class Dragging:
    """Material point of a body that is dragged, within guards.

    Attributes
    ----------
    system : System
        System of the rigid mechanism without prescribed motions.
    signals : Signals
        Signals of prescribed motions.
    freedoms : int
        Degrees of freedom.
    at : int
        Index of the body's first coordinate.
    local : (2,) array
        Place of the point in the body's frame [m].
    guards : list of Guard
        Quantities that keep their signs.
    """

    system: System
    signals: Signals
    freedoms: int
    at: int
    local: Array
    guards: list[Guard]

    def place(self, q: Array) -> Array:
        """Return the position (2,) of the point [m]."""
        c, s = np.cos(q[self.at + 2]), np.sin(q[self.at + 2])
        x, y = self.local
        return q[self.at : self.at + 2] + np.array([c * x - s * y, s * x + c * y])

    def rows(self, q: Array) -> Array:
        """Return the dimensionless derivative (2, n) of the position."""
        rows = np.zeros((2, self.system.n))
        arm = (self.place(q) - q[self.at : self.at + 2]) / self.system.size
        rows[0, self.at] = rows[1, self.at + 1] = 1.0
        rows[:, self.at + 2] = -arm[1], arm[0]
        return rows

    def distance(self, q: Array, target: Array) -> float:
        """Return the distance of the point from a target [sizes of the mechanism]."""
        return float(np.hypot(*(self.place(q) - target))) / self.system.size

    def directions(self, q: Array, free: Array) -> int:
        """Return in how many directions free motions (n, k) move the point."""
        return int(np.sum(np.linalg.svd(self.rows(q) @ free, compute_uv=False) > 10.0 * MARGIN))

    def follow(self, q: Array, start: Array, goal: Array) -> Array:
        """Return the pose that follows a target along a line, in short steps."""
        steps = int(min(np.ceil(np.hypot(*(goal - start)) / (_STEP * self.system.size)), _MOST_STEPS))
        for part in np.arange(1, steps) / max(steps, 1):
            q = self.approach(q, start + part * (goal - start), _ON_THE_WAY)
        return self.approach(q, goal, _AT_THE_END)

    def approach(self, q: Array, target: Array, iterations: int) -> Array:
        """Return the pose nearest to a target that continuous motion from q leads to, or one on the way there."""
        longest, room, bent = _LONGEST, self.room(q), False
        for _ in range(iterations):
            merit = self._merit(q, target, room)
            if self.distance(q, target) <= 0.1 * REACHED:
                break
            slope = self.slope(q, target, bent=bent)
            step = self._step(q, target, slope, room, longest)
            found = self._lower(q, target, step, slope, merit if bent else _FALL * merit, 1 if not bent else 0)
            if found is None and bent:
                break
            if found is None:
                bent = True
                continue
            moved, (q, room) = found[0], found[1:]
            longest = min(_LONGEST, 4.0 * moved)
            if any(not guard.sign for guard in self.guards):
                for guard in self.guards:
                    guard.pass_by(q)
                room = self.room(q)
        return q

    def _lower(
        self, q: Array, target: Array, step: Array, slope: Slope, merit: float, trials: int
    ) -> tuple[float, Array, Array] | None:
        """Return length, pose and room after a step, or a part of it, that leaves less than a merit; None without one.

        The number of trials is not limited if it is zero.
        """
        length = float(np.max(np.abs(step), initial=0.0))
        while length > _SHORTEST:
            trial = self.closed(q, step, slope.inverse)
            if trial is not None:
                room = self.room(trial)
                if np.all(room > -_SPARE * self._margins) and self._merit(trial, target, room) < merit:
                    return length, trial, room
            step, length, trials = 0.25 * step, 0.25 * length, trials - 1
            if trials == 0:
                break
        return None

    def slope(self, q: Array, target: Array, *, bent: bool = True) -> Slope:
        """Return slope and curvature of half the squared distance, the latter of the Lagrangian by differences.

        If it is not `bent`, the curvature is that of straight motions, and steps are least changes (Gauss and Newton).
        """
        jacobian, rank = self.system.dimensionless_jacobian(q), self.system.n - self.freedoms
        left, sizes, right = np.linalg.svd(jacobian)
        free, inverse = right[rank:].T, right[:rank].T @ (left[:, :rank] / sizes[:rank]).T
        rows, off = self.rows(q), (self.place(q) - target) / self.system.size
        slope = rows.T @ off
        along = rows @ free
        if not bent:
            return Slope(free, inverse, free.T @ slope, along.T @ along)
        multipliers, columns = -inverse.T @ slope, []
        here = slope + jacobian.T @ multipliers
        for column in free.T:
            there = q + _DIFFERENCE * self.system.units * column
            moved = self.rows(there).T @ off + self.system.dimensionless_jacobian(there).T @ multipliers
            columns.append(free.T @ (moved - here) / _DIFFERENCE)
        curvature = np.array(columns).reshape(self.freedoms, self.freedoms)
        return Slope(free, inverse, free.T @ slope, 0.5 * (curvature + curvature.T) + along.T @ along)

    def closed(self, q: Array, step: Array, inverse: Array) -> Array | None:
        """Return the pose after a dimensionless step, loops closed by least changes; None if these exceed the step."""
        units, at, length = self.system.units, q + self.system.units * step, float(np.max(np.abs(step)))
        tolerance = _CLOSED * (1.0 + float(np.max(np.abs(q / units))))
        moved = np.zeros_like(q)
        for factor in range(_FACTORS):
            for _ in range(_CHORDS):
                phi = self._residual(at + units * moved)
                if np.max(np.abs(phi), initial=0.0) <= tolerance:
                    return at + units * moved
                moved = moved - inverse @ phi
                if not np.max(np.abs(moved)) <= length:
                    return None
            if factor < _FACTORS - 1:
                rank = self.system.n - self.freedoms
                left, sizes, right = np.linalg.svd(self.system.dimensionless_jacobian(at + units * moved))
                inverse = right[:rank].T @ (left[:, :rank] / sizes[:rank]).T
        return None

    @cached_property
    def _scratch(self) -> tuple[Scratch, Array, Array, Array]:
        return (
            make_scratch(self.system.packed),
            np.zeros(self.system.n),
            np.zeros(self.system.m),
            np.zeros(self.system.m),
        )

    def _residual(self, q: Array) -> Array:
        scratch, still, phi, rate = self._scratch
        constraint_values(self.system.packed, self.signals, 0.0, q, still, scratch, phi, rate)
        return phi / self.system.row_units

    def room(self, q: Array) -> Array:
        """Return the room of every guard at a pose."""
        return np.array([guard.room(q) for guard in self.guards])

    @property
    def _margins(self) -> Array:
        return np.array([guard.margin for guard in self.guards])

    def _merit(self, q: Array, target: Array, room: Array) -> float:
        """Return the distance, and more where guards have less room than their margins."""
        distance = self.distance(q, target)
        return distance + _WEIGHT * min(distance, 1.0) * float(np.sum(np.maximum(-room, 0.0)))

    def _step(self, q: Array, target: Array, slope: Slope, room: Array, longest: float) -> Array:
        """Return a dimensionless step downhill, as far as the guards allow to first order."""
        values, vectors = np.linalg.eigh(slope.curvature)
        along, distance = vectors.T @ slope.gradient, self.distance(q, target)
        scale = np.maximum(np.abs(values), _FLAT * distance)
        # Along negative curvature the slope grows: the longest step is right, in either direction if it is zero yet.
        bent = values < -_FLAT * distance
        scale = np.where(bent, np.minimum(scale, np.abs(along) / longest + 1e-300), scale)
        move = vectors @ (-along / scale)
        if np.max(np.abs(along), initial=0.0) <= _LEVEL * distance and np.any(bent):
            move = longest * vectors[:, 0]
        move *= min(1.0, longest / max(float(np.max(np.abs(slope.free @ move), initial=0.0)), 1e-300))
        move = self._allowed(q, slope, room, move, vectors * np.sqrt(scale))
        step = slope.free @ move
        return step * min(1.0, longest / max(float(np.max(np.abs(step), initial=0.0)), 1e-300))

    def _allowed(self, q: Array, slope: Slope, room: Array, move: Array, root: Array) -> Array:
        """Return the move nearest to one, in the metric root root^T, that leaves all guards room to first order."""
        units = self.system.units
        if np.all(self.room(q + units * (slope.free @ move)) >= 0.0):
            return move
        nearby = [self.room(q + _DIFFERENCE * units * column) for column in slope.free.T]
        signed = np.array([bool(guard.sign) for guard in self.guards])
        room = room[signed]
        change = (np.array(nearby).T[signed] - room[:, None]) / _DIFFERENCE
        if np.all(room + change @ move >= 0.0):
            return move
        # Least distance programming (Lawson and Hanson): w = root^T (y - move), of least norm, with G w >= h.
        G = np.linalg.solve(root, change.T).T
        h = -room - change @ move
        sizes = np.maximum(np.linalg.norm(G, axis=1), 1e-12)
        G, h = G / sizes[:, None], h / sizes
        E = np.vstack([G.T, h])
        wish = np.append(np.zeros(len(move)), 1.0)
        r = E @ scipy.optimize.nnls(E, wish)[0] - wish
        if abs(r[-1]) < 1e-14:
            return np.zeros_like(move)
        return move + np.linalg.solve(root.T, -r[:-1] / r[-1])
