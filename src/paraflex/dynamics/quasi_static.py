"""Balanced start: static equilibrium if drives are at rest, else the quasi-static deflection in their motion."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
import scipy

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array
from paraflex.errors import AssemblyError, Moment
from paraflex.limits import solvable
from paraflex.mechanism import Load, PrescribedAngle, TimeProfile
from paraflex.mechanism.profiles import ConstantSpeed, SampledAngle
from .joint_coordinates import joint_coordinate, joint_value
from .projection import LeastChange, constraint_change, project, second_rates
from .rank import dependence
from .signals import moment_signals
from .sparse import sparse_jacobian, stiffness_diagonal
from .state import VELOCITY_STIFFNESS, State
from .stiffness import RestingForces, pose_stiffness
from .system import System, build_system

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


# Motion of the mechanism for a central difference [sizes of the mechanism, rad].
_DIFFERENCE_MOVE = 1e-3


class JointMotion(NamedTuple):
    """Rate and acceleration of a driven joint [rad/s, rad/s^2; m/s, m/s^2]; zero for a joint that is held."""

    rate: float = 0.0
    acceleration: float = 0.0


def _accelerating(time: float, value: float, motion: JointMotion) -> SampledAngle:
    """Return the profile with a value, rate and acceleration at a time [s], continued with constant acceleration."""
    rate, acceleration = motion
    return SampledAngle(
        lambda t: value + rate * (t - time) + 0.5 * acceleration * (t - time) ** 2,
        lambda t: rate + acceleration * (t - time),
        lambda t: np.full(t.shape, acceleration),
    )


def joint_motions(system: System, q: Array, v: Array, a: Array, joints: Iterable[str]) -> dict[str, JointMotion]:
    """Return rates J v and accelerations J a + J' v of joints in a motion q, v, a (n,).

    J is constant for angles; for travels J' v is computed by finite differences along the motion.
    """
    motions = {}
    for name in joints:
        _, rate, acceleration = joint_accelerations(system, name, q[None], v[None], a[None])
        motions[name] = JointMotion(float(rate[0]), float(acceleration[0]))
    return motions


def joint_accelerations(system: System, name: str, q: Array, v: Array, a: Array) -> tuple[Array, Array, Array]:
    """Return value, rate and acceleration (k,) of a joint's coordinate in a motion q, v, a (k, n)."""
    step = (1e-4 / np.maximum(1.0, np.max(np.abs(v), axis=1, initial=0.0)))[:, None]
    before, here, after = (joint_coordinate(system, name, q + part * step * v, v) for part in (-1.0, 0.0, 1.0))
    turning = (after.rate - before.rate) / (2.0 * step[:, 0])
    return here.value, here.rate, np.sum(here.rows * a, axis=1) + turning


def balanced_state(system: System, start: State, driven: Mapping[str, JointMotion]) -> State:
    """Return a start from which links hardly vibrate.

    If every drive is at rest, it is `static_equilibrium` with the joints held at their angles. If a drive moves, links
    are deflected quasi-statically for its motion, q with

        M a + h(q, v) + K q + Phi_q^T lambda = Q(q, v),   Phi(q, t) = 0,   Phi' = 0,   Phi'' = 0,

    v and a the motion of the drives with links that keep their shape (the least v and a in the metric M + s K that
    constraints allow). Weight, loads and inertia forces are balanced, with dampers and friction at joints. The
    velocities of the start are those with which this pose follows the drives, by central differences, projected onto
    the constraints: velocities of drives equal their profiles to rounding. The inertia forces of the changing shape are
    neglected, a fraction (Omega / omega)^2 of the deflection for drives of angular frequency Omega and links of omega.

    Springs at joints count as elastic. If drives leave other degrees of freedom, the motion of these is not given: the
    pose is then that of static equilibrium, with the velocities of least kinetic energy.

    Parameters
    ----------
    system : System
        System of the mechanism.
    start : State
        State that starts the search; its v has no effect.
    driven : mapping of str to JointMotion
        Joints without a prescribed motion that keep their coordinate of the start, slopes of beams included,
        and their motion there.

    Raises
    ------
    AssemblyError
        No equilibrium is found near the start.
    """
    prescribed = {one.joint: one for one in system.mechanism.prescribed}
    driven = {joint: motion for joint, motion in driven.items() if joint not in prescribed}
    now = np.array([start.time])
    rates = [one.profile.evaluate(now)[1][0] for one in prescribed.values()]
    if not np.any([*rates, *(motion.rate for motion in driven.values())]):
        return static_equilibrium(system, start, list(driven))
    drives = _driven(system, start, driven)
    if not _prescribes_all(drives, start):
        still = static_equilibrium(system, start, list(driven))
        return replace(still, v=_Motion(drives, start.time).velocities(still.q))
    return _moving(drives, start)


