"""Actions that draw points, links and joints."""

from collections.abc import Mapping, Sequence
from math import cos, dist, sin
from typing import Any

from paraflex.errors import InputError
from paraflex.files.fields import value_at
from paraflex.mechanism import JOINT_KINDS, Joint
from paraflex.mechanism.joints import GROUND
from paraflex.mechanism.poses import Pose
from paraflex.mechanism.quantities import known
from .changing import without_things
from .dependents import replaced, spelt, uses
from .sheet import XY, Action, Done, Sheet, check_name, direction, placed, tidy, without_spare_places

_SECTION = {"width": "30 mm", "thickness": "5 mm"}
_MATERIAL = {"youngs_modulus": "70 GPa", "density": 2700.0}


def add_ground(sheet: Sheet, action: Action) -> Done:
    """Add a point of the ground."""
    name = action.get("name") or sheet.fresh_point()
    check_name(name, sheet.names("ground"), f"ground.{name}")
    return sheet.put(("ground", name), tidy(_xy(action.get("at"), "at"))), f"ground.{name}"


def add_link(sheet: Sheet, action: Action) -> Done:
    """Add a link through points; a point of another body or of the ground becomes a revolute joint."""
    ends = action.get("points")
    if not isinstance(ends, Sequence) or isinstance(ends, str) or len(ends) < 2:
        raise InputError("needs two points", field="points", value=ends, remedy="give places [x, y] or points")
    before, body, names = sheet, sheet.free_name(action, "body", "link"), _names_of(sheet, ends)
    sheet = _with_assembly(sheet)
    shown = action.get("assembly") or sheet.shown
    places = {each: [_place(before, end, each) for end in ends] for each in sheet.names("assembly")}
    origin, angle = places[shown][0], direction(places[shown][0], places[shown][1])
    local = [_turned((x - origin[0], y - origin[1]), -angle) for x, y in places[shown]]
    sheet = _with_body(sheet, body, dict(zip(names, local, strict=True)), bool(action.get("flexible")))
    held = next((k for k, end in enumerate(ends) if isinstance(end, str)), 0)
    frames = {}
    for each, (start, second, *_) in places.items():
        turned = direction(start, second) if isinstance(ends[0], str) and isinstance(ends[1], str) else angle
        arm, (x, y) = _turned(local[held], turned), places[each][held]
        frames[each] = {body: Pose(turned, (x - arm[0], y - arm[1]))}
        sheet = sheet.put(("assembly", each, body), turned)
    for name, end in zip(names, ends, strict=True):
        sheet = _pinned(sheet, end, f"{body}.{name}") if isinstance(end, str) else sheet
    return placed(before, sheet, frames), f"body.{body}"


def add_joint(sheet: Sheet, action: Action) -> Done:
    """Add a joint of any kind between two points; its `direction` counts in the ground frame [rad]."""
    before, kind = sheet, action.get("type", "revolute")
    a, b = str(action.get("a")), str(action.get("b"))
    known(kind, list(JOINT_KINDS), "type", "kind of joint")
    if b.startswith(f"{GROUND}."):
        a, b = b, a
    fields = _fields_of(sheet, action, JOINT_KINDS[kind], a, b)
    name = sheet.free_name(action, "joint", "joint") if action.get("name") else _joint_name(sheet, b)
    if kind == "revolute":
        sheet = sheet.put(("joint", name), [a, b])
    else:
        sheet = sheet.table(("joint", name), {"type": kind, "points": [a, b]} | fields)
    bodies = {ref.partition(".")[0] for ref in (a, b)}
    return placed(before, without_spare_places(sheet, bodies)), f"joint.{name}"


def retype(sheet: Sheet, action: Action) -> Done:
    """Make a joint one of another type; what drives or loads it stays, if the joint still moves in that way."""
    name, kind = str(action.get("joint")), str(action.get("type"))
    known(kind, list(JOINT_KINDS), "type", "kind of joint")
    joint = next((one for one in sheet.joints if one.name == name), None)
    if joint is None:
        raise sheet.problem or InputError("no such joint", field="joint", value=name, remedy="choose a joint")
    a, b, thing = str(joint.a), str(joint.b), ("joint", name)
    table, old = {"type": kind, "points": [a, b]}, value_at(sheet.data, thing)
    table |= _fields_of(sheet, action, JOINT_KINDS[kind], a, b)
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
        after = without_things(after, list(users)) if users else after
    bodies = {joint.a.body, joint.b.body}
    return placed(sheet, without_spare_places(after, bodies)), spelt(thing)


