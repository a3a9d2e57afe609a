"""The modified trapezoidal law of motion along a length (Eqs. 62-63, as corrected)."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt

import numpy as np

from paraflex.arrays import Array


@dataclass(frozen=True)
class TrapezoidalLaw:
    """Sine-shaped acceleration, cruise, sine-shaped deceleration, each lasting half a period T.

    The acceleration is a_max sin(2 pi t/T) on [0, T/2), zero on [T/2, T), -a_max sin(2 pi t/T) on [T, 3T/2] with
    T = sqrt(pi s/a_max). The cruise speed is a_max T/pi: Eq. 63 as printed has half of it, which its own
    acceleration does not give and which would not cover the length.

    Attributes
    ----------
    length : float
        Covered [m].
    max_acceleration : float
        [m/s^2]
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
        """Length covered [m], speed and acceleration at times t [s]; at rest outside the motion."""
        T, a = self.period, self.max_acceleration
        t = np.clip(t, 0.0, self.duration)
        w = 2.0 * pi / T
        sine = a * np.sin(w * t)
        # One half period of sine-shaped acceleration: its speed and distance as functions of time.
        rising = np.minimum(t, 0.5 * T)
        falling = np.maximum(t - T, 0.0)

        def speed(x):
            return a / w * (1.0 - np.cos(w * x))

        def distance(x):
            return a / w * (x - np.sin(w * x) / w)

        cruise = a * T / pi
        covered = distance(rising) + cruise * np.maximum(t - 0.5 * T, 0.0) - distance(falling)
        acceleration = np.where(t < 0.5 * T, sine, np.where(t < T, 0.0, -sine))
        return covered, speed(rising) - speed(falling), acceleration
