"""What is left of the equations of closed loops at a motion given: to differentiate what they determine."""

from __future__ import annotations

from paraflex.kernel.arrays import fill
from paraflex.kernel.axes import apply_axes
from paraflex.kernel.closure import closure_jacobian, task_values
from paraflex.kernel.compiling import lasting
from paraflex.kernel.constraints import constraint_values
from paraflex.kernel.joints import body_joints, start_rows
from paraflex.kernel.packed import INDEX_1


@lasting
def closure_residuals(p, signals, marker_index, coordinates, times, target, q, v, a, basis, out, jacobians, ws):
    """Residuals of positions, velocities, accelerations and of the basis at every instant.

    Parameters
    ----------
    times, target, q, v, a, basis : arrays
        As for `closure.close_path`; all are read.
    out : (times, n, 3 + tasks) array
        Written: constraints and task coordinates less their targets, the rates and the accelerations of these, and
        the Jacobian's product with the basis.
    jacobians : (times, n, n) array
        Written: [Phi_q; task_q].
    ws : ClosureScratch
    """
    marker, m, tasks = p.markers[marker_index], p.rows.size, coordinates.size
    for k in range(times.size):
        constraint_values(p, signals, times[k], q[k], v[k], ws.body, ws.phi, ws.dphi)
        for r in range(m):
            out[k, r, 0], out[k, r, 1] = ws.phi[r], ws.dphi[r]
        start_rows(p, signals, times[k], INDEX_1, ws.phi)
        fill(ws.lam, 0.0)
        for i in range(p.bodies.size):
            body_joints(p, i, q[k], v[k], a[k], ws.lam, INDEX_1, ws.body, ws.unused, ws.phi)
        apply_axes(p, q[k], v[k], a[k], ws.lam, INDEX_1, ws.idle, ws.unused, ws.phi)
        task_values(p, marker, coordinates, q[k], v[k], a[k], ws.here)
        for r in range(m):
            out[k, r, 2] = ws.phi[r]
        for i in range(tasks):
            for order in range(3):
                out[k, m + i, order] = ws.here[order, i] - target[k, order, i]
        jacobian = jacobians[k]
        closure_jacobian(p, marker, coordinates, q[k], jacobian)
        for r in range(q.shape[1]):
            for i in range(tasks):
                total = 0.0
                for j in range(q.shape[1]):
                    total += jacobian[r, j] * basis[k, j, i]
                out[k, r, 3 + i] = total
