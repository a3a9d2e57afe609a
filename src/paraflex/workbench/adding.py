"""Actions that add motors, forces, sensors and paths to a mechanism."""

from collections.abc import Callable, Mapping
from itertools import pairwise
from math import floor, hypot, log10, pi
from typing import Any

from paraflex.driven.ranges import freedoms_at
from paraflex.errors import InputError, NumericalError
from paraflex.mechanism.quantities import known
from .changing import rename
from .linking import add_ground, add_joint, add_link, add_point, add_slider, retype
from .sheet import Action, Done, Sheet, check_name

_LUMP = {"mass": "0.1 kg", "inertia": "20 kg mm^2"}
# Time in which a new path is run through [s]; the acceleration follows.
_MOTION = 0.5
_COORDINATES = {1: ["x"], 2: ["x", "y"], 3: ["x", "y", "angle"]}


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
    joint = _undriven(sheet, action)
    # A speed in its unit is a whole turn in the duration, to the last digit.
    speed, duration = ("100 mm/s" if _slides(sheet, joint) else "60 rpm"), 1.0
    if action.get("speed"):
        speed = float(action["speed"])
        duration = 1.0 if _slides(sheet, joint) else abs(2.0 * pi / speed)
    name = sheet.free_name(action, "prescribed", "drive")
    sheet = sheet.table(("prescribed", name), {"joint": joint, "speed": speed})
    if not sheet.data.get("study", {}).keys() & {"duration", "path", "paths"}:
        sheet = sheet.put(("study", "duration"), duration)
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
    """Add a damper at a joint, or between two points: a linear spring without stiffness."""
    if "points" in action:
        table = {"points": list(action["points"]), "damping": float(action.get("damping", 10.0))}
        return _member(sheet, action, "linear_spring", table, "damper")
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
    lump = action.get("lump") or next(iter(sheet.names("lump")), "pin")
    if lump not in sheet.names("lump"):
        sheet = sheet.table(("lump", lump), {key: action.get(key, value) for key, value in _LUMP.items()})
    return sheet.put(("body", body, "lumps", point), lump), f"body.{body}"


def add_sensor(sheet: Sheet, action: Action) -> Done:
    """Add a sensor at a joint, a point or a beam."""
    if "joint" in action:
        table = {"type": action.get("type", "encoder"), "joint": action["joint"]}
        table |= {"axis": action.get("axis", "x")} if table["type"] == "joint_force" else {}
    elif "body" in action:
        body = _known(sheet, action, "body")
        if "length" not in sheet.data["body"][body]:
            remedy = "click on a point of it: Further point (O) adds one"
            raise InputError("a rigid link has no strain", field="sensor", value=body, remedy=remedy)
        length = sheet.number(("body", body, "length"))
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
    size = max((hypot(a[0] - b[0], a[1] - b[1]) for a, b in pairwise(corners)), default=0.0)
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


def _known(sheet: Sheet, action: Action, table: str) -> str:
    name: Any = action.get(table)
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
    "add-gravity": add_gravity, "retype": retype,
}  # fmt: skip
