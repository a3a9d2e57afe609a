"""Positions, velocities and accelerations of a rigid mechanism over the travel of its drive, and its rigid torques."""

import math
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from paraflex.actuation import allocate, required_effort
from paraflex.arguments import checked_arguments, named_in_errors
from paraflex.arrays import Array, Mask
from paraflex.dynamics import System, build_system, reference_pose, still_signals
from paraflex.dynamics.joint_coordinates import joint_value, value_text
from paraflex.dynamics.load_values import check_laws
from paraflex.errors import AssemblyError, InputError, ParaflexError, UnreachablePathError
from paraflex.findings import Finding
from paraflex.formatting import quantity
from paraflex.integrators import Solution, check_times
from paraflex.integrators.between import samples_too_few, with_between
from paraflex.integrators.solution import LateFindings
from paraflex.kernel.constraints import constraint_values
from paraflex.kernel.packed import make_scratch
from paraflex.limits import solvable
from paraflex.mechanism import ActuationMode, Mechanism, mode_of_motors, parse_mode, standing
from paraflex.mechanism.masses import check_masses, with_any_masses
from paraflex.motion import MotionRun
from paraflex.paths import ModelWithPaths, Path, PathFollower, RigidMotion, path_follower
from paraflex.paths.closure import PathClosure
from paraflex.paths.loops import LoopClosure
from paraflex.validity import large_rotations, shared_loads
from .assemblies import FoundAssembly, assemblies_of
from .exact import Drive, ExactMotion, FirstPose, Held, placed
from .features import KinematicFeatures, features_of
from .loads import LIMITS_RIGHT_TO, RIGHT_TO, load_errors, with_limits, with_loads
from .ranges import Wish, check_determined, chosen_drive, driven_loops, followed, freedoms_at, ranged

