"""Minimal coordinates of linear models: coordinates of motors' joints, then elastic coordinates of bodies.

The constraints leave f degrees of freedom at a pose. The minimal coordinates y = T q are the angles and travels of the
joints with motors, as far as these are independent (with flexible links usually all), then flexible coordinates of
bodies, and positions and angles of bodies where these do not suffice: see `independent`. Position and angle of the
end-effector may take the place of the joints.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy
from scipy.sparse import csr_matrix

from paraflex.arrays import Array, Brief, Indices
from paraflex.dynamics import System, joint_coordinate, material_angle
from paraflex.dynamics.constraints import coordinate_kind
from paraflex.dynamics.points import marker_place
from paraflex.dynamics.system import with_constraints_of
from paraflex.dynamics.tangents import MotionPoint, Tangency, Tangents, rows_of
from paraflex.errors import InputError
from paraflex.mechanism import GROUND, ConstantSpeed, Mechanism, PointRef, PrescribedAngle, RevoluteJoint
from paraflex.mechanism.cut import Cut
from paraflex.mechanism.quantities import all_listed
from .independent import independent_dense, independent_sparse

# Largest matrix for dense factorisation: BLAS uses a single thread for it.
_FEW_ENTRIES = 8192
# Weight of positions and angles of bodies relative to flexible coordinates: they become states last.
_LAST = 1e-5
# Fictitious pin between the end-effector and the origin, whose rows are the end-effector's coordinates.
_TASK, _ORIGIN = "the end-effector", "origin of named coordinates"


class Variable(NamedTuple):
    """Name and unit of a state, an input or an output."""

    name: str
    unit: str


def numbers_of(names: Sequence[str] | None, have: Sequence[Variable], what: str) -> Indices:
    """Return the indices of variables by name, by default of all.

    Raises
    ------
    InputError
        A name is unknown.
    """
    known = [one.name for one in have]
    if names is None:
        return np.arange(len(known))
    all_listed(names, known, f"{what}s", f"is not one of the {what}s")
    return np.array([known.index(name) for name in names], dtype=int)


class CoordinateChoice(NamedTuple):
    """Choice of minimal coordinates at a pose.

    Attributes
    ----------
    constraints : array of int
        Indices of the independent constraints.
    joints : array of int
        Indices in `Coordinates.measured` of the coordinates of the end-effector and of joints that are states.
    bodies : array of int
        Indices of the coordinates of bodies that are states.
    """

    constraints: Indices
    joints: Indices
    bodies: Indices

    @property
    def freedoms(self) -> int:
        """Number of degrees of freedom."""
        return self.joints.size + self.bodies.size


class PointTangents(NamedTuple):
    """Tangent matrices at an operating point, separately for constraints and joint coordinates: see `Tangents`.

    Attributes
    ----------
    whole : Tangents
        Tangent matrices of the equations of motion.
    constraints, joints : RowTangents
        Tangents of the constraints and of the coordinates of `Coordinates.measured`.
    compliant : array of int
        Indices in the system of the rows of springs, dampers and friction.
    motors : (motors, n) sparse matrix
        Derivatives of the coordinates on which the motors act.
    """

    whole: Tangents
    constraints: RowTangents
    joints: RowTangents
    compliant: Indices
    motors: csr_matrix


class RowTangents(NamedTuple):
    """Derivatives of constraint rows Phi, or of joint coordinates y, each (rows, n) and sparse with the same pattern.

    Attributes
    ----------
    jacobian : (rows, n) sparse matrix
        Derivatives of Phi with respect to q.
    rate : (rows, n) sparse matrix
        Derivatives of Phi' with respect to q.
    second_place, second_rate : (rows, n) sparse matrices
        Derivatives of Phi'' with respect to q and to v.
    number : (rows,) array of int
        Indices of the rows in the system; -1 for rows that it does not have.
    """

    jacobian: csr_matrix
    rate: csr_matrix
    second_place: csr_matrix
    second_rate: csr_matrix
    number: Indices

    def taken(self, rows: Indices) -> RowTangents:
        """Return the tangents of some of the rows."""
        return RowTangents(*rows_of(rows, *self[:4]), number=self.number[rows])

    def with_rows(self, others: RowTangents) -> RowTangents:
        """Return the tangents of these rows followed by others."""
        parts = (csr_matrix(scipy.sparse.vstack(pair)) for pair in zip(self[:4], others[:4], strict=True))
        return RowTangents(*parts, number=np.concatenate([self.number, others.number]))


@dataclass(frozen=True)
class Coordinates(Brief):
    """Candidate coordinates of a mechanism for linear models, independent of the pose.

    Attributes
    ----------
    system : System
        System of the mechanism.
    joints : tuple of str
        Joints of the motors, followed by those of `driven`, in order; their coordinates become states if they are
        independent.
    driven : tuple of str
        Prescribed motions that are inputs; the coordinates of their joints are states.
    task : tuple of str
        Coordinates "x", "y" and "angle" of the end-effector that become states in place of those of motors' joints.
    """

    system: System
    joints: tuple[str, ...]
    driven: tuple[str, ...] = ()
    task: tuple[str, ...] = ()

    @cached_property
    def measured(self) -> tuple[Variable, ...]:
        """Coordinates of the end-effector and of the joints, which may become states."""
        slides = [self.system.mechanism.joint(joint).slides for joint in self._candidates]
        return (
            *(Variable(axis, "rad" if axis == "angle" else "m") for axis in self.task),
            *(Variable(joint, "m" if each else "rad") for joint, each in zip(self._candidates, slides, strict=True)),
        )

    @property
    def _candidates(self) -> tuple[str, ...]:
        """Joints whose coordinates may become states: with the end-effector's coordinates only the driven ones."""
        return self.joints[len(self.joints) - len(self.driven) :] if self.task else self.joints

    def values(self, chosen: CoordinateChoice, q: Array, v: Array) -> Array:
        """Return minimal coordinates, then their rates (k, 2f), from coordinates q and velocities v (k, n)."""
        found = [self._measured(k, q, v) for k in chosen.joints.tolist()]
        found += [(q[:, k], v[:, k]) for k in chosen.bodies.tolist()]
        return np.concatenate([np.stack(part, axis=1) for part in zip(*found, strict=True)], axis=1)

    def _measured(self, k: int, q: Array, v: Array) -> tuple[Array, Array]:
        """Return a coordinate of `measured` and its rate."""
        if k >= len(self.task):
            coordinate = joint_coordinate(self.system, self._candidates[k - len(self.task)], q, v)
            return coordinate.value, coordinate.rate
        axis, marker = self.task[k], self.system.marker(self._effector)
        if axis == "angle":
            # The slope is linear in the coordinates.
            return material_angle(self.system, self._effector, q), material_angle(self.system, self._effector, v)
        place, rows = marker_place(self.system, marker, q)
        component = ("x", "y").index(axis)
        return place[:, component], np.sum(rows[:, component] * v, axis=1)

    @property
    def _effector(self) -> PointRef:
        effector = self.system.mechanism.end_effector
        assert effector is not None
        return effector.point

    @cached_property
    def tangency(self) -> Tangency:
        """Tangent matrices of the system extended by a row for every coordinate of `measured`, without a constraint."""
        angle = [_TASK] if "angle" in self.task else []
        pins = {_TASK: self._effector} if self.task else {}
        return Tangency(with_coordinates(self.system, (*self.joints, *angle), pins))

    @cached_property
    def _rows(self) -> tuple[dict[str, int], Indices]:
        """Coordinate rows of the extended system by joint, and the indices of all its rows in the original system."""
        extended = self.tangency.system
        mechanism, names = extended.mechanism, {name: k for k, name in enumerate(extended.rows)}
        rows = {one.joint: names[f"{one.name} {coordinate_kind(mechanism.joint(one.joint))}"]
                for one in mechanism.prescribed}  # fmt: skip
        own = {name: k for k, name in enumerate(self.system.rows)}
        return rows, np.array([own.get(name, -1) for name in extended.rows], dtype=int)

    def _rows_of(self, joints: Sequence[str]) -> Indices:
        return np.array([self._rows[0][joint] for joint in joints], dtype=int)

    def inertia(self, time: float, q: Array, joints: Sequence[str]) -> tuple[csr_matrix, csr_matrix, csr_matrix]:
        """Return mass matrix, constraint rows and joint rows at coordinates q (n,)."""
        mass, jacobian = self.tangency.inertia(time, q)
        number = self._rows[1]
        own = np.nonzero(number >= 0)[0]
        constraints, rows = own[np.argsort(number[own])], self._rows_of(joints)
        return mass, jacobian[constraints], jacobian[rows]

    def at(self, point: MotionPoint) -> PointTangents:
        """Compute the tangent matrices at an operating point."""
        (rows_at, number), names = self._rows, self.tangency.system.rows
        task = [rows_at[_TASK] if axis == "angle" else names.index(f"{_TASK} {axis}") for axis in self.task]
        coordinates = np.concatenate([np.array(task, dtype=int), self._rows_of(self._candidates)])
        lam = np.zeros(number.size)
        lam[number >= 0] = point.multipliers[number[number >= 0]]
        whole = self.tangency.at(point._replace(multipliers=lam))

        def rows(selected: Indices) -> RowTangents:
            at = np.searchsorted(whole.rows, selected)
            parts = (whole.jacobian, whole.rate, whole.second_place, whole.second_rate)
            return RowTangents(*rows_of(at, *parts), number=number[selected])

        # No row of the fictitious pin is a constraint, whether it is a coordinate or not.
        pin = [k for k, name in enumerate(names) if name.startswith(_TASK)]
        holding = whole.rows[~np.isin(whole.rows, [*self._rows_of(self.joints), *coordinates, *pin])]
        motors = self._rows_of([motor.joint for motor in self.system.mechanism.motors])
        acting = whole.jacobian[np.searchsorted(whole.rows, motors)]
        return PointTangents(whole, rows(holding), rows(coordinates), number[whole.compliant], acting)

    def choose(self, tangents: PointTangents, without: Collection[int] = ()) -> CoordinateChoice:
        """Choose minimal coordinates at a pose, with the exception of those of `measured` in `without`.

        Raises
        ------
        InputError
            The end-effector's coordinates shall be states but do not describe the motion.
        """
        constraints, joints = (unit_in(part.jacobian, self.scale) for part in (tangents.constraints, tangents.joints))
        # Driven coordinates must be states.
        free, driven = np.split(np.arange(len(self.measured)), [len(self.measured) - len(self.driven)])
        free = np.array([k for k in free.tolist() if k not in without], dtype=int)
        weights = np.full(self.system.n, _LAST)
        for body in self.system.bodies:
            weights[body.flexible] = 1.0
        few = (tangents.constraints.number.size + len(self.measured)) * self.system.n <= _FEW_ENTRIES
        choose = independent_dense if few else independent_sparse
        found = choose([constraints, joints[driven], joints[free]], weights)
        states = np.concatenate([free[found.groups[2]], driven[found.groups[1]]])
        bodies = np.setdiff1d(np.arange(self.system.n), found.columns)
        chosen = CoordinateChoice(found.groups[0], states, bodies)
        if self.task:
            self._check_task(chosen)
        return chosen

    def _check_task(self, chosen: CoordinateChoice) -> None:
        """Raise an `InputError` if end-effector coordinates depend on others or leave rigid bodies free."""
        rigid = [body.name for body in self.system.bodies
                 if np.isin(chosen.bodies, np.arange(body.offset, body.offset + 3)).any()]  # fmt: skip
        follow = [axis for k, axis in enumerate(self.task) if k not in chosen.joints]
        if not (rigid or follow):
            return
        reason = (
            f"{', '.join(follow)} cannot change by itself" if follow
            else f"{', '.join(rigid)} can move while {', '.join(self.task)} and all deflections stay"
        )  # fmt: skip
        raise InputError(
            f"the end-effector's coordinates do not describe the motion here: {reason}",
            field="coordinates", value="task", remedy='choose "motors", or another pose',
        )  # fmt: skip

    @cached_property
    def scale(self) -> Array:
        """Scale of each coordinate (n,): size of the mechanism or rad, and less for stiff flexible coordinates."""
        scale = self.system.units.copy()
        lowest = min((np.min(body.modes.omega[body.modes.omega > 0.0], initial=np.inf) for body in self.system.bodies),
                     default=np.inf)  # fmt: skip
        for body in self.system.bodies:
            size = self.system.size * np.sqrt(body.integrals.m)
            scale[body.flexible] = size / np.hypot(1.0, body.modes.omega / (lowest if np.isfinite(lowest) else 1.0))
        return scale

    def names(self, chosen: CoordinateChoice) -> tuple[Variable, ...]:
        """Return the states that are coordinates; their rates are states in the same order."""
        quantities = [self.measured[k] for k in chosen.joints.tolist()]
        offsets = np.array([body.offset for body in self.system.bodies])
        for k, which in zip(chosen.bodies, np.searchsorted(offsets, chosen.bodies, side="right") - 1, strict=True):
            body = self.system.bodies[which]
            local = int(k - body.offset)
            own = ("x", "y", "angle")[local] if local < 3 else f"elastic{local - 2}"
            quantities.append(Variable(f"{body.name}.{own}", ("m", "m", "rad")[local] if local < 3 else "m kg^0.5"))
        return tuple(quantities)


