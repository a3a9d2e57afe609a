"""Positions, velocities and accelerations of a rigid mechanism over the travel of its drive, and its rigid torques."""

import math
import time
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np

from paraflex.arguments import checked_arguments, named_in_errors
from paraflex.arrays import Array
from paraflex.dynamics import System, assembled_position, build_system, dependence, reference_pose, still_signals
from paraflex.dynamics.constraints import constraint_count
from paraflex.dynamics.joint_coordinates import joint_value, value_text
from paraflex.dynamics.stiffness import RestingForces
from paraflex.errors import AssemblyError, InputError, Moment, UnreachablePathError
from paraflex.findings import Finding
from paraflex.formatting import quantity
from paraflex.integrators import Solution, check_times
from paraflex.kernel.bodies import stored_energy
from paraflex.kernel.constraints import constraint_values
from paraflex.kernel.packed import make_scratch
from paraflex.limits import solvable
from paraflex.mechanism import ConstantSpeed, Mechanism, PrescribedAngle, standing
from paraflex.mechanism.masses import with_any_masses
from paraflex.mechanism.quantities import known
from paraflex.motion import MotionRun
from paraflex.paths import ModelWithPaths
from paraflex.paths.loops import LoopClosure, no_long_steps
from .assemblies import FoundAssembly, assemblies_of
from .exact import NO_TASKS, Drive, ExactMotion, no_target
from .features import KinematicFeatures, features_of
from .limits import limit_of_reach

# Fraction of the range between two limits of reach that is left out at either limit, where rates grow without bound.
_MARGIN = 1e-3
# Largest travel of a sliding drive whose range is not given, in sizes of the mechanism.
_LONGEST_TRAVEL = 4.0
# Speeds below this, and above its inverse, are refused [rad/s, m/s].
_SLOWEST = 1e-12
# Largest number of turns of a drive.
_MOST_TURNS = 20.0
# Longest step of a drive as a fraction of a turn, or of its travel; samples between which properties are located.
_STEP, _FINE, _FINEST = 1.0 / 360.0, 361, 1441
_GIVE_RANGE = "give the start and end of its travel"


@named_in_errors("a driven motion", "the motion that kinematics returns")
@dataclass(frozen=True)
class DrivenMotion(MotionRun):
    """Motion of a rigid mechanism that its drives determine.

    It is a run whose solution comes from the closure of the loops instead of integration: every sample is exact to
    rounding. Datasets, reports, figures and films are made of it as of other runs.

    Attributes
    ----------
    drive : Drive, optional
        Joint that moves at constant speed; None if the mechanism's own prescribed motions act.
    loops : LoopClosure
        Equations that determine the motion.
    """

    drive: Drive | None
    loops: LoopClosure
    open_loop: ClassVar[bool] = False

    @cached_property
    def findings(self) -> tuple[Finding, ...]:
        """Findings of the motion; none, as it is exact to rounding."""
        return ()

    @cached_property
    def exact(self) -> ExactMotion:
        """The motion at any time, exact to rounding: over one turn of the drive, with samples of its own."""
        drive, solution = self.drive, self.solution
        if drive is not None and drive.turns > 1.0:
            drive = replace(drive, end=drive.start + math.copysign(2.0 * math.pi, drive.end - drive.start))
        end = float(solution.t[-1]) if drive is None else drive.duration
        times = np.linspace(0.0, end, _FINE if drive is not None else int(np.clip(solution.t.size, _FINE, _FINEST)))
        if times.size != solution.t.size or times[-1] != solution.t[-1]:
            t, q, v, a = _followed(self.loops, times, solution.q[0], drive)
            solution = replace(solution, t=t, q=q, v=v, a=a)
        return ExactMotion(self.system, solution, drive, self.loops)

    @cached_property
    def features(self) -> KinematicFeatures:
        """Transmission angles, dead points, time ratios and coupler curves."""
        return features_of(self.exact)

    def assemblies(self, starts: int = 200) -> list[FoundAssembly]:
        """Return all assemblies found with the drives as at the first sample; see `assemblies_of`."""
        return assemblies_of(self.exact, starts)


