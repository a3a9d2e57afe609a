"""Joint controllers: PD and PID control of motor angles, with projection of the torques where motors are redundant.

With e the errors of the active motors' angles, tau = -P (Kp e + Kd e' + Ki integral of e). Encoders of redundant motors
contradict one another, because of link deflections and quantisation. The projector P = B^+ B keeps the part of the
torques that acts on the motion; without it, each contradiction causes torques that only strain links against one
another. B is the rigid actuation matrix on the planned motion.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import scipy

from paraflex.actuation import Effort, required_effort
from paraflex.arguments import checked_arguments
from paraflex.arrays import Array
from paraflex.control.laws.controllers import Plant
from paraflex.control.laws.discrete import DiscreteModel
from paraflex.control.laws.estimators import BackwardDifference, checked_cutoff
from paraflex.control.laws.linear_law import LinearLaw
from paraflex.control.loop.references import PLAN, AtSamples, planned_motion
from paraflex.dynamics.state import mass_matrix
from paraflex.errors import InputError
from paraflex.mechanism import ActuationMode, Mechanism
from paraflex.mechanism.measured import encoders_of
from paraflex.mechanism.quantities import all_known, positive
from paraflex.tracking import TrackingTask

# Internal torques below this fraction of the largest torque are rounding errors.
_ROUNDING = 1e-12

Gain = float | Sequence[float] | Mapping[str, float] | Array


class JointGains(NamedTuple):
    """Gains of a PD joint controller: stiffness [N m/rad] and damping [N m s/rad]."""

    stiffness: float
    damping: float


class JointPID:
    """PID control of the angles of a mode's motors: a law for `SampledController`.

    The rate is the difference of two readings over the period, low-pass filtered if a cut-off is given. Anti-windup:
    where torques are limited, the integral is brought back towards the limited torques, with the time constant Kp/Ki.

    Parameters
    ----------
    stiffness : float, sequence or mapping of str to float
        Proportional gain Kp of all motors or of each [N m/rad, N/m].
    damping : float, sequence or mapping of str to float
        Derivative gain Kd [N m s/rad, N s/m].
    integral : float, sequence or mapping of str to float
        Integral gain Ki [N m/(rad s), N/(m s)].
    project : bool
        Whether torques that do not act on the rigid motion are removed where there is a plan: see `internal_torques`.
    cutoff : float, optional
        Cut-off frequency of the low-pass filter of rates [Hz]; no filter by default.

    Raises
    ------
    InputError
        When started: gains that are negative or not numbers, gains of motors that it does not drive, or different
        numbers of readings and motors.
    """

    title = "PID of joints"
    reference: str | None = PLAN

    @checked_arguments()
    def __init__(
        self,
        stiffness: Gain,
        damping: Gain = 0.0,
        integral: Gain = 0.0,
        *,
        project: bool = True,
        cutoff: float | None = None,
    ) -> None:
        self._gains = {"stiffness": stiffness, "damping": damping, "integral": integral}
        self._project = project
        self._cutoff = checked_cutoff(cutoff)

    def start(self, plant: Plant) -> None:
        """Prepare for a run: see `Controller.start`."""
        check_pairs(plant.inputs, plant.outputs)
        gains = (gains_of(gain, plant.outputs, field) for field, gain in self._gains.items())
        self._Kp, self._Kd, self._Ki = gains
        self._period = plant.period
        self._rates = BackwardDifference(plant.period, self._cutoff)
        self._sum = np.zeros(len(plant.outputs))
        self._wanted = np.zeros(len(plant.outputs))
        self._projector: AtSamples | None = None
        if self._project and plant.task is not None:
            # Projectors P (outputs, outputs) of the motors on the planned motion, at the controller's samples.
            effort = required_effort(planned_motion(plant))
            self._projector = AtSamples(plant, torque_projectors(effort, plant.outputs))

    @checked_arguments()
    def sampled(self, period: float, mechanism: Mechanism, motors: Sequence[str] | None = None) -> DiscreteModel:
        """Return the law without projection and limits as a state-space model, for `closed_loop` and `margins`.

        Parameters
        ----------
        period : float
            Sampling period [s].
        mechanism : Mechanism
            Mechanism with the motors.
        motors : sequence of str, optional
            Motors that it drives, all by default; its readings are the encoders of their joints.

        Raises
        ------
        InputError
            Motors that do not each have a joint of their own.
        """
        names = tuple(motor.name for motor in mechanism.motors) if motors is None else tuple(motors)
        joints = encoders_of(mechanism, names)
        if len(joints) != len(names):
            raise InputError(f"{len(joints)} joints for {len(names)} motors", field="motors", value=", ".join(names),
                             remedy="name motors of the mechanism, one of each joint")  # fmt: skip
        Kp, Kd, Ki = (gains_of(gain, names, field) for field, gain in self._gains.items())
        law = _pid(Kp, Kd, Ki, BackwardDifference(period, self._cutoff))
        return DiscreteModel(law.A, law.B, law.C, law.D, period, joints, names)

    def step(self, k: int, t: float, y: Array) -> Array:
        """Compute the torques of a sample from errors y of angles: see `Controller.step`."""
        self._sum = self._sum + self._Ki * self._period * y
        torques = -(self._Kp * y + self._Kd * self._rates.step(y)[1] + self._sum)
        if self._projector is not None:
            torques = self._projector(t) @ torques
        self._wanted = torques
        return torques

    def limited(self, torques: Array) -> None:
        """Reduce the integral where torques were limited."""
        excess = self._wanted - torques
        if np.any(excess):
            self._sum = self._sum + self._pace * excess

    @property
    def _pace(self) -> Array:
        """Fraction of the excess torque by which the integrals are brought back in a period."""
        pace = np.divide(self._Ki * self._period, self._Kp, out=np.ones_like(self._Kp), where=self._Kp > 0.0)
        return np.minimum(pace, 1.0) * (self._Ki > 0.0)

    def linear_law(self) -> LinearLaw:
        """Return the law for the compiled time loop; its states are the previous errors, their rates and integrals."""
        law = _pid(self._Kp, self._Kd, self._Ki, self._rates)
        back = np.diag(self._pace)[self._Ki > 0.0]
        E = np.vstack([np.zeros((len(law.A) - len(back), len(self._Kp))), back])
        return replace(law, E=E, projector=None if self._projector is None else self._projector.values)


def _pid(Kp: Array, Kd: Array, Ki: Array, rates: BackwardDifference) -> LinearLaw:
    """Return the linear law -(Kp y + Kd y' + sum of Ki T y), with gains (motors,).

    Its states are those of the rates, and the sums of motors with an integral gain.
    """
    one, summed = rates.linear_law(len(Kp)), np.eye(len(Kp))[Ki > 0.0]
    gain = np.diag(Ki * rates.period)
    return LinearLaw(
        A=scipy.linalg.block_diag(one.A, np.eye(len(summed))),
        B=np.vstack([one.B, summed @ gain]),
        C=-np.hstack([Kd[:, None] * one.C, summed.T]),
        D=-(np.diag(Kp) + Kd[:, None] * one.D + gain),
        first=np.vstack([one.first, np.zeros_like(summed)]),
    )


def torque_projectors(effort: Effort, motors: Sequence[str]) -> Array:
    """Return the projectors P = B^+ B (k, motors, motors) of some motors along a motion."""
    own = [motor.name for motor in effort.motion.mechanism.motors]
    B = effort.matrix[:, :, [own.index(name) for name in motors]]
    return np.linalg.pinv(B) @ B


@checked_arguments()
def internal_torques(task: TrackingTask, mode: str | ActuationMode, torques: Array) -> Array:
    """Return the internal part (I - P) tau (k, motors) of torques, which only strains links against one another.

    Parameters
    ----------
    task : TrackingTask
        Task along whose planned motion the projectors P are computed.
    mode : str or ActuationMode
        Mode whose motors are active.
    torques : (k, motors) array
        Torques of all motors at the first k samples of the task, zero for motors outside the mode [N m, N].

    Raises
    ------
    InputError
        Torques of another shape.
    """
    names = [motor.name for motor in task.mechanism.motors]
    active = [name for name in names if name in task.mode(mode).motors]
    columns = [names.index(name) for name in active]
    P = torque_projectors(task.effort, active)[: len(torques) if torques.ndim else 0]
    if torques.shape != (len(P), len(names)):
        raise InputError("needs one row per sample, one column per motor", field="torques", value=torques.shape,
                         remedy=f"give at most {len(task.motion.t)} x {len(names)} numbers")  # fmt: skip
    out = np.zeros_like(torques)
    out[:, columns] = torques[:, columns] - np.einsum("kij,kj->ki", P, torques[:, columns])
    # Where there are as many motors as degrees of freedom, only rounding errors remain.
    out[np.abs(out) < _ROUNDING * np.max(np.abs(torques), initial=0.0)] = 0.0
    return out


@checked_arguments()
def joint_gains(
    task: TrackingTask, mode: str | ActuationMode, frequency: float, damping_ratio: float = 0.7
) -> JointGains:
    """Compute PD joint gains that give the rigid mechanism a natural frequency and a damping ratio.

    One stiffness k for all motors gives the task stiffness k B B^T. The mean of the eigenvalues of M^-1 k B B^T over
    task coordinates and path equals omega^2, where M = Z^T M Z is the inertia of the rigid mechanism.

    Parameters
    ----------
    task : TrackingTask
        Task with the planned motion.
    mode : str or ActuationMode
        Mode whose motors are controlled.
    frequency : float
        Natural frequency [Hz].
    damping_ratio : float
        Damping ratio.

    Raises
    ------
    InputError
        A frequency or a ratio that is not positive.
    """
    positive(frequency, "frequency", "Hz")
    positive(damping_ratio, "damping_ratio", "parts of the critical one")
    omega = 2.0 * np.pi * frequency
    B = task.effort.matrix[:, :, task.effort.active(task.mode(mode))]
    ratio = np.linalg.solve(task_inertia(task.effort), B @ np.swapaxes(B, 1, 2))
    stiffness = omega**2 / float(np.mean(np.trace(ratio, axis1=1, axis2=2)) / ratio.shape[1])
    return JointGains(stiffness, 2.0 * damping_ratio * stiffness / omega)


def task_inertia(effort: Effort) -> Array:
    """Return the task-space inertia Z^T M Z (k, tasks, tasks) of the rigid mechanism along a motion."""
    motion = effort.motion
    masses = np.array([mass_matrix(motion.system, q) for q in motion.q])
    return np.swapaxes(motion.basis, 1, 2) @ masses @ motion.basis


def check_pairs(inputs: Sequence[str], outputs: Sequence[str]) -> None:
    """Raise an `InputError` unless there is one reading for each motor."""
    if len(inputs) != len(outputs):
        raise InputError(
            f"{len(inputs)} readings for {len(outputs)} motors", field="inputs", value=", ".join(inputs),
            remedy="name the encoder of each motor, in their order, or leave it out",
        )  # fmt: skip


def gains_of(given: Any, motors: Sequence[str], field: str) -> Array:
    """Return one gain for each motor (motors,), from one for all, one for each, or values by motor.

    Raises
    ------
    InputError
        Unknown motors, or gains that are not numbers or are negative.
    """
    if isinstance(given, Mapping):
        all_known(given, motors, field, "motor")
        given = [given.get(name, 0.0) for name in motors]
    try:
        gains = np.broadcast_to(np.asarray(given, dtype=float), (len(motors),)).copy()
    except (TypeError, ValueError):
        gains = np.full(1, np.nan)
    if not np.all(np.isfinite(gains)):
        raise InputError(f"not gains for {len(motors)} motors", field=field, value=given,
                         remedy="give one number, one for each motor, or numbers by motor")  # fmt: skip
    if np.any(gains < 0.0):
        raise InputError("must not be negative", field=field, value=float(gains.min()),
                         remedy="give zero or more: the sign of the law already opposes errors")  # fmt: skip
    return gains
