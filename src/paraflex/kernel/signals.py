"""Time profiles as piecewise quintics, evaluated exactly with their derivatives."""

from .arrays import last_before
from .compiling import inlined, kernel


@inlined
def piece_at(s, k, t):
    """Return the piece of signal k with breaks[piece] <= t, by bisection; the first or last piece outside the range."""
    return last_before(s.breaks, s.start[k], s.start[k + 1] - 2, t)


@kernel
def evaluate_signal(s, k, t):
    """Return value, rate and acceleration of signal k at time t; outside its range the end pieces are extrapolated."""
    piece = piece_at(s, k, t)
    c = s.coefficients[piece]
    x = t - s.breaks[piece]
    value = c[0] + x * (c[1] + x * (c[2] + x * (c[3] + x * (c[4] + x * c[5]))))
    rate = c[1] + x * (2.0 * c[2] + x * (3.0 * c[3] + x * (4.0 * c[4] + x * 5.0 * c[5])))
    acceleration = 2.0 * c[2] + x * (6.0 * c[3] + x * (12.0 * c[4] + x * 20.0 * c[5]))
    return value, rate, acceleration
