"""Names and periods of controllers that act together."""

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from paraflex.arrays import Array
from paraflex.errors import InputError
from paraflex.limits import SAMPLES
from paraflex.mechanism.quantities import all_known, known, positive

# Names of the references: the planned motion, and the readings where the planned torques alone drive the flexible
# mechanism.
PLAN, OPEN_LOOP = "plan", "open-loop"
# One number for all names, or numbers by name.
Numbers = float | Mapping[str, float]
# Instants closer than this fraction of the shortest period are regarded as equal.
SAME = 1e-9
_MOST_PERIODS = 10 * SAMPLES


def is_number(value: Any) -> bool:
    """Whether a value is a real number other than NaN."""
    return isinstance(value, int | float | np.floating | np.integer) and not isinstance(value, bool) and value == value


def checked_number(value: Any, field: str, unit: str, check: Callable[..., None] = positive) -> float:
    """Return a number as a float after a check, such as `positive`.

    Parameters
    ----------
    value : any
        Value to be checked.
    field, unit : str
        Field and unit for errors.
    check : callable
        Function of value, field and unit that raises an `InputError`.

    Raises
    ------
    InputError
        A value that is missing, is not a number, or does not pass the check.
    """
    if value is None or not is_number(value):
        raise InputError("is missing" if value is None else "is not a number", field=field, value=value,
                         remedy=f"give it in {unit}")  # fmt: skip
    check(float(value), field, unit)
    return float(value)


def by_name(
    given: Any, names: Sequence[str], field: str, what: str, take: Callable[[Any, str], Any]
) -> dict[str, Any]:  # fmt: skip
    """Return values by name, from a mapping or from one value for all names.

    Parameters
    ----------
    given : any or mapping of str to any
        One value for all names, or values by name.
    names : sequence of str
        Known names.
    field, what : str
        Field for errors, and the kind of object that is named.
    take : callable
        Function of a value and its field that returns the converted value, or raises.

    Raises
    ------
    InputError
        An unknown name.
    """
    if not isinstance(given, Mapping):
        return dict.fromkeys(names, take(given, field))
    all_known(given, names, field, what)
    return {name: take(value, f"{field}.{name}") for name, value in given.items()}


def numbers_by_name(
    given: Any, names: Sequence[str], field: str, unit: str, check: Callable[..., None] = positive
) -> dict[str, float]:
    """Return numbers by name, from a mapping or from one number for all: see `by_name` and `checked_number`."""
    return by_name(given, names, field, "name", partial(checked_number, unit=unit, check=check))


def check_distinct(names: Sequence[str], among: Collection[str], field: str, what: str) -> None:
    """Check that names are among others, and that none is given twice.

    Raises
    ------
    InputError
        An unknown name, or one given twice.
    """
    for k, name in enumerate(names):
        known(name, among, field, what)
        if name in names[:k]:
            raise InputError("is named twice", field=field, value=name, remedy="name it once")


def whole_and_part(periods: float) -> tuple[int, float]:
    """Split a number of periods into whole periods and a fraction, which is zero if within rounding."""
    nearest = round(periods)
    if abs(periods - nearest) <= SAME * max(1.0, nearest):
        return nearest, 0.0
    return math.floor(periods), periods - math.floor(periods)


def same_period(one: float, other: float) -> bool:
    """Whether two periods are equal to rounding."""
    return abs(one - other) <= SAME * other


def multiple_of(name: str, period: float, shortest: float) -> int:
    """Return the period of a controller as a multiple of the shortest period, both in [s].

    Raises
    ------
    InputError
        A period that is not a multiple of the shortest one.
    """
    times = period / shortest
    if abs(times - round(times)) > SAME * times:
        raise InputError(
            f"is not a multiple of the shortest period, {shortest:g} s", field=f"{name}.period", value=period,
            remedy=f"give {round(times) * shortest:g}",
        )  # fmt: skip
    return round(times)


def check_name(name: Any) -> None:
    """Check that a controller's name can be used in result files and in names of fields.

    Raises
    ------
    InputError
        A name that is not a text, is empty, or contains dots or slashes.
    """
    if not isinstance(name, str) or not name or set(name) & set("./"):
        raise InputError("is not a name for a controller", field="name", value=name,
                         remedy="give a text without dots and slashes")  # fmt: skip


def check_whole(names: Sequence[str]) -> None:
    """Check that at most one controller gives the whole torque, given the names of those that do.

    Raises
    ------
    InputError
        Two such controllers, which would drive the mechanism twice.
    """
    if len(names) > 1:
        raise InputError(
            f'gives the whole torque, as "{names[0]}" does', field=names[1],
            remedy="let one of the two act, or put a feedback law beside it",
        )  # fmt: skip


def periods_in(duration: float, period: float) -> int:
    """Return the number of periods in a duration [s], at least one; a last one shorter than `SAME` of one is dropped.

    Raises
    ------
    InputError
        More samples than memory can hold.
    """
    if duration / period > _MOST_PERIODS:
        raise InputError("is too short for the duration: more samples than memory holds", field="period", value=period,
                         remedy=f"at least {duration / _MOST_PERIODS:.2g} s")  # fmt: skip
    return max(1, math.ceil(duration / period - SAME))


def real_numbers(given: Any) -> Array | None:
    """Return torques of a law or user as an array of floats; None if they are not real numbers."""
    try:
        return None if given is None or np.iscomplexobj(given) else np.asarray(given, dtype=float)
    except (TypeError, ValueError, OverflowError):
        return None
