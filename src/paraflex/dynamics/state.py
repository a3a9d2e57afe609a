"""States of a system: poses, consistent positions and velocities, momentum."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from paraflex.dynamics.signals import moment_signals
from paraflex.dynamics.system import System
from paraflex.errors import AssemblyError, Moment
from paraflex.kernel.bodies import body_terms
from paraflex.kernel.packed import CONSTRAINT, Signals, make_point_scratch
from paraflex.mechanism import Assembly
from paraflex.mechanism.poses import approximate_poses

_MAX_ITERATIONS = 50
# Closure error that counts as closed [m, rad]: a few rounding errors of a metre-sized mechanism.
CLOSED = 1e-12
# A constraint row whose independent part is smaller than this fraction of the largest follows from the others.
DEPENDENT = 1e-9
# Weight of stiffness against mass [s^2] when loops are closed: links move, their deflections stay as given.
_POSITION_STIFFNESS = 1.0
# The same for a start in motion: rates of deflection are to be none beside those of links.
_VELOCITY_STIFFNESS = 1e3


@dataclass(frozen=True)
class State:
    """Coordinates q and velocities v of a system at a time."""

    time: float
    q: NDArray[np.float64]
    v: NDArray[np.float64]


def mass_matrix(system: System, q: NDArray[np.float64]) -> NDArray[np.float64]:
    """Dense mass matrix (n, n) at q: the equations of motion are linear in the accelerations."""
    M = np.zeros((system.n, system.n))
    base, column = np.zeros(system.n), np.zeros(system.n)
    still, points = np.zeros(system.n), make_point_scratch(system.packed)
    for i, body in enumerate(system.bodies):
        body_terms(system.packed, i, q, still, still, base, points)
        for j in range(body.all.start, body.all.stop):
            unit = np.zeros(system.n)
            unit[j] = 1.0
            body_terms(system.packed, i, q, still, unit, column, points)
            M[body.all, j] = column[body.all] - base[body.all]
    return M


def momentum(system: System, state: State) -> tuple[NDArray[np.float64], float]:
    """Linear momentum (2,) [kg m/s] and angular momentum about the ground frame's origin [kg m^2/s]."""
    p = mass_matrix(system, state.q) @ state.v
    linear, angular = np.zeros(2), 0.0
    for body in system.bodies:
        linear += p[body.position]
        # A rigid turn about the origin moves r by E r and phi by one.
        x, y = state.q[body.position]
        angular += float(p[body.angle] + x * p[body.offset + 1] - y * p[body.offset])
    return linear, angular


def redundant_rows(system: System, q: NDArray[np.float64], threshold: float = DEPENDENT) -> list[str]:
    """Names of constraint rows that follow from the others at q, by a pivoted QR factorisation of Phi_q^T.

    A row counts as such when its independent part is smaller than the threshold, as a fraction of the largest.
    """
    if system.n_constraints == 0:
        return []
    rigid = np.nonzero(system.packed.rows["kind"] == CONSTRAINT)[0]
    factors = scipy.linalg.qr(system.jacobian(q)[rigid].T, mode="r", pivoting=True)
    size, order = np.abs(np.diag(factors[0])), factors[-1]
    rank = int(np.sum(size > threshold * size.max(initial=0.0)))
    return sorted(system.rows[i] for i in rigid[order[rank:]])


def reference_pose(system: System, assembly: Assembly) -> NDArray[np.float64]:
    """Undeformed coordinates at an assembly's angles, positions found along a tree of joints from the ground.

    Loops are not closed yet. Bodies the tree does not reach are where the assembly's points have them.
    """
    q = np.zeros(system.n)
    poses = approximate_poses(system.mechanism, assembly)
    for body in system.bodies:
        pose = poses[body.name]
        q[body.angle] = pose.angle
        q[body.position] = (0.0, 0.0) if pose.position is None else pose.position
    placed: set[str] = set()
    joints = list(system.mechanism.joints)
    if not any(joint.a.on_ground or joint.b.on_ground for joint in joints):
        placed.add(system.bodies[0].name)
    while joints:
        for joint in joints:
            known, new = (joint.a, joint.b) if joint.a.on_ground or joint.a.body in placed else (joint.b, joint.a)
            if not (known.on_ground or known.body in placed):
                continue
            if not new.on_ground and new.body not in placed:
                target = point_position(system, q, known)
                q[system.body(new.body).position] += target - point_position(system, q, new)
                placed.add(new.body)
            joints.remove(joint)
            break
        else:  # what is left floats free of everything placed
            break
    return q


