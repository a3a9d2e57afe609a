"""Closure of large mechanisms along a path: the method of `kernel.closure` with sparse factors."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import scipy

from paraflex.arrays import Array, Indices
from paraflex.dynamics import System
from paraflex.dynamics.projection import second_rates
from paraflex.dynamics.sparse import jacobian_entries, jacobian_values
from paraflex.kernel import closure as kernel
from paraflex.kernel.packed import PackedSystem, Signals

# Hager's estimate of a norm is a lower bound, rarely less than a third of the norm.
_LARGEST_CHANGE = 1.0 / 3.0
# Residual of closed loops, as a fraction of the largest coordinate: a few roundings. The size of a step is no measure,
# as long rows of loops multiply rounding errors by more than their number.
_ROUNDING = 1e-15
# Residual of redundant constraints beyond which they contradict one another [sizes of the mechanism, rad].
_CONTRADICTION = 1e-10


class SparseClosure:
    """Loops and task coordinates, those of a marker, closed with sparse factors; arguments as for `close_path`."""

    def __init__(
        self, system: System, packed: PackedSystem, signals: Signals, marker: int, coordinates: Indices
    ) -> None:
        self._system, self._packed, self._signals, self._coordinates = system, packed, signals, coordinates
        self._marker = packed.markers[marker]
        self._row_units = np.concatenate([system.row_units, np.where(coordinates == 2, 1.0, system.size)])
        self._own = system.bodies[self._marker["body"]].offset + np.arange(3)
        rows, columns, _ = jacobian_entries(system)
        rows = np.concatenate([rows, system.m + np.repeat(np.arange(coordinates.size), 3)])
        columns = np.concatenate([columns, np.tile(self._own, coordinates.size)])
        self._order = np.lexsort((rows, columns))
        self._scale, self._rows = (system.units[columns] / self._row_units[rows])[self._order], rows[self._order]
        self._starts = np.searchsorted(columns[self._order], np.arange(system.n + 1))
        self._at = np.array([body.offset for body in system.bodies])
        self._still = np.zeros(system.n)

    def run(self, times: Array, target: Array, q: Array, v: Array, a: Array, basis: Array) -> tuple[int, int]:
        """Close the loops along a path, as `kernel.closure.close_path` does with the same arguments and results."""
        before = factor = None
        for k, t in enumerate(times.tolist()):
            if k > 0:
                dt = t - float(times[k - 1])
                q[k] = q[k - 1] + dt * (v[k - 1] + 0.5 * dt * a[k - 1])
            predicted = q[k].copy()
            status = self._close(t, target[k, 0], factor, q[k])
            if status != kernel.LOOPS_CLOSED:
                return status, k
            jacobian, (shift, turn) = self._jacobian(q[k]), self._moves(predicted - q[k])
            if before is not None and (
                turn > kernel.LARGEST_TURN
                or shift > kernel.LARGEST_SHIFT
                or self._relative_change(factor, jacobian - before, q[k]) >= _LARGEST_CHANGE
            ):
                return kernel.TOO_COARSE, k
            before, factor = jacobian, self._factor(jacobian)
            if factor is None:
                return kernel.LOOPS_SINGULAR, k
            self._move(t, target[k], factor, q[k], v[k], a[k], basis[k])
        return kernel.LOOPS_CLOSED, times.size

    def _jacobian(self, q: Array) -> scipy.sparse.csc_matrix:
        """Return the dimensionless [Phi_q; task_q] at q, with the same stored entries at all poses."""
        units = np.zeros((3, q.size))
        units[np.arange(3), self._own] = 1.0
        rates = np.transpose([self._task(q, unit)[1] for unit in units])
        data = self._scale * np.concatenate([jacobian_values(self._system, q), rates.ravel()])[self._order]
        return scipy.sparse.csc_matrix((data, self._rows, self._starts), shape=(self._row_units.size, q.size))

    def _factor(self, jacobian: scipy.sparse.csc_matrix) -> Any:
        """Return the factors of a Jacobian; None at a singular position."""
        try:
            factor = scipy.sparse.linalg.splu(jacobian)
        except RuntimeError:
            return None
        pivot = np.min(np.abs(factor.U.diagonal()))
        return factor if pivot >= kernel.SINGULAR_PIVOT * np.max(np.abs(jacobian.data)) else None

    def _task(self, q: Array, v: Array | None = None) -> Array:
        """Return the task coordinates and two derivatives (3, tasks), at rest or without accelerations."""
        out = np.zeros((3, self._coordinates.size))
        v = self._still if v is None else v
        kernel.task_values(self._packed, self._marker, self._coordinates, q, v, self._still, out)
        return out

    def _solve(self, factor: Any, right: Array) -> Array:
        """Solve for coordinates [m, rad] with right-hand sides (n,) or (n, k)."""
        return (self._system.units * factor.solve((right.T / self._row_units).T).T).T

    def _moves(self, x: Array) -> tuple[float, float]:
        """Return the largest shift [sizes of the mechanism] and turn [rad] of a body among changes of coordinates."""
        shift, turn = np.max(np.abs([x[self._at], x[self._at + 1]])), np.max(np.abs(x[self._at + 2]))
        return float(shift) / self._system.size, float(turn)

    def _close(self, t: float, goal: Array, factor: Any, q: Array) -> int:
        """Close the loops at one time by Newton's method from the pose in q, with factors of a pose nearby if given."""
        for iteration in range(kernel.MAX_ITERATIONS):
            phi, far = self._system.constraints(self._signals, t, q)[0], 1.0 + max(self._moves(q))
            left = np.concatenate([phi, self._task(q)[0] - goal])
            if np.max(np.abs(left) / self._row_units) <= _ROUNDING * far:
                return kernel.LOOPS_CLOSED
            if factor is None or iteration >= kernel.CHORDS:
                factor = self._factor(self._jacobian(q))
                if factor is None:
                    return kernel.LOOPS_SINGULAR
            step = self._solve(factor, left)
            q -= step
            if max(self._moves(step)) < kernel.SMALLEST_MOVE * far:
                return kernel.LOOPS_CLOSED
        return kernel.LOOPS_OPEN

    def _relative_change(self, factor: Any, change: scipy.sparse.csc_matrix, q: Array) -> float:
        """Estimate the norm of before^-1 change, from the factors of `before`: see `kernel.closure.relative_change`.

        Below one in any norm, no matrix between the two is singular. Positions count here in extents of the mechanism
        at its pose: in sizes of a body the norm would grow with the number of bodies.
        """
        weights, extent = np.ones((q.size, 1)), max(np.ptp(q[self._at]), np.ptp(q[self._at + 1]))
        weights[self._at] = weights[self._at + 1] = max(1.0, extent / self._system.size)

        def forward(x: Array) -> Array:
            return factor.solve(change @ (weights * x)) / weights

        def backward(x: Array) -> Array:
            return weights * (change.T @ factor.solve(x / weights, "T"))

        # The largest sum of a row is that of a column of the transpose.
        transposed = scipy.sparse.linalg.LinearOperator(
            change.shape, matvec=backward, matmat=backward, rmatvec=forward, rmatmat=forward, dtype=np.dtype(float)
        )
        return float(scipy.sparse.linalg.onenormest(transposed, t=1))

    def _move(self, t: float, target: Array, factor: Any, q: Array, v: Array, a: Array, basis: Array) -> None:
        """Compute velocities, accelerations and basis of closed loops, with the factors at their pose."""
        signals, m, tasks = self._signals, self._system.m, self._coordinates.size
        rate = np.concatenate([-self._system.constraints(signals, t, q)[1], target[1]])
        found = self._solve(factor, np.column_stack([rate, np.eye(rate.size, tasks, -m)]))
        v[:], basis[:] = found[:, 0], found[:, 1:]
        second = second_rates(self._system, signals, t, q, v, self._still)
        a[:] = self._solve(factor, np.concatenate([-second, target[2] - self._task(q, v)[2]]))


class RedundantClosure(SparseClosure):
    """Loops closed by least squares, where constraints depend on one another at every pose."""

    def _factor(self, jacobian: scipy.sparse.csc_matrix) -> Any:
        """Return a solver of least squares with a Jacobian; None at a singular position."""
        dense = jacobian.toarray()
        sizes = np.linalg.svd(dense, compute_uv=False)
        regular = sizes[-1] >= kernel.SINGULAR_PIVOT * sizes[0]
        return SimpleNamespace(solve=np.linalg.pinv(dense).__matmul__) if regular else None

    def _relative_change(self, factor: Any, change: scipy.sparse.csc_matrix, q: Array) -> float:
        """Return the norm of the pseudoinverse of `before` times its change: below one, no position is singular."""
        return float(np.linalg.norm(factor.solve(change.toarray()), np.inf))

    def _close(self, t: float, goal: Array, factor: Any, q: Array) -> int:
        """Close the loops as `SparseClosure` does; where constraints contradict one another they stay open."""
        status = super()._close(t, goal, factor, q)
        gap = self._system.gap(self._system.constraints(self._signals, t, q)[0])
        return kernel.LOOPS_OPEN if status == kernel.LOOPS_CLOSED and gap > _CONTRADICTION else status