@checked_arguments()
@solvable("kinematics")
def kinematics(
    mechanism: Mechanism | ModelWithPaths,
    drive: str | None = None,
    *,
    start: float | None = None,
    end: float | None = None,
    speed: float | None = None,
    duration: float | None = None,
    samples: int = 361,
    assembly: str | None = None,
) -> DrivenMotion:
    """Compute positions, velocities and accelerations of a mechanism over the travel of a joint that drives it.

    All bodies are rigid. Masses have no effect and are not needed.

    Parameters
    ----------
    mechanism : Mechanism or Model
        Mechanism, or a model with one.
    drive : str, optional
        Joint that moves at constant speed. By default the mechanism's prescribed motions act, or, if there are none,
        the joint of its only motor.
    start, end : float, optional
        First and last angle [rad] or travel [m] of the drive. By default a whole turn from the assembly or from
        `start`; if the joint cannot make one, the range between its limits of reach.
    speed : float, optional
        Speed of the drive [rad/s, m/s]; by default that of the prescribed motion at its joint, else 1.
    duration : float, optional
        Duration of prescribed motions that are not of constant speed [s]; that of the model's study by default.
    samples : int
        Number of samples, evenly spaced, both ends included.
    assembly : str, optional
        Assembly in which the mechanism moves; the first by default.

    Returns
    -------
    DrivenMotion
        Motion at the samples. Forces and energies are NaN: see `torques`.

    Raises
    ------
    InputError
        An unknown joint or one that does not move, a range out of order, or drives that do not determine the motion.
    AssemblyError
        The loops do not close.
    UnreachablePathError
        The drive cannot cover the range, because of a limit of reach or a change point; the error names its angle or
        travel.
    """
    light = with_any_masses(Mechanism.from_source(mechanism))
    if duration is None:
        duration = _study_duration(mechanism)
    return _driven(light, drive, start, end, speed, duration, samples, assembly)


@checked_arguments()
@solvable("rigid torques")
def torques(
    mechanism: Mechanism | ModelWithPaths,
    drive: str | None = None,
    *,
    start: float | None = None,
    end: float | None = None,
    speed: float | None = None,
    duration: float | None = None,
    samples: int = 361,
    assembly: str | None = None,
) -> DrivenMotion:
    """Compute the motion as `kinematics` does, with the torque of the drive, joint forces and shaking forces.

    The inverse dynamics of the rigid mechanism includes weight, loads, springs, dampers and friction.

    Parameters
    ----------
    mechanism, drive, start, end, speed, duration, samples, assembly
        See `kinematics`.

    Returns
    -------
    DrivenMotion
        Motion with multipliers and energies; the work is NaN.

    Raises
    ------
    InputError, AssemblyError, UnreachablePathError
        See `kinematics`; also InputError for a body without mass.
    """
    if duration is None:
        duration = _study_duration(mechanism)
    motion = _driven(Mechanism.from_source(mechanism), drive, start, end, speed, duration, samples, assembly)
    return replace(motion, solution=with_loads(motion.system, motion.solution))


def _study_duration(given: Mechanism | ModelWithPaths) -> float | None:
    return getattr(getattr(given, "study", None), "duration", None)


def _driven(
    mechanism: Mechanism,
    drive: str | None,
    start: float | None,
    end: float | None,
    speed: float | None,
    duration: float | None,
    samples: int,
    assembly: str | None,
) -> DrivenMotion:
    began = time.perf_counter()
    check_times(None, samples)
    for name, value in (("start", start), ("end", end), ("speed", speed)):
        if value is not None and not math.isfinite(value):
            raise InputError("not a finite number", field=name, value=value, remedy="give it in SI units and radians")
    moved = standing(mechanism.rigid(), assembly)
    begun = LoopClosure(moved, 0.0, None, NO_TASKS)
    near = reference_pose(begun.system, moved.assembly(assembly))
    law = _chosen(moved, drive, start, end, speed, begun.system, near)
    if law is None:
        if duration is None:
            raise InputError("is missing", field="duration", remedy="give it in seconds, or name a drive")
        check_times(duration, None)
        loops, pose = _loops(moved, near, duration)
        arrays = _followed(loops, np.linspace(0.0, duration, samples), pose)
    else:
        try:
            loops, pose, law = _ranged(moved, law, near, fixed=end is not None)
        except AssemblyError:
            if start is not None:
                raise
            # The assembly's angle of the drive is approximate: another joint's may be nearer.
            closed = begun.assembled(moved.assembly(assembly))
            law = _chosen(moved, drive, start, end, speed, begun.system, closed)
            assert law is not None
            loops, pose, law = _ranged(moved, law, closed, fixed=end is not None)
        moved = loops.mechanism
        arrays = _followed(loops, np.linspace(0.0, law.duration, samples), pose, law)
    system = build_system(moved)
    return DrivenMotion(system, arrays[0], {motor.name: 0.0 for motor in moved.motors},
                        _solution(system, arrays, began), law, loops)  # fmt: skip


