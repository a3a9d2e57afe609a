"""The numbers of a record of arrays as one vector, and back: to differentiate all of them at once."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

# Matrices of so few rows hold another quantity in each.
_SHORT = 6

R = TypeVar("R", bound=tuple)


def numbers_of(record: tuple) -> NDArray[np.float64]:
    """Every floating-point number of a named tuple of arrays, records and numbers, in order: a vector."""
    return np.concatenate([np.zeros(0), *(np.ravel(part) for part in _parts(record))])


def blocks_of(record: tuple, numbers: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Numbers in the order of `numbers_of` by what they are: each field of a record, each row of a short matrix."""
    blocks, at = [], 0
    for part in _parts(record):
        rows = part.shape[0] if part.ndim == 2 and part.shape[0] <= _SHORT else 1
        blocks += np.split(numbers[at : at + part.size], rows)
        at += part.size
    return blocks


def with_numbers(record: R, numbers: NDArray[np.float64]) -> R:
    """The same named tuple with other numbers, as `numbers_of` orders them; whole numbers stay."""
    fields, at = [], 0
    for field in record:
        new, at = _replaced(field, numbers, at)
        fields.append(new)
    return type(record)(*fields)


def same_layout(a: tuple, b: tuple) -> bool:
    """Whether two named tuples of a kind differ in nothing but their floating-point numbers."""
    return all(_same(x, y) for x, y in zip(a, b, strict=True))


def _parts(record: tuple) -> Iterator[Any]:
    for field in record:
        if isinstance(field, float | complex):
            yield np.array([field])
        elif isinstance(field, np.ndarray):
            if field.dtype.names is not None:
                yield from (field[name] for name in _floating(field))
            elif field.dtype.kind in "fc":
                yield field


def _replaced(field: Any, numbers: NDArray[np.float64], at: int) -> tuple[Any, int]:
    if isinstance(field, float):
        return float(numbers[at]), at + 1
    if not isinstance(field, np.ndarray) or (field.dtype.names is None and field.dtype.kind != "f"):
        return field, at
    if field.dtype.names is None:
        return numbers[at : at + field.size].reshape(field.shape).copy(), at + field.size
    new = field.copy()
    for name in _floating(field):
        new[name] = numbers[at : at + field.size]
        at += field.size
    return new, at


def _same(x: Any, y: Any) -> bool:
    if not isinstance(x, np.ndarray):
        return type(x) is type(y)
    if x.shape != y.shape or x.dtype != y.dtype:
        return False
    if x.dtype.names is not None:
        return all(np.array_equal(x[name], y[name]) for name in x.dtype.names if name not in _floating(x))
    return x.dtype.kind == "f" or bool(np.array_equal(x, y))


def _floating(records: NDArray[np.void]) -> list[str]:
    names = records.dtype.names or ()
    return [name for name in names if records.dtype[name].kind in "fc"]
