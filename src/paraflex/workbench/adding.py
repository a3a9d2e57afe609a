"""Actions that add members to a mechanism."""

from collections.abc import Callable, Mapping, Sequence
from math import cos, degrees, floor, hypot, log10, pi, sin
from typing import Any

from paraflex.driven.ranges import freedoms_at
from paraflex.errors import InputError, NumericalError
from paraflex.mechanism import JOINT_KINDS
from paraflex.mechanism.joints import GROUND
from paraflex.mechanism.poses import Pose
from paraflex.mechanism.quantities import known
from .changing import rename
from .sheet import XY, Action, Done, Sheet, check_name, direction, placed, tidy, without_spare_places

_SECTION = {"width": "30 mm", "thickness": "5 mm"}
_MATERIAL = {"youngs_modulus": "70 GPa", "density": 2700.0}
_LUMP = {"mass": "0.1 kg", "inertia": "20 kg mm^2"}
# Time in which a new path is run through [s]; the acceleration follows.
_MOTION = 0.5
_COORDINATES = {1: ["x"], 2: ["x", "y"], 3: ["x", "y", "angle"]}


def add_ground(sheet: Sheet, action: Action) -> Done:
    """Add a point of the ground."""
    name = action.get("name") or sheet.fresh_point()
    check_name(name, sheet.names("ground"), f"ground.{name}")
    return sheet.put(("ground", name), tidy(_xy(action, "at"))), f"ground.{name}"


def add_link(sheet: Sheet, action: Action) -> Done:
    """Add a link through points; a point of another body or of the ground becomes a revolute joint."""
    ends = action.get("points")
    if not isinstance(ends, Sequence) or isinstance(ends, str) or len(ends) < 2:
        raise InputError("needs two points", field="points", value=ends, remedy="give places [x, y] or points")
    body, before = sheet.free_name(action, "body", "link"), sheet
    names = _names_of(sheet, ends)
    sheet = _with_assembly(sheet)
    shown = action.get("assembly") or sheet.shown
    places = {each: [_place(before, end, each) for end in ends] for each in sheet.names("assembly")}
    origin, angle = places[shown][0], direction(places[shown][0], places[shown][1])
    local = [_turned((x - origin[0], y - origin[1]), -angle) for x, y in places[shown]]
    sheet = _with_body(sheet, body, dict(zip(names, local, strict=True)), bool(action.get("flexible")))
    frames = {}
    for each, (start, second, *_) in places.items():
        turned = direction(start, second) if isinstance(ends[0], str) and isinstance(ends[1], str) else angle
        frames[each] = {body: Pose(turned, start)}
        sheet = sheet.put(("assembly", each, body), turned)
    for name, end in zip(names, ends, strict=True):
        if isinstance(end, str):
            joint = name if name not in sheet.names("joint") else sheet.fresh(name, "joint")
            sheet = sheet.put(("joint", joint), [end, f"{body}.{name}"])
    if not any(isinstance(end, str) for end in ends[:1]):
        held = next((k for k, end in enumerate(ends) if isinstance(end, str)), None)
        frames = frames if held is None else _held_at(frames, body, local[held], places, held)
    return placed(before, sheet, frames), f"body.{body}"


def add_joint(sheet: Sheet, action: Action) -> Done:
    """Add a joint of any kind between two points; its `direction` counts in the ground frame [rad]."""
    kind, a, b = (action.get(key, default) for key, default in (("type", "revolute"), ("a", ""), ("b", "")))
    known(kind, list(JOINT_KINDS), "type", "kind of joint")
    shown, before = action.get("assembly") or sheet.shown, sheet
    if str(b).startswith(f"{GROUND}."):
        a, b = b, a
    start, end = sheet.place(a, shown), sheet.place(b, shown)
    name = _free_joint(sheet, action, a, b)
    turned = [sheet.angle(ref.partition(".")[0], shown) for ref in (a, b)]
    fields = {}
    if "axis" in JOINT_KINDS[kind].holds and not JOINT_KINDS[kind].follows_beam:
        along = action.get("direction")
        apart = hypot(end[0] - start[0], end[1] - start[1]) > 1e-9
        fields["direction"] = (direction(start, end) if apart else 0.0) if along is None else float(along)
        fields["direction"] -= turned[0]
    if "angle" in JOINT_KINDS[kind].holds:
        fields["angle"] = turned[1] - turned[0]
    if "distance" in JOINT_KINDS[kind].holds:
        fields["length"] = hypot(end[0] - start[0], end[1] - start[1])
    fields = {key: value for key, value in fields.items() if abs(value) > 1e-6}
    if kind == "revolute":
        sheet = sheet.put(("joint", name), [a, b])
    else:
        sheet = sheet.table(("joint", name), {"type": kind, "points": [a, b]} | fields)
    bodies = {ref.partition(".")[0] for ref in (a, b)}
    return placed(before, without_spare_places(sheet, bodies)), f"joint.{name}"


