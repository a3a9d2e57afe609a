"""Limits of reach of a drive: angles or travels beyond which the loops do not close."""

import numpy as np

from paraflex.arrays import Array, Indices
from paraflex.dynamics import System, moment_signals
from paraflex.dynamics.following import driven_rows
from paraflex.dynamics.joint_coordinates import joint_value

# Iterations of the secant method, first step along the curve [sizes of the mechanism, rad], and the largest slope of
# the drive at a limit, relative to its slope with a free mechanism.
_ITERATIONS, _FIRST_STEP, _FLAT = 60, 1e-3, 1e-10
# Poses are closed to this [sizes of the mechanism, rad].
_CLOSED = 1e-13
# Largest distance of a limit from the last pose with closed loops [sizes of the mechanism, rad].
_FAR = 0.5


def limit_of_reach(system: System, joint: str, q: Array) -> float | None:
    """Return the angle [rad] or travel [m] of a driven joint at its limit of reach near a pose, other drives held.

    Without the drive's row the poses form a curve q(s). At a limit of reach the drive's coordinate is stationary along
    it; the secant method finds the root of its slope.

    Parameters
    ----------
    system : System
        System of a rigid mechanism that its drives determine, without redundant rows.
    joint : str
        Joint of the drive.
    q : (n,) array
        Pose near the limit, with closed loops.

    Returns
    -------
    float or None
        Value of the drive's joint at the limit; None if there is no such limit nearby, as at a change point.
    """
    motion, row = next((one, row) for one, row in driven_rows(system) if one.joint == joint)
    others = np.delete(np.arange(system.m), row)
    signals = moment_signals(system.mechanism, 0.0)
    direction = _tangent(system, q, others)

    def pose(s: float) -> Array:
        here = q + s * system.units * direction
        for _ in range(_ITERATIONS):
            left = system.constraints(signals, 0.0, here)[0] / system.row_units
            move = np.linalg.lstsq(system.dimensionless_jacobian(here)[others], left[others])[0]
            here = here - system.units * move
            if np.max(np.abs(move)) < _CLOSED:
                break
        return here

    def slope(s: float) -> float:
        here = pose(s)
        return float(system.dimensionless_jacobian(here)[row] @ _tangent(system, here, others, direction))

    before, after = 0.0, _FIRST_STEP
    f0, f1 = slope(before), slope(after)
    for _ in range(_ITERATIONS):
        if f1 == f0 or abs(f1) < _FLAT:
            break
        before, after, f0 = after, after - f1 * (after - before) / (f1 - f0), f1
        if not abs(after) < _FAR:
            return None
        f1 = slope(after)
    return joint_value(system, motion.joint, pose(after)) if abs(f1) < _FLAT else None


def _tangent(system: System, q: Array, rows: Indices, like: Array | None = None) -> Array:
    """Return the unit tangent (n,) of the curve on which some rows hold, in units of the system."""
    tangent = np.linalg.svd(system.dimensionless_jacobian(q)[rows])[2][-1]
    return tangent if like is None or tangent @ like > 0.0 else -tangent
