"""Starts at which branches meet: change points with two possible velocities, and dead centres of drives."""

from typing import Any, NamedTuple

import numpy as np
import scipy

from paraflex.arrays import Array
from paraflex.kernel.packed import Signals
from paraflex.mechanism.profiles import ConstantSpeed
from .following import driven_rows, drives_at
from .projection import NAMED, second_rates
from .rank import Dependence, dependence
from .system import DENSE_ROWS, System

# Curvatures and rates below this fraction of the largest are rounding.
_ROUNDING = 1e-7
# Rows with a smaller share of a dependence near a singular configuration than this take no part in it.
_PART = 1e-2
_BESIDE = "start prescribed motions beside this pose and within the mechanism's reach"
_TWO_BRANCHES = "give one of these rates in [start.velocity.angular], or start beside this pose"


class ChangePoint(NamedTuple):
    """A pose at which the branches of a motion meet.

    Attributes
    ----------
    cause, remedy : str
        Description of the pose, and the remedy; all fields are empty for any other pose.
    velocities : tuple of (n,) arrays
        Velocities of the branches; empty if no branch continues.
    drives : str
        Prescribed motions at a dead centre, with the values of their joints.
    """

    cause: str = ""
    remedy: str = ""
    velocities: tuple[Array, ...] = ()
    drives: str = ""


def change_point_at(system: System, signals: Signals, t: float, q: Array, rows: Any, target: Array) -> ChangePoint:
    """Find whether the branches of a motion meet at a pose.

    Velocities v0 + x n, n the null vector of the rows, have accelerations if w Phi''(v0 + x n) = 0, a quadratic
    equation in x; w is the vanishing combination of the rows of Phi_q.

    Parameters
    ----------
    system : System
        System of the mechanism.
    signals : Signals
        Signals with the prescribed values.
    t : float
        Time [s].
    q : (n,) array
        Closed coordinates.
    rows, target : (k, n) array or sparse matrix, and (k,) array
        Phi_q and the rows of given velocities, and the required values of rows v.
    """
    found = dependence(system, q) if 0 < system.m <= DENSE_ROWS else None
    if found is None or not found.dropped.size:
        return ChangePoint()
    scaled = (rows.toarray() if scipy.sparse.issparse(rows) else rows) * system.units
    null = scipy.linalg.null_space(scaled / np.maximum(np.linalg.norm(scaled, axis=1, keepdims=True), 1e-300), 1e-9)
    if null.shape[1] != 1:
        return ChangePoint()
    v, along = system.units * np.linalg.lstsq(scaled, target, rcond=1e-9)[0], system.units * null[:, 0]

    def missing(x: float, v: Array = v) -> Array:
        return found.conflict(second_rates(system, signals, t, q, v + x * along, np.zeros(system.n)))

    curvature = 0.5 * (missing(1.0, 0.0 * v) + missing(-1.0, 0.0 * v)) - missing(0.0, 0.0 * v)
    k = int(np.argmax(np.abs(curvature)))
    if abs(curvature[k]) <= _ROUNDING * system.row_units[found.dropped[k]]:
        return ChangePoint()
    drives = dependent_drives(system, q, found)
    barred = found.conflict(-target[: system.m])[k]
    if abs(barred) > _ROUNDING * np.max(np.abs(target)):
        return ChangePoint(
            f"a dead centre, the limit of reach, with {drives}, where prescribed motions are not at rest", _BESIDE
        )
    terms = np.array([curvature[k], 0.5 * (missing(1.0) - missing(-1.0))[k], missing(0.0)[k]])
    roots = np.roots(np.where(np.abs(terms) <= _ROUNDING * np.max(np.abs(terms)), 0.0, terms))
    if np.iscomplexobj(roots):
        return ChangePoint(
            f"a dead centre, the limit of reach, with {drives}, beyond which prescribed motions lead", _BESIDE
        )
    if abs(roots[0] - roots[1]) <= _ROUNDING:
        return ChangePoint()
    what = f"a dead centre, with {drives}" if drives else "a change point"
    velocities = tuple(v + x * along for x in roots)
    turning = np.array([[one[body.angle] for one in velocities] for body in system.bodies])
    rounding = _ROUNDING * np.max(np.abs(turning))
    turning[np.abs(turning) < rounding] = 0.0
    rates = [
        f"{body.name} at {first:.6g} or {second:.6g} rad/s"
        for body, (first, second) in zip(system.bodies, turning, strict=True)
        if abs(first - second) > rounding
    ]
    turns = f": {', '.join(rates[:NAMED])}" if rates else ""
    return ChangePoint(
        f"{what}, at which two branches meet{turns}", _TWO_BRANCHES if rates else _BESIDE, velocities, drives
    )


def branches_from_rest(system: System, signals: Signals, t: float, q: Array) -> bool:
    """Return whether prescribed motions, all at rest, are at a change point from which two branches lead on."""
    moves = np.zeros(system.m)
    for motion, row in driven_rows(system):
        moves[row] = not isinstance(motion.profile, ConstantSpeed)
    if not np.any(moves):
        return False
    found = change_point_at(system, signals, t, q, system.jacobian(q), moves)
    return bool(found.velocities) and not found.drives


def dependent_drives(system: System, q: Array, found: Dependence) -> str:
    """List prescribed motions that take part in dependences of rows, with values of their joints; empty for none."""
    units, rows = system.row_units, set()
    for k, row in enumerate(found.dropped):
        part = np.abs(found.coefficients[:, k]) * units[found.kept] / units[row]
        rows |= {row, *found.kept[part > _PART * max(1.0, part.max(initial=0.0))].tolist()}
    return drives_at(system, q, rows)