def add_slider(sheet: Sheet, action: Action) -> Done:
    """Add a rail on the ground, and a block on it that is pinned to a point; or a pin in a slot if `block` is false."""
    at, along = action.get("at"), float(action.get("direction") or 0.0)
    before, sheet = sheet, _with_assembly(sheet)
    shown = action.get("assembly") or sheet.shown
    place = _place(before, at, shown)
    pinned = isinstance(at, str) and not at.startswith(f"{GROUND}.")
    if isinstance(at, str) and not pinned:
        rail = at
    else:
        point = sheet.fresh_point()
        rail, sheet = f"{GROUND}.{point}", sheet.put(("ground", point), tidy(place))
    if action.get("block", True) is False:
        if not pinned:
            raise InputError(
                "a slot holds the point of a link", field="at", value=at, remedy="choose a point of a link"
            )
        return add_joint(sheet, {"type": "slot", "a": rail, "b": at, "direction": along, "assembly": shown})
    body = sheet.free_name(action, "body", "slider")
    pin = str(at).partition(".")[2] if pinned else rail.partition(".")[2]
    sheet = sheet.table(("body", body), {"type": "rigid", "points": {pin: [0.0, 0.0]}})
    frames = {}
    for each in sheet.names("assembly"):
        sheet = sheet.put(("assembly", each, body), 0.0)
        frames[each] = {body: Pose(0.0, _place(before, at, each) if pinned else place)}
    if pinned:
        name = pin if pin not in sheet.names("joint") else sheet.fresh(pin, "joint")
        sheet = sheet.put(("joint", name), [at, f"{body}.{pin}"])
    name = sheet.fresh("rail", "joint")
    direct = {"direction": along} if along else {}
    sheet = sheet.table(("joint", name), {"type": "prismatic", "points": [rail, f"{body}.{pin}"]} | direct)
    return placed(before, sheet, frames), f"joint.{name}"


def add_point(sheet: Sheet, action: Action) -> Done:
    """Add a further point to a link."""
    body, shown = _known(sheet, action, "body"), action.get("assembly") or sheet.shown
    frame = sheet.frames.get(shown, {}).get(body)
    if frame is None or frame.position is None:
        raise InputError("its place is not known", field=f"body.{body}", remedy="give its angle in an assembly")
    name = action.get("name") or sheet.fresh_point()
    check_name(name, sheet.locals[body], f"body.{body}.points.{name}")
    x, y = _xy(action, "at")
    local = _turned((x - frame.position[0], y - frame.position[1]), -frame.angle)
    on_axis = sheet.data["body"][body].get("type") in ("beam", "assumed-modes")
    return sheet.put(("body", body, "points", name), local[0] if on_axis else tidy(local)), f"body.{body}"


def add_motor(sheet: Sheet, action: Action) -> Done:
    """Add a motor at a joint, and enter it in the mode of all motors."""
    joint = _undriven(sheet, action)
    name, others = sheet.free_name(action, "motor", "motor"), sheet.names("motor")
    sheet = sheet.put(("motor", name), joint)
    modes = sheet.data.get("mode", {})
    whole = next((mode for mode, motors in modes.items() if motors == others and mode == "+" * len(others)), None)
    if whole is not None and others:
        listed = [mode for mode in modes if mode != whole and set(mode) <= set("+-0")]
        if not listed:
            sheet = sheet.append(("mode", whole), name)
            return rename(sheet, {"kind": "rename", "of": "mode", "name": whole, "to": whole + "+"})[0], f"motor.{name}"
    if not modes:
        sheet = sheet.put(("mode", "+" * (len(others) + 1)), [*others, name])
    return sheet, f"motor.{name}"


def add_mode(sheet: Sheet, action: Action) -> Done:
    """Add a mode of motors; by default its name has a sign for each motor."""
    motors = list(action.get("motors") or ())
    for each in motors:
        known(each, sheet.names("motor"), "motors", "motor")
    signs = "".join("+" if each in motors else "-" for each in sheet.names("motor"))
    name = action.get("name") or signs
    check_name(name, sheet.names("mode"), f"mode.{name}")
    return sheet.put(("mode", name), motors), f"mode.{name}"


def add_drive(sheet: Sheet, action: Action) -> Done:
    """Add a motion of constant speed at a joint; a model without a path runs for one turn by default."""
    joint, speed = _undriven(sheet, action), float(action.get("speed") or 2.0 * pi)
    name = sheet.free_name(action, "prescribed", "drive")
    sheet = sheet.table(("prescribed", name), {"joint": joint, "speed": speed})
    study = sheet.data.get("study", {})
    if not study.keys() & {"duration", "path", "paths"}:
        sheet = sheet.put(("study", "duration"), abs(2.0 * pi / speed) if not _slides(sheet, joint) else 1.0)
    return sheet, f"prescribed.{name}"


