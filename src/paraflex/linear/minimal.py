"""The equations of small motions in minimal coordinates y = T q: see `coordinates`.

About a point of a motion, dq = Z dy and dv = Z dy' + Z' dy with

    [Phi_q; T] Z = [0; 1],    [Phi_q; T] Z' = -[Phi_q'; T'] Z

and accelerations and multipliers follow from

    [M, Phi_q^T; Phi_q, 0] [da; dlambda] = [S du - D dv - K dq; -Phi''_q dq - Phi''_v dv]

with dy'' = T da + y''_q dq + y''_v dv. Coordinates that are driven have rows among Phi'' too, their dy'' given.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from paraflex.arrays import Array
from paraflex.dynamics import System
from paraflex.dynamics.sparse import Factor
from paraflex.dynamics.tangents import MotionPoint
from paraflex.errors import Moment, SingularPositionError
from paraflex.linear.coordinates import Chosen, PointTangents, RowTangents

# Coordinates with a larger condition number do not describe the motion any more.
_SINGULAR = 1e13


class Changes(NamedTuple):
    """Changes of the motion, a column for each state of x = (y, y') and then for each input.

    Attributes
    ----------
    q, v : (n, states) arrays
        Inputs do not change these.
    a : (n, states + inputs) array
    multipliers : (m, states + inputs) array
        Zero in redundant rows.
    second : (f, states + inputs) array
        Of the accelerations y''.
    """

    q: Array
    v: Array
    a: Array
    multipliers: Array
    second: Array


@dataclass(frozen=True)
class Minimal:
    """Small motions about a point of a motion in chosen coordinates.

    Attributes
    ----------
    system : System
    point : MotionPoint
    tangents : PointTangents
    chosen : Chosen
    scale : (n,) array
        What one of each coordinate is measured in.
    forces : (n, inputs) sparse matrix
        Generalised forces S of the inputs that are torques and forces.
    motors : (motors,) array of int
        Numbers of the motors that are the first of the inputs.
    driven : int
        How many of the last of the chosen joints are driven: their accelerations are the last inputs.
    """

    system: System
    point: MotionPoint
    tangents: PointTangents
    chosen: Chosen
    scale: Array
    forces: csr_matrix
    motors: NDArray[np.int64]
    driven: int

    @cached_property
    def constraints(self) -> RowTangents:
        """The independent constraints."""
        return self.tangents.constraints.taken(self.chosen.constraints)

    @cached_property
    def joints(self) -> RowTangents:
        """Those joints' coordinates that are states."""
        return self.tangents.joints.taken(self.chosen.joints)

    @cached_property
    def _matrix(self) -> csr_matrix:
        """The rows [Phi_q; T] at the coordinates that are no states."""
        whole = csr_matrix(scipy.sparse.vstack([self.constraints.jacobian, self.joints.jacobian]))
        return csr_matrix(whole[:, self._dependent])

    @cached_property
    def _factor(self) -> Factor:
        """Factor of `_matrix`."""
        cause = "the coordinates chosen for the linear model do not describe its motion"
        factor = self._factored(self._matrix, self.scale[self._dependent], cause)
        if not factor.condition < _SINGULAR:
            raise self._singular(cause)
        return factor

    def _factored(self, matrix: csr_matrix, units: Array, cause: str) -> Factor:
        """A factored matrix that is singular in singular positions only."""
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
        """Condition number of the coordinates, infinite where they do not describe the motion."""
        try:
            return self._factor.condition
        except SingularPositionError:
            return np.inf

    @property
    def orientation(self) -> float:
        """Sign of the determinant of `_matrix`: another one lies beyond a pose where the coordinates are singular."""
        return self._factor.sign

    def most_dependent(self) -> int | None:
        """Which of `chosen.joints` has the largest part in rows that nearly depend on one another; None without any."""
        rows = self._matrix.toarray() * self.scale[self._dependent]
        part = np.abs(scipy.linalg.svd(rows / np.linalg.norm(rows, axis=1, keepdims=True))[0][:, -1])
        part = part[self.constraints.number.size :]
        return int(np.argmax(part)) if part.size else None

    @cached_property
    def _dependent(self) -> NDArray[np.int64]:
        return np.setdiff1d(np.arange(self.system.n), self.chosen.bodies)

    def coordinates(self, constraints: Array, y: Array) -> Array:
        """Changes of all coordinates (n, k), from those of the constraints Phi (c, k) and of y (f, k)."""
        joints = self.chosen.joints.size
        out = np.zeros((self.system.n, y.shape[1]))
        out[self.chosen.bodies] = y[joints:]
        right = np.vstack([constraints - self.constraints.jacobian @ out, y[:joints] - self.joints.jacobian @ out])
        out[self._dependent] = self._factor.solve(right)
        return out

    @cached_property
    def directions(self) -> Array:
        """Z (n, f): how all coordinates change with each y. Dense."""
        f = self.chosen.freedoms
        return self.coordinates(np.zeros((self.chosen.constraints.size, f)), np.eye(f))

    @cached_property
    def changes(self) -> Changes:
        """Changes of the motion with states and inputs. Dense."""
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
        return Changes(q, v, a, multipliers, second)

    @cached_property
    def held_rows(self) -> RowTangents:
        """Rows whose second derivatives are given: constraints, and coordinates that are driven."""
        driven = self.joints.taken(np.arange(self.chosen.joints.size - self.driven, self.chosen.joints.size))
        return self.constraints.with_rows(driven)

    def _held(self, q: Array, v: Array, columns: int) -> Array:
        """Phi_q da as states and inputs want it."""
        rows = self.held_rows
        out = np.zeros((rows.number.size, columns))
        out[:, : q.shape[1]] = -(rows.second_place @ q + rows.second_rate @ v)
        if self.driven:
            out[-self.driven :, -self.driven :] = np.eye(self.driven)
        return out

    def _accelerations(self, forces: Array, held: Array) -> tuple[Array, Array]:
        """Accelerations and multipliers from forces and from the second derivatives of held rows."""
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
