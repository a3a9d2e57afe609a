"""Equations for external solvers: an ODE in (q, v), with multipliers eliminated (Eqs. 59-60), and its Jacobian.

A third part is added to (q, v), the work done so far, so that a solver integrates the power with the motion.
"""

from .arrays import copy, fill
from .compiling import kernel, routine
from .constraints import constraint_values, note_friction
from .factor import factor_bodies
from .linear import orient, solve_residuals
from .packed import CONSTRAINT, INDEX_1
from .stage import equations, solve_linear
from .step import input_power
from .tangent import note_slopes, reaction_tangent, residual_tangent

# Value of b for rows of springs and dampers that determine their forces independently of the accelerations: the rows
# are divided by b or by its square root, and both must be negligible beside 1.
INSTANT_B = 1e-36
# Weights of Phi'', Phi' and Phi for constraints on velocities, and on positions.
SPEEDS, PLACES = (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


@kernel
def accelerations(system, signals, t, weights, q, v, a, lam, torques, work, dependent_part):
    """Compute accelerations (n,) and multipliers (m,) at (t, q, v) into a and lam; the factor stays in work.

    Returns
    -------
    int
        Number of dependent rows, with a relative pivot below `dependent_part`; their multipliers are zero.
    """
    fill(a, 0.0)
    fill(lam, 0.0)
    note_friction(system, q, v, work.mu, work.compliance)
    factor_bodies(system, 0.0, q, work)
    work.step[0] = INSTANT_B
    dependent = orient(system, q, work, dependent_part)
    solve_linear(system, signals, t, weights, q, v, a, lam, torques, work)
    return dependent


@kernel
def rates(system, signals, t, weights, y, a, lam, torques, work, dependent_part, dy):
    """Compute the derivative of y = (q, v, work done) into dy, both (2n + 1,); a and lam as by `accelerations`.

    Returns
    -------
    int
        Number of dependent rows, see `accelerations`.
    """
    n = a.size
    q, v = y[:n], y[n : 2 * n]
    dependent = accelerations(system, signals, t, weights, q, v, a, lam, torques, work, dependent_part)
    for j in range(n):
        dy[j] = v[j]
        dy[n + j] = a[j]
    dy[2 * n] = input_power(system, signals, t, q, v, lam, torques, work)
    return dependent


@kernel
def rates_jacobian(system, weights, y, a, lam, torques, work, direction, out):
    """Compute the derivative of `rates` by y into out (2n + 1, 2n + 1), at the y of its last call.

    The accelerations change by -[M, J^T; J, -C]^-1 (dF, dG). The row of the power is left zero: Newton's iteration
    obtains the work from the motion, one iteration later.
    """
    n = a.size
    q, v = y[:n], y[n : 2 * n]
    for j in range(2 * n + 1):
        fill(out[j], 0.0)
    note_slopes(system, q, v, work.mu, work.compliance, direction)
    for i in range(system.bodies.size):
        for j in range(system.bodies[i].offset, system.bodies[i].offset + 3 + system.bodies[i].nf):
            for part in range(2):
                one = direction.q if part == 0 else direction.v
                one[j] = 1.0
                residual_tangent(system, weights, q, v, a, lam, torques, work.compliance, i, i + 1, direction)
                one[j] = 0.0
                copy(direction.f, work.f)
                copy(direction.rows, work.rows)
                solve_residuals(system, work, 1.0)
                column = part * n + j
                for k in range(n):
                    out[n + k, column] = work.x[k]
            out[j, n + j] = 1.0


@kernel
def descriptor_residual(system, signals, t, weights, y, dy, dropped, torques, work, out):
    """Compute the residual of the equations as a DAE of index 1 in y = (q, v, lambda, work done), into out.

    y, dy, out : (2n + m + 1,) arrays.

    The entries are q' - v, then those of `equations` with v' as the acceleration, then work' less the power. `dropped`
    (m,) marks rows that depend on others: their multipliers are zero.
    """
    n, m = work.f.size, work.rows.size
    q, v, a, lam = y[:n], y[n : 2 * n], dy[n : 2 * n], y[2 * n : 2 * n + m]
    note_friction(system, q, v, work.mu, work.compliance)
    equations(system, signals, t, weights, q, v, a, lam, torques, work)
    for j in range(n):
        out[j] = dy[j] - v[j]
        out[n + j] = work.f[j]
    for r in range(m):
        out[2 * n + r] = lam[r] if dropped[r] else work.rows[r]
    out[out.size - 1] = dy[dy.size - 1] - input_power(system, signals, t, q, v, lam, torques, work)


@kernel
def descriptor_jacobian(system, weights, y, dy, c, dropped, torques, work, direction, out):
    """Compute the derivative of `descriptor_residual` by y plus c times that by dy, into out, at its last call.

    `out` is square, with a row for each entry of y; `direction` is scratch.
    """
    n, m = work.f.size, work.rows.size
    q, v, a, lam = y[:n], y[n : 2 * n], dy[n : 2 * n], y[2 * n : 2 * n + m]
    for j in range(y.size):
        fill(out[j], 0.0)
    note_slopes(system, q, v, work.mu, work.compliance, direction)
    for i in range(system.bodies.size):
        for j in range(system.bodies[i].offset, system.bodies[i].offset + 3 + system.bodies[i].nf):
            direction.q[j] = 1.0
            residual_tangent(system, weights, q, v, a, lam, torques, work.compliance, i, i + 1, direction)
            direction.q[j] = 0.0
            fill_column(direction, n, 2 * n, j, out)
            direction.v[j], direction.a[j] = 1.0, c
            residual_tangent(system, weights, q, v, a, lam, torques, work.compliance, i, i + 1, direction)
            direction.v[j], direction.a[j] = 0.0, 0.0
            fill_column(direction, n, 2 * n, n + j, out)
            out[j, j], out[j, n + j] = c, -1.0
    for r in range(m):
        direction.lam[r] = 1.0
        residual_tangent(system, weights, q, v, a, lam, torques, work.compliance, 0, system.bodies.size, direction)
        direction.lam[r] = 0.0
        fill_column(direction, n, 2 * n, 2 * n + r, out)
    drop_rows(dropped, 2 * n, 2 * n, out)
    out[out.shape[0] - 1, out.shape[0] - 1] = c


@routine
def fill_column(direction, first, rows, column, out):
    """Copy the changes of the equations of motion and of the rows to a column of out, from `first` and `rows` on."""
    copy(direction.f, out[first : first + direction.f.size, column])
    copy(direction.rows, out[rows : rows + direction.rows.size, column])


@routine
def drop_rows(dropped, row, column, out):
    """Replace dropped rows, from `row` on in out, by the equation that the multiplier, from `column` on, is zero."""
    for r in range(dropped.size):
        if dropped[r]:
            fill(out[row + r], 0.0)
            out[row + r, column + r] = 1.0


@kernel
def stabilised_residual(system, signals, t, y, dy, dropped, weight, torques, idle, work, direction, phi, dphi, out):
    """Compute the residual of the stabilised form of index 2 in y = (q, v, lambda, mu, work done), into out.

    y, dy, out : (2n + 2m + 1,) arrays; phi, dphi are scratch (m,), `idle` (motors,) is zero.

    The entries are W (q' - v) + Phi_q^T mu, the equations of motion, Phi' and Phi, the power (Gear, Gupta and
    Leimkuhler 1985). W is the diagonal `weight` (n,). Rows that are not constraints replace their Phi', and have no mu.
    """
    n, m = work.f.size, work.rows.size
    q, v, lam, mu = y[:n], y[n : 2 * n], y[2 * n : 2 * n + m], y[2 * n + m : 2 * n + 2 * m]
    descriptor_residual(system, signals, t, INDEX_1, y, dy, dropped, torques, work, out)
    constraint_values(system, signals, t, q, v, work.scratch, phi, dphi)
    for r in range(m):
        free = dropped[r] or system.rows[r].kind != CONSTRAINT
        direction.lam[r] = 0.0 if free else mu[r]
        out[2 * n + m + r] = mu[r] if free else phi[r]
        if not free:
            out[2 * n + r] = dphi[r]
    reaction_tangent(system, PLACES, q, idle, idle, lam, idle, 0, system.bodies.size, direction)
    for j in range(n):
        out[j] = weight[j] * out[j] + direction.f[j]
    fill(direction.lam, 0.0)


@kernel
def stabilised_jacobian(system, y, dy, c, dropped, weight, torques, idle, work, direction, out):
    """Compute the derivative of `stabilised_residual` by y plus c times that by dy, into out, at its last call.

    `out` is square, with a row for each entry of y; `direction` is scratch.
    """
    n, m = work.f.size, work.rows.size
    q, mu = y[:n], y[2 * n + m : 2 * n + 2 * m]
    descriptor_jacobian(system, SPEEDS, y, dy, c, dropped, torques, work, direction, out)
    for i in range(system.bodies.size):
        for j in range(system.bodies[i].offset, system.bodies[i].offset + 3 + system.bodies[i].nf):
            direction.q[j] = 1.0
            reaction_tangent(system, PLACES, q, idle, idle, mu, idle, i, i + 1, direction)
            direction.q[j] = 0.0
            fill_column(direction, 0, 2 * n + m, j, out)
            out[j, j] += weight[j] * c
            out[j, n + j] = -weight[j]
    for r in range(m):
        row = 2 * n + m + r
        if dropped[r] or system.rows[r].kind != CONSTRAINT:
            fill(out[row], 0.0)
            out[row, row] = 1.0
        else:
            direction.lam[r] = 1.0
            reaction_tangent(system, PLACES, q, idle, idle, mu, idle, 0, system.bodies.size, direction)
            direction.lam[r] = 0.0
            fill_column(direction, 0, 2 * n + m, row, out)
