"""Linearised equations of motion in minimal coordinates y = T q: see `coordinates`.

At an operating point, dq = Z dy and dv = Z dy' + Z' dy with

    [Phi_q; T] Z = [0; 1],    [Phi_q; T] Z' = -[Phi_q'; T'] Z

and accelerations and multipliers follow from

    [M, Phi_q^T; Phi_q, 0] [da; dlambda] = [S du - D dv - K dq; -Phi''_q dq - Phi''_v dv]

with dy'' = T da + y''_q dq + y''_v dv. Driven coordinates have rows in Phi'' as well; their dy'' are inputs.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy
from scipy.sparse import csr_matrix

from paraflex.arrays import Array, Brief, Indices
from paraflex.dynamics import System
from paraflex.dynamics.sparse import Factor
from paraflex.dynamics.tangents import MotionPoint
from paraflex.errors import Moment, SingularPositionError
from .coordinates import CoordinateChoice, PointTangents, RowTangents

# Coordinates with a larger condition number are singular.
_SINGULAR = 1e13


class MotionDerivatives(NamedTuple):
    """Derivatives of the motion, with one column per state of x = (y, y'), then one per input.

    Attributes
    ----------
    q, v : (n, states) arrays
        Derivatives of coordinates and velocities, which do not depend on inputs.
    a : (n, states + inputs) array
        Derivatives of accelerations.
    multipliers : (m, states + inputs) array
        Derivatives of multipliers; zero in redundant rows.
    second : (f, states + inputs) array
        Derivatives of the minimal accelerations y''.
    """

    q: Array
    v: Array
    a: Array
    multipliers: Array
    second: Array


@dataclass(frozen=True)
class MinimalEquations(Brief):
    """Linearised equations of motion at an operating point in chosen minimal coordinates.

    Attributes
    ----------
    system : System
        System of the mechanism.
    point : MotionPoint
        Operating point.
    tangents : PointTangents
        Tangent matrices at the operating point.
    chosen : CoordinateChoice
        Minimal coordinates.
    scale : (n,) array
        Unit of each coordinate, for scaling.
    forces : (n, inputs) sparse matrix
        Generalised forces S of the inputs that are torques and forces.
    motors : (motors,) array of int
        Indices of the motors that are the first inputs.
    driven : int
        Number of driven joints, which are the last of the chosen joints; their accelerations are the last inputs.
    """

    system: System
    point: MotionPoint
    tangents: PointTangents
    chosen: CoordinateChoice
    scale: Array
    forces: csr_matrix
    motors: Indices
    driven: int

    @cached_property
    def constraints(self) -> RowTangents:
        """Tangents of the independent constraints."""
        return self.tangents.constraints.taken(self.chosen.constraints)

    @cached_property
    def joints(self) -> RowTangents:
        """Tangents of the joint coordinates that are states."""
        return self.tangents.joints.taken(self.chosen.joints)

    @cached_property
    def _matrix(self) -> csr_matrix:
        """Columns of [Phi_q; T] for the coordinates that are not states."""
        whole = csr_matrix(scipy.sparse.vstack([self.constraints.jacobian, self.joints.jacobian]))
        return csr_matrix(whole[:, self._dependent])

    @cached_property
    def _factor(self) -> Factor:
        """Factorisation of `_matrix`."""
        cause = "the coordinates chosen for the linear model do not describe its motion"
        factor = self._factored(self._matrix, self.scale[self._dependent], cause)
        if not factor.condition < _SINGULAR:
            raise self._singular(cause)
        return factor

    def _factored(self, matrix: csr_matrix, units: Array, cause: str) -> Factor:
        """Factorise a matrix that is singular at singular positions only."""
        try:
            return Factor(matrix, units)
        except np.linalg.LinAlgError as error:
            raise self._singular(cause) from error

    def _singular(self, cause: str) -> SingularPositionError:
        return SingularPositionError(
            cause, Moment(self.point.time, 0), remedy="linearise away from this singular position"
        )

    @property
    def condition(self) -> float:
        """Condition number of the minimal coordinates; infinite if they do not describe the motion."""
        try:
            return self._factor.condition
        except SingularPositionError:
            return np.inf

    @property
    def orientation(self) -> float:
        """Sign of the determinant of `_matrix`, which changes at a pose where the coordinates are singular."""
        return self._factor.sign

    def most_dependent(self) -> int | None:
        """Return the index in `chosen.joints` with the largest part in nearly dependent rows; None without joints."""
        rows = self._matrix.toarray() * self.scale[self._dependent]
        part = np.abs(scipy.linalg.svd(rows / np.linalg.norm(rows, axis=1, keepdims=True))[0][:, -1])
        part = part[self.constraints.number.size :]
        return int(np.argmax(part)) if part.size else None

    @cached_property
    def _dependent(self) -> Indices:
        return np.setdiff1d(np.arange(self.system.n), self.chosen.bodies)

    def coordinates(self, constraints: Array, y: Array) -> Array:
        """Compute changes of all coordinates (n, k) from those of the constraints Phi (c, k) and of y (f, k)."""
        joints = self.chosen.joints.size
        out = np.zeros((self.system.n, y.shape[1]))
        out[self.chosen.bodies] = y[joints:]
        right = np.vstack([constraints - self.constraints.jacobian @ out, y[:joints] - self.joints.jacobian @ out])
        out[self._dependent] = self._factor.solve(right)
        return out

    @cached_property
    def directions(self) -> Array:
        """Derivatives Z (n, f) of all coordinates with respect to y, dense."""
        f = self.chosen.freedoms
        return self.coordinates(np.zeros((self.chosen.constraints.size, f)), np.eye(f))

    @cached_property
    def changes(self) -> MotionDerivatives:
        """Derivatives of the motion with respect to states and inputs, dense."""
        Z, whole = self.directions, self.tangents.whole
        turned = np.zeros_like(Z)
        if np.any(self.point.v):
            still = np.zeros((self.chosen.bodies.size, Z.shape[1]))
            turned = -self.coordinates(self.constraints.rate @ Z, np.vstack([self.joints.rate @ Z, still]))
        q, v = np.hstack([Z, np.zeros_like(Z)]), np.hstack([turned, Z])
        forces = np.hstack(
            [-(whole.damping @ v + whole.stiffness @ q), self.forces.toarray(), np.zeros((self.system.n, self.driven))]
        )
        held = self._held(q, v, forces.shape[1])
        a, kept = self._accelerations(forces, held)
        second = np.zeros((self.chosen.freedoms, a.shape[1]))
        joints = self.chosen.joints.size
        second[:joints] = self.joints.jacobian @ a
        second[:joints, : q.shape[1]] += self.joints.second_place @ q + self.joints.second_rate @ v
        second[joints:] = a[self.chosen.bodies]
        multipliers = np.zeros((self.system.m, a.shape[1]))
        multipliers[self.held_rows.number] = kept
        multipliers[self.tangents.compliant, : q.shape[1]] = whole.compliant_place @ q + whole.compliant_rate @ v
        return MotionDerivatives(q, v, a, multipliers, second)

    @cached_property
    def held_rows(self) -> RowTangents:
        """Tangents of the rows with given second derivatives: constraints and driven coordinates."""
        driven = self.joints.taken(np.arange(self.chosen.joints.size - self.driven, self.chosen.joints.size))
        return self.constraints.with_rows(driven)

    def _held(self, q: Array, v: Array, columns: int) -> Array:
        """Return the derivatives of Phi_q a that the held rows require, with respect to states and inputs."""
        rows = self.held_rows
        out = np.zeros((rows.number.size, columns))
        out[:, : q.shape[1]] = -(rows.second_place @ q + rows.second_rate @ v)
        if self.driven:
            out[-self.driven :, -self.driven :] = np.eye(self.driven)
        return out

    def _accelerations(self, forces: Array, held: Array) -> tuple[Array, Array]:
        """Solve for accelerations and multipliers from forces and the second derivatives of held rows."""
        rows, n = self.held_rows.jacobian, self.system.n
        mass = self.tangents.whole.mass
        column = 1.0 / np.sqrt(mass.diagonal())
        size = 1.0 / scipy.sparse.linalg.norm(rows @ scipy.sparse.diags(column), axis=1)
        factor = self._factored(
            csr_matrix(scipy.sparse.bmat([[mass, rows.T], [rows, None]])), np.concatenate([column, size]),
            "its constraints, or the accelerations that are given, depend on one another",
        )  # fmt: skip
        found = factor.solve(np.vstack([forces, held]))
        return found[:n], found[n:]
