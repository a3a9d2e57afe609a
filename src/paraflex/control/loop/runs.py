"""Runs under controllers, along a plan or without a path."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from paraflex.arguments import named_in_errors
from paraflex.arrays import Array
from paraflex.control.loop.loop_check import unstable_loop
from paraflex.control.loop.run_loop import ControllerRecord
from paraflex.findings import Finding
from paraflex.motion import MotionRun
from paraflex.tracking import TrackingRun


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


@named_in_errors("a run under controllers", "the run that Simulation.run returns")
@dataclass(frozen=True)
class ControlledTracking(Controlled, TrackingRun):
    """Run of a plan under torques that were set at discrete instants."""

    @property
    def follows(self) -> bool:
        """Whether torques drive the mechanism along the path."""
        return True

    @cached_property
    def findings(self) -> tuple[Finding, ...]:
        """Findings on controllers, on events in the run, and on results that are implausible for the mechanism."""
        return (
            *unstable_loop(self, self.controllers, self.task.start.time, f"mode {self.mode.name}"),
            *super().findings,
        )


@named_in_errors("a run under controllers", "the run that Simulation.run returns")
@dataclass(frozen=True)
class ControlledMotion(Controlled, MotionRun):
    """Run without a path under torques that were set at discrete instants."""

    open_loop: ClassVar[bool] = False

    @property
    def in_time(self) -> bool:
        """Whether torques change in time."""
        return True

    @cached_property
    def findings(self) -> tuple[Finding, ...]:
        """Findings on controllers, on events in the run, and on implausible results."""
        return (*unstable_loop(self, self.controllers, float(self.solution.t[0]), ""), *super().findings)


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
        self._lags, self._start = lags, start
        self._times: list[float] = []
        # Commanded torques, and torques that acted at the time of each command.
        self._commanded: list[Array] = [before]
        self._begun: list[Array] = [before]

    def __len__(self) -> int:
        """Return the number of commands."""
        return len(self._times)

    def note(self, t: float, torques: Array) -> None:
        """Add torques (motors,) that are commanded from a time on."""
        acting = self.now(t)
        self._times.append(t)
        self._commanded.append(torques)
        self._begun.append(acting)

    @property
    def last(self) -> tuple[float, Array, Array]:
        """Time of the last command, torques that acted then, and torques commanded from then on (motors,)."""
        return self._times[-1] if self._times else 0.0, self._begun[-1], self._commanded[-1]

    def copy(self) -> TorqueLog:
        """Return a copy that can be continued independently."""
        other = TorqueLog(self._lags, self._start, self._commanded[0])
        other._times, other._commanded, other._begun = self._times.copy(), self._commanded.copy(), self._begun.copy()
        return other

    def now(self, t: float) -> Array:
        """Return the torques (motors,) that act at a time after the last command."""
        since, begun, commanded = self.last
        return self._relaxed(np.array([t - since]), begun[None], commanded[None])[0]

    def at(self, times: Array, slack: float) -> Array:
        """Return the torques (k, motors) that act at times (k,), those before a change within a slack [s]."""
        number = self._number(times, slack)
        since = np.array([0.0, *self._times])[number]
        return self._relaxed(times - since, np.array(self._begun)[number], np.array(self._commanded)[number])

    def given(self, times: Array, slack: float) -> Array:
        """Return the torques (k, motors) that are commanded at times (k,), those before a change within a slack [s]."""
        return np.array(self._commanded)[self._number(times, slack)]

    def _number(self, times: Array, slack: float) -> NDArray[np.int64]:
        """Return the indices of the commands that hold at times (k,); the first one holds at the start."""
        changes = np.array(self._times)
        number = np.searchsorted(changes, times - slack, side="left")
        if changes.size and changes[0] <= self._start + slack:
            number = np.where(times <= changes[0] + slack, 1, number)
        return number

    def _relaxed(self, since: Array, begun: Array, commanded: Array) -> Array:
        """Return the torques (k, motors) at times (k,) after their commands."""
        if not np.any(self._lags):
            return commanded
        lags = np.where(self._lags > 0.0, self._lags, 1.0)
        left = np.exp(-np.maximum(since, 0.0)[:, None] / lags)
        return commanded + np.where(self._lags > 0.0, left, 0.0) * (begun - commanded)
