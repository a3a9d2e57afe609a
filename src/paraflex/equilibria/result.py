"""Equilibria of a mechanism as a result: coordinates, forces, stability and stiffness in steps."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from paraflex.arguments import checked_arguments, named_in_errors
from paraflex.arrays import Array, Brief, Indices, Mask
from paraflex.display import Shown
from paraflex.dynamics import System
from paraflex.dynamics.points import point_motion
from paraflex.dynamics.rank import NO_PART, Dependence, dependence
from paraflex.dynamics.sparse import stiffness_diagonal
from paraflex.dynamics.stiffness import laws_without_energy
from paraflex.errors import InputError, suggestion
from paraflex.findings import Finding
from paraflex.integrators import Solution
from paraflex.kernel.packed import SPRING
from paraflex.mechanism.quantities import known
from paraflex.validity import Validity, assess, implausible_stresses, shared_loads
from .branch import Point
from .conditions import Coordinate
from .equations import Equations
from .stability import Buckling, Vibrations


@dataclass(frozen=True)
class Equilibrium(Brief):
    """An equilibrium.

    Attributes
    ----------
    point : Point
        Point of the branch.
    vibrations, free : Vibrations
        Vibrations with held and moved coordinates kept, and with moved coordinates released under the force that moves
        them.
    buckling : Buckling
        Buckling factors and shapes.
    stiffness : (directions,) array
        Stiffness of the measured coordinates [N/m, N m/rad].
    """

    point: Point
    vibrations: Vibrations
    free: Vibrations
    buckling: Buckling
    stiffness: Array


@named_in_errors("equilibria", "the equilibria that statics returns")
@dataclass(frozen=True)
class Statics(Shown):
    """Equilibria along a branch, in its order: the start, the steps, limit points between them.

    Attributes
    ----------
    equations : Equations
        Equations of equilibrium, with the coordinates held, moved and loaded.
    equilibria : tuple of Equilibrium
        Equilibria of the branch.
    status : str
        Status: "complete", or "failed" if the branch ends before the last step.
    message : str
        Reason why the branch ends; empty by default.
    """

    equations: Equations
    equilibria: tuple[Equilibrium, ...]
    status: str = "complete"
    message: str = ""

    @property
    def system(self) -> System:
        """System of the mechanism."""
        return self.equations.system

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """All named coordinates: moved, loaded, measured, held."""
        return self.equations.conditions.coordinates

    @property
    def directions(self) -> tuple[Coordinate, ...]:
        """Coordinates with a stiffness."""
        return self.equations.conditions.measured

    @property
    def fraction(self) -> Array:
        """Load fraction (k,): part of all given loads and displacements."""
        return np.array([one.point.at.s for one in self.equilibria])

    @property
    def limit(self) -> Mask:
        """Mask (k,) of limit points."""
        return np.array([one.point.limit for one in self.equilibria], dtype=bool)

    @property
    def stable(self) -> Mask:
        """Mask (k,) of stable equilibria, with held and moved coordinates kept; limit points are not stable."""
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
        """Redundant rows of each equilibrium, among those that hold the mechanism."""
        return [dependence(self.equations.extended, q, acting=self.equations.holding) for q in self.q]

    @property
    def frequencies(self) -> Array:
        """Natural frequencies (k, f), zero for unstable motions, NaN where there are fewer [rad/s].

        Held and moved coordinates are kept; see `free_frequencies`.
        """
        return self.within_rows([np.sqrt(np.maximum(one.vibrations.squares, 0.0)) for one in self.equilibria])

    @property
    def free_frequencies(self) -> Array:
        """Natural frequencies (k, f) with moved coordinates released under the force that moves them [rad/s]."""
        return self.within_rows([np.sqrt(np.maximum(one.free.squares, 0.0)) for one in self.equilibria])

    @staticmethod
    def within_rows(rows: Sequence[Array]) -> Array:
        """Stack arrays of different lengths as rows, NaN beyond their ends."""
        out = np.full((len(rows), max((row.size for row in rows), default=0)), np.nan)
        for filled, row in zip(out, rows, strict=True):
            filled[: row.size] = row
        return out

    @property
    def buckling(self) -> Array:
        """Load factors (k, b) at which the mechanism buckles, estimated from each equilibrium."""
        return np.array([one.buckling.factors for one in self.equilibria])

    @cached_property
    def _values(self) -> Array:
        return np.array([self.equations.values(q) for q in self.q])

    @checked_arguments()
    def place(self, name: str) -> Array:
        """Return the value (k,) of a named coordinate [m, rad]."""
        return self._values[:, self._row(name)]

    @checked_arguments()
    def travel(self, name: str) -> Array:
        """Return the change (k,) of a named coordinate since the start [m, rad]."""
        number = self._row(name)
        return self._values[:, number] - self.equations.values(self.equations.start.q)[number]

    @checked_arguments()
    def effort(self, name: str) -> Array:
        """Return the force or torque (k,) at a named coordinate: given, or exerted to hold or move it [N, N m].

        If it is not determined, the solution of least norm is returned; see `known_effort`.
        """
        return -self.multipliers[:, self._row(name)]

    @checked_arguments()
    def known_effort(self, name: str) -> Array:
        """Return the effort (k,), NaN if redundant rows share it arbitrarily, as two drives of one motion do."""
        number, units = self._row(name), self.equations.extended.row_units
        free = [one.self_stresses(units)[:, number] * units[number] for one in self._dependence]
        return np.where([np.any(np.abs(one) > NO_PART) for one in free], np.nan, self.effort(name))

    @checked_arguments()
    def stiffness(self, name: str) -> Array:
        """Return force per unit displacement (k,) of a coordinate, others held and moved as given [N/m, N m/rad]."""
        names = [one.name for one in self.directions]
        known(name, names, "stiffness", "direction with a stiffness")
        return np.array([one.stiffness[names.index(name)] for one in self.equilibria])

    def _row(self, name: str) -> int:
        """Return the row of a named coordinate in the extended system."""
        rows = {one.name: number for one, number in self.equations.number.items()}
        if name not in rows:
            raise InputError("is not a coordinate of these equilibria", field="name", value=name,
                             remedy=f"{suggestion(name, rows)}; name it in `stiffness` to have it")  # fmt: skip
        return rows[name]

    @cached_property
    def solution(self) -> Solution:
        """Equilibria as samples at rest of `equations.extended`, numbered in place of times."""
        equations = self.equations
        return resting_solution(
            equations.extended, self.q, self.multipliers, equations.holding, self.status, self.message
        )

    @cached_property
    def validity(self) -> Validity | None:
        """Validity of the model in all steps; None for rigid bodies."""
        return assess(self.equations.extended, self.solution)

    @cached_property
    def findings(self) -> tuple[Finding, ...]:
        """Findings: unstable equilibria with their growing motion, stresses beyond the strength, undetermined loads."""
        of_loads = (implausible_stresses, shared_loads)
        stresses = tuple(one for of in of_loads for one in of(self.equations.extended, self.solution))
        stresses += tuple(laws_without_energy(self.system, self.equations.start.time, self.q[-1]))
        unstable = np.flatnonzero(~self.stable & ~self.limit)
        if not unstable.size:
            return stresses
        first = self.equilibria[unstable[0]]
        return (
            Finding(
                "equilibrium-unstable", "",
                f"{unstable.size} of {len(self.equilibria)} equilibria are unstable, the first at load factor "
                f"{first.point.at.s:.4g}: {self.moving_away(unstable[0])}",
                "such a state is not reached on its own: give less, hold the motion that grows, or move a coordinate "
                "in place of loading it",
            ),
            *stresses,
        )  # fmt: skip

    @checked_arguments()
    def moving_away(self, step: int) -> str:
        """Describe the unstable motion at an equilibrium: the coordinate and the body that move most."""
        shape = self.equilibria[step].vibrations.shapes[:, 0] / self.equations.scale
        rigid = {body.name: shape[body.offset : body.offset + 3] for body in self.system.bodies}
        name = max(rigid, key=lambda body: float(np.max(np.abs(rigid[body]))))
        which = int(np.argmax(np.abs(rigid[name])))
        return f"{self.system.carrier(name)[0]} {('moves along x', 'moves along y', 'turns')[which]} most"


def resting_solution(
    system: System, q: Array, multipliers: Array, acting: Indices, status: str, message: str
) -> Solution:
    """Return samples at rest with coordinates (k, n) and multipliers (k, m), numbered in place of times.

    `acting` holds the numbers of the rows that act.
    """
    zeros = np.zeros(len(q))
    return Solution(
        t=np.arange(len(q), dtype=float), q=q, v=np.zeros_like(q), a=np.zeros_like(q), multipliers=multipliers,
        kinetic_energy=zeros, strain_energy=strain_energy(system, q, multipliers), work=zeros, status=status,
        message=message, steps=len(q), resting=True, acting=acting,
    )  # fmt: skip


def strain_energy(system: System, q: Array, multipliers: Array) -> Array:
    """Return the energy (k,) of beams, springs at joints, and springs between points [J]."""
    rows = system.packed.rows
    energy = 0.5 * q**2 @ stiffness_diagonal(system)
    energy += 0.5 * multipliers**2 @ np.where(rows["kind"] == SPRING, rows["compliance"], 0.0)
    still = np.zeros_like(q)
    for spring in system.mechanism.linear_springs:
        ends = (
            np.array(system.mechanism.ground[end.point]) if end.on_ground
            else point_motion(system, end, q, still, still).position for end in (spring.a, spring.b)
        )  # fmt: skip
        distance = np.linalg.norm(np.subtract(*ends), axis=1)
        energy += 0.5 * spring.stiffness * (distance - spring.length) ** 2
    return energy
