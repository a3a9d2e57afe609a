"""Quintic splines through points, as the coefficients of their pieces.

Basis and equations are those of `scipy.interpolate.make_interp_spline`. Several splines are computed at once, and
importing `scipy.interpolate` takes longer than planning the torques of a path.
"""

from math import factorial

import numpy as np
import scipy

from paraflex.arrays import Array, Indices

DEGREE = 5
# The inner points that are no knots, at each end: the fifth derivative does not jump there.
_NO_KNOT = (DEGREE - 1) // 2


def quintic_splines(x: Array, y: Array, sizes: Indices) -> tuple[Array, Array]:
    """Return the left ends of the pieces of quintic splines, and the Taylor coefficients there.

    Parameters
    ----------
    x : (k,) array
        Places, ascending, of the points of all splines, one spline after the other.
    y : (k, columns) array
        Values at these places.
    sizes : (splines,) array of int
        Number of points of each spline, six at least.

    Returns
    -------
    starts : (pieces,) array
        Left end of each piece.
    coefficients : (6, pieces, columns) array
        Coefficients of the powers of the distance from the left end, ascending.

    References
    ----------
    C. de Boor, A Practical Guide to Splines, chapters X (basis) and XIII (interpolation, not-a-knot condition).
    """
    first, rows = np.cumsum(sizes) - sizes, np.arange(x.size)
    begin = np.repeat(first, sizes)
    # First function of the basis that is not zero from each point on, and the knot at or before the point.
    function = begin + np.clip(rows - begin - _NO_KNOT, 0, np.repeat(sizes, sizes) - DEGREE - 1)
    knot = function + DEGREE + (DEGREE + 1) * np.repeat(np.arange(sizes.size), sizes)
    repeated = np.ones(x.size, dtype=int)
    repeated[[first, first + sizes - 1]] = DEGREE + 1
    for k in range(1, _NO_KNOT + 1):
        repeated[[first + k, first + sizes - 1 - k]] = 0
    knots = np.repeat(x, repeated)
    basis = _basis(knots, x, knot)
    # Row and column of each value, in the band storage of LAPACK.
    column = function + np.arange(DEGREE + 1)[:, None]
    band = np.zeros((2 * DEGREE + 1, x.size))
    band[DEGREE + rows - column, column] = basis[DEGREE]
    weights = scipy.linalg.solve_banded((DEGREE, DEGREE), band, y)
    repeated[first + sizes - 1] = 0
    starts = np.flatnonzero(repeated)
    parts = _derivatives([each[:, starts] for each in basis], knots, knot[starts])[..., None]
    coefficients = sum(parts[:, k] * weights[function[starts] + k] for k in range(DEGREE + 1))
    return x[starts], coefficients / np.array([factorial(order) for order in range(DEGREE + 1)])[:, None, None]


def _basis(knots: Array, x: Array, knot: Indices) -> list[Array]:
    """Return the basis functions (degree + 1, k) that are not zero at places x after their knots, by degree."""
    found = [np.ones((1, x.size))]
    for degree in range(1, DEGREE + 1):
        right, left = _ends(knots, knot, degree)
        share = found[-1] / (right - left)
        found.append(_joined(share * (right - x), share * (x - left)))
    return found


def _derivatives(basis: list[Array], knots: Array, knot: Indices) -> Array:
    """Return the derivatives (6, 6, k) of the quintic basis functions, by order, from the functions of all degrees."""
    found = [*basis]
    for degree in range(1, DEGREE + 1):
        right, left = _ends(knots, knot, degree)
        # Up to the degree, each order is the difference of that before it of the functions of one degree less.
        for order in range(DEGREE - degree + 1, DEGREE + 1):
            slope = degree * found[DEGREE - order] / (right - left)
            found[DEGREE - order] = _joined(-slope, slope)
    return np.stack(found[::-1])


def _ends(knots: Array, knot: Indices, degree: int) -> tuple[Array, Array]:
    """Return the right and left ends (degree, k) of the functions of one degree less that are not zero."""
    above = knot + np.arange(1, degree + 1)[:, None]
    return knots[above], knots[above - degree]


def _joined(falling: Array, rising: Array) -> Array:
    """Return the sums (j + 1, k) of falling and rising parts (j, k) of neighbouring functions."""
    values = np.zeros((len(rising) + 1, rising.shape[1]))
    values[:-1] += falling
    values[1:] += rising
    return values
