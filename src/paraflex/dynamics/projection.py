"""Assembly of a mechanism: least change of coordinates onto Phi = 0, then of rates onto Phi' = 0.

Every pose of this package except the steps of a run is found here: assemblies, starts, poses near a path.
"""

import math
from collections.abc import Callable

import numpy as np
import scipy

from paraflex.arrays import Array, Mask
from paraflex.errors import InconsistentConstraintsError, Moment
from paraflex.kernel.packed import INDEX_1, Signals
from paraflex.kernel.stage import equations
from .inputs import inputs_of
from .rank import Dependence, constraint_jacobian, dependence, involved, joint_of_row
from .sparse import Saddle, elastic_stiffness, sparse_mass
from .system import DENSE_ROWS, System

Sparse = scipy.sparse.csr_matrix
# Function from the wanted rows (m,) to the smallest change.
LeastChange = Callable[[Array], Array]

_MAX_ITERATIONS = 50
# Error below which a closure is closed [rad], and as a fraction of the mechanism's size: thousands of roundings.
CLOSED = 1e-12
# Number of projections of rates: the second removes the rounding error of the first.
_PROJECTIONS = 2
# Least mass of a body in the metric, as a fraction of the whole.
_LEAST_MASS = 1e-7
# Largest number of joints named in an error.
NAMED = 6
_GAP_UNITS = {"positions": "m or rad", "velocities": "m/s or rad/s", "accelerations": "m/s^2 or rad/s^2"}
# Remedy for contradicting constraints.
AGREE = "leave one of these joints, gears or prescribed motions out, or choose places and profiles that agree"
# Largest residual of constraint rates (sizes of the mechanism, rad; s), as a fraction of the wanted rates.
_CONFLICT = 1e-6


def assemble(
    system: System,
    signals: Signals,
    t: float,
    q: Array,
    change_at: Callable[[Array], LeastChange],
    *,
    free: Mask | None = None,
    longest: float = math.inf,
    offset: Array | float = 0.0,
) -> tuple[Array, Array]:
    """Solve Phi(q, t) = offset by Newton's iteration, each step the least change in some metric.

    Parameters
    ----------
    system : System
        System of the mechanism.
    signals : Signals
        Signals with the prescribed values.
    t : float
        Time [s].
    q : (n,) array
        Coordinates at which the iteration starts.
    change_at : callable
        Least change of the free coordinates at coordinates (n,), for example by `constraint_change`.
    free : (n,) array of bool, optional
        Coordinates that may change; all by default.
    longest : float
        Longest step [sizes of the mechanism, rad]; no limit by default.
    offset : (m,) array
        Values that the constraints are to have, zero by default.

    Returns
    -------
    q, phi
        Coordinates, and the residual of the constraints there: see `closed`.
    """
    q, free = q.copy(), np.ones(system.n, dtype=bool) if free is None else free
    phi = system.constraints(signals, t, q)[0] - offset
    for _ in range(_MAX_ITERATIONS):
        if closed(system, q, phi) or not np.any(free):
            break
        change = change_at(q)(phi)
        q[free] -= change * shortened(change / system.units[free], longest)
        phi = system.constraints(signals, t, q)[0] - offset
    return q, phi


def closed(system: System, q: Array, phi: Array) -> bool:
    """Return whether residuals (m,) of constraints at q are rounding, for the mechanism's size or its distance."""
    far = max(float(np.max(np.abs(q[body.position]), initial=system.size)) for body in system.bodies) / system.size
    return system.gap(phi) < CLOSED * far


def shortened(step: Array, longest: float) -> float:
    """Return the factor that shortens a dimensionless step to the longest one allowed, at most one."""
    return min(1.0, longest / max(float(np.max(np.abs(step), initial=0.0)), np.finfo(float).tiny))


def link_metric(system: System, q: Array, stiffness: float, *, every_spring: bool = False) -> Sparse:
    """Return M + stiffness K / omega^2, omega the slowest vibration of a body; `every_spring` adds springs at joints.

    With a large stiffness (dimensionless) links keep their shape, at any size of the mechanism. Bodies have at least a
    fraction of the total mass: otherwise the coupling of heavy bodies through light ones would be lost in rounding.
    """
    mass = sparse_mass(system, q)
    held, least = mass.diagonal(), _LEAST_MASS * system.total_mass
    light = [body for body in system.bodies if held[body.position.start] < least]
    if light:
        more = np.zeros(system.n)
        for body in light:
            more[body.position], more[body.angle] = least, least * system.size**2
        mass = Sparse(mass + scipy.sparse.diags(more))
    if not stiffness:
        return mass
    weight = stiffness / system.slowest**2
    return Sparse(mass + weight * elastic_stiffness(system, q, every_spring=every_spring))


