"""Runs under controllers: those of a plan, and those of a mechanism without a path."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from paraflex.arguments import given_as
from paraflex.arrays import Array
from paraflex.control.loop import ControllerRecord
from paraflex.control.loop_check import unstable_loop
from paraflex.findings import Finding
from paraflex.motion import MotionRun
from paraflex.tracking import TrackingRun


@dataclass(frozen=True)
class Controlled:
    """What runs under torques have that were given from one instant to the next.

    Attributes
    ----------
    acting : (k, motors) array
        Torques of all motors at the samples reached, before they change where they do so just then [N m, N].
    commanded : (k, motors) array
        Those given, which act with the lag of actuators.
    controllers : tuple of ControllerRecord
        What each controller did; none where torques were given by `Simulation.step`.
    """

    acting: Array | None = None
    commanded: Array | None = None
    controllers: tuple[ControllerRecord, ...] = ()

    @property
    def applied(self) -> Array:
        """Torques (k, motors) at the samples reached [N m, N]."""
        assert self.acting is not None
        return self.acting


@given_as("a run under controllers", "the run that Simulation.run returns")
@dataclass(frozen=True)
class ControlledTracking(Controlled, TrackingRun):
    """A run of a plan under torques that were given from one instant to the next."""

    @property
    def follows(self) -> bool:
        """Whether torques drive it along the path."""
        return True

    @cached_property
    def doubts(self) -> tuple[Finding, ...]:
        """Findings on controllers, on events in the run, and on results that are implausible for the mechanism."""
        return (*unstable_loop(self, self.controllers, self.task.start.time, f"mode {self.mode.name}"), *super().doubts)


@given_as("a run under controllers", "the run that Simulation.run returns")
@dataclass(frozen=True)
class ControlledMotion(Controlled, MotionRun):
    """A run without a path under torques that were given from one instant to the next."""

    open_loop: ClassVar[bool] = False

    @property
    def in_time(self) -> bool:
        """Whether torques change in time."""
        return True

    @cached_property
    def doubts(self) -> tuple[Finding, ...]:
        """Findings on controllers, on events in the run, and on implausible results."""
        return (*unstable_loop(self, self.controllers, float(self.solution.t[0]), ""), *super().doubts)


class TorqueLog:
    """Torques of all motors as they were given, one after another.

    Parameters
    ----------
    lags : (motors,) array
        Time constants with which they follow what is given; zero where they do at once [s].
    start : float
        Of the run [s].
    before : (motors,) array
        Torques before anything is given.
    """

    def __init__(self, lags: Array, start: float, before: Array) -> None:
        self._lags, self._start = lags, start
        self._times: list[float] = []
        # Those given, and those that acted then.
        self._given: list[Array] = [before]
        self._begun: list[Array] = [before]

    def __len__(self) -> int:
        """How often something was given."""
        return len(self._times)

    def note(self, t: float, torques: Array) -> None:
        """Add torques (motors,) that are given from a time on."""
        acting = self.now(t)
        self._times.append(t)
        self._given.append(torques)
        self._begun.append(acting)

    @property
    def last(self) -> tuple[float, Array, Array]:
        """When torques changed last, those that acted then and those given from then on (motors,)."""
        return self._times[-1] if self._times else 0.0, self._begun[-1], self._given[-1]

    def copy(self) -> TorqueLog:
        """The same so far, to go on from apart."""
        other = TorqueLog(self._lags, self._start, self._given[0])
        other._times, other._given, other._begun = self._times.copy(), self._given.copy(), self._begun.copy()
        return other

    def now(self, t: float) -> Array:
        """Torques (motors,) that act at a time after the last change."""
        since, begun, given = self.last
        return self._relaxed(np.array([t - since]), begun[None], given[None])[0]

    def at(self, times: Array, slack: float) -> Array:
        """Torques (k, motors) that act at times (k,), those before a change within a slack [s]."""
        number = self._number(times, slack)
        since = np.array([0.0, *self._times])[number]
        return self._relaxed(times - since, np.array(self._begun)[number], np.array(self._given)[number])

    def given(self, times: Array, slack: float) -> Array:
        """Torques (k, motors) that are given at times (k,), those before a change within a slack [s]."""
        return np.array(self._given)[self._number(times, slack)]

    def _number(self, times: Array, slack: float) -> NDArray[np.int64]:
        """Of the torques given at times (k,); the first at the start."""
        changes = np.array(self._times)
        number = np.searchsorted(changes, times - slack, side="left")
        if changes.size and changes[0] <= self._start + slack:
            number = np.where(times <= changes[0] + slack, 1, number)
        return number

    def _relaxed(self, since: Array, begun: Array, given: Array) -> Array:
        """Torques (k, motors) at times (k,) after changes."""
        if not np.any(self._lags):
            return given
        lags = np.where(self._lags > 0.0, self._lags, 1.0)
        left = np.exp(-np.maximum(since, 0.0)[:, None] / lags)
        return given + np.where(self._lags > 0.0, left, 0.0) * (begun - given)