def add_slider(sheet: Sheet, action: Action) -> Done:
    """Add a rail on the ground, and a block on it that is pinned to a point; or a pin in a slot if `block` is false."""
    at, along, before = action.get("at"), float(action.get("direction") or 0.0), sheet
    sheet = _with_assembly(sheet)
    shown = action.get("assembly") or sheet.shown
    place, rail = _place(before, at, shown), at
    pinned = isinstance(at, str) and not at.startswith(f"{GROUND}.")
    if pinned or not isinstance(rail, str):
        point = sheet.fresh_point()
        rail, sheet = f"{GROUND}.{point}", sheet.put(("ground", point), tidy(place))
    if action.get("block", True) is False:
        if not pinned:
            raise InputError(
                "a slot holds the point of a link", field="at", value=at, remedy="choose a point of a link"
            )
        return add_joint(sheet, {"type": "slot", "a": rail, "b": at, "direction": along, "assembly": shown})
    body, pin = sheet.free_name(action, "body", "slider"), str(at if pinned else rail).partition(".")[2]
    sheet = sheet.table(("body", body), {"type": "rigid", "points": {pin: [0.0, 0.0]}})
    frames = {}
    for each in sheet.names("assembly"):
        sheet = sheet.put(("assembly", each, body), 0.0)
        frames[each] = {body: Pose(0.0, _place(before, at, each) if pinned else place)}
    sheet = _pinned(sheet, str(at), f"{body}.{pin}") if pinned else sheet
    name = sheet.fresh("rail", "joint")
    table = {"type": "prismatic", "points": [rail, f"{body}.{pin}"]} | ({"direction": along} if along else {})
    return placed(before, sheet.table(("joint", name), table), frames), f"joint.{name}"


def add_point(sheet: Sheet, action: Action) -> Done:
    """Add a further point to a link."""
    body, name = action.get("body", ""), action.get("name") or sheet.fresh_point()
    known(body, sheet.names("body"), "body", "body")
    frame = sheet.frame(body, action.get("assembly") or sheet.shown)
    check_name(name, sheet.locals[body], f"body.{body}.points.{name}")
    x, y = _xy(action.get("at"), "at")
    local = _turned((x - frame.origin[0], y - frame.origin[1]), -frame.angle)
    on_axis = sheet.data["body"][body].get("type") in ("beam", "assumed-modes")
    return sheet.put(("body", body, "points", name), local[0] if on_axis else tidy(local)), f"{body}.{name}"


def _fields_of(sheet: Sheet, action: Action, kind: type[Joint], a: str, b: str) -> dict[str, float]:
    """Return the directions of a joint as its points are in the picture, without those that are zero."""
    shown = action.get("assembly") or sheet.shown
    start, end = sheet.place(a, shown), sheet.place(b, shown)
    turned = [sheet.angle(ref.partition(".")[0], shown) for ref in (a, b)]
    fields = {}
    if "axis" in kind.holds and not kind.follows_beam:
        along = action.get("direction")
        if along is None:
            along = direction(start, end) if dist(start, end) > 1e-9 else 0.0
        fields["direction"] = float(along) - turned[0]
    if "angle" in kind.holds:
        fields["angle"] = turned[1] - turned[0]
    if "distance" in kind.holds:
        fields["length"] = dist(start, end)
    return {key: value for key, value in fields.items() if abs(value) > 1e-6}


def _xy(place: Any, field: str) -> XY:
    if isinstance(place, Sequence) and not isinstance(place, str) and len(place) == 2:
        return float(place[0]), float(place[1])
    raise InputError("not a place", field=field, value=place, remedy="give [x, y] in m")


def _place(sheet: Sheet, at: Any, assembly: str) -> XY:
    return sheet.place(at, assembly) if isinstance(at, str) else _xy(at, "at")


def _joint_name(sheet: Sheet, ref: str) -> str:
    """Return the name of the point for a new joint, with a number if it is taken."""
    point = ref.partition(".")[2]
    return point if point not in sheet.names("joint") else sheet.fresh(f"{point}_", "joint")


def _pinned(sheet: Sheet, a: str, b: str) -> Sheet:
    return sheet.put(("joint", _joint_name(sheet, b)), [a, b])


def _turned(place: XY, angle: float) -> XY:
    c, s = cos(angle), sin(angle)
    return c * place[0] - s * place[1], s * place[0] + c * place[1]


def _names_of(sheet: Sheet, ends: Sequence[Any]) -> list[str]:
    """Return a name for each point of a new link: that of the point to which it is joined, or a fresh one."""
    names: list[str] = []
    for end in ends:
        shared = end.partition(".")[2] if isinstance(end, str) else ""
        taken = [*names, *(each.partition(".")[2] for each in ends if isinstance(each, str))]
        names.append(shared if shared and shared not in names else sheet.fresh_point(taken))
    return names


def _with_assembly(sheet: Sheet) -> Sheet:
    """Return a sheet with an assembly; a first one is named "drawn"."""
    if sheet.names("assembly"):
        return sheet
    return sheet.table(("assembly", "drawn"), {})


def _with_body(sheet: Sheet, body: str, points: Mapping[str, XY], flexible: bool) -> Sheet:
    """Add a straight beam of the first section and material of the file, or a rigid body without mass."""
    if len(points) > 2 or not flexible:
        return sheet.table(("body", body), {"type": "rigid", "points": {key: tidy(xy) for key, xy in points.items()}})
    (first, _), (last, (length, _)) = points.items()
    sheet, section = _with_first(sheet, "section", "bar", _SECTION)
    sheet, material = _with_first(sheet, "material", "aluminium", _MATERIAL)
    table = {"type": "beam", "length": length, "section": section, "material": material,
             "points": {first: 0.0, last: length}, "elements": 3}  # fmt: skip
    return sheet.table(("body", body), table)


def _with_first(sheet: Sheet, table: str, name: str, default: Mapping[str, Any]) -> tuple[Sheet, str]:
    """Return the first name of a table, after adding a default if it has none."""
    names = sheet.names(table)
    return (sheet, names[0]) if names else (sheet.table((table, name), default), name)
