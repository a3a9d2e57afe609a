"""Closure of the loops of a rigid mechanism at ascending times, by Newton's iteration from each pose to the next."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from paraflex.arrays import Array, Brief, Indices, Mask
from paraflex.dynamics import System, assembled_position, build_system, records, reference_pose, still_signals
from paraflex.dynamics.system import DENSE_ROWS
from paraflex.errors import InputError
from paraflex.kernel.arrays import apart
from paraflex.kernel.closure import LOOPS_CLOSED, LOOPS_SINGULAR, close_path, make_closure_scratch
from paraflex.kernel.packed import MARKER, PackedSystem, Signals
from paraflex.limits import INSTANTS
from paraflex.mechanism import Assembly, Mechanism, PointRef, with_actuators
from .sparse_closure import RedundantClosure, SparseClosure

# Number of pieces of a step that is too long, divided repeatedly down to the shortest step [s], or as a part of
# a shorter motion.
_STEP_PIECES, _SHORTEST_STEP = 16, 1e-8


@dataclass(frozen=True)
class ClosedLoops(Brief):
    """Motion as far as the loops close.

    Attributes
    ----------
    arrays : tuple of array
        Times (k,), coordinates, velocities and accelerations (k, n), basis (k, n, tasks), at the requested instants.
    closed : bool
        Whether all requested instants were reached.
    stopped : float
        Time at which the loops did not close [s].
    last : (n,) array
        Last pose with closed loops.
    """

    arrays: tuple[Array, Array, Array, Array, Array]
    closed: bool
    stopped: float
    last: Array


class LoopClosure:
    """Rigid system whose loops are closed with as many task coordinates of a point given as its drives leave free.

    Parameters
    ----------
    mechanism : Mechanism
        Rigid mechanism.
    end : float
        Last time [s].
    point : PointRef, optional
        Point with the task coordinates; None if prescribed motions determine the motion.
    coordinates : (tasks,) array
        Task coordinates: 0 for x, 1 for y, 2 for the angle.
    """

    packed: PackedSystem
    marker: int

    def __init__(self, mechanism: Mechanism, end: float, point: PointRef | None, coordinates: Indices) -> None:
        self.mechanism = mechanism
        # Springs, dampers and friction are not constraints.
        moved = with_actuators(mechanism)
        acts = moved.springs or moved.dampers or moved.frictions
        self.system: System = build_system(replace(moved, springs=(), dampers=(), frictions=()) if acts else moved)
        self.signals: Signals = still_signals(self.system.mechanism, end if end > 0.0 else 1.0)[0]
        self.coordinates = coordinates
        self.packed, self.marker = (self.system.packed, 0) if point is None else with_marker(self.system, point)

    def assembled(self, assembly: Assembly) -> Array:
        """Return the pose of an assembly, loops closed."""
        return assembled_position(self.system, self.signals, 0.0, reference_pose(self.system, assembly))

    def run(self, times: Array, target: Array, pose: Array) -> tuple[int, int, tuple[Array, Array, Array, Array]]:
        """Close the loops along targets; return status, index, and the computed arrays."""
        k, n = times.size, self.system.n
        q, v, a = apart((3, k, n))
        basis = apart((k, n, self.coordinates.size))
        q[0] = pose
        if self.system.m > DENSE_ROWS or self.redundant:
            return *self._sparse.run(times, target, q, v, a, basis), (q, v, a, basis)
        scratch = make_closure_scratch(self.packed, self.coordinates.size, self.signals.start.size)
        given = (self.packed, self.signals, self.marker, self.coordinates, times, target)
        status, index = close_path(*given, q, v, a, basis, scratch)
        return status, int(index), (q, v, a, basis)

    def follow(self, target: Callable[[Array], Array], grid: Array, keep: Mask, pose: Array) -> ClosedLoops:
        """Close the loops at the instants of a grid, with further instants where steps are too long.

        Parameters
        ----------
        target : callable
            Function that returns the task coordinates and two derivatives (times, 3, tasks) at times [s].
        grid : (k,) array
            Times, ascending [s].
        keep : (k,) array of bool
            Whether an instant was requested.
        pose : (n,) array
            Pose near the first instant.
        """
        intervals, end = [], float(np.max(np.abs(grid[[0, -1]])))
        # Of very long motions it is a few roundings of the time.
        shortest = max(_SHORTEST_STEP * min(1.0, abs(float(grid[-1] - grid[0])) or 1.0), 8.0 * float(np.spacing(end)))
        while True:
            status, index, found = self.run(grid, target(grid), pose)
            last = index - 1
            if status in (LOOPS_CLOSED, LOOPS_SINGULAR) or last < 0 or abs(grid[index] - grid[last]) < shortest:
                break
            # Continue from the last instant reached, in shorter steps.
            intervals.append([x[:last][keep[:last]] for x in (grid, *found)])
            pose = found[0][last]
            between = np.linspace(grid[last], grid[index], _STEP_PIECES + 1)[1:-1]
            grid = np.concatenate([grid[last:index], between, grid[index:]])
            keep = np.concatenate([keep[last:index], np.zeros(between.size, bool), keep[index:]])
        intervals.append([x[:index][keep[:index]] for x in (grid, *found)])
        t, q, v, a, basis = (np.concatenate(parts) for parts in zip(*intervals, strict=True))
        stopped = float(grid[min(index, grid.size - 1)])
        return ClosedLoops((t, q, v, a, basis), status == LOOPS_CLOSED, stopped, pose if last < 0 else found[0][last])

    @property
    def redundant(self) -> bool:
        """Whether there are more constraints and task coordinates than coordinates."""
        return self.system.n_constraints + self.coordinates.size > self.system.n

    @cached_property
    def _sparse(self) -> SparseClosure:
        kind = RedundantClosure if self.redundant else SparseClosure
        return kind(self.system, self.packed, self.signals, self.marker, self.coordinates)


def no_long_steps(times: Array, longest: float) -> tuple[Array, Mask]:
    """Return times refined to the longest step [s], and which of them were given."""
    pieces = np.maximum(1.0, np.ceil(np.diff(times) / longest * (1.0 - 1e-9)))
    if np.sum(pieces) > INSTANTS:
        raise InputError(
            "too long for a motion along a path", field="duration", value=float(times[-1] - times[0]),
            remedy=f"at most {INSTANTS * longest:g} s: loops are closed every {longest:g} s",
        )  # fmt: skip
    pieces = pieces.astype(int)
    first = np.concatenate([[0], np.cumsum(pieces)])
    step = np.repeat(np.diff(times) / pieces, pieces)
    within = np.arange(first[-1]) - np.repeat(first[:-1], pieces)
    grid = np.append(np.repeat(times[:-1], pieces) + within * step, times[-1:])
    keep = np.zeros(grid.size, dtype=bool)
    keep[first] = True
    return grid, keep


def with_marker(system: System, ref: PointRef) -> tuple[PackedSystem, int]:
    """Return the packed system with one more marker, for a point not at a joint; rigid, hence without shape rows."""
    marker = system.marker(ref)
    x, y = marker.x0
    record = records(MARKER, [{"body": marker.body, "bending": -1, "x": x, "y": y}])
    kind = max(system.packed.markers.dtype, record.dtype, key=lambda dtype: dtype.itemsize)
    markers = np.concatenate([system.packed.markers.astype(kind), record.astype(kind)])
    return system.packed._replace(markers=markers), markers.size - 1
