"""Actions that change, rename, copy and delete what is there."""

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from math import dist, isfinite, pi
from typing import Any

from paraflex.errors import InputError
from paraflex.expressions.evaluate import names_in
from paraflex.files.fields import Place, field_at, value_at
from paraflex.files.overlay import value_of
from paraflex.files.schema import ModelTable
from paraflex.mechanism import JOINT_KINDS
from paraflex.mechanism.joints import GROUND
from paraflex.mechanism.poses import Pose
from paraflex.mechanism.quantities import known
from .dependents import Use, falling, replaced, spelt, thing_of, uses
from .edits import number_text, renamed, with_value, written
from .linking import fields_of
from .moving_points import joined_to, move_point, with_number, with_starts
from .sheet import XY, Action, Done, Sheet, check_name, near, placed, tidy, without_spare_places
from .spans import entries_of

# Length by which the inertia of a block is that of a rod [m].
_BLOCK = 0.05
# Number that ends an expression, after a sum or difference, and steps that are rounding [m].
_LAST_TERM, _NO_STEP = re.compile(r" [+-] [0-9.]+(?:e[+-]?[0-9]+)?$"), 1e-12
# Members that are copied together with the joints and points that they name.
_COPIED = ("joint", "spring", "damper", "friction", "linear_spring", "load", "sensor")


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


def retype(sheet: Sheet, action: Action) -> Done:
    """Make a joint one of another type; what drives or loads it stays, if the joint still moves in that way."""
    name, kind = str(action.get("joint")), str(action.get("type"))
    known(kind, list(JOINT_KINDS), "type", "kind of joint")
    joint = next((one for one in sheet.joints if one.name == name), None)
    if joint is None:
        raise sheet.problem or InputError("no such joint", field="joint", value=name, remedy="choose a joint")
    a, b, thing = str(joint.a), str(joint.b), ("joint", name)
    table, old = {"type": kind, "points": [a, b]}, value_at(sheet.data, thing)
    table |= fields_of(sheet, action, JOINT_KINDS[kind], a, b)
    after = sheet
    if isinstance(old, list):
        after = sheet.put(thing, [a, b] if kind == "revolute" else table)
    else:
        for key in [key for key in old if key not in table]:
            after = after.without((*thing, key))
        for key in [key for key in table if table[key] != old.get(key)]:
            after = after.put((*thing, key), table[key])
    if after.problem is not None:
        users = {use.place[:2] for use in uses(after.data) if replaced(use, thing, "") is not None} - {thing}
        after = _without(after, list(users)) if users else after
    bodies = {joint.a.body, joint.b.body}
    return placed(sheet, without_spare_places(after, bodies)), spelt(thing)


def delete(sheet: Sheet, action: Action) -> Done:
    """Delete members together with what depends on them."""
    things = [thing_of(sheet.data, name) for name in action.get("names") or ()]
    if not things:
        raise InputError("nothing to delete", field="names", value=action.get("names"), remedy="choose something")
    return placed(sheet, _without(sheet, things)), ""


def _without(sheet: Sheet, things: Sequence[Place]) -> Sheet:
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


def copied(sheet: Sheet, action: Action) -> Done:
    """Copy bodies and ground points, with the joints, springs, loads and sensors among them, to another place."""
    dx, dy = map(float, action.get("by") or (0.0, 0.0))
    return _doubled(sheet, action, lambda at: Pose(at.angle, (_xy(at)[0] + dx, _xy(at)[1] + dy)), mirrored=False)


def mirrored(sheet: Sheet, action: Action) -> Done:
    """Add the mirror image of bodies and ground points about a line parallel to the x or y axis."""
    axis, about = action.get("axis", "y"), action.get("about") or 0.0
    if axis not in ("x", "y"):
        raise InputError("not an axis", field="axis", value=axis, remedy='give "x" or "y"')
    line = float(about if isinstance(about, int | float) else about[axis == "x"])
    if axis == "x":
        return _doubled(sheet, action, lambda at: Pose(-at.angle, (_xy(at)[0], 2 * line - _xy(at)[1])), mirrored=True)
    return _doubled(sheet, action, lambda at: Pose(pi - at.angle, (2 * line - _xy(at)[0], _xy(at)[1])), mirrored=True)


