"""What a solver of others must do for a run: take one step at a time, stop where asked to, look back into the step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np

from paraflex.arrays import Array
from paraflex.integrators.forms import OdeForm

# Times within a step that differ by less than this fraction of it are one.
_SAME = 1e-9


class SolverCounts(NamedTuple):
    """What steps took, as far as the solver tells or shows."""

    evaluations: int
    rejected: int
    iterations: int
    factorisations: int

    def __add__(self, other: SolverCounts) -> SolverCounts:  # type: ignore[override]
        """Of both."""
        return SolverCounts(*(a + b for a, b in zip(self, other, strict=True)))


class Steps(NamedTuple):
    """What steps a solver may take: the first and the longest [s], the highest order of a multistep method."""

    first: float
    longest: float
    order: int


class Stepper(Protocol):
    """A solver between steps."""

    form: OdeForm

    def begin(self, t: float, y: Array, stop: float) -> None:
        """Forget what was, and start from y at t towards a stop."""
        ...

    def step(self, stop: float) -> int:
        """Take one step, to the stop or before it: PAUSED, or why there is none."""
        ...

    @property
    def t(self) -> float:
        """Where it stands [s]."""
        ...

    @property
    def y(self) -> Array:
        """The solution there."""
        ...

    def at(self, time: float) -> Array:
        """The solution within the last step, by the solver's own interpolation."""
        ...

    def counts(self) -> SolverCounts:
        """Since the run began."""
        ...


def attempts(times: Sequence[float], start: float, places: int) -> int:
    """How many steps were tried from the start, by the times at which equations were evaluated.

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
