"""Derivatives of the motion along a path by parameters, from the differentiated equations of closed loops."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from paraflex.arrays import Array
from paraflex.kernel.arrays import apart
from paraflex.kernel.closure import make_closure_scratch
from paraflex.kernel.closure_residuals import closure_residuals
from paraflex.kernel.packed import PackedSystem, Signals
from .closure import PathClosure, RigidMotion


class DisplacedClosure(NamedTuple):
    """The closure at one point of a finite difference.

    Attributes
    ----------
    place : float
        Offset of the parameter, in its units.
    weight : float
        Weight of the residuals there in the derivative.
    packed : PackedSystem
        Packed system with the marker of the task.
    signals : Signals
        Signals of prescribed motions.
    times : (k,) array
        Sample times [s].
    target : (k, 3, tasks) array
        Task coordinates and two derivatives.
    """

    place: float
    weight: float
    packed: PackedSystem
    signals: Signals
    times: Array
    target: Array


class MotionChange(NamedTuple):
    """Derivatives of a motion along a path: coordinates, velocities, accelerations (k, n) and basis."""

    q: Array
    v: Array
    a: Array
    basis: Array


def motion_sensitivity(closure: PathClosure, motion: RigidMotion, nearby: Sequence[DisplacedClosure]) -> MotionChange:
    """Compute the derivatives of the motion of closed loops by a parameter, exact to rounding.

    F(x, s) = 0 gives dx = -F_x^-1 F_s for positions, then for velocities, the basis and the accelerations; each stage
    uses the derivatives of the stages before. F_s is a finite difference: F is smooth, and no iteration is involved.

    Parameters
    ----------
    closure : PathClosure
        Closure of the motion.
    motion : RigidMotion
        Motion at the nominal parameter.
    nearby : sequence of DisplacedClosure
        Points of the finite difference.
    """
    zero = MotionChange(*(np.zeros_like(x) for x in (motion.q, motion.v, motion.a, motion.basis)))
    found, jacobians = _residual_change(closure, motion, zero, nearby)
    if not found.any():
        return zero
    dq = -_solved(jacobians, found[:, :, :1])[:, :, 0]
    found, _ = _residual_change(closure, motion, zero._replace(q=dq), nearby)
    later = -_solved(jacobians, found[:, :, [1, *range(3, found.shape[2])]])
    dv, d_basis = later[:, :, 0], later[:, :, 1:]
    found, _ = _residual_change(closure, motion, zero._replace(q=dq, v=dv), nearby)
    return MotionChange(dq, dv, -_solved(jacobians, found[:, :, 2:3])[:, :, 0], d_basis)


def _solved(jacobians: Array, right: Array) -> Array:
    """Solve with one step of iterative refinement, as rows of metres and of angles differ in scale."""
    x = np.linalg.solve(jacobians, right)
    return x + np.linalg.solve(jacobians, right - jacobians @ x)


def _residual_change(
    closure: PathClosure, motion: RigidMotion, change: MotionChange, nearby: Sequence[DisplacedClosure]
) -> tuple[Array, Array]:
    """Return the derivative of the residuals along a change of the motion, and the Jacobians of the motion itself."""
    total = np.zeros((*motion.q.shape, 3 + closure.coordinates.size))
    target = closure.target(motion.path, motion.t)
    nominal = DisplacedClosure(0.0, 0.0, closure.packed, closure.signals, motion.t, target)
    here, jacobians = _residuals(closure, nominal, motion)
    for near in nearby:
        moved = MotionChange(
            *(x + near.place * dx for x, dx in zip((motion.q, motion.v, motion.a, motion.basis), change, strict=True))
        )
        found, _ = _residuals(closure, near, moved)
        # Subtracting the nominal residuals cancels the rounding of entries that do not change.
        total += near.weight * (found - here)
    return total, jacobians


def _residuals(closure: PathClosure, near: DisplacedClosure, motion: RigidMotion | MotionChange) -> tuple[Array, Array]:
    k, n = motion.q.shape
    tasks = closure.coordinates.size
    out, jacobians = apart((k, n, 3 + tasks)), apart((k, n, n))
    arrays = (np.ascontiguousarray(x) for x in (near.times, near.target, motion.q, motion.v, motion.a, motion.basis))
    closure_residuals(
        near.packed, near.signals, closure.marker, closure.coordinates, *arrays, out, jacobians,
        make_closure_scratch(near.packed, tasks, near.signals.start.size),
    )  # fmt: skip
    return out, jacobians
