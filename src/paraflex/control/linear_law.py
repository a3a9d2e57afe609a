"""Linear laws with limits, as the compiled time loop takes them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from paraflex.arrays import Array


@dataclass(frozen=True)
class LinearLaw:
    """A law x' = A x + B e + E (w - g), w = P (h + C x + D e), with g what limits leave of the torques w wanted.

    Attributes
    ----------
    A, B, C, D : (n, n), (n, inputs), (outputs, n) and (outputs, inputs) arrays
    E : (n, outputs) array
        None: limits tell it nothing.
    first : (n, inputs) array
        States before the first sample, by its errors; none for zero.
    holding : (outputs,) array
        Constant torques h; none for zero.
    waiting : (n,) array
        One for states that stay as they are while a torque is limited.
    projector : (samples, outputs, outputs) array or None
        P; its last goes on.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    E: Array = field(default_factory=lambda: np.zeros((0, 0)))
    first: Array = field(default_factory=lambda: np.zeros((0, 0)))
    holding: Array = field(default_factory=lambda: np.zeros(0))
    waiting: Array = field(default_factory=lambda: np.zeros(0))
    projector: Array | None = None
