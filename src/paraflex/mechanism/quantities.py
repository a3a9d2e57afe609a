"""Metadata of fields of members of a mechanism, and checks of single numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import field, fields
from functools import partial
from typing import Any, Literal, cast

from paraflex.errors import InputError, suggestion
from paraflex.limits import of_size, possible

# Motions of joints that members name: an angle, a travel, or either; "exists" for a joint of any kind.
JointThat = Literal["moves", "turns", "slides", "exists"]


def known(name: str, names: Collection[str], field: str, kind: str) -> None:
    """Raise an `InputError` that names the nearest name, unless a name is a known one."""
    if not isinstance(name, str) or name not in names:
        raise InputError(f"unknown {kind}", field=field, value=name, remedy=suggestion(name, names))


def all_known(given: Iterable[str], names: Collection[str], field: str, kind: str) -> None:
    """Raise an `InputError` that names the nearest name, unless all names are known ones."""
    for name in given:
        known(name, names, field, kind)


def finite(values: float | Iterable[float], field: str) -> None:
    """Raise an `InputError` unless a value, or each of several, is finite and of a size that is possible."""
    several = isinstance(values, Iterable) and getattr(values, "ndim", 1)
    for value in cast("Iterable[float]", values if several else (values,)):
        of_size(value, field)


def positive(value: float, field: str, unit: str) -> None:
    """Raise an `InputError` unless a value is positive and finite."""
    if not (math.isfinite(value) and value > 0.0):
        raise InputError("must be positive", field=field, value=value, remedy=f"give it in {unit}")
    possible(value, field, unit)


def not_negative(value: float, field: str, unit: str) -> None:
    """Raise an `InputError` unless a value is zero or positive and finite."""
    if not (math.isfinite(value) and value >= 0.0):
        raise InputError("must not be negative", field=field, value=value, remedy=f"give it in {unit}")
    if value:
        possible(value, field, unit)


def not_zero(value: float, field: str, unit: str) -> None:
    """Raise an `InputError` unless a value is finite and not zero."""
    if not (math.isfinite(value) and value != 0.0):
        raise InputError("must be a finite number other than zero", field=field, value=value, remedy=f"give it {unit}")
    possible(value, field, unit.removeprefix("in "))


def said(
    description: str, check: Callable[..., None] | None = None, unit: str = "", *, joint: JointThat | None = None
) -> dict[str, Any]:
    """Metadata of a member's field for model files, their schema and errors, with the unit behind "in".

    A number is checked, unless it is None, by `finite`, or with a unit to ask for by `positive`, `not_negative` or
    `not_zero`; a name may be that of a joint that moves, turns, slides, or of any kind.
    """
    checked = partial(check, unit=unit) if check is not None and unit else check
    return {"description": description, "check": checked, "joint": joint}


def optional(default: Any, description: str, check: Callable[..., None] | None = None, unit: str = "") -> Any:
    """The field of a member that need not be given; see `said`."""
    return field(default=default, metadata=said(description, check, unit))


def in_unit(check: Callable[..., None], unit: str) -> dict[str, Any]:
    """Metadata of a number that a check asks for in a unit."""
    return {"check": partial(check, unit=unit)}


AT_JOINT = said("the name of a joint", joint="moves")


def check_numbers(member: Any, place: str) -> None:
    """Check the numbers of a member by the metadata of their fields."""
    for each in fields(member):
        check, value = each.metadata.get("check"), getattr(member, each.name)
        if check is not None and value is not None:
            check(value, f"{place}.{each.name}")


def joints_named(member: Any) -> Iterator[tuple[str, str, JointThat]]:
    """Joints that a member names, each with its field in files and the motion that it must have."""
    together = joint_pair(member)
    for each in fields(member):
        if does := each.metadata.get("joint"):
            named = getattr(member, each.name)
            for name in named if isinstance(named, Mapping) else (named,):
                yield "joints" if together else each.name, name, does


def joint_pair(member: Any) -> list[str]:
    """Fields of a member, or of its class, that name two joints: `joints` in files. None if it names one."""
    named = [each.name for each in fields(member) if each.metadata.get("joint")]
    return named if len(named) > 1 else []
