"""Compressed numbers for a page, including NaN, which JSON does not have."""

import base64
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np

from paraflex.arrays import ArrayLike, NDArray
from paraflex.contexts import holding

# 16-bit integers: the code of NaN, and the largest magnitude of other values.
MISSING, _LARGEST_CODE = -32768, 32767
# Bits of a single-precision fraction that are dropped: the rest resolves 4e-6 of a value and compresses better.
_DROPPED = 6
# Highest order of differences over frames, and over points; and half the number of frames that decide.
_HIGHEST, _FEW = 3, 16
# Levels of compression for files, and for a page on this machine, which also does not search for the best orders.
_SMALL, _QUICK, _QUICK_ORDERS = 6, 1, (2, 0)
_LEVEL: ContextVar[int] = ContextVar("level of compression", default=_SMALL)


@contextmanager
def quickly() -> Iterator[None]:
    """Provide a context in which numbers are packed in less time and need more space."""
    with holding(_LEVEL, _QUICK):
        yield


@dataclass
class Series:
    """Rows of numbers for curves, each stored once, in single precision.

    Curves of many charts share rows: the time, and quantities that are shown both alone and beside other runs.
    """

    rows: list[bytes] = field(default_factory=list)
    _numbers: dict[bytes, int] = field(default_factory=dict)

    def add(self, values: ArrayLike, *, exact: bool = False) -> int:
        """Add a row of values (k,) unless it is stored already, and return its index.

        Values are rounded to about six digits, or to single precision if `exact` is True.
        """
        with np.errstate(over="ignore"):
            row = np.array(values, dtype="<f4", ndmin=1, copy=True)
        if not exact:
            bits, finite = row.view("<u4"), np.isfinite(row)
            bits[finite] = (bits[finite] + np.uint32(1 << (_DROPPED - 1))) & ~np.uint32((1 << _DROPPED) - 1)
        raw = row.tobytes()
        if raw not in self._numbers:
            self._numbers[raw] = len(self.rows)
            self.rows.append(raw)
        return self._numbers[raw]

    def to_dict(self) -> dict[str, Any]:
        """Return all rows for JSON: their lengths and their compressed bytes."""
        joined = np.frombuffer(b"".join(self.rows), dtype=np.uint8)
        return {"lengths": [len(row) // 4 for row in self.rows], "data": _deflated(joined.reshape(-1, 4))}


def packed(values: ArrayLike) -> dict[str, Any]:
    """Return an array (runs, frames, ...) with last axis x, y for JSON: 16 bits per number, as differences.

    A number is `offset + scale * integer`, with separate offsets for x and y; it is NaN where the integer is MISSING.
    Differences are over frames, and then over points (runs, frames, points, 2), each of the order from none to the
    third with which numbers are smallest: motions are smooth, and beams have smooth shapes. The sign of a difference is
    its lowest bit, so that the higher bytes of small ones are zero.
    """
    array = np.asarray(values, dtype=float)
    flat = array.reshape(-1, array.shape[-1])
    finite = np.isfinite(flat).all(axis=1)
    low, high = (flat[finite].min(axis=0), flat[finite].max(axis=0)) if finite.any() else (np.zeros(2), np.zeros(2))
    offset = 0.5 * (low + high)
    scale = float(0.5 * np.max(high - low) / _LARGEST_CODE) or 1.0
    whole = np.full(array.shape, MISSING, dtype="<i2")
    known = np.isfinite(array).all(axis=-1)
    whole[known] = np.rint((array[known] - offset) / scale)
    orders = _QUICK_ORDERS if _LEVEL.get() == _QUICK else _best_orders(whole)
    signed = _differences(whole, orders)
    data = _deflated(((signed << 1) ^ (signed >> 15)).astype("<i2").view(np.uint8).reshape(-1, 2))
    return {"shape": list(array.shape), "offset": offset.tolist(), "scale": scale, "orders": orders, "data": data}


def _best_orders(whole: NDArray[np.int16]) -> tuple[int, int]:
    """Return the orders with which differences are smallest, by a few frames in the middle."""
    middle = whole.shape[1] // 2
    few = whole[:, max(0, middle - _FEW) : middle + _FEW]
    choices = product(range(_HIGHEST + 1), range(_HIGHEST + 1) if whole.ndim > 3 else [0])
    return min(choices, key=lambda each: _bits(_differences(few, each)))


def _differences(whole: NDArray[np.int16], orders: tuple[int, int]) -> NDArray[np.int16]:
    """Return differences over frames and over points; overflow of integers cancels in the sums."""
    for axis, order in enumerate(orders, start=1):
        for _ in range(order):
            whole = np.diff(whole, axis=axis, prepend=np.int16(0))
    return whole


def _bits(whole: NDArray[np.int16]) -> float:
    """Return the number of bits of integers, as far as they depend on their magnitudes."""
    return float(np.log2(1.0 + np.abs(whole.astype(np.float32))).sum())


def _deflated(numbers: NDArray[np.uint8]) -> str:
    """Compress bytes (numbers, bytes of each) to base64: all first bytes, then all second ones, which is smaller."""
    return deflated(np.ascontiguousarray(numbers.T).tobytes())


def deflated(data: bytes) -> str:
    """Compress bytes to base64."""
    return base64.b64encode(zlib.compress(data, _LEVEL.get())).decode("ascii")
