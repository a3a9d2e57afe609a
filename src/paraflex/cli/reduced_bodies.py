"""Runs with few flexible coordinates: the requested number, and the reduced mechanism."""

from __future__ import annotations

from collections.abc import Sequence

from paraflex.cli.commands.runs import RunRequest
from paraflex.errors import InputError
from paraflex.files import StudyDefaults
from paraflex.mechanism import ActuationMode, Mechanism
from paraflex.motion import MotionRun
from paraflex.reduced_bodies import reduced_mechanism
from paraflex.tracking import TrackingTask


def kept_coordinates(request: RunRequest, study: StudyDefaults) -> int | None:
    """Return the number of flexible coordinates that a run keeps, as requested or set in the study; None for all."""
    if request.rigid or request.ked or request.segments is not None:
        return None
    return (study.reduced if request.reduced is None else request.reduced) or None


def reduced_as_requested(
    request: RunRequest, along: TrackingTask | MotionRun, count: int, modes: Sequence[ActuationMode] | None = None
) -> Mechanism:
    """Return the mechanism reduced to `count` coordinates along a plan or a run; errors name the option or field."""
    try:
        return reduced_mechanism(along, count, modes=modes)
    except InputError as error:
        if error.field not in ("coordinates", "mechanism"):
            raise
        raise error.at("study.reduced" if request.reduced is None else "--reduced") from None
