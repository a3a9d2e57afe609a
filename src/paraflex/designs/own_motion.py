"""Runs of a model without a path: the mechanism moves under loads, prescribed motions and given torques."""

from collections.abc import Sequence
from typing import Any

from paraflex.control import ControllerDescription, simulate_controlled_motion
from paraflex.errors import InputError
from paraflex.files import StudyDefaults
from paraflex.mechanism import Mechanism
from paraflex.motion import MotionRun, simulate_motion


def own_run(
    mechanism: Mechanism,
    study: StudyDefaults,
    controllers: Sequence[ControllerDescription],
    *,
    warning: bool = False,
    **how: Any,
) -> MotionRun:
    """Run a mechanism as a study sets it, under controllers or else under the study's torques.

    Parameters
    ----------
    mechanism : Mechanism
        Mechanism to simulate.
    study : StudyDefaults
        Study with duration, samples and torques.
    controllers : sequence of ControllerDescription
        Sampled controllers, which replace the torques; may be empty.
    warning : bool
        Whether a doubtful run under the study's torques issues warnings.
    **how
        Start, options and progress callback; see `simulate_motion`.
    """
    duration = own_duration(study)
    if controllers:
        return simulate_controlled_motion(mechanism, duration, controllers, samples=study.samples, **how)
    return simulate_motion(mechanism, duration, samples=study.samples, torques=study.torques, warning=warning, **how)


def own_duration(study: StudyDefaults) -> float:
    """Return the duration of a run without a path [s].

    Raises
    ------
    InputError
        The study has none.
    """
    if study.duration is None:
        raise InputError("the model has no path, and no duration is given", field="duration", remedy="give it in s")
    return study.duration
