"""Drive of a mechanism: the joint, its range, which ends at limits of reach, and the motion through it."""

import math
from dataclasses import replace

import numpy as np

from paraflex.arrays import Array
from paraflex.dynamics import System, assembled_position, dependence
from paraflex.dynamics.constraints import constraint_count
from paraflex.dynamics.joint_coordinates import joint_value, value_text
from paraflex.errors import InputError, Moment, UnreachablePathError
from paraflex.formatting import quantity
from paraflex.mechanism import ConstantSpeed, Mechanism, PrescribedAngle
from paraflex.mechanism.quantities import known
from paraflex.paths.loops import LoopClosure, no_long_steps
from .exact import NO_TASKS, Drive, no_target
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
_GIVE_RANGE = "give the start and end of its travel"


def chosen_drive(
    mechanism: Mechanism, joint: str | None, start: float | None, end: float | None, speed: float | None,
    system: System, pose: Array,
) -> Drive | None:  # fmt: skip
    """Return the drive of constant speed; None if the mechanism's own prescribed motions act as they are."""
    prescribed = mechanism.prescribed
    steady = [one for one in prescribed if isinstance(one.profile, ConstantSpeed)]
    given = next((name for name, value in (("start", start), ("end", end), ("speed", speed)) if value is not None), "")
    if joint is None and (len(steady) != 1 or len(prescribed) != 1):
        moving = [one.name for one in mechanism.joints if one.moves]
        motors = [motor.joint for motor in mechanism.motors] or moving
        if prescribed and not given:
            return None
        free = 3 * len(mechanism.bodies) - constraint_count(replace(mechanism, prescribed=()))
        if free > 1 or not moving:
            raise InputError(
                f"{free} degrees of freedom need as many prescribed motions" if moving else "no joint moves",
                field="drive", value=len(prescribed) if moving else None,
                remedy="add a [prescribed.NAME] table for each; start, end and speed are for one drive"
                if moving else "flexures move by bending: paraflex statics",
            )  # fmt: skip
        if prescribed or len(motors) != 1:
            also = "; paraflex run plans a motion along a path" if mechanism.end_effector else ""
            raise InputError(
                "is missing", field="drive",
                remedy=f"name the joint that drives the mechanism: {', '.join(moving)}{also}",
            )  # fmt: skip
        joint = motors[0]
    elif joint is None:
        joint = steady[0].joint
    known(joint, [one.name for one in mechanism.joints], "drive", "joint")
    one = mechanism.joint(joint)
    one.check_moves("drive")
    before = next((each for each in prescribed if each.joint == joint), None)
    profile = None if before is None else before.profile
    steadily = profile if isinstance(profile, ConstantSpeed) else None
    unit = "m" if one.slides else "rad"
    if speed is None:
        speed = abs(steadily.speed) if steadily is not None and steadily.speed else 1.0
    if not _SLOWEST < speed < 1.0 / _SLOWEST:
        problem = "of no machine" if speed > 0.0 else "not positive"
        remedy = f"give it in {unit}/s; the range from start to end gives the direction"
        raise InputError(problem, field="speed", value=speed, remedy=remedy)
    backwards = steadily is not None and steadily.speed < 0.0
    if start is None:
        start = joint_value(system, joint, pose)
    turn = 2.0 * math.pi if unit == "rad" else _LONGEST_TRAVEL * system.size
    if end is not None and end == start:
        raise InputError("the drive does not move", field="end", value=end, remedy="give another value than the start")
    last = start + (-turn if backwards else turn) if end is None else end
    found = Drive(joint if before is None else before.name, joint, start, last, speed, unit)
    if found.turns > _MOST_TURNS or max(abs(start), abs(last)) > _MOST_TURNS * max(turn, 2.0 * math.pi):
        example = {"rad": "90 deg", "m": "50 mm"}[unit]
        raise InputError(
            f"more than {_MOST_TURNS:g} turns" if unit == "rad" else "too far", field="start" if end is None else "end",
            value=start if end is None else end, remedy=f'in another unit? It is in {unit}, or write "{example}"',
        )  # fmt: skip
    return found


def driven_loops(mechanism: Mechanism, pose: Array, end: float) -> tuple[LoopClosure, Array]:
    """Return the closure of a mechanism moved by its prescribed motions, and the pose at their start."""
    loops = LoopClosure(mechanism, end, None, NO_TASKS)
    system = loops.system
    pose = assembled_position(system, loops.signals, 0.0, pose)
    free = system.n - system.m
    if free > 0:
        one, several = "1 degree of freedom", f"{free} degrees of freedom"
        raise InputError(
            f"the drives leave {one if free == 1 else several} of the mechanism open", field="drive",
            value=", ".join(each.joint for each in mechanism.prescribed) or None,
            remedy="kinematics needs as many drives as degrees of freedom: add [prescribed] motions",
        )  # fmt: skip
    if free < 0:
        found = dependence(system, pose)
        names = ", ".join(dict.fromkeys(system.rows[row] for row in found.dropped))
        raise InputError(
            f"more constraints and drives than degrees of freedom; redundant: {names}", field="joint",
            remedy="leave out the joint or drive whose constraints follow from the others",
        )  # fmt: skip
    return loops, pose


