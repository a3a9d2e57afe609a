"""Members of a model file and their fields, as the inspector of the workbench shows them."""

import math
import typing
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from paraflex.errors import InputError
from paraflex.files.fields import Place, described, field_at, is_table, takes_number, units_at, value_at
from paraflex.files.schema import ModelTable
from paraflex.mechanism.members import TASK_COORDINATES
from .dependents import uses
from .edits import written
from .sheet import Sheet, refusals
from .spans import entries_of

# Tables whose members are numbers, names or lists, which have no fields of their own.
_ENTRIES = ("parameters", "units", "ground", "mode")
# Tables that choose among members of other tables by name, by the field that holds the name.
_CHOICES = {
    "section": "section", "material": "material", "joint": "joint", "joints": "joint", "path": "path", "paths": "path",
    "assembly": "assembly", "modes": "mode", "body": "body", "motors": "motor", "lumps": "lump",
}  # fmt: skip


def outline(text: str) -> list[dict[str, Any]]:
    """Return all members of a file: `kind`, `name`, `place` of each, and `owns`, the places of what belongs to it.

    A motor, spring or sensor belongs to the joint that it names, a joint or load to the body whose point it names.
    """
    sheet = Sheet(text)
    with refusals(sheet, "file"):
        named = _named(sheet.data)
        members = list(_members(sheet.data))
    return [
        {"kind": place[0], "name": place[-1], "place": list(place), "owns": named.get(place, [])} for place in members
    ]


def fields(text: str, place: Sequence[Any]) -> dict[str, Any]:
    """Return the fields of the member at a place: `fields` that the file has, and `addable` ones that it may have.

    Each field has `place`, `label`, `text` as in the file, `value` in SI units or None, `unit`, `help` and `choices`.

    Raises
    ------
    InputError
        There is nothing at the place.
    """
    sheet, place = Sheet(text), tuple(place)
    found = value_at(sheet.data, place) if place else sheet.data
    if found is None:
        raise InputError("is not in the file", field=".".join(map(str, place)), remedy="choose a member of the file")
    with refusals(sheet, ".".join(map(str, place))):
        if place[:1] == ("motor",) and len(place) == 2 and isinstance(found, str):
            rows, found = [_row(sheet, place, "joint")], {"joint": found}
        else:
            rows = list(_rows(sheet, place, found, ""))
        return {"fields": rows, "addable": list(_addable(sheet.data, place, found))}


def _named(data: Mapping[str, Any]) -> dict[tuple[str, ...], list[list[Any]]]:
    """Return by member the places of what names it, except of settings and poses."""
    named: dict[tuple[str, ...], list[list[Any]]] = {}
    for use in uses(data):
        owner = list(use.place[: 1 if use.place[0] == "end_effector" else 2])
        for thing in _things(use.kind, use.text, use.place):
            if owner != list(thing) and use.place[0] not in ("assembly", "start", "study", "statics"):
                found = named.setdefault(thing, [])
                found += [owner] if owner not in found else []
    return named


def _members(data: Mapping[str, Any]) -> Iterator[tuple[str, ...]]:
    for table, members in data.items():
        if isinstance(members, dict) and _by_name(table):
            yield from ((table, name) for name in members)
        elif isinstance(members, dict):
            yield (table,)


def _by_name(table: str) -> bool:
    """Check whether a table has members by name, and not fields of its own."""
    info = ModelTable.model_fields.get(table)
    return info is not None and typing.get_origin(info.annotation) is dict


def _things(kind: str, text: str, place: Place) -> Iterator[tuple[str, str]]:
    """Yield the members that a text names."""
    if kind == "ref":
        body, _, point = text.partition(".")
        yield ("ground", point) if body == "ground" else ("body", body)
    elif kind in ("expression", "any", "coordinate"):
        yield from (("joint", text),) if kind == "any" else ()
    elif kind != "own":
        yield kind, text


