"""Drive of a mechanism: the joint, its range, which ends at limits of reach, and the motion through it."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from paraflex.arrays import Array
from paraflex.dynamics import System, assembled_position
from paraflex.dynamics.joint_coordinates import joint_value, value_text
from paraflex.dynamics.soundness import mobility
from paraflex.dynamics.state import State
from paraflex.errors import AssemblyError, InputError, Moment, UnreachablePathError, listed
from paraflex.formatting import quantity
from paraflex.mechanism import Assembly, ConstantSpeed, Mechanism, PrescribedAngle
from paraflex.mechanism.quantities import finite, known
from paraflex.paths.loops import LoopClosure, no_long_steps
from .exact import AT, NO_TASKS, Drive, FirstPose, Held, follow_past, no_target, width_beside
from .limits import limit_of_reach

# Fraction of the range between two limits of reach that is left out at either limit, where rates grow without bound.
_MARGIN = 1e-3
# Largest travel of a sliding drive whose range is not given, in sizes of the mechanism.
_LONGEST_TRAVEL = 4.0
# Speeds below this, and above its inverse, are refused [rad/s, m/s].
_SLOWEST = 1e-12
# Largest number of turns of a drive.
_MOST_TURNS = 20.0
# Longest step of a drive as a fraction of a turn, or of its travel.
_STEP = 1.0 / 360.0
# Smallest singular value of the constraints, relative to the largest, at which a motion ends beside a change point.
_NEAR = 1e-2
# Distance from the first pose within which a motion stops there [sizes of the mechanism, rad].
_AT_FIRST = 1e-6
_GIVE_RANGE = "give the start and end of its travel"


class JointDrive(PrescribedAngle):
    """Prescribed motion of a joint that drives the mechanism, or is held, without a table of the model."""

    @property
    def place(self) -> str:
        """Name of the motion in messages."""
        return f"drive {self.joint}"


class Wish(NamedTuple):
    """Arguments of a motion: see `kinematics`."""

    drive: str | None
    held: Held
    start: float | None
    end: float | None
    speed: float | None
    duration: float | None

    @property
    def of_drive(self) -> str:
        """Name of an argument that only a motion of constant speed has; empty if none is given."""
        return next((name for name in ("held", "start", "end", "speed") if getattr(self, name) not in (None, {})), "")


def chosen_drive(mechanism: Mechanism, wish: Wish, freedoms: int, system: System, pose: Array) -> Drive | None:
    """Return the drive of constant speed; None if the mechanism's own prescribed motions act as they are."""
    joint, prescribed = wish.drive, mechanism.prescribed
    for held, value in wish.held.items():
        _check_joint(mechanism, held, "held")
        for each in value if isinstance(value, tuple) else (value,):
            finite(each, f"held.{held}")
    steady = [one for one in prescribed if isinstance(one.profile, ConstantSpeed) and one.joint not in wish.held]
    if joint is None and (len(steady) != 1 or len(prescribed) != 1):
        moving = [one.name for one in mechanism.joints if one.moves and one.name not in wish.held]
        motors = [motor.joint for motor in mechanism.motors if motor.joint not in wish.held] or moving
        if prescribed and not wish.of_drive:
            return None
        if wish.held and len(wish.held) >= freedoms:
            raise InputError(
                "nothing moves where all degrees of freedom are held", field="held", value=", ".join(wish.held),
                remedy="name a joint that moves without a value",
            )  # fmt: skip
        if not moving:
            raise InputError("no joint moves", field="drive", remedy="flexures move by bending: paraflex statics")
        if prescribed or len(motors) != 1 or freedoms > 1 + len(wish.held):
            hold = "" if freedoms < 2 else f", and {freedoms - 1} to hold, {_held_text(mechanism, motors[-1:])}"
            raise InputError(
                "is missing", field="drive", remedy=f"name the joint that drives the mechanism: {listed(moving)}{hold}"
            )
        joint = motors[0]
    elif joint is None:
        joint = steady[0].joint
    _check_joint(mechanism, joint, "drive")
    if joint in wish.held:
        raise InputError("one joint both moves and is held", field="drive", value=joint, remedy="leave one of them out")
    one = mechanism.joint(joint)
    before = next((each for each in prescribed if each.joint == joint), None)
    profile = None if before is None else before.profile
    steadily = profile if isinstance(profile, ConstantSpeed) else None
    unit = "m" if one.slides else "rad"
    speed = wish.speed
    if speed is None:
        speed = abs(steadily.speed) if steadily is not None and steadily.speed else 1.0
    if not _SLOWEST < speed < 1.0 / _SLOWEST:
        problem = "of no machine" if speed > 0.0 else "not positive"
        remedy = f"give it in {unit}/s; the range from start to end gives the direction"
        raise InputError(problem, field="speed", value=speed, remedy=remedy)
    start = joint_value(system, joint, pose) if wish.start is None else wish.start
    turn = 2.0 * math.pi if unit == "rad" else _LONGEST_TRAVEL * system.size
    if wish.end is not None and wish.duration is not None:
        raise InputError(
            "has no effect where the end of the drive is given", field="duration", value=wish.duration,
            remedy="leave one of them out: the speed gives the time",
        )  # fmt: skip
    if wish.end is not None and wish.end == start:
        remedy = "give another value than the start"
        raise InputError("the drive does not move", field="end", value=wish.end, remedy=remedy)
    travel = turn if wish.duration is None else speed * wish.duration
    backwards = steadily is not None and steadily.speed < 0.0
    last = start + (-travel if backwards else travel) if wish.end is None else wish.end
    own = joint if all(each.name != joint for each in prescribed) else f"{joint} drive"
    found = Drive(own if before is None else before.name, joint, start, last, speed, unit, held=dict(wish.held))
    if found.turns > _MOST_TURNS or max(abs(start), abs(last)) > _MOST_TURNS * max(turn, 2.0 * math.pi):
        field = "duration" if wish.duration is not None else "start" if wish.end is None else "end"
        example = {"rad": "90 deg", "m": "50 mm"}[unit]
        remedy = f'in another unit? It is in {unit}, or write "{example}"'
        if field == "duration":
            remedy = "give less" if wish.drive else "give less, or name the drive, which turns once"
        raise InputError(
            f"more than {_MOST_TURNS:g} turns" if unit == "rad" else "too far", field=field,
            value=getattr(wish, field), remedy=remedy,
        )  # fmt: skip
    return found