def _with_drive(mechanism: Mechanism, law: Drive) -> Mechanism:
    """Return the mechanism with a drive instead of the prescribed motion, and of a motor, at the same joint.

    Other prescribed motions are left out if the mechanism has one degree of freedom. Motors with actuators stay, as
    their rotors have inertia.
    """
    if not mechanism.actuators:
        motors = tuple(one for one in mechanism.motors if one.joint != law.joint)
        mechanism = replace(mechanism, motors=motors, modes=())
    others = tuple(one for one in mechanism.prescribed if one.joint != law.joint)
    if 3 * len(mechanism.bodies) - constraint_count(replace(mechanism, prescribed=())) < 1 + len(others):
        others = ()
    return replace(mechanism, prescribed=(PrescribedAngle(law.name, law.joint, law.profile), *others))


def ranged(mechanism: Mechanism, law: Drive, pose: Array, *, fixed: bool) -> tuple[LoopClosure, Array, Drive]:
    """Return closure, first pose and drive; without a given end the range is a turn or lies between two limits."""
    loops, pose = driven_loops(_with_drive(mechanism, law), pose, law.duration)
    if fixed or (stopped := _reached(loops, law, pose)) is None:
        if not fixed and law.unit == "m":
            raise InputError(
                "a joint that slides without a limit of reach", field="drive", value=law.joint, remedy=_GIVE_RANGE
            )
        return loops, pose, law
    ends = []
    for way in (law, replace(law, end=2.0 * law.start - law.end)):
        there = LoopClosure(_with_drive(mechanism, way), way.duration, None, NO_TASKS)
        stopped = _reached(there, way, pose)
        limit = None if stopped is None else limit_of_reach(there.system, law.joint, stopped)
        if limit is None:
            raise _barred(way, there, stopped, None)
        ends.append(limit)
    low, high = sorted(ends)
    reach, inside = (low, high), _MARGIN * (high - low)
    span = (low + inside, high - inside) if law.end > law.start else (high - inside, low + inside)
    back = replace(law, end=span[0])
    there = LoopClosure(_with_drive(mechanism, back), max(back.duration, 1e-6), None, NO_TASKS)
    if span[0] != law.start:
        pose = followed(there, np.array([0.0, back.duration]), pose, back)[1][-1]
    law = replace(law, start=span[0], end=span[1], reach=reach)
    return LoopClosure(_with_drive(mechanism, law), law.duration, None, NO_TASKS), pose, law


def _reached(loops: LoopClosure, law: Drive, pose: Array) -> Array | None:
    """Return the last pose with closed loops before the end of a drive's travel; None if it covers all of it."""
    times = np.linspace(0.0, law.duration, 181)
    found = loops.follow(no_target, times, np.ones(times.size, dtype=bool), pose.copy())
    return None if found.closed else found.last


def followed(loops: LoopClosure, times: Array, pose: Array, law: Drive | None = None) -> tuple[Array, ...]:
    """Return times, coordinates, velocities and accelerations along the whole motion."""
    grid, keep = times, np.ones(times.size, dtype=bool)
    if law is not None:
        grid, keep = no_long_steps(times, _STEP * law.duration / max(law.turns, 1.0))
    found = loops.follow(no_target, grid, keep, pose.copy())
    if not found.closed:
        raise _barred(law, loops, found.last, found.stopped)
    return found.arrays[:4]


def _barred(law: Drive | None, loops: LoopClosure, last: Array | None, stopped: float | None) -> UnreachablePathError:
    """Return the error of a motion that stops at a limit of reach or a change point."""
    system = loops.system
    q = last if last is not None else np.zeros(system.n)
    drives = ", ".join(f"{one.joint} at {value_text(system, one.joint, q)}" for one in system.mechanism.prescribed)
    limit = limit_of_reach(system, law.joint, q) if law is not None and last is not None else None
    if limit is not None and law is not None:
        cause = f"{law.joint} reaches its limit of reach, {quantity(limit, law.unit, digits=6)},"
    else:
        cause = f"the motion passes a change point or a limit of reach near {drives},"
    at = stopped if stopped is not None else 0.0
    return UnreachablePathError(
        cause, Moment(at, 0), None, "give a range on one side of it, or drive another joint"
    )  # fmt: skip
