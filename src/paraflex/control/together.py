"""Names and periods of controllers that act together."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from paraflex.errors import InputError

# Instants closer than this part of the shortest period are one.
SAME = 1e-9


def whole_and_part(periods: float) -> tuple[int, float]:
    """A number of periods as whole ones, and what is left as a part of one: none to rounding."""
    nearest = round(periods)
    if abs(periods - nearest) <= SAME * max(1.0, nearest):
        return nearest, 0.0
    return math.floor(periods), periods - math.floor(periods)


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
