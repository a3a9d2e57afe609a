"""The degrees of freedom that sets of motors drive at a pose."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from paraflex.arrays import Array
from paraflex.dynamics.joint_coordinates import joint_coordinate
from paraflex.dynamics.sparse import Saddle, sparse_jacobian, sparse_mass
from paraflex.dynamics.state import State
from paraflex.dynamics.system import System

# Smallest part of the largest effect that motors must have in every direction, squared: that of `actuation.allocation`.
_WEAK = 1e-12
_SETS_TRIED, _SETS_KEPT = 20_000, 1000


@dataclass(frozen=True)
class Reach:
    """Degrees of freedom that motors drive at a pose.

    Attributes
    ----------
    freedoms : int
        Of the mechanism at the pose.
    all_motors : int
        Freedoms that all motors together reach.
    modes : mapping of str to int
        The same for each mode of the mechanism.
    sets : tuple of tuple of str
        Sets of motors of which none can be left out, and which reach every freedom; none where no set does.
    more : bool
        Whether there are others: they were not all looked for.
    """

    freedoms: int
    all_motors: int
    modes: Mapping[str, int]
    sets: tuple[tuple[str, ...], ...]
    more: bool


def reach(system: System, state: State, freedoms: int) -> Reach:
    """Degrees of freedom that motors drive at a pose, and the smallest sets of motors that drive all of them.

    With S the columns of the motors' joint coordinates and Z a basis of the motions that constraints allow, motors
    reach as many as the rank of B = Z^T S; it is that of S^T Z (Z^T M Z)^-1 Z^T S, accelerations per torque, which asks
    for no basis.
    """
    mechanism = system.mechanism
    motors = [motor.name for motor in mechanism.motors]
    rows = [joint_coordinate(system, motor.joint, state.q[None]).rows[0] for motor in mechanism.motors]
    S = np.array(rows).reshape(-1, system.n)
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
    return Reach(freedoms, everything, modes, tuple(sets), more)


def _rank(effect: Array, chosen: Sequence[int]) -> int:
    """Number of independent directions in which the chosen motors act."""
    values = np.linalg.eigvalsh(effect[np.ix_(chosen, chosen)]) if len(chosen) else np.zeros(0)
    return int(np.sum(values > _WEAK * values.max(initial=0.0)))
