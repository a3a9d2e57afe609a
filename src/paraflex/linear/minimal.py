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

from paraflex.arrays import Array
from paraflex.dynamics import System
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
    forces : (n, inputs) array
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
    forces: Array
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

    @property
    def _rows(self) -> Array:
        """The rows [Phi_q; T] in units of the coordinates."""
        bodies = np.zeros((self.chosen.bodies.size, self.system.n))
        bodies[np.arange(self.chosen.bodies.size), self.chosen.bodies] = 1.0
        return np.vstack([self.constraints.jacobian, self.joints.jacobian, bodies]) * self.scale

    @cached_property
    def _factor(self) -> tuple[tuple[Array, Array], Array, float]:
        """LU factor of `_rows` in units of the rows, these, and its condition number."""
        rows = self._rows
        size = np.linalg.norm(rows, axis=1, keepdims=True)
        factor = scipy.linalg.lu_factor(rows / size)
        inverse = scipy.linalg.lapack.dgecon(factor[0], np.linalg.norm(rows / size, 1))[0]
        if not inverse * _SINGULAR > 1.0:
            cause = "the coordinates chosen for the linear model do not describe its motion"
            raise SingularPositionError(
                cause, Moment(self.point.time, 0), remedy="linearise away from this singular position"
            )
        return factor, size, 1.0 / float(inverse)

    @property
    def condition(self) -> float:
        """Condition number of the coordinates, infinite where they do not describe the motion."""
        try:
            return self._factor[2]
        except SingularPositionError:
            return np.inf

    @property
    def orientation(self) -> float:
        """Sign of the determinant of `_rows`: another one lies beyond a pose where the coordinates are singular."""
        factor, pivots = self._factor[0]
        return float(np.prod(np.sign(np.diag(factor)))) * (-1.0) ** np.sum(pivots != np.arange(pivots.size))

    def most_dependent(self) -> int | None:
        """Which of `chosen.joints` has the largest part in rows that nearly depend on one another; None without any."""
        size = np.linalg.norm(self._rows, axis=1, keepdims=True)
        part = np.abs(scipy.linalg.svd(self._rows / size)[0][:, -1])
        first = self.constraints.number.size
        part = part[first : first + self.chosen.joints.size]
        return int(np.argmax(part)) if part.size else None

    def _coordinates(self, right: Array) -> Array:
        """Changes of all coordinates, from those of Phi and y."""
        factor, size, _ = self._factor
        return self.scale[:, None] * scipy.linalg.lu_solve(factor, right / size)

    @cached_property
    def directions(self) -> Array:
        """Z (n, f): how all coordinates change with each y."""
        return self._coordinates(np.eye(self.system.n)[:, self.system.n - self.chosen.freedoms :])

    @cached_property
    def changes(self) -> Changes:
        """Changes of the motion with states and inputs."""
        Z, whole = self.directions, self.tangents.whole
        turned = np.zeros_like(Z)
        if np.any(self.point.v):
            still = np.zeros((self.chosen.bodies.size, Z.shape[1]))
            turned = -self._coordinates(np.vstack([self.constraints.rate @ Z, self.joints.rate @ Z, still]))
        q, v = np.hstack([Z, np.zeros_like(Z)]), np.hstack([turned, Z])
        forces = np.hstack(
            [-(whole.damping @ v + whole.stiffness @ q), self.forces, np.zeros((self.system.n, self.driven))]
        )
        held = self._held(q, v, forces.shape[1])
        a, kept = self._accelerations(forces, held)
        second = np.zeros((self.chosen.freedoms, a.shape[1]))
        moved = self.joints.second_place @ q + self.joints.second_rate @ v
        second[: moved.shape[0]] = self.joints.jacobian @ a
        second[: moved.shape[0], : moved.shape[1]] += moved
        second[moved.shape[0] :] = a[self.chosen.bodies]
        multipliers = np.zeros((self.system.m, a.shape[1]))
        multipliers[self._held_rows.number] = kept
        multipliers[self.tangents.compliant, : q.shape[1]] = whole.compliant_place @ q + whole.compliant_rate @ v
        return Changes(q, v, a, multipliers, second)

    @cached_property
    def _held_rows(self) -> RowTangents:
        """Rows whose second derivatives are given: constraints, and coordinates that are driven."""
        driven = self.joints.taken(np.arange(self.chosen.joints.size - self.driven, self.chosen.joints.size))
        return self.constraints.with_rows(driven)

    def _held(self, q: Array, v: Array, columns: int) -> Array:
        """Phi_q da as states and inputs want it."""
        rows = self._held_rows
        out = np.zeros((rows.number.size, columns))
        out[:, : q.shape[1]] = -(rows.second_place @ q + rows.second_rate @ v)
        if self.driven:
            out[-self.driven :, -self.driven :] = np.eye(self.driven)
        return out

    def _accelerations(self, forces: Array, held: Array) -> tuple[Array, Array]:
        """Accelerations and multipliers from forces and from the second derivatives of held rows."""
        rows, n = self._held_rows.jacobian, self.system.n
        mass = self.tangents.whole.mass.toarray()
        column = 1.0 / np.sqrt(mass.diagonal())
        scaled = rows * column
        size = 1.0 / np.linalg.norm(scaled, axis=1)
        scaled = scaled * size[:, None]
        matrix = np.zeros((n + size.size, n + size.size))
        matrix[:n, :n] = mass * column * column[:, None]
        matrix[n:, :n], matrix[:n, n:] = scaled, scaled.T
        right = np.vstack([forces * column[:, None], held * size[:, None]])
        found = scipy.linalg.solve(matrix, right, assume_a="sym")
        return found[:n] * column[:, None], found[n:] * size[:, None]
