"""Distances of end-effector positions from the workspace: the nearest pose to each."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import scipy

from paraflex.arrays import Array, Indices, Mask
from paraflex.dynamics import System, material_angle
from paraflex.dynamics.points import marker_place
from paraflex.dynamics.projection import LeastChange, assemble, closed, shortened
from paraflex.dynamics.sparse import Saddle, sparse_jacobian
from paraflex.dynamics.system import DENSE_ROWS
from paraflex.kernel.packed import Signals
from paraflex.mechanism import PointRef

# A position nearer than this fraction of the mechanism's size to a pose is reached.
REACHED = 1e-8
# Newton's iteration on the distance: largest number, longest step [sizes of the mechanism, rad], also for closing
# loops, shortest step, and step of the finite differences for second derivatives.
_MAX_ITERATIONS, _LONGEST_MOVE, _SHORTEST_MOVE, _DIFFERENCE = 60, 0.5, 1e-12, 1e-6
# A gradient or a curvature of the distance below this counts as zero.
_FLAT = 1e-10
# Number of additional starts with bodies at random angles.
_SCATTERED = 4
# Singular values below this fraction of the largest belong to redundant constraints.
_DEPENDENT = 1e-9


class NearestPose(NamedTuple):
    """The pose nearest to a desired position.

    Attributes
    ----------
    q : (n,) array
        Coordinates of the pose.
    distance : float
        Distance from the desired position [m].
    turn : float
        Rotation from the desired angle, if the task has one [rad].
    part : float
        Norm of both, dimensionless; zero if the position is reached.
    """

    q: Array
    distance: float
    turn: float
    part: float


@dataclass(frozen=True)
class Shortfall:
    """Distance of a path from the workspace.

    Attributes
    ----------
    t : (k,) array
        Instants [s].
    desired : (k, tasks) array
        Desired task coordinates [m, rad].
    distance : (k,) array
        Distance from the nearest pose [m]; zero if the position is reached.
    turn : (k,) array
        Rotation from the nearest pose, if the task has an angle [rad].
    own : (k,) array
        Norm of both, dimensionless, to the nearest pose found in the same assembly. If it is not zero and the others
        are, the position is reached only past a Type I singularity or in another assembly.
    """

    t: Array
    desired: Array
    distance: Array
    turn: Array
    own: Array

    @property
    def out(self) -> Mask:
        """Mask (k,) of instants at which no pose reaches the position."""
        return (self.distance > 0.0) | (self.turn > 0.0)

    @property
    def elsewhere(self) -> Mask:
        """Mask (k,) of instants at which poses reach the position, but none near the pose before."""
        return ~self.out & (self.own > 0.0)

    @property
    def furthest(self) -> int:
        """Index of the largest distance or, if all are zero, of the largest rotation."""
        return int(np.argmax(self.distance if np.any(self.distance) else self.turn))

    def beyond(self, k: int) -> str:
        """Format the distance of the k-th position from the nearest pose, with units; empty if it is reached."""
        parts = [
            f"{self.distance[k]:.3g} m" if self.distance[k] else "",
            f"{self.turn[k]:.3g} rad" if self.turn[k] else "",
        ]
        return " and ".join(filter(None, parts))

    def joined(self, more: "Shortfall") -> "Shortfall":
        """Merge two sets of instants in order of time."""
        order = np.argsort(np.concatenate([self.t, more.t]), kind="stable")
        names = ("t", "desired", "distance", "turn", "own")
        return Shortfall(*(np.concatenate([getattr(self, name), getattr(more, name)])[order] for name in names))


@dataclass(frozen=True)
class PoseSearch:
    """Search for the poses of a rigid mechanism that bring its end-effector nearest to positions.

    Attributes
    ----------
    system : System
        System of the rigid mechanism.
    point : PointRef
        Point of the end-effector.
    coordinates : (tasks,) array of int
        Task coordinates: 0 for x, 1 for y, 2 for the angle.
    signals : Signals
        Signals of prescribed motions.
    """

    system: System
    point: PointRef
    coordinates: Indices
    signals: Signals

    def nearest(self, t: float, goal: Array, q: Array) -> NearestPose:
        """Find the pose nearest to a goal (tasks,) among those near a closed pose q.

        Newton's method minimises half the squared distance within the admissible poses, along the null space of Phi_q;
        second derivatives are those of the Lagrangian, by finite differences.
        """
        square, longest = self._square(q, goal), _LONGEST_MOVE
        for _ in range(_MAX_ITERATIONS):
            if square <= (1e-3 * REACHED) ** 2:
                break
            step = self._step(goal, q, longest)
            length = float(np.max(np.abs(step)))
            if length <= _SHORTEST_MOVE:
                break
            trial = self.closed(t, q + self.system.units * step)
            found = np.inf if trial is None else self._square(trial, goal)
            if trial is None or found >= square:
                longest = 0.25 * length
                if longest < _SHORTEST_MOVE:
                    break
                continue
            q, square, longest = trial, found, min(_LONGEST_MOVE, 2.0 * longest)
        off = np.abs(self._task(q)[0] - goal)
        angle = self.coordinates == 2
        part = float(np.linalg.norm(off / self._units))
        if part <= REACHED:
            return NearestPose(q, 0.0, 0.0, 0.0)
        return NearestPose(q, float(np.linalg.norm(off[~angle])), float(np.linalg.norm(off[angle])), part)

    def closed(self, t: float, q: Array) -> Array | None:
        """Close the loops by least changes and return the pose; None if they do not close."""
        system = self.system
        pose, phi = assemble(system, self.signals, t, q, self._change_at, longest=_LONGEST_MOVE)
        return pose if closed(system, pose, phi) else None

    def tracked(self, times: Sequence[float] | Array, goals: Array, q: Array) -> list[NearestPose]:
        """Find the nearest poses to goals (k, tasks) at times (k,), each from the one before."""
        found = []
        for t, goal in zip(times, goals, strict=True):
            start = self.closed(float(t), q)
            found.append(self.nearest(float(t), goal, q if start is None else start))
            q = found[-1].q
        return found

    def shortfall(self, times: Array, goals: Array, q: Array, others: Sequence[Array] = ()) -> Shortfall:
        """Compute the distances of goals (k, tasks) at times (k,) from the nearest poses, from a pose q onwards.

        Other poses, given or with bodies at random angles, are used as well if they come nearer to the furthest goal.
        """
        found = self.tracked(times, goals, q)
        own = np.array([one.part for one in found])
        worst = int(np.argmax(own))
        t, goal = float(times[worst]), goals[worst]
        if own[worst] > 0.0:
            for pose in (*others, *self.scattered(t, q, _SCATTERED)):
                start = self.closed(t, pose)
                if start is not None and self.nearest(t, goal, start).part < own[worst] - REACHED:
                    again = self.tracked(times, goals, start)
                    found = [min(pair, key=lambda one: one.part) for pair in zip(found, again, strict=True)]
        distance, turn = (np.array([getattr(one, name) for one in found]) for name in ("distance", "turn"))
        return Shortfall(np.asarray(times, dtype=float), goals, distance, turn, own)

    def scattered(self, t: float, q: Array, count: int) -> Iterator[Array]:
        """Yield closed poses found from bodies at random angles, if they close: other assemblies."""
        random, angles = np.random.default_rng(0), [body.angle for body in self.system.bodies]
        for _ in range(count):
            turned = q.copy()
            turned[angles] = random.uniform(-np.pi, np.pi, len(angles))
            pose = self.closed(t, turned)
            if pose is not None:
                yield pose

    @property
    def _units(self) -> Array:
        """Units of the task coordinates: the size of the mechanism, 1 for an angle."""
        return np.where(self.coordinates == 2, 1.0, self.system.size)

    def _task(self, q: Array) -> tuple[Array, Array]:
        """Return task coordinates (tasks,) and their derivatives (tasks, n)."""
        system = self.system
        place, rows = marker_place(system, system.marker(self.point), q[None])
        turn = np.zeros((1, system.n))
        if not self.point.on_ground:
            turn[0, system.body(self.point.body).angle] = 1.0
        values = np.append(place[0], material_angle(system, self.point, q[None]))
        return values[self.coordinates], np.vstack([rows[0], turn])[self.coordinates]

    def _square(self, q: Array, goal: Array) -> float:
        off = (self._task(q)[0] - goal) / self._units
        return float(off @ off)

    def _change_at(self, q: Array) -> LeastChange:
        """Return the dimensionless least change; dense for few rows, as a search closes thousands of poses."""
        jacobian, units, row_units = self._jacobian(q), self.system.units, self.system.row_units
        if not isinstance(jacobian, np.ndarray):
            nearest = _nearest(jacobian)
            return lambda phi: units * nearest.solve(r=phi / row_units)[0]
        return lambda phi: units * np.linalg.lstsq(jacobian, phi / row_units, rcond=_DEPENDENT)[0]

    def _jacobian(self, q: Array) -> Any:
        """Return the dimensionless Phi_q, a dense array or, for many rows, a sparse matrix."""
        if self.system.m <= DENSE_ROWS:
            return self.system.dimensionless_jacobian(q)
        rows, columns = scipy.sparse.diags(1.0 / self.system.row_units), scipy.sparse.diags(self.system.units)
        return scipy.sparse.csr_matrix(rows @ sparse_jacobian(self.system, q) @ columns)

    def _slope(self, q: Array, goal: Array, multipliers: Array | None = None) -> tuple[Array, Any]:
        """Return the gradient of half the squared distance, or of the Lagrangian with multipliers; and Phi_q."""
        (values, rows), jacobian = self._task(q), self._jacobian(q)
        slope = (rows * self.system.units / self._units[:, None]).T @ ((values - goal) / self._units)
        return (slope if multipliers is None else slope + jacobian.T @ multipliers), jacobian

    def _admissible(self, jacobian: Any, slope: Array) -> tuple[Array, Array]:
        """Return a basis (n, f) of the null space of Phi_q, and the multipliers (m,) that balance a slope best."""
        if not isinstance(jacobian, np.ndarray):
            nearest, freedoms = _nearest(jacobian), self.system.n - self.system.n_constraints
            wishes = np.random.default_rng(0).standard_normal((self.system.n, freedoms))
            found = nearest.solve(wishes, np.zeros((self.system.m, freedoms)))[0]
            return np.linalg.qr(found)[0], nearest.solve(-slope)[1]
        left, sizes, right = np.linalg.svd(jacobian)
        rank = int(np.sum(sizes > _DEPENDENT * np.max(sizes, initial=0.0)))
        return right[rank:].T, -left[:, :rank] @ ((right[:rank] @ slope) / sizes[:rank])

    def _step(self, goal: Array, q: Array, longest: float) -> Array:
        """Return a dimensionless step towards the nearest pose within the null space of the constraints."""
        slope, jacobian = self._slope(q, goal)
        free, multipliers = self._admissible(jacobian, slope)
        here = slope + jacobian.T @ multipliers
        columns = [
            self._slope(q + self.system.units * _DIFFERENCE * column, goal, multipliers)[0] - here for column in free.T
        ]
        curvature = free.T @ np.column_stack(columns) / _DIFFERENCE if columns else np.zeros((0, 0))
        values, vectors = np.linalg.eigh(0.5 * (curvature + curvature.T))
        along = vectors.T @ (free.T @ slope)
        # The step goes downhill for any sign of the curvature; at a zero gradient, along negative curvature.
        scale = np.maximum(np.abs(values), _FLAT)
        move = -along / scale
        if values.size and np.max(np.abs(along)) <= _FLAT and values[0] < -np.sqrt(_FLAT):
            move[0] = longest
        step = free @ (vectors @ move)
        return step * shortened(step, longest)


def _nearest(rows: scipy.sparse.csr_matrix) -> Saddle:
    """Return the equations of the smallest change with given values of rows."""
    return Saddle(scipy.sparse.csr_matrix(scipy.sparse.identity(rows.shape[1])), rows)
