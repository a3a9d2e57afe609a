"""Linear models at rest at poses along a motion, in common minimal coordinates."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array
from paraflex.dynamics import State
from paraflex.dynamics.points import marker_position
from paraflex.errors import InputError
from paraflex.limits import solvable
from paraflex.mechanism import ActuationMode
from paraflex.motion import MotionRun
from paraflex.tracking import TrackingRun, TrackingTask, undeformed_at
from .coordinates import FirstCoordinates
from .linearise import motion_variables
from .model import LinearModel
from .points import resting_point
from .varying import in_common_coordinates


@dataclass(frozen=True)
class PosesAlong:
    """Linear models at rest at poses along a motion.

    Attributes
    ----------
    places : (k,) array
        Positions of the poses: arc length of the end-effector's path [m], or without end-effector the time [s], both
        from the start.
    unit : str
        Unit of the positions, "m" or "s".
    models : tuple of LinearModel
        Linear models at the poses, all with the same states.
    elsewhere : LinearModel, optional
        Linear model at a separate pose, with the same states.
    """

    places: Array
    unit: str
    models: tuple[LinearModel, ...]
    elsewhere: LinearModel | None = None


@checked_arguments()
@solvable("linear models along a motion")
def poses_along(
    source: TrackingTask | TrackingRun | MotionRun,
    count: int,
    *,
    mode: str | ActuationMode | None = None,
    pose: State | None = None,
    forces: Sequence[str] = (),
    prescribed: Sequence[str] = (),
    coordinates: FirstCoordinates | str = FirstCoordinates.MOTORS,
) -> PosesAlong:
    """Linearise at rest at evenly spaced poses along a planned motion or a run, all in the same coordinates.

    Parameters
    ----------
    source : TrackingTask, TrackingRun or MotionRun
        Planned motion or run.
    count : int
        Number of poses, at least 2; they are at samples of the motion.
    mode, forces, prescribed, coordinates
        Inputs and states, see `linearise`.
    pose : State, optional
        Additional pose, for `PosesAlong.elsewhere`.

    Raises
    ------
    InputError
        There are fewer than two poses or more poses than distinct samples; or see `linearise`.
    SingularPositionError
        No coordinates describe the motion at all poses.
    """
    motion, variables = motion_variables(source, mode, forces, prescribed, coordinates)
    far, unit = _lengths(source)
    samples = _evenly(far, count)
    still = np.zeros(motion.system.n)
    states = [State(float(motion.times[k]), _coordinates(source, k), still) for k in samples]
    states += [] if pose is None else [pose]
    points = [resting_point(variables.coordinates, state, variables.ports.mode)[0] for state in states]
    models = in_common_coordinates(points, variables._replace(about="a pose at rest"), lambda model: model)[1]
    return PosesAlong(far[samples], unit, tuple(models[:count]), None if pose is None else models[count])


def _lengths(source: TrackingTask | TrackingRun | MotionRun) -> tuple[Array, str]:
    """Return the positions of all samples along the motion, and their unit: arc length [m] or time [s]."""
    if isinstance(source, TrackingTask):
        system, q, t = source.motion.system, source.motion.q, source.motion.t
    else:
        system = source.system if isinstance(source, MotionRun) else source.task.system
        q, t = source.solution.q, source.solution.t
    effector = system.mechanism.end_effector
    if effector is None:
        return t - t[0], "s"
    places = marker_position(system, system.marker(effector.point), q)
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(places, axis=0), axis=1))]), "m"


def _coordinates(source: TrackingTask | TrackingRun | MotionRun, sample: int) -> Array:
    if isinstance(source, TrackingTask):
        return undeformed_at(source.system, source.motion, sample)[0]
    return source.solution.q[sample]


def _evenly(far: Array, count: int) -> list[int]:
    """Return `count` samples, evenly spaced in position from the first to the last."""
    if count < 2:
        raise InputError("too few poses", field="count", value=count, remedy="give at least 2")
    samples = np.abs(far[:, None] - np.linspace(0.0, far[-1], count)).argmin(axis=0)
    apart = np.unique(samples).size
    if apart < count:
        raise InputError("more poses than samples of the motion that lie apart", field="count", value=count,
                         remedy=f"give at most {apart}, or plan the motion with more samples")  # fmt: skip
    return samples.tolist()
