"""Actions that move, copy and mirror bodies and points with all that joins them."""

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from math import dist, pi
from typing import Any

from paraflex.errors import InputError
from paraflex.expressions.evaluate import names_in
from paraflex.files.fields import Place, value_at
from paraflex.mechanism.joints import GROUND
from paraflex.mechanism.poses import Pose
from .dependents import Use, replaced, spelt, thing_of, uses
from .edits import number_text, with_value
from .moving_points import joined_to, move_point, with_number
from .sheet import XY, Action, Done, Sheet, near, placed, tidy
from .spans import entries_of

# Number that ends an expression, after a sum or difference, and steps that are rounding [m].
_LAST_TERM, _NO_STEP = re.compile(r" [+-] [0-9.]+(?:e[+-]?[0-9]+)?$"), 1e-12
# Members that are copied together with the joints and points that they name.
_COPIED = ("joint", "spring", "damper", "friction", "linear_spring", "load", "sensor")


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


def _pivots(sheet: Sheet, bodies: Sequence[str]) -> list[str]:
    """Return the ground points to which bodies are joined."""
    pairs = [(joint.a, joint.b) for joint in sheet.joints] + [(joint.b, joint.a) for joint in sheet.joints]
    return [one.point for one, other in pairs if one.on_ground and other.body in bodies]


def moved(sheet: Sheet, action: Action) -> Done:
    """Move points, or whole linkages with the ground points that hold them, by the same step."""
    by, before = [float(each) for each in action.get("by") or ()], sheet
    things = [thing_of(sheet.data, name) for name in action.get("names") or ()]
    if len(by) != 2 or not things or any(thing[0] not in ("body", GROUND) for thing in things):
        raise InputError("nothing to move", field="names", value=action.get("names"), remedy="choose links or points")
    bodies = {str(thing[1]) for thing in things if thing[0] == "body" and len(thing) == 2}
    points = [f"{thing[1]}.{thing[-1]}" if thing[0] == "body" else ".".join(map(str, thing)) for thing in things
              if len(thing) == 4 or thing[0] == GROUND]  # fmt: skip
    done = set[str]()
    if bodies:
        pivots = [f"{GROUND}.{name}" for name in _pivots(sheet, list(bodies))]
        grounds = {ref for ref in pivots + points if ref.startswith(f"{GROUND}.")}
        sheet = _with_linkage_moved(sheet, bodies, grounds, by)
        done = {ref for ref in before.refs if ref in grounds or ref.partition(".")[0] in bodies}
    for ref in points:
        if ref not in done:
            x, y = before.place(ref, before.shown)
            sheet, _ = move_point(sheet, {"ref": ref, "to": [x + by[0], y + by[1]]})
            done.update(joined_to(before, ref))
    return _as_written(before, sheet), spelt(things[-1])


def _with_linkage_moved(sheet: Sheet, bodies: Collection[str], grounds: Collection[str], by: Sequence[float]) -> Sheet:
    """Move ground points, and the places in the assemblies of bodies to which nothing else is joined."""
    _check_whole(sheet, bodies, grounds)
    for ref in grounds:
        sheet = _shifted(sheet, (GROUND, ref.partition(".")[2]), by)
    for assembly in sheet.names("assembly"):
        for ref in value_at(sheet.data, ("assembly", assembly, "points")) or {}:
            if ref.partition(".")[0] in bodies:
                sheet = _shifted(sheet, ("assembly", assembly, "points", ref), by)
    return sheet


def _check_whole(sheet: Sheet, bodies: Collection[str], grounds: Collection[str]) -> None:
    """Check that nothing else is joined to bodies that are moved, or to the ground points that move with them."""
    for joint in sheet.joints:
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


def _as_written(before: Sheet, after: Sheet) -> Sheet:
    """Write values that have changed and come back as they were written."""
    written_now = {one.place: after.text[slice(*one.value)] for one in entries_of(after.text) if one.kind == "pair"}
    for one in entries_of(before.text):
        text = before.text[slice(*one.value)]
        differs = one.kind == "pair" and written_now.get(one.place, text) != text
        if differs and value_at(before.data, one.place) == value_at(after.data, one.place):
            after = after.with_text(with_value(after.text, one.place, text))
    return after


COPYING: dict[str, Callable[[Sheet, Action], Done]] = {"copy": copied, "mirror": mirrored, "move": moved}
