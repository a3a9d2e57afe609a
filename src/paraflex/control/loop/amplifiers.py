"""Amplifiers and windings between a controller's torques and those of motors: limits and lags."""

from math import inf

import numpy as np

from paraflex.actuation.feed_forward import about
from paraflex.arrays import Array
from paraflex.dynamics import InputSignals, System, joint_coordinate, piecewise_quintic
from paraflex.mechanism import Actuator, Mechanism, actuators_by_motor

# Largest error of the quintic pieces of an exponential, as a fraction of the change of the torque. The pieces end where
# the remainder is as small. On an interval h, in time constants, the error is h^6/46080 of the remainder at its start.
_PIECE_ERROR = 1e-10
_RELAXED = -np.log(_PIECE_ERROR)


# Spacing of unused times, beyond the end of any run [s].
_NEVER = 1e12


def _breaks() -> Array:
    """Return the breaks of the pieces, in time constants; pieces grow longer as the exponential decays."""
    breaks = [0.0]
    while breaks[-1] < _RELAXED:
        breaks.append(breaks[-1] + (46080.0 * _PIECE_ERROR) ** (1.0 / 6.0) * np.exp(breaks[-1] / 6.0))
    return np.array(breaks)


_BREAKS = _breaks()
# Coefficients of exp(-x) in these pieces, and zero after them.
_LEFT = np.vstack([
    piecewise_quintic(_BREAKS, np.exp(-_BREAKS), -np.exp(-_BREAKS), np.exp(-_BREAKS)).coefficients, np.zeros((1, 6)),
])  # fmt: skip


class Amplifiers:
    """Amplifiers of a mechanism: limits and lags of torques by motor; motors without an actuator have neither.

    Parameters
    ----------
    mechanism : Mechanism
        Mechanism with its actuators.

    Attributes
    ----------
    lags : (motors,) array
        Time constants with which torques follow their commands [s].
    limited : (motors,) array of bool
        Whether there is a limit of voltage or current.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        found = actuators_by_motor(mechanism)
        each = [found.get(motor.name) for motor in mechanism.motors]
        self._joints = [motor.joint for motor in mechanism.motors]
        self.lags: Array = np.array([0.0 if one is None else one.lag for one in each])
        self._imposes_voltage = np.array([one is not None and one.imposes_voltage for one in each], dtype=bool)
        numbers = np.array([_numbers(one) for one in each]).reshape(len(each), 5)
        self._per_current, self._per_rate, self._resistance, self._voltage, self._current = numbers.T
        self.limited: np.ndarray = np.isfinite(self._voltage) | np.isfinite(self._current)

    def rates(self, system: System, q: Array, v: Array) -> Array:
        """Return the joint rates of all motors (motors,) at coordinates and velocities (n,) [rad/s, m/s]."""
        return np.array([joint_coordinate(system, name, q[None], v[None]).rate[0] for name in self._joints])

    def limits(self, rates: Array) -> tuple[Array, Array]:
        """Return the lowest and highest commands (motors,) at given joint rates [N m, N].

        The voltage u = R i + n k_e w and the current i stay within the amplifier's limits. Where the amplifier imposes
        the voltage, the command is the torque n k_t u/R that the voltage would give at rest.
        """
        per_current, resistance = self._per_current, self._resistance
        back = self._per_rate * rates
        bounds = []
        for sign in (-1.0, 1.0):
            current, voltage = sign * self._current, sign * self._voltage
            of_current = per_current * np.clip((voltage - back) / resistance, -self._current, self._current)
            closer = np.maximum if sign < 0.0 else np.minimum
            of_voltage = per_current / resistance * closer(voltage, resistance * current + back)
            bounds.append(np.where(self._imposes_voltage, of_voltage, of_current))
        return bounds[0], bounds[1]


def _numbers(actuator: Actuator | None) -> tuple[float, float, float, float, float]:
    """Return n k_t, n k_e, R and the limits of voltage and current, with values that limit nothing for unknown ones."""
    if actuator is None or actuator.torque_per_current is None or actuator.voltage_per_rate is None:
        return 1.0, 0.0, 1.0, inf, inf
    voltage, current = (inf if one is None else one for one in (actuator.voltage_limit, actuator.current_limit))
    resistance = 1.0 if actuator.resistance is None else actuator.resistance
    return actuator.torque_per_current, actuator.voltage_per_rate, resistance, voltage, current


def largest_commands(mechanism: Mechanism, motors: tuple[str, ...]) -> Array:
    """Return the largest commands (motors,) of amplifiers at any speed [N m, N]; infinite without a limit.

    They are n k_t I under a current loop, n k_t U/R where the amplifier imposes the voltage.
    """
    found, largest = actuators_by_motor(mechanism), []
    for actuator in map(found.get, motors):
        per_current, _, resistance, voltage, current = _numbers(actuator)
        imposes_voltage = actuator is not None and actuator.imposes_voltage
        largest.append(per_current * (voltage / resistance if imposes_voltage else current))
    return np.array(largest)


def relaxing(base: InputSignals, t: float, begin: float, target: float, lag: float) -> InputSignals:
    """Add to a signal a torque that relaxes exponentially from one value to another.

    Parameters
    ----------
    base : InputSignals
        Signal to which the torque is added.
    t : float
        Time at which the torque begins and from which on the sum is returned, before the end of the signal [s].
    begin, target : float
        Initial and final value of the torque [N m, N].
    lag : float
        Time constant [s].

    Returns
    -------
    InputSignals
        Sum, exact to 1e-10 of the change.
    """
    own, end = t + lag * _BREAKS, base.breaks[-1]
    first, last = np.searchsorted(base.breaks, (t, min(own[-1], end)), side="right")
    between = base.breaks[first : min(last, base.breaks.size - 1)]
    starts = np.sort(np.concatenate([own[own < end], between]))
    starts = starts[np.diff(starts, append=np.inf) > 0.0]
    piece = np.maximum(np.searchsorted(base.breaks, starts, side="right") - 1, 0)
    part = np.minimum(np.searchsorted(own, starts, side="right") - 1, len(_LEFT) - 1)
    both = np.concatenate([base.coefficients[piece], (begin - target) * _LEFT[part] / lag ** np.arange(6)])
    planned, left = np.split(about(both, np.concatenate([starts - base.breaks[piece], starts - own[part]])), 2)
    rest = slice(min(last, base.breaks.size - 1), None)
    coefficients = np.vstack([planned + left, base.coefficients[rest]])
    coefficients[:, 0] += target
    return InputSignals(np.concatenate([starts, base.breaks[rest]]), coefficients)


def padded_signal(signal: InputSignals, pieces: int | None = None) -> InputSignals:
    """Return a signal padded with unused pieces, beyond the times of any run.

    Parameters
    ----------
    signal : InputSignals
        Signal to be padded.
    pieces : int, optional
        Total number of pieces; by default as many are added as `relaxing` needs.
    """
    more = _BREAKS.size + 2 if pieces is None else pieces - len(signal.coefficients)
    breaks = np.concatenate([signal.breaks[:-1], _NEVER * np.arange(1.0, more + 2.0)])
    return InputSignals(breaks, np.vstack([signal.coefficients, np.zeros((more, signal.coefficients.shape[1]))]))
