"""Lookup and replacement of values of a model file by field name, before the file is validated."""

import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from paraflex.errors import InputError, suggestion
from paraflex.expressions.evaluate import ExpressionError, evaluate, evaluate_parameters
from .fields import Place, field_at, has_tables, is_table, leaves, takes_number, value_at
from .schema import ModelTable

_BARE = re.compile(r"[A-Za-z0-9_-]+\Z")
_PART = re.compile(r'\s*(?:"([^"]*)"|\'([^\']*)\'|([^."\'\s]+))\s*(\.|\Z)')


def find_place(data: Mapping[str, Any], field: str) -> Place:
    """Find the place of a number in a model's data.

    Parameters
    ----------
    data : mapping
        Parsed model file.
    field : str
        Keys and list indices joined by dots, "body.link1.length" or "ground.A1.0"; a key that contains a dot is quoted.
        The table may be omitted if the name is unique: "link1.length".

    Raises
    ------
    InputError
        Unknown field, reported with the nearest ones, ambiguous name, or field that is not a number.
    """
    parts = _in_full(data, field)
    place = _followed(data, parts)
    if len(place) < len(parts):
        raise InputError(
            "no such number in the mechanism's file", field=field,
            remedy=suggestion(field, [_spelt(each) for each in number_places(data)]),
        )  # fmt: skip
    found = value_at(data, place)
    if not _is_number(found, data):
        raise InputError("not a number in the mechanism's file", field=field, value=found, remedy=_below(data, field))
    return place


