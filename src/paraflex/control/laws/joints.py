"""Gains of joint controllers, and the part of torques that only strains links against one another."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from paraflex.actuation import Effort
from paraflex.arguments import checked_arguments
from paraflex.arrays import Array
from paraflex.dynamics.state import mass_matrix
from paraflex.errors import InputError
from paraflex.mechanism import ActuationMode
from paraflex.mechanism.quantities import positive
from paraflex.tracking import TrackingTask

# Internal torques below this fraction of the largest torque are rounding errors.
_ROUNDING = 1e-12


class JointGains(NamedTuple):
    """Gains of a PD joint controller: stiffness [N m/rad] and damping [N m s/rad]."""

    stiffness: float
    damping: float


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
