"""Functions of time as piecewise quintics, evaluated exactly with their derivatives."""

from __future__ import annotations

from paraflex.kernel.compiling import kernel


@kernel
def evaluate_signal(s, k, t):
    """Value, rate and acceleration of signal k at time t; held at its ends' pieces outside its range."""
    low, high = s.start[k], s.start[k + 1] - 2
    # Bisection for the piece with breaks[piece] <= t.
    while low < high:
        middle = (low + high + 1) // 2
        if s.breaks[middle] <= t:
            low = middle
        else:
            high = middle - 1
    c = s.coefficients[low]
    x = t - s.breaks[low]
    value = c[0] + x * (c[1] + x * (c[2] + x * (c[3] + x * (c[4] + x * c[5]))))
    rate = c[1] + x * (2.0 * c[2] + x * (3.0 * c[3] + x * (4.0 * c[4] + x * 5.0 * c[5])))
    acceleration = 2.0 * c[2] + x * (6.0 * c[3] + x * (12.0 * c[4] + x * 20.0 * c[5]))
    return value, rate, acceleration
