"""Closure of large mechanisms along a path: the method of `kernel.closure` with sparse factors."""

from typing import Any

import numpy as np
import scipy

from paraflex.arrays import Array, Indices
from paraflex.dynamics import System
from paraflex.dynamics.inputs import inputs_of
from paraflex.dynamics.sparse import jacobian_entries, jacobian_values
from paraflex.kernel.closure import (
    CHORDS,
    LARGEST_SHIFT,
    LARGEST_TURN,
    LOOPS_CLOSED,
    LOOPS_OPEN,
    LOOPS_SINGULAR,
    MAX_ITERATIONS,
    SINGULAR_PIVOT,
    SMALLEST_MOVE,
    TOO_COARSE,
    task_values,
)
from paraflex.kernel.packed import INDEX_1, PackedSystem, Signals
from paraflex.kernel.stage import equations

# Hager's estimate of a norm is a lower bound, rarely less than a third of the norm.
_LARGEST_CHANGE = 1.0 / 3.0
# Residual of closed loops, as a fraction of the largest coordinate: a few roundings. Steps are no measure, as long rows
# of loops multiply rounding errors by more than their number.
_ROUNDING = 1e-15


class SparseClosure:
    """Loops of a large rigid mechanism with the task coordinates of a marker, closed with sparse factors.

    Parameters
    ----------
    system : System
        System of the rigid mechanism.
    packed : PackedSystem
        The same with the marker of the end-effector.
    marker : int
        Number of this marker.
    coordinates : (tasks,) array of int
        Task coordinates: 0 for x, 1 for y, 2 for the angle.
    signals : Signals
        Signals of prescribed motions.
    """

    def __init__(
        self, system: System, packed: PackedSystem, marker: int, coordinates: Indices, signals: Signals
    ) -> None:
        self._system, self._packed, self._signals = system, packed, signals
        self._marker, self._coordinates = packed.markers[marker], coordinates
        self._row_units = np.concatenate([system.row_units, np.where(coordinates == 2, 1.0, system.size)])
        entries, offset = jacobian_entries(system), system.bodies[self._marker["body"]].offset
        tasks = np.repeat(np.arange(coordinates.size), 3)
        rows = np.concatenate([entries.rows, system.m + tasks])
        columns = np.concatenate([entries.columns, offset + np.tile(np.arange(3), coordinates.size)])
        self._order = np.lexsort((rows, columns))
        self._scale = (system.units[columns] / self._row_units[rows])[self._order]
        self._rows = rows[self._order]
        self._starts = np.searchsorted(columns[self._order], np.arange(system.n + 1))
        self._owned = offset + np.arange(3)
        self._at = np.array([body.position.start for body in system.bodies])
        self._still = np.zeros(system.n)
        self._workspace, self._torques = system.workspace(), np.zeros(inputs_of(system.mechanism).acting)

    def run(self, times: Array, target: Array, q: Array, v: Array, a: Array, basis: Array) -> tuple[int, int]:
        """Close the loops along a path, as `kernel.closure.close_path` does with the same arguments and results."""
        factor: Any = None
        before = None
        for k, t in enumerate(times.tolist()):
            if k > 0:
                dt = t - float(times[k - 1])
                q[k] = q[k - 1] + dt * (v[k - 1] + 0.5 * dt * a[k - 1])
            predicted = q[k].copy()
            status = self._close(t, target[k, 0], factor, q[k])
            if status != LOOPS_CLOSED:
                return status, k
            shift, turn = self._moves(predicted - q[k])
            if k > 0 and (turn > LARGEST_TURN or shift > LARGEST_SHIFT):
                return TOO_COARSE, k
            jacobian = self._jacobian(q[k])
            if before is not None and self._relative_change(factor, jacobian - before, q[k]) >= _LARGEST_CHANGE:
                return TOO_COARSE, k
            before, factor = jacobian, self._factor(jacobian)
            if factor is None:
                return LOOPS_SINGULAR, k
            self._move(t, target[k], factor, q[k], v[k], a[k], basis[k])
        return LOOPS_CLOSED, times.size

    def _jacobian(self, q: Array) -> scipy.sparse.csc_matrix:
        """Return the dimensionless [Phi_q; task_q] at q, with the same stored entries at all poses."""
        rates = [self._task(q, unit)[1] for unit in np.eye(3)]
        values = np.concatenate([jacobian_values(self._system, q), np.transpose(rates).ravel()])
        data, n = self._scale * values[self._order], self._system.n
        return scipy.sparse.csc_matrix((data, self._rows, self._starts), shape=(n, n))

    def _factor(self, jacobian: scipy.sparse.csc_matrix) -> Any:
        """Return the factors of a Jacobian; None at a singular position."""
        try:
            factor = scipy.sparse.linalg.splu(jacobian)
        except RuntimeError:
            return None
        least = np.min(np.abs(factor.U.diagonal()))
        return factor if least >= SINGULAR_PIVOT * np.max(np.abs(jacobian.data)) else None

    def _task(self, q: Array, owned: Array | None = None, v: Array | None = None, a: Array | None = None) -> Array:
        """Return the task coordinates and two derivatives (3, tasks), for velocities of the marker's body or of all."""
        v = self._still if v is None else v
        if owned is not None:
            v = np.zeros_like(q)
            v[self._owned] = owned
        out = np.zeros((3, self._coordinates.size))
        task_values(self._packed, self._marker, self._coordinates, q, v, self._still if a is None else a, out)
        return out

    def _solve(self, factor: Any, right: Array) -> Array:
        """Solve for coordinates [m, rad] (n, k) with right-hand sides (n, k)."""
        return (self._system.units * factor.solve((right.T / self._row_units).T).T).T

    def _moves(self, x: Array) -> tuple[float, float]:
        """Return the largest shift [sizes of the mechanism] and turn [rad] of a body among changes of coordinates."""
        shift = max(float(np.max(np.abs(x[self._at]))), float(np.max(np.abs(x[self._at + 1]))))
        return shift / self._system.size, float(np.max(np.abs(x[self._at + 2])))

    def _close(self, t: float, goal: Array, factor: Any, q: Array) -> int:
        """Close the loops at one time by Newton's method from the pose in q, with factors of a pose nearby if given."""
        for iteration in range(MAX_ITERATIONS):
            left = np.concatenate([self._system.constraints(self._signals, t, q)[0], self._task(q)[0] - goal])
            far = 1.0 + max(self._moves(q))
            if float(np.max(np.abs(left) / self._row_units)) <= _ROUNDING * far:
                return LOOPS_CLOSED
            if factor is None or iteration >= CHORDS:
                factor = self._factor(self._jacobian(q))
                if factor is None:
                    return LOOPS_SINGULAR
            step = self._solve(factor, left)
            q -= step
            if max(self._moves(step)) < SMALLEST_MOVE * far:
                return LOOPS_CLOSED
        return LOOPS_OPEN

    def _relative_change(self, factor: Any, change: scipy.sparse.csc_matrix, q: Array) -> float:
        """Estimate the norm of before^-1 change, from the factors of `before`: see `kernel.closure.relative_change`.

        Below one in any norm, no matrix between the two is singular. Positions count here in extents of the mechanism
        at its pose: in sizes of a body the norm would grow with the number of bodies.
        """
        weights = np.ones((q.size, 1))
        extent = max(float(np.ptp(q[self._at])), float(np.ptp(q[self._at + 1]))) / self._system.size
        weights[self._at] = weights[self._at + 1] = max(1.0, extent)

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
        m, tasks = self._system.m, self._coordinates.size
        right = np.zeros((q.size, 1 + tasks))
        right[:m, 0] = -self._system.constraints(self._signals, t, q)[1]
        right[m:, 0] = target[1]
        right[m:, 1:] = np.eye(tasks)
        found = self._solve(factor, right)
        v[:], basis[:] = found[:, 0], found[:, 1:]
        equations(
            self._system.packed, self._signals, t, INDEX_1, q, v, self._still, np.zeros(m), self._torques,
            self._workspace,
        )  # fmt: skip
        left = np.concatenate([-self._workspace.rows, target[2] - self._task(q, v=v)[2]])
        a[:] = self._solve(factor, left)
