"""Runs under controllers, along a plan or without a path, and the check of their sampled loop for stability."""

from copy import copy
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from paraflex.arguments import named_in_errors
from paraflex.arrays import Array, Indices
from paraflex.control.laws.discrete import side_by_side
from paraflex.errors import ParaflexError
from paraflex.findings import Finding
from paraflex.motion import MotionRun
from paraflex.tracking import TrackingRun
from .run_loop import ControllerRecord
from .together import same_period, whole_and_part

# Growth below this factor over the whole run is not reported, as rigid motions that no motor controls drift anyway. A
# run counts as at least this many samples.
_GROWS, _SAMPLES = 2.0, 1000
# Up to this number of states, delayed torques included, the poles are computed as eigenvalues; above it, only counted.
_STATES = 500


@dataclass(frozen=True)
class Controlled:
    """Common part of runs under torques that were set at discrete instants.

    Attributes
    ----------
    acting : (k, motors) array
        Torques of all motors at the sample times reached, before a change at the same time [N m, N].
    commanded : (k, motors) array
        Commanded torques, which the acting torques follow with the lag of the actuators [N m, N].
    controllers : tuple of ControllerRecord
        Records of the controllers; empty where torques were set by `Simulation.step`.
    """

    acting: Array | None = None
    commanded: Array | None = None
    controllers: tuple[ControllerRecord, ...] = ()

    @property
    def applied(self) -> Array:
        """Torques (k, motors) at the sample times reached [N m, N]."""
        assert self.acting is not None
        return self.acting

    @cached_property
    def findings(self: Any) -> tuple[Finding, ...]:
        """Findings on controllers, on events in the run, and on results that are implausible for the mechanism."""
        return (*unstable_loop(self), *super().findings)  # pyright: ignore[reportAttributeAccessIssue]


@named_in_errors("a run under controllers", "the run that Simulation.run returns")
@dataclass(frozen=True)
class ControlledTracking(Controlled, TrackingRun):
    """Run of a plan under torques that were set at discrete instants."""

    @property
    def follows(self) -> bool:
        """Whether torques drive the mechanism along the path."""
        return True


@named_in_errors("a run under controllers", "the run that Simulation.run returns")
@dataclass(frozen=True)
class ControlledMotion(Controlled, MotionRun):
    """Run without a path under torques that were set at discrete instants."""

    open_loop: ClassVar[bool] = False

    @property
    def in_time(self) -> bool:
        """Whether torques change in time."""
        return True


class TorqueLog:
    """Log of the torques of all motors, as they were commanded one after another.

    Parameters
    ----------
    lags : (motors,) array
        Time constants with which torques follow their commands [s]; zero where they follow at once.
    start : float
        Start time of the run [s].
    before : (motors,) array
        Torques before the first command [N m, N].
    """

    def __init__(self, lags: Array, start: float, before: Array) -> None:
        self._lags, self._lagging, self._start = lags, bool(np.any(lags)), start
        # Time of each command, torques that acted then, and torques commanded; the first is before the start.
        self._commands: list[tuple[float, Array, Array]] = [(0.0, before, before)]

    def __len__(self) -> int:
        """Return the number of commands."""
        return len(self._commands) - 1

    def note(self, t: float, torques: Array) -> None:
        """Add torques (motors,) that are commanded from a time on."""
        self._commands.append((t, self.now(t), torques))

    @property
    def last(self) -> tuple[float, Array, Array]:
        """Time of the last command, torques that acted then, and torques commanded from then on (motors,)."""
        return self._commands[-1]

    def copy(self) -> "TorqueLog":
        """Return a copy that can be continued independently."""
        other = copy(self)
        other._commands = self._commands.copy()
        return other

    def now(self, t: float) -> Array:
        """Return the torques (motors,) that act at a time after the last command."""
        since, begun, commanded = self.last
        if not self._lagging:
            return commanded
        return self._relaxed(np.array([t - since]), begun[None], commanded[None])[0]

    def at(self, times: Array, slack: float) -> Array:
        """Return the torques (k, motors) that act at times (k,), those before a change within a slack [s]."""
        number = self._number(times, slack)
        since, begun, commanded = (np.array(each)[number] for each in zip(*self._commands, strict=True))
        return self._relaxed(times - since, begun, commanded)

    def given(self, times: Array, slack: float) -> Array:
        """Return the torques (k, motors) that are commanded at times (k,), those before a change within a slack [s]."""
        return np.array([torques for _, _, torques in self._commands])[self._number(times, slack)]

    def _number(self, times: Array, slack: float) -> Indices:
        """Return the indices of the commands that hold at times (k,); the first one holds at the start."""
        changes = np.array([t for t, _, _ in self._commands[1:]])
        number = np.searchsorted(changes, times - slack, side="left")
        if changes.size and changes[0] <= self._start + slack:
            number = np.where(times <= changes[0] + slack, 1, number)
        return number

    def _relaxed(self, since: Array, begun: Array, commanded: Array) -> Array:
        """Return the torques (k, motors) at times (k,) after their commands."""
        if not self._lagging:
            return commanded
        lags = np.where(self._lags > 0.0, self._lags, 1.0)
        left = np.exp(-np.maximum(since, 0.0)[:, None] / lags)
        return commanded + np.where(self._lags > 0.0, left, 0.0) * (begun - commanded)


def unstable_loop(run: ControlledTracking | ControlledMotion) -> tuple[Finding, ...]:
    """Return a finding if the run's linear controllers, of one period and delay, make the linearised loop unstable.

    Limits of torques and rates are disregarded. Without a linear model, at a singular configuration for example, the
    loop is not checked.
    """
    records = run.controllers
    if not records:
        return ()
    # Runs without controllers do not need them.
    from paraflex.control.design.closed_loops import closed_loop, poles_beyond, unstable_poles
    from paraflex.linear import linearise

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
        model = linearise(run)
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
    place = f"mode {run.mode.name}" if isinstance(run, TrackingRun) else ""
    return (Finding("loop-unstable", place, text, remedy),)
