"""Formulas of metrics; those that need derivatives use sums, products and roots only, for the complex step."""

from typing import Any

import numpy as np

from paraflex.arrays import Mask, Numbers

# A sample within this fraction of the motion from its end is at the end: rounding of times.
SAME_TIME = 1e-9
# Degree of the polynomial drift in time: a free mechanism drifts at a speed that changes slowly.
_DRIFT_DEGREE = 2
# Fewer samples after the motion do not distinguish a vibration from a drift.
_FEWEST_SAMPLES = 3 * (_DRIFT_DEGREE + 1)
# Band of the settling time about the desired position, as a fraction of the largest tracking error.
SETTLING_BAND = 0.05
# Desired positions within this fraction of the largest distance from the end of the path do not define its direction.
_NEAR_END = 1e-6


def during_motion(t: Numbers, motion_end: float) -> Mask:
    """Return which samples at times t (k,) [s] are during the motion, its end included; the others are after it."""
    end = np.real(motion_end)
    return np.real(t) <= end + SAME_TIME * abs(end)


def length(vectors: Numbers) -> Numbers:
    """Return the lengths (...,) of vectors (..., 2)."""
    return np.sqrt(vectors[..., 0] ** 2 + vectors[..., 1] ** 2)


def largest_norm(vectors: Numbers) -> float:
    """Return the largest Euclidean norm of vectors (k, n), NaN if there are none."""
    return float(np.max(np.linalg.norm(vectors, axis=1))) if len(vectors) else np.nan


def rms(values: Numbers) -> Any:
    """Return the root mean square over the first axis, NaN if it is empty."""
    if len(values) == 0:
        return np.full(values.shape[1:], np.nan)[()]
    return np.sqrt(np.mean(values**2, axis=0))


def drift_speed(t: Numbers, position: Numbers) -> Any:
    """Return the mean speed [m/s] of the drift of positions (k, 2) at times t (k,) from which `vibration` is measured.

    The mean speed is the slope of the least-squares line. NaN if there are too few samples.
    """
    if len(t) < _FEWEST_SAMPLES:
        return np.nan
    coefficients, half = _drift(t, position)[1:]
    # The constant and the quadratic Legendre polynomial have equal values at both ends.
    return np.sqrt(np.sum(coefficients[1] ** 2)) / half


def vibration(t: Numbers, position: Numbers) -> Any:
    """Return the root mean square distance of positions (k, 2) at times t (k,) from their drift [m].

    The drift is the least-squares quadratic in time, as of a free body whose speed changes slowly. A steady sinusoid of
    amplitude A along a line gives A / sqrt(2) if the samples cover a few periods. NaN if there are too few samples.
    """
    if len(t) < _FEWEST_SAMPLES:
        return np.nan
    basis, coefficients, _ = _drift(t, position)
    return np.sqrt(np.mean(np.sum((position - basis @ coefficients) ** 2, axis=1)))


def settling_time(t: Numbers, distance: Numbers, motion_end: float, band: float | None = None) -> float:
    """Return the settling time [s]: from the end of the motion until distances (k,) at times t (k,) stay within a band.

    Distances are interpolated linearly between samples. The time is 0 if they stay within the band from the end on, NaN
    if the last is outside, if one is not finite, or if there are no samples after the motion.

    Parameters
    ----------
    t, distance : (k,) arrays
        Sample times [s], and distances from the desired position [m].
    motion_end : float
        End of the motion [s].
    band : float, optional
        Width of the band [m]; by default the fraction `SETTLING_BAND` of the largest distance.
    """
    moving = during_motion(t, motion_end)
    if moving.all() or not np.isfinite(distance).all():
        return np.nan
    band = SETTLING_BAND * float(distance.max()) if band is None else band
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


def overshoot(position: Numbers, desired: Numbers, moving: Mask) -> float:
    """Return the overshoot [m] of positions (k, 2) beyond the end of their desired path (k, 2), in its final direction.

    Only samples after the motion count, which are those where `moving` (k,) is false. The value is 0 without overshoot,
    NaN if there are no such samples or the path has no final direction.
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
    """Return Legendre polynomials (k, 3) at the samples, their least-squares coefficients (3, 2), half the time [s]."""
    half = 0.5 * (t[-1] - t[0])
    x = (t - t[0]) / half - 1.0
    basis = np.stack([np.ones_like(x), x, 1.5 * x**2 - 0.5], axis=1)
    # Normal equations with the plain transpose: well conditioned for Legendre polynomials, and analytic.
    return basis, np.linalg.solve(basis.T @ basis, basis.T @ position), half


def stress_at(loads: Any, nominal: Any, at: Any) -> Any:
    """Return stresses |N| / A + |M| c / I at an index of samples and sections, with the signs of the nominal run [Pa].

    `loads` are `SectionLoads`. The stresses are due to bending alone where the axial force is NaN.
    """
    bending = np.sign(nominal.moment[at]) * loads.moment[at] / loads.modulus[at]
    known = ~np.isnan(nominal.force[at])
    axial = np.sign(nominal.force[at]) * np.where(known, loads.force[at], 0.0) / loads.area[at]
    return bending + np.where(known, axial, 0.0)
