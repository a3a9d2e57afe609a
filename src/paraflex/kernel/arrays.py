"""Loops in place of slice expressions, which Numba compiles sooner; and padded arrays.

A compiled loop asks whether what it writes lies close to what it reads, and if so takes another way, which rounds
differently. Small arrays lie close or not as it happens: runs would differ by rounding from one to the next.
"""

from __future__ import annotations

from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paraflex.kernel.compiling import routine

# Entries before and behind an array that nobody uses: more than a loop does at once.
ROOM = 128


def apart(shape: int | tuple[int, ...], dtype: type = float) -> NDArray[Any]:
    """Zeros of a shape, padded on both sides."""
    count = shape if isinstance(shape, int) else prod(shape)
    return np.zeros(count + 2 * ROOM, dtype)[ROOM : ROOM + count].reshape(shape)


@routine
def fill(x, value):
    """Set every entry of a vector."""
    for i in range(x.size):
        x[i] = value


@routine
def copy(x, to):
    """Copy a vector."""
    for i in range(x.size):
        to[i] = x[i]


@routine
def add(x, to):
    """Add a vector to another."""
    for i in range(x.size):
        to[i] += x[i]


@routine
def largest(x):
    """Largest magnitude in a vector; zero for an empty one."""
    size = 0.0
    for i in range(x.size):
        size = max(size, abs(x[i]))
    return size
