"""The equations as others integrate them: an ODE in (q, v), multipliers eliminated (Eqs. 59-60), with its Jacobian.

A third part is added to (q, v), the work done so far: whoever integrates the motion integrates its power as well.
"""

from __future__ import annotations

from paraflex.kernel.arrays import add, copy, fill
from paraflex.kernel.bodies import system_energy, weight_work
from paraflex.kernel.compiling import kernel, routine
from paraflex.kernel.constraints import constraint_values, note_friction
from paraflex.kernel.factor import factor_bodies
from paraflex.kernel.joints import line_energy, spring_energy
from paraflex.kernel.linear import orient, right_hand_side, solve_system
from paraflex.kernel.packed import CONSTRAINT, INDEX_1
from paraflex.kernel.stage import equations
from paraflex.kernel.step import input_power
from paraflex.kernel.tangent import note_slopes, reaction_tangent, residual_tangent

# b of the factor whose rows of springs and dampers hold their forces and nothing of the accelerations: they divide by
# b and by its square root, and either must be nothing beside 1.
INSTANT_B = 1e-36


@kernel
def accelerations(p, signals, t, weights, q, v, a, lam, torques, ws, dependent_part):
    """Accelerations (n,) and multipliers (m,) at (t, q, v), into a and lam; the factor stays in ws.

    Returns
    -------
    int
        How many rows depend on others here, with less than `dependent_part` of their squares left: multipliers zero.
    """
    fill(a, 0.0)
    fill(lam, 0.0)
    note_friction(p, q, v, ws.mu, ws.compliance)
    factor_bodies(p, 0.0, q, ws)
    ws.step[0] = INSTANT_B
    dependent = orient(p, q, ws, dependent_part)
    # Linear in a and lambda with this very matrix: the second pass only removes rounding.
    for _ in range(2):
        equations(p, signals, t, weights, q, v, a, lam, torques, ws)
        right_hand_side(p, ws, 1.0)
        solve_system(p, ws, ws.x, ws.mu)
        add(ws.x, a)
        add(ws.mu, lam)
    return dependent


@kernel
def rates(p, signals, t, weights, y, a, lam, torques, ws, dependent_part, dy):
    """Derivative of y = (q, v, work) into dy; a and lam are left as `accelerations` has them. Dependent rows."""
    n = a.size
    q, v = y[:n], y[n : 2 * n]
    dependent = accelerations(p, signals, t, weights, q, v, a, lam, torques, ws, dependent_part)
    for j in range(n):
        dy[j] = v[j]
        dy[n + j] = a[j]
    dy[2 * n] = input_power(p, signals, t, q, v, lam, torques, ws)
    return dependent


@kernel
def stored_energy(p, q, v, lam, scratch):
    """Kinetic energy, strain energy with that of springs, and what gravity has done: see `bodies.weight_work`."""
    kinetic, strain = system_energy(p, q, v, scratch)
    strain += spring_energy(p, lam) + line_energy(p, q, v)[0]
    return kinetic, strain, weight_work(p, q, scratch)


@kernel
def rates_jacobian(p, weights, y, a, lam, torques, ws, d, out):
    """Derivative of `rates` by y, into out (2n + 1, 2n + 1), at the y it was last called with.

    The accelerations change by -[M, J^T; J, -C]^-1 (dF, dG). The row of the power is left zero: Newton's iteration
    finds work from motion, one iteration behind.
    """
    n = a.size
    q, v = y[:n], y[n : 2 * n]
    for j in range(2 * n + 1):
        fill(out[j], 0.0)
    note_slopes(p, q, v, ws.mu, ws.compliance, d)
    for i in range(p.bodies.size):
        for j in range(p.bodies[i].offset, p.bodies[i].offset + 3 + p.bodies[i].nf):
            for part in range(2):
                direction = d.q if part == 0 else d.v
                direction[j] = 1.0
                residual_tangent(p, weights, q, v, a, lam, torques, ws.compliance, i, i + 1, d)
                direction[j] = 0.0
                copy(d.f, ws.f)
                copy(d.rows, ws.rows)
                right_hand_side(p, ws, 1.0)
                solve_system(p, ws, ws.x, ws.mu)
                column = part * n + j
                for k in range(n):
                    out[n + k, column] = ws.x[k]
            out[j, n + j] = 1.0


