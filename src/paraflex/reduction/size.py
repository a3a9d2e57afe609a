"""Size of a system: its flexible coordinates, and the states of its motion."""

from __future__ import annotations

from typing import NamedTuple

from paraflex.dynamics import State, System
from paraflex.dynamics.rank import dependence


class Size(NamedTuple):
    """How many flexible coordinates a system has, and how many states its motion at a pose."""

    flexible_coordinates: int
    states: int


def size_of(system: System, state: State) -> Size:
    """Size of a system at a state: twice the coordinates that its constraints leave free, and its flexible ones."""
    return Size(system.n_flexible, 2 * (system.n - dependence(system, state.q).rank))
