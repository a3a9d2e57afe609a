"""States from the start of a motion as given by the user, by names."""

from collections.abc import Mapping
from functools import partial
from typing import NamedTuple

import numpy as np
import scipy

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array, Mask
from paraflex.errors import InconsistentConstraintsError, InputError
from paraflex.kernel.packed import Signals
from paraflex.limits import solvable
from paraflex.mechanism import (
    Assembly,
    BodyValues,
    Deflection,
    Mechanism,
    PointRef,
    Start,
    begun_at,
    check_start,
    standing,
)
from .change_points import change_point_at
from .coordinates import BodyCoordinates, end_markers
from .following import POSITION_STIFFNESS, follow_drives
from .joint_coordinates import joint_value
from .points import marker_place
from .projection import assemble, constraint_change, least_change, link_metric, project
from .rank import constraint_jacobian
from .signals import moment_signals
from .state import VELOCITY_STIFFNESS, State, check_accelerations, consistent_state, reference_pose, undeformed
from .system import System, build_system

# Largest gap of joints at a given start [sizes of the mechanism, rad], and largest relative error of velocities.
_GAP = 1e-6
_SLIP = 1e-6
# Given velocities within this fraction of the largest are those of a branch: messages show six digits.
_PRINTED = 1e-5
# Terms of a row that are a smaller fraction of the largest of all rows are rounding of the projection.
_SMALL_TERMS = 1e-4
# Given deflections of one beam may contradict one another by this fraction.
_CONTRADICTION = 1e-9


@checked_arguments()
@solvable("a start")
def start_state(
    system: System,
    start: Start,
    assembly: str | Assembly | None = None,
    *,
    q: Array | None = None,
    time: float = 0.0,
) -> State:
    """Return the state of a start; bodies without given coordinates come from an assembly, and joints are closed.

    Parameters
    ----------
    system : System
        System of the mechanism.
    start : Start
        Start as given by the user.
    assembly : Assembly or str, optional
        Assembly or its name. Not needed if the coordinates of every body are given.
    q : (n,) array, optional
        Coordinates from elsewhere, for example of a static equilibrium; the start then gives velocities only.
    time : float
        Time of prescribed motions [s]; zero by default.

    Raises
    ------
    InputError
        The start fails `check_start`, or joints are open at its coordinates or do not allow its velocities; the error
        gives the residual.
    """
    check_start(system.described, start)
    for field, given in (("coordinates", start.coordinates), ("rates", start.rates), ("deflection", start.deflection)):
        for name in given:
            if len(system.parts(name)) > 1:
                raise InputError(
                    "cannot be given for a beam in several frames", field=f"start.{field}.{name}",
                    remedy="give velocities of points, or the beam one frame",
                )  # fmt: skip
    if isinstance(assembly, str):
        assembly = system.mechanism.assembly(assembly)
    signals = moment_signals(system.mechanism, time)
    if q is None:
        q = _coordinates(system, signals, start, assembly, time)
    return State(time, q, _velocities(system, signals, start, time, q))


def standing_system(mechanism: Mechanism, start: Start | State | str | None, assembly: str | None = None) -> System:
    """Build a mechanism's system; prescribed motions without a start of their own begin at a start or assembly."""
    if isinstance(start, str):
        start, assembly = None, start
    if not isinstance(start, State):
        return build_system(standing(mechanism, assembly, start))
    system, q = build_system(mechanism), start.q
    begun = begun_at(mechanism, lambda joint: joint_value(system, joint, q), start.time)
    return system if begun is mechanism else build_system(begun)


def pose_at_rest(system: System, start: Start | State | None, assembly: str | None = None) -> State:
    """Return the pose of a start, or of an assembly with undeformed links, the first by default.

    Raises
    ------
    InputError
        The start is not valid: see `start_state`.
    AssemblyError
        The loops do not close.
    """
    if isinstance(start, State):
        return start
    mechanism = system.mechanism
    if start is None:
        rigid = build_system(system.described.rigid())
        return undeformed(system, rigid, consistent_state(rigid, assembly))
    return start_state(system, start, mechanism.assembly(assembly) if mechanism.assemblies else None)


