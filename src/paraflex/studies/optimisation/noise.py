"""Noise of a computed quantity, estimated from differences of high order."""

from __future__ import annotations

import numpy as np

from paraflex.arrays import Array

# Number of closely spaced values from which noise is estimated.
NOISE_POINTS = 8
# Largest ratio of the estimates of three successive orders that agree.
_AGREE = 4.0


def noise_of(values: Array) -> Array:
    """Estimate the standard deviation of the noise in values at closely and equally spaced points.

    Differences of order k of independent noise of variance s^2 have variance s^2 (2k)! / (k!)^2, while those of a
    smooth function vanish with growing k. The noise is given by the first order whose differences change sign and whose
    estimate agrees with those of the next two orders. If there is none, the smallest estimate is a bound (More and
    Wild, Estimating computational noise, SIAM J. Sci. Comput. 33, 2011).

    Parameters
    ----------
    values : (points, ...) array
        Values at the points; the noise of each component is estimated separately.
    """
    columns = values.reshape(values.shape[0], -1)
    return np.array([_noise(column) for column in columns.T]).reshape(values.shape[1:])


def _noise(values: Array) -> float:
    estimates, changes, rest, factor = [], [], values, 1.0
    for order in range(1, values.size):
        rest = np.diff(rest)
        factor *= 0.5 * order / (2.0 * order - 1.0)
        estimates.append(float(np.sqrt(factor * np.mean(rest**2))))
        changes.append(bool(rest.min() < 0.0 < rest.max()))
    for k in range(len(estimates) - 2):
        three = estimates[k : k + 3]
        if changes[k] and max(three) <= _AGREE * min(three):
            return estimates[k]
    return min(estimates)
