"""Actions that set, rename and delete what is there, and that keep a pose."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from math import dist, isfinite
from typing import Any

from paraflex.errors import InputError
from paraflex.files.fields import Place, field_at, value_at
from paraflex.files.overlay import value_of
from paraflex.files.schema import ModelTable
from .dependents import Use, falling, replaced, spelt, thing_of, uses
from .edits import renamed, with_value, written
from .moving_points import with_starts
from .sheet import Action, Done, Sheet, check_name, near, placed

# Length by which the inertia of a block is that of a rod [m].
_BLOCK = 0.05


def set_value(sheet: Sheet, action: Action) -> Done:
    """Write a value as typed, or a value of JSON, at a place; points at the end of a beam follow its length."""
    before, place = sheet, _place(action)
    sheet = _in_full(sheet, place)
    _check_place(sheet.data, place)
    if isinstance(action.get("value"), Mapping) and value_at(sheet.data, place) is None and len(place) <= 2:
        return placed(before, sheet.table([str(key) for key in place], action["value"], exact=True)), spelt(place)
    if "value" in action:
        text = written(action["value"], exact=True)
    else:
        text = _toml_of(sheet.data, place, str(action.get("text", "")).strip())
    for point in _at_end(sheet, place):
        sheet = sheet.with_text(with_value(sheet.text, point, text))
    after = sheet.with_text(with_value(sheet.text, place, text))
    if place[0] == "body" and place[2:] == ("mass",) and value_at(sheet.data, (*place[:2], "inertia")) is None:
        after = _with_inertia(after, place[:2])
    # Numbers decide nowhere which places are determined.
    is_number = _is_number(before, place) and _is_number(after, place)
    return after if is_number else placed(before, after), ".".join(map(str, place[:2]))


def _is_number(sheet: Sheet, place: Place) -> bool:
    with suppress(InputError):
        return isfinite(sheet.number(place))
    return False


def _in_full(sheet: Sheet, place: Place) -> Sheet:
    """Write a joint or motor as a table if a field of it is to be set."""
    short = value_at(sheet.data, place[:2])
    if len(place) == 3 and place[0] == "motor" and isinstance(short, str):
        return sheet.put(place[:2], {"joint": short})
    if len(place) == 3 and place[0] == "joint" and isinstance(short, list) and isinstance(place[2], str):
        return sheet.put(place[:2], {"type": "revolute", "points": short})
    return sheet


def _check_place(data: Any, place: Place) -> None:
    for key in place[:-1]:
        data = value_at(data, (key,)) if isinstance(data, dict | list) else data
    inside = isinstance(data, list) and place[-1] in range(len(data))
    if not (data is None or inside or (isinstance(data, dict) and isinstance(place[-1], str))):
        remedy = "choose a field that is there"
        raise InputError("no such place in the file", field=".".join(map(str, place)), remedy=remedy)


def _at_end(sheet: Sheet, place: Place) -> list[Place]:
    """Return the places of the points at the end of a beam whose length is to be set."""
    points = value_at(sheet.data, ("body", *place[1:2], "points"))
    if place[0] != "body" or place[2:] != ("length",) or not isinstance(points, dict):
        return []
    length = sheet.number(place)
    return [(*place[:2], "points", name) for name in points if sheet.number((*place[:2], "points", name)) == length]


def _with_inertia(sheet: Sheet, body: Place) -> Sheet:
    """Give a rigid body the centre of mass and the inertia of a thin rod along its points, if it has none."""
    table = value_at(sheet.data, body)
    if table.get("type", "rigid") != "rigid":
        return sheet
    points = [tuple(sheet.number((*body, "points", name, k)) for k in (0, 1)) for name in table.get("points", {})]
    length = max((dist(one, other) for one in points for other in points), default=0.0) or _BLOCK
    inertia = sheet.number((*body, "mass")) * length**2 / 12.0
    centre = [sum(each) / len(points) for each in zip(*points, strict=True)] if points else [0.0, 0.0]
    if "centre_of_mass" not in table and any(centre):
        sheet = sheet.put((*body, "centre_of_mass"), centre)
    return sheet.put((*body, "inertia"), inertia)


def unset(sheet: Sheet, action: Action) -> Done:
    """Remove an optional field."""
    place = _place(action)
    if value_at(sheet.data, place) is None:
        raise InputError("is not in the file", field=".".join(map(str, place)), remedy="choose a field that is there")
    return placed(sheet, sheet.without(place)), ".".join(map(str, place[:2]))


def rename(sheet: Sheet, action: Action) -> Done:
    """Give a member another name, in all references and expressions as well."""
    of, name, to = action.get("of") or "", action.get("name"), action.get("to")
    thing = thing_of(sheet.data, [of, name] if of and of != "point" else name)
    above = value_at(sheet.data, thing[:-1])
    if len(thing) < 2:
        raise InputError("has no name of its own", field=spelt(thing), remedy="rename a member of a table")
    if to == thing[-1]:
        return sheet, spelt(thing)
    check_name(to, above if isinstance(above, dict) else (), "to")
    text, values = sheet.text, _values(sheet)
    for use in [each for each in uses(sheet.data) if not each.is_key]:
        found = replaced(use, thing, str(to))
        if found is not None:
            text = with_value(text, use.place, written(found))
    for use in [each for each in uses(sheet.data) if each.is_key]:
        found = replaced(use, thing, str(to))
        if found is not None:
            text = renamed(text, use.place, found)
    after = sheet.with_text(renamed(text, thing, str(to)))
    if _values(after) != values:
        raise InputError("the name has another meaning in expressions", field="to", value=to, remedy="choose another")
    return after, spelt((*thing[:-1], str(to)))


def delete(sheet: Sheet, action: Action) -> Done:
    """Delete members together with what depends on them."""
    things = [thing_of(sheet.data, name) for name in action.get("names") or ()]
    if not things:
        raise InputError("nothing to delete", field="names", value=action.get("names"), remedy="choose something")
    return placed(sheet, without_things(sheet, things)), ""


def without_things(sheet: Sheet, things: Sequence[Place]) -> Sheet:
    """Remove members, and what depends on them."""
    after, gone = sheet, falling(sheet.data, things)
    whole = [place for place in gone if not any(place[: len(each)] == each for each in gone if each != place)]
    # Items of a list go from its end, as their indices count from its start.
    for place in sorted(whole, key=lambda each: [part for part in each if isinstance(part, int)], reverse=True):
        after = after.without(place)
    return after


def pose(sheet: Sheet, action: Action) -> Done:
    """Let the angles and places of a pose be those of an assembly, which is added if there is none of its name."""
    name = action.get("assembly") or sheet.shown or "drawn"
    given, before = value_at(sheet.data, ("assembly", name)), sheet
    angles, points = action.get("angles") or {}, action.get("points") or {}
    if given is None:
        check_name(name, (), "assembly")
        sheet = sheet.table(("assembly", name), {body: float(angle) for body, angle in angles.items()})
        base = value_at(before.data, ("assembly", before.shown, "points")) or {}
        points = {ref: points[ref] for ref in points if ref in base or not before.shown}
    else:
        for body, angle in angles.items():
            if body in given:
                sheet = _turned(sheet, ("assembly", name, body), float(angle))
        points = {ref: place for ref, place in points.items() if ref in given.get("points", {})}
    for ref, place in points.items():
        sheet = sheet.put(("assembly", name, "points", ref), [float(each) for each in place])
    frames = before.frames(name) if name == before.shown else {}
    turns = {
        body: near(float(angle), frames[body].angle) - frames[body].angle
        for body, angle in angles.items()
        if body in frames
    }
    return with_starts(sheet, turns, action.get("travels") or {}), f"assembly.{name}"


def _turned(sheet: Sheet, place: Place, angle: float) -> Sheet:
    """Write an angle of an assembly, unless it is an expression, which approximates it well enough."""
    old = value_at(sheet.data, place)
    return sheet if isinstance(old, str) else sheet.put(place, near(angle, float(old)))


def _place(action: Action) -> Place:
    place = action.get("place")
    if isinstance(place, Sequence) and not isinstance(place, str) and place and isinstance(place[0], str):
        return tuple(place)
    raise InputError("not a place in the file", field="place", value=place, remedy='give ["body", "link1", "length"]')


def _toml_of(data: Mapping[str, Any], place: Place, text: str) -> str:
    """Return a typed text as TOML: a value as it is, names and expressions in quotes."""
    annotation = field_at(ModelTable, data, place).annotation
    plain = annotation is str or (isinstance(annotation, type) and issubclass(annotation, str))
    value = text if plain and not text.startswith(('"', "'")) else value_of(text)
    if isinstance(value, str) and value == text:
        return written(text)
    # A comment behind the value would hide what follows in an inline table.
    return written(value) if "#" in text or "\n" in text else text


def _values(sheet: Sheet) -> list[float]:
    """Return the values of all expressions, in the order of the file."""
    found: list[float] = []
    for use in uses(sheet.data):
        if use.kind == "expression" and not use.is_key:
            found += _value(sheet, use)
    return found


def _value(sheet: Sheet, use: Use) -> list[float]:
    try:
        return [sheet.number(use.place)]
    except InputError:
        return []


CHANGING: dict[str, Callable[[Sheet, Action], Done]] = {
    "set": set_value, "unset": unset, "rename": rename, "delete": delete, "pose": pose,
}  # fmt: skip