def add_gear(sheet: Sheet, action: Action) -> Done:
    """Add a constant ratio between two joints."""
    joints = list(action.get("joints") or ())
    return _member(sheet, action, "gear", {"joints": joints, "ratio": float(action.get("ratio", -1.0))})


def add_spring(sheet: Sheet, action: Action) -> Done:
    """Add a spring at a joint, free in the pose shown, or between two points."""
    shown = action.get("assembly") or sheet.shown
    if "points" in action:
        one, other = (sheet.place(ref, shown) for ref in action["points"])
        table = {"points": list(action["points"]), "stiffness": float(action.get("stiffness", 100.0)),
                 "length": hypot(other[0] - one[0], other[1] - one[1])}  # fmt: skip
        return _member(sheet, action, "linear_spring", table, "spring")
    return _member(sheet, action, "spring", {"joint": action.get("joint"), "stiffness": action.get("stiffness", 1.0)}
                   | ({"rest": float(action["rest"])} if "rest" in action else {}))  # fmt: skip


def add_damper(sheet: Sheet, action: Action) -> Done:
    """Add a damper at a joint."""
    return _member(
        sheet, action, "damper", {"joint": action.get("joint"), "coefficient": action.get("coefficient", 0.1)}
    )


def add_load(sheet: Sheet, action: Action) -> Done:
    """Add a force or a torque at a point of a body."""
    kind = "torque" if "torque" in action else "force"
    value = action.get(kind, [0.0, -10.0])
    return _member(sheet, action, "load", {"type": kind, "point": action.get("at"), kind: value}, kind)


def add_lump(sheet: Sheet, action: Action) -> Done:
    """Add a lumped mass at a point of a beam: the first of the file, or a new one."""
    body, _, point = str(action.get("at")).partition(".")
    if sheet.data.get("body", {}).get(body, {}).get("type") not in ("beam", "assumed-modes"):
        raise InputError("not a point of a beam", field="at", value=action.get("at"),
                         remedy="a rigid body has a mass of its own")  # fmt: skip
    lump = action.get("name") or next(iter(sheet.names("lump")), "pin")
    if lump not in sheet.names("lump"):
        sheet = sheet.table(("lump", lump), {key: action.get(key, value) for key, value in _LUMP.items()})
    return sheet.put(("body", body, "lumps", point), lump), f"body.{body}"


def add_sensor(sheet: Sheet, action: Action) -> Done:
    """Add a sensor at a joint, a point or a beam."""
    if "joint" in action:
        table = {"type": action.get("type", "encoder"), "joint": action["joint"]}
        table |= {"axis": action.get("axis", "x")} if table["type"] == "joint_force" else {}
    elif "body" in action:
        length = sheet.number(("body", _known(sheet, action, "body"), "length"))
        table = {"type": "strain", "body": action["body"], "at": action.get("at", length / 2.0)}
    else:
        table = {"type": action.get("type", "position"), "point": action.get("at"), "axis": action.get("axis", "x")}
    return _member(sheet, action, "sensor", table, table["type"])


def set_effector(sheet: Sheet, action: Action) -> Done:
    """Let a point be the end-effector; a new one has as many task coordinates as there are degrees of freedom."""
    if "end_effector" in sheet.data:
        return sheet.put(("end_effector", "point"), action.get("at")), "end_effector"
    coordinates = action.get("coordinates") or _COORDINATES.get(_freedoms(sheet), ["x", "y"])
    table = {"point": action.get("at"), "coordinates": list(coordinates)}
    return sheet.table(("end_effector",), table), "end_effector"


def add_path(sheet: Sheet, action: Action) -> Done:
    """Add a path of the end-effector, on which runs go unless the study has another."""
    name, kind = sheet.free_name(action, "path", "path"), action.get("type", "polygon")
    table = {key: value for key, value in action.items() if key not in ("kind", "type", "name", "points", "assembly")}
    corners = [list(map(float, each)) for each in action.get("points", [])]
    if kind == "polygon":
        table["corners"] = corners
    elif kind == "line" and len(corners) == 2:
        table |= {"start": corners[0], "end": corners[1]}
    elif corners:
        table["points"] = corners
    size = max((hypot(a[0] - b[0], a[1] - b[1]) for a, b in zip(corners, corners[1:], strict=False)), default=0.0)
    size = size or 2.0 * pi * float(action.get("radius", 0.05))
    if kind in ("polygon", "line", "circle"):
        table.setdefault("max_acceleration", _round(5.0 * size / _MOTION**2))
    else:
        table.setdefault("motion_time", max(len(corners) - 1, 1) * _MOTION)
    sheet = sheet.table(("path", name), {"type": kind} | table)
    if not sheet.data.get("study", {}).keys() & {"path", "paths", "torques"}:
        sheet = sheet.put(("study", "path"), name)
    return sheet, f"path.{name}"


