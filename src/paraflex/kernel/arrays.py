"""Element-wise loops, which Numba compiles faster than slice expressions, and padded arrays.

A compiled loop checks whether the memory it writes lies close to the memory it reads, and if so runs another version of
the loop, which rounds differently. Whether small arrays lie close depends on the allocator, so without padding repeated
runs would differ by rounding.
"""

from __future__ import annotations

from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paraflex.kernel.compiling import routine

# Unused entries before and after an array: more than a vectorised loop processes at once.
ROOM = 128


def apart(shape: int | tuple[int, ...], dtype: type = float) -> NDArray[Any]:
    """Return an array of zeros of a given shape, padded on both sides in memory."""
    count = shape if isinstance(shape, int) else prod(shape)
    return np.zeros(count + 2 * ROOM, dtype)[ROOM : ROOM + count].reshape(shape)


@routine
def fill(x, value):
    """Set every entry of a vector to a value."""
    for i in range(x.size):
        x[i] = value


@routine
def copy(x, to):
    """Copy a vector to another."""
    for i in range(x.size):
        to[i] = x[i]


@routine
def add(x, to):
    """Add a vector to another."""
    for i in range(x.size):
        to[i] += x[i]


@routine
def largest(x):
    """Return the largest magnitude in a vector, zero for an empty one."""
    size = 0.0
    for i in range(x.size):
        size = max(size, abs(x[i]))
    return size