def static_shape(system: System, name: str, points: Mapping[str, Deflection]) -> Array:
    """Return the modal coordinates (nf,) of a beam of least elastic energy with given deflections of its points.

    Deflections count from the tangent at the first end, for any reference condition; for a body of given shapes from
    its frame.

    Raises
    ------
    InputError
        Deflections contradict one another, or the body's shapes do not allow them.
    """
    body = system.body(name)
    root = _root_rows(system, name)
    rows, values, fields = [], [], []
    for point, deflection in points.items():
        marker = system.marker(PointRef(name, point))
        across = marker.N[1] - root[1] - marker.x0[0] * root[2]
        for what, row in (("axial", marker.N[0] - root[0]), ("transverse", across), ("slope", marker.slope - root[2])):
            value = getattr(deflection, what)
            if value is not None:
                rows.append(row)
                values.append(value)
                fields.append(f"{point}.{what}")
    if not rows:
        return np.zeros(body.nf)
    C, d = np.array(rows), np.array(values)
    compliant = C.T / body.modes.omega[:, None] ** 2
    # Rows scaled to one length: displacements and slopes differ in size.
    size = 1.0 / np.sqrt(np.maximum(np.sum(C * compliant.T, axis=1), np.finfo(float).tiny))
    force = size * np.linalg.lstsq((C @ compliant) * size * size[:, None], d * size, rcond=1e-12)[0]
    u = compliant @ force
    left = C @ u - d
    worst = int(np.argmax(np.abs(left)))
    if abs(left[worst]) > _CONTRADICTION * np.max(np.abs(d), initial=0.0):
        raise InputError(
            f"the shapes of the body, or its other deflections, do not allow it: "
            f"{abs(left[worst]):.3g} (m or rad) is missing",
            field=f"start.deflection.{name}.{fields[worst]}", value=values[worst],
            remedy="a beam's deflections count from the tangent at its first end, others from the body frame",
        )  # fmt: skip
    return u


def _root_rows(system: System, name: str) -> Array:
    """Return the displacement and slope of a beam's first end in its frame (3, nf); zero for bodies of given shapes."""
    body = system.body(name)
    if body.mesh is None:
        return np.zeros((3, body.nf))
    first = end_markers(system.index[name], body)[0]
    return np.vstack([first.N, first.slope])


def point_rows(system: System, q: Array, ref: PointRef) -> Array:
    """Return the rows (2, n) from the velocities of the coordinates to the velocity of a point of a body at q."""
    return marker_place(system, system.marker(ref), q[None])[1][0]


def _coordinates(system: System, signals: Signals, start: Start, assembly: Assembly | None, time: float) -> Array:
    if set(start.coordinates) == set(system.index):
        q = np.zeros(system.n)
    elif assembly is None:
        missing = next(name for name in system.index if name not in start.coordinates)
        raise InputError(
            "the coordinates of this body are not given, and there is no assembly to take them from",
            field="start.coordinates", value=missing,
            remedy="give them, or an [assembly.NAME] table",
        )  # fmt: skip
    else:
        q = reference_pose(system, assembly)
    held = np.zeros(system.n, dtype=bool)
    for name, values in start.coordinates.items():
        body = system.body(name)
        q[body.all] = _all_values(body, values, f"start.coordinates.{name}")
        held[body.all] = True
    for name, points in start.deflection.items():
        body = system.body(name)
        u = static_shape(system, name, points)
        q[body.flexible] = u
        held[body.flexible] = True
        # The assembly defines the position of the tangent at the first end.
        x, y, slope = _root_rows(system, name) @ u
        q[body.angle] -= slope
        cos, sin = np.cos(q[body.angle]), np.sin(q[body.angle])
        q[body.position] -= [cos * x - sin * y, sin * x + cos * y]
    return _closed(system, signals, time, q, held)


def _closed(system: System, signals: Signals, time: float, q: Array, held: Mask) -> Array:
    """Close the joints by the least change of the coordinates that are not held."""
    q = q if np.any(held) else follow_drives(system, signals, time, q)
    change = partial(constraint_change, system, stiffness=POSITION_STIFFNESS, free=~held)
    q, phi = assemble(system, signals, time, q, change, free=~held)
    worst = int(np.argmax(np.abs(phi) / system.row_units)) if phi.size else 0
    if system.gap(phi) > _GAP:
        raise InputError(
            f"the joints do not close at this start: a gap of {abs(phi[worst]):.3g} remains in {system.rows[worst]}",
            field="start.coordinates" if np.all(held) or not np.any(held) else "start",
            remedy=f"give coordinates at which they close to {_GAP * system.size:.2g} m or {_GAP:g} rad, "
            "or leave more open",
        )
    return q