def point_position(system: System, q: NDArray[np.float64], ref) -> NDArray[np.float64]:
    """Ground-frame position (2,) of a named point at q [m]."""
    marker = system.marker(ref)
    if ref.on_ground:
        return marker.x0
    body = system.bodies[marker.body]
    c, s = np.cos(q[body.angle]), np.sin(q[body.angle])
    local = marker.place(q[body.flexible])
    return q[body.position] + np.array([c * local[0] - s * local[1], s * local[0] + c * local[1]])


def project_position(system: System, signals: Signals, t: float, q: NDArray[np.float64]) -> NDArray[np.float64]:
    """The nearest coordinates, in the metric of mass and stiffness, at which the constraints hold.

    Raises
    ------
    AssemblyError
        The loops cannot be closed from there.
    """
    q = q.copy()
    zero = np.zeros(system.n)
    phi = np.zeros(system.m)
    for _ in range(_MAX_ITERATIONS):
        phi, _ = system.constraints(signals, t, q, zero)
        if np.max(np.abs(phi), initial=0.0) < CLOSED:
            return q
        q -= _least_change(system, q, phi, stiffness=_POSITION_STIFFNESS)
    worst = system.rows[int(np.argmax(np.abs(phi)))]
    raise AssemblyError(
        f"the loops do not close: a gap of {np.max(np.abs(phi)):.3g} remains in {worst}", Moment(t, 0), partial=q
    )


def project_velocity(
    system: System,
    signals: Signals,
    t: float,
    q: NDArray[np.float64],
    v: NDArray[np.float64],
    stiffness: float = 0.0,
) -> NDArray[np.float64]:
    """The nearest velocities, in the metric of mass, at which the constraints' first derivative vanishes.

    That is what a blow does. With a weight of stiffness [s^2] against mass links move and do not begin to bend.
    """
    _, rate = system.constraints(signals, t, q, v)
    return v - _least_change(system, q, rate, stiffness)


def _least_change(
    system: System, q: NDArray[np.float64], residual: NDArray[np.float64], stiffness: float = 0.0
) -> NDArray[np.float64]:
    """The smallest d in the metric M + stiffness K with Phi_q d = residual; least squares for dependent rows."""
    jacobian = system.jacobian(q)
    metric = mass_matrix(system, q)
    for body in system.bodies:
        k = np.arange(body.flexible.start, body.flexible.stop)
        metric[k, k] += stiffness * body.modes.omega**2
    weighted = np.linalg.solve(metric, jacobian.T)
    multipliers = np.linalg.lstsq(jacobian @ weighted, residual, rcond=1e-12)[0]
    return weighted @ multipliers


def consistent_state(
    system: System,
    assembly: Assembly,
    *,
    deflection: Mapping[str, NDArray[np.float64]] | None = None,
    velocity: NDArray[np.float64] | None = None,
    time: float = 0.0,
) -> State:
    """A start: an assembly closed, with an initial deflection and velocity if given.

    Parameters
    ----------
    system : System
    assembly : Assembly
    deflection : mapping of str to (n_nodal,) array, optional
        Nodal coordinates of a body (4 a node, then separate curvatures if any); what its mesh's reference condition
        allows of them is kept.
    velocity : (n,) array, optional
        Projected on the constraints as by a blow. By default at rest, or where angles are prescribed moving with them,
        links unbent.
    time : float
        [s], for prescribed joint angles.

    Raises
    ------
    AssemblyError
        The loops cannot be closed.
    """
    q = reference_pose(system, assembly)
    for name, nodal in (deflection or {}).items():
        body = system.body(name)
        q[body.flexible] = np.linalg.lstsq(body.integrals.D, nodal, rcond=None)[0]
    signals = moment_signals(system.mechanism, time)
    q = project_position(system, signals, time, q)
    if velocity is not None:
        return State(time, q, project_velocity(system, signals, time, q, velocity))
    return State(time, q, project_velocity(system, signals, time, q, np.zeros(system.n), _VELOCITY_STIFFNESS))
