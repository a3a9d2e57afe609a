"""A branch of equilibria, followed by its arc length, so that it goes on past limit points.

Each point is found by Newton's iteration from a step along the tangent, across which the iteration does not move
(pseudo-arclength continuation; Keller, Applications of Bifurcation Theory, 1977). Where the fraction s of what is given
passes a wanted value, and where it turns back, the point there is found exactly.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import scipy
from scipy.sparse import csr_matrix

from paraflex.arrays import Array
from paraflex.dynamics.sparse import solved
from paraflex.equilibria.equations import Equations, Unknowns
from paraflex.errors import EquilibriumError, LimitPointError

_MOST_ITERATIONS = 25
# Newton's iteration of a step has converged when it moves less than the first [sizes of the mechanism, rad], or less
# than the second and no nearer by it: what rounding of stiff coordinates allows.
_CONVERGED, _ROUNDED = 1e-10, 1e-7
# An iteration that moves links by more than this is shortened, at the start [sizes of the mechanism, rad].
_LONGEST_MOVE = 0.3
# Steps grow with displacements up to these [sizes of the mechanism, rad].
_WHOLE = 1.0
# What moves by less under the whole of what is given does so by rounding, as a column that bends only when it buckles.
_NO_MOVE = 1e-12
# What a step may leave of constraints [sizes of the mechanism, rad].
_GAP = 1e-9
# Steps grow after so few iterations and shrink by these parts; none is longer than this many of the wanted steps.
_FEW, _GROWTH, _SHRINK, _LONGEST = 4, 1.5, 0.5, 2.0
# The cosine of the angle between the tangents of two points next to each other is not less.
_STRAIGHT = 0.85
# The shortest step, as a part of the first, and the most that a branch is followed for.
_SHORTEST, _MOST_STEPS = 1e-6, 2000
# A branch has come back where links are so near to the start [sizes of the mechanism, rad].
_BACK = 1e-6
_LIMIT_ITERATIONS, _AT_LIMIT = 40, 1e-9
_LOOSE = "hold what turns or slides freely, start nearer to the equilibrium, or make links and springs stiffer"


class Point(NamedTuple):
    """A point of a branch.

    Attributes
    ----------
    at : Unknowns
    tangent : Unknowns
        Of length one, in the direction in which the branch is followed.
    limit : bool
        Whether the fraction turns back here.
    """

    at: Unknowns
    tangent: Unknowns
    limit: bool = False


class _Failed(Exception):
    """Newton's iteration did not converge, or its matrix is singular."""


