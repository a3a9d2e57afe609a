"""Fields that a description says, as against those that are as they are by default."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import MISSING, Field, fields
from typing import Any

from paraflex.errors import InputError


def fields_said(given: Any, *left_out: str) -> dict[str, Any]:
    """The fields of a dataclass that are not as they are by default."""
    out = {}
    for field in fields(given):
        value = getattr(given, field.name)
        default = field.default if field.default_factory is MISSING else field.default_factory()
        if field.name not in left_out and (default is MISSING or value != default):
            out[field.name] = value
    return out


def check_fields(
    given: Mapping[str, Any],
    own: Mapping[str, Field[Any]],
    what: str,
    place: str,
    described: Callable[[Field[Any]], str],
) -> None:
    """Refuse what a table gives and its class does not have, and what the class needs and is not given."""
    for key, value in given.items():
        if key not in own:
            raise InputError(f"a {what} has no {key}", field=f"{place}.{key}", value=value, remedy="leave it out")
    for key, each in own.items():
        if each.default is MISSING and key not in given:
            raise InputError("is missing", field=f"{place}.{key}", remedy=f"give {described(each)}")


def unsayable(field: str, value: object, remedy: str) -> InputError:
    """The error for what a model has and its file has no words for."""
    return InputError("a model file cannot say this", field=field, value=value, remedy=remedy)
