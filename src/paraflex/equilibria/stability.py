"""Properties of an equilibrium: stability, natural frequencies, buckling, stiffness in named directions."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy
from scipy.sparse import csr_matrix

from paraflex.arrays import Array, brief
from paraflex.dynamics.linearise import DENSE_COORDINATES, LOWEST, admissible, all_modes, slowest, typical_square
from paraflex.dynamics.sparse import Saddle, solved
from .branch import Point
from .conditions import Coordinate
from .equations import Equations, Matrices, Unknowns

# Step of finite differences along the branch: motion of links [sizes of the mechanism, rad] and change of fraction.
_MOVE, _FRACTION = 1e-4, 1e-2
# Load stiffness below this fraction of the stiffness belongs to no buckling.
_NOTHING = 1e-9
# Weight of positions and angles, as a fraction of typical energies: they yield before links bend or stretch.
_RIGID_FIRST = 1e-6
# Number of the slowest vibrations that define typical energies.
_SLOWEST = 5
# Largest rotation of links until the fraction of buckling by the linear estimate [rad].
_MOST_TURN = 2.0 * np.pi
# Beyond this number of coordinates dense matrices take minutes.
_MOST_COORDINATES = 2000


class Vibrations(NamedTuple):
    """Small vibrations about an equilibrium, with held and moved coordinates kept.

    Attributes
    ----------
    squares : (k,) array
        Squares of the natural frequencies, ascending [rad^2/s^2]; negative for an unstable motion.
    shapes : (n, k) array
        Mode shapes of unit modal mass.
    complete : bool
        Whether these are all vibrations, not only the lowest.
    """

    squares: Array
    shapes: Array
    complete: bool
    __repr__ = brief

    @property
    def stable(self) -> bool:
        """Whether no motion is unstable."""
        return not np.any(self.squares < 0.0)


class Buckling(NamedTuple):
    """Load fractions at which another equilibrium branches off or the stiffness becomes singular, and their shapes.

    Attributes
    ----------
    factors : (b,) array
        Factors of all given loads and displacements, ascending, above the fraction of the equilibrium; NaN where there
        are fewer.
    shapes : (n, b) array
        Buckling shapes; the largest displacement or rotation is one [sizes of the mechanism, rad].
    reason : str
        Reason why there is no factor; empty if nothing buckles.
    """

    factors: Array
    shapes: Array
    reason: str
    __repr__ = brief


def vibrations(equations: Equations, found: Matrices) -> Vibrations:
    """Compute the small vibrations about an equilibrium.

    All loads are gradients of coordinates, so that the stiffness is symmetric up to rounding.
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
    """Compute buckling factors about an equilibrium: fractions s' at which K + (s' - s) dK/ds is singular.

    The derivative is taken along the branch, in displacements that follow the deflection with the least change of
    elastic energy. If links rotate, displacements that do not follow stretch them: to first order this couples
    stretching to bending, a loss of stiffness that second-order terms cancel.

    Parameters
    ----------
    equations : Equations
        Equations of equilibrium.
    point : Point
        Equilibrium and its tangent.
    found : Matrices
        Derivatives at the equilibrium.
    vibration : Vibrations
        Vibrations about the equilibrium.
    count : int
        Number of factors.
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
    """Return the stiffness (f, f) at a point nearby, in displacements that the rows allow there.

    They differ from `shapes` by the least elastic energy, and among these by the least positions and angles. `typical`
    is the energy of displacements by sizes of the mechanism.
    """
    found, elastic = equations.matrices(at), equations.elastic
    weight = np.where(elastic > 0.0, elastic / (_RIGID_FIRST * typical), equations.scale**-2.0)
    nearest = Saddle(csr_matrix(scipy.sparse.diags(weight)), found.rows)
    moved = shapes - np.column_stack([nearest.solve(0.0, found.rows @ shape)[0] for shape in shapes.T])
    return moved.T @ (found.stiffness @ moved)


def checked(ahead: Sequence[tuple[Point, Vibrations, Buckling]], count: int) -> Buckling:
    """Return the first equilibrium's buckling factors, none if later ones along the branch contradict them.

    If stable equilibria lead to a limit point, the factors are those of the limit point.
    """
    point, vibration, own = ahead[0]
    reached, lost, last = point.at.s, np.inf, own
    for there, moving, that in ahead[1:] if vibration.stable and not point.limit else ():
        if there.at.s <= reached:
            break
        # One square is zero at a limit point; if another is negative, the branch lost its stability before.
        if there.limit and np.all(moving.squares[1:2] > np.abs(moving.squares[:1])):
            return Buckling(that.factors[:count], that.shapes[:, :count], "")
        if there.limit or not moving.stable:
            lost = there.at.s
            break
        reached, last = there.at.s, that
    first = own.factors[0] if count else np.nan
    # Extrapolation from a step does not hold if the stiffness no longer decreases at a later one.
    stiffening = lost == np.inf and not last.reason and np.isnan(last.factors[:1]).any() and not np.isnan(first)
    if first > lost or (first <= reached and reached > point.at.s) or stiffening:
        until = ", as seen from which nothing buckles" if stiffening else ""
        until = f", unstable from {lost:.4g} on" if lost < np.inf else until
        return Buckling(
            np.full(count, np.nan), np.full_like(own.shapes[:, :count], np.nan),
            f"the branch contradicts the linear estimate: stable up to load factor {reached:.4g}{until}",
        )  # fmt: skip
    return Buckling(own.factors[:count], own.shapes[:, :count], own.reason)


def _largest_one(equations: Equations, shapes: Array) -> Array:
    """Scale shapes (n, k) to a largest coordinate of plus one [sizes of the mechanism, rad]."""
    relative = shapes / equations.scale[:, None]
    largest = np.take_along_axis(relative, np.argmax(np.abs(relative), axis=0)[None], axis=0)
    return shapes / np.where(largest == 0.0, 1.0, largest)


def stiffness(equations: Equations, at: Unknowns, found: Matrices, directions: Sequence[Coordinate]) -> Array:
    """Return force per unit displacement (directions,) of each coordinate [N/m, N m/rad]; infinite if it cannot move.

    Held and moved coordinates are kept, except the coordinate itself.
    """
    n = equations.system.n
    selected = equations.rows_named(directions, at.q)
    out = np.zeros(len(directions))
    for k, one in enumerate(directions):
        others = np.nonzero(equations.holding != equations.number[one])[0]
        rows, row = csr_matrix(found.rows[others]), csr_matrix(selected[k])
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
