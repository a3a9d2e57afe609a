"""Equations of equilibrium with given coordinates held, moved or loaded.

A named coordinate is the angle or travel of a joint, or the position or angle of a point: a row Phi_c of a system that
has more rows than the mechanism's own. With a fraction s of all given loads and displacements

    F(q) + Phi_q^T mu - s Phi_l,q^T p = 0        forces: beams, springs, weight, loads; p is given at loaded rows l
    Phi(q) = Phi_0 + s d                         the mechanism's constraints and rows that are held (d = 0) or moved

so that the force of a held or moved coordinate on the mechanism is -mu.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy
from scipy.sparse import csr_matrix

from paraflex.arrays import Array, Brief, Indices
from paraflex.dynamics import State, System, acting_loads
from paraflex.dynamics.constraints import coordinate_kind
from paraflex.dynamics.sparse import Saddle, stiffness_diagonal, without_stiffness
from paraflex.dynamics.stiffness import RestingForces
from paraflex.dynamics.tangents import MotionPoint, Tangency
from paraflex.linear.coordinates import Coordinates, unit_in, with_coordinates
from paraflex.linear.independent import independent_dense, independent_sparse
from paraflex.mechanism import PointRef
from .conditions import Conditions, Coordinate

# Up to this number of entries a QR factorisation finds the independent rows of a matrix, beyond it elimination.
_DENSE_ENTRIES = 400_000


class Unknowns(NamedTuple):
    """Coordinates (n,), multipliers (rows,) of constraints and of held or moved coordinates, and the fraction s."""

    q: Array
    mu: Array
    s: float

    def plus(self, change: Unknowns, part: float = 1.0) -> Unknowns:
        """Add a multiple of a change."""
        return Unknowns(self.q + part * change.q, self.mu + part * change.mu, self.s + part * change.s)

    @property
    def packed(self) -> Array:
        """All unknowns as one array."""
        return np.concatenate([self.q, self.mu, [self.s]])


class Matrices(NamedTuple):
    """Derivatives at a point: of forces by coordinates (n, n), of rows by coordinates (rows, n), of forces by s (n,).

    `mass` is the mass matrix (n, n).
    """

    stiffness: csr_matrix
    rows: csr_matrix
    load: Array
    mass: csr_matrix


@dataclass(frozen=True)
class Equations(Brief):
    """Equations of equilibrium of a system, relative to a start.

    Attributes
    ----------
    system : System
        System of the mechanism.
    start : State
        State from whose pose changes of coordinates count; loads in time have their values at its time.
    conditions : Conditions
        Coordinates held, moved, loaded and measured.
    """

    system: System
    start: State
    conditions: Conditions

    @cached_property
    def extended(self) -> System:
        """System with a row for every named coordinate."""
        cut = self.system.mechanism.cut
        joints, pins = [], {}
        for one in self.conditions.coordinates:
            if one.point is not None:
                pins[_pin(one.point)] = one.point if cut is None else cut.points.get(one.point, one.point)
            if one.point is None or one.axis == "angle":
                joints.append(one.name if one.point is None else _pin(one.point))
        return with_coordinates(self.system, joints, pins)

    @cached_property
    def own(self) -> Indices:
        """Rows of the extended system that are the mechanism's own, in its order."""
        number = {name: k for k, name in enumerate(self.extended.rows)}
        return np.array([number[name] for name in self.system.rows], dtype=int)

    @cached_property
    def number(self) -> dict[Coordinate, int]:
        """Row of every named coordinate in the extended system."""
        mechanism, names = self.extended.mechanism, {name: k for k, name in enumerate(self.extended.rows)}
        motion_of = {one.joint: one.name for one in mechanism.prescribed}
        numbers = {}
        for one in self.conditions.coordinates:
            joint = one.name if one.point is None else _pin(one.point)
            if one.point is not None and one.axis != "angle":
                numbers[one] = names[f"{joint} {one.axis}"]
            else:
                numbers[one] = names[f"{motion_of[joint]} {coordinate_kind(mechanism.joint(joint))}"]
        return numbers

    @cached_property
    def holding(self) -> Indices:
        """Rows that keep their value or follow a change: constraints, and coordinates held or moved."""
        own = [k for k in self.own.tolist() if self.extended.constrained[k]]
        extra = [self.number[one] for one in (*self.conditions.held, *self.conditions.moved)]
        return np.array(list(dict.fromkeys([*own, *extra])), dtype=int)

    @cached_property
    def change(self) -> Array:
        """Change (rows,) of the rows `holding` at load fraction one."""
        change, place = np.zeros(self.holding.size), {row: k for k, row in enumerate(self.holding.tolist())}
        for one, value in self.conditions.moved.items():
            change[place[self.number[one]]] = value
        return change

    @cached_property
    def _loaded(self) -> tuple[Indices, Array]:
        """Rows at which forces act, and the forces."""
        rows = np.array([self.number[one] for one in self.conditions.loads], dtype=int)
        return rows, np.array(list(self.conditions.loads.values()), dtype=float)

    @cached_property
    def _forces(self) -> RestingForces:
        forces = RestingForces(self.extended, self.start.time)
        forces.torques = acting_loads(self.extended.mechanism, np.array([self.start.time]))[0]
        return forces

    @cached_property
    def _tangency(self) -> Tangency:
        return Tangency(replace(self.extended, packed=without_stiffness(self.extended.packed)))

    @cached_property
    def elastic(self) -> Array:
        """Diagonal (n,) of the stiffness of beams."""
        return stiffness_diagonal(self.system)

    @cached_property
    def scale(self) -> Array:
        """Unit of each coordinate (n,): sizes of the mechanism, rad; smaller for stiff coordinates."""
        return Coordinates(self.system, ()).scale

    @cached_property
    def units(self) -> Array:
        """Unit of each unknown (n + rows + 1,)."""
        energy = (
            float(np.max(self.elastic * self.scale**2, initial=0.0)) or self.system.total_mass * self.system.size**2
        )
        return np.concatenate([self.scale, energy / self.extended.row_units[self.holding], [1.0]])

    def values(self, q: Array) -> Array:
        """Return values (rows,) of all rows of the extended system at coordinates (n,), named coordinates included."""
        return self.extended.constraints(self._forces.signals, self.start.time, q)[0]

    @cached_property
    def at_start(self) -> Array:
        """Values of all rows at the start; zero for the mechanism's constraints."""
        values = self.values(self.start.q)
        values[self.own] = 0.0
        return values

    def multipliers(self, at: Unknowns) -> Array:
        """Return the multipliers (m,) of all rows of the extended system; those of springs follow the pose."""
        lam = self._forces.compliant(at.q)
        rows, efforts = self._loaded
        lam[rows] = -at.s * efforts
        lam[self.holding] = at.mu
        return lam

    def residual(self, at: Unknowns) -> tuple[Array, Array]:
        """Return the residuals of forces (n,) and of rows (rows,)."""
        f = self._forces(at.q, self.multipliers(at))[0] + self.elastic * at.q
        return f, (self.values(at.q) - self.at_start)[self.holding] - at.s * self.change

    def matrices(self, at: Unknowns) -> Matrices:
        """Return the derivatives at a point."""
        still = np.zeros(self.system.n)
        point = MotionPoint(self.start.time, at.q, still, still, self.multipliers(at), self._forces.torques)
        found = self._tangency.at(point)
        rows, efforts = self._loaded
        held, loaded = (found.jacobian[np.searchsorted(found.rows, selected)] for selected in (self.holding, rows))
        stiffness = csr_matrix(found.stiffness + scipy.sparse.diags(self.elastic))
        return Matrices(stiffness, held, -(loaded.T @ efforts), found.mass)

    def rows_named(self, coordinates: Sequence[Coordinate], q: Array) -> csr_matrix:
        """Return the derivatives (coordinates, n) of named coordinates."""
        jacobian = self._tangency.inertia(self.start.time, q)[1]
        return jacobian[np.array([self.number[one] for one in coordinates], dtype=int)]

    def guess(self) -> Unknowns:
        """Return the start, with the multipliers that hold it best."""
        none = Unknowns(self.start.q, np.zeros(self.holding.size), 0.0)
        found = self.matrices(none)
        mu = Saddle(found.mass, found.rows).solve(-self.residual(none)[0])[1]
        return none._replace(mu=mu)

    def independent(self, rows: csr_matrix, more: csr_matrix | None = None) -> tuple[Indices, ...]:
        """Return which rows (rows, n) are independent of one another, and which of `more` are independent of these."""
        groups = [unit_in(part, self.scale) for part in (rows, more) if part is not None]
        entries = sum(int(np.prod(group.shape or ())) for group in groups)
        choose = independent_dense if entries <= _DENSE_ENTRIES else independent_sparse
        return choose(groups, np.ones(self.system.n)).groups

    def dependent_travels(self, at: Unknowns) -> list[Coordinate]:
        """Return the moved coordinates that follow, at a point, from constraints and other held or moved ones."""
        rows, moved = self.matrices(at).rows, list(self.conditions.moved)
        kept = self.holding.size - len(moved)
        free = self.independent(csr_matrix(rows[:kept]), csr_matrix(rows[kept:]))[1] if moved else ()
        return [one for k, one in enumerate(moved) if k not in free]

    def gap(self, at: Unknowns) -> float:
        """Return the largest residual of rows [sizes of the mechanism, rad]."""
        phi = self.residual(at)[1]
        return float(np.max(np.abs(phi) / self.extended.row_units[self.holding], initial=0.0))

    def least_multipliers(self, at: Unknowns) -> Unknowns:
        """Return the equilibrium with the multipliers of dependent rows of least sum of squares."""
        rows = self.matrices(at).rows
        if self.independent(rows)[0].size == self.holding.size:
            return at
        transposed = rows.T.toarray() * self.scale[:, None]
        mu = np.linalg.lstsq(transposed, transposed @ at.mu, rcond=1e-10)[0]
        return at._replace(mu=mu)


def _pin(point: PointRef) -> str:
    return f"coordinates of {point.body} {point.point}"
