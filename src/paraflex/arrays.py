"""Types of numeric arrays for annotations, with the shapes in docstrings, and representations of objects of arrays."""

from collections.abc import Collection, Mapping
from dataclasses import fields, is_dataclass
from reprlib import recursive_repr
from typing import Any

import numpy as np
from numpy.typing import ArrayLike as ArrayLike, NDArray as NDArray

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
# Real, or complex where a complex step carries a derivative.
Numbers = NDArray[Any]
Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]
# Records of the kernels: arrays with named fields.
Records = NDArray[np.void]

# Longest representation with all values in full, and longest value beside others that are not [characters].
_WHOLE, _VALUE = 600, 60
# Largest number of elements of an array given in full.
_FEW = 4


class Brief:
    """Base class of dataclasses with short representations: long values are given by their class, name or shape."""

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        # A dataclass keeps the representation that it finds in its class.
        if "__repr__" not in vars(cls):
            setattr(cls, "__repr__", brief)  # noqa: B010  type checkers take an assignment for a field


def brief(self: Any) -> str:
    """Return the representation of a dataclass or named tuple: all values if they are short, else each abbreviated."""
    texts = {name: _in_full(value) for name, value in _values(self)}
    if sum(map(len, (*texts, *texts.values()))) > _WHOLE:
        texts = {name: _abbreviated(getattr(self, name), text) for name, text in texts.items()}
    return f"{type(self).__qualname__}({', '.join(f'{name}={text}' for name, text in texts.items())})"


def whole(value: Any) -> str:
    """Return a text with all values of dataclasses, also of those in collections."""
    if is_dataclass(value):
        value = [type(value).__qualname__, *_values(value)]
    elif isinstance(value, Mapping):
        value = list(value.items())
    return f"({', '.join(map(whole, value))})" if isinstance(value, tuple | list) else repr(value)


def _values(record: Any) -> list[tuple[str, Any]]:
    shown = [each.name for each in fields(record) if each.repr] if is_dataclass(record) else ()
    return [(name, getattr(record, name)) for name in shown or getattr(record, "_fields", ())]


@recursive_repr()
def _in_full(value: Any) -> str:
    shape = getattr(value, "shape", ())
    if isinstance(shape, tuple) and (len(shape) > 1 or max(shape, default=0) > _FEW):
        return f"array({', '.join(map(str, shape))})"
    return " ".join(repr(value).split())


def _abbreviated(value: Any, text: str) -> str:
    if len(text) <= _VALUE:
        return text
    if isinstance(value, str):
        return f"{text[: _VALUE - 3]}..."
    if isinstance(value, Collection) and type(value).__module__ in ("builtins", "types"):
        kinds = {type(each).__name__ for each in (value.values() if isinstance(value, Mapping) else value)}
        return f"<{len(value)} {kinds.pop() if len(kinds) == 1 else 'values'}>"
    name = getattr(value, "name", "")
    return f"{type(value).__name__}({repr(name) if isinstance(name, str) and name else '...'})"
