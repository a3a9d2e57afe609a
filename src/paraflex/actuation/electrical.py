"""Currents and voltages of motors in a run, from the parameters of their actuators."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from paraflex.arrays import Array, Brief
from paraflex.dynamics import System, joint_coordinate
from paraflex.findings import Finding
from paraflex.mechanism import ActuationMode, Actuator, Mechanism, actuators_by_motor

# Limits exceeded by less than this fraction are not reported: speed and lag change that much between a controller's
# samples.
_BEYOND = 0.1
# Change of the back-EMF torque within L/R above which its neglected delay is reported, as a fraction of the largest
# torque.
_LATE = 0.01


@dataclass(frozen=True)
class Electrical(Brief):
    """Currents and voltages of all motors in a run; NaN for a motor whose actuator does not define them.

    Attributes
    ----------
    motors : tuple of str
        All motors of the mechanism.
    t : (k,) array
        Sample times [s].
    torque : (k, motors) array
        Torque at the joint, n k_t i; back-EMF is subtracted where the amplifier imposes the voltage [N m, N].
    rate : (k, motors) array
        Rate of the joint [rad/s, m/s].
    current : (k, motors) array
        Current i [A].
    voltage : (k, motors) array
        Voltage u; under a current loop R i + n k_e w + L i', where jumps of the current contribute no i' [V].
    resistance : (motors,) array
        Resistance R of the windings [ohm].
    """

    motors: tuple[str, ...]
    t: Array
    torque: Array
    rate: Array
    current: Array
    voltage: Array
    resistance: Array

    @property
    def power(self) -> Array:
        """Electrical power u i (k, motors) [W]."""
        return self.voltage * self.current

    @property
    def copper_loss(self) -> Array:
        """Copper loss R i^2 (k, motors) [W]."""
        return self.resistance * self.current**2

    @property
    def energy(self) -> Array:
        """Energy from the amplifiers (motors,), integrated over the samples [J]."""
        return scipy.integrate.trapezoid(self.power, self.t, axis=0)

    @property
    def copper_energy(self) -> Array:
        """Heat of the windings (motors,), integrated over the samples [J]."""
        return scipy.integrate.trapezoid(self.copper_loss, self.t, axis=0)

    @property
    def rms_current(self) -> Array:
        """Root mean square of the currents over time (motors,), to be compared with the continuous current [A]."""
        square = scipy.integrate.trapezoid(self.current**2, self.t, axis=0)
        return np.sqrt(square / (self.t[-1] - self.t[0])) if self.t.size > 1 else np.abs(self.current[0])


def electrical(system: System, mechanism: Mechanism, run: Any) -> Electrical:
    """Compute the currents and voltages in a run.

    Parameters
    ----------
    system : System
        Equations of motion of the run.
    mechanism : Mechanism
        Mechanism as described, with actuators.
    run : TrackingRun or MotionRun
        Run with torques `applied`, and `commanded` if these differ.
    """
    applied = run.applied
    k = min(len(applied), run.solution.t.size)
    applied, commanded = applied[:k], getattr(run, "commanded", None)
    commanded = applied if commanded is None else commanded[:k]
    motors, found = tuple(motor.name for motor in mechanism.motors), actuators_by_motor(mechanism)
    q, v = run.solution.q[:k], run.solution.v[:k]
    torque, rate, current, voltage = np.full((4, k, len(motors)), np.nan)
    for m, motor in enumerate(mechanism.motors):
        rate[:, m] = joint_coordinate(system, motor.joint, q, v).rate
        each = _of_motor(found.get(motor.name), applied[:, m], commanded[:, m], rate[:, m])
        torque[:, m], current[:, m], voltage[:, m] = each
    known = [found.get(name) for name in motors]
    resistance = np.array([np.nan if one is None or one.resistance is None else one.resistance for one in known])
    return Electrical(motors, run.solution.t[:k], torque, rate, current, voltage, resistance)


def _of_motor(actuator: Actuator | None, applied: Array, commanded: Array, rate: Array) -> tuple[Any, Any, Any]:
    """Return torque, current and voltage (k,) of a motor from its acting and its commanded torques."""
    if actuator is None or actuator.torque_per_current is None or actuator.voltage_per_rate is None:
        return applied, np.nan, np.nan
    torque = applied - actuator.damping * rate
    current = torque / actuator.torque_per_current
    if actuator.resistance is None:
        return torque, current, np.nan
    if actuator.imposes_voltage:
        return torque, current, actuator.resistance * commanded / actuator.torque_per_current
    rise = (commanded - applied) / (actuator.lag * actuator.torque_per_current) if actuator.lag else 0.0
    voltage = actuator.resistance * current + actuator.voltage_per_rate * rate + actuator.inductance * rise
    return torque, current, voltage


def electrical_findings(
    mechanism: Mechanism, found: Electrical, mode: ActuationMode | None = None
) -> Iterator[Finding]:
    """Yield findings on exceeded amplifier limits, passive motors that brake, and back-EMF that acts too early."""
    for k, motor in enumerate(found.motors):
        actuator = actuators_by_motor(mechanism).get(motor)
        if actuator is not None and mode is not None and motor not in mode.motors and actuator.damping:
            yield Finding(
                "back-emf-passive", f"mode {mode.name}",
                f"motor {motor} is passive and brakes its joint by {actuator.damping:.3g} N m s/rad or N s/m: its "
                "amplifier holds it at zero voltage",
                f'give {motor} an actuator of its own with amplifier = "current"'
            )  # fmt: skip
        if actuator is not None and found.t.size:
            yield from _beyond(actuator, motor, found.current[:, k], found.voltage[:, k])
            yield from _delayed_back_emf(actuator, motor, found, k)


def _beyond(actuator: Actuator, motor: str, current: Array, voltage: Array) -> Iterator[Finding]:
    for word, values, limit, unit in (
        ("current", current, actuator.current_limit, "A"), ("voltage", voltage, actuator.voltage_limit, "V"),
    ):  # fmt: skip
        most = float(np.max(np.abs(values)))
        if limit is not None and most > (1.0 + _BEYOND) * limit:
            yield Finding(
                "amplifier-beyond", f"actuator.{actuator.name}.{word}_limit",
                f"motor {motor} needs {most:.3g} {unit}, but its amplifier supplies {limit:.3g} {unit}",
                "reduce the acceleration, or choose another gear or motor",
            )  # fmt: skip


def _delayed_back_emf(actuator: Actuator, motor: str, found: Electrical, k: int) -> Iterator[Finding]:
    """Yield a finding if the delay of back-EMF by L/R matters, as the model's back-EMF damps without delay."""
    if not (actuator.imposes_voltage and actuator.inductance) or found.t.size < 3:
        return
    late = actuator.damping * actuator.electrical_time * float(np.max(np.abs(np.gradient(found.rate[:, k], found.t))))
    most = float(np.max(np.abs(found.torque[:, k])))
    if late > _LATE * most > 0.0:
        yield Finding(
            "back-emf-late", f"actuator.{actuator.name}.inductance",
            f"back-EMF of motor {motor} acts at once, but L/R = {1e3 * actuator.electrical_time:.3g} ms would delay up "
            f"to {late:.3g} of {most:.3g} (N m or N)",
            'read results as those without inductance, or use amplifier = "current" with the bandwidth of its loop',
        )  # fmt: skip
