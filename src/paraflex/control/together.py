"""Names and periods of controllers that act together."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from paraflex.arrays import Array
from paraflex.errors import InputError
from paraflex.limits import SAMPLES
from paraflex.mechanism.quantities import all_known, known, positive

# One number, or one for each of some names.
Numbers = float | Mapping[str, float]
# Instants closer than this part of the shortest period are one.
SAME = 1e-9
_MOST_PERIODS = 10 * SAMPLES


def is_number(value: Any) -> bool:
    """Whether a value is a real number, not NaN."""
    return isinstance(value, int | float | np.floating | np.integer) and not isinstance(value, bool) and value == value


def checked_number(value: Any, field: str, unit: str, check: Callable[..., None] = positive) -> float:
    """A number in a unit that passes a check, such as `positive`.

    Raises
    ------
    InputError
        It is missing, is no number, or does not pass.
    """
    if value is None or not is_number(value):
        raise InputError("is missing" if value is None else "is no number", field=field, value=value,
                         remedy=f"give it in {unit}")  # fmt: skip
    check(float(value), field, unit)
    return float(value)


def by_name(
    given: Any, names: Sequence[str], field: str, what: str, take: Callable[[Any, str], Any]
) -> dict[str, Any]:  # fmt: skip
    """What is given by name, or of every name where one value is given for all.

    Parameters
    ----------
    given : any or mapping of str to any
    names : sequence of str
    field, what : str
        For errors: the field, and what is named.
    take : callable
        Of a value and its field gives what it stands for, or raises.

    Raises
    ------
    InputError
        A name that is none of them.
    """
    if not isinstance(given, Mapping):
        return dict.fromkeys(names, take(given, field))
    all_known(given, names, field, what)
    return {name: take(value, f"{field}.{name}") for name, value in given.items()}


def numbers_by_name(
    given: Any, names: Sequence[str], field: str, unit: str, check: Callable[..., None] = positive
) -> dict[str, float]:
    """Numbers by name, of every name where one number is given for all: see `by_name` and `checked_number`."""
    return by_name(given, names, field, "name", partial(checked_number, unit=unit, check=check))


def check_distinct(names: Sequence[str], among: Collection[str], field: str, what: str) -> None:
    """Check that names are some of others, each named once.

    Raises
    ------
    InputError
        One that is not among them, or that is given twice.
    """
    for k, name in enumerate(names):
        known(name, among, field, what)
        if name in names[:k]:
            raise InputError("is named twice", field=field, value=name, remedy="name it once")


def whole_and_part(periods: float) -> tuple[int, float]:
    """A number of periods as whole ones, and what is left as a part of one: none to rounding."""
    nearest = round(periods)
    if abs(periods - nearest) <= SAME * max(1.0, nearest):
        return nearest, 0.0
    return math.floor(periods), periods - math.floor(periods)


def same_period(one: float, other: float) -> bool:
    """Whether two periods are the same but for rounding."""
    return abs(one - other) <= SAME * other


def multiple_of(name: str, period: float, shortest: float) -> int:
    """How many shortest periods [s] the period of a controller is [s].

    Raises
    ------
    InputError
        It is no multiple of them.
    """
    times = period / shortest
    if abs(times - round(times)) > SAME * times:
        raise InputError(
            f"is no multiple of the shortest period, {shortest:g} s", field=f"{name}.period", value=period,
            remedy=f"say {round(times) * shortest:g}",
        )  # fmt: skip
    return round(times)


def check_name(name: Any) -> None:
    """Check that a controller's name can stand in files of results, and in names of fields.

    Raises
    ------
    InputError
        It cannot.
    """
    if not isinstance(name, str) or not name or set(name) & set("./"):
        raise InputError("is no name of a controller", field="name", value=name,
                         remedy="give a text without dots and slashes")  # fmt: skip


def check_whole(names: Sequence[str]) -> None:
    """Check that no more than one controller gives the whole torque, by the names of those that do.

    Raises
    ------
    InputError
        Two of them, which would drive the mechanism twice.
    """
    if len(names) > 1:
        raise InputError(
            f'gives the whole torque, as "{names[0]}" does', field=names[1],
            remedy="let one of the two act, or put a feedback law beside it",
        )  # fmt: skip


def periods_in(duration: float, period: float) -> int:
    """Number of periods in a duration [s], at least one; a last one of less than `SAME` of one does not count.

    Raises
    ------
    InputError
        More than memory holds samples of.
    """
    if duration / period > _MOST_PERIODS:
        raise InputError("is too short for the duration: more samples than memory holds", field="period", value=period,
                         remedy=f"at least {duration / _MOST_PERIODS:.2g} s")  # fmt: skip
    return max(1, math.ceil(duration / period - SAME))


def real_numbers(given: Any) -> Array | None:
    """An array of what a law or user gives as torques; None of what are no real numbers."""
    try:
        return None if np.iscomplexobj(given) else np.asarray(given, dtype=float)
    except (TypeError, ValueError, OverflowError):
        return None
