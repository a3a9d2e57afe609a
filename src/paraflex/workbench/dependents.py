"""References between the members of a model file: who uses a name, and what goes with it."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from paraflex.errors import InputError, listed, suggestion
from paraflex.expressions.evaluate import ExpressionError, names_in
from paraflex.files.fields import Place, field_at, takes_number, value_at
from paraflex.files.schema import ModelTable
from paraflex.mechanism.joints import GROUND
from paraflex.units import quantities_in

# Kinds of names by the field in which they stand.
_BY_FIELD = {
    "joint": "joint", "joints": "joint", "point": "ref", "points": "ref", "reaction": "ref", "body": "body",
    "section": "section", "material": "material", "motors": "motor", "path": "path", "paths": "path", "modes": "mode",
    "assembly": "assembly", "controllers": "controller", "held": "coordinate", "stiffness": "coordinate",
}  # fmt: skip
# Kinds of names that are keys, by the place of their table; None stands for any name.
_BY_KEYS: dict[tuple[str | None, ...], str] = {
    ("assembly", None): "body", ("assembly", None, "points"): "ref", ("start", "velocity", "angular"): "body",
    ("start", "velocity", "point"): "ref", ("start", "coordinates"): "body", ("start", "rates"): "body",
    ("start", "deflection"): "body", ("start", "deflection", None): "own", ("relation", None, "weights"): "joint",
    ("study", "torques"): "motor", ("statics", "torques"): "motor", ("statics", "loads"): "coordinate",
    ("statics", "moved"): "coordinate", ("body", None, "lumps"): "own",
}  # fmt: skip
# Tables in which an entry goes alone, not with the whole table.
_LOOSE = ("assembly", "start", "study", "statics", "body")
# Tables whose names stay as long as they are used.
_NEEDED = ("section", "material", "parameters")
_SIGNS = re.compile(r"[-+0]+\Z")


class Use(NamedTuple):
    """Name of another member in a file: its place, whether it is a key, its kind, and the text as written."""

    place: Place
    is_key: bool
    kind: str
    text: str


def uses(data: Mapping[str, Any]) -> Iterator[Use]:
    """Yield all names of members in a file, and all expressions."""
    for place, is_key, text in _texts(data):
        kind = _kind_of_key(place) if is_key else _kind_of_value(data, place)
        if kind:
            yield Use(place, is_key, kind, text)


def replaced(use: Use, thing: Place, name: str) -> str | None:
    """Return the text of a use after a thing gets a name; None if the use does not refer to the thing.

    A thing is the place of a member: ("body", "link1"), ("body", "link1", "points", "B"), ("ground", "A").
    """
    old = str(thing[-1])
    if use.kind == "expression":
        return _in_expression(use.text, thing, name)
    if use.kind == "any":
        return (
            name if thing[0] in ("sensor", "motor", "joint") and use.text == old else _coordinate(use.text, thing, name)
        )
    if use.kind == "coordinate":
        return name if thing[0] == "joint" and use.text == old else _coordinate(use.text, thing, name)
    if use.kind == "ref":
        return _ref(use.text, thing, name)
    if use.kind == "own":
        return name if thing == ("body", _owner(use), "points", use.text) else None
    if use.kind == "mode" and thing[0] == "motor":
        parts = use.text.split(",")
        return (
            ",".join(name if part.strip() == old else part for part in parts) if old in map(str.strip, parts) else None
        )
    return name if thing[:-1] == (use.kind,) and use.text == old else None


def thing_of(data: Mapping[str, Any], name: Any) -> Place:
    """Return the place of a named thing: "body.link1", "ground.A", a point "link1.B", or the place itself."""
    if isinstance(name, Sequence) and not isinstance(name, str):
        place = tuple(name)
    else:
        head, _, rest = str(name).partition(".")
        if (rest and head not in ModelTable.model_fields) or (head == "body" and "body" in data.get("body", {})):
            place: Place = ("body", head, "points", rest)
        else:
            place = (head, rest) if rest else (head,)
    if not place or value_at(data, place) is None:
        known = [f"{table}.{each}" for table, members in data.items() if isinstance(members, dict) for each in members]
        raise InputError("no such thing in the file", field="names", value=name, remedy=suggestion(name, known))
    return place


def spelt(thing: Place) -> str:
    """Return the name of a thing as a person reads it: "body.link1", or "link1.B" for a point."""
    return (
        f"{thing[1]}.{thing[3]}"
        if thing[0] == "body" and thing[2:3] == ("points",) and len(thing) == 4
        else ".".join(map(str, thing))
    )


def falling(data: Mapping[str, Any], things: Iterable[Place]) -> list[Place]:
    """Return the places of all that goes with things, themselves first.

    Raises
    ------
    InputError
        A section, a material or a parameter that something else needs.
    """
    found, known = list(dict.fromkeys(things)), list(uses(data))
    for thing in found:
        for use in known:
            if any(use.place[: len(each)] == each for each in found) or replaced(use, thing, "") is None:
                continue
            if thing[0] in _NEEDED:
                users = [spelt(each.place) for each in known if replaced(each, thing, "") is not None]
                raise InputError(f"is used by {listed(users, 5)}", field=spelt(thing), remedy="change these first")
            found += [place for place in [_falls(data, use)] if place not in found]
        found += [place for place in _also(data, thing) if place not in found]
    lost = _lost(data, found)
    return falling(data, [*found, *lost]) if lost else found


def _texts(data: Any, place: Place = ()) -> Iterator[tuple[Place, bool, str]]:
    if isinstance(data, dict):
        for key, value in data.items():
            if len(place) > 1:
                yield (*place, key), True, key
            yield from _texts(value, (*place, key))
    elif isinstance(data, list):
        for number, value in enumerate(data):
            yield from _texts(value, (*place, number))
    elif isinstance(data, str):
        yield place, False, data


def _kind_of_key(place: Place) -> str:
    if place[0] == "controller":
        return "any"
    for table, kind in _BY_KEYS.items():
        if len(table) + 1 == len(place) and all(one in (None, two) for one, two in zip(table, place, strict=False)):
            return "" if place[0] == "assembly" and place[2:] == ("points",) else kind
    return ""


def _kind_of_value(data: Mapping[str, Any], place: Place) -> str:
    table, fields = place[0], [part for part in place if isinstance(part, str)]
    if table == "controller":
        return "any"
    if table in ("joint", "motor") and len(fields) == 2:
        return "ref" if table == "joint" else "joint"
    if table == "mode":
        return "motor"
    if fields[-2:-1] == ["lumps"]:
        return "lump"
    kind = _BY_FIELD.get(fields[-1], "")
    if kind and len(fields) > 1 and not (kind == "coordinate" and table != "statics"):
        return kind
    if place[0] == "parameters" or takes_number(field_at(ModelTable, data, place).annotation):
        points = value_at(data, ("body", value_at(data, (*place[:2], "body")), "points")) or {}
        return "own" if table == "sensor" and value_at(data, place) in points else "expression"
    return ""


def _owner(use: Use) -> Any:
    return use.place[2] if use.place[0] == "start" else use.place[1]


def _ref(text: str, thing: Place, name: str) -> str | None:
    body, _, point = text.partition(".")
    if thing == ("body", body):
        return f"{name}.{point}"
    if (thing == (GROUND, point) and body == GROUND) or thing == ("body", body, "points", point):
        return f"{body}.{name}"
    return None


def _coordinate(text: str, thing: Place, name: str) -> str | None:
    ref, _, axis = text.rpartition(".")
    found = _ref(ref, thing, name) if ref else None
    return None if found is None else f"{found}.{axis}"


def _in_expression(text: str, thing: Place, name: str) -> str | None:
    """Return an expression with a parameter, or the owner of a quantity of the motion, under another name."""
    old = re.escape(str(thing[-1]))
    patterns = {
        "parameters": rf"(?<![\w.'\"]){old}(?![\w.'\"(])", "joint": rf"(?<![\w.-]){old}(?=\.(?:angle|travel|rate)\b)",
        "linear_spring": rf"(?<![\w.-]){old}(?=\.length)", "body": rf"(?<![\w.-]){old}(?=\.[^.\s]+\.v?[xy]\b)",
    }  # fmt: skip
    pattern = patterns.get(str(thing[0]))
    if len(thing) == 4:
        pattern = rf"(?<={re.escape(str(thing[1]))}\.){old}(?=\.v?[xy]\b)"
    try:
        if pattern is None or (thing[0] == "parameters" and thing[1] not in names_in(text)):
            return None
    except ExpressionError:
        return None
    units = [(each.start, each.end) for each in quantities_in(text)]
    found = [each for each in re.finditer(pattern, text)
             if not any(start < each.end() and each.start() < end for start, end in units)]  # fmt: skip
    for each in reversed(found):
        text = text[: each.start()] + name + text[each.end() :]
    return text if found else None


def _falls(data: Mapping[str, Any], use: Use) -> Place:
    """Return the place that goes with a name that it uses: an entry, or the whole member."""
    if use.place[0] in _LOOSE:
        return use.place
    items = value_at(data, use.place[:-1])
    if use.place[0] == "actuator" and isinstance(items, list) and len(items) > 1:
        return use.place
    return use.place[: 1 if use.place[0] in ("end_effector", "gravity", "payload") else 2]


def _lost(data: Mapping[str, Any], gone: Sequence[Place]) -> list[Place]:
    """Return the bodies that no joint connects any more with the ground, or with the first body if none is on it."""
    bodies = [name for name in data.get("body", {}) if ("body", name) not in gone]
    pairs = []
    for name, joint in data.get("joint", {}).items():
        refs = joint if isinstance(joint, list) else joint.get("points", [])
        if ("joint", name) not in gone:
            pairs.append({str(ref).partition(".")[0] for ref in refs})
    reached = {GROUND} if any(GROUND in pair for pair in pairs) else set(bodies[:1])
    for _ in bodies:
        reached |= {name for pair in pairs if pair & reached for name in pair}
    return [("body", name) for name in bodies if name not in reached]


def _also(data: Mapping[str, Any], thing: Place) -> Iterator[Place]:
    """Yield places that lose their meaning without a thing although they do not name it."""
    if thing[0] == "motor":
        for k, mode in enumerate(value_at(data, ("study", "modes")) or []):
            if _SIGNS.match(str(mode).partition(" ")[0]) and mode not in data.get("mode", {}):
                yield ("study", "modes", k)
    if thing == ("end_effector",):
        places: list[Place] = [("payload",), ("study", "orientation"), ("study", "path"), ("study", "paths")]
        yield from (place for place in places if value_at(data, place) is not None)
