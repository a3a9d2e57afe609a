"""Checks and conversions of arguments and dataclass fields by their annotations.

Errors name the argument or field. The expected types come from the annotations of a function decorated with
`checked_arguments`, or of the fields of a dataclass derived from `CheckedFields`. Ranges of numbers and existence of
names are checked where the values are used.
"""

import collections.abc as abc
import sys
import typing
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import cache, reduce, wraps
from inspect import signature
from numbers import Integral, Real
from operator import or_
from pathlib import PurePath
from types import NoneType, UnionType
from typing import Any, ParamSpec, TypeVar

import numpy as np

from .arrays import Brief
from .errors import InputError, as_enum

P = ParamSpec("P")
R = TypeVar("R")
C = TypeVar("C")

_UNIONS = (typing.Union, UnionType)
_LISTS = (tuple, list, abc.Sequence, abc.Iterable)
_TABLES = (dict, abc.Mapping)
# NumPy kinds of real numbers, and the largest integer of compiled code (int64).
_REAL, _MOST = tuple("biuf"), 2**63 - 1

# Converter: takes a value and the name of its field, returns the converted value or raises an InputError.
Take = Callable[[Any, str], Any]


def checked_arguments(**remedies: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Return a decorator that converts and checks the arguments of a function by their annotations.

    Parameters
    ----------
    **remedies : str
        Remedies in errors, by argument name, for arguments whose type does not show how to obtain one: "give a
        dataset, as ... makes it".

    Raises
    ------
    InputError
        Raised by the decorated function if an argument has another type than its annotation.
    """

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        names = tuple(signature(function).parameters)

        @wraps(function)
        def checked(*args: P.args, **kwargs: P.kwargs) -> R:
            takes = _of_function(function)
            given: list[Any] = list(args)
            named: dict[str, Any] = dict(kwargs)
            try:
                for k, name in enumerate(names[: len(given)]):
                    if name in takes:
                        given[k] = takes[name](given[k], name)
                for name, value in named.items():
                    if name in takes:
                        named[name] = takes[name](value, name)
            except InputError as error:
                raise error.advising(remedies.get(error.field, error.remedy)) from None
            return function(*given, **named)  # type: ignore[reportCallIssue]

        return checked

    return decorate


class CheckedFields(Brief):
    """Base class of dataclasses whose fields are converted and checked by their annotations.

    A dataclass that defines `__post_init__` calls this one first. Errors prefix the field with `_table`, and with the
    name of the object if it has one.
    """

    _table = ""
    # Fields that the class checks itself, with its own error messages.
    _own: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name, take in _of_class(type(self)).items():
            value = getattr(self, name)
            taken = take(value, _Field(self, name))  # type: ignore[arg-type]
            if taken is not value:
                object.__setattr__(self, name, taken)


def with_fields(record: C, **changes: Any) -> C:
    """Return a copy of a dataclass with other field values, like `replace` but unchecked: complex numbers pass."""
    new = object.__new__(type(record))
    for each in fields(record):  # pyright: ignore[reportArgumentType]
        object.__setattr__(new, each.name, changes.get(each.name, getattr(record, each.name)))
    return new


class _Field:
    """Name of a field, composed only if an error needs it."""

    __slots__ = ("name", "owner")

    def __init__(self, owner: CheckedFields, name: str) -> None:
        self.owner, self.name = owner, name

    def __str__(self) -> str:
        own = getattr(self.owner, "name", "")
        parts = (self.owner._table, own if isinstance(own, str) and self.owner._table else "", self.name)
        return ".".join(part for part in parts if part)


def refused(value: object, field: object, what: str, remedy: str) -> InputError:
    """Return the error for a value of a wrong type.

    Parameters
    ----------
    value : object
        Offending value; None is reported as missing.
    field : object
        Name of the field, converted with `str`.
    what : str
        Noun of the expected type, as in "a number".
    remedy : str
        Value to give instead.
    """
    if value is None:
        return InputError("is not given", field=str(field), remedy=remedy)
    return InputError(f"not {what}", field=str(field), value=value, remedy=remedy)


@cache
def _of_function(function: Callable[..., Any]) -> dict[str, Take]:
    given = signature(function).parameters
    hints = {name: each.annotation for name, each in given.items() if each.annotation is not each.empty}
    return _takes(hints, function.__module__)


@cache
def _of_class(kind: type) -> dict[str, Take]:
    found: dict[str, Take] = {}
    for base in reversed(kind.__mro__):
        if is_dataclass(base):
            own = vars(base).get("__annotations__", ())
            hints = {each.name: each.type for each in fields(base) if each.name in own}
            found |= _takes(hints, base.__module__)
    for name in getattr(kind, "_own", ()):
        found.pop(name, None)
    return found


def _takes(hints: Mapping[str, Any], module: str) -> dict[str, Take]:
    names = vars(sys.modules[module])
    found = {name: take_as(_resolved(hint, names)) for name, hint in hints.items()}
    return {name: take for name, take in found.items() if take is not None}


def _resolved(hint: Any, names: dict[str, Any]) -> Any:
    """Evaluate an annotation to a type; Any if its names exist for type checkers only."""
    try:
        return eval(hint, names) if isinstance(hint, str) else hint
    except NameError:
        return Any


def take_as(hint: Any) -> Take | None:
    """Return the function that converts a value to a type, None for types that accept any value or are not checked."""
    # Unions compare equal in any order of their members, but errors list these in the order of the annotation.
    return _take_as(hint, repr(hint))


@cache
def _take_as(hint: Any, _spelling: str) -> Take | None:
    if hint in _PLAIN:
        return _PLAIN[hint]
    origin, inner = typing.get_origin(hint), typing.get_args(hint)
    if origin in _UNIONS:
        return _as_one_of(hint, inner)
    if _is_row(hint):
        return _as_row(hint, inner)
    if origin is np.ndarray:
        return numbers_in if inner[1] in (np.dtype[np.float64], np.dtype[np.int64]) else None
    if origin in _LISTS:
        return _as_many(hint, inner[0], tuple if origin is tuple else list)
    if origin in _TABLES or hint is dict:
        return _as_table(hint, inner)
    if origin is abc.Callable:
        noun, expected = _words(hint)
        return _plain_of(callable, noun, f"give {expected}")
    return _as_instance(hint) if isinstance(hint, type) and origin is None else None


def _is_row(hint: Any) -> bool:
    """Check whether a type is a tuple of fixed length, such as a point, and not a list of any length."""
    return typing.get_origin(hint) is tuple and typing.get_args(hint)[-1:] != (Ellipsis,)


def _plain_of(is_one: Callable[[Any], bool], noun: str, remedy: str) -> Take:
    """Return the converter that passes a value unchanged if the predicate `is_one` holds."""

    def take(value: Any, field: str) -> Any:
        if is_one(value):
            return value
        raise refused(value, field, noun, remedy)

    return take


def _as_text(value: Any, field: str) -> Any:
    """Return a text, or the name of an object that has one."""
    if isinstance(value, str):
        return value
    name = getattr(value, "name", None)
    if (is_dataclass(value) or hasattr(value, "_fields")) and isinstance(name, str):
        return name
    raise refused(value, field, "a text", "give a text in quotes")


def _kind(value: Any) -> str:
    """Return the NumPy kind of an array's dtype, an empty text for other objects."""
    return getattr(getattr(value, "dtype", None), "kind", "")


def _is_number(value: Any) -> bool:
    """Check whether a value is a real number within the range of floats, or a zero-dimensional array of one."""
    if isinstance(value, Integral):
        return abs(int(value)) <= sys.float_info.max
    return isinstance(value, Real) or (getattr(value, "ndim", None) == 0 and _kind(value) in _REAL)


def _is_whole(value: Any) -> bool:
    return isinstance(value, Integral) and not isinstance(value, bool) and abs(int(value)) <= _MOST


_PLAIN: dict[Any, Take | None] = {
    float: _plain_of(_is_number, "a number", "give a number"),
    int: _plain_of(_is_whole, "a whole number", "give a whole number"),
    bool: _plain_of(lambda value: isinstance(value, bool) or _kind(value) == "b",
                    "True or False", "give one of the two"),
    str: _as_text, Any: None, object: None, NoneType: None,
}  # fmt: skip


def _as_instance(kind: type) -> Take | None:
    """Return the converter to an instance of a class; its `taken_from`, if any, converts other values."""
    if getattr(kind, "_is_protocol", False) and not getattr(kind, "_is_runtime_protocol", False):
        return None
    if issubclass(kind, Enum):
        return lambda value, field: as_enum(kind, value, str(field))
    make = getattr(kind, "taken_from", None)

    def take(value: Any, field: str) -> Any:
        if isinstance(value, kind):
            return value
        converted = None if make is None else make(value, field)
        if converted is not None:
            return converted
        raise _refused(value, field, kind)

    return take


def _as_one_of(hint: Any, kinds: Sequence[Any]) -> Take | None:
    """Return the converter to one of several types: the value has one of them or is convertible to one of them."""
    takes = {kind: take_as(kind) for kind in kinds if kind is not NoneType}
    files = any(isinstance(kind, type) and issubclass(kind, PurePath) for kind in kinds)
    if files:
        # Converting to text would take the name of an object as a file name.
        takes.pop(str, None)
    if any(take is None for take in takes.values()):
        return None
    if len(takes) == 1 and str not in kinds:
        (only,) = takes.values()
        return lambda value, field: None if value is None else only(value, field)  # type: ignore[misc]
    optional = NoneType in kinds
    classes = tuple(kind for kind in kinds if isinstance(kind, type) and typing.get_origin(kind) is None)
    plain = tuple(kind for kind in classes if kind is str or (kind not in _PLAIN and not issubclass(kind, Enum)))

    def take(value: Any, field: str) -> Any:
        if files and isinstance(value, str | PurePath) and "\0" in str(value):
            raise refused(value, field, "a file name", "remove the null character")
        if (value is None and optional) or isinstance(value, plain) or type(value) in classes:
            return value
        for each in takes.values():
            try:
                return each(value, field)  # type: ignore[misc]
            except InputError:
                continue
        raise _refused(value, field, hint)

    return take


def _as_row(hint: Any, kinds: Sequence[Any]) -> Take:
    """Return the converter to a tuple of fixed length, each entry with its own type, such as a point in the plane."""
    takes = [take_as(kind) for kind in kinds]

    def take(value: Any, field: str) -> Any:
        if isinstance(value, str | Mapping) or not isinstance(value, Iterable) or _length(value) != len(takes):
            raise _refused(value, field, hint)
        return _same(value, tuple(each(one, field) if each else one for each, one in zip(takes, value, strict=True)))

    return take


def numbers_in(value: Any, field: str, kinds: Collection[str] = _REAL) -> Any:
    """Convert a value to an array of real numbers, or of other NumPy kinds.

    Parameters
    ----------
    value : array_like
        Numbers.
    field : str
        Name of the field, for the error.
    kinds : collection of str
        Accepted kinds of the dtype; by default Booleans, integers and real numbers.

    Raises
    ------
    InputError
        The value is not an array of such numbers.
    """
    if not isinstance(value, str | bytes | Mapping):
        try:
            converted = np.asarray(value)
        except ValueError:
            converted = np.empty(0, dtype=object)
        if converted.dtype.kind in kinds:
            return converted
    raise refused(value, field, "an array of numbers", "give an array of numbers")


def _as_many(hint: Any, kind: Any, collect: Callable[[Iterable[Any]], Any]) -> Take:
    """Return the converter to a collection of one type, of any length; a single value becomes a collection of one."""
    one = take_as(kind)

    def take(value: Any, field: str) -> Any:
        numbers = _kind(value) in _REAL
        alone = (is_dataclass(value) and not isinstance(value, Sequence)) or getattr(value, "ndim", 1) == 0
        if isinstance(value, str | Mapping) or alone or not isinstance(value, Iterable):
            if value is None or one is None:
                raise _refused(value, field, hint)
            return collect([one(value, field)])
        if one is None or (numbers and kind is float and getattr(value, "ndim", 1) == 1):
            return value
        if numbers:
            for each in value:
                one(each, field)
            return value
        return _same(value, collect(one(each, field) for each in value))

    return take


def _as_table(hint: Any, kinds: Sequence[Any]) -> Take:
    """Return the converter to a dictionary, each key and value with its type."""
    key, item = (take_as(kind) for kind in kinds) if kinds else (None, None)

    def take(value: Any, field: str) -> Any:
        if not isinstance(value, Mapping):
            raise _refused(value, field, hint)
        if key is None and item is None:
            return value
        names = [key(name, field) for name in value] if key else [*value]
        items = [item(each, f"{field}.{name}") for name, each in value.items()] if item else [*value.values()]
        unchanged = all(a is b for a, b in zip((*names, *items), (*value, *value.values()), strict=True))
        return value if unchanged else dict(zip(names, items, strict=True))

    return take


def _length(value: Any) -> int:
    return len(value) if hasattr(value, "__len__") else -1


def _same(given: Any, converted: Any) -> Any:
    """Return the given collection if it has the type and the very entries of the converted one, else the latter."""
    return (
        given
        if type(given) is type(converted) and all(a is b for a, b in zip(given, converted, strict=True))
        else converted
    )


_NOUNS = {float: "a number", int: "a whole number", str: "a text", bool: "True or False"}
_NUMBER_WORDS = {2: "two", 3: "three"}
# Noun of a class in errors, and the value to give instead.
_ERROR_NOUNS: dict[Any, tuple[str, str]] = {}


def named_in_errors(noun: str, expected: str = "") -> Callable[[C], C]:
    """Return a class decorator that registers the noun of the class in errors, and the value to give instead."""

    def register(kind: C) -> C:
        _ERROR_NOUNS[kind] = noun, expected
        return kind

    return register


def _refused(value: object, field: object, hint: Any) -> InputError:
    """Return the error for a value that is not of a type."""
    noun, expected = _words(hint)
    return refused(value, field, noun, f"give {expected}")


def _words(hint: Any) -> tuple[str, str]:
    """Return the noun of a type in error messages, and the description of the value to give instead."""
    origin, inner = typing.get_origin(hint), typing.get_args(hint)
    expected = ""
    if hint in _NOUNS:
        noun = _NOUNS[hint]
    elif origin in _UNIONS:
        noun, expected = map(_either, zip(*map(_words, _members(inner)), strict=True))
    elif _is_row(hint):
        noun = f"{_NUMBER_WORDS.get(len(inner), str(len(inner)))} numbers" if set(inner) == {float} else "such a row"
    elif origin in _LISTS:
        noun, expected = "a list", f"a list, each {_words(inner[0])[1]}"
    elif origin in _TABLES or hint is dict:
        noun = "a dictionary"
        if inner and Any not in inner:
            (key, _), (item, _) = map(_words, inner)
            expected = f"a dictionary, {{{key.replace('a text', 'name')}: {item}}}"
    elif origin is abc.Callable:
        noun = "a function"
    elif issubclass(hint, PurePath):
        noun = "a file name"
    else:
        noun = f"{'an' if hint.__name__[0] in 'AEIOU' else 'a'} {hint.__name__}"
        if issubclass(hint, Enum):
            expected = "one of " + ", ".join(f'"{member.value}"' for member in hint)
    named, instead = _ERROR_NOUNS.get(_stripped(hint), ("", ""))
    return named or noun, instead or expected or named or noun


def _stripped(hint: Any) -> Any:
    """Return a type without its None member."""
    kinds = [kind for kind in typing.get_args(hint) if kind is not NoneType]
    return reduce(or_, kinds) if typing.get_origin(hint) in _UNIONS and kinds else hint


def _members(kinds: Sequence[Any]) -> list[Any]:
    """Return the member types of a union without None, and without str beside file names or enumerations."""
    named = [kind for kind in kinds if isinstance(kind, type) and issubclass(kind, PurePath | Enum)]
    return [kind for kind in kinds if kind is not NoneType and not (named and kind is str)]


def _either(names: Sequence[str]) -> str:
    names = list(dict.fromkeys(names))
    return " or ".join([", ".join(names[:-1]), names[-1]]) if len(names) > 1 else names[0]
