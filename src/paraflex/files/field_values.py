"""Explicit fields of a description, those that differ from their defaults, and checks of given fields."""

from collections.abc import Mapping
from dataclasses import MISSING, fields
from typing import Any

from paraflex.errors import InputError


def changed_fields(given: Any, *left_out: str) -> dict[str, Any]:
    """Return the fields of a dataclass that differ from their defaults, without those in `left_out`."""
    out = {}
    for field in fields(given):
        value = getattr(given, field.name)
        default = field.default if field.default_factory is MISSING else field.default_factory()
        if field.name not in left_out and (default is MISSING or value != default):
            out[field.name] = value
    return out


def check_fields(kind: type, given: Mapping[str, Any], what: str, place: str, *left_out: str) -> None:
    """Check the fields of a table against those of its class, without those in `left_out`.

    Parameters
    ----------
    kind : type
        Class.
    given : mapping
        Fields of the table.
    what, place : str
        Name of the object and place of the table, for errors.
    *left_out : str
        Fields of the class that are not in the table.

    Raises
    ------
    InputError
        Field that the class does not have, or missing required field.
    """
    own = {each.name: each for each in fields(kind) if each.name not in left_out}
    for key, value in given.items():
        if key not in own:
            raise InputError(f"a {what} has no {key}", field=f"{place}.{key}", value=value, remedy="leave it out")
    for key, each in own.items():
        if each.default is MISSING and key not in given:
            raise InputError(
                "is missing", field=f"{place}.{key}", remedy=f"give {each.metadata.get('description', 'it')}"
            )


def inexpressible(field: str, value: object, remedy: str) -> InputError:
    """Return the error for a part of a model that cannot be expressed in a file."""
    return InputError("a model file cannot express this", field=field, value=value, remedy=remedy)