def _check_joint(mechanism: Mechanism, name: str, field: str) -> None:
    """Check that a drive is a joint that moves."""
    names = [one.name for one in mechanism.joints]
    on_body = [one.name for one in mechanism.joints if name in (one.a.body, one.b.body)]
    at = [one.joint for one in (*mechanism.motors, *mechanism.prescribed) if one.name == name]
    if name not in names and (on_body or at):
        remedy = f"name one of its joints: {', '.join(on_body or at)}"
        raise InputError("not a joint", field=field, value=name, remedy=remedy)
    known(name, names, field, "joint")
    mechanism.joint(name).check_moves(field)


def _held_text(mechanism: Mechanism, joints: Sequence[str]) -> str:
    """Return an example of a joint that is held, for the command line and Python."""
    name = next(iter(joints), "JOINT")
    value = "50 mm" if joints and mechanism.slides(name) else "30 deg"
    return f'as --drive "{name}={value}" (held={{...}} in Python)'


def freedoms_at(mechanism: Mechanism, assembly: Assembly) -> tuple[int, Array]:
    """Return the degrees of freedom without prescribed motions, and the closed pose of an assembly."""
    loops = LoopClosure(replace(mechanism, prescribed=()), 0.0, None, NO_TASKS)
    pose = loops.assembled(assembly)
    found = mobility(loops.system, State(0.0, pose, np.zeros(loops.system.n)))
    return found.nearby_freedoms or found.freedoms, pose


def check_determined(mechanism: Mechanism, freedoms: int) -> None:
    """Check that there are as many prescribed motions as degrees of freedom."""
    open_ones = freedoms - len(mechanism.prescribed)
    driven = [each.joint for each in mechanism.prescribed]
    if open_ones > 0:
        one, several = "1 degree of freedom", f"{open_ones} degrees of freedom"
        left = [each.joint for each in mechanism.motors if each.joint not in driven]
        left = left or [each.name for each in mechanism.joints if each.moves and each.name not in driven]
        raise InputError(
            f"the drives leave {one if open_ones == 1 else several} of the mechanism open", field="drive",
            value=", ".join(driven) or None, remedy=f"hold as many other joints, {_held_text(mechanism, left)}",
        )  # fmt: skip
    if open_ones < 0:
        raise InputError(
            f"{len(driven)} drives, where the mechanism has {freedoms} degree{'s' * (freedoms != 1)} of freedom",
            field="drive", value=", ".join(driven), remedy="leave a drive out, or a joint that blocks the mechanism",
        )  # fmt: skip


