"""Planar beam element with linear axial and quintic Hermite transverse displacement (Eqs. 3-6).

The element has two nodes with four coordinates each: axial displacement, transverse displacement, slope and
curvature. Lumped masses and moments of inertia at its ends are point contributions, which enter in `fem.integrals`;
without them this is the common element (Remark 1).
"""

from functools import cache

import numpy as np

from paraflex.arrays import Array, Indices

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
# Linear functions of the axial displacement, likewise.
_LINEAR = np.array([[1.0, -1.0], [0.0, 1.0]])
# Power of l that scales each row: nodal slopes and curvatures are derivatives by x, not by z.
_LENGTH_POWER = np.array([0, 1, 2, 0, 1, 2])
_TRANSVERSE_COLUMNS = [TRANSVERSE, SLOPE, CURVATURE, 4 + TRANSVERSE, 4 + SLOPE, 4 + CURVATURE]
_AXIAL_COLUMNS = [AXIAL, 4 + AXIAL]


@cache
def _coefficients(axial: bool, derivative: int) -> Array:
    """Return the coefficients (powers, functions) of a derivative of the shape functions by z, or of an integral."""
    rows, polynomial = _LINEAR if axial else _HERMITE, np.polynomial.polynomial
    found = polynomial.polyder(rows, derivative, axis=1) if derivative > 0 else rows
    if derivative < 0:
        found = polynomial.polyint(rows, -derivative, axis=1)
    return np.ascontiguousarray(found.T, dtype=np.float64)


def axial_shape(x: Array, length: Array | float, derivative: int = 0) -> Array:
    """Evaluate the axial displacement per nodal coordinate (first row of Eq. 5) or its x-derivative.

    Parameters
    ----------
    x : (...) array
        Positions from the first node [m].
    length : float or (...) array
        Length of the element [m].
    derivative : int
        Order of the derivative with respect to x, by default 0; -1 is the integral from the first node, -2 its
        integral.

    Returns
    -------
    (..., 8) array
        Rows per coordinate of the element.
    """
    return _shape(x, length, _coefficients(True, derivative), np.full(2, -derivative), _AXIAL_COLUMNS)


def transverse_shape(x: Array, length: Array | float, derivative: int = 0) -> Array:
    """Evaluate the transverse displacement per nodal coordinate (second row of Eq. 5) or its x-derivative.

    Parameters
    ----------
    x, length, derivative
        See `axial_shape`; the first derivative is the slope, the second the curvature.

    Returns
    -------
    (..., 8) array
        Rows per coordinate of the element.
    """
    return _shape(x, length, _coefficients(False, derivative), _LENGTH_POWER - derivative, _TRANSVERSE_COLUMNS)


def transverse_powers(length: float) -> Array:
    """Return the coefficients (6, 8) of ascending powers of x of the transverse displacement, per coordinate."""
    found = np.zeros((6, 2 * COORDINATES_PER_NODE), dtype=np.result_type(length, float))
    found[:, _TRANSVERSE_COLUMNS] = _coefficients(False, 0) * length ** (_LENGTH_POWER - np.arange(6)[:, None])
    return found


def _shape(x: Array, length: Array | float, coefficients: Array, power: Indices, columns: list[int]) -> Array:
    z = np.asarray(x) / length
    powers = np.ones((*z.shape, len(coefficients)), z.dtype)
    powers[..., 1:] = z[..., None]
    values = np.cumprod(powers, axis=-1) @ coefficients * np.asarray(length)[..., None] ** power
    rows = np.zeros((*z.shape, 2 * COORDINATES_PER_NODE), values.dtype)
    rows[..., columns] = values
    return rows