class FirstCoordinates(Enum):
    """Coordinates that are the first states: those of the motors' joints or those of the end-effector."""

    MOTORS = "motors"
    TASK = "task"


def coordinates_of(
    system: System, driven: tuple[str, ...] = (), first: FirstCoordinates = FirstCoordinates.MOTORS
) -> Coordinates:
    """Return the candidate coordinates: those of all motors' joints or of the end-effector, and driven ones.

    Raises
    ------
    InputError
        The mechanism does not have a driven motion, or has no end-effector where one is needed.
    """
    mechanism: Mechanism = system.mechanism
    known = {one.name: one.joint for one in mechanism.prescribed}
    for name in driven:
        if name not in known:
            raise InputError(
                "is not a prescribed motion", field="prescribed", value=name,
                remedy="choose from " + ", ".join(known) if known else "the mechanism has none",
            )  # fmt: skip
    task: tuple[str, ...] = ()
    if first is FirstCoordinates.TASK:
        if mechanism.end_effector is None:
            raise InputError("needs an end-effector, which the mechanism does not have", field="coordinates",
                             value="task", remedy='choose "motors", or name an end-effector')  # fmt: skip
        task = mechanism.end_effector.coordinates
    joints = dict.fromkeys(motor.joint for motor in mechanism.motors if motor.joint not in set(known.values()))
    return Coordinates(system, (*joints, *(known[name] for name in driven)), driven, task)


