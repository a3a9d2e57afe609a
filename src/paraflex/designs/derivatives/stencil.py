"""Differences of high order for functions that are smooth to rounding, with an estimate of their error."""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial
from typing import NamedTuple

import numpy as np

from paraflex.arrays import Array

# Between places, as parts of a parameter's size. What is differentiated is smooth over many times as far: powers of a
# number, sines and cosines.
_STENCIL_SPACING = 4e-3


class Difference(NamedTuple):
    """A derivative, and its difference from a formula two orders lower, which bounds its error."""

    value: Array
    error: Array


@dataclass(frozen=True)
class Stencil:
    """Points at which a function is evaluated, and their weights.

    Attributes
    ----------
    places : tuple of float
        As parts of a parameter's size.
    weights, coarse : (places,) arrays
        For a derivative by the parameter as a part of its size; `coarse` leaves out the outermost places.
    """

    places: tuple[float, ...]
    weights: Array
    coarse: Array

    def derivative(self, values: list[Array]) -> Difference:
        """Derivative from values at the points, arrays of one shape."""
        stack = np.stack(values)
        # Differences from one of the values: constant parts cancel without rounding.
        stack = stack - stack[0]
        fine, coarse = (np.asarray(np.tensordot(w, stack, axes=1), dtype=float) for w in (self.weights, self.coarse))
        return Difference(fine, np.abs(fine - coarse))


def make_stencil(places: range | tuple[int, ...], spacing: float) -> Stencil:
    """The stencil of points in units of a spacing; the coarser formula leaves out two of them."""
    x = np.array(places, dtype=float)
    near = np.argsort(np.abs(x), kind="stable")[:-2]
    weights, coarse = np.zeros(x.size), np.zeros(x.size)
    weights[:] = _weights(x)
    coarse[near] = _weights(x[near])
    return Stencil(tuple(spacing * x), weights / spacing, coarse / spacing)


def _weights(places: Array) -> Array:
    """Weights of values at the points for the first derivative at zero, in units of the spacing: by Taylor's series."""
    taylor = np.array([places**power / factorial(power) for power in range(places.size)])
    return np.linalg.solve(taylor, np.eye(places.size)[1])


# Centred on a value, and to either side of it only.
STENCILS = (
    make_stencil((-4, -3, -2, -1, 1, 2, 3, 4), _STENCIL_SPACING),
    make_stencil(range(9), _STENCIL_SPACING),
    make_stencil(range(0, -9, -1), _STENCIL_SPACING),
)
