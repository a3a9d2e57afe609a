"""Finite differences of high order for functions that are smooth to rounding, with an error estimate."""

from dataclasses import dataclass
from math import factorial
from typing import NamedTuple

import numpy as np

from paraflex.arrays import Array

# Spacing of the points, relative to a parameter's size. The differentiated functions (powers, sines and cosines) are
# smooth over many times this distance.
_STENCIL_SPACING = 4e-3


class Difference(NamedTuple):
    """Derivative, and its difference from a formula of lower order with two points fewer, an estimate of the error."""

    value: Array
    error: Array


@dataclass(frozen=True)
class Stencil:
    """Points at which a function is evaluated, and their weights.

    Attributes
    ----------
    places : tuple of float
        Displacements of the points, relative to a parameter's size.
    weights, coarse : (places,) arrays
        Weights for the derivative with respect to the parameter relative to its size; `coarse` omits the outermost two
        points.
    """

    places: tuple[float, ...]
    weights: Array
    coarse: Array

    def derivative(self, values: list[Array]) -> Difference:
        """Return the derivative from values at the points, which are arrays of equal shape."""
        stack = np.stack(values)
        # One of the values is subtracted so that constant parts cancel without rounding.
        stack = stack - stack[0]
        fine, coarse = (np.asarray(np.tensordot(w, stack, axes=1), dtype=float) for w in (self.weights, self.coarse))
        return Difference(fine, np.abs(fine - coarse))


def _stencil(places: range | tuple[int, ...]) -> Stencil:
    """Return the stencil of points in units of the spacing; the coarser formula omits the outermost two."""
    x = np.array(places, dtype=float)
    near = np.argsort(np.abs(x), kind="stable")[:-2]
    coarse = np.zeros(x.size)
    coarse[near] = _weights(x[near])
    return Stencil(tuple(_STENCIL_SPACING * x), _weights(x) / _STENCIL_SPACING, coarse / _STENCIL_SPACING)


def _weights(places: Array) -> Array:
    """Return the weights of values at the points for the first derivative at zero, in units of the spacing.

    They follow from Taylor's series.
    """
    taylor = np.array([places**power / factorial(power) for power in range(places.size)])
    return np.linalg.solve(taylor, np.eye(places.size)[1])


# Central differences, and one-sided differences to either side.
STENCILS = (
    _stencil((-4, -3, -2, -1, 1, 2, 3, 4)),
    _stencil(range(9)),
    _stencil(range(0, -9, -1)),
)
