"""Steps back onto the constraints: the least change of coordinates or rates, and what to say where there is none."""

from __future__ import annotations

import math

import numpy as np
import scipy
from numpy.typing import NDArray

from paraflex.dynamics.rank import DENSE_ROWS, Dependence, dependence, involved, joint_of_row
from paraflex.dynamics.sparse import Saddle, body_masses, elastic_stiffness, sparse_jacobian, sparse_mass
from paraflex.dynamics.system import System
from paraflex.errors import InconsistentConstraintsError, Moment

# Joints named in an error.
NAMED = 6
_UNITS = {"positions": "m or rad", "velocities": "m/s or rad/s", "accelerations": "m/s^2 or rad/s^2"}
# What helps where constraints contradict one another.
AGREE = "leave one of these joints or prescribed motions out, or choose places and laws that agree"
# What constraints may leave of each other's rates (sizes of the mechanism, rad; s), as a fraction of what they ask for.
_CONFLICT = 1e-6


def least_change(
    system: System,
    q: NDArray[np.float64],
    residual: NDArray[np.float64],
    stiffness: float = 0.0,
    damping: float = 0.0,
    *,
    every_spring: bool = False,
) -> NDArray[np.float64]:
    """The smallest d in the metric M + stiffness K with Phi_q d = residual; least squares for dependent rows.

    K keeps links in shape; with every spring also those at joints.

    With damping it goes less far, as Levenberg and Marquardt have it: a fraction of the mean diagonal entry of
    Phi_q (M + stiffness K)^-1 Phi_q^T.
    """
    if system.m > DENSE_ROWS:
        return _sparse_change(system, q, residual, stiffness, damping, every_spring)
    jacobian = system.jacobian(q)
    metric = np.asarray(scipy.linalg.block_diag(*body_masses(system, q)))
    if stiffness:
        metric = metric + stiffness * elastic_stiffness(system, q, every_spring=every_spring).toarray()
    weighted = np.linalg.solve(metric, jacobian.T)
    # Without dimension: rows of angles and of lengths would differ by the square of the mechanism's size.
    units = system.row_units
    schur = (jacobian @ weighted) / np.outer(units, units)
    if damping:
        schur += damping * np.mean(np.diag(schur)) * np.eye(system.m)
    return weighted @ (np.linalg.lstsq(schur, residual / units, rcond=1e-12)[0] / units)


def _sparse_change(
    system: System,
    q: NDArray[np.float64],
    residual: NDArray[np.float64],
    stiffness: float,
    damping: float,
    every_spring: bool,
) -> NDArray[np.float64]:
    jacobian = sparse_jacobian(system, q)
    metric = sparse_mass(system, q)
    if stiffness:
        metric = scipy.sparse.csr_matrix(metric + stiffness * elastic_stiffness(system, q, every_spring=every_spring))
    jacobian = scipy.sparse.csr_matrix(scipy.sparse.diags(1.0 / system.row_units) @ jacobian)
    mean = float(np.mean(jacobian.multiply(jacobian) @ (1.0 / np.asarray(metric.diagonal(), dtype=float))))
    return Saddle(metric, jacobian, np.full(system.m, damping * mean)).solve(r=residual / system.row_units)[0]


def joint_gaps(system: System, phi: NDArray[np.float64]) -> dict[str, float]:
    """What is left open at joints and prescribed motions by name [m, rad]: the largest first, down to a tenth of it."""
    gaps: dict[str, float] = {}
    for row, value in zip(system.rows, phi.tolist(), strict=True):
        gaps[joint_of_row(row)] = math.hypot(gaps.get(joint_of_row(row), 0.0), value)
    largest = max(gaps.values(), default=0.0)
    return {name: gap for name, gap in sorted(gaps.items(), key=lambda item: -item[1]) if gap >= 0.1 * largest}


def gap_unit(system: System, phi: NDArray[np.float64]) -> str:
    """The unit of the largest number among constraint rows (m,)."""
    return "rad" if system.rows[int(np.argmax(np.abs(phi)))].endswith(" angle") else "m"


def refuse_conflict(
    system: System, what: str, t: float, q: NDArray[np.float64], wanted: NDArray[np.float64], left: NDArray[np.float64]
) -> None:
    """Raise where a projection leaves more of what the rows want (m,) than rounding explains.

    Raises
    ------
    InconsistentConstraintsError
        It names joints and prescribed motions that depend on one another.
    """
    if not system.gap(left) > _CONFLICT * max(1.0, system.gap(wanted)):
        return
    cause = contradiction(system, wanted, dependence(system, q), what)
    raise InconsistentConstraintsError(cause, Moment(t, 0), remedy=AGREE)


def contradiction(system: System, wanted: NDArray[np.float64], found: Dependence, what: str) -> str:
    """Who contradicts whom, and by how much: the dropped row furthest from what its sources have it want."""
    if found.dropped.size:
        conflict = np.abs(found.conflict(wanted))
        k = int(np.argmax(conflict))
        names, size = involved(system, found, k), float(conflict[k])
    else:
        gaps = joint_gaps(system, wanted)
        names, size = list(gaps), max(gaps.values())
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    return (
        f"the {what} of constraints contradict one another, by {size:.3g} {_UNITS[what]}: "
        f"{', '.join(names[:NAMED])}{more},"
    )