def with_values(data: dict[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """Replace or add values of fields in a model's data; see `find_place` for the names of fields.

    Parameters
    ----------
    data : dict
        Parsed data; not modified.
    values : mapping of str to Any
        Numbers, expressions, numbers with units, names, booleans, or lists of these, by field.

    Raises
    ------
    InputError
        Unknown field, ambiguous name, or field or value that is a table.
    """
    for field, value in values.items():
        place = _place_to_set(data, field)
        if isinstance(value, Mapping):
            raise InputError("a table", field=field, value=value, remedy="set its fields one by one")
        data = overlaid(data, [(place, value)])
    return data


def plain(value: Any) -> Any:
    """Convert NumPy numbers and arrays, tuples and mappings, to numbers, lists and dicts as used in TOML."""
    value = value.tolist() if hasattr(value, "tolist") else value
    if isinstance(value, Mapping):
        return {name: plain(each) for name, each in value.items()}
    return list(map(plain, value)) if isinstance(value, tuple | list) else value


def value_of(text: str) -> Any:
    """Parse a text as a TOML value: a number, boolean, list, or string without its quotes; else return the text."""
    try:
        found = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
        return text
    return found["value"] if len(found) == 1 else text


def _place_to_set(data: Mapping[str, Any], field: str) -> Place:
    parts = _in_full(data, field)
    place = _followed(data, parts)
    for part in parts[len(place) :]:
        inside = value_at(data, place)
        short = isinstance(inside, str) and place[:1] == ("motor",)
        if not (inside is None or isinstance(inside, dict) or short) or not _may_have(data, place, part):
            raise InputError(
                "no such field in the model's file", field=field,
                remedy=_same_names(data, part) or suggestion(_spelt((*place, part)), _known_below(data, place)),
            )  # fmt: skip
        place = (*place, part)
    if isinstance(value_at(data, place), dict):
        raise InputError("a table of the model's file", field=field, remedy=_below(data, field))
    return place


def _may_have(data: Mapping[str, Any], place: Place, part: str) -> bool:
    """Check whether a table may have a missing field: one of the schema, or a number by a new name."""
    annotation = field_at(ModelTable, data, place).annotation if place else ModelTable
    if is_table(annotation):
        return part in annotation.model_fields or annotation.model_config.get("extra") == "allow"
    return place[0] != "parameters" and (takes_number(annotation) or not has_tables(annotation))


def _known_below(data: Mapping[str, Any], place: Place) -> list[str]:
    """Return the fields that the table at a place has or may have; all numbers of the data for an empty place."""
    if not place:
        return [_spelt(each) for each in number_places(data)]
    annotation, inside = field_at(ModelTable, data, place).annotation, value_at(data, place)
    there = list(inside) if isinstance(inside, dict) else range(len(inside)) if isinstance(inside, list) else []
    possible = list(annotation.model_fields) if is_table(annotation) else []
    return [_spelt((*place, key)) for key in dict.fromkeys([*there, *possible])]


def _same_names(data: Mapping[str, Any], name: str) -> str:
    """Suggest fields of that name in other tables, "did you mean section.bar.thickness?"; empty if there are none."""
    there = [_spelt(each) for each in number_places(data) if each[-1] == name]
    return f"did you mean {' or '.join(there[:3])}?" if there else ""


def _in_full(data: Mapping[str, Any], field: str) -> list[str]:
    """Return the parts of a field name, completed with an omitted table."""
    parts = _joined(data, _parts(field))
    if parts[0] in data or parts[0] in ModelTable.model_fields:
        return parts
    fits = [
        [table, *parts]
        for table, members in data.items()
        if isinstance(members, dict) and parts[0] in members
        and (isinstance(members[parts[0]], (dict, list)) == (len(parts) > 1))
    ]  # fmt: skip
    whole = [each for each in fits if len(_followed(data, each)) == len(each)]
    if len(whole or fits) > 1:
        names = ", ".join(_spelt(tuple(each)) for each in whole or fits)
        raise InputError("the name of several", field=field, remedy=f"choose from {names}")
    return (whole or fits or [parts])[0]


def _joined(data: Mapping[str, Any], parts: list[str]) -> list[str]:
    """Join the parts that form one key of the data that contains dots, as in "statics.moved.stage.T.x"."""
    for start in range(1, len(parts)):
        place = _followed(data, parts[:start])
        if len(place) < start:
            break
        inside = value_at(data, place)
        for end in range(len(parts), start + 1, -1) if isinstance(inside, dict) else ():
            if (key := ".".join(parts[start:end])) in inside:
                return [*parts[:start], key, *parts[end:]]
    return parts


def _followed(data: Mapping[str, Any], parts: Sequence[str]) -> Place:
    """Follow the parts of a name in the data, and return the place as far as it exists."""
    place: list[str | int] = []
    inside: Any = data
    for part in parts:
        key: str | int = int(part) if isinstance(inside, list) and part.isdigit() else part
        inside = value_at(inside, (key,))
        if inside is None:
            break
        place.append(key)
    return tuple(place)


def number_places(data: Mapping[str, Any]) -> Iterator[Place]:
    """Yield the places of all numbers of a model's data, including expressions with a value."""
    return (place for place, value in leaves(data) if _is_number(value, data))


def number_at(data: Mapping[str, Any], place: Place) -> float:
    """Return the number at a place found by `find_place`, or the value of its expression."""
    inside = value_at(data, place)
    if isinstance(inside, str):
        return float(evaluate(inside, evaluate_parameters(data.get("parameters", {}))))
    return float(inside)


def overlaid(data: dict[str, Any], values: Sequence[tuple[Place, Any]]) -> dict[str, Any]:
    """Return a model's data with new values at given places; unchanged tables are shared, not copied."""
    out: Any = dict(data)
    for place, value in values:
        inside: Any = out
        for key in place[:-1]:
            below = inside.get(key, {}) if isinstance(inside, dict) else inside[key]
            # A motor may be written as the name of its joint alone.
            table = {"joint": below} if isinstance(below, str) else below
            inside[key] = dict(table) if isinstance(table, dict) else list(table)
            inside = inside[key]
        inside[place[-1]] = value
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
    raise InputError("not the name of a field", field=field, remedy='write "body.link1.length"')


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
    inside = _spelt(_followed(data, _in_full(data, field)))
    near = [name for name in map(_spelt, number_places(data)) if name.startswith(f"{inside}.")]
    return f'write "{near[0]}"' if near else "name a number"


def _spelt(place: Place) -> str:
    """Return a place as it is written in a study file."""
    return ".".join(str(key) if _BARE.match(str(key)) else f'"{key}"' for key in place)
