"""Times at which torques, loads or prescribed motions jump, where steps must end."""

from __future__ import annotations

from math import factorial

import numpy as np
from numpy.polynomial.polynomial import polyder, polyval

from paraflex.arrays import Array
from paraflex.dynamics import Inputs
from paraflex.kernel.packed import Signals

# A jump counts above this fraction of the largest value or derivative of the signal, and above this rounding of values.
_SMOOTH, _ROUNDING = 1e-9, 1e-13


def jump_times(signals: Signals, inputs: Inputs, knots: Array) -> Array:
    """Return the knots at which a torque or load jumps, or a prescribed motion in its value, rate or acceleration.

    Parameters
    ----------
    signals : Signals
        Signals to examine.
    inputs : Inputs
        Indices of motors, loads and prescribed motions among the signals.
    knots : (k,) array
        Times to examine [s].
    """
    looked_at = [(k, 1) for k in (*inputs.motors, *inputs.loads)] + [(k, 3) for k in inputs.prescribed]
    return np.array([t for t in knots if any(_jumps(signals, k, t, derivatives) for k, derivatives in looked_at)])


def _jumps(signals: Signals, k: int, time: float, derivatives: int) -> bool:
    first, last = int(signals.start[k]), int(signals.start[k + 1]) - 1
    breaks = signals.breaks[first:last]
    piece = int(np.searchsorted(breaks, time, side="right")) - 1
    if piece < 1 or breaks[piece] != time:
        return False
    before, after = signals.coefficients[first + piece - 1], signals.coefficients[first + piece]
    x = time - breaks[piece - 1]
    largest = np.max(np.abs(signals.coefficients[first:last]), axis=0)
    # Rounding of the values is amplified in their derivatives, the more the shorter the pieces are.
    short = float(np.min(np.diff(signals.breaks[first : last + 1])))
    rounding = _ROUNDING * float(np.sum(largest * short ** np.arange(largest.size)))
    for order in range(derivatives):
        left, right = (float(polyval(at, polyder(one, order))) for one, at in ((before, x), (after, 0.0)))
        size = max(abs(left), factorial(order) * largest[order])
        if abs(right - left) > max(_SMOOTH * size, rounding / short**order):
            return True
    return False
