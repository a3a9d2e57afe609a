"""Minimal coordinates of linear models: joints with motors by name, then elastic coordinates of bodies.

The constraints leave f free directions at a pose. Their coordinates y = T q are the angles and travels of the joints
that have motors, as far as these are independent (of flexible links mostly all), then as many flexible coordinates of
bodies as are missing, and places and angles of bodies where these do not suffice. Bodies are chosen by a QR
factorisation with pivots, soft coordinates first.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from paraflex.arrays import Array
from paraflex.dynamics import System, build_system
from paraflex.dynamics.constraints import coordinate_kind
from paraflex.dynamics.tangents import MotionPoint, Tangency, Tangents
from paraflex.errors import InputError
from paraflex.mechanism import ConstantSpeed, Mechanism, PrescribedAngle

# A direction with less than this part of its size independent of others follows from them.
_DEPENDENT = 1e-8
# Places and angles of bodies count as much less than flexible coordinates: they are chosen last.
_LAST = 1e-5


class Variable(NamedTuple):
    """A state, an input or an output: its name and its unit."""

    name: str
    unit: str


class Chosen(NamedTuple):
    """Minimal coordinates at a pose.

    Attributes
    ----------
    constraints : array of int
        Independent rows among the constraints.
    joints : array of int
        Rows of the joints whose coordinates are states, among `Coordinates.joints`.
    bodies : array of int
        Coordinates of bodies that are states.
    """

    constraints: NDArray[np.int64]
    joints: NDArray[np.int64]
    bodies: NDArray[np.int64]

    @property
    def freedoms(self) -> int:
        """Number of degrees of freedom."""
        return self.joints.size + self.bodies.size


class PointTangents(NamedTuple):
    """Tangent matrices at a point of a motion, constraints and coordinates of joints apart: see `Tangents`.

    Attributes
    ----------
    whole : Tangents
    constraints, joints : RowTangents
    compliant : array of int
        Rows of springs, dampers and friction, as the system numbers them.
    """

    whole: Tangents
    constraints: RowTangents
    joints: RowTangents
    compliant: NDArray[np.int64]


class RowTangents(NamedTuple):
    """Derivatives of some rows Phi of constraints, or of coordinates y of joints, each (rows, n).

    Attributes
    ----------
    jacobian : of Phi by q
    rate : of Phi' by q
    second_place, second_rate : of Phi'' by q and by v
    number : (rows,) array of int
        As the system numbers its rows; -1 where it has none.
    """

    jacobian: Array
    rate: Array
    second_place: Array
    second_rate: Array
    number: NDArray[np.int64]

    def taken(self, rows: NDArray[np.int64]) -> RowTangents:
        """Some of the rows."""
        return RowTangents(
            self.jacobian[rows], self.rate[rows], self.second_place[rows], self.second_rate[rows], self.number[rows]
        )

    def with_rows(self, others: RowTangents) -> RowTangents:
        """These rows and then others."""
        return RowTangents(
            np.vstack([self.jacobian, others.jacobian]), np.vstack([self.rate, others.rate]),
            np.vstack([self.second_place, others.second_place]), np.vstack([self.second_rate, others.second_rate]),
            np.concatenate([self.number, others.number]),
        )  # fmt: skip


@dataclass(frozen=True)
class Coordinates:
    """A mechanism's coordinates for linear models: what does not depend on the pose.

    Attributes
    ----------
    system : System
    joints : tuple of str
        Joints whose coordinates become states where they are independent; those of `driven` last, in their order.
    driven : tuple of str
        Prescribed motions that are inputs: their joints' coordinates are states.
    """

    system: System
    joints: tuple[str, ...]
    driven: tuple[str, ...] = ()

    @cached_property
    def tangency(self) -> Tangency:
        """Of the system with a row for every joint's coordinate, which prescribes nothing."""
        mechanism, held = self.system.mechanism, {one.joint for one in self.system.mechanism.prescribed}
        more = tuple(PrescribedAngle(_row(joint), joint, ConstantSpeed(0.0, 0.0))
                     for joint in self.joints if joint not in held)  # fmt: skip
        if not more:
            return Tangency(self.system)
        extended = build_system(replace(mechanism, prescribed=(*mechanism.prescribed, *more)))
        # Damping ratios are those of links whose motors turn freely, as in the system.
        own, bodies = self.system.packed, extended.packed.bodies.copy()
        bodies["damping"] = own.bodies["damping"]
        packed = extended.packed._replace(bodies=bodies, modal=own.modal, damping=own.damping)
        return Tangency(replace(extended, packed=packed))

    @cached_property
    def _rows(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Rows of the system with more rows: those of the joints' coordinates; and their numbers in the system."""
        extended = self.tangency.system
        mechanism, names = extended.mechanism, {name: k for k, name in enumerate(extended.rows)}
        by_joint = {one.joint: one.name for one in mechanism.prescribed}
        rows = [names[f"{by_joint[joint]} {coordinate_kind(mechanism.joint(joint))}"] for joint in self.joints]
        own = {name: k for k, name in enumerate(self.system.rows)}
        return np.array(rows, dtype=int), np.array([own.get(name, -1) for name in extended.rows])

    def at(self, point: MotionPoint) -> PointTangents:
        """The tangent matrices at a point of a motion."""
        coordinates, number = self._rows
        lam = np.zeros(number.size)
        lam[number >= 0] = point.multipliers[number[number >= 0]]
        whole = self.tangency.at(point._replace(multipliers=lam))

        def rows(wanted: NDArray[np.int64]) -> RowTangents:
            at = np.searchsorted(whole.rows, wanted)
            return RowTangents(
                whole.jacobian[at].toarray(), whole.rate[at].toarray(), whole.second_place[at].toarray(),
                whole.second_rate[at].toarray(), number[wanted],
            )  # fmt: skip

        holding = whole.rows[~np.isin(whole.rows, coordinates)]
        return PointTangents(whole, rows(holding), rows(coordinates), number[whole.compliant])

    def choose(self, tangents: PointTangents) -> Chosen:
        """Choose minimal coordinates at a pose."""
        scale = self.scale
        constraints = unit_rows(tangents.constraints.jacobian * scale)
        rows = unit_rows(tangents.joints.jacobian * scale)
        kept, free = _independent(constraints)
        joints: list[int] = []
        for k in self._order(rows.shape[0]):
            moved = rows[k] @ free
            size = np.linalg.norm(moved)
            if size <= _DEPENDENT:
                continue
            joints.append(k)
            free = free @ _complement(moved / size)
        weights = np.full(self.system.n, _LAST)
        for body in self.system.bodies:
            weights[body.flexible] = 1.0
        order = scipy.linalg.qr(free.T * weights, mode="r", pivoting=True)[-1]
        return Chosen(kept, np.array(sorted(joints), dtype=int), np.sort(np.asarray(order)[: free.shape[1]]))

    def _order(self, rows: int) -> list[int]:
        """Rows of coordinates of joints, those that are driven first: these must be states."""
        first = rows - len(self.driven)
        return [*range(first, rows), *range(first)]

    @cached_property
    def scale(self) -> Array:
        """What one of each coordinate (n,) is measured in: sizes of the mechanism, rad; less of stiff coordinates."""
        scale = self.system.units.copy()
        lowest = min((np.min(body.modes.omega[body.modes.omega > 0.0], initial=np.inf) for body in self.system.bodies),
                     default=np.inf)  # fmt: skip
        for body in self.system.bodies:
            size = self.system.size * np.sqrt(body.integrals.m)
            scale[body.flexible] = size / np.hypot(1.0, body.modes.omega / (lowest if np.isfinite(lowest) else 1.0))
        return scale

    def names(self, chosen: Chosen) -> tuple[Variable, ...]:
        """The states that are coordinates; their rates follow in the same order."""
        mechanism, quantities = self.system.mechanism, []
        for joint in (self.joints[k] for k in chosen.joints.tolist()):
            quantities.append(Variable(joint, "m" if mechanism.joint(joint).slides else "rad"))
        for k in chosen.bodies.tolist():
            body = next(one for one in self.system.bodies if one.all.start <= k < one.all.stop)
            local = k - body.offset
            own = ("x", "y", "angle")[local] if local < 3 else f"elastic{local - 2}"
            quantities.append(Variable(f"{body.name}.{own}", ("m", "m", "rad")[local] if local < 3 else "m kg^0.5"))
        return tuple(quantities)


def coordinates_of(system: System, driven: tuple[str, ...] = ()) -> Coordinates:
    """Coordinates with the joints of all motors, and those that are driven.

    Raises
    ------
    InputError
        A driven motion that the mechanism does not have.
    """
    mechanism: Mechanism = system.mechanism
    known = {one.name: one.joint for one in mechanism.prescribed}
    for name in driven:
        if name not in known:
            raise InputError(
                "is no prescribed motion", field="prescribed", value=name,
                remedy="choose from " + ", ".join(known) if known else "the mechanism has none",
            )  # fmt: skip
    joints = dict.fromkeys(motor.joint for motor in mechanism.motors if motor.joint not in set(known.values()))
    return Coordinates(system, (*joints, *(known[name] for name in driven)), driven)


def _row(joint: str) -> str:
    return f"coordinate of {joint}"


def unit_rows(rows: Array) -> Array:
    """Rows of size one, those of zeros as they are."""
    size = np.linalg.norm(rows, axis=1, keepdims=True)
    return rows / np.where(size > 0.0, size, 1.0)


def _independent(rows: Array) -> tuple[NDArray[np.int64], Array]:
    """Numbers of independent rows (of unit size), and a basis (n, f) of what all of them allow."""
    if not rows.size:
        return np.zeros(0, dtype=int), np.eye(rows.shape[1])
    factors = scipy.linalg.qr(rows.T, pivoting=True)
    size = np.abs(np.diag(factors[1]))
    rank = int(np.sum(size > _DEPENDENT * size.max(initial=1.0)))
    return np.sort(np.asarray(factors[2])[:rank]), np.asarray(factors[0])[:, rank:]


def _complement(direction: Array) -> Array:
    """A basis (f, f - 1) of what is perpendicular to a unit vector (f,)."""
    reflected = direction.copy()
    reflected[0] += np.copysign(1.0, direction[0])
    reflected /= np.linalg.norm(reflected)
    return (np.eye(direction.size) - 2.0 * np.outer(reflected, reflected))[:, 1:]
