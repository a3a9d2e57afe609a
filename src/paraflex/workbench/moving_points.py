"""The action that moves a point: the numbers behind its place change in the way in which they are written."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from math import cos, hypot, isclose, sin
from typing import Any

from paraflex.errors import InputError, listed
from paraflex.expressions.evaluate import ExpressionError, evaluate, names_in
from paraflex.files.fields import Place, value_at
from paraflex.mechanism import Joint
from paraflex.mechanism.joints import GROUND
from paraflex.mechanism.poses import Pose
from paraflex.units import quantities_in
from .edits import number_text
from .sheet import XY, Action, Done, Sheet, direction, near

# Numbers whose difference is smaller count as equal [m, rad].
_EQUAL = 1e-7
_ITERATIONS = 30


def move_point(sheet: Sheet, action: Action) -> Done:
    """Move a point, and the points joined to it, to a place in the assembly shown."""
    ref, to = str(action.get("ref")), tuple(map(float, action.get("to") or ()))
    if ref not in sheet.refs or len(to) != 2:
        raise sheet.unknown_point(ref)
    assembly, before = action.get("assembly") or sheet.shown, sheet
    moved = joined_to(sheet, ref)
    turns: dict[str, float] = {}
    for each in moved:
        body, _, point = each.partition(".")
        if body == GROUND:
            for k in range(2):
                sheet = with_number(sheet, (GROUND, point, k), to[k])
        else:
            sheet, turns[body] = _with_body(sheet, before, body, point, (to[0], to[1]), assembly)
    for joint in before.joints:
        sheet = _with_directions(sheet, joint, turns)
    sheet = with_starts(sheet, turns)
    for body, turn in turns.items():
        old = value_at(sheet.data, ("assembly", assembly, body))
        if turn and old is not None and not (isinstance(old, str) and names_in(old) & sheet.parameters.keys()):
            angle = before.angle(body, assembly) + turn
            sheet = with_number(
                sheet, ("assembly", assembly, body), near(angle, before.number(("assembly", assembly, body)))
            )
    for each in moved:
        if value_at(sheet.data, ("assembly", assembly, "points", each)) is not None:
            sheet = sheet.put(("assembly", assembly, "points", each), list(to))
    return sheet, f"ground.{ref.partition('.')[2]}" if ref.startswith(f"{GROUND}.") else f"body.{ref.partition('.')[0]}"


def with_starts(sheet: Sheet, turns: Mapping[str, float], travels: Mapping[str, float] | None = None) -> Sheet:
    """Let prescribed motions begin at the angles to which bodies have turned, and at the travels of sliding joints.

    Laws of the time stay as they are.
    """
    joints, travels = {joint.name: joint for joint in sheet.joints}, travels or {}
    for name in sheet.names("prescribed"):
        place = ("prescribed", name, "angle")
        joint = joints.get(str(value_at(sheet.data, ("prescribed", name, "joint"))))
        if joint is not None and value_at(sheet.data, place) is not None:
            change = turns.get(joint.b.body, 0.0) - turns.get(joint.a.body, 0.0)
            with suppress(InputError):
                sheet = with_number(sheet, place, sheet.number(place) + change)
        place = ("prescribed", name, "displacement")
        if joint is not None and joint.name in travels and value_at(sheet.data, place) is not None:
            with suppress(InputError):
                sheet = with_number(sheet, place, float(travels[joint.name]))
    return sheet


def joined_to(sheet: Sheet, ref: str) -> list[str]:
    """Return a point and all points that joints hold to it."""
    found = [ref]
    for one in found:
        for joint in sheet.joints:
            pair = (str(joint.a), str(joint.b))
            if "points" in joint.holds and one in pair:
                found += [other for other in pair if other not in found]
    return found


def with_number(sheet: Sheet, place: Place, value: float) -> Sheet:
    """Give a number another value in its own unit; of an expression the one parameter changes.

    Raises
    ------
    InputError
        The expression depends on several parameters, or on one by which it cannot have the value.
    """
    old, field = value_at(sheet.data, place), ".".join(map(str, place))
    if abs(sheet.number(place) - value) <= _EQUAL:
        return sheet
    if not isinstance(old, str):
        return sheet.put(place, float(value))
    names = sorted(names_in(old) & sheet.parameters.keys())
    if not names:
        return _with_unit(sheet, place, old, value)
    if len(names) > 1:
        which = listed([f"parameters.{name}" for name in names])
        raise InputError(f"depends on {which}", field=field, value=old, remedy="change one of these, or write a number")
    return with_number(sheet, ("parameters", names[0]), _solved(sheet, field, old, names[0], value))


def _with_unit(sheet: Sheet, place: Place, old: str, value: float) -> Sheet:
    """Write a value in the unit of a number such as "80 mm"; any other constant becomes a plain number."""
    text, found = old.strip(), quantities_in(old)
    sign = -1.0 if text.startswith("-") else 1.0
    if len(found) != 1 or text.lstrip("+- ") != old[found[0].start : found[0].end] or not found[0].value:
        return sheet.put(place, float(value))
    number = evaluate(f"1 {found[0].unit}", {})
    written = number_text(sign * sign * value / number).removesuffix(".0")
    return sheet.put(place, f"{written} {found[0].unit}")


def _solved(sheet: Sheet, field: str, text: str, name: str, value: float) -> float:
    """Return the value of a parameter for which an expression has a value, by the secant method."""

    def residual(x: float) -> float:
        return evaluate(text, {**sheet.parameters, name: x}) - value

    x = sheet.parameters[name]
    other = x + 1e-4 * (abs(x) or 1.0)
    try:
        f, g = residual(x), residual(other)
        for _ in range(_ITERATIONS):
            if abs(g) < 1e-12 or g == f:
                break
            x, f, other = other, g, other - g * (other - x) / (g - f)
            g = residual(other)
        if abs(g) < _EQUAL:
            return other
    except (ExpressionError, OverflowError):
        pass
    remedy = f"change parameters.{name}, or write a number"
    raise InputError(f"cannot become {number_text(value)}", field=field, value=text, remedy=remedy)


def _with_body(sheet: Sheet, before: Sheet, body: str, point: str, to: XY, assembly: str) -> tuple[Sheet, float]:
    """Return the sheet with a point of a body elsewhere, and the angle by which the body turns [rad]."""
    frame, table = before.frame(body, assembly), before.data["body"][body]
    if table.get("type") == "modal":
        raise InputError("a body of matrices has fixed points", field=f"body.{body}.points.{point}",
                         remedy="change its matrices in the text")  # fmt: skip
    points = before.locals[body]
    if table.get("type") in ("beam", "assumed-modes"):
        return _with_beam(sheet, before, (body, point), frame, to)
    if len(points) == 2:
        return _with_bar(sheet, body, point, points, frame, to)
    if len(points) > 2:
        x, y = to[0] - frame.origin[0], to[1] - frame.origin[1]
        c, s = cos(frame.angle), sin(frame.angle)
        sheet = _with_pair(sheet, ("body", body, "points", point), (c * x + s * y, c * y - s * x))
    return sheet, 0.0


def _with_beam(sheet: Sheet, before: Sheet, named: tuple[str, str], frame: Pose, to: XY) -> tuple[Sheet, float]:
    """Move an end of a beam, which gets longer and turns about its other end; other points move along it."""
    body, point = named
    length, at = before.number(("body", body, "length")), before.locals[body][point][0]
    first, last = isclose(at, 0.0, abs_tol=_EQUAL), isclose(at, length, abs_tol=_EQUAL)
    if not (first or last):
        start, end = frame.place_of((0.0, 0.0)), frame.place_of((length, 0.0))
        along = ((to[0] - start[0]) * (end[0] - start[0]) + (to[1] - start[1]) * (end[1] - start[1])) / length
        return with_number(sheet, ("body", body, "points", point), min(max(along, 0.0), length)), 0.0
    fixed = frame.place_of((0.0 if last else length, 0.0))
    new = hypot(to[0] - fixed[0], to[1] - fixed[1])
    angle = direction(fixed, to) if last else direction(to, fixed)
    sheet = with_number(sheet, ("body", body, "length"), new)
    for name, (x, _) in before.locals[body].items():
        if isclose(x, length, abs_tol=_EQUAL):
            sheet = with_number(sheet, ("body", body, "points", name), new)
    return sheet, near(angle - frame.angle, 0.0)


def _with_bar(sheet: Sheet, body: str, point: str, points: Any, frame: Pose, to: XY) -> tuple[Sheet, float]:
    """Move one of the two points of a rigid body, which turns about the other one."""
    other = next(name for name in points if name != point)
    arm = (points[point][0] - points[other][0], points[point][1] - points[other][1])
    fixed, size = frame.place_of(points[other]), hypot(*arm)
    new = hypot(to[0] - fixed[0], to[1] - fixed[1])
    turn = direction(fixed, to) - direction(fixed, frame.place_of(points[point]))
    scale = new / size
    # The point at the origin of the frame stays there, and the other one gets other coordinates.
    if hypot(*points[point]) < _EQUAL:
        pair, changed = (-arm[0] * scale, -arm[1] * scale), other
    else:
        pair, changed = (points[other][0] + arm[0] * scale, points[other][1] + arm[1] * scale), point
    return _with_pair(sheet, ("body", body, "points", changed), pair), near(turn, 0.0)


def _with_pair(sheet: Sheet, place: Place, pair: Sequence[float]) -> Sheet:
    for k in range(2):
        sheet = with_number(sheet, (*place, k), pair[k])
    return sheet


def _with_directions(sheet: Sheet, joint: Joint, turns: dict[str, float]) -> Sheet:
    """Keep the axes and angles of a joint in the picture although its bodies turn in it."""
    first, second = (turns.get(ref.body, 0.0) for ref in (joint.a, joint.b))
    changes = {"direction": -first if "axis" in joint.holds and not joint.follows_beam else 0.0,
               "angle": second - first if "angle" in joint.holds else 0.0}  # fmt: skip
    for key, change in changes.items():
        if abs(change) > _EQUAL:
            place = ("joint", joint.name, key)
            if value_at(sheet.data, place) is None:
                sheet = sheet.put(place, change)
            else:
                sheet = with_number(sheet, place, sheet.number(place) + change)
    return sheet
