"""Forces and moments between the bodies of a joint, from all its members.

A constraint has Phi of body b less that of body a, and Phi_q^T lambda is on the left-hand side of M q'' + ... + Phi_q^T
lambda: -lambda acts on body b. The same holds for the multipliers of prescribed motions, springs, dampers, friction
and, times the weight of the joint, of gears. A motor's torque or force acts on b with its own sign.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from paraflex.arrays import Array, Indices, Numbers
from paraflex.kernel.packed import ANGLE, POINT
from paraflex.mechanism import Joint
from .constraints import RowTerm, Term
from .coordinates import transverse_pieces, transverse_rows
from .following import driven_rows
from .joint_coordinates import axis_angle, line_direction, unit_vectors
from .load_values import line_laws
from .points import cross, marker_place, point_motion
from .rank import NO_PART, dependence
from .system import System


class Loads(NamedTuple):
    """Forces and moments over time.

    Attributes
    ----------
    force : (k, 2) or (k, joints, 2) array
        Force in the ground frame [N]; of a joint, on the joint's point of the second body.
    moment : (k,) or (k, joints) array
        Moment about the origin of the ground frame, or about that point, positive anticlockwise [N m].
    """

    force: Array
    moment: Array


class LoadComponents(NamedTuple):
    """Properties of the load components of joints and of all drives: errors, or whether they are determined.

    Attributes
    ----------
    force, moment : arrays
        Property of forces (k, joints, 2) and moments (k, joints) in joints; errors are (joints,) for both [N, N m].
    drive : array
        Property of torques or forces of prescribed motions (k, drives); errors are (drives,) [N m, N].
    """

    force: Numbers
    moment: Numbers
    drive: Numbers


class JointParts(NamedTuple):
    """Members that act in a joint.

    Attributes
    ----------
    terms : sequence of RowTerm
        Terms of its constraints, springs, dampers, friction, gears and prescribed motion, with the numbers of their
        multipliers.
    motors : sequence of int
        Numbers of its motors.
    """

    terms: Sequence[RowTerm]
    motors: Sequence[int]

    def alone(self) -> "JointParts":
        """Renumber the parts for arrays of this joint's multipliers and motors only, ordered as `rows` and `motors`."""
        place = {row: i for i, row in enumerate(self.rows)}
        terms = [RowTerm([place[row] for row in rows], term) for rows, term in self.terms]
        return JointParts(terms, range(len(self.motors)))

    @property
    def rows(self) -> list[int]:
        """Numbers of all its multipliers."""
        return list(dict.fromkeys(row for rows, _ in self.terms for row in rows))


def joint_parts(system: System, name: str) -> JointParts:
    """Return the members that act in a joint, given by name."""
    motors = [k for k, motor in enumerate(system.mechanism.motors) if motor.joint == name]
    return JointParts(system.row_terms.get(name, ()), motors)


def joint_loads(system: System, names: Sequence[str], q: Array, multipliers: Array, torques: Array) -> Loads:
    """Return forces and moments in joints: of constraints, motors, springs, dampers, friction and gears.

    All arrays may have complex steps.

    The second body exerts the opposite on the first at the same position. Springs and dampers between points (linear
    springs) are not part of a joint and are not included.

    Parameters
    ----------
    system : System
        System of the mechanism.
    names : sequence of str
        Names of the joints.
    q : (k, n) array
        Coordinates.
    multipliers : (k, m) array
        Multipliers.
    torques : (k, motors) array
        Torque or force of every motor.
    """
    kind = np.result_type(q, multipliers, torques)
    force, moment = np.zeros((len(q), len(names), 2), kind), np.zeros((len(q), len(names)), kind)
    for i, name in enumerate(names):
        force[:, i], moment[:, i] = load_in(system, name, joint_parts(system, name), q, multipliers, torques)
    return Loads(force, moment)


def load_in(system: System, name: str, parts: JointParts, q: Array, multipliers: Array, torques: Array) -> Loads:
    """Return force (k, 2) and moment (k,) in one joint, as `joint_loads`; all arguments may have complex steps."""
    joint, kind = system.mechanism.joint(name), np.result_type(q, multipliers, torques)
    force, moment = np.zeros((len(q), 2), kind), np.zeros(len(q), kind)
    for rows, term in parts.terms:
        load = term.weight * multipliers[:, rows]
        if term.kind == POINT:
            force -= load
        elif term.kind == ANGLE:
            moment -= load[:, 0]
        else:
            force -= load * _direction(system, term, q)
    for torque in torques[:, list(parts.motors)].T:
        if joint.slides:
            force += torque[:, None] * unit_vectors(axis_angle(system, joint, q))
        else:
            moment += torque
    return Loads(force, moment)


