"""Operating points of linear models: poses at rest, planned motions and runs."""

from __future__ import annotations

import numpy as np

from paraflex.arrays import Array
from paraflex.dynamics import State, System, acting_loads, joint_coordinate
from paraflex.dynamics.linearise import forces_at_rest
from paraflex.dynamics.sparse import sparse_jacobian
from paraflex.dynamics.stiffness import RestingForces
from paraflex.dynamics.tangents import MotionPoint
from paraflex.mechanism import ActuationMode
from paraflex.motion import MotionRun
from paraflex.tracking import TrackingRun, TrackingTask, undeformed_at
from .coordinates import Coordinates


def resting_point(coordinates: Coordinates, state: State, mode: ActuationMode) -> tuple[MotionPoint, float]:
    """Return the operating point of a pose at rest, held by the motors of a mode and by constant forces.

    Returns
    -------
    MotionPoint
        Operating point.
    float
        Initial acceleration of the mechanism without the constant forces [m/s^2]: see `Vibration.acceleration`.
    """
    system = coordinates.system
    active = [(k, motor.joint) for k, motor in enumerate(system.mechanism.motors) if motor.name in mode.motors]
    joints = list(dict.fromkeys(joint for _, joint in active))
    found = forces_at_rest(system, state, *coordinates.inertia(state.time, state.q, joints))
    efforts = dict(zip(joints, found.efforts, strict=True))
    torques = _acting(system, state.time, {k: efforts[joint] for k, joint in active})
    still = np.zeros(system.n)
    return MotionPoint(state.time, state.q, still, still, found.multipliers, torques), found.acceleration


def planned_point(task: TrackingTask, mode: ActuationMode, sample: int) -> MotionPoint:
    """Return the operating point of a planned motion at a sample, with its velocities, accelerations and torques.

    Links are undeformed, and constraint forces are those of the rigid motion. The equations of the deflections
    therefore have a residual, which the linear model neglects.
    """
    system, rigid = task.system, task.motion
    q, v, a = undeformed_at(system, rigid, sample)
    time = float(rigid.t[sample])
    efforts = task.torques(mode).evaluate(rigid.t[sample : sample + 1])[0]
    forces = RestingForces(system, time)
    forces.v, forces.a = v, a
    lam = forces.compliant(q)
    left = forces(q, lam)[0]
    for motor, effort in zip(system.mechanism.motors, efforts, strict=True):
        left = left - effort * joint_coordinate(system, motor.joint, q[None]).rows[0]
    moving = np.concatenate([np.arange(body.offset, body.offset + 3) for body in system.bodies])
    rows = np.nonzero(system.constrained)[0]
    jacobian = sparse_jacobian(system, q)[rows][:, moving].toarray()
    lam[rows] = np.linalg.lstsq(jacobian.T, -left[moving], rcond=None)[0]
    return MotionPoint(time, q, v, a, lam, _acting(system, time, dict(enumerate(efforts))))


def run_point(run: TrackingRun | MotionRun, sample: int) -> MotionPoint:
    """Return the operating point of a run at a sample."""
    system = run.system if isinstance(run, MotionRun) else run.task.system
    solution, time = run.solution, float(run.solution.t[sample])
    torques = _acting(system, time, dict(enumerate(run.applied[sample])))
    return MotionPoint(
        time, solution.q[sample], solution.v[sample], solution.a[sample], solution.multipliers[sample], torques
    )


def _acting(system: System, time: float, efforts: dict[int, float]) -> Array:
    """Return the actions (acting,) at a time: efforts of motors, given by index, and loads."""
    acting = acting_loads(system.mechanism, np.array([time]))[0]
    for k, effort in efforts.items():
        acting[k] = effort
    return acting
