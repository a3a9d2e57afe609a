"""Checks of single numbers that the checks of mechanisms and bodies share."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable

from paraflex.errors import InputError, suggestion


def known(name: str, names: Collection[str], field: str, kind: str) -> None:
    """Raise an `InputError`, with the nearest, unless a name is one of those there are."""
    if not isinstance(name, str) or name not in names:
        raise InputError(f"unknown {kind}", field=field, value=name, remedy=suggestion(name, names))


def finite(values: Iterable[float], field: str) -> None:
    """Raise an `InputError` unless all values are finite."""
    for value in values:
        if not math.isfinite(value):
            raise InputError("not a finite number", field=field, value=value, remedy="give a number")


def positive(value: float, field: str, unit: str) -> None:
    """Raise an `InputError` unless a value is positive and finite."""
    if not (math.isfinite(value) and value > 0.0):
        raise InputError("must be positive", field=field, value=value, remedy=f"give it in {unit}")


def not_negative(value: float, field: str, unit: str) -> None:
    """Raise an `InputError` unless a value is zero or positive and finite."""
    if not (math.isfinite(value) and value >= 0.0):
        raise InputError("must not be negative", field=field, value=value, remedy=f"give it in {unit}")
