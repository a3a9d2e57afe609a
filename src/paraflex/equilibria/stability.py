"""An equilibrium looked at closely: whether it is stable, its frequencies, buckling, stiffness in named directions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from paraflex.arrays import Array
from paraflex.dynamics.linearise import DENSE_COORDINATES, LOWEST, admissible, slowest, typical_square, undamped_modes
from paraflex.dynamics.sparse import solved
from paraflex.equilibria.branch import Point
from paraflex.equilibria.equations import Equations, Matrices, Unknowns
from paraflex.equilibria.given import Coordinate
from paraflex.linear.independent import unit_rows

Complex = NDArray[np.complex128]
# Differences along the branch move links by this [sizes of the mechanism, rad], and change the fraction by no more.
_MOVE, _FRACTION = 1e-4, 1e-2
# Of an eigenvalue that belongs to no buckling: load stiffness as a part of the stiffness.
_NOTHING = 1e-9
# The imaginary part of a real eigenvalue, as a part of it.
_COMPLEX = 1e-6


class Vibrations(NamedTuple):
    """Small vibrations about an equilibrium, what is held and moved kept.

    Attributes
    ----------
    squares : (k,) array
        Of natural frequencies, ascending [rad^2/s^2]; negative of a motion that grows.
    shapes : (n, k) array
        Of unit modal mass.
    complete : bool
        Whether these are all.
    """

    squares: Array
    shapes: Array
    complete: bool

    @property
    def stable(self) -> bool:
        """Whether no motion grows."""
        return not np.any(self.squares < 0.0)


class Buckling(NamedTuple):
    """Fractions of what is given at which another equilibrium branches off or the stiffness ends, and shapes.

    Attributes
    ----------
    factors : (b,) array
        Ascending, of all that is given; those above the fraction of the equilibrium, NaN where there are fewer.
    shapes : (n, b) array
        The largest displacement or turn is one [sizes of the mechanism, rad].
    """

    factors: Array
    shapes: Array


def vibrations(equations: Equations, found: Matrices) -> Vibrations:
    """Small vibrations about an equilibrium.

    All loads are gradients of coordinates, so that the stiffness is symmetric but for rounding.
    """
    K, M, C, elastic = found.stiffness, found.mass, found.rows, equations.elastic
    typical = typical_square(elastic, csr_matrix(K - scipy.sparse.diags(elastic)), M)
    symmetric = csr_matrix(0.5 * (K + K.T))
    if equations.system.n > DENSE_COORDINATES:
        freedoms = equations.system.n - equations.independent(C)[0].size
        low = slowest(symmetric, M, C, typical, min(LOWEST, freedoms), freedoms)
        return Vibrations(low.squares, low.shapes, False)
    basis = admissible(C, elastic, typical)
    if not basis.shape[1]:
        return Vibrations(np.zeros(0), np.zeros((elastic.size, 0)), True)
    squares, shapes = undamped_modes(basis.T @ (M @ basis), basis.T @ (symmetric @ basis), typical)
    return Vibrations(squares, basis @ shapes, True)


def _eigenpairs(a: Array, b: Array) -> tuple[Complex, Complex]:
    """Eigenvalues (k,) and vectors (k, k) of a x = value b x."""
    values, vectors = (np.asarray(part, dtype=complex) for part in scipy.linalg.eig(a, b))
    return values, vectors


def buckling(equations: Equations, point: Point, vibration: Vibrations, count: int) -> Buckling:
    """Factors of buckling about an equilibrium: fractions s' with a singular K + (s' - s) dK/ds.

    The derivative is along the branch and takes the deflection with it.
    """
    n = equations.system.n
    none = Buckling(np.full(count, np.nan), np.full((n, count), np.nan))
    if not count or not vibration.complete or not vibration.squares.size:
        return none
    if point.limit or abs(point.tangent.s) < _NOTHING:
        factors, shapes = none
        factors[0], shapes[:, 0] = point.at.s, _largest_one(equations, vibration.shapes[:, :1])[:, 0]
        return Buckling(factors, shapes)
    along = point.tangent
    reach = float(np.max(np.abs(along.q / equations.scale)))
    step = min(_FRACTION / abs(along.s), _MOVE / max(reach, 1e-300)) * np.sign(along.s)
    ahead, behind = (_reduced(equations, point.at.plus(along, side * step), vibration.shapes) for side in (1.0, -1.0))
    change = (ahead - behind) / (2.0 * step * along.s)
    change, squares = 0.5 * (change + change.T), vibration.squares
    if np.all(squares > 0.0):
        inverse, vectors = scipy.linalg.eigh(-change, np.diag(squares))
    else:
        found, vectors = _eigenpairs(-change, np.diag(squares))
        real = np.abs(found.imag) <= _COMPLEX * np.abs(found)
        inverse, vectors = found.real[real], vectors.real[:, real]
    typical = float(np.max(np.abs(np.diag(change)) / np.abs(squares), initial=0.0))
    order = [k for k in np.argsort(-inverse) if inverse[k] > _NOTHING * typical and inverse[k] > _NOTHING][:count]
    factors, shapes = none
    factors[: len(order)] = point.at.s + 1.0 / inverse[order]
    shapes[:, : len(order)] = _largest_one(equations, vibration.shapes @ vectors[:, order])
    return Buckling(factors, shapes)


def _reduced(equations: Equations, at: Unknowns, shapes: Array) -> Array:
    """Stiffness (f, f) at a point near by, in displacements nearest to shapes that the rows allow there."""
    found = equations.matrices(at)
    scale = equations.scale
    rows = unit_rows(found.rows.toarray() * scale)
    moved = shapes / scale[:, None]
    moved = scale[:, None] * (moved - np.linalg.lstsq(rows, rows @ moved, rcond=1e-10)[0])
    return moved.T @ (found.stiffness @ moved)


def _largest_one(equations: Equations, shapes: Array) -> Array:
    """Shapes (n, k) with a largest coordinate of one [sizes of the mechanism, rad]; its sign is positive."""
    relative = shapes / equations.scale[:, None]
    largest = np.take_along_axis(relative, np.argmax(np.abs(relative), axis=0)[None], axis=0)
    return shapes / np.where(largest == 0.0, 1.0, largest)


def stiffness(equations: Equations, at: Unknowns, found: Matrices, directions: Sequence[Coordinate]) -> Array:
    """Force for a unit displacement (directions,) of each coordinate [N/m, N m/rad]; infinite where it cannot move.

    What is held and moved stays, the coordinate itself set free.
    """
    n = equations.system.n
    wanted = equations.rows_named(directions, at.q)
    out = np.zeros(len(directions))
    for k, one in enumerate(directions):
        others = np.nonzero(equations.holding != equations.number(one))[0]
        rows, row = csr_matrix(found.rows[others]), csr_matrix(wanted[k])
        kept, free = equations.independent(rows, row)
        if not free.size:
            out[k] = np.inf
            continue
        C = csr_matrix(scipy.sparse.vstack([rows[kept], row]))
        units = np.concatenate([equations.units[:n], equations.units[n:-1][others[kept]], [0.0]])
        units[-1] = np.max(equations.elastic * equations.scale**2, initial=0.0) or 1.0
        right = np.zeros(n + kept.size + 1)
        right[-1] = 1.0
        try:
            out[k] = -solved(csr_matrix(scipy.sparse.bmat([[found.stiffness, C.T], [C, None]])), units, right)[-1]
        except np.linalg.LinAlgError:
            out[k] = np.nan
    return out
