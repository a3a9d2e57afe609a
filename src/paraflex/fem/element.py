"""Planar beam element with linear axial and quintic Hermite transverse displacement (Eqs. 3-6).

The element has two nodes with four coordinates each: axial displacement, transverse displacement, slope and
curvature. Lumped masses and moments of inertia at its ends are point contributions, which enter in `fem.integrals`;
without them this is the common element (Remark 1).
"""

from functools import cache

import numpy as np

from paraflex.arrays import Array

COORDINATES_PER_NODE = 4
AXIAL, TRANSVERSE, SLOPE, CURVATURE = range(COORDINATES_PER_NODE)

# Quintic Hermite polynomials in z = x/l, ascending powers z^0..z^5; rows: displacement, slope / l,
# curvature / l^2 of the first node, then of the second. Eq. 6, whose first row ends in -6 z^5 (printed -16).
_HERMITE = np.array(
    [
        [1.0, 0.0, 0.0, -10.0, 15.0, -6.0],
        [0.0, 1.0, 0.0, -6.0, 8.0, -3.0],
        [0.0, 0.0, 0.5, -1.5, 1.5, -0.5],
        [0.0, 0.0, 0.0, 10.0, -15.0, 6.0],
        [0.0, 0.0, 0.0, -4.0, 7.0, -3.0],
        [0.0, 0.0, 0.0, 0.5, -1.0, 0.5],
    ]
)
# Power of l that scales each row: nodal slopes and curvatures are derivatives by x, not by z.
_LENGTH_POWER = np.array([0, 1, 2, 0, 1, 2])
_TRANSVERSE_COLUMNS = [TRANSVERSE, SLOPE, CURVATURE, 4 + TRANSVERSE, 4 + SLOPE, 4 + CURVATURE]
_AXIAL_COLUMNS = [AXIAL, 4 + AXIAL]


@cache
def _coefficients(derivative: int) -> Array:
    """Return the coefficients (powers, 6) of a derivative of the Hermite polynomials with respect to z."""
    rows = np.polynomial.polynomial.polyder(_HERMITE, derivative, axis=1)
    return np.ascontiguousarray(rows.T, dtype=np.float64)


def axial_shape(x: Array, length: float, derivative: int = 0) -> Array:
    """Evaluate the axial displacement per nodal coordinate (first row of Eq. 5) or its x-derivative.

    Parameters
    ----------
    x : (n,) array
        Positions from the first node [m].
    length : float
        Length of the element [m].
    derivative : int
        Order of the derivative with respect to x, by default 0.

    Returns
    -------
    (n, 8) array
        Rows per coordinate of the element.
    """
    z = np.asarray(x) / length
    rows = np.zeros((z.size, 2 * COORDINATES_PER_NODE), dtype=z.dtype)
    if derivative == 0:
        rows[:, _AXIAL_COLUMNS] = np.column_stack([1.0 - z, z])
    elif derivative == 1:
        rows[:, _AXIAL_COLUMNS] = [-1.0 / length, 1.0 / length]
    return rows


def transverse_shape(x: Array, length: float, derivative: int = 0) -> Array:
    """Evaluate the transverse displacement per nodal coordinate (second row of Eq. 5) or its x-derivative.

    Parameters
    ----------
    x : (n,) array
        Positions from the first node [m].
    length : float
        Length of the element [m].
    derivative : int
        Order of the derivative with respect to x, by default 0: 1 is the slope, 2 the curvature.

    Returns
    -------
    (n, 8) array
        Rows per coordinate of the element.
    """
    z = np.asarray(x) / length
    rows = np.zeros((z.size, 2 * COORDINATES_PER_NODE), dtype=z.dtype)
    values = np.polynomial.polynomial.polyval(z, _coefficients(derivative)).T
    rows[:, _TRANSVERSE_COLUMNS] = values * np.asarray(length) ** (_LENGTH_POWER - derivative)
    return rows
