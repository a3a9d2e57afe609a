"""Linear control laws with limits, in the form that the compiled time loop takes."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from paraflex.arrays import Array


@dataclass(frozen=True)
class LinearLaw:
    """Linear law x' = A x + B e + E (w - g), w = P (h + C x + D e), with g the torques w after limits.

    Attributes
    ----------
    A, B, C, D : (n, n), (n, inputs), (outputs, n) and (outputs, inputs) arrays
        State, input, output and feed-through matrices; e are errors of readings.
    E : (n, outputs) array
        Gain of the feedback from limiting; empty if the states do not depend on it (no anti-windup).
    first : (n, inputs) array
        Matrix from the first errors to the states before the first sample; empty for zero states.
    holding : (outputs,) array
        Constant torques h; empty for zero.
    waiting : (n,) array
        One for states that stay constant while a torque is limited, zero for others; empty if there are none.
    projector : (samples, outputs, outputs) array or None
        Projectors P by sample, the last one kept afterwards; None for the identity.
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
