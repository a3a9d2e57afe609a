"""Shaped motions: a path, or the torques of a plan, convolved with the impulses of a shaper."""

from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace

import numpy as np

from paraflex.actuation import FeedForward, TorquePlan, plan_torques, required_effort
from paraflex.arguments import CheckedFields, checked_arguments
from paraflex.arrays import Array
from paraflex.errors import InputError
from paraflex.mechanism import ActuationMode
from paraflex.paths import Path, PathFollower, PathMotion, turning_of
from paraflex.tracking import TrackingTask, path_knots
from .shapers import Shaper

# A run may end before the shaped torques do by this fraction of their duration, a rounding error.
_SAME_END = 1e-9


@dataclass(frozen=True)
class ShapedPath(CheckedFields):
    """Path with shaped motion: p(t) = sum A_i r(t - t_i), and likewise its velocity, acceleration and angle.

    It begins and ends where the path r does, its end is delayed by the shaper's duration, and it cuts corners between.

    Attributes
    ----------
    path : Path
        Path r, at rest before its start.
    shaper : Shaper
        Input shaper.

    Raises
    ------
    InputError
        An object that is not a path, or not a shaper.
    """

    path: Path
    shaper: Shaper

    @property
    def duration(self) -> float:
        """Duration of the motion, the sum of those of path and shaper [s]."""
        return self.path.duration + self.shaper.duration

    @property
    def knots(self) -> tuple[float, ...]:
        """Knots of the path, delayed by the time of each impulse [s]."""
        return tuple(np.unique(np.add.outer(self.shaper.times, np.array(self.path.knots))))

    def evaluate(self, t: Array) -> PathMotion:
        """Return the motion at times t."""
        return PathMotion(*self._shaped(lambda at: np.stack(self.path.evaluate(at)), t))

    def turning(self, t: Array) -> Array | None:
        """Return the end-effector's angle [rad], rate and acceleration at times t (3, k); None without angles."""
        if turning_of(self.path, np.zeros(1)) is None:
            return None
        return self._shaped(lambda at: np.stack(self.path.turning(at)), t)  # type: ignore[attr-defined]

    def _shaped(self, motion: Callable[[Array], Array], t: Array) -> Array:
        """Return the weighted sum of delayed copies of a motion (3, k, ...)."""
        t, total = np.atleast_1d(t) * 1.0, np.zeros(())
        for delay, weight in zip(self.shaper.times, self.shaper.amplitudes, strict=True):
            begun = np.real(t - delay) >= 0.0
            copy = motion(np.where(begun, t - delay, 0.0))
            copy[1:, ~begun] = 0.0
            total = total + weight * copy
        return total


@dataclass(frozen=True)
class ShapedTorquePlan(TorquePlan):
    """Shaped torques of another plan, together with the rigid motion along its shaped path.

    Attributes
    ----------
    unshaped : TorquePlan
        Plan whose torques are shaped.
    shaper : Shaper
        Input shaper.
    """

    unshaped: TorquePlan = field(kw_only=True)
    shaper: Shaper = field(kw_only=True)

    def feed_forward(self, mode: ActuationMode) -> FeedForward:
        """Return the shaped torques of a mode: see `TorquePlan.feed_forward`."""
        return self.unshaped.feed_forward(mode).shaped(self.shaper.times, self.shaper.amplitudes)


@checked_arguments()
def shape_torques(task: TrackingTask, shaper: Shaper) -> TrackingTask:
    """Return the task driven by shaped torques: tau(t) = sum A_i tau_0(t - t_i), with tau_0 its planned torques.

    Before the start of the path the first torque holds, so that weight stays balanced. The desired motion is that along
    the shaped path, which a linear mechanism follows under these torques; a mechanism whose inertia changes on the way
    departs from it. Where the path matters, plan along a `ShapedPath` instead. Torques against loads that change in
    time are delayed with the rest.

    Parameters
    ----------
    task : TrackingTask
        Task with a duration of at least that of its path plus the shaper.
    shaper : Shaper
        Input shaper.

    Raises
    ------
    InputError
        The task ends before the shaped torques do.
    UnreachablePathError
        The shaped path, which cuts corners, leaves the workspace or passes a Type I singularity.
    """
    path, end = ShapedPath(task.path, shaper), float(task.motion.t[-1])
    if end < path.duration * (1.0 - _SAME_END):
        raise InputError(
            "the run ends before the shaped torques do", field="duration", value=end,
            remedy=f"plan with a duration of at least {path.duration:.6g} s",
        )  # fmt: skip
    assert isinstance(task.plan.follow, PathFollower)
    follow = task.plan.follow.along(path)
    motion = follow(task.motion.t)
    planned = plan_torques(follow, path_knots(path, end, task.mechanism))
    own = {each.name: getattr(planned, each.name) for each in fields(planned)}
    plan = ShapedTorquePlan(**own, unshaped=task.plan, shaper=shaper)
    whole = None if task.whole is None else shape_torques(task.whole, shaper)
    return replace(task, path=path, motion=motion, effort=required_effort(motion), plan=plan, whole=whole)
