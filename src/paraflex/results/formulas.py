"""Formulas of metrics: sums, products and roots only, so that a complex step differentiates them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from paraflex.arrays import Numbers

# A sample so near to the end of the motion is at it: rounding of times, as a fraction of the motion.
SAME_TIME = 1e-9
# Degree of the drift in time: a free mechanism drifts at a speed that changes slowly.
_DRIFT_DEGREE = 2
# Fewer samples after the motion do not distinguish a vibration from a drift.
_FEWEST_SAMPLES = 3 * (_DRIFT_DEGREE + 1)
# The band about the desired place that a run settles into, as a share of its largest tracking error.
SETTLED = 0.05
# A desired place so near to the end of the path, as a share of its way, says nothing of where it comes from.
_NEAR_END = 1e-6


def during_motion(t: Numbers, motion_end: float) -> NDArray[np.bool_]:
    """The samples at times t (k,) during the motion, its end included [s]; the others are after it."""
    end = np.real(motion_end)
    return np.real(t) <= end + SAME_TIME * abs(end)


def length(vectors: Numbers) -> Numbers:
    """Length of vectors (k, 2)."""
    return np.sqrt(vectors[:, 0] ** 2 + vectors[:, 1] ** 2)


def largest_norm(vectors: Numbers) -> float:
    """Largest Euclidean norm of vectors (k, n); NaN for none."""
    return float(np.max(np.linalg.norm(vectors, axis=1))) if len(vectors) else np.nan


def rms(values: Numbers) -> Any:
    """Root mean square over the first axis; NaN for no values."""
    if len(values) == 0:
        return np.full(values.shape[1:], np.nan)[()]
    return np.sqrt(np.mean(values**2, axis=0))


def integral(t: Numbers, values: Numbers) -> Any:
    """Integral over time by the trapezoidal rule."""
    return np.sum(0.5 * (values[1:] + values[:-1]) * np.diff(t))


def drift_speed(t: Numbers, position: Numbers) -> Any:
    """Mean speed [m/s] of the drift of positions (k, 2) at times t (k,) about which `vibration` is measured.

    The slope of the straight line of least squares. NaN where there are too few samples.
    """
    if len(t) < _FEWEST_SAMPLES:
        return np.nan
    coefficients, half = _drift(t, position)[1:]
    # The constant and the quadratic part are the same at both ends.
    return np.sqrt(np.sum(coefficients[1] ** 2)) / half


def vibration(t: Numbers, position: Numbers) -> Any:
    """Root mean square distance of positions (k, 2) at times t (k,) from their drift [m].

    The drift is the quadratic in time of least squares, which a body has that moves freely, at a speed that changes
    slowly. Of a steady sinusoid of amplitude A along a line A / sqrt(2), if the samples are of a few periods. NaN where
    there are too few.
    """
    if len(t) < _FEWEST_SAMPLES:
        return np.nan
    basis, coefficients, _ = _drift(t, position)
    return np.sqrt(np.mean(np.sum((position - basis @ coefficients) ** 2, axis=1)))


def settling_time(t: Numbers, distance: Numbers, motion_end: float, band: float | None = None) -> float:
    """Time from the end of the motion until distances (k,) at times t (k,) stay within a band [s].

    Distances between samples are taken for straight lines. 0 where they are within it from the end on; NaN where the
    last is not, and where there are no samples after the motion.

    Parameters
    ----------
    t, distance : (k,) arrays
        [s], [m]
    motion_end : float
        [s]
    band : float, optional
        [m]; by default the share `SETTLED` of the largest distance.
    """
    moving = during_motion(t, motion_end)
    if moving.all() or not np.isfinite(distance).all():
        return np.nan
    band = SETTLED * float(distance.max()) if band is None else band
    first = max(int(np.sum(moving)) - 1, 0)
    times, rest = t[first:], distance[first:]
    outside = np.flatnonzero(rest > band)
    if not outside.size:
        return 0.0
    last = int(outside[-1])
    if last == rest.size - 1:
        return np.nan
    part = (rest[last] - band) / (rest[last] - rest[last + 1])
    return max(float(times[last] + part * (times[last + 1] - times[last])) - motion_end, 0.0)


def overshoot(position: Numbers, desired: Numbers, moving: NDArray[np.bool_]) -> float:
    """How far positions (k, 2) go beyond the end of their desired path (k, 2), in the direction it comes from [m].

    Of the samples after the motion; 0 where they do not, NaN where there are none, or no direction.
    """
    if moving.all() or not moving.any() or not np.isfinite(position).all():
        return np.nan
    end = desired[moving][-1]
    way = end - desired[moving]
    sizes = length(way)
    coming = np.flatnonzero(sizes > _NEAR_END * sizes.max())
    if not coming.size:
        return np.nan
    direction = way[coming[-1]] / sizes[coming[-1]]
    return max(float(np.max((position[~moving] - end) @ direction)), 0.0)


def _drift(t: Numbers, position: Numbers) -> tuple[Numbers, Numbers, Any]:
    """Legendre polynomials at the samples (k, 3), their coefficients (3, 2) by least squares, half of the time [s]."""
    half = 0.5 * (t[-1] - t[0])
    x = (t - t[0]) / half - 1.0
    basis = np.stack([np.ones_like(x), x, 1.5 * x**2 - 0.5], axis=1)
    # Normal equations with a plain transpose: well conditioned for these, and analytic.
    return basis, np.linalg.solve(basis.T @ basis, basis.T @ position), half
