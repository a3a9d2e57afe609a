"""Forces at rest and their derivatives by the pose: stiffness of springs, weight, loads and constraint forces."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

from paraflex.arrays import Array
from paraflex.dynamics.inputs import inputs_of
from paraflex.dynamics.signals import moment_signals
from paraflex.dynamics.sparse import apart_colours, bodies_acted_on, tied_bodies, without_stiffness
from paraflex.dynamics.state import point_position
from paraflex.dynamics.system import System
from paraflex.kernel.packed import CONSTRAINT, FRICTION, INDEX_1, SPRING, PackedSystem, Signals, Workspace
from paraflex.kernel.stage import equations

# Differences of fourth order: places and weights, for a step of one.
_STENCIL = ((-2.0, 1.0 / 12.0), (-1.0, -8.0 / 12.0), (1.0, 8.0 / 12.0), (2.0, -1.0 / 12.0))
# The step [m, rad], or as a fraction of the length of a spring between points that is shorter than a metre.
_STEP, _SHORTEST_SPRING = 1e-3, 1e-6


class RestingForces:
    """Forces at rest (n,), with the sign of the left-hand side of the equations, and rows of springs (m,).

    All forces but the stiffness of beams, which is known exactly and would drown them. With velocities `v` and
    accelerations `a` (n,) in place of zeros they are those of a motion.
    """

    def __init__(self, system: System, time: float) -> None:
        self.packed: PackedSystem = without_stiffness(system.packed)
        self.time = time
        self.signals: Signals = moment_signals(system.mechanism, time)
        self.workspace: Workspace = system.workspace()
        self.v: Array = np.zeros(system.n)
        self.a: Array = np.zeros(system.n)
        self.torques: Array = np.zeros(inputs_of(system.mechanism).acting)
        self.springs: NDArray[np.intp] = np.nonzero(system.packed.rows["kind"] == SPRING)[0]

    def __call__(self, q: Array, lam: Array) -> tuple[Array, Array]:
        """Forces and rows at coordinates (n,) with multipliers (m,)."""
        self._evaluate(q, lam)
        return self.workspace.f.copy(), self.workspace.rows[self.springs]

    def compliant(self, q: Array) -> Array:
        """Multipliers (m,) of springs, dampers and friction at coordinates (n,); zero in rows of constraints."""
        rows = self.packed.rows
        # Rows of springs and dampers are compliance times what is missing; those of friction with the scale set here.
        scale = np.where(rows["kind"] == FRICTION, 1.0, rows["compliance"])
        self.workspace.compliance[:] = scale
        self._evaluate(q, np.zeros(rows.size))
        compliant = rows["kind"] != CONSTRAINT
        return np.divide(self.workspace.rows, scale, out=np.zeros(rows.size), where=compliant)

    def _evaluate(self, q: Array, lam: Array) -> None:
        equations(
            self.packed, self.signals, self.time, INDEX_1, q, self.v, self.a, lam, self.torques, self.workspace
        )  # fmt: skip


def pose_stiffness(system: System, time: float, q: Array, lam: Array) -> scipy.sparse.csr_matrix:
    """Derivative (n, n) of the forces at rest by the coordinates at constant multipliers, without that of the beams.

    By differences; bodies between which no force or row reaches are displaced at once.

    Parameters
    ----------
    system : System
    time : float
        For prescribed angles [s].
    q : (n,) array
    lam : (m,) array
        Multipliers of constraints and torques of springs at joints at that pose.
    """
    forces, steps = RestingForces(system, time), _steps(system, q)
    tied, spring_rows = bodies_acted_on(system), _spring_rows(system, forces.springs)
    colour = apart_colours(tied)
    stiffness, slopes = _Entries(), _Entries()
    for group in range(int(colour.max(initial=-1)) + 1):
        members = np.nonzero(colour == group)[0].tolist()
        for local in range(max(3 + system.bodies[i].nf for i in members)):
            moved = [i for i in members if local < 3 + system.bodies[i].nf]
            columns = [system.bodies[i].offset + local for i in moved]
            df, dr = _difference(forces, q, lam, np.array(columns), steps)
            for i, column in zip(moved, columns, strict=True):
                for other in tied[i]:
                    stiffness.add(np.arange(*system.bodies[other].all.indices(system.n)), column, df, steps[column])
                slopes.add(np.array(spring_rows[i], dtype=int), column, dr, steps[column])
    K = stiffness.matrix(system.n, system.n)
    # A spring at a joint is a multiplier: its torque is its row over its compliance.
    J = slopes.matrix(forces.springs.size, system.n)
    strength = scipy.sparse.diags(1.0 / system.packed.rows["compliance"][forces.springs])
    return scipy.sparse.csr_matrix(0.5 * (K + K.T) + J.T @ strength @ J)


class _Entries:
    """Entries of a sparse matrix, collected column by column."""

    def __init__(self) -> None:
        self.rows: list[NDArray[np.int64]] = [np.zeros(0, dtype=int)]
        self.columns: list[NDArray[np.int64]] = [np.zeros(0, dtype=int)]
        self.values: list[Array] = [np.zeros(0)]

    def add(self, rows: NDArray[np.int64], column: int, values: Array, step: float) -> None:
        self.rows.append(rows)
        self.columns.append(np.full(rows.size, column))
        self.values.append(values[rows] / step)

    def matrix(self, m: int, n: int) -> scipy.sparse.csr_matrix:
        places = (np.concatenate(self.rows), np.concatenate(self.columns))
        return scipy.sparse.csr_matrix((np.concatenate(self.values), places), shape=(m, n))


def _difference(
    forces: RestingForces, q: Array, lam: Array, columns: NDArray[np.int64], steps: Array
) -> tuple[Array, Array]:
    """Change of forces and spring rows by one step of the coordinates in the columns."""
    df, dr = np.zeros(q.size), np.zeros(forces.springs.size)
    for place, weight in _STENCIL:
        moved = q.copy()
        moved[columns] += place * steps[columns]
        f, rows = forces(moved, lam)
        df += weight * f
        dr += weight * rows
    return df, dr


def _steps(system: System, q: Array) -> Array:
    """A step (n,) of each coordinate that moves points by a thousandth of a metre or of the shortest spring."""
    lengths = [1.0]
    for spring in system.mechanism.linear_springs:
        if spring.length > 0.0:
            across = point_position(system, q, spring.b) - point_position(system, q, spring.a)
            lengths.append(max(float(np.linalg.norm(across)), _SHORTEST_SPRING))
    steps = np.full(system.n, _STEP * min(lengths))
    for body in system.bodies:
        # Modes of unit mass displace points by about one over the square root of the mass.
        steps[body.flexible] *= np.sqrt(body.integrals.m)
    return steps


def _spring_rows(system: System, springs: NDArray[np.int64]) -> list[list[int]]:
    """For each body the springs at joints that touch it, counted among springs."""
    number = {row: k for k, row in enumerate(springs.tolist())}
    touching: list[list[int]] = [[] for _ in system.bodies]
    for row, body in zip(*(part.tolist() for part in tied_bodies(system)), strict=True):
        if row in number:
            touching[body].append(number[row])
    return touching