def least_change(metric: Sparse, rows: Sparse, units: Array, damping: float = 0.0) -> LeastChange:
    """Return the solver for the smallest x in a metric with rows x = wanted (m,); least squares for dependent rows.

    Damping shortens the change, as in the Levenberg-Marquardt method.

    Parameters
    ----------
    metric, rows : (n, n) and (m, n) sparse matrices
        Metric, and constraint rows.
    units : (m,) array
        Units of the rows: otherwise angles and lengths would differ by the square of the mechanism's size.
    damping : float
        Damping, as a fraction of the mean diagonal entry of rows metric^-1 rows^T; none by default.
    """
    if units.size > DENSE_ROWS:
        rows = Sparse(scipy.sparse.diags(1.0 / units) @ rows)
        mean = float(np.mean(rows.multiply(rows) @ (1.0 / np.asarray(metric.diagonal(), dtype=float))))
        saddle = Saddle(metric, rows, np.full(units.size, damping * mean))
        return lambda target: saddle.solve(r=target / units)[0]
    dense = rows.toarray() / units[:, None]
    weighted = scipy.sparse.linalg.splu(scipy.sparse.csc_matrix(metric)).solve(dense.T)
    schur = dense @ weighted
    if damping:
        schur += damping * np.mean(np.diag(schur)) * np.eye(units.size)
    # Rows scaled to equal size: those of massless links would make others look dependent.
    size = np.sqrt(np.diag(schur))
    scale = 1.0 / np.where(size > 0.0, size, 1.0)
    schur *= scale[:, None] * scale
    return lambda wanted: weighted @ (scale * np.linalg.lstsq(schur, scale * wanted / units, rcond=1e-12)[0])


def constraint_change(
    system: System,
    q: Array,
    stiffness: float = 0.0,
    damping: float = 0.0,
    *,
    every_spring: bool = False,
    free: Mask | None = None,
) -> LeastChange:
    """Return `least_change` in `link_metric` with the rows Phi_q, for all coordinates or the free ones (n,)."""
    metric = link_metric(system, q, stiffness, every_spring=every_spring)
    rows = constraint_jacobian(system, q)
    if free is not None:
        metric, rows = metric[free][:, free], rows[:, free]
    return least_change(metric, rows, system.row_units, damping)


def project(change: LeastChange, x: Array, left: Callable[[Array], Array]) -> Array:
    """Return the rates nearest to x (n,) with zero residual `left` (m,), which is linear in them."""
    for _ in range(_PROJECTIONS):
        x = x - change(left(x))
    return x


def second_rates(system: System, signals: Signals, t: float, q: Array, v: Array, a: Array) -> Array:
    """Return Phi'' (m,) at accelerations (n,); zero in the rows of springs and dampers."""
    workspace, torques = system.workspace(), np.zeros(inputs_of(system.mechanism).acting)
    equations(system.packed, signals, t, INDEX_1, q, v, a, np.zeros(system.m), torques, workspace)
    return np.where(system.constrained, workspace.rows, 0.0)


def joint_gaps(system: System, phi: Array) -> dict[str, float]:
    """Return residuals of joints, gears and drives by name [m, rad], descending to a tenth of the largest."""
    gaps: dict[str, float] = {}
    for row, value in zip(system.rows, phi.tolist(), strict=True):
        gaps[joint_of_row(row)] = math.hypot(gaps.get(joint_of_row(row), 0.0), value)
    largest = max(gaps.values(), default=0.0)
    return {name: gap for name, gap in sorted(gaps.items(), key=lambda item: -item[1]) if gap >= 0.1 * largest}


def gap_texts(system: System, phi: Array) -> tuple[str, str]:
    """Return the largest residual of joints, gears and drives with its unit, and the names of those furthest open."""
    gaps, largest = joint_gaps(system, phi), system.rows[int(np.argmax(np.abs(phi)))]
    return f"{max(gaps.values()):.3g} {row_unit(largest)}", " and ".join(list(gaps)[:NAMED])


def row_unit(row: str) -> str:
    """Return the unit of a constraint row's residual, from the row's name."""
    return "rad" if row.endswith(" angle") else "m"


def refuse_conflict(system: System, what: str, t: float, q: Array, target: Array, left: Array) -> None:
    """Raise an error if a projection leaves a larger residual of rows (m,) than rounding explains.

    Raises
    ------
    InconsistentConstraintsError
        Constraints contradict one another; the error names the joints, gears and prescribed motions involved.
    """
    if not system.gap(left) > _CONFLICT * max(1.0, system.gap(target)):
        return
    cause = contradiction(system, target, dependence(system, q), what)
    raise InconsistentConstraintsError(cause, Moment(t, 0), remedy=AGREE)


def contradiction(system: System, target: Array, found: Dependence, what: str) -> str:
    """Describe the largest contradiction: that of the dropped row furthest from the value its sources imply."""
    if found.dropped.size:
        conflict = np.abs(found.conflict(target))
        k = int(np.argmax(conflict))
        names, size = involved(system, found, k), float(conflict[k])
    else:
        gaps = joint_gaps(system, target)
        names, size = list(gaps), max(gaps.values())
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    return (
        f"the {what} of constraints contradict one another, by {size:.3g} {_GAP_UNITS[what]}: "
        f"{', '.join(names[:NAMED])}{more},"
    )
