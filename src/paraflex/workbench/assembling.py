"""Search for all assemblies of a mechanism that stands on the page, with its drives or end-effector where they are."""

from dataclasses import replace

import numpy as np

from paraflex.arrays import Array
from paraflex.driven.assemblies import poses_of
from paraflex.driven.exact import NO_TASKS
from paraflex.driven.ranges import JointDrive
from paraflex.dynamics import material_angle
from paraflex.dynamics.joint_coordinates import joint_rows, joint_value
from paraflex.dynamics.points import marker_position
from paraflex.mechanism import GROUND, ConstantSpeed, EndEffector, Mechanism, PointRef, RevoluteJoint, WeldJoint
from paraflex.paths.loops import LoopClosure
from .branches import Branches
from .moving import Mover

# Joints at which freedoms are held have independent coordinates, to this singular value.
_INDEPENDENT = 1e-6


def assemblies(mover: Mover) -> list[Array]:
    """Search for all assemblies (n,) at the present pose of a mover, which comes first.

    The drives are held if there are as many as degrees of freedom, else the end-effector if it has two or three, else
    as many joints as needed, those at the ground first.
    """
    loops = LoopClosure(_held(mover), 0.0, None, NO_TASKS)
    return [pose for pose, _ in poses_of(loops, mover.q)]


def _held(mover: Mover) -> Mechanism:
    """Return the rigid mechanism with its drives, end-effector or other joints held at the present pose."""
    rigid, effector = mover.loops.mechanism, mover.mechanism.end_effector
    if mover.drives:
        return _with_held(mover, mover.drives)
    if effector is not None and mover.freedoms in (2, 3):
        return _pinned(mover, effector)
    moving = [one for one in rigid.joints if one.moves]
    grounded = [one.name for one in moving if GROUND in (one.a.body, one.b.body)]
    return _with_held(mover, list(dict.fromkeys([*grounded, *(one.name for one in moving)])))


def _pinned(mover: Mover, effector: EndEffector) -> Mechanism:
    """Return the rigid mechanism with its end-effector pinned, or welded if it has three freedoms, to the ground."""
    rigid = mover.loops.mechanism
    x, y = marker_position(mover.system, mover.system.marker(effector.point), mover.q)
    pin = PointRef(GROUND, "held_point")
    angle = float(material_angle(mover.system, effector.point, mover.q[None])[0])
    pinned = RevoluteJoint("held_joint", pin, effector.point)
    more = pinned if mover.freedoms == 2 else WeldJoint("held_joint", pin, effector.point, angle)
    return replace(rigid, ground={**rigid.ground, pin.point: (float(x), float(y))}, joints=(*rigid.joints, more))


def _with_held(mover: Mover, names: list[str]) -> Mechanism:
    """Return the rigid mechanism with as many of some joints held as it has freedoms."""
    free, held = Branches(mover.system, mover.freedoms, mover.q).free(mover.q), list[str]()
    for name in names:
        rows = joint_rows(mover.system, [*held, name], mover.q) * mover.system.units
        rows[[mover.mechanism.slides(one) for one in (*held, name)]] /= mover.system.size
        if np.linalg.svd(rows @ free, compute_uv=False)[-1] > _INDEPENDENT and len(held) < mover.freedoms:
            held.append(name)
    at = {name: joint_value(mover.system, name, mover.q) for name in held}
    drives = tuple(JointDrive(f"{name} held", name, ConstantSpeed(value, 0.0)) for name, value in at.items())
    left = replace(mover.loops.mechanism, motors=(), modes=())
    return replace(left, prescribed=drives)
