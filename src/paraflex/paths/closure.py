"""Inverse kinematics along a path: Newton's iteration on the constraints, starting from a named assembly."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array, Brief, Mask
from paraflex.dynamics import System, redundant_rows
from paraflex.dynamics.points import point_motion
from paraflex.errors import AssemblyError, InputError, Moment, NumericalError, UnreachablePathError
from paraflex.kernel.arrays import apart
from paraflex.kernel.closure import LOOPS_CLOSED, task_values
from paraflex.limits import solvable
from paraflex.mechanism import Assembly, Mechanism
from paraflex.mechanism.members import TASK_COORDINATES
from paraflex.mechanism.poses import local_points
from .loops import LoopClosure, no_long_steps
from .paths import KnownPath, Path, PathMotion, turning_of
from .reach import PoseSearch, Shortfall

# Closure proceeds along the path in steps no longer than this [s], for any requested times.
_LONGEST_STEP = 1e-3
# Numbers of steps from the assembly's pose to the start of the path, tried in turn.
_APPROACHES = (25, 250, 2500)
# Evenly spaced instants at which the distance of an unreachable path from the workspace is computed, besides the knots
# of the path, and further instants about the largest distance.
_INSTANTS_LOOKED_AT, _MORE_LOOKS = 41, 9
# A path that leaves the workspace within this fraction of its remaining time does so where closure stopped.
_SOON = 0.05
# A path within a thousandth of a link of a singular configuration cannot be distinguished from one through it.
_NEARLY_SINGULAR = "or comes so near to one that the assembly beyond it is not certain"
_MOVE_PATH = "move the path or the bases, or choose another assembly"
# A path further than this many sizes of the mechanism beyond its reach is likely given in another unit.
_OTHER_UNIT = 30.0
_OTHER = "it can be reached, but only past a Type I singularity or in another assembly"


@dataclass(frozen=True)
class RigidMotion(Brief):
    """Motion of the rigid mechanism along a path.

    Attributes
    ----------
    mechanism : Mechanism
        Rigid mechanism.
    system : System
        System of the rigid mechanism, without springs, dampers and friction at its joints: three coordinates per body
        (RDM).
    path : Path
        Path of the end-effector.
    t : (k,) array
        Sample times [s].
    q, v, a : (k, n) arrays
        Coordinates, velocities and accelerations.
    basis : (k, n, tasks) array
        Velocities of all coordinates per unit of each task velocity: a basis of the null space of Phi_q.
    """

    mechanism: Mechanism
    system: System
    path: Path
    t: Array
    q: Array
    v: Array
    a: Array
    basis: Array

    @property
    def desired(self) -> PathMotion:
        """Desired motion of the end-effector at the times t; that of the rigid mechanism for x or y not in the task."""
        planned, effector = self.path.evaluate(self.t), self.mechanism.end_effector
        assert effector is not None
        given = [name in effector.coordinates for name in ("x", "y")]
        if all(given):
            return planned
        own = point_motion(self.system, effector.point, self.q, self.v, self.a)
        return PathMotion(*(np.where(given, path, place) for path, place in zip(planned, own, strict=True)))


@checked_arguments()
@solvable("the motion along the path")
def follow_path(
    mechanism: Mechanism,
    path: Path,
    times: Sequence[float] | Array,
    *,
    assembly: str | Assembly | None = None,
    orientation: float = 0.0,
) -> RigidMotion:
    """Compute positions, velocities and accelerations of all bodies along a path of the end-effector.

    The mechanism must have as many task coordinates as degrees of freedom. Bodies are taken as rigid.

    Parameters
    ----------
    mechanism : Mechanism
        Mechanism with an end-effector.
    path : Path
        Path of the end-effector.
    times : (k,) array
        Sample times, ascending [s].
    assembly : str or Assembly, optional
        Assembly in which the mechanism starts; the first of the mechanism by default.
    orientation : float
        Angle of the end-effector if it is a task coordinate and the path does not prescribe it [rad].

    Returns
    -------
    RigidMotion
        Motion at the sample times.

    Raises
    ------
    InputError
        There is no end-effector, the number of task coordinates differs from the degrees of freedom, or the path has
        angles and the task has none.
    AssemblyError
        The assembly does not close.
    UnreachablePathError
        The path leaves the workspace or passes a Type I singularity; the error gives time and position.
    """
    end = float(np.max(times, initial=0.0))
    return path_follower(mechanism, path, end, assembly=assembly, orientation=orientation)(times)


@checked_arguments()
def pose_at(
    mechanism: Mechanism,
    position: tuple[float, float],
    *,
    assembly: str | Assembly | None = None,
    orientation: float = 0.0,
) -> Array:
    """Compute the pose of the rigid mechanism with its end-effector at a position.

    Parameters
    ----------
    mechanism, assembly, orientation
        See `follow_path`.
    position : (float, float)
        Position of the end-effector [m].

    Returns
    -------
    (n,) array
        Coordinates of the bodies, those of `RigidMotion.q`.

    Raises
    ------
    InputError, AssemblyError, UnreachablePathError
        See `follow_path`.
    """
    still = KnownPath(PathMotion(np.array([position]), np.zeros((1, 2)), np.zeros((1, 2))))
    return path_follower(mechanism, still, 0.0, assembly=assembly, orientation=orientation)([0.0]).q[0]


@checked_arguments()
def path_follower(
    mechanism: Mechanism,
    path: Path,
    end: float,
    *,
    assembly: str | Assembly | None = None,
    orientation: float = 0.0,
) -> "PathFollower":
    """Prepare `follow_path` for several sets of times.

    Parameters
    ----------
    mechanism, path, assembly, orientation
        Arguments of `follow_path`. Its errors are raised here, but those of the path when the times are given.
    end : float
        Last time of all sets [s].

    Returns
    -------
    PathFollower
        Callable that returns the motion at times (k,), ascending [s].
    """
    if mechanism.end_effector is None:
        raise InputError("the mechanism has no end-effector", field="end_effector", remedy="name its point")
    closure = PathClosure(mechanism.rigid(), orientation, end)
    chosen = assembly if isinstance(assembly, Assembly) else mechanism.assembly(assembly)
    closure.check_degrees_of_freedom(chosen)
    if turning_of(path, np.zeros(1)) is not None and "angle" not in mechanism.end_effector.coordinates:
        raise InputError(
            "the path gives angles, but the task has none", field="end_effector.coordinates",
            value=list(mechanism.end_effector.coordinates), remedy='name "angle", or leave the angles out',
        )  # fmt: skip
    return PathFollower(closure, closure.assembled(chosen), path)


@dataclass(frozen=True)
class PathFollower:
    """Motion of the rigid mechanism along a path, at any times.

    Attributes
    ----------
    closure : PathClosure
        Rigid system whose loops are closed.
    assembled : (n,) array
        Pose of the assembly from which the path is approached.
    path : Path
        Path of the end-effector.
    """

    closure: "PathClosure"
    assembled: Array
    path: Path

    def __call__(self, times: Sequence[float] | Array) -> RigidMotion:
        """Return the motion at times (k,), ascending [s]; see `follow_path` for its errors."""
        times = np.ascontiguousarray(times, dtype=float)
        grid, keep = no_long_steps(times, _LONGEST_STEP)
        pose = self.closure.approach(self.path, self.assembled, times[0], times[-1])
        return self.closure.walk(self.path, pose, grid, keep)

    def along(self, path: Path) -> "PathFollower":
        """Return the follower of another path, in the same assembly and orientation."""
        return replace(self, path=path)


class PathClosure(LoopClosure):
    """Rigid system with its task marker, whose loops are closed along a path."""

    def __init__(self, mechanism: Mechanism, orientation: float, end: float) -> None:
        effector = mechanism.end_effector
        assert effector is not None
        names = [TASK_COORDINATES.index(name) for name in effector.coordinates]
        super().__init__(mechanism, end, effector.point, np.array(names))
        self.orientation = orientation
        self.reach: PoseSearch = PoseSearch(self.system, effector.point, self.coordinates, self.signals)

    def check_degrees_of_freedom(self, assembly: Assembly) -> None:
        """Check that there are as many task coordinates as degrees of freedom."""
        free, tasks, repeated = self.system.n - self.system.n_constraints, self.coordinates.size, []
        if free == tasks:
            return
        with suppress(NumericalError):
            repeated = redundant_rows(self.system, self.assembled(assembly))
        if free + len(repeated) == tasks:
            return
        raise InputError(
            f"the mechanism has {free + len(repeated)} degrees of freedom, its task {tasks} coordinate(s)",
            field="end_effector.coordinates",
            value=[TASK_COORDINATES[i] for i in self.coordinates],
            remedy="name as many task coordinates as there are degrees of freedom",
        )

    def task(self, q: Array) -> Array:
        """Return the task coordinates at a pose."""
        zero, out = np.zeros_like(q), apart((3, self.coordinates.size))
        task_values(self.packed, self.packed.markers[self.marker], self.coordinates, q, zero, zero, out)
        return out[0]

    def target(self, path: Path, t: Array) -> Array:
        """Return the task coordinates, selected from x, y and angle, and two derivatives (times, 3, tasks)."""
        motion, turning = path.evaluate(t), turning_of(path, t)
        if turning is None:
            turning = np.zeros((3, t.size))
            turning[0] = self.orientation
        full = np.concatenate([np.stack(motion), turning[:, :, None]], axis=2)
        return np.ascontiguousarray(full[:, :, self.coordinates].transpose(1, 0, 2))

    def approach(self, path: Path, pose: Array, start: float, end: float) -> Array:
        """Move the end-effector from the assembly to the start of the path, staying in that assembly."""
        goal = self.target(path, np.array([start]))[0, 0]
        here = self.task(pose)
        reached = pose
        for steps in _APPROACHES:
            fractions = np.linspace(0.0, 1.0, steps + 1)
            target = np.zeros((steps + 1, 3, goal.size))
            target[:, 0] = here + fractions[:, None] * (goal - here)
            status, index, (q, *_) = self.run(np.zeros(steps + 1), target, pose)
            if status == LOOPS_CLOSED:
                return q[-1]
            reached = q[index - 1] if index else reached
        found = self.shortfall(path, start, end, reached)
        cause, detail = "the path's start is out of reach", f"{found.beyond(0)} beyond reach"
        if not found.out[0]:
            cause, detail = "the path's start is not reached from the assembly's pose", _OTHER
        raise self._unreachable(cause, detail, found, start, 0, None)

    def walk(self, path: Path, pose: Array, grid: Array, keep: Mask) -> RigidMotion:
        """Return the motion at the instants of a grid, with further instants where steps are too long."""
        found = self.follow(lambda times: self.target(path, times), grid, keep, pose)
        motion = RigidMotion(self.mechanism, self.system, path, *found.arrays)
        if found.closed:
            return motion
        at = found.stopped
        # The Jacobian is singular as well where the path leaves the workspace, but beyond it no loop closes.
        found = self.shortfall(path, at, float(grid[-1]), found.last)
        cause, detail = "the path passes a Type I singularity", _NEARLY_SINGULAR
        if np.any(found.out[found.t <= at + _SOON * (found.t[-1] - at)]):
            cause, detail = "the path goes out of reach", ""
        elif np.any(found.elsewhere):
            detail = _OTHER
        raise self._unreachable(cause, detail, found, at, motion.t.size, motion)

    def shortfall(self, path: Path, start: float, end: float, pose: Array) -> Shortfall:
        """Return the distance of a path from the workspace, from a pose near its start onwards.

        It is that from the desired position to the nearest pose that joints and prescribed motions allow. A path within
        reach may still be impossible to follow: past a Type I singularity poses continue in another assembly.
        """
        end = max(start, min(end, path.duration))
        knots = [knot for knot in path.knots if start < knot < end]
        times = np.unique([*np.linspace(start, end, _INSTANTS_LOOKED_AT), *knots])
        found = self.distances(path, times, pose)
        k = found.furthest
        if not found.out[k] or times.size < 2:
            return found
        span = times[max(k - 1, 0)], times[min(k + 1, times.size - 1)]
        closer = np.setdiff1d(np.linspace(*span, _MORE_LOOKS + 2)[1:-1], times)
        return found.joined(self.distances(path, closer, pose))

    def distances(self, path: Path, times: Array, pose: Array) -> Shortfall:
        """Return the distances of a path from the workspace at some times, from a pose or the assemblies that close."""
        return self.reach.shortfall(times, self.target(path, times)[:, 0], pose, self._other_poses)

    @cached_property
    def _other_poses(self) -> list[Array]:
        poses = []
        for assembly in self.mechanism.assemblies:
            with suppress(AssemblyError):
                poses.append(self.assembled(assembly))
        return poses

    def _unreachable(
        self, cause: str, detail: str, found: Shortfall, at: float, step: int, partial: RigidMotion | None
    ) -> UnreachablePathError:
        """Return the error of a path that cannot be followed: time, position, and distance of its furthest point."""
        lengths, k = self.coordinates != 2, found.furthest
        # A closed path has the same distance at its start and end, which is reported once.
        if found.out[k] and found.beyond(k) != found.beyond(0):
            place = ", ".join(f"{x:.4g}" for x in found.desired[k, lengths])
            place = f"({place}) m" if place else f"at t = {found.t[k]:.6g} s"
            furthest = f"its furthest point, {place}, lies {found.beyond(k)} beyond reach"
            detail = f"{detail}; {furthest}" if detail else furthest
        size = sum(
            np.hypot.reduce(np.max(np.abs([*local_points(body).values()]), axis=0)) for body in self.mechanism.bodies
        )
        if np.max(found.distance) > _OTHER_UNIT * size:
            detail += f"; that is {np.max(found.distance) / size:.0f} times the mechanism's size: is the path in mm?"
        place = tuple(found.desired[0, lengths].tolist()) or None
        return UnreachablePathError(
            cause, Moment(at, step, place), partial, _MOVE_PATH, detail=detail,
            shortfall=float(np.max(found.distance)), shortfall_angle=float(np.max(found.turn)),
        )  # fmt: skip
