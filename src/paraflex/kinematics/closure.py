"""The joint motion that makes the end-effector follow a path: Newton on the constraints, from a named assembly."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from paraflex.arguments import checked_arguments
from paraflex.dynamics import (
    System,
    build_system,
    constant_signals,
    pack_signals,
    project_position,
    records,
    reference_pose,
)
from paraflex.errors import InputError, Moment, UnreachablePathError
from paraflex.kernel.arrays import apart
from paraflex.kernel.closure import CLOSED, NO_CONVERGENCE, SINGULAR, close_path, make_closure_scratch, task_values
from paraflex.kernel.packed import MARKER, PackedSystem, Signals
from paraflex.kinematics.paths import Path, PathMotion
from paraflex.mechanism import Assembly, Mechanism, PointRef
from paraflex.mechanism.mechanism import TASK_COORDINATES

# Closure walks along the path in steps no longer than this [s], whatever times are asked for.
_LONGEST_STEP = 1e-3
# Where such a step is too long it is cut into pieces, and these again; a step shorter than this is short enough [s].
_PIECES, _SHORTEST_STEP = 16, 1e-6
# Steps from the assembly's pose to the start of the path; more where these fail.
_APPROACHES = (25, 250, 2500)


@dataclass(frozen=True)
class RigidMotion:
    """The motion of the rigid mechanism along a path.

    Attributes
    ----------
    mechanism : Mechanism
        Rigid.
    system : System
        Of it, without springs, dampers and friction at its joints: three coordinates a body (RDM).
    path : Path
    t : (k,) array
        [s]
    q, v, a : (k, n) arrays
        Coordinates, velocities and accelerations.
    basis : (k, n, tasks) array
        Velocities of all coordinates per unit of each task velocity: spans the null space of Phi_q.
    """

    mechanism: Mechanism
    system: System
    path: Path
    t: NDArray[np.float64]
    q: NDArray[np.float64]
    v: NDArray[np.float64]
    a: NDArray[np.float64]
    basis: NDArray[np.float64]

    @property
    def desired(self) -> PathMotion:
        """Of the end-effector at the times t."""
        return self.path.evaluate(self.t)


@checked_arguments()
def follow_path(
    mechanism: Mechanism,
    path: Path,
    times: Sequence[float] | NDArray[np.float64],
    *,
    assembly: str | Assembly | None = None,
    orientation: float = 0.0,
) -> RigidMotion:
    """Positions, velocities and accelerations of all bodies along a path of the end-effector.

    Works for any mechanism with as many task coordinates as degrees of freedom. Bodies are taken as rigid.

    Parameters
    ----------
    mechanism : Mechanism
    path : Path
    times : (k,) array
        Ascending [s].
    assembly : str or Assembly, optional
        Which way the mechanism is put together; the first of the mechanism by default.
    orientation : float
        Angle of the end-effector where it is a task coordinate and the path does not say it [rad].

    Returns
    -------
    RigidMotion

    Raises
    ------
    InputError
        No end-effector, a number of task coordinates other than the degrees of freedom, or a path with angles for a
        task without.
    AssemblyError
        The assembly does not close.
    UnreachablePathError
        The path leaves the workspace or passes a Type I singularity: it names time and position.
    """
    end = float(np.max(times, initial=0.0))
    return path_follower(mechanism, path, end, assembly=assembly, orientation=orientation)(times)


@checked_arguments()
def path_follower(
    mechanism: Mechanism,
    path: Path,
    end: float,
    *,
    assembly: str | Assembly | None = None,
    orientation: float = 0.0,
) -> Callable[[Sequence[float] | NDArray[np.float64]], RigidMotion]:
    """`follow_path` for several sets of times: what does not depend on them is made once.

    Parameters
    ----------
    mechanism, path, assembly, orientation
        See `follow_path`, also for what is raised; of the path itself, when the times are known.
    end : float
        The last time of all [s].

    Returns
    -------
    callable
        The motion at times (k,), ascending [s].
    """
    if mechanism.end_effector is None:
        raise InputError("the mechanism has no end-effector", field="end_effector", remedy="name its point")
    closure = PathClosure(mechanism.rigid(), orientation, end)
    closure.check_degrees_of_freedom()
    chosen = assembly if isinstance(assembly, Assembly) else mechanism.assembly(assembly)
    if _turning(path, np.zeros(1)) is not None and "angle" not in mechanism.end_effector.coordinates:
        raise InputError(
            "the path gives angles, the task has none", field="end_effector.coordinates",
            value=list(mechanism.end_effector.coordinates), remedy='name "angle", or leave the angles out',
        )  # fmt: skip
    assembled = closure.assemble(chosen)

    def follow(times: Sequence[float] | NDArray[np.float64]) -> RigidMotion:
        times = np.ascontiguousarray(times, dtype=float)
        grid, keep = _no_long_steps(times)
        return closure.walk(path, closure.approach(path, assembled, times[0]), grid, keep)

    return follow


def _no_long_steps(times: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Times and more between them where they are further apart than closure steps; which of them were there."""
    pieces = np.maximum(1, np.ceil(np.diff(times) / _LONGEST_STEP * (1.0 - 1e-9))).astype(int)
    first = np.concatenate([[0], np.cumsum(pieces)])
    step = np.repeat(np.diff(times) / pieces, pieces)
    within = np.arange(first[-1]) - np.repeat(first[:-1], pieces)
    grid = np.append(np.repeat(times[:-1], pieces) + within * step, times[-1:])
    keep = np.zeros(grid.size, dtype=bool)
    keep[first] = True
    return grid, keep


