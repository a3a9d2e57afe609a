"""Conversion of arrays to plain numbers for JSON, tables and sentences."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from paraflex.arrays import Array, Numbers

if TYPE_CHECKING:
    import xarray as xr


def finite_or_none(value: float) -> float | None:
    """Return a number for JSON, None if it is not finite."""
    return float(value) if math.isfinite(value) else None


def plain(value: Any) -> Any:
    """Return a value for JSON, None for a float that is not finite."""
    return finite_or_none(value) if isinstance(value, float) else value


def largest(values: Array) -> float | None:
    """Return the largest finite magnitude, None if there is none."""
    known = np.abs(values[np.isfinite(values)])
    return float(known.max()) if known.size else None


def single(values: Array) -> Numbers:
    """Return numbers in single precision, or unchanged if one of them would overflow."""
    return values if (largest(values) or 0.0) > float(np.finfo(np.float32).max) else values.astype(np.float32)


def units_of_each(array: xr.DataArray, number: int) -> list[str]:
    """Return the unit of each of `number` members of a variable: from `units_each`, else the common `units`."""
    each = str(array.attrs.get("units_each", "")).split(", ")
    return each if len(each) == number and each != [""] else [str(array.attrs.get("units", ""))] * number


def name_units(array: xr.DataArray, units: Sequence[str], each: Sequence[str]) -> None:
    """Write the units of a variable; if there are several, also `units_each`, one for each label in their order."""
    array.attrs["units"] = ", ".join(units)
    if len(units) > 1:
        array.attrs["units_each"] = ", ".join(each)


def by_label(values: xr.DataArray, dim: str) -> dict[str, float | None]:
    """Return the numbers of an array by the labels of its dimension for JSON, None for those that are not finite."""
    return {str(name): finite_or_none(values.sel({dim: name}).item()) for name in values[dim].values}


def stacked(parts: Sequence[Any], samples: int, *rest: int) -> Any:
    """Stack arrays (samples, ...) along a new second axis, which has length zero if there are none."""
    return np.stack(parts, axis=1) if parts else np.zeros((samples, 0, *rest))