def moved(sheet: Sheet, action: Action) -> Done:
    """Move points, or whole linkages with the ground points that hold them, by the same step."""
    by, before = [float(each) for each in action.get("by") or ()], sheet
    things = [thing_of(sheet.data, name) for name in action.get("names") or ()]
    if len(by) != 2 or not things or any(thing[0] not in ("body", GROUND) for thing in things):
        raise InputError("nothing to move", field="names", value=action.get("names"), remedy="choose links or points")
    bodies = {str(thing[1]) for thing in things if thing[0] == "body" and len(thing) == 2}
    points = [f"{thing[1]}.{thing[-1]}" if thing[0] == "body" else ".".join(map(str, thing)) for thing in things
              if len(thing) == 4 or thing[0] == GROUND]  # fmt: skip
    pivots = [f"{GROUND}.{name}" for name in _pivots(sheet, list(bodies))]
    carried = {ref for ref in pivots + points if bodies and ref.startswith(f"{GROUND}.")}
    _check_whole(sheet, bodies, carried)
    for ref in carried:
        sheet = _shifted(sheet, (GROUND, ref.partition(".")[2]), by)
    for assembly in sheet.names("assembly") if bodies else ():
        for ref in value_at(sheet.data, ("assembly", assembly, "points")) or {}:
            if ref.partition(".")[0] in bodies:
                sheet = _shifted(sheet, ("assembly", assembly, "points", ref), by)
    done = {ref for ref in before.refs if ref in carried or ref.partition(".")[0] in bodies}
    for ref in points:
        if ref not in done:
            x, y = before.place(ref, before.shown)
            sheet, _ = move_point(sheet, {"ref": ref, "to": [x + by[0], y + by[1]]})
            done.update(joined_to(before, ref))
    return _as_written(before, sheet), spelt(things[-1])


def _as_written(before: Sheet, after: Sheet) -> Sheet:
    """Write values that have changed and come back as they were written."""
    written_now = {one.place: after.text[slice(*one.value)] for one in entries_of(after.text) if one.kind == "pair"}
    for one in entries_of(before.text):
        text = before.text[slice(*one.value)]
        differs = one.kind == "pair" and written_now.get(one.place, text) != text
        if differs and value_at(before.data, one.place) == value_at(after.data, one.place):
            after = after.with_text(with_value(after.text, one.place, text))
    return after


def _check_whole(sheet: Sheet, bodies: Collection[str], grounds: Collection[str]) -> None:
    """Check that nothing else is joined to bodies that are moved, or to the ground points that move with them."""
    for joint in sheet.joints if bodies else ():
        moving = [one.body in bodies or str(one) in grounds for one in (joint.a, joint.b)]
        if any(moving) and not all(moving):
            left = joint.b if moving[0] else joint.a
            remedy = f"select {left.point if left.on_ground else left.body} as well"
            raise InputError("joined to what stays", field=f"joint.{joint.name}", value=str(left), remedy=remedy)


def _shifted(sheet: Sheet, place: Place, by: Sequence[float]) -> Sheet:
    """Move a point; an expression of parameters has the step added as its last term."""
    for k in (0, 1):
        old, to = value_at(sheet.data, (*place, k)), sheet.number((*place, k)) + by[k]
        if isinstance(old, str) and names_in(old) & sheet.parameters.keys():
            term = _LAST_TERM.search(old)
            last = float(term[0].replace(" ", "")) + by[k] if term else by[k]
            rest = old[: term.start()] if term else old
            more = f" {'-' if last < 0.0 else '+'} {number_text(abs(last))}" if abs(last) > _NO_STEP else ""
            sheet = sheet.put((*place, k), rest + more)
        else:
            sheet = with_number(sheet, (*place, k), to)
    return sheet


