"""Branch of equilibria, followed by its arc length and hence past limit points.

Each point is found by Newton's iteration from a step along the tangent, constrained to the hyperplane normal to it
(pseudo-arclength continuation; Keller, Applications of Bifurcation Theory, 1977). Points at which the load fraction s
has a wanted value, and limit points at which it turns back, are solved for exactly.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import scipy
from scipy.sparse import csr_matrix

from paraflex.arrays import Array
from paraflex.dynamics.sparse import solved
from paraflex.errors import EquilibriumError, LimitPointError
from .equations import Equations, Unknowns

_MOST_ITERATIONS = 25
# Newton's iteration of a step has converged when it moves less than the first [sizes of the mechanism, rad], or less
# than the second without further progress: the limit set by rounding of stiff coordinates.
_CONVERGED, _ROUNDED = 1e-10, 1e-7
# An iteration at the start that moves links by more than this is shortened [sizes of the mechanism, rad].
_LONGEST_MOVE = 0.3
# The weight of displacements follows the largest of them up to this [sizes of the mechanism, rad].
_WHOLE = 1.0
# A smaller displacement under the whole load is rounding, as for a column that bends only when it buckles.
_NO_MOVE = 1e-12
# Largest residual of constraints after a step [sizes of the mechanism, rad].
_GAP = 1e-9
# Steps grow after this many iterations or fewer, by the second factor; they shrink by the third. The longest is the
# last, times the wanted step.
_FEW, _GROWTH, _SHRINK, _LONGEST = 4, 1.5, 0.5, 2.0
# Least cosine of the angle between the tangents of two consecutive points.
_STRAIGHT = 0.85
# The shortest step, as a fraction of the longest, and the largest number of steps of a branch.
_SHORTEST, _MOST_STEPS = 1e-6, 2000
# A branch has returned if links are this close to the start [sizes of the mechanism, rad].
_BACK = 1e-6
_LIMIT_ITERATIONS, _AT_LIMIT = 40, 1e-9
_LOOSE = "hold joints that turn or slide freely, start nearer to the equilibrium, or make links and springs stiffer"


class Point(NamedTuple):
    """A point of a branch.

    Attributes
    ----------
    at : Unknowns
        Coordinates, multipliers and load fraction.
    tangent : Unknowns
        Tangent of length one, in the direction in which the branch is followed.
    limit : bool
        Whether the point is a limit point, where the fraction turns back.
    """

    at: Unknowns
    tangent: Unknowns
    limit: bool = False


class _NewtonFailure(Exception):
    """Failure of Newton's iteration: it did not converge, or its matrix is singular."""


