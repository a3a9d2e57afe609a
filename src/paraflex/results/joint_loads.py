"""Forces and moments between the bodies of a joint, from all members in it.

Constraints have Phi of body b less that of body a and stand on the left of the equations, M q'' + ... + Phi_q^T lambda:
-lambda acts on body b. So do the multipliers of prescribed motions, springs, dampers, friction and gears, of these
the weights of their joints times these; a motor's torque or force acts on b as it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from paraflex.dynamics import System, axis_angle
from paraflex.dynamics.constraints import Term, row_order
from paraflex.dynamics.coordinates import transverse_pieces
from paraflex.dynamics.joint_coordinates import marker_place
from paraflex.kernel.packed import ANGLE, POINT
from paraflex.mechanism import Joint

Array = NDArray[np.float64]


class JointLoads(NamedTuple):
    """Forces and moments of the first body of each joint on its second.

    Attributes
    ----------
    force : (k, joints, 2) array
        At the joint's point of the second body, in the ground frame [N].
    moment : (k, joints) array
        About that point, positive anticlockwise [N m].
    """

    force: Array
    moment: Array


def joint_loads(system: System, names: Sequence[str], q: Array, multipliers: Array, torques: Array) -> JointLoads:
    """Forces and moments in joints by name: of constraints, motors, springs, dampers, friction and gears.

    The second body does the opposite to the first at the same place. Springs and dampers between points (linear
    springs) are not in a joint and do not count.

    Parameters
    ----------
    system : System
    names : sequence of str
    q : (k, n) array
    multipliers : (k, m) array
    torques : (k, motors) array
        Torque or force of every motor.
    """
    mechanism, place = system.mechanism, {name: i for i, name in enumerate(names)}
    force, moment = np.zeros((len(q), len(names), 2)), np.zeros((len(q), len(names)))
    row = 0
    for constraint in row_order(mechanism, system.index):
        lam = multipliers[:, row : row + len(constraint.labels)]
        row += len(constraint.labels)
        for term in constraint.terms:
            i, load = place.get(term.joint), term.weight * lam
            if i is None:
                continue
            if term.kind == POINT:
                force[:, i] -= load
            elif term.kind == ANGLE:
                moment[:, i] -= load[:, 0]
            else:
                force[:, i] -= load * _direction(system, term, q)
    for motor, torque in zip(mechanism.motors, torques.T, strict=True):
        i, joint = place.get(motor.joint), mechanism.joint(motor.joint)
        if i is None:
            continue
        if joint.slides:
            force[:, i] += torque[:, None] * _unit(axis_angle(system, joint, q))
        else:
            moment[:, i] += torque
    return JointLoads(force, moment)


def _direction(system: System, term: Term, q: Array) -> Array:
    """Derivative (k, 2) of a row along an axis by the place of point b."""
    joint = system.mechanism.joint(term.joint)
    along = axis_angle(system, joint, q)
    direction = _unit(along + term.direction - joint.direction)
    if term.carrier == "track":
        # Square to the beam where the point stands, bent as it is.
        direction -= _track_slope(system, joint, q)[:, None] * _unit(along)
    return direction


def _track_slope(system: System, joint: Joint, q: Array) -> Array:
    """Slope (k,) of a beam in its frame, at the place of the point that slides on it."""
    body = system.body(joint.a.body)
    assert body.mesh is not None
    nodes, pieces = body.mesh.nodes, transverse_pieces(body)
    away = marker_place(system, system.marker(joint.b), q)[0] - q[:, body.position]
    x = np.sum(away * _unit(q[:, body.angle]), axis=1)
    piece = np.clip(np.searchsorted(nodes, x, side="right") - 1, 0, len(pieces) - 1)
    z = x - nodes[piece]
    powers = np.arange(1, pieces.shape[1])
    shapes = np.einsum("kp,kpj->kj", powers * z[:, None] ** (powers - 1), pieces[piece][:, 1:])
    return np.sum(shapes * q[:, body.flexible], axis=1)


def _unit(angle: Array) -> Array:
    return np.column_stack([np.cos(angle), np.sin(angle)])
