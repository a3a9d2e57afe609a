"""Size of a system: number of its flexible coordinates, and of the states of its motion."""

from __future__ import annotations

from typing import NamedTuple

from paraflex.dynamics import State, System
from paraflex.dynamics.rank import dependence


class Size(NamedTuple):
    """Number of flexible coordinates of a system, and of states of its motion at a pose."""

    flexible_coordinates: int
    states: int


def size_of(system: System, state: State) -> Size:
    """Return the size of a system at a state; the states are twice the degrees of freedom."""
    return Size(system.n_flexible, 2 * (system.n - dependence(system, state.q).rank))
