"""Structural damping of a flexible body: in proportion to mass and stiffness, or by a ratio for each mode."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class RayleighDamping:
    """Damping in proportion to mass and stiffness: D = mass M_ff + stiffness K.

    Attributes
    ----------
    mass : float
        [1/s]
    stiffness : float
        [s]
    """

    mass: float = 0.0
    stiffness: float = 0.0

    def coefficients(self, omega: NDArray[np.float64]) -> NDArray[np.float64]:
        """Of mass-normalised modes of these angular frequencies [1/s]."""
        return self.mass + self.stiffness * omega**2


@dataclass(frozen=True)
class ModalDamping:
    """Damping by a ratio for each mode of a body in its frame; the last serves all that follow."""

    ratios: tuple[float, ...]

    def coefficients(self, omega: NDArray[np.float64]) -> NDArray[np.float64]:
        """2 ratio omega of each mode [1/s]."""
        last = len(self.ratios) - 1
        return 2.0 * omega * np.array([self.ratios[min(k, last)] for k in range(omega.size)])


Damping = RayleighDamping | ModalDamping