def add_gravity(sheet: Sheet, action: Action) -> Done:
    """Set the vector of free fall [m/s^2], by default along -y."""
    return sheet.put(("gravity",), [float(each) for each in action.get("value", [0.0, -9.81])]), "gravity"


def _member(sheet: Sheet, action: Action, table: str, fields: Mapping[str, Any], stem: str = "") -> Done:
    name = sheet.free_name(action, table, stem or table)
    return sheet.table((table, name), fields), f"{table}.{name}"


def _xy(action: Action, key: str) -> XY:
    place = action.get(key)
    if isinstance(place, Sequence) and not isinstance(place, str) and len(place) == 2:
        return float(place[0]), float(place[1])
    raise InputError("not a place", field=key, value=place, remedy="give [x, y] in m")


def _place(sheet: Sheet, at: Any, assembly: str) -> XY:
    return sheet.place(at, assembly) if isinstance(at, str) else _xy({"at": at}, "at")


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
    (_, (_, _)), (last, (length, _)), *further = points.items()
    if further or not flexible:
        return sheet.table(("body", body), {"type": "rigid", "points": {key: tidy(xy) for key, xy in points.items()}})
    sheet, section = _with_first(sheet, "section", "bar", _SECTION)
    sheet, material = _with_first(sheet, "material", "aluminium", _MATERIAL)
    table = {"type": "beam", "length": length, "section": section, "material": material,
             "points": {next(iter(points)): 0.0, last: length}, "elements": 3}  # fmt: skip
    return sheet.table(("body", body), table)


def _with_first(sheet: Sheet, table: str, name: str, default: Mapping[str, Any]) -> tuple[Sheet, str]:
    """Return the first name of a table, after adding a default if it has none."""
    names = sheet.names(table)
    return (sheet, names[0]) if names else (sheet.table((table, name), default), name)


def _held_at(
    frames: Mapping[str, Mapping[str, Pose]], body: str, local: XY, places: Mapping[str, Sequence[XY]], held: int
) -> dict[str, dict[str, Pose]]:
    """Return poses of a body that is held at a point other than its first."""
    out = {}
    for assembly, poses in frames.items():
        arm = _turned(local, poses[body].angle)
        x, y = places[assembly][held]
        out[assembly] = {body: Pose(poses[body].angle, (x - arm[0], y - arm[1]))}
    return out


def _free_joint(sheet: Sheet, action: Action, a: str, b: str) -> str:
    if action.get("name") is not None:
        return sheet.free_name(action, "joint", "joint")
    point = b.partition(".")[2]
    return point if point not in sheet.names("joint") else sheet.fresh(point, "joint")


def _known(sheet: Sheet, action: Action, table: str) -> str:
    name = action.get(table)
    known(name, sheet.names(table), table, table)
    return str(name)


def _undriven(sheet: Sheet, action: Action) -> str:
    """Return the joint that an action drives, if nothing drives it yet."""
    joint = _known(sheet, action, "joint")
    for table in ("motor", "prescribed"):
        for name, each in sheet.data.get(table, {}).items():
            if (each if isinstance(each, str) else each.get("joint")) == joint:
                remedy = f"delete {table}.{name} first, or choose another joint"
                raise InputError("is driven already", field=f"joint.{joint}", remedy=remedy)
    return joint


def _slides(sheet: Sheet, joint: str) -> bool:
    return any(one.name == joint and one.slides for one in sheet.joints)


def _freedoms(sheet: Sheet) -> int:
    """Return the degrees of freedom in the assembly shown; zero if they are not known."""
    found = sheet.mechanism
    try:
        return freedoms_at(found, found.assembly(sheet.shown))[0] if found and sheet.shown else 0
    except (InputError, NumericalError):
        return 0


def _round(value: float) -> float:
    """Round a number to two digits."""
    return round(value, 1 - floor(log10(abs(value)))) if value else 1.0


Adding = Callable[[Sheet, Action], Done]
ADDING: dict[str, Adding] = {
    "add-ground": add_ground, "add-link": add_link, "add-joint": add_joint, "add-slider": add_slider,
    "add-point": add_point, "add-motor": add_motor, "add-mode": add_mode, "add-drive": add_drive,
    "add-gear": add_gear, "add-spring": add_spring, "add-damper": add_damper, "add-load": add_load,
    "add-lump": add_lump, "add-sensor": add_sensor, "set-effector": set_effector, "add-path": add_path,
    "add-gravity": add_gravity,
}  # fmt: skip