def driven_loops(mechanism: Mechanism, pose: Array, end: float, freedoms: int) -> tuple[LoopClosure, Array]:
    """Return the closure of a mechanism moved by its prescribed motions, and the pose at their start."""
    check_determined(mechanism, freedoms)
    loops = LoopClosure(mechanism, end, None, NO_TASKS)
    return loops, assembled_position(loops.system, loops.signals, 0.0, pose)


def _with_drive(mechanism: Mechanism, law: Drive, freedoms: int) -> Mechanism:
    """Return the mechanism with a drive instead of the prescribed motion, and of a motor, at the same joint.

    Other joints are held; other prescribed motions are left out if they are more than the degrees of freedom. Motors
    with actuators stay, as their rotors have inertia.
    """
    moved = (law.joint, *law.held)
    if not mechanism.actuators:
        motors = tuple(one for one in mechanism.motors if one.joint not in moved)
        mechanism = replace(mechanism, motors=motors, modes=())
    others = tuple(one for one in mechanism.prescribed if one.joint not in moved)
    if freedoms < len(moved) + len(others):
        others = ()
    names = {one.joint: one.name for one in mechanism.prescribed}
    drive = PrescribedAngle if law.joint in names else JointDrive
    taken = {one.name for one in others}
    held = tuple(
        JointDrive(joint if joint not in taken else f"{joint} held", joint,
                   ConstantSpeed(first, (last - first) / law.duration if last != first else 0.0))
        for joint, (first, last) in law.ends_of_others.items()
    )  # fmt: skip
    return replace(mechanism, prescribed=(drive(law.name, law.joint, law.profile), *held, *others))


def ranged(
    mechanism: Mechanism, law: Drive, pose: Array, freedoms: int, system: System, *, fixed: bool
) -> tuple[LoopClosure, FirstPose, Drive]:
    """Return closure, start and drive; without a given end the range is a turn or lies between two limits."""
    loops, first = _started(mechanism, law, pose, freedoms, system)
    if fixed or not law.alone or (stopped := _reached(loops, law, first)) is None:
        if not fixed and law.unit == "m":
            raise InputError(
                "a joint that slides without a limit of reach", field="drive", value=law.joint, remedy=_GIVE_RANGE
            )
        return loops, first, law
    ends = []
    for way in (law, replace(law, end=2.0 * law.start - law.end)):
        there = _closure(mechanism, way, freedoms)
        stopped = _reached(there, way, first)
        limit = None if stopped is None else limit_of_reach(there.system, law.joint, stopped)
        if limit is None:
            raise _barred(way, there, stopped, None, first)
        ends.append(limit)
    low, high = sorted(ends)
    reach, inside = (low, high), _MARGIN * (high - low)
    span = (low + inside, high - inside) if law.end > law.start else (high - inside, low + inside)
    if span[0] != law.start:
        back = replace(law, end=span[0])
        first = _end(_closure(mechanism, back, freedoms), back, first)
    law = replace(law, start=span[0], end=span[1], reach=reach)
    return _closure(mechanism, law, freedoms), FirstPose(first.q), law


def _started(
    mechanism: Mechanism, law: Drive, pose: Array, freedoms: int, system: System
) -> tuple[LoopClosure, FirstPose]:
    """Return closure and start; a start at a change point or beyond one is reached along the motion from a pose."""
    at_first = {joint: first for joint, (first, _) in law.ends_of_others.items()}
    way = replace(law, start=joint_value(system, law.joint, pose), end=law.start, held=at_first)
    try:
        loops, near = driven_loops(_with_drive(mechanism, law, freedoms), pose, law.duration, freedoms)
        if way.start == way.end or not _folded(loops, near):
            return loops, FirstPose(near)
    except AssemblyError:
        if way.start == way.end:
            raise
    there, pose = driven_loops(_with_drive(mechanism, way, freedoms), pose, way.duration, freedoms)
    end = _end(there, way, FirstPose(pose))
    if end.rates is None or not law.alone:
        return _closure(mechanism, law, freedoms), FirstPose(end.q)
    sign = math.copysign(1.0, (way.end - way.start) * (law.end - law.start))
    return _closure(mechanism, law, freedoms), FirstPose(end.q, (sign * end.rates[0], end.rates[1]))


