"""Test cases for comparing integration methods: one motion, and the points whose positions define the error."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from paraflex.arguments import checked_arguments, named_in_errors
from paraflex.arrays import Array
from paraflex.dynamics import State, System, build_system
from paraflex.dynamics.points import point_motion
from paraflex.errors import IntegrationError
from paraflex.integrators import IntegrationOptions, Solution, check_times
from paraflex.mechanism import ActuationMode, Mechanism, PointRef
from paraflex.mechanism.loads import InTime
from paraflex.motion import MotionRun, simulate_motion
from paraflex.tracking import TrackingRun, TrackingTask, simulate

Progress = Callable[[float], None]


@named_in_errors("a case", "what tracking_case or motion_case returns")
@dataclass(frozen=True)
class Case:
    """A motion to be integrated by several methods.

    Attributes
    ----------
    name : str
        Short description of the case.
    system : System
        System whose equations of motion are integrated.
    duration : float
        Duration of the motion [s].
    samples : int
        Number of output samples.
    points : tuple of PointRef
        Points whose positions are compared; if empty, the origins of all body frames.
    solve : callable
        Function that integrates the motion with given options and returns the solution. Its second argument, a callable
        or None, receives the time reached [s].
    """

    name: str
    system: System
    duration: float
    samples: int
    points: tuple[PointRef, ...]
    solve: Callable[[IntegrationOptions, Progress | None], Solution]

    def places(self, solution: Solution) -> Array:
        """Compute the positions of the compared points at the samples (k, points, 2) [m]."""
        q, v, a = solution.q, solution.v, solution.a
        if not self.points:
            return np.stack([q[:, body.position] for body in self.system.bodies], axis=1)
        return np.stack([point_motion(self.system, point, q, v, a).position for point in self.points], axis=1)


@checked_arguments()
def tracking_case(task: TrackingTask, mode: str | ActuationMode) -> Case:
    """Build the case of one mode of a task; the error is that of the end-effector.

    Parameters
    ----------
    task : TrackingTask
        Planned motion along a path.
    mode : str or ActuationMode
        Actuation mode.

    Raises
    ------
    InputError
        Unknown mode.
    """
    chosen, effector = task.mode(mode), task.mechanism.end_effector
    assert effector is not None

    times, solve = task.motion.t, partial(_solution, partial(simulate, task, chosen))
    return Case(f"mode {chosen.name}", task.system, float(times[-1] - times[0]), times.size, (effector.point,), solve)


@checked_arguments()
def motion_case(
    mechanism: Mechanism,
    duration: float,
    *,
    samples: int = 701,
    torques: Mapping[str, InTime] | None = None,
    start: State,
) -> Case:
    """Build the case of a motion without a path; the error is that of the end-effector, or else of all named points.

    Parameters
    ----------
    mechanism, duration, samples, torques, start
        See `motion.simulate_motion`.

    Raises
    ------
    InputError
        Invalid duration or number of samples.
    """
    check_times(duration, samples)
    effector = mechanism.end_effector
    every = tuple(PointRef(body.name, point) for body in mechanism.bodies for point in body.points)

    points = every if effector is None else (effector.point,)
    run = partial(simulate_motion, mechanism, duration, samples=samples, torques=torques, start=start)
    return Case("its own motion", build_system(mechanism), duration, samples, points, partial(_solution, run))


def _solution(
    run: Callable[..., TrackingRun | MotionRun], options: IntegrationOptions, on_progress: Progress | None
) -> Solution:
    """Return the solution of a run; an IntegrationError is passed on with the partial solution."""
    try:
        return run(options=options, on_progress=on_progress).solution
    except IntegrationError as error:
        error.partial = error.partial.solution
        raise
