"""The interface of an external solver: take one step at a time, stop at a time, interpolate within the step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np

from paraflex.arrays import Array
from paraflex.integrators.forms import OdeForm

# Times within a step that differ by less than this fraction of it are one.
_SAME = 1e-9


class SolverCounts(NamedTuple):
    """Counts of the steps, as far as the solver reports them."""

    evaluations: int
    rejected: int
    iterations: int
    factorisations: int

    def __add__(self, other: SolverCounts) -> SolverCounts:  # type: ignore[override]
        """Sum of both."""
        return SolverCounts(*(a + b for a, b in zip(self, other, strict=True)))


class Steps(NamedTuple):
    """Limits of a solver's steps: the first and the longest [s], the highest order of a multistep method."""

    first: float
    longest: float
    order: int


class Stepper(Protocol):
    """A solver between steps."""

    form: OdeForm

    def begin(self, t: float, y: Array, stop: float) -> None:
        """Start again from y at t towards a stop."""
        ...

    def step(self, stop: float) -> int:
        """Take one step, to the stop or before it: PAUSED, or the reason of a failure."""
        ...

    @property
    def t(self) -> float:
        """The present time [s]."""
        ...

    @property
    def y(self) -> Array:
        """The solution at the present time."""
        ...

    def at(self, time: float) -> Array:
        """The solution within the last step, by the solver's own interpolation."""
        ...

    def counts(self) -> SolverCounts:
        """Counts since the run began."""
        ...


def attempts(times: Sequence[float], start: float, places: int) -> int:
    """Number of steps attempted from the start, by the times at which equations were evaluated.

    Parameters
    ----------
    times : sequence of float
        Every attempt that is cut has others [s].
    start : float
        Where they began [s]; evaluations there do not count.
    places : int
        Different times of one attempt.
    """
    later = np.array(times) - start
    later = later[later > 0.0]
    if later.size == 0:
        return 0
    distinct = np.unique(np.round(later / later.min() / _SAME) * _SAME).size
    return -(-distinct // places)
