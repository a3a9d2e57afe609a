"""Element-wise loops, which Numba compiles faster than slice expressions, and padded arrays.

A compiled loop checks whether the memory it writes lies close to the memory it reads, and if so runs another version of
the loop, which rounds differently. Whether small arrays lie close depends on the allocator, so without padding repeated
runs would differ by rounding.
"""

from collections.abc import Mapping
from functools import cache
from math import prod
from typing import Any, TypeVar, get_type_hints

import numpy as np

from paraflex.arrays import Array, Indices, NDArray
from .compiling import inlined, routine

Floats = Array
Ints = Indices
R = TypeVar("R")
# Unused entries before and after an array: more than a vectorised loop processes at once.
ROOM = 128


def apart(shape: int | tuple[int, ...], dtype: type = float) -> NDArray[Any]:
    """Return an array of zeros of a given shape, padded on both sides in memory."""
    count = shape if isinstance(shape, int) else prod(shape)
    return np.zeros(count + 2 * ROOM, dtype)[ROOM : ROOM + count].reshape(shape)


@cache
def _annotations(record: type) -> dict[str, Any]:
    return get_type_hints(record, include_extras=True)


def allocated(record: type[R], sizes: Mapping[str, int], **given: Any) -> R:
    """Return a record of arrays of zeros, padded on both sides in memory.

    Parameters
    ----------
    record : type
        Class of named tuples. A field annotated as Annotated[Floats, 2, "n"] is an array of the shape (2, n).
    sizes : mapping of str to int
        Sizes by name.
    **given
        Fields that are not allocated here.
    """
    arrays = {}
    for name, kind in _annotations(record).items():
        if name not in given:
            shape = tuple(size if isinstance(size, int) else sizes[size] for size in kind.__metadata__)
            arrays[name] = apart(shape, np.int64 if kind.__origin__ == Ints else float)
    return record(**arrays, **given)


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


@inlined
def last_before(x, low, high, value):
    """Return the index of the last entry not above a value among those from low to high, ascending; low if none is."""
    while low < high:
        middle = (low + high + 1) // 2
        if x[middle] <= value:
            low = middle
        else:
            high = middle - 1
    return low