def _end(loops: LoopClosure, law: Drive, first: FirstPose) -> FirstPose:
    """Return the last pose of a motion, with velocities and accelerations."""
    _, q, v, a = followed(loops, np.array([0.0, law.duration]), first, law)[0]
    return FirstPose(q[-1], (v[-1], a[-1]))


def _folded(loops: LoopClosure, q: Array) -> bool:
    """Return whether a pose is near a change point or a limit of reach."""
    sizes = np.linalg.svd(loops.system.dimensionless_jacobian(q), compute_uv=False)
    return bool(sizes[-1] < _NEAR * sizes[0])


def _closure(mechanism: Mechanism, law: Drive, freedoms: int) -> LoopClosure:
    return LoopClosure(_with_drive(mechanism, law, freedoms), max(law.duration, 1e-6), None, NO_TASKS)


def _reached(loops: LoopClosure, law: Drive, first: FirstPose) -> Array | None:
    """Return the last pose with closed loops before the end of a drive's travel; None if it covers all of it."""
    times = np.linspace(0.0, law.duration, 181)
    keep = np.ones(times.size, dtype=bool)
    found, _ = follow_past(loops, no_target, times, keep, first, width_beside(law, law.duration))
    return None if found.closed else found.last


def followed(
    loops: LoopClosure, times: Array, first: FirstPose, law: Drive | None = None
) -> tuple[tuple[Array, ...], tuple[float, ...]]:
    """Return times, coordinates, velocities and accelerations along the whole motion, and times of change points."""
    grid, keep = times, np.ones(times.size, dtype=bool)
    if law is not None:
        grid, keep = no_long_steps(times, _STEP * law.duration / max(law.turns, 1.0))
    beside = width_beside(law, float(times[-1]), loops.mechanism)
    found, passed = follow_past(loops, no_target, grid, keep, first, beside)
    if not found.closed:
        raise _barred(law, loops, found.last, found.stopped, first)
    if law is not None and _folded(loops, found.last):
        # Accelerations at the end are rounding errors, unless they follow from the motion beyond a change point.
        beyond = np.append(grid, grid[-1] + 2.0 * beside), np.append(keep, False)
        more, later = follow_past(loops, no_target, *beyond, first, beside)
        if more.closed:
            found, passed = more, [t for t in later if t <= times[-1] + AT * beside]
    return found.arrays[:4], tuple(passed)


def _barred(
    law: Drive | None, loops: LoopClosure, last: Array | None, stopped: float | None, first: FirstPose
) -> UnreachablePathError:
    """Return the error of a motion that stops at a limit of reach or a change point."""
    system = loops.system
    q = last if last is not None else np.zeros(system.n)
    drives = ", ".join(f"{one.joint} at {value_text(system, one.joint, q)}" for one in system.mechanism.prescribed)
    limit = limit_of_reach(system, law.joint, q) if law is not None and law.alone and last is not None else None
    if limit is not None and law is not None:
        cause = f"{law.joint} reaches its limit of reach, {quantity(limit, law.unit, digits=6)},"
    elif first.rates is None and last is not None and np.max(np.abs((last - first.q) / system.units)) < _AT_FIRST:
        beside = "" if law is None else quantity(2.0 * law.speed * width_beside(law, law.duration), law.unit)
        remedy = f"give the assembly in another position{f', {beside} away' * bool(beside)}; the motion may start here"
        return UnreachablePathError(f"the assembly is at a change point, {drives}, where others meet it", remedy=remedy)
    else:
        cause = f"the motion passes a change point or a limit of reach near {drives},"
    at = Moment(stopped if stopped is not None else 0.0)
    return UnreachablePathError(cause, at, remedy="give a range on one side of it, or drive another joint")
