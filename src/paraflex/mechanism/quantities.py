"""Metadata of the fields of a mechanism's members, and checks of single numbers."""

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import field, fields
from functools import partial
from typing import Any, Literal, cast

from paraflex.errors import InputError, suggestion
from paraflex.limits import of_size, possible

# Motion that a member requires of its joint: an angle, a travel, or either; "exists" for a joint of any kind.
JointThat = Literal["moves", "turns", "slides", "exists"]


def known(name: str, names: Collection[str], field: str, kind: str, problem: str = "") -> None:
    """Raise an `InputError` that suggests the nearest name, unless a name is known; by default "unknown `kind`"."""
    if not isinstance(name, str) or name not in names:
        raise InputError(problem or f"unknown {kind}", field=field, value=name, remedy=suggestion(name, names))


def all_known(given: Iterable[str], names: Collection[str], field: str, kind: str) -> None:
    """Raise an `InputError` that suggests the nearest name, unless all names are known."""
    for name in given:
        known(name, names, field, kind)


def all_listed(given: Iterable[str], names: Collection[str], field: str, problem: str) -> None:
    """Raise an `InputError` that lists all admissible names, unless all names are among them."""
    for name in given:
        if name not in names:
            raise InputError(problem, field=field, value=name, remedy=f"choose from {', '.join(names)}")


def enter_kind(kinds: dict[str, Any], kind: str, member: type, word: str) -> None:
    """Enter a class under its name in files; raise a `TypeError` if another class has the name."""
    if kind in kinds and kinds[kind].__qualname__ != member.__qualname__:
        raise TypeError(f'there is a {word} of kind "{kind}": {kinds[kind].__name__}')
    kinds[kind] = member


def finite(values: float | Iterable[float], field: str) -> None:
    """Raise an `InputError` unless a value, or each of several, is finite and of admissible size."""
    several = isinstance(values, Iterable) and getattr(values, "ndim", 1)
    for value in cast("Iterable[float]", values if several else (values,)):
        of_size(value, field)


def positive(value: float, field: str, unit: str) -> None:
    """Raise an `InputError` unless a value is positive, finite and of a size possible for its unit."""
    if not (math.isfinite(value) and value > 0.0):
        raise InputError("must be positive", field=field, value=value, remedy=f"give it in {unit}")
    possible(value, field, unit)


def not_negative(value: float, field: str, unit: str) -> None:
    """Raise an `InputError` unless a value is zero, or positive, finite and of a size possible for its unit."""
    if not (math.isfinite(value) and value >= 0.0):
        raise InputError("must not be negative", field=field, value=value, remedy=f"give it in {unit}")
    if value:
        possible(value, field, unit)


def not_zero(value: float, field: str, unit: str) -> None:
    """Raise an `InputError` unless a value is not zero, finite and of a size possible for its unit."""
    if not (math.isfinite(value) and value != 0.0):
        raise InputError("must be a finite number other than zero", field=field, value=value, remedy=f"give it {unit}")
    possible(value, field, unit.removeprefix("in "))


def field_metadata(
    description: str, check: Callable[..., None] | None = None, unit: str = "", *, joint: JointThat | None = None
) -> dict[str, Any]:
    """Return the metadata of a member's field for model files, their schema and errors.

    Parameters
    ----------
    description : str
        Description of the field in the schema, with its unit after "in".
    check : callable, optional
        Check of a value that is not None: `finite`, or `positive`, `not_negative` or `not_zero`, which need a unit.
    unit : str
        Unit that the remedy of the check's error asks for, by default the last in the description.
    joint : "moves", "turns", "slides" or "exists", optional
        Motion required of a joint, if the field is the name of one.
    """
    if check is not None and check in (positive, not_negative, not_zero):
        check = partial(check, unit=unit or description.rpartition(" in ")[2].partition(",")[0])
    return {"description": description, "check": check, "joint": joint}


def optional(default: Any, description: str, check: Callable[..., None] | None = None, unit: str = "") -> Any:
    """Return a dataclass field with a default value and with the metadata of the other arguments."""
    value: Any = {"default_factory": dict} if default == {} else {"default": default}
    return field(**value, metadata=field_metadata(description, check, unit))


AT_JOINT = field_metadata("the name of a joint", joint="moves")


def check_numbers(member: Any, place: str = "") -> None:
    """Check the numbers of a member at a place of a file by the metadata of their fields."""
    for each in fields(member):
        check, value = each.metadata.get("check"), getattr(member, each.name)
        if check is not None and value is not None:
            check(value, f"{place}.{each.name}".lstrip("."))


def joints_named(member: Any) -> Iterator[tuple[str, str, JointThat]]:
    """Yield the joints that a member refers to, as field in files, name and required motion."""
    together = joint_pair(member)
    for each in fields(member):
        if does := each.metadata.get("joint"):
            named = getattr(member, each.name)
            for name in named if isinstance(named, Mapping) else (named,):
                yield "joints" if together else each.name, name, does


def joint_pair(member: Any) -> list[str]:
    """Return the fields of a member, or of its class, that name two joints (`joints` in files); empty if it has one."""
    named = [each.name for each in fields(member) if each.metadata.get("joint")]
    return named if len(named) > 1 else []