def undetermined_loads(system: System, names: Sequence[str], q: Array, acting: Indices | None = None) -> LoadComponents:
    """Find the loads of joints and of all drives that redundant rows share arbitrarily.

    Rows are redundant in all poses (k, n) or in none: the search ends at the first pose without redundant rows.
    `acting` restricts the rows, all by default.
    """
    drives = system.mechanism.prescribed
    shapes = (len(names), 2), (len(names),), (len(drives),)
    found = LoadComponents(*(np.zeros((len(q), *shape), dtype=bool) for shape in shapes))
    arms = np.where([system.mechanism.slides(one.joint) for one in drives], system.size, 1.0)
    for k, pose in enumerate(q):
        free = dependence(system, pose, acting=acting).self_stresses(system.row_units)
        if not len(free):
            break
        still = np.zeros((len(free), len(system.mechanism.motors)))
        loads = joint_loads(system, names, np.repeat(pose[None], len(free), axis=0), free, still)
        found.force[k] = np.any(np.abs(loads.force) * system.size > NO_PART, axis=0)
        found.moment[k] = np.any(np.abs(loads.moment) > NO_PART, axis=0)
        torques = drive_torques(system, free)
        found.drive[k] = np.any(np.abs(torques) * arms > NO_PART, axis=0)
    return found


def drive_torques(system: System, multipliers: Array) -> Array:
    """Return the torque [N m] or force [N] of every prescribed motion (k, drives), on its joint's second body."""
    return -multipliers[:, np.array([row for _, row in driven_rows(system)], int)]


def load_errors(system: System, names: Sequence[str], errors: Array) -> LoadComponents:
    """Return estimated errors of the loads of joints and of all drives, from those of the multipliers (m,)."""
    force, moment = np.zeros(len(names)), np.zeros(len(names))
    for i, name in enumerate(names):
        for rows, term in joint_parts(system, name).terms:
            if term.kind == ANGLE:
                moment[i] += abs(term.weight) * errors[rows[0]]
            else:
                force[i] += abs(term.weight) * float(np.linalg.norm(errors[rows]))
    return LoadComponents(force, moment, np.abs(drive_torques(system, errors[None])[0]))


def frame_load(system: System, places: Array, loads: Loads, q: Array, v: Array) -> Loads:
    """Return shaking force and moment, the load of a mechanism on the ground, from joints and springs at its points.

    Parameters
    ----------
    system : System
        System of the mechanism.
    places : (k, joints, 2) array
        Positions of the joints of `loads`, on their second bodies [m].
    loads : Loads
        Loads of the first joints of the system's mechanism, all joints on the ground among them.
    q, v : (k, n) arrays
        Coordinates and velocities.
    """
    mechanism = system.mechanism
    force, moment = np.zeros((len(q), 2)), np.zeros(len(q))
    for i, joint in enumerate(mechanism.joints[: places.shape[1]]):
        sign = float(joint.b.on_ground) - float(joint.a.on_ground)
        force += sign * loads.force[:, i]
        moment += sign * (loads.moment[:, i] + cross(places[:, i], loads.force[:, i]))
    for k, spring in enumerate(mechanism.linear_springs):
        if spring.a.on_ground or spring.b.on_ground:
            fixed, moving = (spring.a, spring.b) if spring.a.on_ground else (spring.b, spring.a)
            at, there = np.array(mechanism.ground[fixed.point]), point_motion(system, moving, q, v, np.zeros_like(v))
            line = there.position - at
            distance = np.linalg.norm(line, axis=1)
            along = line / np.where(distance > 0.0, distance, 1.0)[:, None]
            rate = np.sum(along * there.velocity, axis=1)
            tension = spring.stiffness * (distance - spring.length) + spring.damping * rate
            if spring.force is not None:
                tension = tension + line_laws(system, q, v)[:, k]
            pull = tension[:, None] * along
            force += pull
            moment += cross(np.broadcast_to(at, pull.shape), pull)
    return Loads(force, moment)


def _direction(system: System, term: Term, q: Array) -> Array:
    """Return the derivative (k, 2) of an axis row by the position of point b."""
    joint = system.mechanism.joint(term.joint)
    if term.carrier == "nothing":
        return line_direction(system, joint, q)
    along = axis_angle(system, joint, q)
    direction = unit_vectors(along + term.direction - joint.direction)
    if term.carrier == "track":
        # Normal to the deformed beam at the position of the point.
        direction = direction - _track_slope(system, joint, q)[:, None] * unit_vectors(along)
    return direction


def _track_slope(system: System, joint: Joint, q: Array) -> Array:
    """Return the slope (k,) of a beam in its frame, at the position of the point that slides on it."""
    body = system.body(joint.a.body)
    assert body.mesh is not None
    away = marker_place(system, system.marker(joint.b), q)[0] - q[:, body.position]
    x = np.sum(away * unit_vectors(q[:, body.angle]), axis=1)
    shapes = transverse_rows(body.mesh.nodes, transverse_pieces(body), x, 1)
    return np.sum(shapes * q[:, body.flexible], axis=1)
