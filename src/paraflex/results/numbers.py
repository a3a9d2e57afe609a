"""Plain numbers of arrays, for JSON, tables and sentences."""

from __future__ import annotations

import math

import numpy as np
import xarray as xr
from numpy.typing import NDArray


def finite_or_none(value: float) -> float | None:
    """A number for JSON: None if it is not finite."""
    return float(value) if math.isfinite(value) else None


def finite_by_name(values: xr.DataArray, dim: str) -> dict[str, float | None]:
    """Numbers for JSON, by the labels of their only dimension."""
    return {str(name): finite_or_none(values.sel({dim: name}).item()) for name in values[dim].values}


def units_of_each(array: xr.DataArray, number: int) -> list[str]:
    """Units of so many members of a variable: its own of all where it does not say them one by one."""
    each = str(array.attrs.get("units_each", "")).split(", ")
    return each if len(each) == number and each != [""] else [str(array.attrs.get("units", ""))] * number


def largest(values: NDArray[np.float64]) -> float | None:
    """Largest finite magnitude; None if there is none."""
    known = np.abs(values[np.isfinite(values)])
    return float(known.max()) if known.size else None