def _rows(sheet: Sheet, place: Place, value: Any, label: str) -> Iterator[dict[str, Any]]:
    """Yield the fields below a place: tables are flattened, pairs of numbers have a row for each."""
    if not place:
        value = {key: each for key, each in value.items() if not isinstance(each, dict)}
    if isinstance(value, dict):
        for key, each in value.items():
            yield from _rows(sheet, (*place, key), each, f"{label}.{key}".lstrip("."))
    elif (
        isinstance(value, list)
        and len(value) <= 3
        and value
        and not any(isinstance(each, list | dict) for each in value)
    ):
        for k, _ in enumerate(value):
            yield _row(sheet, (*place, k), f"{label} {'xy'[k] if _is_pair(sheet, place, value) else k + 1}".strip())
    else:
        yield _row(sheet, place, label or "value")


def _is_pair(sheet: Sheet, place: Place, value: Sequence[Any]) -> bool:
    return len(value) == 2 and takes_number(field_at(ModelTable, sheet.data, (*place, 0)).annotation)


def _row(sheet: Sheet, place: Place, label: str) -> dict[str, Any]:
    found = field_at(ModelTable, sheet.data, place)
    entry = next((one for one in entries_of(sheet.text) if one.place == place and one.kind != "header"), None)
    value = value_at(sheet.data, place)
    text = value if isinstance(value, str) else sheet.text[slice(*entry.value)] if entry else written(value, exact=True)
    return {
        "place": list(place), "label": label, "text": text,
        "value": _number(sheet, place) if takes_number(found.annotation) or place[0] == "parameters" else None,
        "unit": _unit(sheet.data, place, found.annotation), "help": described(found, sheet.data, place),
        "choices": _choices(sheet.data, place, found.annotation),
    }  # fmt: skip


def _number(sheet: Sheet, place: Place) -> float | None:
    try:
        value = sheet.number(place)
    except InputError:
        return None
    return value if math.isfinite(value) else None


def _unit(data: Mapping[str, Any], place: Place, annotation: Any) -> str:
    units = units_at(ModelTable, data, place) if takes_number(annotation) else ()
    return units[0] if units else ""


def _choices(data: Mapping[str, Any], place: Place, annotation: Any) -> list[Any] | None:
    """Return the words or names among which a field chooses; None for any value."""
    words = list(_words(annotation))
    if words and not takes_number(annotation):
        return words
    keys = [part for part in place if isinstance(part, str)]
    table = "lump" if keys[-2:-1] == ["lumps"] else "motor" if keys[0] == "mode" else _CHOICES.get(keys[-1], "")
    if place[:2] == ("end_effector", "coordinates"):
        return list(TASK_COORDINATES)
    if (keys[0] == "joint" or keys[-1] in ("point", "reaction")) and not takes_number(annotation):
        bodies = {name: body.get("points", {}) for name, body in data.get("body", {}).items()}
        return [
            f"{body}.{point}"
            for body, points in {"ground": data.get("ground", {}), **bodies}.items()
            for point in points
        ]
    if len(keys) < 2 or not table or takes_number(annotation):
        return [True, False] if annotation is bool else None
    return list(data.get(table, {}))


def _words(annotation: Any) -> Iterator[Any]:
    if typing.get_origin(annotation) is typing.Literal:
        yield from typing.get_args(annotation)
    elif typing.get_origin(annotation) not in (list, dict, tuple):
        for each in typing.get_args(annotation):
            yield from _words(each)


def _addable(data: Mapping[str, Any], place: Place, value: Any) -> Iterator[dict[str, str]]:
    """Yield the optional fields that a table may get."""
    model = field_at(ModelTable, data, place).annotation if place else ModelTable
    if not is_table(model) or not isinstance(value, dict):
        return
    for name, info in model.model_fields.items():
        found = field_at(ModelTable, data, (*place, name))
        if name in value or (not place and (_by_name(name) or is_table(found.annotation))):
            continue
        if not info.is_required():
            unit = _unit(data, (*place, name), found.annotation)
            yield {"label": name, "help": found.description, "unit": unit}
