"""Motion profiles along a length: modified trapezoidal (Eqs. 62-63, as corrected), and with limited speed."""

from dataclasses import dataclass
from math import pi, sqrt

import numpy as np

from paraflex.arrays import Array


@dataclass(frozen=True)
class TrapezoidalProfile:
    """Sine-shaped acceleration, cruise and sine-shaped deceleration, each of half a period T.

    The acceleration is a_max sin(2 pi t/T) on [0, T/2), zero on [T/2, T), -a_max sin(2 pi t/T) on [T, 3T/2] with T =
    sqrt(pi s/a_max). The cruise speed is a_max T/pi. Eq. 63 as printed has half of it, which is inconsistent with its
    own acceleration and would not cover the length.

    Attributes
    ----------
    length : float
        Length of the path [m].
    max_acceleration : float
        Largest acceleration a_max [m/s^2].
    """

    length: float
    max_acceleration: float

    @property
    def period(self) -> float:
        """Period T [s]."""
        squared = pi * self.length / self.max_acceleration
        return np.sqrt(squared) if isinstance(squared, complex) else sqrt(squared)

    @property
    def duration(self) -> float:
        """Duration of the motion, 3T/2 [s]."""
        return 1.5 * self.period

    @property
    def knots(self) -> tuple[float, ...]:
        """Times at which the third derivative jumps [s]."""
        T = self.period
        return (0.0, 0.5 * T, T, 1.5 * T)

    def evaluate(self, t: Array) -> tuple[Array, Array, Array]:
        """Return the length covered [m], speed and acceleration at times t [s]; at rest outside the motion."""
        T, a = self.period, self.max_acceleration
        t = np.clip(t, 0.0, self.duration)
        w = 2.0 * pi / T
        sine = a * np.sin(w * t)
        covered, speed, _, _ = _ramped(t, 0.5 * T, T, w, a / w, a * T / pi)
        return covered, speed, np.where(t < 0.5 * T, sine, np.where(t < T, 0.0, -sine))


@dataclass(frozen=True)
class CruiseProfile:
    """Sine-shaped acceleration to a speed, cruise, sine-shaped deceleration: a trapezoidal speed profile without jumps.

    With the acceleration a sin(pi t/R) on [0, R] the speed 2 a R/pi is reached. R is such that this is the largest
    speed or, if the length is too short for it, that there is no cruise.

    Attributes
    ----------
    length : float
        Length of the path [m].
    max_acceleration, max_speed : float
        Largest acceleration [m/s^2] and speed [m/s].
    """

    length: float
    max_acceleration: float
    max_speed: float

    @property
    def ramp(self) -> float:
        """Duration R of either ramp [s]."""
        full = pi * self.max_speed / (2.0 * self.max_acceleration)
        if np.real(full * self.max_speed) <= np.real(self.length):
            return full
        return np.sqrt(pi * self.length / (2.0 * self.max_acceleration))

    @property
    def speed(self) -> float:
        """Speed reached [m/s]."""
        return 2.0 * self.max_acceleration * self.ramp / pi

    @property
    def duration(self) -> float:
        """Duration of the motion [s]."""
        return self.ramp + self.length / self.speed

    @property
    def knots(self) -> tuple[float, ...]:
        """Times at which the third derivative jumps [s]."""
        return (0.0, self.ramp, self.duration - self.ramp, self.duration)

    def evaluate(self, t: Array) -> tuple[Array, Array, Array]:
        """Return the length covered [m], speed and acceleration at times t [s]; at rest outside the motion."""
        R, v, end = self.ramp, self.speed, self.duration
        w = pi / R
        covered, speed, rising, falling = _ramped(np.clip(t, 0.0, end), R, end - R, w, 0.5 * v, v)
        return covered, speed, 0.5 * v * w * (np.sin(w * rising) - np.sin(w * falling))


def _ramped(
    t: Array, ramp: float, slows: float, w: float, half: float, cruise: float
) -> tuple[Array, Array, Array, Array]:
    """Return length covered and speed at times t for ramps up from 0 and down from `slows`, and times in either.

    A ramp has the acceleration half * w * sin(w x); its speed rises to 2 * half, the cruise speed.
    """
    rising, falling = np.minimum(t, ramp), np.maximum(t - slows, 0.0)

    def distance(x):
        return half * (x - np.sin(w * x) / w)

    def speed(x):
        return half * (1.0 - np.cos(w * x))

    covered = distance(rising) + cruise * np.maximum(t - ramp, 0.0) - distance(falling)
    return covered, speed(rising) - speed(falling), rising, falling
