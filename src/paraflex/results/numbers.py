"""Plain numbers of arrays, for JSON, tables and sentences."""

from __future__ import annotations

import math

import numpy as np

from paraflex.arrays import Array


def finite_or_none(value: float) -> float | None:
    """A number for JSON: None if it is not finite."""
    return float(value) if math.isfinite(value) else None


def largest(values: Array) -> float | None:
    """Largest finite magnitude; None if there is none."""
    known = np.abs(values[np.isfinite(values)])
    return float(known.max()) if known.size else None