def _doubled(sheet: Sheet, action: Action, image: Callable[[Pose], Pose], *, mirrored: bool) -> Done:
    """Add the image of members under new names."""
    before, named = sheet, [thing_of(sheet.data, name) for name in action.get("names") or ()]
    bodies = [str(thing[1]) for thing in named if thing[0] == "body"]
    if not named or (not bodies and not any(thing[0] == GROUND for thing in named)):
        raise InputError("nothing to copy", field="names", value=action.get("names"), remedy="choose bodies or points")
    chosen = [str(thing[1]) for thing in named if thing[0] == GROUND]
    grounds = list(dict.fromkeys(chosen + _pivots(sheet, bodies)))
    names: dict[Place, str] = {}
    for name in grounds:
        old = sheet.place(f"{GROUND}.{name}", sheet.shown)
        new = _xy(image(Pose(0.0, old)))
        # A point on the axis is its own image.
        names[GROUND, name] = name if dist(old, new) < 1e-9 else sheet.fresh_point()
        if names[GROUND, name] != name:
            sheet = sheet.put((GROUND, names[GROUND, name]), tidy(new))
    frames: dict[str, dict[str, Pose]] = {assembly: {} for assembly in sheet.names("assembly")}
    for body in bodies:
        names["body", body] = new = sheet.fresh(body.rstrip("0123456789") or body, "body")
        table = sheet.data["body"][body]
        sheet = sheet.table(("body", new), _flipped(table, body) if mirrored else table, exact=True)
        for assembly in frames:
            at = before.frames(assembly).get(body)
            if at is not None and at.position is not None:
                frames[assembly][new] = image(at)
                sheet = sheet.put(("assembly", assembly, new), near(image(at).angle, 0.0))
    named_by = [use for use in uses(before.data) if use.kind in ("ref", "joint", "body", "own")]
    for table in _COPIED:
        for name, member in before.data.get(table, {}).items():
            own = [use for use in named_by if use.place[:2] == (table, name)]
            sheet = _with_copy(sheet, (table, name), member, own, names, mirrored=mirrored)
    selected = ("body", bodies[-1]) if bodies else named[-1]
    return placed(before, sheet, frames), f"{selected[0]}.{names[selected]}"


def _pivots(sheet: Sheet, bodies: Sequence[str]) -> list[str]:
    """Return the ground points to which bodies are joined."""
    pairs = [(joint.a, joint.b) for joint in sheet.joints] + [(joint.b, joint.a) for joint in sheet.joints]
    return [one.point for one, other in pairs if one.on_ground and other.body in bodies]


def _with_copy(
    sheet: Sheet, thing: Place, member: Any, own: Sequence[Use], names: dict[Place, str], *, mirrored: bool
) -> Sheet:
    """Add a copy of a member if all that it names, at its own uses, is copied."""
    renamed_to = {
        use.place: next((new for each, to in names.items() if (new := replaced(use, each, to)) is not None), None)
        for use in own
    }
    if not own or any(new is None and use.kind != "own" for use, new in zip(own, renamed_to.values(), strict=True)):
        return sheet
    table, name = str(thing[0]), str(thing[1])
    new = sheet.fresh_point() if table == "joint" and len(name) <= 2 else sheet.fresh(name.rstrip("0123456789"), table)
    names[thing] = new
    copy = _with_names(member, thing, {place: text for place, text in renamed_to.items() if text})
    if mirrored and table == "joint" and isinstance(copy, dict):
        copy = {key: _minus(each) if key in ("angle", "direction") else each for key, each in copy.items()}
    return sheet.table((table, new), copy, exact=True) if isinstance(copy, dict) else sheet.put((table, new), copy)


def _with_names(value: Any, place: Place, texts: Mapping[Place, str]) -> Any:
    if isinstance(value, dict):
        return {key: _with_names(each, (*place, key), texts) for key, each in value.items()}
    if isinstance(value, list):
        return [_with_names(each, (*place, k), texts) for k, each in enumerate(value)]
    return texts.get(place, value)


def _flipped(table: Mapping[str, Any], body: str) -> dict[str, Any]:
    """Return the table of a body mirrored about the x axis of its frame."""
    kind = table.get("type", "rigid")
    if kind == "modal":
        raise InputError("a body of matrices has no mirror image", field=f"body.{body}", remedy="copy it instead")
    if kind != "rigid":
        return dict(table)
    points = {name: [x, _minus(y)] for name, (x, y) in table.get("points", {}).items()}
    centre = table.get("centre_of_mass")
    return {**table, "points": points} | ({"centre_of_mass": [centre[0], _minus(centre[1])]} if centre else {})


def _minus(value: Any) -> Any:
    return f"-({value})" if isinstance(value, str) else -value if value else value


def _xy(pose: Pose) -> XY:
    assert pose.position is not None
    return pose.position


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
    "set": set_value, "unset": unset, "rename": rename, "copy": copied, "mirror": mirrored, "delete": delete,
    "move": moved, "pose": pose, "retype": retype,
}  # fmt: skip