@dataclass(frozen=True)
class Branch:
    """The branch of equilibria through a start.

    Attributes
    ----------
    equations : Equations
        Equations of equilibrium.
    weight : float
        Weight of squared displacements [sizes of the mechanism, rad] relative to the squared fraction in arc lengths.
    """

    equations: Equations
    weight: float = 1.0

    def first(self) -> Point:
        """Find the equilibrium at load fraction zero nearest the start.

        Raises
        ------
        EquilibriumError
            No equilibrium is found, or held coordinates contradict the joints.
        """
        begin = self.equations.guess()
        try:
            found = self._solve(begin, self._load_factor_only(begin), 0.0, longest=_LONGEST_MOVE)
            if self.equations.gap(found) > _GAP:
                raise EquilibriumError("held coordinates contradict the joints", remedy="hold fewer coordinates")
            return Point(found, self._tangent(found, self._load_factor_only(found)))
        except _NewtonFailure:
            raise EquilibriumError("no static equilibrium is found near the start", remedy=_LOOSE) from None

    def follow(self, first: Point, steps: int, goal: float = 1.0) -> Iterator[Point]:
        """Yield points at multiples of a load fraction, and limit points, in the order of the branch, up to a goal.

        Parameters
        ----------
        first : Point
            Point at which the branch starts.
        steps : int
            Number of multiples up to one. If the branch turns back, multiples below zero are included.
        goal : float
            Fraction at which the branch ends; one by default.

        Raises
        ------
        LimitPointError
            The branch turns back and does not reach the goal.
        EquilibriumError
            The branch ends.
        """
        move = self._size(first.tangent._replace(s=0.0)) / max(abs(first.tangent.s), 1e-300)
        move = move if move > _NO_MOVE else 0.0
        branch = replace(self, weight=self.weight / move**2) if move > 0.0 else self
        here = Point(first.at, branch._tangent(first.at, branch._load_factor_only(first.at)))
        longest = _LONGEST * np.sqrt(2.0) / steps
        step, turned, furthest = 0.5 * longest, False, 0.0
        for _ in range(_MOST_STEPS):
            there, step = branch._next(here, step, longest)
            parts = [here, there]
            if here.tangent.s * there.tangent.s < 0.0:
                parts.insert(1, branch._limit(here, there))
                turned = True
            for a, b in pairwise(parts):
                yield from branch._between(a, b, steps, goal)
                furthest = max(furthest, b.at.s)
                if furthest >= goal:
                    return
                if b.limit:
                    yield b
            if turned and branch._back(first, here, there):
                break
            # Displacements are weighted by the largest so far: near a limit load steps grow with the bending of links.
            moved = min(_WHOLE, self._size(there.at.plus(first.at, -1.0)._replace(s=0.0)))
            if moved > move > 0.0:
                move, branch = moved, replace(self, weight=self.weight / moved**2)
                there = there._replace(tangent=branch._of_length_one(there.tangent))
            here = there
        raise self._ended(turned, furthest)

    def _ended(self, turned: bool, furthest: float) -> EquilibriumError:
        given = self.equations.conditions.description
        if turned:
            cause = (
                f"no equilibrium beyond load factor {furthest:.6g} ({given}): the branch turns back there, "
                "at a limit point, and does not go further"
            )
            return LimitPointError(cause, remedy=f"give at most {furthest:.4g} of it")
        return EquilibriumError(
            f"the branch of equilibria is followed for {_MOST_STEPS} steps and has only reached load factor "
            f"{furthest:.6g} ({given})", remedy="give less, or more where values are almost zero",
        )  # fmt: skip

    def _stopped(self, at: Unknowns) -> EquilibriumError:
        """Return the error of a branch that ends at a point: a displacement implied by others, or an unknown cause."""
        stuck = self.equations.dependent_travels(at)
        if stuck:
            names = ", ".join(one.name for one in stuck)
            return EquilibriumError(
                f"no equilibrium beyond load factor {at.s:.6g}: the travel of {names} follows from the joints and "
                "from other held and moved coordinates",
                remedy="leave it out, or hold and move less",
            )
        return EquilibriumError(
            f"no equilibrium is found beyond load factor {at.s:.6g} ({self.equations.conditions.description})",
            remedy="joints may not allow more, or links touch parts that the model lacks: give less",
        )

    def _next(self, here: Point, step: float, longest: float) -> tuple[Point, float]:
        """Return the point a step along, and the length of the next step."""
        shortest = _SHORTEST * longest
        while step > shortest:
            try:
                counted: list[int] = []
                found = self._solve(here.at.plus(here.tangent, step), here.tangent, None, counted=counted)
                tangent = self._tangent(found, here.tangent)
            except _NewtonFailure:
                step *= _SHRINK
                continue
            if self._product(tangent, here.tangent) < _STRAIGHT or self.equations.gap(found) > _GAP:
                step *= _SHRINK
                continue
            return Point(found, tangent), min(longest, step * (_GROWTH if counted[0] <= _FEW else 1.0))
        raise self._stopped(here.at)

    def _between(self, a: Point, b: Point, steps: int, goal: float) -> Iterator[Point]:
        """Yield points at multiples between two points, the second included, in the order of the branch."""
        if b.at.s > a.at.s:
            inside = range(int(np.floor(a.at.s * steps)) + 1, int(np.floor(min(b.at.s, goal) * steps)) + 1)
        else:
            inside = range(int(np.ceil(a.at.s * steps)) - 1, int(np.ceil(b.at.s * steps)) - 1, -1)
        for k in inside:
            try:
                yield self._at_fraction(a, b, k / steps)
            except _NewtonFailure:
                # This close to a limit point no Newton iteration at a given fraction converges.
                continue

    def _at_fraction(self, a: Point, b: Point, s: float) -> Point:
        """Return the point between two points at a fraction, interpolated and then solved."""
        length = self._size(b.at.plus(a.at, -1.0))
        values = [self._cubic(a, b, length, part).s - s for part in (0.0, 1.0)]
        if values[0] * values[1] > 0.0:
            part = 1.0
        else:
            part = float(scipy.optimize.brentq(lambda x: self._cubic(a, b, length, x).s - s, 0.0, 1.0))
        begin = self._cubic(a, b, length, part)._replace(s=s)
        found = self._solve(begin, self._load_factor_only(begin), s)
        return Point(found, self._tangent(found, a.tangent))

    @staticmethod
    def _cubic(a: Point, b: Point, length: float, part: float) -> Unknowns:
        """Return Hermite's interpolation between two points with their tangents."""
        x = part
        weights = ((1.0 + 2.0 * x) * (1.0 - x) ** 2, x**2 * (3.0 - 2.0 * x))
        slopes = (length * x * (1.0 - x) ** 2, length * x**2 * (x - 1.0))
        parts = [weights[0] * a.at.packed, weights[1] * b.at.packed]
        parts += [slopes[0] * a.tangent.packed, slopes[1] * b.tangent.packed]
        whole, n = np.sum(parts, axis=0), a.at.q.size
        return Unknowns(whole[:n], whole[n:-1], float(whole[-1]))

    def _limit(self, a: Point, b: Point) -> Point:
        """Find the limit point between two points by false position (Illinois)."""
        low, high = 0.0, self._product(b.at.plus(a.at, -1.0), a.tangent)
        value_low, value_high = a.tangent.s, b.tangent.s
        found, side = b, 0
        for _ in range(_LIMIT_ITERATIONS):
            step = (low * value_high - high * value_low) / (value_high - value_low)
            try:
                at = self._solve(a.at.plus(a.tangent, step), a.tangent, None)
                found = Point(at, self._tangent(at, a.tangent), limit=True)
            except _NewtonFailure:
                break
            value = found.tangent.s
            if abs(value) <= _AT_LIMIT or abs(high - low) <= 1e-14 * abs(high):
                break
            if value * value_low > 0.0:
                low, value_low = step, value
                value_high *= 0.5 if side == 1 else 1.0
                side = 1
            else:
                high, value_high = step, value
                value_low *= 0.5 if side == -1 else 1.0
                side = -1
        return found._replace(limit=True)

    def _back(self, first: Point, a: Point, b: Point) -> bool:
        """Return whether the branch passes through its first point between two points."""
        if not min(a.at.s, b.at.s) <= 0.0 <= max(a.at.s, b.at.s):
            return False
        try:
            found = self._at_fraction(a, b, 0.0)
        except _NewtonFailure:
            return False
        apart = found.at.q - first.at.q
        for body in self.equations.system.bodies:
            apart[body.angle] = (apart[body.angle] + np.pi) % (2.0 * np.pi) - np.pi
        return float(np.max(np.abs(apart / self.equations.scale))) < _BACK

    def _product(self, a: Unknowns, b: Unknowns) -> float:
        """Return the inner product of two changes, of coordinates and the fraction."""
        scale = self.equations.scale
        return self.weight * float((a.q / scale) @ (b.q / scale)) + a.s * b.s

    def _size(self, change: Unknowns) -> float:
        return float(np.sqrt(self._product(change, change)))

    def _load_factor_only(self, like: Unknowns) -> Unknowns:
        """Return a change of the fraction alone."""
        return Unknowns(np.zeros_like(like.q), np.zeros_like(like.mu), 1.0)

    def _change(self, at: Unknowns, across: Unknowns, f: Array, phi: Array, product: float) -> Unknowns:
        """Solve the linear equations at a point for a change with given forces (n,), rows and product with `across`.

        Multipliers of redundant rows are unchanged.
        """
        equations, found = self.equations, self.equations.matrices(at)
        (kept,) = equations.independent(found.rows)
        rows = csr_matrix(found.rows[kept])
        border = np.concatenate([self.weight * across.q / equations.scale**2, np.zeros(kept.size), [across.s]])
        inner = scipy.sparse.bmat([
            [found.stiffness, rows.T, csr_matrix(found.load[:, None])],
            [rows, None, csr_matrix(-equations.change[kept][:, None])],
        ])  # fmt: skip
        matrix = csr_matrix(scipy.sparse.vstack([inner, csr_matrix(border[None])]))
        n, units = equations.system.n, equations.units
        units = np.concatenate([units[:n], units[n:-1][kept], units[-1:]])
        try:
            change = solved(matrix, units, np.concatenate([f, phi[kept], [product]]))
        except np.linalg.LinAlgError:
            raise _NewtonFailure from None
        if not np.all(np.isfinite(change)):
            raise _NewtonFailure
        mu = np.zeros(phi.size)
        mu[kept] = change[n:-1]
        return Unknowns(change[:n], mu, float(change[-1]))

    def _tangent(self, at: Unknowns, along: Unknowns) -> Unknowns:
        """Return the tangent of length one at a point, in the direction of another."""
        return self._of_length_one(self._change(at, along, np.zeros_like(at.q), np.zeros_like(at.mu), 1.0))

    def _of_length_one(self, change: Unknowns) -> Unknowns:
        size = self._size(change)
        return Unknowns(change.q / size, change.mu / size, change.s / size)

    def _solve(
        self,
        begin: Unknowns,
        across: Unknowns,
        fraction: float | None,
        longest: float = np.inf,
        counted: list[int] | None = None,
    ) -> Unknowns:
        """Find an equilibrium by Newton iteration, normal to a direction or at a fraction.

        Raises `_NewtonFailure` if it fails.
        """
        at, before = begin, np.inf
        for number in range(1, _MOST_ITERATIONS + 1):
            f, phi = self.equations.residual(at)
            if not (np.all(np.isfinite(f)) and np.all(np.isfinite(phi))):
                raise _NewtonFailure
            left = -self._product(at.plus(begin, -1.0), across) if fraction is None else fraction - at.s
            change = self._change(at, across, -f, -phi, left)
            move = float(np.max(np.abs(change.q / self.equations.scale)))
            at = at.plus(change, min(1.0, longest / max(move, longest)))
            if move <= _CONVERGED or (move <= _ROUNDED and move > 0.1 * before):
                if counted is not None:
                    counted.append(number)
                return at
            if np.isinf(longest) and (move > 10.0 * before or (number > _MOST_ITERATIONS // 2 and move > before)):
                raise _NewtonFailure
            before = move
        raise _NewtonFailure