def _chosen(
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


def _loops(mechanism: Mechanism, pose: Array, end: float) -> tuple[LoopClosure, Array]:
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


def _ranged(mechanism: Mechanism, law: Drive, pose: Array, *, fixed: bool) -> tuple[LoopClosure, Array, Drive]:
    """Return closure, first pose and drive; without a given end the range is a turn or lies between two limits."""
    loops, pose = _loops(_with_drive(mechanism, law), pose, law.duration)
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
        pose = _followed(there, np.array([0.0, back.duration]), pose, back)[1][-1]
    law = replace(law, start=span[0], end=span[1], reach=reach)
    return LoopClosure(_with_drive(mechanism, law), law.duration, None, NO_TASKS), pose, law


def _reached(loops: LoopClosure, law: Drive, pose: Array) -> Array | None:
    """Return the last pose with closed loops before the end of a drive's travel; None if it covers all of it."""
    times = np.linspace(0.0, law.duration, 181)
    found = loops.follow(no_target, times, np.ones(times.size, dtype=bool), pose.copy())
    return None if found.closed else found.last


def _followed(loops: LoopClosure, times: Array, pose: Array, law: Drive | None = None) -> tuple[Array, ...]:
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


def _solution(system: System, arrays: tuple[Array, ...], began: float) -> Solution:
    """Return the solution of exact positions, velocities and accelerations, without forces and energies."""
    t, q, v, a = arrays
    none = np.full(t.size, np.nan)
    signals = still_signals(system.mechanism, float(t[-1]))[0]
    scratch, gaps = make_scratch(system.packed), np.zeros((2, t.size, system.m))
    for k, at in enumerate(t.tolist()):
        constraint_values(system.packed, signals, at, q[k], v[k], scratch, gaps[0, k], gaps[1, k])
    return Solution(
        t=t, q=q, v=v, a=a, multipliers=np.full((t.size, system.m), np.nan), kinetic_energy=none, strain_energy=none,
        work=none, status="complete", message="", steps=t.size, energy_balance_max=math.nan, method="closure of loops",
        constraint_position_max=float(np.max(np.abs(gaps[0]))), constraint_velocity_max=float(np.max(np.abs(gaps[1]))),
        wall_time=time.perf_counter() - began,
    )  # fmt: skip


def with_loads(system: System, solution: Solution) -> Solution:
    """Return a solution with the multipliers that its motion requires, and energies.

    Phi_q^T lambda = -(M a + h - loads), with the multipliers of springs, dampers and friction from their laws.
    """
    forces, held = RestingForces(system, 0.0, beams=True), system.constrained
    forces.signals = still_signals(system.mechanism, float(solution.t[-1]))[0]
    scratch = make_scratch(system.packed)
    multipliers, energies = np.zeros(solution.multipliers.shape), np.zeros((solution.t.size, 2))
    for k, (t, q, v, a) in enumerate(zip(solution.t, solution.q, solution.v, solution.a, strict=True)):
        forces.time, forces.v, forces.a = float(t), v, a
        lam = forces.compliant(q)
        rows = system.dimensionless_jacobian(q)[held]
        left = forces(q, lam)[0] * system.units
        lam[held] = -np.linalg.solve(rows.T, left) / system.row_units[held]
        multipliers[k] = lam
        energies[k] = stored_energy(system.packed, q, v, lam, scratch)[:2]
    return replace(solution, multipliers=multipliers, kinetic_energy=energies[:, 0], strain_energy=energies[:, 1])