def with_coordinates(system: System, joints: Iterable[str], pins: Mapping[str, PointRef]) -> System:
    """Return the system extended by rows of joint coordinates, and of point positions as pins to the origin.

    The rows serve for derivatives only and are not constraints. The pins are joints by name, whose angles may be among
    the coordinates; prescribed joints have their rows already.
    """
    mechanism, origin = system.mechanism, PointRef(GROUND, _ORIGIN)
    driven = {one.joint for one in mechanism.prescribed}
    profiles = [PrescribedAngle(f"coordinate of {joint}", joint, ConstantSpeed(0.0, 0.0))
            for joint in joints if joint not in driven]  # fmt: skip
    pinned = [RevoluteJoint(name, origin, point) for name, point in pins.items()]
    extended = replace(
        mechanism, ground={**mechanism.ground, _ORIGIN: (0.0, 0.0)}, joints=(*mechanism.joints, *pinned),
        prescribed=(*mechanism.prescribed, *profiles), cut=mechanism.cut or Cut(mechanism, {}, {}),
    )  # fmt: skip
    return with_constraints_of(system, extended)


def unit_in(rows: csr_matrix, scale: Array) -> csr_matrix:
    """Normalise rows to unit norm in units (n,) of the coordinates; rows of zeros are unchanged."""
    scaled = csr_matrix(rows @ scipy.sparse.diags(scale))
    size = np.sqrt(np.asarray(scaled.multiply(scaled).sum(axis=1)).ravel())
    return csr_matrix(scipy.sparse.diags(1.0 / np.where(size > 0.0, size, 1.0)) @ scaled)
