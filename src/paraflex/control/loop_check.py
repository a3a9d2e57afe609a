"""Whether the loop of a run's controllers is stable about its start."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from paraflex.control.closed_loops import closed_loop, unstable_poles
from paraflex.control.discrete import side_by_side
from paraflex.control.together import same_period
from paraflex.errors import ParaflexError
from paraflex.findings import Finding
from paraflex.linear import linearise

if TYPE_CHECKING:
    from paraflex.control.loop import ControllerRecord
    from paraflex.motion import MotionRun
    from paraflex.tracking import TrackingRun

CODE = "loop-unstable"
# What grows by less in the whole run is not worth a word: motions that no motor holds drift.
_GROWS = 2.0


def unstable_loop(
    run: TrackingRun | MotionRun, records: Sequence[ControllerRecord], start: float, place: str
) -> tuple[Finding, ...]:
    """The finding that linear controllers of one period and delay make something grow, without limits.

    Parameters
    ----------
    run : TrackingRun or MotionRun
    records : sequence of ControllerRecord
    start : float
        Of the run [s].
    place : str
        Of the finding.
    """
    laws = [one.linear for one in records]
    linear = [law for law in laws if law is not None]
    first = records[0]
    together = all(same_period(one.period, first.period) and one.delay == first.delay for one in records)
    if len(linear) < len(laws) or not together:
        return ()
    try:
        model = linearise(run, at=start)
        loop = closed_loop(model, side_by_side(linear), period=first.period, delay=first.delay)
    except ParaflexError:
        # There is no linear model: at a singular pose, say.
        return ()
    if loop.spectral_radius ** len(first.t) < _GROWS:
        return ()
    several = ", ".join(f'"{one.name}"' for one in records)
    text = f"the sampled loop is unstable about the start: {unstable_poles(loop)}"
    remedy = "lower the gains, sample sooner or delay less; give links damping and motors the inertia of their rotors"
    return (Finding(CODE, place, f"controller {several}: {text}", remedy),)
