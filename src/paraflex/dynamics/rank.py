"""Redundant constraint rows: which rows follow from which others, and multipliers of least norm."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from paraflex.arrays import Array
from paraflex.dynamics.sparse import body_masses, sparse_jacobian
from paraflex.dynamics.system import System
from paraflex.kernel.linear import factor_system
from paraflex.kernel.packed import CONSTRAINT

# A constraint row whose independent part is smaller than this fraction of the largest follows from the others.
DEPENDENT = 1e-9
# The same where rows are compared by the squares of their sizes, which hold half of the digits.
_DEPENDENT_SQUARED = 1e-12
# Up to so many rows a dense factorisation with pivots is as fast as a sparse one, and finer.
DENSE_ROWS = 400
# Rows with less than this part in a dependence have none in it.
NO_PART = 1e-6


@dataclass(frozen=True)
class Dependence:
    """Redundant constraint rows of a system at a pose.

    Attributes
    ----------
    kept, dropped : arrays of int
        Row numbers. There is a choice: the rows dropped are those that a factorisation comes to last.
    coefficients : (kept, dropped) array
        Each dropped row of Phi_q is this combination of the kept ones.
    """

    kept: NDArray[np.int64]
    dropped: NDArray[np.int64]
    coefficients: Array

    @property
    def rank(self) -> int:
        """Rank of the constraint Jacobian."""
        return self.kept.size

    def sources(self, k: int) -> NDArray[np.int64]:
        """Row numbers from which the k-th dropped row follows."""
        part = np.abs(self.coefficients[:, k])
        return self.kept[part > NO_PART * max(1.0, part.max(initial=0.0))]

    def conflict(self, residual: Array) -> Array:
        """Residual of each dropped row less that implied by the rows it follows from; residual (m,)."""
        return residual[self.dropped] - self.coefficients.T @ residual[self.kept]

    def least_norm(self, multipliers: Array) -> Array:
        """Multipliers (m,) of the same constraint forces with the least sum of squares."""
        free = self.self_stresses(np.ones(multipliers.size)).T
        return multipliers - free @ np.linalg.lstsq(free, multipliers, rcond=None)[0]

    def self_stresses(self, units: Array) -> Array:
        """Multipliers (dropped, m) that exert no force, the largest times units (m,) of size one.

        What redundant rows carry is determined up to these.
        """
        out = np.zeros((self.dropped.size, units.size))
        out[:, self.kept], out[:, self.dropped] = -self.coefficients.T, np.eye(self.dropped.size)
        return out / np.max(np.abs(out * units), axis=1, keepdims=True)


def constraint_jacobian(system: System, q: Array) -> scipy.sparse.csr_matrix:
    """Phi_q (m, n) at q as a sparse matrix; zero in the rows of springs and dampers."""
    return sparse_jacobian(system, q) if system.m > DENSE_ROWS else scipy.sparse.csr_matrix(system.jacobian(q))


def dependence(
    system: System, q: Array, threshold: float = DEPENDENT, count: int | None = None,
    acting: NDArray[np.int64] | None = None,
) -> Dependence:  # fmt: skip
    """Redundant constraint rows at q.

    Parameters
    ----------
    system : System
    q : (n,) array
    threshold : float
        A row does where its independent part is smaller than this, as a fraction of the largest.
    count : int, optional
        How many rows do, in place of the threshold, where that is known.
    acting : (c,) array, optional
        The constraint rows that count; all by default.
    """
    rigid = np.nonzero(system.packed.rows["kind"] == CONSTRAINT)[0] if acting is None else acting
    if rigid.size == 0:
        return Dependence(rigid, rigid, np.zeros((0, 0)))
    if rigid.size <= DENSE_ROWS or acting is not None:
        return _dense(system, q, rigid, threshold, count)
    return _sparse(system, q, rigid, threshold, count)


def _dense(system: System, q: Array, rigid: NDArray[np.int64], threshold: float, count: int | None) -> Dependence:
    """Dependence by a QR factorisation of Phi_q^T with pivots, without dimension."""
    units, columns = system.row_units[rigid], system.units.copy()
    for body in system.bodies:
        # Elastic coordinates are of unit modal mass: with this unit they move points by about the size.
        columns[body.flexible] *= system.size * np.sqrt(np.real(body.integrals.m))
    jacobian = system.jacobian(q)[rigid] * columns / units[:, None]
    factors = scipy.linalg.qr(jacobian.T, mode="r", pivoting=True)
    upper, order = np.asarray(factors[0]), np.asarray(factors[-1])
    size = np.abs(np.diag(upper))
    rank = int(np.sum(size > threshold * size.max(initial=0.0))) if count is None else rigid.size - count
    coefficients = scipy.linalg.solve_triangular(upper[:rank, :rank], upper[:rank, rank:])
    kept, dropped = order[:rank], order[rank:]
    return Dependence(rigid[kept], rigid[dropped], coefficients / units[kept][:, None] * units[dropped])


def _sparse(system: System, q: Array, rigid: NDArray[np.int64], threshold: float, count: int | None) -> Dependence:
    """Dependence by the Cholesky factor of Phi_q M^-1 Phi_q^T as in runs, row by row within its envelope."""
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
    """Names of constraint rows that follow from others at q: see `dependence`."""
    return sorted(system.rows[i] for i in dependence(system, q, threshold).dropped)


def involved(system: System, found: Dependence, k: int) -> list[str]:
    """Joints, gears and prescribed motions, these first, of the k-th dropped row and its sources."""
    rows = [found.dropped[k], *found.sources(k)]
    names = dict.fromkeys(joint_of_row(system.rows[row]) for row in rows)
    prescribed = {motion.name for motion in system.mechanism.prescribed}
    return sorted(names, key=lambda name: name not in prescribed)


def joint_of_row(row: str) -> str:
    """The joint or prescribed motion that a row belongs to: "B1" of "B1 x"."""
    return row.rsplit(" ", 1)[0]
