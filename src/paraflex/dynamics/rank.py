"""Redundant constraint rows: dependences between rows, and multipliers of least norm."""

from dataclasses import dataclass

import numpy as np
import scipy

from paraflex.arrays import Array, Indices
from paraflex.kernel.linear import factor_system
from .sparse import body_masses, sparse_jacobian
from .system import DENSE_ROWS, System

# A constraint row with an independent part smaller than this fraction of the largest is redundant.
DEPENDENT = 1e-9
# The same for rows compared by the squares of their sizes, which hold half of the digits.
_DEPENDENT_SQUARED = 1e-12
# Rows with a smaller share of a dependence than this take no part in it.
NO_PART = 1e-6


@dataclass(frozen=True)
class Dependence:
    """Redundant constraint rows of a system at a pose.

    Attributes
    ----------
    kept, dropped : arrays of int
        Row numbers. The choice is not unique: dropped rows are the last pivots of a factorisation.
    coefficients : (kept, dropped) array
        Coefficients by which each dropped row of Phi_q is a combination of the kept ones.
    """

    kept: Indices
    dropped: Indices
    coefficients: Array

    @property
    def rank(self) -> int:
        """Rank of the constraint Jacobian."""
        return self.kept.size

    def sources(self, k: int) -> Indices:
        """Return the row numbers of which the k-th dropped row is a combination."""
        part = np.abs(self.coefficients[:, k])
        return self.kept[part > NO_PART * max(1.0, part.max(initial=0.0))]

    def conflict(self, residual: Array) -> Array:
        """Return the residual of each dropped row less that implied by its sources; residual (m,)."""
        return residual[self.dropped] - self.coefficients.T @ residual[self.kept]

    def least_norm(self, multipliers: Array) -> Array:
        """Return multipliers (m,) of the same constraint forces with the least sum of squares."""
        free = self.self_stresses(np.ones(multipliers.size)).T
        return multipliers - free @ np.linalg.lstsq(free, multipliers, rcond=None)[0]

    def self_stresses(self, units: Array) -> Array:
        """Return multipliers (dropped, m) that exert no force, the largest times units (m,) being one.

        Multipliers of redundant rows are determined up to these.
        """
        out = np.zeros((self.dropped.size, units.size))
        out[:, self.kept], out[:, self.dropped] = -self.coefficients.T, np.eye(self.dropped.size)
        return out / np.max(np.abs(out * units), axis=1, keepdims=True)


def constraint_jacobian(system: System, q: Array) -> scipy.sparse.csr_matrix:
    """Return Phi_q (m, n) at q as a sparse matrix; zero in the rows of springs and dampers."""
    return sparse_jacobian(system, q) if system.m > DENSE_ROWS else scipy.sparse.csr_matrix(system.jacobian(q))


def dependence(
    system: System, q: Array, threshold: float = DEPENDENT, count: int | None = None,
    acting: Indices | None = None,
) -> Dependence:  # fmt: skip
    """Find the redundant constraint rows at q.

    Parameters
    ----------
    system : System
        System of the mechanism.
    q : (n,) array
        Coordinates of the pose.
    threshold : float
        Independent part below which a row is redundant, as a fraction of the largest.
    count : int, optional
        Number of redundant rows if known, in place of the threshold.
    acting : (c,) array, optional
        Constraint rows that are considered; all by default.
    """
    rigid = np.nonzero(system.constrained)[0] if acting is None else acting
    if rigid.size == 0:
        return Dependence(rigid, rigid, np.zeros((0, 0)))
    if rigid.size > DENSE_ROWS:
        every = np.nonzero(system.constrained)[0]
        found = _sparse(system, q, every, threshold, count)
        if rigid.size == every.size:
            return found
        # Rows that are independent together with others are independent.
        if count is None and not found.dropped.size:
            return Dependence(rigid, found.dropped, np.zeros((rigid.size, 0)))
    return _dense(system, q, rigid, threshold, count)


def _dense(system: System, q: Array, rigid: Indices, threshold: float, count: int | None) -> Dependence:
    """Find the dependence by a pivoted QR factorisation of the dimensionless Phi_q^T."""
    units, columns = system.row_units[rigid], system.units.copy()
    for body in system.bodies:
        # Elastic coordinates have unit modal mass: in this unit they move points by about the size.
        columns[body.flexible] *= system.size * np.sqrt(np.real(body.integrals.m))
    jacobian = system.jacobian(q)[rigid] * columns / units[:, None]
    factors = scipy.linalg.qr(jacobian.T, mode="r", pivoting=True)
    upper, order = np.asarray(factors[0]), np.asarray(factors[-1])
    size = np.abs(np.diag(upper))
    rank = int(np.sum(size > threshold * size.max(initial=0.0))) if count is None else rigid.size - count
    coefficients = scipy.linalg.solve_triangular(upper[:rank, :rank], upper[:rank, rank:])
    kept, dropped = order[:rank], order[rank:]
    return Dependence(rigid[kept], rigid[dropped], coefficients / units[kept][:, None] * units[dropped])


def _sparse(system: System, q: Array, rigid: Indices, threshold: float, count: int | None) -> Dependence:
    """Find the dependence by the Cholesky factor of Phi_q M^-1 Phi_q^T as in runs, row by row within its envelope."""
    workspace = system.workspace()
    factor_system(system.packed, 0.0, q, workspace)
    rows = system.packed.rows[rigid]
    # Diagonals of the factor hold reciprocals, zero for dependent rows.
    inverse = workspace.schur[rows["start"] + rigid - rows["first"]]
    jacobian = sparse_jacobian(system, q)[rigid]
    inverse_mass = scipy.sparse.block_diag([np.linalg.inv(M) for M in body_masses(system, q)], format="csr")
    schur = (jacobian @ inverse_mass @ jacobian.T).tocsc()
    with np.errstate(divide="ignore"):
        part = np.where(inverse > 0.0, 1.0 / inverse**2, 0.0) / schur.diagonal()
    if count is None:
        dependent = part <= max(threshold**2, _DEPENDENT_SQUARED)
    else:
        dependent = np.zeros(rigid.size, dtype=bool)
        dependent[np.argsort(part)[:count]] = True
    kept, dropped = np.nonzero(~dependent)[0], np.nonzero(dependent)[0]
    across = schur[kept][:, dropped].toarray()
    coefficients = scipy.sparse.linalg.splu(schur[kept][:, kept].tocsc()).solve(across) if dropped.size else across
    return Dependence(rigid[kept], rigid[dropped], coefficients)


def redundant_rows(system: System, q: Array, threshold: float = DEPENDENT) -> list[str]:
    """Return the names of the redundant constraint rows at q: see `dependence`."""
    return sorted(system.rows[i] for i in dependence(system, q, threshold).dropped)


def involved(system: System, found: Dependence, k: int) -> list[str]:
    """Return the drives, joints and gears, in this order, of the k-th dropped row and its sources."""
    rows = [found.dropped[k], *found.sources(k)]
    names = dict.fromkeys(joint_of_row(system.rows[row]) for row in rows)
    prescribed = {motion.name for motion in system.mechanism.prescribed}
    return sorted(names, key=lambda name: name not in prescribed)


def joint_of_row(row: str) -> str:
    """Return the joint or prescribed motion that a row belongs to: "B1" for "B1 x"."""
    return row.rsplit(" ", 1)[0]
