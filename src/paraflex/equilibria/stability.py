"""An equilibrium looked at closely: whether it is stable, its frequencies, buckling, stiffness in named directions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy
from scipy.sparse import csr_matrix

from paraflex.arrays import Array
from paraflex.dynamics.linearise import DENSE_COORDINATES, LOWEST, admissible, all_modes, slowest, typical_square
from paraflex.dynamics.sparse import Saddle, solved
from paraflex.equilibria.branch import Point
from paraflex.equilibria.equations import Equations, Matrices, Unknowns
from paraflex.equilibria.given import Coordinate

# Differences along the branch move links by this [sizes of the mechanism, rad], and change the fraction by no more.
_MOVE, _FRACTION = 1e-4, 1e-2
# Of an eigenvalue that belongs to no buckling: load stiffness as a part of the stiffness.
_NOTHING = 1e-9
# Places and turns of links give way before links bend or stretch: what they cost, as a part of typical energies.
_RIGID_FIRST = 1e-6
# Typical energies are those of so many slowest vibrations.
_SLOWEST = 5
# Links turn by no more until the fraction at which something buckles by a linear estimate [rad].
_MOST_TURN = 2.0 * np.pi
# Of more coordinates dense matrices take minutes.
_MOST_COORDINATES = 2000


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
    reason : str
        Why there is no factor; empty where nothing buckles.
    """

    factors: Array
    shapes: Array
    reason: str


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
    return Vibrations(*all_modes(symmetric, M, C, elastic, typical), True)


def buckling(equations: Equations, point: Point, found: Matrices, vibration: Vibrations, count: int) -> Buckling:
    """Factors of buckling about an equilibrium: fractions s' with a singular K + (s' - s) dK/ds.

    The derivative is along the branch, in displacements that follow the deflection with the least change of elastic
    energy. Where links turn, displacements that do not follow stretch them: to first order that couples what stretches
    links to what bends them, a loss of stiffness that terms of second order cancel.
    """
    factors, shapes = np.full(count, np.nan), np.full((equations.system.n, count), np.nan)
    along, squares = point.tangent, vibration.squares
    if not count or not squares.size:
        return Buckling(factors, shapes, "")
    if point.limit or abs(along.s) < _NOTHING:
        factors[0], shapes[:, 0] = point.at.s, _largest_one(equations, vibration.shapes[:, :1])[:, 0]
        return Buckling(factors, shapes, "")
    if squares[0] <= 0.0 or equations.system.n > _MOST_COORDINATES:
        reason = f"more than {_MOST_COORDINATES} coordinates" if squares[0] > 0.0 else "the equilibrium is not stable"
        return Buckling(factors, shapes, reason)
    basis, stiffness = vibration.shapes, np.diag(squares)
    if not vibration.complete:
        basis = admissible(found.rows, found.mass, equations.elastic, squares[0])
        stiffness = basis.T @ (found.stiffness @ basis)
    slow = vibration.shapes[:, :_SLOWEST] / equations.scale[:, None]
    typical = float(np.median(squares[:_SLOWEST] / np.sum(slow**2, axis=0)))
    reach = float(np.max(np.abs(along.q / equations.scale)))
    step = min(_FRACTION / abs(along.s), _MOVE / max(reach, 1e-300)) * np.sign(along.s)
    ahead, behind = (_reduced(equations, point.at.plus(along, side * step), basis, typical) for side in (1.0, -1.0))
    change = (behind - ahead) / (2.0 * step * along.s)
    try:
        inverse, vectors = (part[..., ::-1] for part in scipy.linalg.eigh(change + change.T, stiffness + stiffness.T))
    except np.linalg.LinAlgError:
        return Buckling(factors, shapes, "the stiffness is singular to rounding")
    q = along.q / along.s
    turn = max(abs(q[body.angle]) for body in equations.system.bodies)
    turn += float(np.max(np.abs(equations.system.slope_rows @ q), initial=0.0))
    known = inverse > _NOTHING * max(1.0, *np.abs(inverse))
    which = np.flatnonzero(known & (_MOST_TURN * inverse > turn))[:count]
    factors[: which.size] = point.at.s + 1.0 / inverse[which]
    shapes[:, : which.size] = _largest_one(equations, basis @ vectors[:, which])
    far = "links would turn by more than a full turn before anything buckles by the linear estimate"
    return Buckling(factors, shapes, far if known.any() and not which.size else "")


def _reduced(equations: Equations, at: Unknowns, shapes: Array, typical: float) -> Array:
    """Stiffness (f, f) at a point near by, in displacements that the rows allow there.

    They differ from shapes by as little elastic energy as can be, and within that by least places and turns. Typical
    is the energy of displacements by sizes of the mechanism.
    """
    found, elastic = equations.matrices(at), equations.elastic
    weight = np.where(elastic > 0.0, elastic / (_RIGID_FIRST * typical), equations.scale**-2.0)
    nearest = Saddle(csr_matrix(scipy.sparse.diags(weight)), found.rows)
    moved = shapes - np.column_stack([nearest.solve(0.0, found.rows @ shape)[0] for shape in shapes.T])
    return moved.T @ (found.stiffness @ moved)


def checked(ahead: Sequence[tuple[Point, Vibrations, Buckling]], count: int) -> Buckling:
    """Factors of the first of some equilibria along their branch, none where the others contradict the first.

    Where stable equilibria lead to a limit point it is that of the limit point.
    """
    point, vibration, own = ahead[0]
    reached, lost = point.at.s, np.inf
    for there, moving, that in ahead[1:] if vibration.stable and not point.limit else ():
        if there.at.s <= reached:
            break
        # One square is zero at a limit point; where another is negative the branch has lost its stability before.
        if there.limit and np.all(moving.squares[1:2] > np.abs(moving.squares[:1])):
            return Buckling(that.factors[:count], that.shapes[:, :count], "")
        if there.limit or not moving.stable:
            lost = there.at.s
            break
        reached = there.at.s
    first = own.factors[0] if count else np.nan
    if first > lost or (first <= reached and reached > point.at.s):
        until = f", unstable from {lost:.4g} on" if lost < np.inf else ""
        return Buckling(
            np.full(count, np.nan), np.full_like(own.shapes[:, :count], np.nan),
            f"the branch contradicts the linear estimate: stable up to {reached:.4g} of what is given{until}",
        )  # fmt: skip
    return Buckling(own.factors[:count], own.shapes[:, :count], own.reason)


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
        others = np.nonzero(equations.holding != equations.number[one])[0]
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
