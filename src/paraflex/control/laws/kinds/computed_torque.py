"""Computed torque control of the rigid mechanism in task space.

The torques are tau = B^+ Z^T (M a + h - F), where the accelerations a follow from the end-effector's x'' = x_d'' - Kv
(x' - x_d') - Kp (x - x_d). Its position x and velocity follow from the encoders by the kinematics of the rigid
mechanism, for redundant encoders in the least-squares sense. The torques are those of least norm. As they are the whole
torque, feed-forward must not act as well.
"""

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from paraflex.actuation import required_effort
from paraflex.arrays import Array
from paraflex.control.laws.controllers import Plant
from paraflex.control.laws.estimators import CUTOFF, BackwardDifference, Rates
from paraflex.control.laws.law import Law, StartedLaw, given
from paraflex.dynamics import joint_coordinate
from paraflex.errors import InputError
from paraflex.kernel.closure import LOOPS_CLOSED
from paraflex.mechanism.quantities import all_listed, positive
from paraflex.paths import RigidMotion
from paraflex.paths.closure import PathClosure

# The iteration for the position has converged at a change below this fraction of the mechanism's size; largest number
# of iterations.
_FOUND, _ITERATIONS = 1e-11, 20


@dataclass(frozen=True)
class ComputedTorque(Law, kind="computed-torque", title="computed torque"):
    """Computed-torque control of the rigid mechanism in task space, in place of planned torques.

    Attributes
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

    whole_torque: ClassVar[bool] = True
    absolute: ClassVar[bool] = True

    frequency: float = given("the natural frequency of the end-effector's error in Hz", positive)
    damping_ratio: float = given(
        "the damping ratio of the end-effector's error", positive, "parts of the critical one", default=0.7
    )
    cutoff: float | None = given(*CUTOFF, default=None)

    def start(self, plant: Plant) -> "RigidInverse":
        """Return the law in a run: see `Law.start`."""
        from paraflex.control.loop.references import planned_motion

        if plant.task is None:
            raise InputError("there is no planned motion to follow", field="law", value=self.title,
                             remedy="give a path to plan along, or another law")  # fmt: skip
        plan = planned_motion(plant)
        joints = dict.fromkeys(motor.joint for motor in plan.mechanism.motors)
        all_listed(plant.inputs, joints, "inputs", "is not an encoder of a motor")
        omega = 2.0 * np.pi * self.frequency
        return RigidInverse(
            plan, plant, omega**2, 2.0 * self.damping_ratio * omega, BackwardDifference(plant.period, self.cutoff)
        )


class RigidInverseState(NamedTuple):
    """State of computed torque: the pose (n,) of the rigid mechanism, and the rates of the readings."""

    pose: Array
    rates: Rates | None


class RigidInverse(StartedLaw):
    """Computed torque in a run, with gains Kp [1/s^2] and Kv [1/s] along a plan at the samples of a controller."""

    def __init__(self, plan: RigidMotion, plant: Plant, Kp: float, Kv: float, rates: BackwardDifference) -> None:
        self._plan, self._Kp, self._Kv = plan, Kp, Kv
        self.rates: BackwardDifference = rates
        self._start, self._period, self._joints = plant.state.time, plant.period, plant.inputs
        self._motors = [k for k, motor in enumerate(plan.mechanism.motors) if motor.name in plant.outputs]
        self._closure = PathClosure(plan.mechanism, 0.0, float(plan.t[-1]))
        self._wanted = self._closure.target(plan.path, plan.t)

    def step(self, state: RigidInverseState | None, k: int, t: float, y: Array) -> tuple[Array, RigidInverseState]:
        """Return torques from angles and travels y of joints, and the state: see `StartedLaw.step`."""
        pose, before = state or RigidInverseState(self._plan.q[0], None)
        sample = min(max(round((t - self._start) / self._period), 0), len(self._plan.t) - 1)
        place = self._closure.task(self._plan.q[sample])
        _, rate, acceleration = self._wanted[sample]
        read, rows, pose = self._read(y, place, pose)
        rates = self.rates.after(before, y)
        command = acceleration - self._Kv * (rows @ rates.rates - rate) - self._Kp * (read - place)
        motion = self._motion(t, read, rows @ rates.rates, command, pose)
        effort = required_effort(motion)
        torques = np.linalg.pinv(effort.matrix[0][:, self._motors]) @ effort.required[0]
        return torques, RigidInverseState(motion.q[0], rates)

    def _read(self, y: Array, place: Array, pose: Array) -> tuple[Array, Array, Array]:
        """Return the end-effector's position (tasks,) at readings y, its Jacobian (tasks, joints), and the pose."""
        for _ in range(_ITERATIONS):
            motion = self._motion(0.0, place, np.zeros_like(place), np.zeros_like(place), pose)
            pose = motion.q[0]
            each = [joint_coordinate(motion.system, joint, motion.q) for joint in self._joints]
            read = np.array([one.value[0] for one in each])
            rows = np.linalg.pinv(np.stack([one.rows[0] for one in each]) @ motion.basis[0])
            change = rows @ (y - read)
            place = place + change
            if np.max(np.abs(change)) < _FOUND * self._closure.system.size:
                return place, rows, pose
        raise ArithmeticError("the rigid mechanism has no pose near the readings of its encoders")

    def _motion(self, t: float, place: Array, velocity: Array, acceleration: Array, near: Array) -> RigidMotion:
        """Return the motion of the rigid mechanism with this motion of the end-effector, near a pose."""
        target = np.ascontiguousarray(np.stack([place, velocity, acceleration])[None])
        status, _, (q, v, a, basis) = self._closure.run(np.zeros(1), target, near)
        if status != LOOPS_CLOSED:
            raise ArithmeticError("the rigid mechanism cannot take the pose that its encoders read")
        plan = self._plan
        return RigidMotion(plan.mechanism, plan.system, plan.path, np.array([t]), q, v, a, basis)
