"""Conversion of a record of arrays to one vector of its numbers and back, to differentiate by all of them at once."""

from collections.abc import Iterator
from typing import Any, TypeVar

import numpy as np

from paraflex.arrays import Array, Records

R = TypeVar("R", bound=tuple[Any, ...])


def numbers_of(record: tuple[Any, ...]) -> Array:
    """Return every floating-point number of a named tuple of arrays, records and numbers, in order, as a vector."""
    return np.concatenate([np.zeros(0), *(np.ravel(part) for part in _parts(record))])


def with_numbers(record: R, numbers: Array) -> R:
    """Return the named tuple with other numbers, ordered as by `numbers_of`; integers are unchanged."""
    ends = np.cumsum([np.size(part) for part in _parts(record)])
    parts = iter(np.split(numbers, ends))
    return type(record)(*(_replaced(field, parts) for field in record))


def same_layout(a: tuple[Any, ...], b: tuple[Any, ...]) -> bool:
    """Return whether two named tuples of a kind differ in their floating-point numbers only."""
    return all(_same(x, y) for x, y in zip(a, b, strict=True))


def _parts(record: tuple[Any, ...]) -> Iterator[Any]:
    for field in record:
        if isinstance(field, float | complex):
            yield np.array([field])
        elif isinstance(field, np.ndarray):
            if field.dtype.names is not None:
                yield from (field[name] for name in _floating(field))
            elif field.dtype.kind in "fc":
                yield field


def _replaced(field: Any, parts: Iterator[Array]) -> Any:
    if isinstance(field, float):
        return next(parts).item()
    if not isinstance(field, np.ndarray) or (field.dtype.names is None and field.dtype.kind != "f"):
        return field
    if field.dtype.names is None:
        return next(parts).reshape(field.shape).copy()
    new = field.copy()
    for name in _floating(field):
        new[name] = next(parts)
    return new


def _same(x: Any, y: Any) -> bool:
    if not isinstance(x, np.ndarray):
        return type(x) is type(y)
    if x.shape != y.shape or x.dtype != y.dtype:
        return False
    if x.dtype.names is not None:
        return all(np.array_equal(x[name], y[name]) for name in x.dtype.names if name not in _floating(x))
    return x.dtype.kind == "f" or bool(np.array_equal(x, y))


def _floating(records: Records) -> list[str]:
    names = records.dtype.names or ()
    return [name for name in names if records.dtype[name].kind in "fc"]
