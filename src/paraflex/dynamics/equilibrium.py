"""Equilibrium under weight, loads and springs: at rest with some joints held, and in a prescribed motion."""

from collections.abc import Callable, Sequence

import numpy as np
import scipy

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array
from paraflex.errors import AssemblyError, Moment
from paraflex.limits import solvable
from .joint_coordinates import joint_coordinate
from .sparse import sparse_jacobian, stiffness_diagonal
from .state import State
from .stiffness import RestingForces, pose_stiffness
from .system import System

_MAX_ITERATIONS = 50
# Newton's iteration has converged when it moves links by less than this [sizes of the mechanism, rad] ...
_SMALLEST_MOVE = 1e-10
# ... and the residual of the forces is less than this fraction of the largest.
_BALANCED = 1e-6
# Step of the finite differences for the Jacobian; forces are linear in multipliers and nearly so in displacements.
_DIFFERENCE = 1e-6
# Longest move of a link in one iteration [sizes of the mechanism, rad].
_LONGEST_STEP = 0.3
# Up to this number of unknowns a dense Jacobian is fast enough; least squares then handles dependent columns.
_MOST_DENSE = 400
_NO_EQUILIBRIUM = "no static equilibrium is found near the start"
_HOLD = "start nearer to it, keep the angles of more joints, or make links and springs stiffer"
_NO_MOVING_EQUILIBRIUM = (
    "no equilibrium of links with weight, loads and the inertia of the motion is found near the start: the drives are "
    "too fast for links this soft"
)
_SLOWER_DRIVES = "let the drives start more slowly, or make the links stiffer"

# Velocities and accelerations (n,) at coordinates (n,).
Motion = Callable[[Array], tuple[Array, Array]]


@checked_arguments()
@solvable("an equilibrium")
def static_equilibrium(system: System, start: State, held: Sequence[str] = ()) -> State:
    """Find the state of rest nearest a start: forces in balance, joints closed, held joints at their angles.

    Newton's iteration solves for forces and constraints, with the Jacobian by finite differences. Motors of held joints
    exert whatever torque is needed; all others exert none. If no joint holds the mechanism in some direction, its
    weight or springs must.

    Parameters
    ----------
    system : System
        System of the mechanism.
    start : State
        State whose q starts the search; its v has no effect.
    held : sequence of str
        Joints whose angle or travel, slopes of beams included, is kept.

    Returns
    -------
    State
        Equilibrium at the time of the start, at rest.

    Raises
    ------
    AssemblyError
        No equilibrium is found near the start.
    """
    return State(start.time, _find(system, start, held, None), np.zeros(system.n))


@solvable("an equilibrium")
def moving_equilibrium(system: System, start: State, motion: Motion) -> Array:
    """Find the pose (n,) nearest a start at which forces balance the inertia forces of a motion.

    The iteration is that of `static_equilibrium` with M a + h(q, v) among the forces, and dampers and friction at
    joints; v and a are updated in every iteration.

    Parameters
    ----------
    system : System
        System with all its rigid degrees of freedom prescribed.
    start : State
        State whose q starts the search.
    motion : callable
        Function that returns v and a (n,) at a pose (n,), consistent with the constraints.

    Raises
    ------
    AssemblyError
        No equilibrium is found near the start.
    """
    try:
        return _find(system, start, (), motion)
    except AssemblyError as error:
        raise AssemblyError(_NO_MOVING_EQUILIBRIUM, error.moment, error.partial, _SLOWER_DRIVES) from None


def _find(system: System, start: State, held: Sequence[str], motion: Motion | None) -> Array:
    solve = _sparse_equilibrium if system.n + system.m > _MOST_DENSE else _dense_equilibrium
    return solve(system, start, held, motion)


def _dense_equilibrium(system: System, start: State, held: Sequence[str], motion: Motion | None) -> Array:
    n, m = system.n, system.m
    residual = _Residual(system, start, held)
    z = np.concatenate([start.q, np.zeros(m + len(held))])
    # Dimensionless: forces by the energy of the total mass at the mechanism's size and the slowest vibration of a body;
    # modes scaled to unit stiffness.
    energy = system.total_mass * (system.size * system.slowest) ** 2
    units = np.append(1.0 / system.row_units, np.ones(len(held)))
    scale, by_force = np.append(system.units, energy * units), np.append(system.units / energy, units)
    for body in system.bodies:
        scale[body.flexible] = np.sqrt(energy) / body.modes.omega
        by_force[body.flexible] = scale[body.flexible] / energy
    for _ in range(_MAX_ITERATIONS):
        if motion is not None:
            residual.forces.v, residual.forces.a = motion(z[:n])
        value = by_force * residual(z)
        jacobian = np.column_stack(
            [(by_force * residual(z + _DIFFERENCE * unit) - value) / _DIFFERENCE for unit in np.diag(scale)]
        )
        # Rows of soft springs have large entries. Dependent rows and motors that work against one another leave
        # multipliers undetermined: least squares gives those of least norm.
        largest = np.max(np.abs(jacobian), axis=1)
        largest[largest == 0.0] = 1.0
        change = scale * np.linalg.lstsq(jacobian / largest[:, None], -value / largest, rcond=1e-12)[0]
        reach = largest_move(system, change[:n])
        z += change * min(1.0, _LONGEST_STEP / max(reach, _LONGEST_STEP))
        if reach <= _SMALLEST_MOVE and energy * np.max(np.abs(value[:n])) <= _BALANCED * residual.largest_effort:
            return z[:n]
    raise AssemblyError(_NO_EQUILIBRIUM, Moment(start.time, 0), z[:n], _HOLD)