def _moving(drives: System, start: State) -> State:
    """Return the moving equilibrium, with its velocities."""

    def at(time: float, q: Array) -> Array:
        return moving_equilibrium(drives, State(time, q, np.zeros_like(q)), _Motion(drives, time))

    motion, q = _Motion(drives, start.time), at(start.time, start.q)
    v = motion.velocities(q)
    step = _DIFFERENCE_MOVE / largest_move(drives, v)
    before, after = (at(start.time + h, q + h * v) for h in (-step, step))
    return State(start.time, q, motion.velocities(q, (after - before) / (2.0 * step)))


class _Motion:
    """Velocities and accelerations imposed by drives on a system whose links keep their shape."""

    def __init__(self, system: System, time: float) -> None:
        self.system, self.time, self.signals = system, time, moment_signals(system.mechanism, time)

    def __call__(self, q: Array) -> tuple[Array, Array]:
        """Return velocities and accelerations (n,) at coordinates (n,)."""
        change, rest = self._change(q), np.zeros(self.system.n)
        v = project(change, rest, partial(self._rates, q))
        return v, project(change, rest, partial(second_rates, self.system, self.signals, self.time, q, v))

    def velocities(self, q: Array, near: Array | None = None) -> Array:
        """Return the admissible velocities (n,) at coordinates (n,) nearest to given ones, by default to zero."""
        return project(self._change(q), np.zeros(self.system.n) if near is None else near, partial(self._rates, q))

    def _change(self, q: Array) -> LeastChange:
        return constraint_change(self.system, q, VELOCITY_STIFFNESS, every_spring=True)

    def _rates(self, q: Array, v: Array) -> Array:
        return self.system.constraints(self.signals, self.time, q, v)[1]


def _driven(system: System, start: State, driven: Mapping[str, JointMotion]) -> System:
    """Return the system with the joints driven too; drives and loads follow smooth profiles from the start."""
    own = tuple(
        replace(prescribed, profile=_smooth(prescribed.profile, start.time))
        for prescribed in system.mechanism.prescribed
    )
    more = tuple(
        PrescribedAngle(f"drive of {name}", name, _accelerating(start.time, joint_value(system, name, start.q), motion))
        for name, motion in driven.items()
    )
    loads = tuple(_smooth_load(load, start.time) for load in system.mechanism.loads)
    return build_system(replace(system.mechanism, prescribed=(*own, *more), loads=loads), system)


def _smooth_load(load: Load, time: float) -> Load:
    parts = [_smooth(part, time) if isinstance(part, TimeProfile) else part for part in load.components]
    return replace(load, **{load.kind: tuple(parts) if len(parts) > 1 else parts[0]})


def _smooth(profile: TimeProfile, time: float) -> SampledAngle:
    value, rate, acceleration = (float(x[0]) for x in profile.evaluate(np.array([time])))
    return _accelerating(time, value, JointMotion(rate, acceleration))


def _prescribes_all(drives: System, start: State) -> bool:
    """Return whether drives and springs at joints determine the motion of rigid bodies."""
    mechanism = drives.mechanism
    taken = {prescribed.joint for prescribed in mechanism.prescribed}
    springs = {spring.joint for spring in mechanism.springs} - taken
    locks = tuple(PrescribedAngle(f"spring of {name}", name, ConstantSpeed(0.0, 0.0)) for name in springs)
    rigid = build_system(replace(mechanism, prescribed=(*mechanism.prescribed, *locks)).rigid())
    frames = np.concatenate([start.q[body.offset : body.offset + 3] for body in drives.bodies])
    return dependence(rigid, frames).rank == rigid.n
