"""Values of messages from a page, which may hold anything, and numbers that JSON can hold."""

import math
from collections.abc import Sequence
from typing import Any, TypeVar

from paraflex.errors import InputError, ParaflexError

Message = dict[str, Any]
T = TypeVar("T")
_KINDS = {str: "a text", dict: "a table", list: "a list", bool: "true or false", int: "a whole number"}


def field(message: Any, name: str, kind: type[T]) -> T:
    """Return a field of a message.

    Raises
    ------
    InputError
        Message that is not a table, or field that is missing or of another kind.
    """
    if not isinstance(message, dict):
        raise InputError("a message is not a table", field=name, remedy="send a JSON object")
    found = message.get(name)
    if not isinstance(found, kind) or (isinstance(found, bool) and kind is not bool):
        value = str(found)[:60]
        raise InputError(
            f"is not {_KINDS.get(kind, kind.__name__)}", field=name, value=value, remedy="load the page again"
        )
    return found


def numbers(message: Any, name: str, count: int) -> list[float]:
    """Return a field of a message that is a list of finite numbers; see `field` for the errors."""
    found = field(message, name, list)
    if len(found) != count or not all(isinstance(one, int | float) and math.isfinite(one) for one in found):
        raise InputError(
            f"is not {count} finite numbers", field=name, value=str(found)[:60], remedy="load the page again"
        )
    return [float(one) for one in found]


def table(value: Any, name: str) -> dict[str, Any]:
    """Return a value of a message that is a table; see `field` for the errors."""
    return field({name: value}, name, dict)


def keys(message: Any, name: str) -> list[str | int]:
    """Return a field of a message that is a place in the file: keys and indices; see `field` for the errors."""
    found = field(message, name, list)
    if not all(isinstance(one, str | int) for one in found):
        raise InputError("is not a list of names", field=name, value=str(found)[:60], remedy="load the page again")
    return found


def one_of(value: str, choices: Sequence[str]) -> str:
    """Return a word of a message that is one of the choices; InputError otherwise."""
    if value not in choices:
        raise InputError("unknown", field="what", value=value[:60], remedy=f"choose from {', '.join(choices)}")
    return value


def finite(value: Any) -> Any:
    """Return a value for JSON: None for a number that is not finite, plain numbers and lists for those of NumPy."""
    if isinstance(value, dict):
        return {str(key): finite(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [finite(one) for one in value]
    if hasattr(value, "tolist"):
        return finite(value.tolist())
    return None if isinstance(value, float) and not math.isfinite(value) else value


def described(error: ParaflexError) -> Message:
    """Return an error for the page: its line, the field at fault and the remedy."""
    text = " ".join(str(error).split())
    return {"text": text, "field": getattr(error, "field", ""), "remedy": getattr(error, "remedy", "")}