@kernel
def descriptor_residual(p, signals, t, weights, y, dy, dropped, torques, ws, out):
    """Residual of the equations as a DAE of index 1 in y = (q, v, lambda, work), into out.

    q' - v, then those of `equations` with v' as the acceleration, then work' less the power. `dropped` (m,) says which
    rows follow from others: their multipliers are zero.
    """
    n, m = ws.f.size, ws.rows.size
    q, v, a, lam = y[:n], y[n : 2 * n], dy[n : 2 * n], y[2 * n : 2 * n + m]
    note_friction(p, q, v, ws.mu, ws.compliance)
    equations(p, signals, t, weights, q, v, a, lam, torques, ws)
    for j in range(n):
        out[j] = dy[j] - v[j]
        out[n + j] = ws.f[j]
    for r in range(m):
        out[2 * n + r] = lam[r] if dropped[r] else ws.rows[r]
    out[2 * n + m] = dy[2 * n + m] - input_power(p, signals, t, q, v, lam, torques, ws)


@kernel
def descriptor_jacobian(p, weights, y, dy, c, dropped, torques, ws, d, out):
    """Derivative of `descriptor_residual` by y plus c times that by dy, into out, where it was last called."""
    n, m = ws.f.size, ws.rows.size
    q, v, a, lam = y[:n], y[n : 2 * n], dy[n : 2 * n], y[2 * n : 2 * n + m]
    for j in range(2 * n + m + 1):
        fill(out[j], 0.0)
    note_slopes(p, q, v, ws.mu, ws.compliance, d)
    for i in range(p.bodies.size):
        for j in range(p.bodies[i].offset, p.bodies[i].offset + 3 + p.bodies[i].nf):
            d.q[j] = 1.0
            residual_tangent(p, weights, q, v, a, lam, torques, ws.compliance, i, i + 1, d)
            d.q[j] = 0.0
            fill_column(d, j, out)
            d.v[j], d.a[j] = 1.0, c
            residual_tangent(p, weights, q, v, a, lam, torques, ws.compliance, i, i + 1, d)
            d.v[j], d.a[j] = 0.0, 0.0
            fill_column(d, n + j, out)
            out[j, j], out[j, n + j] = c, -1.0
    for r in range(m):
        d.lam[r] = 1.0
        residual_tangent(p, weights, q, v, a, lam, torques, ws.compliance, 0, p.bodies.size, d)
        d.lam[r] = 0.0
        fill_column(d, 2 * n + r, out)
    drop_rows(dropped, 2 * n, 2 * n, out)
    out[2 * n + m, 2 * n + m] = c


@routine
def fill_column(d, column, out):
    """The changes of the equations of motion and of the rows into a column of out, below n rows."""
    n = d.f.size
    for k in range(n):
        out[n + k, column] = d.f[k]
    for r in range(d.rows.size):
        out[2 * n + r, column] = d.rows[r]


@routine
def drop_rows(dropped, row, column, out):
    """Where a row is dropped, from `row` on, let out say that its multiplier, from `column` on, is zero."""
    for r in range(dropped.size):
        if dropped[r]:
            fill(out[row + r], 0.0)
            out[row + r, column + r] = 1.0


