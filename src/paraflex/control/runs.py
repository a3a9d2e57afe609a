"""Runs under controllers: those of a plan, and those of a mechanism without a path."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from paraflex.arguments import given_as
from paraflex.arrays import Array
from paraflex.control.loop import ControllerRecord
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


@given_as("a run under controllers", "the run that Simulation.run returns")
@dataclass(frozen=True)
class ControlledTracking(Controlled, TrackingRun):
    """A run of a plan under torques that were given from one instant to the next."""

    @property
    def follows(self) -> bool:
        """Whether torques drive it along the path."""
        return True


@given_as("a run under controllers", "the run that Simulation.run returns")
@dataclass(frozen=True)
class ControlledMotion(Controlled, MotionRun):
    """A run without a path under torques that were given from one instant to the next."""

    @property
    def in_time(self) -> bool:
        """Whether torques change in time."""
        return True


class TorqueLog:
    """Torques of all motors as they were given, one after another.

    Parameters
    ----------
    motors : int
    start : float
        Of the run [s].
    """

    def __init__(self, motors: int, start: float) -> None:
        self._start = start
        self._times: list[float] = []
        self._torques: list[Array] = [np.zeros(motors)]

    @property
    def begun(self) -> bool:
        """Whether anything was given."""
        return bool(self._times)

    def __len__(self) -> int:
        """How often something was given."""
        return len(self._times)

    def note(self, t: float, torques: Array) -> None:
        """Add torques (motors,) that act from a time on."""
        self._times.append(t)
        self._torques.append(torques)

    def copy(self) -> TorqueLog:
        """The same so far, to go on from apart."""
        other = TorqueLog(0, self._start)
        other._times, other._torques = self._times.copy(), self._torques.copy()
        return other

    def at(self, times: Array, slack: float) -> Array:
        """Torques (k, motors) at times (k,), those before a change within a slack [s]; the first at the start."""
        changes = np.array(self._times)
        number = np.searchsorted(changes, times - slack, side="left")
        if changes.size and changes[0] <= self._start + slack:
            number = np.where(times <= changes[0] + slack, 1, number)
        return np.array(self._torques)[number]
