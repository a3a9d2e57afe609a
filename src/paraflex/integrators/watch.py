"""Checks of a run between slices of the time loop, and multipliers of dependent rows at its end."""

from typing import NamedTuple

import numpy as np

from paraflex.arrays import Array
from paraflex.dynamics import System, dependence
from paraflex.dynamics.projection import AGREE, contradiction, gap_texts
from paraflex.dynamics.rank import constraint_jacobian
from paraflex.kernel.packed import Signals
from .methods import Treatment

# Largest slope [rad]: beyond it no theory of small slopes is valid, and the run diverges.
_LARGEST_SLOPE = 2.0
# Gaps of joints above this part of the mechanism's size, or deviations of motions [rad], end a run. Dependent
# constraints are contradictory at much smaller gaps.
_GAPS, _CONTRADICTION = 7e-3, 7e-4
# Multipliers whose forces differ by less than this fraction are equivalent.
_SAME_FORCES = 1e-9


class Breakdown(NamedTuple):
    """Reason why a run cannot continue, and the remedy."""

    cause: str
    remedy: str


def excessive_bending(system: System, q: Array) -> Breakdown | None:
    """Return a breakdown with the beam whose slope exceeds the validity of the theory, and its slope, or None."""
    if not np.max(np.abs(system.slope_rows @ q), initial=0.0) > _LARGEST_SLOPE:
        return None
    for body in system.bodies:
        slope = float(np.max(np.abs(body.slopes(q)), initial=0.0))
        if slope > _LARGEST_SLOPE:
            return Breakdown(
                f"{body.name} bends to a slope of {slope:.1f} rad, beyond theories of small slopes: the motion "
                "diverges",
                f"look at Young's modulus (Pa), section and length (m) of {body.name}, and at its loads",
            )
    return None


def open_constraint(
    system: System,
    signals: Signals,
    t: float,
    q: Array,
    dependent: int,
    tolerance: float,
    treatment: Treatment,
    largest: float,
) -> Breakdown | None:
    """Return a breakdown if constraints are violated by more than errors of integration explain, or None.

    Parameters
    ----------
    system : System
        System of the run.
    signals : Signals
        Inputs of the run.
    t : float
        Time [s].
    q : (n,) array
        Coordinates at that time.
    dependent : int
        Number of constraint rows that depend on others: they hold only if they are consistent with these.
    tolerance : float
        Tolerance of the run [m]; violations up to it are allowed.
    treatment : Treatment
        Treatment of the constraints in the run.
    largest : float
        Largest violation in the run so far [m, rad].
    """
    allowed = max(_CONTRADICTION if dependent else _GAPS, tolerance / system.size)
    if largest <= allowed * np.min(system.row_units, initial=1.0):
        return None
    phi, _ = system.constraints(signals, t, q)
    if not system.gap(phi) > allowed:
        return None
    if dependent:
        return Breakdown(contradiction(system, phi, dependence(system, q, count=dependent), "positions"), AGREE)
    gap, where = gap_texts(system, phi)
    finer = "choose a finer tolerance, or a shorter step where it is fixed"
    return Breakdown(
        f"joints come apart, by {gap} in {where},",
        f"{finer}, or larger Baumgarte coefficients" if treatment is Treatment.BAUMGARTE else finer,
    )


def least_norm(system: System, q: Array, multipliers: Array, dependent: int) -> Array:
    """Return multipliers (k, m) at poses (k, n) with the least sum of squares, if a number of rows is dependent.

    They exert the same forces. Near a singular position other rows are nearly dependent as well and cannot be
    distinguished from the dependent ones: multipliers are not changed there.
    """
    if not dependent:
        return multipliers
    out = multipliers.copy()
    for pose, lam in zip(q, out, strict=True):
        jacobian = constraint_jacobian(system, pose)
        least = dependence(system, pose, count=dependent).least_norm(lam)
        if np.linalg.norm(jacobian.T @ (least - lam)) <= _SAME_FORCES * np.linalg.norm(jacobian.T @ lam):
            lam[:] = least
    return out