@dataclass(frozen=True)
class Branch:
    """The branch of equilibria through a start.

    Attributes
    ----------
    equations : Equations
    weight : float
        Of the square of displacements [sizes of the mechanism, rad] beside that of the fraction, in lengths.
    """

    equations: Equations
    weight: float = 1.0

    def first(self) -> Point:
        """The equilibrium with nothing of what is given, nearest the start.

        Raises
        ------
        EquilibriumError
            None is found.
        """
        begin = self.equations.guess()
        try:
            found = self._solve(begin, self._only_s(begin), 0.0, longest=_LONGEST_MOVE)
            if self.equations.gap(found) > _GAP:
                raise EquilibriumError("what is held contradicts the joints", remedy="hold fewer coordinates")
            return Point(found, self._tangent(found, self._only_s(found)))
        except _Failed:
            raise EquilibriumError("no static equilibrium is found near the start", remedy=_LOOSE) from None

    def follow(self, first: Point, steps: int, goal: float = 1.0) -> Iterator[Point]:
        """Points at multiples of a fraction of one, and limit points, in the order of the branch, until a goal.

        Parameters
        ----------
        first : Point
        steps : int
            How many multiples there are up to one. Where the branch turns back multiples below zero are met too.
        goal : float
            Fraction at which the branch ends.

        Raises
        ------
        LimitPointError
            The branch turns back and does not come to the goal.
        EquilibriumError
            It ends.
        """
        move = self._size(first.tangent._replace(s=0.0)) / max(abs(first.tangent.s), 1e-300)
        move = move if move > _NO_MOVE else 0.0
        branch = replace(self, weight=self.weight / move**2) if move > 0.0 else self
        here = Point(first.at, branch._tangent(first.at, branch._only_s(first.at)))
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
            # Displacements count by the largest so far: near the limit of a load steps grow with how links bend.
            moved = min(_WHOLE, self._size(there.at.plus(first.at, -1.0)._replace(s=0.0)))
            if moved > move > 0.0:
                move, branch = moved, replace(self, weight=self.weight / moved**2)
                there = there._replace(tangent=branch._of_length_one(there.tangent))
            here = there
        raise self._ended(turned, furthest)

    def _ended(self, turned: bool, furthest: float) -> EquilibriumError:
        given = self.equations.given.words
        if turned:
            cause = (
                f"no equilibrium with more than {furthest:.6g} of what is given, {given}: the branch turns back there, "
                "at a limit point, and does not come to more"
            )
            return LimitPointError(cause, remedy=f"give at most {furthest:.4g} of it")
        return EquilibriumError(
            f"the branch of equilibria is followed for {_MOST_STEPS} steps and has come to {furthest:.6g} of what is "
            f"given only, {given}", remedy="give less, or more where it is next to nothing",
        )  # fmt: skip

    def _stopped(self, at: Unknowns) -> EquilibriumError:
        """Why no equilibrium is found beyond a point: a travel that follows from others, or what is not known."""
        stuck = self.equations.dependent_travels(at)
        if stuck:
            names = ", ".join(one.name for one in stuck)
            return EquilibriumError(
                f"no equilibrium beyond {at.s:.6g} of what is given: the travel of {names} follows from the joints and "
                "from what else is held and moved",
                remedy="leave it out, or hold and move less",
            )
        return EquilibriumError(
            f"no equilibrium is found beyond {at.s:.6g} of what is given, {self.equations.given.words}",
            remedy="joints may not allow more, or links touch what the model has not: give less",
        )

    def _next(self, here: Point, step: float, longest: float) -> tuple[Point, float]:
        """The point a step along, and the length of the next step."""
        shortest = _SHORTEST * longest
        while step > shortest:
            try:
                counted: list[int] = []
                found = self._solve(here.at.plus(here.tangent, step), here.tangent, None, counted=counted)
                tangent = self._tangent(found, here.tangent)
            except _Failed:
                step *= _SHRINK
                continue
            if self._product(tangent, here.tangent) < _STRAIGHT or self.equations.gap(found) > _GAP:
                step *= _SHRINK
                continue
            return Point(found, tangent), min(longest, step * (_GROWTH if counted[0] <= _FEW else 1.0))
        raise self._stopped(here.at)

    def _between(self, a: Point, b: Point, steps: int, goal: float) -> Iterator[Point]:
        """Points at multiples between two points, the second included, in the order of the branch."""
        if b.at.s > a.at.s:
            inside = range(int(np.floor(a.at.s * steps)) + 1, int(np.floor(min(b.at.s, goal) * steps)) + 1)
        else:
            inside = range(int(np.ceil(a.at.s * steps)) - 1, int(np.ceil(b.at.s * steps)) - 1, -1)
        for k in inside:
            try:
                yield self._at_fraction(a, b, k / steps)
            except _Failed:
                # So near to a limit point that no Newton iteration with a given fraction converges.
                continue

    def _at_fraction(self, a: Point, b: Point, s: float) -> Point:
        """The point between two points at a fraction: interpolated, then solved."""
        length = self._size(b.at.plus(a.at, -1.0))
        values = [self._cubic(a, b, length, part).s - s for part in (0.0, 1.0)]
        if values[0] * values[1] > 0.0:
            part = 1.0
        else:
            part = float(scipy.optimize.brentq(lambda x: self._cubic(a, b, length, x).s - s, 0.0, 1.0))
        begin = self._cubic(a, b, length, part)._replace(s=s)
        found = self._solve(begin, self._only_s(begin), s)
        return Point(found, self._tangent(found, a.tangent))

    @staticmethod
    def _cubic(a: Point, b: Point, length: float, part: float) -> Unknowns:
        """Hermite's interpolation between two points with their tangents."""
        x = part
        weights = ((1.0 + 2.0 * x) * (1.0 - x) ** 2, x**2 * (3.0 - 2.0 * x))
        slopes = (length * x * (1.0 - x) ** 2, length * x**2 * (x - 1.0))
        parts = [weights[0] * a.at.packed, weights[1] * b.at.packed]
        parts += [slopes[0] * a.tangent.packed, slopes[1] * b.tangent.packed]
        whole, n = np.sum(parts, axis=0), a.at.q.size
        return Unknowns(whole[:n], whole[n:-1], float(whole[-1]))

    def _limit(self, a: Point, b: Point) -> Point:
        """The point between two points at which the fraction turns back, by false position (Illinois)."""
        low, high = 0.0, self._product(b.at.plus(a.at, -1.0), a.tangent)
        value_low, value_high = a.tangent.s, b.tangent.s
        found, side = b, 0
        for _ in range(_LIMIT_ITERATIONS):
            step = (low * value_high - high * value_low) / (value_high - value_low)
            try:
                at = self._solve(a.at.plus(a.tangent, step), a.tangent, None)
                found = Point(at, self._tangent(at, a.tangent), limit=True)
            except _Failed:
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
        """Whether the branch goes through its first point between two points."""
        if not min(a.at.s, b.at.s) <= 0.0 <= max(a.at.s, b.at.s):
            return False
        try:
            found = self._at_fraction(a, b, 0.0)
        except _Failed:
            return False
        apart = found.at.q - first.at.q
        for body in self.equations.system.bodies:
            apart[body.angle] = (apart[body.angle] + np.pi) % (2.0 * np.pi) - np.pi
        return float(np.max(np.abs(apart / self.equations.scale))) < _BACK

    def _product(self, a: Unknowns, b: Unknowns) -> float:
        """The product of two changes, of coordinates and the fraction."""
        scale = self.equations.scale
        return self.weight * float((a.q / scale) @ (b.q / scale)) + a.s * b.s

    def _size(self, change: Unknowns) -> float:
        return float(np.sqrt(self._product(change, change)))

    def _only_s(self, like: Unknowns) -> Unknowns:
        """A change of the fraction alone."""
        return Unknowns(np.zeros_like(like.q), np.zeros_like(like.mu), 1.0)

    def _change(self, at: Unknowns, across: Unknowns, f: Array, phi: Array, product: float) -> Unknowns:
        """The change that forces (n,), rows and the product with `across` want, by the linear equations at a point.

        Multipliers of rows that follow from others stay.
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
            raise _Failed from None
        if not np.all(np.isfinite(change)):
            raise _Failed
        mu = np.zeros(phi.size)
        mu[kept] = change[n:-1]
        return Unknowns(change[:n], mu, float(change[-1]))

    def _tangent(self, at: Unknowns, along: Unknowns) -> Unknowns:
        """The tangent of length one at a point, in the direction of another."""
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
        """Newton's iteration to an equilibrium, across a direction, or at a fraction; else `_Failed`."""
        at, before = begin, np.inf
        for number in range(1, _MOST_ITERATIONS + 1):
            f, phi = self.equations.residual(at)
            if not (np.all(np.isfinite(f)) and np.all(np.isfinite(phi))):
                raise _Failed
            left = -self._product(at.plus(begin, -1.0), across) if fraction is None else fraction - at.s
            change = self._change(at, across, -f, -phi, left)
            move = float(np.max(np.abs(change.q / self.equations.scale)))
            at = at.plus(change, min(1.0, longest / max(move, longest)))
            if move <= _CONVERGED or (move <= _ROUNDED and move > 0.1 * before):
                if counted is not None:
                    counted.append(number)
                return at
            if np.isinf(longest) and (move > 10.0 * before or (number > _MOST_ITERATIONS // 2 and move > before)):
                raise _Failed
            before = move
        raise _Failed