# Samples between which properties are located: of a travel or a turn of a drive, and at most for other motions.
_FINE, _FINEST = 361, 1441
# Part of a turn by which a whole number of turns may be missed.
_WHOLE = 1e-9


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
    effort : (k, motors) array
        Torques or forces of the motors: NaN without loads, zero without a path [N m, N].
    rigid : RigidMotion, optional
        Motion of the end-effector along a path; None for a motion that drives determine.
    path, mode : str
        Name of the path and of the actuation mode; empty for none.
    passed : tuple of float
        Times of change points that the motion passes [s].
    notes : sequence of Finding
        Findings on the assembly, change points, and forces.
    """

    drive: Drive | None
    loops: LoopClosure
    effort: Array
    rigid: RigidMotion | None = None
    path: str = ""
    mode: str = ""
    passed: tuple[float, ...] = ()
    notes: Sequence[Finding] = ()
    open_loop: ClassVar[bool] = False

    @property
    def in_time(self) -> bool:
        """Whether torques change in time, as those of motors along a path do."""
        return True

    @property
    def applied(self) -> Array:
        """Torques (k, motors) at the times of the solution [N m]."""
        return self.effort

    @cached_property
    def findings(self) -> tuple[Finding, ...]:
        """Findings on the assembly, change points, and forces; the motion itself is exact."""
        return tuple(self.notes)

    @cached_property
    def exact(self) -> ExactMotion:
        """The motion at any time, exact to rounding, with samples of its own, until it repeats."""
        drive, solution = self.drive, self.solution
        end = float(solution.t[-1]) if drive is None else drive.duration
        one = drive is not None and drive.alone
        times = np.linspace(0.0, end, _FINE if one else int(np.clip(solution.t.size, _FINE, _FINEST)))
        if drive is not None and drive.turns > 1.0 + _WHOLE:
            # Whole turns are samples.
            pieces = np.arange(math.ceil((_FINE - 1) * (drive.turns - _WHOLE)))
            times = np.append(pieces * 2.0 * math.pi / ((_FINE - 1) * drive.speed), end)
        passed, rigid = self.passed, self.rigid
        if times.size != solution.t.size or times[-1] != solution.t[-1]:
            solution, rigid, passed = self.moved(times)
        exact = ExactMotion(self.system, solution, drive, self.loops, rigid, passed)
        for k in range(_FINE - 1, times.size - 1, _FINE - 1):
            if drive is not None and exact.repeats_at(k):
                solution = replace(solution, **{name: getattr(solution, name)[: k + 1] for name in "tqva"})
                drive = replace(drive, end=drive.at(times[k]))
                passed = tuple(t for t in passed if t <= times[k])
                return replace(exact, solution=solution, drive=drive, passed=passed)
        return exact

    def moved(self, times: Array) -> tuple[Solution, RigidMotion | None, tuple[float, ...]]:
        """Return the motion at other times up to its end, without loads, along a path if any, and change points."""
        solution, rigid, passed = self.solution, self.rigid, ()
        if rigid is None:
            first = FirstPose(solution.q[0], (solution.v[0], solution.a[0]))
            (t, q, v, a), passed = followed(self.loops, times, first, self.drive)
        else:
            assert isinstance(self.loops, PathClosure)
            rigid = PathFollower(self.loops, solution.q[0], rigid.path)(times)
            t, q, v, a = rigid.t, rigid.q, rigid.v, rigid.a
        return replace(solution, t=t, q=q, v=v, a=a), rigid, passed

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
    held: Held | None = None,
    path: Path | str | None = None,
    start: float | None = None,
    end: float | None = None,
    speed: float | None = None,
    duration: float | None = None,
    samples: int = 361,
    assembly: str | None = None,
) -> DrivenMotion:
    """Compute positions, velocities and accelerations of a mechanism that a joint drives, or that follows a path.

    All bodies are rigid. Masses have no effect and are not needed.

    Parameters
    ----------
    mechanism : Mechanism or Model
        Mechanism, or a model with one.
    drive : str, optional
        Joint that moves at constant speed. By default the mechanism's prescribed motions act. If they leave degrees of
        freedom open, the end-effector follows the model's path, or else the joint of the only motor moves.
    held : mapping of str to float, or to a pair of float, optional
        Other joints, which are held at an angle [rad] or travel [m], if there are several degrees of freedom. With a
        pair a joint moves from the first to the second in the time of the drive, at constant speed.
    path : Path or str, optional
        Path of the end-effector, or for a model the name of one.
    start, end : float, optional
        First and last angle [rad] or travel [m] of the drive. By default a whole turn from the assembly or from
        `start`; if the joint cannot make one, the range between its limits of reach.
    speed : float, optional
        Speed of the drive [rad/s, m/s]; by default that of the prescribed motion at its joint, else 1.
    duration : float, optional
        Duration [s]: of the drive in place of its end, else of prescribed motions, by default that of the model's
        study (without one, a single motion of constant speed makes a turn), or of the motion along a path, by default
        the path's.
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
        travel. Or the path cannot be followed.
    """
    began = time.perf_counter()
    check_times(duration, samples)
    for name, value in (("start", start), ("end", end), ("speed", speed)):
        if value is not None and not math.isfinite(value):
            raise InputError("not a finite number", field=name, value=value, remedy="give it in SI units and radians")
    moved = standing(with_any_masses(Mechanism.from_source(mechanism)).rigid(), assembly)
    wish = Wish(drive, held or {}, start, end, speed, duration)
    chosen = moved.assembly(assembly)
    freedoms, closed = freedoms_at(moved, chosen)
    followed_path = _path(mechanism, path, wish, freedoms - len(moved.prescribed))
    if followed_path is not None:
        way, name = followed_path
        last = way.duration if duration is None else duration
        orientation = getattr(getattr(mechanism, "study", None), "orientation", 0.0)
        follow = path_follower(moved, way, last, assembly=chosen, orientation=orientation)
        rigid = follow(np.linspace(0.0, last, samples))
        return _motion(moved, (rigid.t, rigid.q, rigid.v, rigid.a), began, None, follow.closure, rigid=rigid, path=name)
    if duration is None and drive is None and not wish.of_drive and moved.prescribed:
        duration = getattr(getattr(mechanism, "study", None), "duration", None)
        wish = wish._replace(duration=duration)
    system = build_system(replace(moved, prescribed=()))
    near = reference_pose(system, chosen)
    law = chosen_drive(moved, wish, freedoms, system, near)
    if law is None:
        check_determined(moved, freedoms)
        if duration is None:
            raise InputError("is missing", field="duration", remedy="give it in seconds, or name a drive")
        check_times(duration, None)
        loops, pose = driven_loops(moved, near, duration, freedoms)
        arrays, passed = followed(loops, np.linspace(0.0, duration, samples), FirstPose(pose))
        return _motion(moved, arrays, began, None, loops, passed=passed)
    notes = list[Finding]()
    loops, first, law, moved_to = _ranged(moved, law, wish, freedoms, system, (near, closed))
    if moved_to:
        text = (
            f"the loops do not close with {law.joint} at {value_text(system, law.joint, near)} as given, but {moved_to}"
        )
        remedy = "correct the angles of the assembly, or give the start of the drive"
        notes.append(Finding("assembly-moved", f"assembly.{chosen.name}", text, remedy))
    if start is None and not law.held:
        kept = law.start == joint_value(system, law.joint, near)
        notes += large_rotations(system, chosen, first.q if kept else closed)
    arrays, passed = followed(loops, np.linspace(0.0, law.duration, samples), first, law)
    return _motion(loops.mechanism, arrays, began, law, loops, passed=passed, notes=notes)


def _ranged(
    mechanism: Mechanism, law: Drive, wish: Wish, freedoms: int, system: System, poses: tuple[Array, Array]
) -> tuple[LoopClosure, FirstPose, Drive, str]:
    """Return closure, start and drive from an assembly as given or, if that fails, closed; then also its value."""
    near, closed = poses
    fixed = wish.end is not None or wish.duration is not None
    try:
        return *ranged(mechanism, law, near, freedoms, system, fixed=fixed), ""
    except UnreachablePathError:
        raise
    except AssemblyError as error:
        refused = error
    # The assembly's angle of the drive is approximate: another joint's may be nearer.
    again = chosen_drive(mechanism, wish, freedoms, system, closed)
    assert again is not None
    try:
        found = ranged(mechanism, again, closed, freedoms, system, fixed=fixed)
    except AssemblyError as error:
        if wish.start is None and not law.held:
            raise
        field, value = ("held", ", ".join(law.held)) if wish.start is None else ("start", wish.start)
        problem, remedy = refused.cause.rstrip(","), "give one within reach of the assembly"
        with suppress(InputError, AssemblyError):
            free = chosen_drive(mechanism, wish._replace(start=None, end=None, duration=None), freedoms, system, closed)
            assert free is not None
            reach = ranged(mechanism, free, closed, freedoms, system, fixed=False)[2].reach
            low, high = (quantity(end or 0.0, law.unit, digits=6) for end in reach)
            if field == "start" and None not in reach:
                problem = f"not between the limits of reach of {law.joint}, {low} and {high}"
                remedy = "give one between them"
        raise InputError(problem, field=field, value=value, remedy=remedy) from error
    return *found, "" if wish.start is not None else f"at {value_text(system, law.joint, closed)}"


def _path(
    source: Mechanism | ModelWithPaths, path: Path | str | None, wish: Wish, left: int
) -> tuple[Path, str] | None:
    """Return the path that the end-effector follows, and its name; None if drives determine the motion."""
    given = "drive" if wish.drive else wish.of_drive
    if path is not None and given:
        raise InputError(
            "has no effect along a path", field=given, value=getattr(wish, given),
            remedy="leave out the path, or what drives a joint",
        )  # fmt: skip
    if path is not None and not isinstance(path, str):
        return path, "path"
    if isinstance(source, Mechanism) or (path is None and (given or left <= 0 or not getattr(source, "paths", ()))):
        if path is not None:
            raise InputError(
                "a mechanism has no paths by name", field="path", value=path,
                remedy="give the model that paraflex.load reads, or a path such as Line",
            )  # fmt: skip
        return None
    return source.path(path), path or getattr(source, "path_name", str)(None)


def _motion(
    mechanism: Mechanism, arrays: tuple[Array, ...], began: float, law: Drive | None, loops: LoopClosure, *,
    passed: tuple[float, ...] = (), notes: Sequence[Finding] = (), **more: Any,
) -> DrivenMotion:  # fmt: skip
    system, still = build_system(mechanism), {motor.name: 0.0 for motor in mechanism.motors}
    effort = np.full((arrays[0].size, len(still)), np.nan)
    if passed:
        place, where = placed(law, passed)
        text = f"assemblies meet, a change point, with {where}"
        remedy = "the motion continues in the assembly whose velocities are continuous"
        notes = [*notes, Finding("special-pose", place, text, remedy)]
    solution = _solution(system, arrays, began)
    return DrivenMotion(
        system, arrays[0], still, solution, law, loops, effort, passed=passed, notes=tuple(notes), **more
    )


@checked_arguments()
@solvable("rigid torques")
def torques(
    mechanism: Mechanism | ModelWithPaths,
    drive: str | None = None,
    *,
    held: Held | None = None,
    path: Path | str | None = None,
    mode: str | ActuationMode | None = None,
    start: float | None = None,
    end: float | None = None,
    speed: float | None = None,
    duration: float | None = None,
    samples: int = 361,
    assembly: str | None = None,
) -> DrivenMotion:
    """Compute the motion as `kinematics` does, with the torques of drives or motors, joint forces and shaking forces.

    The inverse dynamics of the rigid mechanism includes weight, loads, springs, dampers and friction.

    Parameters
    ----------
    mechanism, drive, held, path, start, end, speed, duration, samples, assembly
        See `kinematics`.
    mode : str or ActuationMode, optional
        Actuation mode along a path: its motors share the effort with the least norm of torques. By default the first
        of the model's study or of the mechanism, or all motors.

    Returns
    -------
    DrivenMotion
        Motion with multipliers and energies; the work is NaN.

    Raises
    ------
    InputError, AssemblyError, UnreachablePathError
        See `kinematics`; also InputError for a body without mass, or a law that is not finite at a sample.
    ActuationError, SingularActuationError
        The motors of the mode cannot drive the mechanism along the path.
    """
    source = Mechanism.from_source(mechanism)
    check_masses(source)
    motion = kinematics(
        mechanism, drive, held=held, path=path, start=start, end=end, speed=speed, duration=duration, samples=samples,
        assembly=assembly,
    )  # fmt: skip
    check_laws(motion.system, motion.solution.t, motion.solution.q, motion.solution.v)
    effort, name, acting = np.zeros_like(motion.effort), "", None
    if motion.rigid is not None:
        known_modes = (*getattr(getattr(mechanism, "study", None), "modes", ()), *source.modes)
        chosen = mode or next(iter(known_modes), None)
        if chosen is None:
            chosen = mode_of_motors(source, [motor.name for motor in source.motors])
        acting = parse_mode(source, chosen) if isinstance(chosen, str) else chosen
        effort, name = allocate(required_effort(motion.rigid), acting), acting.name
    elif mode is not None:
        remedy = "leave it out, or follow a path"
        raise InputError("has no effect without a path", field="mode", value=mode, remedy=remedy)
    solution, grows, unbounded = _loaded(motion, effort)
    notes = [*motion.notes, *shared_loads(motion.system, solution), *unbounded]
    errors = load_errors(motion.system, solution.multipliers, LIMITS_RIGHT_TO if motion.passed else RIGHT_TO)
    errors[grows] = math.inf
    solution = replace(solution, multiplier_errors=errors)
    late = LateFindings(lambda: (*notes, *_samples_too_few(motion, acting)))
    return replace(motion, solution=solution, effort=effort, mode=name, notes=late)


def _loaded(motion: DrivenMotion, effort: Array) -> tuple[Solution, Mask, list[Finding]]:
    """Return the solution with loads, the rows (m,) of those that grow without bound, and findings on them."""
    system, solution = motion.system, with_loads(motion.system, motion.solution, effort)
    if not motion.passed:
        return solution, np.zeros(system.m, dtype=bool), []
    return with_limits(ExactMotion(system, motion.solution, motion.drive, motion.loops, passed=motion.passed), solution)


def _samples_too_few(motion: DrivenMotion, acting: ActuationMode | None) -> Iterator[Finding]:
    """Yield a finding on loads that are larger between the samples; those that grow without bound are left out."""
    system, motors = motion.system, motion.system.mechanism.motors
    finer = with_between(motion.solution.t, system.n)
    if finer is None:
        return
    try:
        whole, rigid, passed = motion.moved(finer.times)
        check_laws(system, whole.t, whole.q, whole.v)
        effort = np.zeros((whole.t.size, len(motors)))
        if rigid is not None and acting is not None:
            effort = allocate(required_effort(rigid), acting)
    except ParaflexError:
        return
    whole, grows, _ = _loaded(replace(motion, solution=whole, passed=passed), effort)
    whole.multipliers[:, grows] = np.nan
    slides = [system.mechanism.slides(motor.joint) for motor in motors]
    more = [(f"the {'force' if slide else 'torque'} of motor {motor.name}", "N" if slide else "N m", np.abs(each))
            for motor, slide, each in zip(motors, slides, effort.T, strict=True)]  # fmt: skip
    found = samples_too_few(system, whole, motion.solution, motion.solution.t.size, more)
    if found is not None:
        yield replace(found, place="samples")


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
