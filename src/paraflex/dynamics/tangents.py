"""Tangent matrices of the equations of motion at a point of a motion, as sparse matrices, by exact derivatives.

About (q, v, a, lambda) with given torques the equations change by

    M da + D dv + K dq + Phi_q^T dlambda = S dtau,    Phi_q da + Phi''_v dv + Phi''_q dq = 0

K includes everything that depends on the pose: stiffness of links, springs, weight, loads, inertia forces (at constant
accelerations), constraint forces (at constant multipliers) and motors along axes. Springs, dampers and friction at
joints, whose torques are multipliers in the equations, are part of K and D. Baumgarte's terms are not included.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy
from scipy.sparse import csr_matrix

from paraflex.arrays import Array, Indices
from paraflex.errors import InputError
from paraflex.kernel.packed import FRICTION, INDEX_1, SPRING
from paraflex.kernel.tangent import make_tangent, note_slopes
from paraflex.kernel.tangent_columns import ACCELERATION, COORDINATE, VELOCITY, tangent_columns
from .inputs import inputs_of
from .load_values import check_laws
from .sparse import apart_colours, bodies_acted_on, tied_bodies
from .system import System

# Weights of Phi'', Phi' and Phi for rows equal to Phi'.
_RATES = (0.0, 1.0, 0.0)


class MotionPoint(NamedTuple):
    """A point of a motion about which the equations are linearised.

    Attributes
    ----------
    time : float
        Time [s].
    q, v, a : (n,) arrays
        Coordinates, velocities and accelerations.
    multipliers : (m,) array
        Multipliers.
    torques : (acting,) array
        Torques of motors, then loads in time: see `dynamics.inputs`.
    """

    time: float
    q: Array
    v: Array
    a: Array
    multipliers: Array
    torques: Array

    @property
    def at_rest(self) -> bool:
        """Whether all velocities and accelerations are zero."""
        return not (np.any(self.v) or np.any(self.a))


class Tangents(NamedTuple):
    """Tangent matrices at a point of a motion.

    Attributes
    ----------
    mass, damping, stiffness : (n, n) sparse arrays
        M, D and K, springs, dampers and friction at joints included.
    rows : (c,) array of int
        Indices of the system's rows that are constraints.
    jacobian : (c, n) sparse array
        Phi_q of these rows.
    rate : (c, n) sparse array
        Derivative of Phi' by the coordinates; its derivative by the velocities is Phi_q.
    second_place, second_rate : (c, n) sparse arrays
        Derivatives of Phi'' by the coordinates and by the velocities.
    compliant : (m - c,) array of int
        Indices of the rows of springs, dampers and friction at joints.
    compliant_place, compliant_rate : (m - c, n) sparse arrays
        Derivatives of their multipliers by the coordinates and the velocities.
    """

    mass: csr_matrix
    damping: csr_matrix
    stiffness: csr_matrix
    rows: Indices
    jacobian: csr_matrix
    rate: csr_matrix
    second_place: csr_matrix
    second_rate: csr_matrix
    compliant: Indices
    compliant_place: csr_matrix
    compliant_rate: csr_matrix


class _Pattern(NamedTuple):
    """Sparsity pattern of a matrix (rows, columns), and the index of the computed value of each entry."""

    shape: tuple[int, int]
    pointers: Indices
    columns: Indices
    sources: Indices

    def matrix(self, values: Array) -> csr_matrix:
        """Return the matrix of computed columns (sources, rows)."""
        return csr_matrix((values.ravel()[self.sources], self.columns, self.pointers), shape=self.shape)


def rows_of(rows: Indices, *matrices: csr_matrix) -> tuple[csr_matrix, ...]:
    """Return selected rows of matrices with the same sparsity pattern, which SciPy would select anew for each."""
    pointers, columns, shape = matrices[0].indptr, matrices[0].indices, matrices[0].shape
    assert shape is not None
    counts = np.diff(pointers)[rows]
    ends = np.cumsum(counts)
    taken = np.arange(counts.sum()) + np.repeat(pointers[rows] - ends + counts, counts)
    at = np.concatenate([[0], ends])
    return tuple(
        csr_matrix((matrix.data[taken], columns[taken], at), shape=(rows.size, shape[1])) for matrix in matrices
    )


@dataclass(frozen=True)
class Tangency:
    """Sparsity pattern of a system's tangent matrices, and the matrices at points of its motions.

    Bodies that share neither row nor spring with a common body are moved at once, so that the cost grows with the
    number of bodies, not with its square.
    """

    system: System

    @cached_property
    def _tied(self) -> list[set[int]]:
        return bodies_acted_on(self.system)

    @cached_property
    def _colours(self) -> Indices:
        return apart_colours(self._tied)

    @cached_property
    def _sources(self) -> tuple[int, list[Indices]]:
        """Number of computed columns, and for each body those of its coordinates."""
        size = np.array([3 + body.nf for body in self.system.bodies])
        widths = [int(size[self._colours == colour].max()) for colour in range(int(self._colours.max()) + 1)]
        starts = np.cumsum([0, *widths])
        return int(starts[-1]), [starts[colour] + np.arange(n) for colour, n in zip(self._colours, size, strict=True)]

    @cached_property
    def _force_pattern(self) -> _Pattern:
        bodies = self.system.bodies
        own = [np.arange(body.all.start, body.all.stop) for body in bodies]
        return self._pattern([np.concatenate([own[other] for other in sorted(others)]) for others in self._tied],
                             self.system.n)  # fmt: skip

    @cached_property
    def _row_pattern(self) -> _Pattern:
        touched: list[list[int]] = [[] for _ in self.system.bodies]
        for row, body in zip(*(part.tolist() for part in tied_bodies(self.system)), strict=True):
            touched[body].append(row)
        return self._pattern([np.array(rows, dtype=int) for rows in touched], self.system.m)

    def _pattern(self, met: list[Indices], rows: int) -> _Pattern:
        """Return the pattern of a matrix with `rows` rows, given those that the coordinates of each body affect."""
        parts = []
        for body, source, own in zip(self.system.bodies, self._sources[1], met, strict=True):
            columns = np.arange(body.all.start, body.all.stop)
            parts.append((np.tile(own, columns.size), np.repeat(columns, own.size), np.repeat(source, own.size)))
        row, column, source = (np.concatenate(part) for part in zip(*parts, strict=True))
        order = np.lexsort((column, row))
        pointers = np.concatenate([[0], np.cumsum(np.bincount(row, minlength=rows))])
        return _Pattern((rows, self.system.n), pointers, column[order], (source * rows + row)[order])

    def inertia(self, time: float, q: Array) -> tuple[csr_matrix, csr_matrix]:
        """Return the mass matrix (n, n), and Phi_q (m, n), with zeros in rows that are not constraints."""
        still, acting = np.zeros(self.system.n), np.zeros(inputs_of(self.system.mechanism).acting)
        point = MotionPoint(time, q, still, still, np.zeros(self.system.m), acting)
        return self._columns(point, INDEX_1, ACCELERATION)

    def stiffness(self, point: MotionPoint) -> csr_matrix:
        """Return K (n, n) alone, without springs, dampers and friction at joints."""
        return self._columns(point, INDEX_1, COORDINATE)[0]

    def at(self, point: MotionPoint) -> Tangents:
        """Return the tangent matrices at a point of a motion."""
        mass, jacobian = self._columns(point, INDEX_1, ACCELERATION)
        damping, second_rate = self._columns(point, INDEX_1, VELOCITY)
        stiffness, second_place = self._columns(point, INDEX_1, COORDINATE)
        rate = self._columns(point, _RATES, COORDINATE)[1] if np.any(point.v) else 0.0 * second_place
        rows, compliant = np.nonzero(self.system.constrained)[0], np.nonzero(~self.system.constrained)[0]
        held = rows_of(rows, jacobian, rate, second_place, second_rate)
        place, speed = rows_of(compliant, second_place, second_rate)
        if compliant.size:
            # Directions in which their torques act: the derivatives of angles and travels.
            kinds = self.system.packed.rows["kind"][compliant]
            springs = scipy.sparse.diags((kinds == SPRING).astype(float))
            turns = csr_matrix(springs @ place + (scipy.sparse.identity(compliant.size) - springs) @ speed).T
            strength = scipy.sparse.diags(self._strengths(point)[compliant])
            place, speed = csr_matrix(strength @ place), csr_matrix(strength @ speed)
            damping, stiffness = csr_matrix(damping + turns @ speed), csr_matrix(stiffness + turns @ place)
        return Tangents(
            mass, damping, stiffness, rows, *held, compliant=compliant, compliant_place=place, compliant_rate=speed
        )

    def _columns(
        self, point: MotionPoint, weights: tuple[float, float, float], part: int
    ) -> tuple[csr_matrix, csr_matrix]:
        """Return derivatives of forces (n, n) and rows (m, n) by a part of the motion, with friction as rates."""
        system, direction = self.system, make_tangent(self.system.packed)
        direction.friction[:] = 1.0
        columns = self._sources[0]
        forces, rows = np.zeros((columns, system.n)), np.zeros((columns, system.m))
        compliance = np.array(system.packed.rows["compliance"], dtype=float)
        tangent_columns(
            system.packed, weights, part, self._colours, point.q, point.v, point.a, point.multipliers, point.torques,
            compliance, direction, forces, rows,
        )  # fmt: skip
        if system.packed.laws.size and not np.isfinite(forces).all():
            check_laws(system, np.array([point.time]), point.q[None], point.v[None])
            members = (*system.mechanism.loads, *system.mechanism.linear_springs)
            laws = [str(law) for one in members for law in one.laws]
            raise InputError("a law has no finite derivative here", field="load", value=", ".join(laws),
                             remedy="begin in another pose, or write laws that are smooth here")  # fmt: skip
        return self._force_pattern.matrix(forces), self._row_pattern.matrix(rows)

    def _strengths(self, point: MotionPoint) -> Array:
        """Return the derivative of each multiplier (m,) of a spring, damper or friction by its angle or rate."""
        rows, direction = self.system.packed.rows, make_tangent(self.system.packed)
        ones, scratch = np.ones(self.system.m), np.zeros(self.system.m)
        note_slopes(self.system.packed, point.q, point.v, scratch, ones, direction)
        with np.errstate(divide="ignore"):
            return np.where(rows["kind"] == FRICTION, direction.friction, 1.0 / rows["compliance"])
