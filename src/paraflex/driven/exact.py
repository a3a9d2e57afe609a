"""Motion of a driven mechanism at any time, from the closure of its loops."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np
import scipy

from paraflex.arrays import Array, Brief, Mask
from paraflex.dynamics import System, build_system
from paraflex.dynamics.soundness import Mobility, mobility
from paraflex.dynamics.state import State
from paraflex.errors import listed
from paraflex.formatting import quantity
from paraflex.integrators import Solution
from paraflex.kernel.closure import LOOPS_CLOSED
from paraflex.mechanism import ConstantSpeed, Mechanism
from paraflex.paths import RigidMotion
from paraflex.paths.closure import PathClosure
from paraflex.paths.loops import ClosedLoops, LoopClosure

# Part of a turn or travel, on either side of a change point, over which a motion is interpolated.
_BESIDE = 1.0 / 720.0
# Part of this time within which a sample is at the change point.
AT = 1e-3
# Deviation beyond a change point from the motion before it, as a part of the move, on the same branch.
_SAME_BRANCH = 0.05
# Singular value of constraints that depend on others, relative to the largest, and accuracy of a change point.
_DEPENDENT = 1e-9
# Part of the width about a change point to which its place is shown.
_SHARP = 1e-5
# Difference of poses, and of velocities as a part of the largest, after which a motion repeats.
_REPEATED, _SAME_RATES = 1e-9, 1e-6
# Change points that a motion may pass, and those that a finding lists.
_MOST_PASSED, _SHOWN = 100, 6
Target = Callable[[Array], Array]
# Values at which other joints are held, or between which they move [rad, m].
Held = Mapping[str, float | tuple[float, float]]
NO_TASKS = np.zeros(0, dtype=np.int64)


def no_target(times: Array) -> Array:
    """Return the task coordinates (times, 3, 0) of a motion that drives alone determine."""
    return np.zeros((times.size, 3, 0))


def width_beside(drive: "Drive | None", end: float, mechanism: Mechanism | None = None) -> float:
    """Return the time before and after a change point over which a motion until `end` is interpolated [s].

    Without a drive, the time of a turn is that of the fastest of a mechanism's prescribed motions that turn.
    """
    if drive is not None:
        return _BESIDE * (2.0 * math.pi / drive.speed if drive.unit == "rad" else end)
    times = np.linspace(0.0, end, 181)
    turning = [one.profile for one in mechanism.prescribed if not mechanism.slides(one.joint)] if mechanism else []
    fastest = max((float(np.max(np.abs(one.evaluate(times)[1]))) for one in turning), default=0.0)
    return _BESIDE * max(end, min(2.0 * math.pi / fastest, 90.0 * end) if fastest else 0.0)


def placed(drive: "Drive | None", times: Sequence[float]) -> tuple[str, str]:
    """Return the place of a finding on some times of a motion [s], and the values of the drive at these times."""
    if drive is None:
        return "drive", f"drives at t = {listed([f'{t:.6g}' for t in times], _SHOWN)} s"
    # Errors of the times would be shown of a value of zero.
    least = _SHARP * drive.speed * width_beside(drive, drive.duration)
    values = [quantity(least * round(drive.at(t) / least), drive.unit, digits=6) for t in times]
    return f"drive {drive.joint}", f"{drive.joint} at {listed(values, _SHOWN)}"


class FirstPose(NamedTuple):
    """First pose (n,) of a motion, and its velocities and accelerations if known, which tell assemblies apart."""

    q: Array
    rates: tuple[Array, Array] | None = None


class ExactState(NamedTuple):
    """Coordinates, velocities and accelerations (k, n) at some times."""

    q: Array
    v: Array
    a: Array


@dataclass(frozen=True)
class Drive:
    """Joint that moves the mechanism, at constant speed.

    Attributes
    ----------
    name, joint : str
        Name of the prescribed motion, and of its joint.
    start, end : float
        First and last angle [rad] or travel [m] of the joint.
    speed : float
        Speed, positive [rad/s, m/s].
    unit : str
        Unit of its coordinate: "rad" or "m".
    reach : tuple of float or None
        Lowest and highest angle or travel that the mechanism allows in this assembly, None for those that do not lie
        in the range examined.
    held : mapping of str to float, or to a pair of float
        Other joints that are held, with their angles [rad] or travels [m]; a pair is the first and last one of a joint
        that moves in the same time, at constant speed.
    """

    name: str
    joint: str
    start: float
    end: float
    speed: float
    unit: str
    reach: tuple[float | None, float | None] = (None, None)
    held: Held = field(default_factory=dict)

    @property
    def turns(self) -> float:
        """Number of turns; zero for a travel."""
        return abs(self.end - self.start) / (2.0 * math.pi) if self.unit == "rad" else 0.0

    @property
    def full_turn(self) -> bool:
        """Whether the joint makes one whole turn, and others that move whole turns."""
        turns = [(last - first) / (2.0 * math.pi) for first, last in self.ends_of_others.values()]
        return math.isclose(self.turns, 1.0, rel_tol=1e-9) and all(abs(one - round(one)) < 1e-9 for one in turns)

    @property
    def ends_of_others(self) -> dict[str, tuple[float, float]]:
        """First and last angle [rad] or travel [m] of the other joints; the same for those that are held."""
        return {name: one if isinstance(one, tuple) else (one, one) for name, one in self.held.items()}

    @property
    def alone(self) -> bool:
        """Whether no other joint moves in the same time."""
        return all(first == last for first, last in self.ends_of_others.values())

    @property
    def duration(self) -> float:
        """Time of the travel [s]."""
        return abs(self.end - self.start) / self.speed

    @property
    def profile(self) -> ConstantSpeed:
        """Angle or travel over time."""
        return ConstantSpeed(self.start, math.copysign(self.speed, self.end - self.start))

    def at(self, t: float) -> float:
        """Return the angle or travel at a time [s]."""
        return self.start + t * self.profile.speed


def follow_past(
    loops: LoopClosure, target: Target, grid: Array, keep: Mask, first: FirstPose, beside: float
) -> tuple[ClosedLoops, list[float]]:
    """Follow a motion as `LoopClosure.follow` does, and past change points, on the branch whose velocities continue.

    Near a change point, where assemblies meet, the equations are ill-conditioned. There the motion is the polynomial
    of degree five through positions, velocities and accelerations at a time `beside` before and after it [s].

    Returns
    -------
    loops, passed
        Motion as far as the loops close, and the times of the change points [s].
    """
    passed: list[float] = []
    parts: list[tuple[Array, ...]] = []
    pose, begin = first.q, float(grid[0])
    if first.rates is not None and not loops.coordinates.size:
        # From a time before the start, where the branch is that of the velocities.
        step, (v, a) = -2.0 * beside, first.rates
        lead = _closed_near(loops, begin + step, pose + step * (v + 0.5 * step * a))
        if lead is not None:
            grid, keep, pose = np.append(begin + step, grid), np.append(False, keep), lead.q[0]
    while True:
        found = loops.follow(target, grid, keep, pose.copy())
        singular, t = found.stopped, found.arrays[0]
        count = int(np.searchsorted(t, singular - beside, side="right"))
        start, begun = (float(t[count - 1]), found.arrays[1][count - 1]) if count else (float(grid[0]), pose)
        # Motions along paths end at singular positions of their own kind.
        if found.closed or loops.coordinates.size or len(passed) == _MOST_PASSED:
            break
        ends = (singular - beside, singular + beside)
        before = state_at(loops, target, start, begun, ends[0])
        after = _continued(loops, before, ends) if before.q.size else None
        if after is None:
            break
        inside = grid[keep & (grid > ends[0]) & (grid <= ends[1])]
        curve = scipy.interpolate.BPoly.from_derivatives(ends, [np.concatenate(before), np.concatenate(after)])
        passed.append(_most_singular(loops.system, curve, ends))
        between = [curve(inside), *(curve.derivative(order)(inside) for order in (1, 2))]
        parts += [tuple(part[:count] for part in found.arrays), (inside, *between, np.zeros((*between[0].shape, 0)))]
        later = grid > ends[1]
        grid, keep = np.append(ends[1], grid[later]), np.append(False, keep[later])
        pose = after.q[0]
    arrays = tuple(np.concatenate(each) for each in zip(*parts, found.arrays, strict=True))
    return replace(found, arrays=arrays), [t for t in passed if t >= begin - AT * beside]


def _most_singular(system: System, curve: Callable[[float], Array], ends: tuple[float, float]) -> float:
    """Return the time [s] on a curve q(t) at which rows that are independent at its start come nearest to dependence.

    Loops fail to close somewhat before it.
    """

    def sizes(t: float) -> Any:
        return np.linalg.svd(system.dimensionless_jacobian(curve(t)), compute_uv=False)

    first = sizes(ends[0])
    last = int(np.sum(first > _DEPENDENT * first[0])) - 1
    near = {"bounds": ends, "method": "bounded", "options": {"xatol": _DEPENDENT * (ends[1] - ends[0])}}
    return float(scipy.optimize.minimize_scalar(lambda t: sizes(t)[last], **near).x)


def state_at(loops: LoopClosure, target: Target, start: float, pose: Array, t: float) -> ExactState:
    """Return the motion (1, n) at a time from the pose at an earlier one [s]."""
    found = loops.follow(target, np.array([start, t]), np.array([False, True]), pose.copy())
    return ExactState(*found.arrays[1:4])


def _continued(loops: LoopClosure, before: ExactState, ends: tuple[float, float]) -> ExactState | None:
    """Return the state beyond a change point on the same branch; None if there is none, as at a limit of reach."""
    step, units = ends[1] - ends[0], loops.system.units
    predicted = before.q + step * (before.v + 0.5 * step * before.a)
    after = _closed_near(loops, ends[1], predicted[0])
    if after is None:
        return None
    q, v, _ = after
    off, move = np.max(np.abs((q - predicted) / units)), np.max(np.abs((q - before.q) / units))
    turned, rate = np.max(np.abs((v - before.v - step * before.a) / units)), np.max(np.abs(before.v / units))
    return after if off <= _SAME_BRANCH * move and turned <= _SAME_BRANCH * rate else None


def _closed_near(loops: LoopClosure, t: float, pose: Array) -> ExactState | None:
    status, _, found = loops.run(np.array([t]), no_target(np.zeros(1)), pose)
    return ExactState(*found[:3]) if status == LOOPS_CLOSED else None


@dataclass(frozen=True)
class ExactMotion(Brief):
    """Motion of a driven mechanism, at samples and between them.

    Attributes
    ----------
    system : System
        System of the rigid mechanism.
    solution : Solution
        Motion at the samples.
    drive : Drive, optional
        Joint that moves at constant speed; None for other prescribed motions.
    loops : LoopClosure
        Equations that determine the motion.
    rigid : RigidMotion, optional
        Motion along a path; None for one that drives determine.
    passed : tuple of float
        Times of change points [s].
    """

    system: System
    solution: Solution
    drive: Drive | None
    loops: LoopClosure
    rigid: RigidMotion | None = None
    passed: tuple[float, ...] = ()

    @property
    def target(self) -> Target:
        """Function that returns the task coordinates over time."""
        if self.rigid is None:
            return no_target
        assert isinstance(self.loops, PathClosure)
        return partial(self.loops.target, self.rigid.path)

    @cached_property
    def beside(self) -> float:
        """See `width_beside`."""
        return width_beside(self.drive, float(self.solution.t[-1]), self.loops.mechanism)

    @cached_property
    def mobility(self) -> Mobility:
        """Degrees of freedom without the drives, and redundant constraints, at the first sample."""
        mechanism = replace(self.loops.system.mechanism, prescribed=())
        return mobility(build_system(mechanism), State(0.0, self.solution.q[0], self.solution.v[0]))

    def repeats_at(self, k: int) -> bool:
        """Return whether a drive has made whole turns at a sample, after which all bodies are as at the first one."""
        drive, system, q, v = self.drive, self.system, self.solution.q, self.solution.v
        if drive is None or drive.unit != "rad":
            return False
        off, angles = q[k] - q[0], [system.body(body.name).angle for body in system.mechanism.bodies]
        off[angles] -= 2.0 * math.pi * np.round(off[angles] / (2.0 * math.pi))
        pace = np.max(np.abs(v[0] / system.units))
        turns = abs(drive.at(self.solution.t[k]) - drive.start) / (2.0 * math.pi)
        whole = turns > 0.5 and abs(turns - round(turns)) < _REPEATED
        near = bool(np.all(np.abs(off) <= _REPEATED * system.units))
        return whole and near and bool(np.all(np.abs(v[k] - v[0]) <= _SAME_RATES * pace * system.units))

    @cached_property
    def repeats(self) -> bool:
        """Whether the motion starts again at its end."""
        return self.repeats_at(self.solution.t.size - 1)

    def at(self, t: float) -> ExactState:
        """Return the motion (1, n) at a time within the samples [s], exact to rounding."""
        times, beside = self.solution.t, self.beside
        k = int(np.clip(np.searchsorted(times, t) - 1, 0, times.size - 1))
        # The motion does not start from samples near a change point.
        while k > 0 and any(abs(times[k] - one) <= beside for one in self.passed):
            k -= 1
        # Where loops close in spite of a change point nearby, accelerations are rounding: the motion goes on beyond it.
        beyond = [one + 2.0 * beside for one in self.passed if abs(one - t) <= beside]
        given = np.array([times[k], t, *beyond]), np.array([False, True, *(False for _ in beyond)])
        solution = self.solution
        first = FirstPose(solution.q[k], None if k else (solution.v[0], solution.a[0]))
        return ExactState(*follow_past(self.loops, self.target, *given, first, beside)[0].arrays[1:4])