def _velocities(system: System, signals: Signals, start: Start, time: float, q: Array) -> Array:
    _, rate = system.constraints(signals, time, q)
    entries = _velocity_entries(system, start, q)
    C = scipy.sparse.csr_matrix(
        scipy.sparse.vstack([constraint_jacobian(system, q), *(entry.row for entry in entries)])
    )
    target = np.concatenate([-rate, [entry.value for entry in entries]])
    units = np.concatenate([system.row_units, [entry.unit for entry in entries]])
    if set(start.rates) == set(system.index):
        v = np.zeros(system.n)
        for name, values in start.rates.items():
            body = system.body(name)
            v[body.all] = _all_values(body, values, f"start.rates.{name}")
    else:
        for stiffness in (VELOCITY_STIFFNESS, 0.0):
            change = least_change(link_metric(system, q, stiffness), C, units)
            v = project(change, np.zeros(system.n), lambda v: C @ v - target)
            # Flexures move by bending alone: with stiff links their projection is too ill-conditioned.
            missed, largest = (float(np.max(np.abs(each) / units, initial=0.0)) for each in (C @ v - target, target))
            if missed <= _SLIP * _SMALL_TERMS * largest:
                break
    slip = np.abs(C @ v - target)
    # Residual relative to the terms of each row, lengths in sizes of the mechanism.
    size = np.maximum(abs(C) @ np.abs(v), np.abs(target)) / units
    bad = slip / units > _SLIP * np.maximum(size, np.max(size, initial=0.0) * _SMALL_TERMS)
    if np.any(bad):
        _refuse_velocities(system, entries, slip, bad)
    fields = [entry.field for entry in entries]
    found = change_point_at(system, signals, time, q, C, target)
    if found.cause:
        raise InputError(found.cause, field=fields[0] if fields else "start", remedy=found.remedy)
    try:
        check_accelerations(system, signals, time, q, v)
    except InconsistentConstraintsError as error:
        # The branches are known without the velocity that contradicts them.
        for k, one in enumerate(fields):
            others = np.arange(len(target)) != system.m + k
            found = change_point_at(system, signals, time, q, C[others], target[others])
            for branch in found.velocities:
                if np.all(np.abs(C @ branch - target) < _PRINTED * units * np.max(np.abs(target))):
                    return branch
            if found.cause:
                problem = f"on neither branch of {found.cause}"
                raise InputError(problem, field=one, value=entries[k].value, remedy=found.remedy) from None
        raise InputError(error.cause.rstrip(","), field="start", remedy=error.remedy) from None
    return v


class _VelocityEntry(NamedTuple):
    """A given velocity: its row (1, n), value, scale, and field."""

    row: scipy.sparse.csr_matrix
    value: float
    unit: float
    field: str


def _velocity_entries(system: System, start: Start, q: Array) -> list[_VelocityEntry]:
    unit = scipy.sparse.csr_matrix(scipy.sparse.identity(system.n))
    given = [
        _VelocityEntry(unit[system.body(name).angle], rate, 1.0, f"start.velocity.angular.{name}")
        for name, rate in start.angular.items()
    ]
    for ref, velocity in start.point.items():
        rows = scipy.sparse.csr_matrix(point_rows(system, q, ref))
        given += [_VelocityEntry(rows[k], velocity[k], system.size, f"start.velocity.point.{ref}") for k in range(2)]
    for name, values in start.rates.items():
        body, field = system.body(name), f"start.rates.{name}"
        given += [
            _VelocityEntry(unit[body.offset + k], float(rate), float(system.units[body.offset + k]), field)
            for k, rate in enumerate(_all_values(body, values, field))
        ]
    return given


def _refuse_velocities(system: System, entries: list[_VelocityEntry], slip: Array, bad: Mask) -> None:
    worst = int(np.argmax(np.where(bad, slip, 0.0)))
    where = system.rows[worst] if worst < system.m else "what is given"
    of_given = slip[system.m :]
    entry = entries[int(np.argmax(of_given))] if entries else None
    raise InputError(
        f"joints, prescribed motions and given velocities contradict each other by {slip[worst]:.3g} m/s or rad/s in "
        f"{where}",
        field="start" if entry is None else entry.field,
        value=None if entry is None else entry.value,
        remedy="give fewer velocities, or ones that the joints allow",
    )


def _all_values(body: BodyCoordinates, values: BodyValues, field: str) -> Array:
    """Return a body's coordinates in q as given, or their rates."""
    frame = [values.x, values.y, values.phi]
    if values.flexible is None:
        return np.concatenate([frame, np.zeros(body.nf)])
    # D of a beam maps to its nodes; that of given shapes to the coordinates for which they are given.
    basis = body.integrals.D if body.mesh is None else body.modes.vectors
    own, count = np.array(values.flexible, dtype=float), basis.shape[0]
    if own.size != count:
        raise InputError(
            f"the body has {count} flexible coordinates", field=f"{field}.flexible", value=len(values.flexible),
            remedy=f"give {count} numbers, or leave them out for zeros",
        )  # fmt: skip
    eta = np.linalg.lstsq(basis, own, rcond=None)[0]
    missed = np.max(np.abs(basis @ eta - own), initial=0.0)
    if missed > _GAP * np.max(np.abs(own), initial=0.0):
        raise InputError(
            f"the modes kept of the body do not contain this shape: the nearest is {missed:.3g} off",
            field=f"{field}.flexible",
            remedy="keep all modes, or give a shape of those kept",
        )  # fmt: skip
    return np.concatenate([frame, eta])
