"""Numbers of a model file by name: found, and replaced before the file is checked."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from paraflex.errors import InputError, suggestion
from paraflex.files.expressions import ExpressionError, evaluate, evaluate_parameters

# A place in parsed TOML: keys of tables and indices of lists.
Place = tuple[str | int, ...]

_BARE = re.compile(r"[A-Za-z0-9_-]+\Z")
_PART = re.compile(r'\s*(?:"([^"]*)"|\'([^\']*)\'|([^."\'\s]+))\s*(\.|\Z)')


def find_place(data: Mapping[str, Any], field: str) -> Place:
    """Place of a number in a model's data.

    Parameters
    ----------
    data : mapping
        A model file as parsed.
    field : str
        Keys and list indices joined by points, "body.link1.length" or "ground.A1.0"; a key with a point in quotes.

    Raises
    ------
    InputError
        There is no such field, which names the nearest; or it is no number.
    """
    place: list[str | int] = []
    inside: Any = data
    for part in _parts(field):
        key: str | int = int(part) if isinstance(inside, list) and part.isdigit() else part
        if (isinstance(inside, dict) and key in inside) or (isinstance(inside, list) and _has(inside, key)):
            inside = inside[key]  # pyright: ignore[reportArgumentType, reportCallIssue]
            place.append(key)
        else:
            raise InputError(
                "no such number in the mechanism's file", field=field,
                remedy=suggestion(field, [_spelt(each) for each in number_places(data)]),
            )  # fmt: skip
    if not _is_number(inside, data):
        raise InputError("not a number in the mechanism's file", field=field, value=inside, remedy=_below(data, field))
    return tuple(place)


def number_places(data: Mapping[str, Any]) -> Iterator[Place]:
    """Every number of a model's data, and every expression that has a value."""

    def walk(inside: Any, place: Place) -> Iterator[Place]:
        if isinstance(inside, (dict, list)):
            for key, value in inside.items() if isinstance(inside, dict) else enumerate(inside):
                yield from walk(value, (*place, key))
        elif _is_number(inside, data):
            yield place

    yield from walk(data, ())


def number_at(data: Mapping[str, Any], place: Place) -> float:
    """The number at a place that `find_place` found, or the value of its expression."""
    inside: Any = data
    for key in place:
        inside = inside[key]
    if isinstance(inside, str):
        return float(evaluate(inside, evaluate_parameters(data.get("parameters", {}))))
    return float(inside)


def overlaid(data: dict[str, Any], numbers: Sequence[tuple[Place, float | int]]) -> dict[str, Any]:
    """A model's data with other numbers at given places; unchanged tables are shared, not copied."""
    out: Any = dict(data)
    for place, number in numbers:
        inside: Any = out
        for key in place[:-1]:
            below = inside[key]
            inside[key] = dict(below) if isinstance(below, dict) else list(below)
            inside = inside[key]
        inside[place[-1]] = number
    return out


def _parts(field: str) -> list[str]:
    parts, at = [], 0
    while at < len(field):
        found = _PART.match(field, at)
        if found is None:
            break
        parts.append(next(group for group in found.groups()[:3] if group is not None))
        at = found.end()
        if found[4] == "":
            return parts
    raise InputError("not the name of a field", field=field, remedy='say "body.link1.length"')


def _has(inside: list, key: str | int) -> bool:
    return isinstance(key, int) and key < len(inside)


def _is_number(value: Any, data: Mapping[str, Any]) -> bool:
    if isinstance(value, bool):
        return False
    if isinstance(value, (int, float)):
        return True
    if not isinstance(value, str):
        return False
    table = data.get("parameters", {})
    try:
        evaluate(value, evaluate_parameters(table if isinstance(table, dict) else {}))
    except (ExpressionError, InputError):
        return False
    return True


def _below(data: Mapping[str, Any], field: str) -> str:
    near = [name for name in map(_spelt, number_places(data)) if name.startswith(f"{field}.")]
    return f'say "{near[0]}"' if near else "name a number"


def _spelt(place: Place) -> str:
    """A place as it is written in a study file."""
    return ".".join(str(key) if _BARE.match(str(key)) else f'"{key}"' for key in place)