@kernel
def stabilised_residual(p, signals, t, y, dy, dropped, weight, torques, idle, ws, d, phi, dphi, out):
    """Residual of the stabilised form of index 2 in y = (q, v, lambda, mu, work), into out.

    W (q' - v) + Phi_q^T mu, the equations of motion, Phi' and Phi, the power (Gear, Gupta and Leimkuhler 1985). W is
    the diagonal `weight` (n,). Rows that are no constraints stand in place of their Phi', and have no mu.
    """
    n, m = ws.f.size, ws.rows.size
    q, v, a = y[:n], y[n : 2 * n], dy[n : 2 * n]
    lam, mu = y[2 * n : 2 * n + m], y[2 * n + m : 2 * n + 2 * m]
    note_friction(p, q, v, ws.mu, ws.compliance)
    equations(p, signals, t, INDEX_1, q, v, a, lam, torques, ws)
    constraint_values(p, signals, t, q, v, ws.scratch, phi, dphi)
    for r in range(m):
        free = dropped[r] or p.rows[r].kind != CONSTRAINT
        d.lam[r] = 0.0 if free else mu[r]
        out[2 * n + m + r] = mu[r] if free else phi[r]
        out[2 * n + r] = dphi[r] if p.rows[r].kind == CONSTRAINT else ws.rows[r]
        if dropped[r]:
            out[2 * n + r] = lam[r]
    reaction_tangent(p, (0.0, 0.0, 1.0), q, idle, idle, lam, idle, 0, p.bodies.size, d)
    for j in range(n):
        out[j] = weight[j] * (dy[j] - v[j]) + d.f[j]
        out[n + j] = ws.f[j]
    fill(d.lam, 0.0)
    out[2 * n + 2 * m] = dy[2 * n + 2 * m] - input_power(p, signals, t, q, v, lam, torques, ws)


@kernel
def stabilised_jacobian(p, y, dy, c, dropped, weight, torques, idle, ws, d, out):
    """Derivative of `stabilised_residual` by y plus c times that by dy, into out, where it was last called."""
    n, m = ws.f.size, ws.rows.size
    q, v, a = y[:n], y[n : 2 * n], dy[n : 2 * n]
    lam, mu = y[2 * n : 2 * n + m], y[2 * n + m : 2 * n + 2 * m]
    speeds, places = (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    for j in range(2 * n + 2 * m + 1):
        fill(out[j], 0.0)
    note_slopes(p, q, v, ws.mu, ws.compliance, d)
    for i in range(p.bodies.size):
        for j in range(p.bodies[i].offset, p.bodies[i].offset + 3 + p.bodies[i].nf):
            d.q[j] = 1.0
            residual_tangent(p, speeds, q, v, a, lam, torques, ws.compliance, i, i + 1, d)
            fill_column(d, j, out)
            reaction_tangent(p, places, q, idle, idle, mu, idle, i, i + 1, d)
            d.q[j] = 0.0
            fill_reactions(d, j, out)
            d.v[j], d.a[j] = 1.0, c
            residual_tangent(p, speeds, q, v, a, lam, torques, ws.compliance, i, i + 1, d)
            d.v[j], d.a[j] = 0.0, 0.0
            fill_column(d, n + j, out)
            out[j, j] += weight[j] * c
            out[j, n + j] = -weight[j]
    for r in range(m):
        d.lam[r] = 1.0
        residual_tangent(p, speeds, q, v, a, lam, torques, ws.compliance, 0, p.bodies.size, d)
        fill_column(d, 2 * n + r, out)
        if not dropped[r] and p.rows[r].kind == CONSTRAINT:
            reaction_tangent(p, places, q, idle, idle, mu, idle, 0, p.bodies.size, d)
            fill_reactions(d, 2 * n + m + r, out)
        else:
            fill(out[2 * n + m + r], 0.0)
        d.lam[r] = 0.0
    for r in range(m):
        if dropped[r] or p.rows[r].kind != CONSTRAINT:
            fill(out[2 * n + m + r], 0.0)
            out[2 * n + m + r, 2 * n + m + r] = 1.0
    drop_rows(dropped, 2 * n, 2 * n, out)
    out[2 * n + 2 * m, 2 * n + 2 * m] = c


@routine
def fill_reactions(d, column, out):
    """The changes of Phi_q^T mu and of Phi into a column of out."""
    n, m = d.f.size, d.rows.size
    for k in range(n):
        out[k, column] = d.f[k]
    for r in range(m):
        out[2 * n + m + r, column] = d.rows[r]
