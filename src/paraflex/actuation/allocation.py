"""Inverse dynamics of the rigid model: efforts in the null space of the constraints, torques of minimum norm.

With Z the basis of admissible motions in task coordinates (Phi_q Z = 0), the motors' torques tau must satisfy B tau =
Q, where Q = Z^T (M a + h) is the required effort and B = Z^T S_motor the actuation matrix. Among the torques of the
active motors that do, those of least Euclidean norm are chosen.
"""

from dataclasses import dataclass

import numpy as np

from paraflex.arrays import Array, Brief, Mask
from paraflex.dynamics import acting_loads, joint_coordinate
from paraflex.dynamics.joint_coordinates import own_coordinate
from paraflex.errors import ActuationError, Moment, SingularActuationError
from paraflex.kernel.arrays import apart
from paraflex.kernel.bodies import motion_forces
from paraflex.kernel.packed import make_scratch
from paraflex.mechanism import ActuationMode, with_actuators
from paraflex.paths import RigidMotion

# Ratio of smallest to largest singular value below which a set of motors cannot drive the mechanism.
SINGULAR_RATIO = 1e-6


@dataclass(frozen=True)
class Effort(Brief):
    """Required effort of a rigid motion, and its actuation matrix.

    Attributes
    ----------
    motion : RigidMotion
        Rigid motion at k instants.
    required : (k, tasks) array
        Q, generalised effort per task coordinate [N; N m for an angle].
    matrix : (k, tasks, motors) array
        B, effort in the task per unit torque of each motor; its transpose gives motor speeds per task velocity.
    """

    motion: RigidMotion
    required: Array
    matrix: Array

    def active(self, mode: ActuationMode) -> Mask:
        """Whether a mode drives each motor (motors,)."""
        return np.array([motor.name in mode.motors for motor in self.motion.mechanism.motors], dtype=bool)


def required_effort(motion: RigidMotion, *, before: bool = False) -> Effort:
    """Compute effort and actuation matrix of a rigid motion, under gravity, loads, springs, dampers and friction.

    Parameters
    ----------
    motion : RigidMotion
        Rigid motion at k instants.
    before : bool
        Whether loads that jump at an instant have their values just before it.
    """
    system = motion.system
    forces, acting = apart(motion.q.shape), acting_loads(motion.mechanism, motion.t, before=before)
    motion_forces(system.packed, motion.q, motion.v, motion.a, acting, forces, make_scratch(system.packed))
    add_springs_and_dampers(motion, forces)
    transposed = np.swapaxes(motion.basis, 1, 2)
    return Effort(motion, np.einsum("kij,kj->ki", transposed, forces), transposed @ motor_rows(motion))


def motor_rows(motion: RigidMotion) -> Array:
    """Return the derivatives (k, n, motors) of the motors' joint coordinates by all coordinates."""
    rows = [joint_coordinate(motion.system, motor.joint, motion.q).rows for motor in motion.system.mechanism.motors]
    return np.stack(rows, axis=2) if rows else np.zeros((*motion.q.shape, 0))


def add_springs_and_dampers(motion: RigidMotion, forces: Array) -> None:
    """Add to forces (k, n) those needed against springs, dampers, back-EMF and friction at joints."""
    for spring in motion.mechanism.springs:
        (value, _, rows), own = own_coordinate(motion.system, spring.joint, motion.q)
        forces[:, own] += (spring.stiffness * (value - spring.rest))[:, None] * rows
    for damper in with_actuators(motion.mechanism).dampers:
        (_, rate, rows), own = own_coordinate(motion.system, damper.joint, motion.q, motion.v)
        forces[:, own] += (damper.coefficient * rate)[:, None] * rows
    for friction in motion.mechanism.frictions:
        (_, rate, rows), own = own_coordinate(motion.system, friction.joint, motion.q, motion.v)
        forces[:, own] += (friction.limit * np.tanh(rate / friction.speed))[:, None] * rows


def actuation_condition(effort: Effort, mode: ActuationMode) -> Array:
    """Return the condition number (k,) of the actuation matrix of a mode's motors; infinite where it loses rank."""
    values = _singular_values(effort, mode)
    with np.errstate(divide="ignore"):
        return np.where(values[:, -1] > 0.0, values[:, 0] / values[:, -1], np.inf)


# Remedy for a path too near a Type II singularity of a mode.
PAST_SINGULAR = "move the path, or add motors to the mode"


def allocate(effort: Effort, mode: ActuationMode) -> Array:
    """Compute torques (k, motors) of minimum norm over a mode's motors, zero for the passive ones [N m].

    Raises
    ------
    ActuationError
        The mode has too few motors, or its motors cannot drive the mechanism anywhere on the path.
    SingularActuationError
        The path meets a Type II singularity of the mode, at the time and position that the error names.
    """
    check_mode(effort, mode)
    active = effort.active(mode)
    torques = np.zeros((effort.required.shape[0], active.size))
    inverse = np.linalg.pinv(effort.matrix[:, :, active])
    torques[:, active] = np.einsum("kij,kj->ki", inverse, effort.required)
    return torques


def check_mode(effort: Effort, mode: ActuationMode) -> None:
    """Check that a mode's motors can drive the mechanism along the whole motion; see `allocate` for its errors."""
    tasks, count = effort.required.shape[1], int(effort.active(mode).sum())
    if count < tasks:
        raise ActuationError(
            f'mode "{mode.name}" cannot drive the mechanism: {count} active motor{"" if count == 1 else "s"} '
            f"for {tasks} degrees of freedom",
            remedy=f"let at least {tasks} motors act",
        )
    values = _singular_values(effort, mode)
    singular = values[:, -1] <= SINGULAR_RATIO * values[:, 0]
    if np.all(singular):
        raise ActuationError(
            f'mode "{mode.name}" cannot drive the mechanism: nowhere on the path do its motors control all {tasks} '
            "degrees of freedom",
            remedy="choose other motors, or add motors to the mode",
        )
    # A square matrix that becomes singular between two instants changes the sign of its determinant.
    if count == tasks:
        sign = np.sign(np.linalg.det(effort.matrix[:, :, effort.active(mode)]))
        singular[1:] |= sign[1:] != sign[:-1]
    if np.any(singular):
        k = int(np.argmax(singular))
        position = effort.motion.desired.position[k]
        raise SingularActuationError(
            f'mode "{mode.name}" meets a Type II singularity, where its motors lose control of the end-effector,',
            Moment(float(effort.motion.t[k]), k, (float(position[0]), float(position[1]))),
            remedy=PAST_SINGULAR,
        )


def _singular_values(effort: Effort, mode: ActuationMode) -> Array:
    active = effort.matrix[:, :, effort.active(mode)]
    values = np.linalg.svd(active, compute_uv=False)
    missing = effort.required.shape[1] - values.shape[1]
    return np.pad(values, ((0, 0), (0, max(0, missing)))).astype(float)
