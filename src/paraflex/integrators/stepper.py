"""Interface of an external solver: take one step at a time, stop at a time, interpolate within the step."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from paraflex.arrays import Array
from .forms import OdeForm

# Times that differ by less than this fraction of the step count as equal.
_SAME_TIME = 1e-9


class SolverCounts(NamedTuple):
    """Counts of evaluations, rejected steps, iterations and factorisations, as far as the solver reports them."""

    evaluations: int
    rejected: int
    iterations: int
    factorisations: int

    def __add__(self, other: SolverCounts) -> SolverCounts:  # type: ignore[override]
        """Return the sum of both counts."""
        return SolverCounts(*(a + b for a, b in zip(self, other, strict=True)))


class Steps(NamedTuple):
    """Limits of a solver's steps: the first and the largest step size [s], the highest order of a multistep method."""

    first: float
    longest: float
    order: int


class Stepper(ABC):
    """Solver between steps.

    Attributes
    ----------
    form : OdeForm
        Equations that it solves.
    t : float
        Current time [s].
    y : array
        Solution at the current time.
    """

    def __init__(self, form: OdeForm, tolerances: Array, steps: Steps) -> None:
        self.form: OdeForm = form
        self._tolerances, self._steps = tolerances, steps
        self.t: float = 0.0
        self.y: Array = np.zeros(0)
        # Times of evaluations in the current step.
        self._seen: list[float] = []

    @abstractmethod
    def begin(self, t: float, y: Array, stop: float) -> None:
        """Restart from y at t towards a stop."""

    @abstractmethod
    def step(self, stop: float) -> int:
        """Take one step, to the stop or before it; return PAUSED or the cause of a failure."""

    @abstractmethod
    def at(self, time: float) -> Array:
        """Return the solution within the last step, by the solver's own interpolation."""

    @abstractmethod
    def counts(self) -> SolverCounts:
        """Return the counts since the run began."""


def attempts(times: Sequence[float], start: float, places: int) -> int:
    """Return the number of attempted steps from the times at which equations were evaluated.

    Parameters
    ----------
    times : sequence of float
        Times of the evaluations [s]; attempts with different step sizes have different times.
    start : float
        Start of the attempts [s]; evaluations there do not count.
    places : int
        Number of different times in one attempt.
    """
    later = np.array(times) - start
    later = later[later > 0.0]
    if later.size == 0:
        return 0
    distinct = np.unique(np.round(later / later.min() / _SAME_TIME) * _SAME_TIME).size
    return -(-distinct // places)
