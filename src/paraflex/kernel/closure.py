"""Closure of a mechanism whose end-effector's motion is given: positions, velocities and accelerations."""

from __future__ import annotations

from paraflex.kernel.arrays import copy, fill, largest, matrix_apart, vector_apart
from paraflex.kernel.axes import apply_axes
from paraflex.kernel.compiling import allocating, routine
from paraflex.kernel.constraints import constraint_values, fill_jacobian
from paraflex.kernel.dense import solve_dense
from paraflex.kernel.joints import (
    apply_force,
    apply_torque,
    body_joints,
    marker_angle,
    marker_motion,
    start_rows,
)
from paraflex.kernel.packed import INDEX_1

MAX_ITERATIONS = 20
# Newton has converged when no coordinate moves by more than this [m, rad].
SMALLEST_MOVE = 1e-13
# A body that turns or shifts this much against its prediction may have jumped to another assembly [rad, m].
LARGEST_JUMP = 0.3
# A pivot below this fraction of the Jacobian's largest entry is a singular position.
SINGULAR_PIVOT = 1e-11
CLOSED, NO_CONVERGENCE, TOO_COARSE, SINGULAR = range(4)


@allocating
def task_values(p, marker, coordinates, q, v, a):
    """Value, rate and acceleration of each task coordinate (0 x, 1 y, 2 angle) of a marker: (3, tasks)."""
    out = matrix_apart(3, coordinates.size)
    px, py, vx, vy, ax, ay, _, _ = marker_motion(p, marker, q, v, a)
    for i in range(coordinates.size):
        if coordinates[i] == 0:
            out[0, i], out[1, i], out[2, i] = px, vx, ax
        elif coordinates[i] == 1:
            out[0, i], out[1, i], out[2, i] = py, vy, ay
        else:
            out[0, i] = marker_angle(p, marker, q)
            out[1, i] = marker_angle(p, marker, v)
            out[2, i] = marker_angle(p, marker, a)
    return out


@routine
def closure_jacobian(p, marker, coordinates, q, jacobian):
    """[Phi_q; task_q] at q."""
    m = p.rows.size
    fill_jacobian(p, q, jacobian)
    for i in range(coordinates.size):
        fill(jacobian[m + i], 0.0)
    _, _, _, _, _, _, rx, ry = marker_motion(p, marker, q, q, q)
    for i in range(coordinates.size):
        if coordinates[i] == 2:
            apply_torque(p, marker, 1.0, jacobian[m + i])
        else:
            unit = 1.0 if coordinates[i] == 0 else 0.0
            apply_force(p, marker, q, unit, 1.0 - unit, rx, ry, jacobian[m + i])


@routine
def relative_change(before, now, change):
    """Norm of before^-1 (now - before): below one, no matrix between the two is singular. Destroys before.

    Assemblies meet where the Jacobian is singular, and a step over that may end in another one; a step that is short
    enough does not, and no step is short enough that passes a singularity. A determinant would not tell: two loops may
    be singular at once, as are an arm and the parallelogram beside it.
    """
    n = now.shape[0]
    for i in range(n):
        for j in range(n):
            change[i, j] = now[i, j] - before[i, j]
    solve_dense(before, change)
    norm = 0.0
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += abs(change[i, j])
        norm = max(norm, total)
    return norm


@allocating
def close_path(p, signals, marker_index, coordinates, times, target, q, v, a, basis, scratch):
    """Close the loops along a path, each instant starting from the one before.

    Parameters
    ----------
    target : (3, times, tasks) array
        Task coordinates, their rates and accelerations.
    q, v, a : (times, n) arrays
        Written; q[0] holds the pose to start from.
    basis : (times, n, tasks) array
        Written: coordinates' change per change of the task coordinates, the null space of Phi_q in task terms.
    scratch : Scratch

    Returns
    -------
    status, index, residual
        Where it stopped and the residual left there, for a status other than CLOSED: NO_CONVERGENCE, SINGULAR, or
        TOO_COARSE where a singular position may lie between this instant and the one before.
    """
    n, m, tasks = q.shape[1], p.rows.size, coordinates.size
    marker = p.markers[marker_index]
    jacobian = matrix_apart(n, n)
    single, zero, guess = matrix_apart(n, 1), vector_apart(n), vector_apart(n)
    phi, dphi, lam = vector_apart(m), vector_apart(m), vector_apart(m)
    # Motors do not matter here, but those along an axis read their force.
    unused, idle = vector_apart(n), vector_apart(signals.start.size)
    right = matrix_apart(n, 1 + tasks)
    before, change = matrix_apart(n, n), matrix_apart(n, n)
    for k in range(times.size):
        t = times[k]
        if k > 0:
            dt = t - times[k - 1]
            for j in range(n):
                q[k, j] = q[k - 1, j] + dt * (v[k - 1, j] + 0.5 * dt * a[k - 1, j])
        copy(q[k], guess)
        closed = False
        size = 0.0
        for _ in range(MAX_ITERATIONS):
            constraint_values(p, signals, t, q[k], zero, scratch, phi, dphi)
            here = task_values(p, marker, coordinates, q[k], zero, zero)
            for r in range(m):
                single[r, 0] = phi[r]
            for i in range(tasks):
                single[m + i, 0] = here[0, i] - target[0, k, i]
            size = largest(single[:, 0])
            closure_jacobian(p, marker, coordinates, q[k], jacobian)
            if solve_dense(jacobian, single) < SINGULAR_PIVOT:
                return SINGULAR, k, size
            for j in range(n):
                q[k, j] -= single[j, 0]
            if largest(single[:, 0]) < SMALLEST_MOVE * (1.0 + largest(q[k])):
                closed = True
                break
        if not closed:
            return NO_CONVERGENCE, k, size
        for j in range(n):
            if k > 0 and abs(q[k, j] - guess[j]) > LARGEST_JUMP:
                return TOO_COARSE, k, size
        # Velocities, and with them the basis: one right-hand side each.
        constraint_values(p, signals, t, q[k], zero, scratch, phi, dphi)
        for r in range(n):
            fill(right[r], 0.0)
        for r in range(m):
            right[r, 0] = -dphi[r]
        for i in range(tasks):
            right[m + i, 0] = target[1, k, i]
            right[m + i, 1 + i] = 1.0
        closure_jacobian(p, marker, coordinates, q[k], jacobian)
        if k > 0 and relative_change(before, jacobian, change) >= 1.0:
            return TOO_COARSE, k, size
        for j in range(n):
            copy(jacobian[j], before[j])
        solve_dense(jacobian, right)
        for j in range(n):
            v[k, j] = right[j, 0]
            for i in range(tasks):
                basis[k, j, i] = right[j, 1 + i]
        # The part of Phi'' and of the task's acceleration that does not depend on the accelerations.
        start_rows(p, signals, t, INDEX_1, phi)
        for i in range(p.bodies.size):
            body_joints(p, i, q[k], v[k], zero, lam, INDEX_1, scratch, unused, phi)
        apply_axes(p, q[k], v[k], zero, lam, INDEX_1, idle, unused, phi)
        here = task_values(p, marker, coordinates, q[k], v[k], zero)
        for r in range(m):
            single[r, 0] = -phi[r]
        for i in range(tasks):
            single[m + i, 0] = target[2, k, i] - here[2, i]
        closure_jacobian(p, marker, coordinates, q[k], jacobian)
        solve_dense(jacobian, single)
        for j in range(n):
            a[k, j] = single[j, 0]
    return CLOSED, times.size, 0.0
