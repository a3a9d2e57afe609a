"""PID control of the angles or displacements of motors.

With e the errors of the active motors' angles, tau = -P (Kp e + Kd e' + Ki integral of e). Encoders of redundant motors
contradict one another, because of link deflections and quantisation. The projector P = B^+ B keeps the part of the
torques that acts on the motion; without it, each contradiction causes torques that only strain links against one
another. B is the rigid actuation matrix on the planned motion.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import scipy

from paraflex.actuation import required_effort
from paraflex.arguments import checked_arguments
from paraflex.arrays import Array
from paraflex.control.laws.controllers import Plant
from paraflex.control.laws.discrete import DiscreteModel
from paraflex.control.laws.estimators import CUTOFF, BackwardDifference
from paraflex.control.laws.law import Law, given
from paraflex.control.laws.linear_law import LinearLaw
from paraflex.control.loop.together import PLAN
from paraflex.errors import InputError
from paraflex.mechanism import Mechanism
from paraflex.mechanism.measured import encoders_of
from paraflex.mechanism.quantities import all_known

Gain = float | Sequence[float] | Mapping[str, float]


def _gain(value: float, field: str) -> None:
    if not np.isfinite(value):
        raise InputError("is not a gain", field=field, value=value, remedy="give a finite number")
    if value < 0.0:
        raise InputError("must not be negative", field=field, value=float(value),
                         remedy="give zero or more: the sign of the law already opposes errors")  # fmt: skip


@dataclass(frozen=True)
class JointPID(Law, kind="pid", title="PID of joints"):
    """PID control of the angles or displacements of a mode's motors.

    The rate is the difference of two readings over the period, low-pass filtered if a cut-off is given. Anti-windup:
    where torques are limited, the integral is brought back towards the limited torques, with the time constant Kp/Ki.

    Attributes
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
        Gains that are negative or not numbers; when started: gains of motors that it does not drive, or different
        numbers of readings and motors.
    """

    reference: ClassVar[str | None] = PLAN

    stiffness: Gain = given("the proportional gain in N m/rad or N/m, of all motors or by motor", _gain, by="motors")
    damping: Gain = given(
        "the derivative gain in N m s/rad or N s/m, of all motors or by motor", _gain, by="motors", default=0.0
    )
    integral: Gain = given(
        "the integral gain in N m/rad/s or N/m/s, of all motors or by motor", _gain, by="motors", default=0.0
    )
    project: bool = given("whether torques that only strain links are removed", default=True)
    cutoff: float | None = given(*CUTOFF, default=None)

    def check(self, mechanism: Mechanism, inputs: Sequence[str], outputs: Sequence[str]) -> None:
        """Check the names of motors, and the pairs of readings and motors: see `Law.check`."""
        super().check(mechanism, inputs, outputs)
        if inputs and outputs:
            check_pairs(inputs, outputs)

    def start(self, plant: Plant) -> LinearLaw:
        """Return the law in a run: see `Law.start`. Its states are the previous errors, their rates and integrals."""
        from paraflex.control.laws.joints import torque_projectors
        from paraflex.control.loop.references import planned_motion

        check_pairs(plant.inputs, plant.outputs)
        law = self._linear(plant.outputs, plant.period)
        if not self.project or plant.task is None:
            return law
        return replace(law, projector=torque_projectors(required_effort(planned_motion(plant)), plant.outputs))

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
        law = self._linear(names, period)
        return DiscreteModel(law.A, law.B, law.C, law.D, period, joints, names)

    def _linear(self, motors: Sequence[str], period: float) -> LinearLaw:
        """Return the linear law -(Kp y + Kd y' + sum of Ki T y) of some motors.

        Its states are those of the rates, and the sums of motors with an integral gain.
        """
        Kp, Kd, Ki = (gains_of(getattr(self, name), motors, name) for name in ("stiffness", "damping", "integral"))
        rates = BackwardDifference(period, self.cutoff).linear_law(len(motors))
        summed, gain = np.eye(len(motors))[Ki > 0.0], np.diag(Ki * period)
        # Fraction of the excess torque by which the sums are brought back in a period.
        pace = np.minimum(np.divide(Ki * period, Kp, out=np.ones_like(Kp), where=Kp > 0.0), 1.0)
        return LinearLaw(
            A=scipy.linalg.block_diag(rates.A, np.eye(len(summed))),
            B=np.vstack([rates.B, summed @ gain]),
            C=-np.hstack([Kd[:, None] * rates.C, summed.T]),
            D=-(np.diag(Kp) + Kd[:, None] * rates.D + gain),
            E=np.vstack([np.zeros((len(rates.A), len(motors))), np.diag(pace)[Ki > 0.0]]),
            first=np.vstack([rates.first, np.zeros_like(summed)]),
        )


def check_pairs(inputs: Sequence[str], outputs: Sequence[str]) -> None:
    """Raise an `InputError` unless there is one reading for each motor."""
    if len(inputs) != len(outputs):
        raise InputError(
            f"{len(inputs)} readings for {len(outputs)} motors", field="inputs", value=", ".join(inputs),
            remedy="name the encoder of each motor, in their order, or leave it out",
        )  # fmt: skip


def gains_of(gains: Any, motors: Sequence[str], field: str) -> Array:
    """Return one gain for each motor (motors,), from one for all, one for each, or values by motor.

    Raises
    ------
    InputError
        Unknown motors, or a wrong number of gains.
    """
    if isinstance(gains, Mapping):
        all_known(gains, motors, field, "motor")
        gains = [gains.get(name, 0.0) for name in motors]
    try:
        return np.broadcast_to(np.asarray(gains, dtype=float), (len(motors),)).copy()
    except (TypeError, ValueError):
        raise InputError(f"not gains for {len(motors)} motors", field=field, value=gains,
                         remedy="give one number, one for each motor, or numbers by motor") from None  # fmt: skip
