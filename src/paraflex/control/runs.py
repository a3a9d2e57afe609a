"""Runs under controllers: those of a plan, and those of a mechanism without a path."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from paraflex.arguments import given_as
from paraflex.arrays import Array
from paraflex.control.loop import ControllerRecord
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
    controllers : tuple of ControllerRecord
        What each controller did; none where torques were given by `Simulation.step`.
    """

    acting: Array | None = None
    controllers: tuple[ControllerRecord, ...] = ()

    @property
    def applied(self) -> Array:
        """Torques (k, motors) at the samples reached [N m, N]."""
        assert self.acting is not None
        return self.acting

    def _of_controllers(self, place: str) -> tuple[Finding, ...]:
        """What laws found doubtful as they started."""
        return tuple(replace(finding, place=place) for one in self.controllers for finding in one.findings)


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
        return (*self._of_controllers(f"mode {self.mode.name}"), *super().doubts)


@given_as("a run under controllers", "the run that Simulation.run returns")
@dataclass(frozen=True)
class ControlledMotion(Controlled, MotionRun):
    """A run without a path under torques that were given from one instant to the next."""

    @property
    def in_time(self) -> bool:
        """Whether torques change in time."""
        return True

    @cached_property
    def doubts(self) -> tuple[Finding, ...]:
        """Findings on controllers, on events in the run, and on implausible results."""
        return (*self._of_controllers(""), *super().doubts)


class TorqueLog:
    """Torques of all motors as they were given, one after another.

    Parameters
    ----------
    motors : int
    """

    def __init__(self, motors: int) -> None:
        self._times: list[float] = []
        self._torques: list[Array] = [np.zeros(motors)]

    @property
    def begun(self) -> bool:
        """Whether anything was given."""
        return bool(self._times)

    def note(self, t: float, torques: Array) -> None:
        """Add torques (motors,) that act from a time on."""
        self._times.append(t)
        self._torques.append(torques)

    def copy(self) -> TorqueLog:
        """The same so far, to go on from apart."""
        other = TorqueLog(0)
        other._times, other._torques = self._times.copy(), self._torques.copy()
        return other

    def at(self, times: Array, slack: float) -> Array:
        """Torques (k, motors) at times (k,), those before a change within a slack [s]; the first at the start."""
        changes = np.array(self._times)
        number = np.searchsorted(changes, times - slack, side="left")
        if changes.size:
            number = np.where(times <= changes[0] + slack, 1, number)
        return np.array(self._torques)[number]