def _sparse_equilibrium(system: System, start: State, held: Sequence[str], motion: Motion | None) -> Array:
    """Find the equilibrium with sparse matrices; springs at joints are stiffness here, not multipliers."""
    forces, elastic = RestingForces(system, start.time), stiffness_diagonal(system)
    kept, _ = _joints(system, held, start.q)
    rigid = np.nonzero(system.constrained)[0]
    q, mu = start.q.copy(), np.zeros(rigid.size + len(held))
    for _ in range(_MAX_ITERATIONS):
        if motion is not None:
            forces.v, forces.a = motion(q)
        values, rows = _joints(system, held, q)
        off, holding = values - kept, scipy.sparse.csr_matrix(rows)
        lam = forces.compliant(q)
        lam[rigid] = mu[: rigid.size]
        f = forces(q, lam)[0] + elastic * q + holding.T @ mu[rigid.size :]
        phi, _ = system.constraints(forces.signals, start.time, q)
        K = scipy.sparse.csr_matrix(pose_stiffness(system, start.time, q, lam) + scipy.sparse.diags(elastic))
        C = scipy.sparse.csr_matrix(scipy.sparse.vstack([sparse_jacobian(system, q)[rigid], holding]))
        try:
            change, more = _solve(K, C, -f, -np.concatenate([phi[rigid], off]))
        except RuntimeError:  # an exactly singular matrix: nothing holds it in some direction, or rows are dependent
            break
        if not np.all(np.isfinite(change)):
            break
        reach = largest_move(system, change)
        part = min(1.0, _LONGEST_STEP / max(reach, _LONGEST_STEP))
        q, mu = q + part * change, mu + part * more
        largest = max(np.max(np.abs(system.row_units * lam), initial=0.0), np.max(np.abs(mu), initial=0.0))
        if reach <= _SMALLEST_MOVE and np.max(np.abs(system.units * f)) <= _BALANCED * largest:
            return q
    raise AssemblyError(_NO_EQUILIBRIUM, Moment(start.time, 0), q, _HOLD)


def _solve(K: scipy.sparse.csr_matrix, C: scipy.sparse.csr_matrix, f: Array, r: Array) -> tuple[Array, Array]:
    """Solve [K, C^T; C, 0] [x; mu] = [f; r]. K is indefinite, so unlike `sparse.Saddle` this does not regularise."""
    size = max(1.0, float(abs(K).max()))
    matrix = scipy.sparse.csc_matrix(scipy.sparse.bmat([[K / size, C.T], [C, None]]))
    right, factor = np.concatenate([f / size, r]), scipy.sparse.linalg.splu(matrix)
    z = factor.solve(right)
    z += factor.solve(right - matrix @ z)
    return z[: f.size], z[f.size :] * size


def largest_move(system: System, change: Array) -> float:
    """Return the largest displacement or rotation of links by a change of coordinates [sizes of the mechanism, rad]."""
    return max(float(np.max(np.abs(change / system.units)[body.offset : body.offset + 3])) for body in system.bodies)


def _joints(system: System, held: Sequence[str], q: Array) -> tuple[Array, Array]:
    """Return the coordinates of the held joints (held,) and their derivatives (held, n)."""
    found = [joint_coordinate(system, name, q[None]) for name in held]
    rows = np.array([joint.rows[0] for joint in found]).reshape(-1, system.n)
    return np.array([joint.value[0] for joint in found]), rows


class _Residual:
    """Residuals of forces, constraints and held joints at (q, multipliers, torques), in the motion of `forces`."""

    def __init__(self, system: System, start: State, held: Sequence[str]) -> None:
        self.system, self.held = system, held
        self.kept = _joints(system, held, start.q)[0]
        self.forces = RestingForces(system, start.time, beams=True)
        self.largest_effort = 0.0

    def __call__(self, z: Array) -> Array:
        system, forces = self.system, self.forces
        q, lam, torque = np.split(z, [system.n, system.n + system.m])
        q, lam = np.ascontiguousarray(q), np.ascontiguousarray(lam)
        f, _ = forces(q, lam)
        phi, _ = system.constraints(forces.signals, forces.time, q)
        # Rows of springs, dampers and friction have no second derivatives in them.
        closed = np.where(system.constrained, phi, forces.workspace.rows)
        value, rows = _joints(system, self.held, q)
        holding = rows.T @ torque
        efforts = (np.abs(system.row_units * lam), np.abs(system.units * holding))
        self.largest_effort = max(np.max(part, initial=0.0) for part in efforts)
        return np.concatenate([f + holding, closed, value - self.kept])