class PathClosure:
    """The rigid system with its task marker: what closes its loops."""

    def __init__(self, mechanism: Mechanism, orientation: float, end: float) -> None:
        effector = mechanism.end_effector
        assert effector is not None
        self.mechanism = mechanism
        # Springs, dampers and friction do not constrain.
        acts = mechanism.springs or mechanism.dampers or mechanism.frictions
        free = replace(mechanism, springs=(), dampers=(), frictions=()) if acts else mechanism
        self.system = system = build_system(free)
        self.orientation = orientation
        end = end if end > 0.0 else 1.0
        self.signals: Signals = pack_signals(
            system.mechanism, constant_signals([0.0] * len(system.mechanism.motors), end), end
        )[0]
        self.coordinates = np.array([TASK_COORDINATES.index(name) for name in effector.coordinates])
        self.packed, self.marker = with_marker(system, effector.point)

    def check_degrees_of_freedom(self) -> None:
        """Nothing, if there are as many task coordinates as degrees of freedom."""
        free, tasks = self.system.n - self.system.n_constraints, self.coordinates.size
        if free != tasks:
            raise InputError(
                f"the mechanism has {free} degrees of freedom, its task {tasks} coordinate(s)",
                field="end_effector.coordinates",
                value=[TASK_COORDINATES[i] for i in self.coordinates],
                remedy="name as many task coordinates as there are degrees of freedom",
            )

    def assemble(self, assembly: Assembly) -> NDArray[np.float64]:
        """The pose of an assembly, loops closed."""
        return project_position(self.system, self.signals, 0.0, reference_pose(self.system, assembly))

    def task(self, q: NDArray[np.float64]) -> NDArray[np.float64]:
        """Task coordinates of a pose."""
        zero, out = np.zeros_like(q), apart((3, self.coordinates.size))
        task_values(self.packed, self.packed.markers[self.marker], self.coordinates, q, zero, zero, out)
        return out[0]

    def target(self, path: Path, t: NDArray[np.float64]) -> NDArray[np.float64]:
        """(times, 3, tasks): the task coordinates chosen from x, y, angle."""
        motion, turning = path.evaluate(t), _turning(path, t)
        if turning is None:
            turning = np.zeros((3, t.size))
            turning[0] = self.orientation
        full = np.concatenate([np.stack(motion), turning[:, :, None]], axis=2)
        return np.ascontiguousarray(full[:, :, self.coordinates].transpose(1, 0, 2))

    def run(self, times: NDArray[np.float64], target: NDArray[np.float64], pose: NDArray[np.float64]):
        """Closure along targets; status, index, residual, and what was computed."""
        k, n = times.size, self.system.n
        q, v, a = apart((3, k, n))
        basis = apart((k, n, self.coordinates.size))
        q[0] = pose
        status, index, residual = close_path(
            self.packed,
            self.signals,
            self.marker,
            self.coordinates,
            times,
            target,
            q,
            v,
            a,
            basis,
            make_closure_scratch(self.packed, self.coordinates.size, self.signals.start.size),
        )
        return status, int(index), residual, (q, v, a, basis)

    def approach(self, path: Path, pose: NDArray[np.float64], start: float) -> NDArray[np.float64]:
        """Move the end-effector from where the assembly has it to the start of the path, staying in that assembly."""
        goal = self.target(path, np.array([start]))[0, 0]
        here = self.task(pose)
        residual = 0.0
        for steps in _APPROACHES:
            fractions = np.linspace(0.0, 1.0, steps + 1)
            target = np.zeros((steps + 1, 3, goal.size))
            target[:, 0] = here + fractions[:, None] * (goal - here)
            status, _, residual, (q, *_) = self.run(np.zeros(steps + 1), target, pose)
            if status == CLOSED:
                return q[-1]
        raise UnreachablePathError(
            f"the path's start is out of reach from the assembly's pose (a gap of {residual:.3g} remains)",
            Moment(start, 0, tuple(goal)),
        )

    def walk(self, path: Path, pose: NDArray[np.float64], grid: NDArray[np.float64], keep: NDArray[np.bool_]):
        """The motion at the instants of the grid to keep, with more instants between where steps prove too long."""
        stretches, gap = [], 0.0
        while True:
            target = self.target(path, grid)
            status, index, residual, found = self.run(grid, target, pose)
            last = index - 1
            # Where the path leaves the workspace the Jacobian is singular as well, but beyond nothing closes.
            gap = residual if status == NO_CONVERGENCE else gap
            if status in (CLOSED, SINGULAR) or last < 0 or grid[index] - grid[last] < _SHORTEST_STEP:
                break
            # From the last instant reached, in shorter steps.
            stretches.append([x[:last][keep[:last]] for x in (grid, *found)])
            pose = found[0][last]
            between = np.linspace(grid[last], grid[index], _PIECES + 1)[1:-1]
            grid = np.concatenate([grid[last:index], between, grid[index:]])
            keep = np.concatenate([keep[last:index], np.zeros(between.size, bool), keep[index:]])
        stretches.append([x[:index][keep[:index]] for x in (grid, *found)])
        motion = RigidMotion(
            self.mechanism, self.system, path, *(np.concatenate(parts) for parts in zip(*stretches, strict=True))
        )
        if status == CLOSED:
            return motion
        what = (
            f"the path is out of reach (a gap of {gap:.3g} remains)" if gap else "the path passes a Type I singularity"
        )
        moment = Moment(float(grid[index]), motion.t.size, tuple(target[index, 0]))
        raise UnreachablePathError(what, moment, partial=motion)


def _turning(path: Path, t: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """How the end-effector turns at times t (3, k), where a path says so."""
    says = getattr(path, "turning", None)
    return None if says is None else says(t)


def with_marker(system: System, ref: PointRef) -> tuple[PackedSystem, int]:
    """The packed system with one more marker, for a point that is not at a joint; rigid, so no shape rows."""
    marker = system.marker(ref)
    x, y = marker.x0
    record = records(MARKER, [{"body": marker.body, "bending": -1, "x": x, "y": y}])
    kind = max(system.packed.markers.dtype, record.dtype, key=lambda dtype: dtype.itemsize)
    markers = np.concatenate([system.packed.markers.astype(kind), record.astype(kind)])
    return system.packed._replace(markers=markers), markers.size - 1
