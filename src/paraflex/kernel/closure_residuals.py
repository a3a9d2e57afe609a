"""Residuals of the equations of closed loops for a given motion, used for derivatives."""

from .closure import closure_jacobian, second_derivatives
from .compiling import releases_lock
from .constraints import constraint_values


@releases_lock
def closure_residuals(system, signals, marker_index, coordinates, times, target, q, v, a, basis, out, jacobians, work):
    """Compute the residuals of positions, velocities, accelerations and of the basis at every sample.

    Parameters
    ----------
    times, target, q, v, a, basis : arrays
        Motion as for `closure.close_path`; all are read.
    out : (times, n, 3 + tasks) array
        Constraints and task coordinates less their targets, the rates and the accelerations of these, and the
        Jacobian's product with the basis. Written.
    jacobians : (times, n, n) array
        Jacobians [Phi_q; task_q]. Written.
    work : ClosureScratch
        Work arrays.
    """
    marker, m, tasks = system.markers[marker_index], system.rows.size, coordinates.size
    for k in range(times.size):
        constraint_values(system, signals, times[k], q[k], v[k], work.body, work.phi, work.dphi)
        for r in range(m):
            out[k, r, 0], out[k, r, 1] = work.phi[r], work.dphi[r]
        second_derivatives(system, signals, marker, coordinates, times[k], q[k], v[k], a[k], work)
        for r in range(m):
            out[k, r, 2] = work.phi[r]
        for i in range(tasks):
            for order in range(3):
                out[k, m + i, order] = work.here[order, i] - target[k, order, i]
        jacobian = jacobians[k]
        closure_jacobian(system, marker, coordinates, q[k], jacobian)
        for r in range(q.shape[1]):
            for i in range(tasks):
                total = 0.0
                for j in range(q.shape[1]):
                    total += jacobian[r, j] * basis[k, j, i]
                out[k, r, 3 + i] = total
