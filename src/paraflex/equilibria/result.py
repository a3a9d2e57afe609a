"""Equilibria of a mechanism as a result: coordinates, forces, stability, stiffness in steps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from paraflex.arguments import checked_arguments, given_as
from paraflex.arrays import Array
from paraflex.display import Shown
from paraflex.dynamics import System
from paraflex.dynamics.rank import NO_PART, Dependence, dependence
from paraflex.equilibria.branch import Point
from paraflex.equilibria.equations import Equations
from paraflex.equilibria.given import Coordinate
from paraflex.equilibria.solution import resting_solution
from paraflex.equilibria.stability import Buckling, Vibrations
from paraflex.errors import InputError, suggestion
from paraflex.findings import Finding
from paraflex.integrators import Solution
from paraflex.mechanism.quantities import known
from paraflex.validity import Validity, assess, doubtful_stresses, shared_loads


@dataclass(frozen=True)
class Equilibrium:
    """One equilibrium.

    Attributes
    ----------
    point : Point
    vibrations, free : Vibrations
        What is held and moved kept; what is moved let go under the force that moves it.
    buckling : Buckling
    stiffness : (directions,) array
        [N/m, N m/rad]
    """

    point: Point
    vibrations: Vibrations
    free: Vibrations
    buckling: Buckling
    stiffness: Array


@given_as("equilibria", "the equilibria that statics returns")
@dataclass(frozen=True)
class Statics(Shown):
    """Equilibria along a branch, in its order: the start, the steps, limit points between them.

    Attributes
    ----------
    equations : Equations
        What was held, moved and loaded.
    equilibria : tuple of Equilibrium
    status : str
        "complete", or "failed" where the branch ends before the last step.
    message : str
        Why it ends.
    """

    equations: Equations
    equilibria: tuple[Equilibrium, ...]
    status: str = "complete"
    message: str = ""

    @property
    def system(self) -> System:
        """The system of the mechanism."""
        return self.equations.system

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """All named coordinates: moved, loaded, looked at, held."""
        return self.equations.given.coordinates

    @property
    def directions(self) -> tuple[Coordinate, ...]:
        """Coordinates with a stiffness."""
        return self.equations.given.measured

    @property
    def fraction(self) -> Array:
        """Fraction (k,) of all that is given."""
        return np.array([one.point.at.s for one in self.equilibria])

    @property
    def limit(self) -> NDArray[np.bool_]:
        """Which are limit points (k,)."""
        return np.array([one.point.limit for one in self.equilibria], dtype=bool)

    @property
    def stable(self) -> NDArray[np.bool_]:
        """Which are stable (k,), what is held and moved kept; limit points are not."""
        return np.array([one.vibrations.stable and not one.point.limit for one in self.equilibria], dtype=bool)

    @property
    def q(self) -> Array:
        """Coordinates (k, n) of the system."""
        return np.array([one.point.at.q for one in self.equilibria])

    @cached_property
    def multipliers(self) -> Array:
        """Multipliers (k, m) of all rows of `equations.extended`."""
        found = [self.equations.least_multipliers(one.point.at) for one in self.equilibria]
        return np.array([self.equations.multipliers(at) for at in found])

    @cached_property
    def _dependence(self) -> list[Dependence]:
        """Redundant rows of each equilibrium, of those that hold the mechanism."""
        return [dependence(self.equations.extended, q, acting=self.equations.holding) for q in self.q]

    @property
    def frequencies(self) -> Array:
        """Natural frequencies (k, f), zero of motions that grow, NaN where there are fewer [rad/s].

        What is held and moved stays; see `free_frequencies`.
        """
        return self.within_rows([np.sqrt(np.maximum(one.vibrations.squares, 0.0)) for one in self.equilibria])

    @property
    def free_frequencies(self) -> Array:
        """The same (k, f) with what is moved let go, under the force that moved it there [rad/s]."""
        return self.within_rows([np.sqrt(np.maximum(one.free.squares, 0.0)) for one in self.equilibria])

    @staticmethod
    def within_rows(rows: Sequence[Array]) -> Array:
        """Arrays of several lengths as rows, NaN beyond their ends."""
        out = np.full((len(rows), max((row.size for row in rows), default=0)), np.nan)
        for filled, row in zip(out, rows, strict=True):
            filled[: row.size] = row
        return out

    @property
    def buckling(self) -> Array:
        """Factors (k, b) of all that is given at which the mechanism buckles, as seen from each equilibrium."""
        return np.array([one.buckling.factors for one in self.equilibria])

    @cached_property
    def _values(self) -> Array:
        return np.array([self.equations.values(q) for q in self.q])

    @checked_arguments()
    def place(self, name: str) -> Array:
        """Value (k,) of a named coordinate [m, rad]."""
        return self._values[:, self._row(name)]

    @checked_arguments()
    def travel(self, name: str) -> Array:
        """Change (k,) of a named coordinate since the start [m, rad]."""
        number = self._row(name)
        return self._values[:, number] - self.equations.values(self.equations.start.q)[number]

    @checked_arguments()
    def effort(self, name: str) -> Array:
        """Force or torque (k,) at a named coordinate: given, or what holds or moves it [N, N m].

        Of least norm where it is not determined; see `known_effort`.
        """
        return -self.multipliers[:, self._row(name)]

    @checked_arguments()
    def known_effort(self, name: str) -> Array:
        """The same (k,), NaN where redundant rows share it in any way: two drives that hold one motion."""
        number, units = self._row(name), self.equations.extended.row_units
        free = [one.self_stresses(units)[:, number] * units[number] for one in self._dependence]
        return np.where([np.any(np.abs(one) > NO_PART) for one in free], np.nan, self.effort(name))

    @checked_arguments()
    def stiffness(self, name: str) -> Array:
        """Force for a unit displacement (k,) of a coordinate, others as they are held and moved [N/m, N m/rad]."""
        names = [one.name for one in self.directions]
        known(name, names, "stiffness", "direction with a stiffness")
        return np.array([one.stiffness[names.index(name)] for one in self.equilibria])

    def _row(self, name: str) -> int:
        """Row of a named coordinate in the extended system."""
        rows = {one.name: number for one, number in self.equations.number.items()}
        if name not in rows:
            raise InputError("is no coordinate of these equilibria", field="name", value=name,
                             remedy=f"{suggestion(name, rows)}; name it in `stiffness` to have it")  # fmt: skip
        return rows[name]

    @cached_property
    def solution(self) -> Solution:
        """The equilibria as samples at rest of `equations.extended`, numbered in place of times."""
        equations = self.equations
        return resting_solution(
            equations.extended, self.q, self.multipliers, equations.holding, self.status, self.message
        )

    @cached_property
    def validity(self) -> Validity | None:
        """Validity of the model in all steps; None for rigid bodies."""
        return assess(self.equations.extended, self.solution)

    @cached_property
    def doubts(self) -> tuple[Finding, ...]:
        """Findings: unstable equilibria with the motion that grows, stresses beyond the strength."""
        of_loads = (doubtful_stresses, shared_loads)
        stresses = tuple(one for of in of_loads for one in of(self.equations.extended, self.solution))
        unstable = np.flatnonzero(~self.stable & ~self.limit)
        if not unstable.size:
            return stresses
        first = self.equilibria[unstable[0]]
        return (
            Finding(
                "equilibrium-unstable", "",
                f"{unstable.size} of {len(self.equilibria)} equilibria are unstable, first that with "
                f"{first.point.at.s:.4g} of what is given: {self.moving_away(unstable[0])}",
                "such a state is not reached by itself: give less, hold the motion that grows, or move a coordinate "
                "in place of loading it",
            ),
            *stresses,
        )  # fmt: skip

    @checked_arguments()
    def moving_away(self, step: int) -> str:
        """In words, the motion that grows at an unstable equilibrium: the coordinate and the body that move most."""
        shape = self.equilibria[step].vibrations.shapes[:, 0] / self.equations.scale
        rigid = {body.name: shape[body.offset : body.offset + 3] for body in self.system.bodies}
        name = max(rigid, key=lambda body: float(np.max(np.abs(rigid[body]))))
        which = int(np.argmax(np.abs(rigid[name])))
        return f"{self.system.carrier(name)[0]} {('moves along x', 'moves along y', 'turns')[which]} most"
