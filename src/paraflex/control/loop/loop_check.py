"""Check of the sampled loop of a run's controllers for stability, linearised about the start of the run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from paraflex.control.design.closed_loops import closed_loop, poles_beyond, unstable_poles
from paraflex.control.laws.discrete import side_by_side
from paraflex.control.loop.together import same_period, whole_and_part
from paraflex.errors import ParaflexError
from paraflex.findings import Finding
from paraflex.linear import linearise

if TYPE_CHECKING:
    from paraflex.control.loop.run_loop import ControllerRecord
    from paraflex.motion import MotionRun
    from paraflex.tracking import TrackingRun

# Growth below this factor over the whole run is not reported, as rigid motions that no motor controls drift anyway. A
# run counts as at least this many samples.
_GROWS, _SAMPLES = 2.0, 1000
# Up to this number of states, delayed torques included, the poles are computed as eigenvalues; above it, only counted.
_STATES = 500


def unstable_loop(
    run: TrackingRun | MotionRun, records: Sequence[ControllerRecord], start: float, place: str
) -> tuple[Finding, ...]:
    """Return a finding if the run's linear controllers, of one period and delay, make the linearised loop unstable.

    Limits of torques and rates are disregarded. Without a linear model, at a singular configuration for example, the
    loop is not checked.

    Parameters
    ----------
    run : TrackingRun or MotionRun
        Run under the controllers.
    records : sequence of ControllerRecord
        Records of all controllers of the run.
    start : float
        Time at which the run starts, about which it is linearised [s].
    place : str
        Place to which the finding refers, such as "mode ++".
    """
    if not records:
        return ()
    laws = [one.linear for one in records]
    linear = [law for law in laws if law is not None]
    first = records[0]
    together = all(same_period(one.period, first.period) and one.delay == first.delay for one in records)
    later, part = whole_and_part(first.delay / first.period)
    # Torques delayed beyond the end of the run never act.
    if len(linear) < len(laws) or not together or later >= len(first.t):
        return ()
    radius = _GROWS ** (1.0 / max(len(first.t), _SAMPLES))
    try:
        model = linearise(run, at=start)
        now = closed_loop(model, side_by_side(linear), period=first.period, delay=part * first.period)
        if len(now.A) + later * len(now.plant.inputs) > _STATES:
            growing = f"{count} with |z| > {radius:.8g}" if (count := poles_beyond(now, later, radius)) else ""
        else:
            loop = now.later(first.delay)
            growing = unstable_poles(loop) if loop.spectral_radius >= radius else ""
    except ParaflexError:
        # There is no linear model, for example at a singular configuration.
        return ()
    if not growing:
        return ()
    several = ", ".join(f'"{one.name}"' for one in records)
    text = f"controller {several}: the sampled loop is unstable about the start: {growing}"
    remedy = "lower the gains, sample faster, reduce the delay; add link damping, rotor inertia, or noise in designs"
    return (Finding("loop-unstable", place, text, remedy),)
