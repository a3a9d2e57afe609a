"""Runs that begin at a singular position where branches meet, on the branch of their velocities.

At such a position constraint rows depend on others, though not beside it, and the forces do not determine the
accelerations along the direction that opens: the branch determines them. With w Phi_q = 0 and Phi = 0 along q + v t + a
t^2 / 2 + j t^3 / 6, the terms of third order, w (Phi''' + 3 Phi'' a) with Phi'' and Phi''' along v, are zero for any
jerk j.
"""

from functools import partial
from math import sqrt
from typing import NamedTuple

import numpy as np
import scipy

from paraflex.arrays import Array
from paraflex.dynamics import dependence, moment_signals
from paraflex.dynamics.projection import assemble, closed, constraint_change, link_metric, project
from paraflex.dynamics.system import DENSE_ROWS
from paraflex.kernel import indices as at
from paraflex.kernel.linear import factor_system
from paraflex.kernel.packed import Workspace
from paraflex.kernel.run_state import March
from .run import Problem

# Distance from the start at which the motion is examined [rad, sizes of the mechanism].
_BESIDE = 1e-2


class BranchPose(NamedTuple):
    """Pose beside a singular start: coordinates (n,), and the time from the start to it [s]."""

    q: Array
    later: float


def pose_on_branch(problem: Problem) -> BranchPose | None:
    """Find a pose on the branch with fewer dependent rows than the start; None if the start is not singular."""
    system, start = problem.system, problem.initial
    pace = float(np.max(np.abs(start.v / system.units), initial=0.0))
    if not 0 < system.m <= DENSE_ROWS or pace == 0.0 or not (dropped := dependence(system, start.q).dropped.size):
        return None
    later = min(_BESIDE / pace, 0.25 * problem.span)
    t, change_at = start.time + later, partial(constraint_change, system)
    q, phi = assemble(system, moment_signals(system.mechanism, t), t, start.q + later * start.v, change_at)
    if closed(system, q, phi) and dependence(system, q).dropped.size < dropped:
        return BranchPose(q, later)
    return None


def begin_on_branch(problem: Problem, branch: BranchPose, march: March, aside: Workspace) -> None:
    """Set the accelerations of the branch after the first stage of a run, and mark the singular position as near."""
    a = march.stage_a[1, 0]
    a += _missing(problem, branch.later, a)
    march.algorithmic[0] = a
    factor_system(problem.system.packed, 0.0, branch.q, aside)
    march.clock[at.ROOT], march.clock[at.ROOT_RATE] = 0.0, sqrt(max(aside.least[0], 0.0)) / branch.later
    march.clock[at.WIDEST] = 1.0
    march.counts[at.ROOT_STEP], march.counts[at.PREPARED] = 0, 1


def _missing(problem: Problem, later: float, a: Array) -> Array:
    """Return the accelerations (n,) of the branch less those that follow from forces, by differences in time."""
    system, t, q, v = problem.system, problem.initial.time, problem.initial.q, problem.initial.v
    J, moved = system.jacobian(q), later * v
    W = dependence(system, q).conflict(np.eye(system.m)).reshape(-1, system.m)
    opening = W @ (system.jacobian(q + moved) - system.jacobian(q - moved)) / (2.0 * later)
    change, left = constraint_change(system, q), partial(np.matmul, J)
    pushed = scipy.sparse.linalg.splu(link_metric(system, q, 0.0).tocsc()).solve(opening.T)
    along = np.column_stack([project(change, each, left) for each in pushed.T])
    # Inputs may begin with the run: evaluate them from its start on, and extrapolate to the start.
    once, twice = (
        system.constraints(moment_signals(system.mechanism, t + h), t + h, q + h * v + 0.5 * h * h * a)[0]
        / (h**3 / 6.0)
        for h in (later, 2.0 * later)
    )
    missing = W @ (2.0 * once - twice)
    return -along @ scipy.linalg.lstsq(3.0 * opening @ along, missing, cond=1e-10)[0]
