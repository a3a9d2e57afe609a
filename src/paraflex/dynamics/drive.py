"""Degrees of freedom that sets of motors drive at a pose."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from paraflex.arrays import Array
from .joint_coordinates import joint_rows
from .sparse import Saddle, sparse_jacobian, sparse_mass
from .state import State
from .system import System

# Smallest effect of motors in any direction, squared, as a fraction of the largest: as in `actuation.allocation`.
_WEAK = 1e-12
_SETS_TRIED, _SETS_KEPT = 20_000, 1000


@dataclass(frozen=True)
class DrivenFreedoms:
    """Degrees of freedom that motors drive at a pose.

    Attributes
    ----------
    freedoms : int
        Degrees of freedom of the mechanism at the pose.
    all_motors : int
        Number of them driven by all motors together.
    modes : mapping of str to int
        Number of them driven in each mode of the mechanism.
    sets : tuple of tuple of str
        Minimal sets of motors that drive every degree of freedom; empty if no set does.
    more : bool
        Whether the search was stopped at its limit, so that further sets may exist.
    """

    freedoms: int
    all_motors: int
    modes: Mapping[str, int]
    sets: tuple[tuple[str, ...], ...]
    more: bool


def driven_freedoms(system: System, state: State, freedoms: int) -> DrivenFreedoms:
    """Return the degrees of freedom driven by motors at a pose, and the smallest sets of motors that drive all.

    With S the columns of the motors' joint coordinates and Z a basis of the admissible motions, motors drive as many as
    the rank of B = Z^T S. This is the rank of S^T Z (Z^T M Z)^-1 Z^T S, accelerations per torque, which needs no basis.

    Parameters
    ----------
    system : System
        System of the mechanism.
    state : State
        State whose pose is examined.
    freedoms : int
        Degrees of freedom of the mechanism at the pose.
    """
    mechanism = system.mechanism
    motors = [motor.name for motor in mechanism.motors]
    S = joint_rows(system, [motor.joint for motor in mechanism.motors], state.q)
    solver = Saddle(sparse_mass(system, state.q), sparse_jacobian(system, state.q))
    effect = S @ np.array([solver.solve(column)[0] for column in S]).reshape(-1, system.n).T
    modes = {mode.name: _rank(effect, [motors.index(name) for name in mode.motors]) for mode in mechanism.modes}
    everything = _rank(effect, range(len(motors)))
    sets, more = [], False
    if everything == freedoms > 0:
        for tried, chosen in enumerate(combinations(range(len(motors)), freedoms)):
            if tried == _SETS_TRIED or len(sets) == _SETS_KEPT:
                more = True
                break
            if _rank(effect, chosen) == freedoms:
                sets.append(tuple(motors[k] for k in chosen))
    return DrivenFreedoms(freedoms, everything, modes, tuple(sets), more)


def _rank(effect: Array, chosen: Sequence[int]) -> int:
    """Return the number of independent directions in which the chosen motors act."""
    values = np.linalg.eigvalsh(effect[np.ix_(chosen, chosen)]) if len(chosen) else np.zeros(0)
    return int(np.sum(values > _WEAK * values.max(initial=0.0)))
