"""Computed torque control of the rigid mechanism in task space.

The torques are tau = B^+ Z^T (M a + h - F), where the accelerations a follow from the end-effector's x'' = x_d'' - Kv
(x' - x_d') - Kp (x - x_d). Its position x and velocity follow from the encoders by the kinematics of the rigid
mechanism, for redundant encoders in the least-squares sense. The torques are those of least norm. As they are the whole
torque, feed-forward must not act as well.
"""

from __future__ import annotations

import numpy as np

from paraflex.actuation import required_effort
from paraflex.arguments import checked_arguments
from paraflex.arrays import Array
from paraflex.control.laws.controllers import Plant
from paraflex.control.laws.estimators import BackwardDifference, checked_cutoff
from paraflex.control.loop.references import planned_motion
from paraflex.dynamics import joint_coordinate
from paraflex.errors import InputError
from paraflex.kernel.closure import LOOPS_CLOSED
from paraflex.kinematics import RigidMotion
from paraflex.kinematics.closure import PathClosure
from paraflex.mechanism.quantities import positive

# The iteration for the position has converged at a change below this fraction of the mechanism's size; largest number
# of iterations.
_FOUND, _ITERATIONS = 1e-11, 20


class ComputedTorque:
    """Computed torque control in task space: a law for `SampledController`, which gives the whole torque.

    Parameters
    ----------
    frequency : float
        Natural frequency of the end-effector's error dynamics [Hz]: Kp = (2 pi frequency)^2.
    damping_ratio : float
        Damping ratio of the error dynamics: Kv = 2 damping_ratio 2 pi frequency.
    cutoff : float, optional
        Cut-off frequency of the low-pass filter of rates, which are differences of readings over the period [Hz]; no
        filter by default.

    Raises
    ------
    InputError
        A frequency, damping ratio or cut-off that is not positive; when started, no plan, or readings of joints without
        a motor.
    """

    title = "computed torque"
    whole_torque = True
    absolute = True

    @checked_arguments()
    def __init__(self, frequency: float, damping_ratio: float = 0.7, *, cutoff: float | None = None) -> None:
        positive(frequency, "frequency", "Hz")
        positive(damping_ratio, "damping_ratio", "parts of the critical one")
        omega = 2.0 * np.pi * frequency
        self._Kp, self._Kv = omega**2, 2.0 * damping_ratio * omega
        self._cutoff = checked_cutoff(cutoff)

    def start(self, plant: Plant) -> None:
        """Prepare for a run: see `Controller.start`."""
        if plant.task is None:
            raise InputError("there is no planned motion to follow", field="law", value=self.title,
                             remedy="give a path to plan along, or another law")  # fmt: skip
        self._plan = planned_motion(plant)
        self._start, self._period = plant.state.time, plant.period
        mechanism = self._plan.mechanism
        joints = [motor.joint for motor in mechanism.motors]
        for name in plant.inputs:
            if name not in joints:
                raise InputError("is not an encoder of a motor", field="inputs", value=name,
                                 remedy=f"choose from {', '.join(dict.fromkeys(joints))}")  # fmt: skip
        self._joints = plant.inputs
        self._motors = [k for k, motor in enumerate(mechanism.motors) if motor.name in plant.outputs]
        self._closure = PathClosure(mechanism, 0.0, float(self._plan.t[-1]))
        self._wanted = self._closure.target(self._plan.path, self._plan.t)
        self._rates = BackwardDifference(plant.period, self._cutoff)
        self._pose = self._plan.q[0]

    def step(self, k: int, t: float, y: Array) -> Array:
        """Compute the torques of a sample from angles and travels y of joints: see `Controller.step`."""
        sample = min(max(round((t - self._start) / self._period), 0), len(self._plan.t) - 1)
        place = self._closure.task(self._plan.q[sample])
        _, rate, acceleration = self._wanted[sample]
        read, rows = self._read(y, place)
        velocity = rows @ self._rates.step(y)[1]
        command = acceleration - self._Kv * (velocity - rate) - self._Kp * (read - place)
        effort = required_effort(self._motion(t, read, velocity, command))
        return np.linalg.pinv(effort.matrix[0][:, self._motors]) @ effort.required[0]

    def _read(self, y: Array, place: Array) -> tuple[Array, Array]:
        """Return the end-effector's position (tasks,) from joint readings y, and its Jacobian (tasks, joints)."""
        size = self._closure.system.size
        for _ in range(_ITERATIONS):
            motion = self._motion(0.0, place, np.zeros_like(place), np.zeros_like(place))
            each = [joint_coordinate(motion.system, joint, motion.q) for joint in self._joints]
            read = np.array([one.value[0] for one in each])
            rows = np.linalg.pinv(np.stack([one.rows[0] for one in each]) @ motion.basis[0])
            change = rows @ (y - read)
            place = place + change
            if np.max(np.abs(change)) < _FOUND * size:
                return place, rows
        raise ArithmeticError("the rigid mechanism has no pose near the readings of its encoders")

    def _motion(self, t: float, place: Array, velocity: Array, acceleration: Array) -> RigidMotion:
        """Return the motion of the rigid mechanism with this motion of the end-effector, near the last pose."""
        target = np.ascontiguousarray(np.stack([place, velocity, acceleration])[None])
        status, _, _, (q, v, a, basis) = self._closure.run(np.zeros(1), target, self._pose)
        if status != LOOPS_CLOSED:
            raise ArithmeticError("the rigid mechanism cannot take the pose that its encoders read")
        self._pose = q[0]
        plan = self._plan
        return RigidMotion(plan.mechanism, plan.system, plan.path, np.array([t]), q, v, a, basis)
