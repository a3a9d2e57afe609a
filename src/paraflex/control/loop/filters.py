"""Filters as users specify them: a cut-off frequency or a transfer function."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from paraflex.arrays import Array
from paraflex.errors import InputError
from paraflex.mechanism.quantities import positive

# Filter specification: cut-off frequency [Hz] of a first-order low-pass filter, or coefficients of numerator and
# denominator in descending powers of s.
Filter = float | tuple[Sequence[float], Sequence[float]]


def transfer_function(value: Any, field: str) -> tuple[Array, Array]:
    """Return the coefficients of numerator and denominator, in descending powers of s.

    Parameters
    ----------
    value : Filter
        Cut-off frequency [Hz] of a first-order low-pass filter, a pair (numerator, denominator), or a transfer function
        with attributes `num` and `den`.
    field : str
        Name of the field for errors.

    Raises
    ------
    InputError
        A value of none of these kinds, or a transfer function that is not proper or not stable.
    """
    if all(hasattr(value, name) for name in ("num", "den")):
        value = (np.ravel(value.num), np.ravel(value.den))
    if isinstance(value, int | float):
        positive(value, field, "Hz")
        rate = 2.0 * np.pi * value
        return np.array([rate]), np.array([1.0, rate])
    try:
        numerator, denominator = (np.trim_zeros(np.atleast_1d(np.asarray(each, dtype=float)), "f") for each in value)
    except (TypeError, ValueError):
        numerator = denominator = np.zeros(0)
    proper = 0 < numerator.size <= denominator.size and denominator.size > 1
    if not proper or not np.all(np.isfinite([*numerator, *denominator])):
        raise InputError(
            "is not a filter", field=field, value=value,
            remedy="give a cut-off frequency in Hz, or coefficients (numerator, denominator) in descending powers of s",
        )  # fmt: skip
    if np.any(np.roots(denominator).real >= 0.0):
        raise InputError("is not stable", field=field, value=value,
                         remedy="give a denominator whose roots have negative real parts")  # fmt: skip
    return numerator, denominator
