"""Coordinate on which a joint's motor acts: the angle of a revolute joint, the travel of a sliding joint."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from paraflex.arrays import Array, Indices
from paraflex.formatting import ROUNDING, output_unit, quantity
from paraflex.mechanism import Joint, PointRef
from .coordinates import GROUND_INDEX, Marker
from .points import cross, marker_place, marker_position
from .system import DENSE_ROWS, System


class JointCoordinate(NamedTuple):
    """Coordinate of a joint over time [rad, m], (k,), its rate, (k,), and its derivative by all coordinates, (k, n)."""

    value: Array
    rate: Array
    rows: Array


def joint_coordinate(system: System, name: str, q: Array, v: Array | None = None) -> JointCoordinate:
    """Return the coordinate of a joint for coordinates (k, n) and velocities (k, n); zero velocities by default.

    Slopes of beams are included. Angle: that of body b less that of body a. Travel: e . (p_b - p_a), e the axis.
    """
    joint = system.mechanism.joint(name)
    v = np.zeros_like(q) if v is None else v
    if not joint.slides:
        ends = (_marker_angle(system, system.marker(ref), q) for ref in (joint.a, joint.b))
        (value_a, rows_a), (value_b, rows_b) = ends
        rows = rows_b - rows_a
        return JointCoordinate(value_b - value_a, np.sum(rows * v, axis=1), rows)
    carrier = axis_marker(system, joint)
    theta, turn = _marker_angle(system, carrier, q)
    theta = theta + joint.direction
    e = unit_vectors(theta)
    (pa, rows_a), (pb, rows_b) = marker_place(system, carrier, q), marker_place(system, system.marker(joint.b), q)
    d = pb - pa
    rows = np.einsum("ki,kij->kj", e, rows_b - rows_a) + cross(e, d)[:, None] * turn
    return JointCoordinate(np.sum(e * d, axis=1), np.sum(rows * v, axis=1), rows)


def own_coordinate(system: System, name: str, q: Array, v: Array | None = None) -> tuple[JointCoordinate, Indices]:
    """Return `joint_coordinate` with derivatives (k, c) by the coordinates of the joint's bodies only, and these (c,).

    For many bodies time and memory do not depend on their number.
    """
    if system.m <= DENSE_ROWS:
        return joint_coordinate(system, name, q, v), np.arange(system.n)
    joint, bodies, columns = system.mechanism.joint(name), [], []
    for i in dict.fromkeys(system.marker(ref).body for ref in (joint.a, joint.b) if not ref.on_ground):
        body = system.bodies[i]
        bodies.append(replace(body, offset=len(columns)))
        columns += range(body.all.start, body.all.stop)
    part, own = replace(system, bodies=tuple(bodies)), np.array(columns)
    return joint_coordinate(part, name, q[:, own], None if v is None else v[:, own]), own


def joint_value(system: System, name: str, q: Array) -> float:
    """Return the coordinate of a joint at q (n,) [rad, m]."""
    return float(joint_coordinate(system, name, q[None]).value[0])


def joint_rows(system: System, names: Sequence[str], q: Array) -> Array:
    """Return the derivatives (joints, n) of the coordinates of joints at q (n,)."""
    return np.array([joint_coordinate(system, name, q[None]).rows[0] for name in names]).reshape(-1, system.n)


def value_text(system: System, name: str, q: Array) -> str:
    """Format the coordinate of a joint at q (n,), with its unit."""
    value, unit = joint_value(system, name, q), "m" if system.mechanism.slides(name) else "rad"
    return quantity(value if abs(value) > ROUNDING else 0.0, unit, output_unit(unit), digits=6, padded=False)


def place_along_beam(system: System, name: str, q: Array) -> Array:
    """Return the distance (k,) of a sliding joint's point from the beam's first end, in the undeformed beam [m]."""
    joint = system.mechanism.joint(name)
    return joint_coordinate(system, name, q).value + system.marker(joint.a).x0[0]


def axis_marker(system: System, joint: Joint) -> Marker:
    """Return the carrier of a joint's axis: the material at point a; for a sliding joint the body's frame there."""
    marker = system.marker(joint.a)
    return marker.on_frame if joint.follows_beam else marker


def unit_vectors(angle: Array) -> Array:
    """Return the unit vectors (k, 2) at angles (k,)."""
    return np.column_stack([np.cos(angle), np.sin(angle)])


def axis_angle(system: System, joint: Joint, q: Array) -> Array:
    """Return the angle (k,) of a joint's axis in the ground frame [rad]."""
    return _marker_angle(system, axis_marker(system, joint), q)[0] + joint.direction


def line_direction(system: System, joint: Joint, q: Array) -> Array:
    """Return the unit vector (k, 2) from point a of a joint to point b; without a norm, for complex steps."""
    a, b = (marker_position(system, system.marker(ref), q) for ref in (joint.a, joint.b))
    return (b - a) / np.sqrt(np.sum((b - a) ** 2, axis=1))[:, None]


def material_angle(system: System, ref: PointRef, q: Array) -> Array:
    """Return the angle (k,) of the material at a point, that of its body plus the slope; zero on the ground [rad]."""
    return _marker_angle(system, system.marker(ref), q)[0]


def _marker_angle(system: System, marker: Marker, q: Array) -> tuple[Array, Array]:
    """Return the angle of the material at a point (k,), and its derivative (k, n)."""
    rows = np.zeros(q.shape, dtype=np.result_type(q, marker.slope))
    if marker.body == GROUND_INDEX:
        return np.zeros(q.shape[0]), rows
    body = system.bodies[marker.body]
    rows[:, body.angle] = 1.0
    rows[:, body.flexible] = marker.slope
    return np.sum(rows * q, axis=1), rows
