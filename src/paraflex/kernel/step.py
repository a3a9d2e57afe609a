"""One step of an ESDIRK scheme: its stages and the error estimate. A tableau is data.

A diagonally implicit scheme with explicit first stage and stiffly accurate last one: stage i stands at
q_i = q_n + h sum_j A_ij v_j and v_i = v_n + h sum_j A_ij a_j, its own v_i and a_i among them, and the last stage is
the new step's first. The error estimate is filtered through the iteration matrix (Hosea and Shampine 1996): without
that an undamped axial mode would dictate the step.
"""

from __future__ import annotations

from math import isfinite

from paraflex.kernel.arrays import copy, fill
from paraflex.kernel.axes import axis_power
from paraflex.kernel.bending import note_all_axial_forces, subtract_geometric
from paraflex.kernel.compiling import routine
from paraflex.kernel.constraints import dissipated_power, note_friction
from paraflex.kernel.joints import line_energy, load_power, marker_angle, modal_damping_power
from paraflex.kernel.linear import (
    factor_bodies,
    factor_system,
    jacobian_times,
    mass_norm,
    mass_times,
    orient,
    solve_system,
    to_body_frame,
    to_ground_frame,
)
from paraflex.kernel.packed import OMEGA2
from paraflex.kernel.run_state import (
    AGE,
    FACTOR_G,
    FACTORS,
    ITERATIONS,
    NO_CONVERGENCE,
    NOT_FINITE,
    PASSAGES,
    PAUSED,
    RATE,
    STEPS,
)
from paraflex.kernel.signals import evaluate_signal
from paraflex.kernel.stage import CONVERGED, WORST_RATE, solve_stage

# A stage that takes more iterations than this asks for a new factor, once the old one has served a few steps.
ENOUGH_ITERATIONS, SERVED = 2, 5
# Steps after which the factor that filters velocity errors is renewed; it serves a norm, so an old one will do.
SLOW_AGE = 25


@routine
def input_power(p, signals, t, q, v, lam, torques, ws):
    """Power of the motors, of prescribed motion and of loads, less what dampers, friction and damping take."""
    total = load_power(p, q, v) + axis_power(p, q, v, torques) - line_energy(p, q, v)[1]
    total -= dissipated_power(p, q, v, lam, ws.mu) + modal_damping_power(p, v)
    for k in range(p.efforts.size):
        effort = p.efforts[k]
        total += effort.sign * torques[effort.signal] * marker_angle(p, p.markers[effort.marker], v)
    for r in range(p.rows.size):
        if p.rows[r].signal >= 0:
            _, rate, _ = evaluate_signal(signals, p.rows[r].signal, t)
            total -= lam[r] * rate
    return total


@routine
def predict(tableau, i, t, h, m):
    """Starting guess for stage i: the accelerations of the last three stages, extrapolated."""
    stages = tableau.c.size
    a, times, rows = m.stage_a[1, i], m.guess_t, m.guess_s
    found = 0
    for j in range(i - 1, -1, -1):
        if found < 3:
            times[found], rows[found, 0], rows[found, 1] = m.stage_t[1, j], 1, j
            found += 1
    if m.counts[STEPS] > 0:
        for j in range(stages - 2, -1, -1):
            if found < 3:
                times[found], rows[found, 0], rows[found, 1] = m.stage_t[0, j], 0, j
                found += 1
    x = t + tableau.c[i] * h
    fill(a, 0.0)
    for k in range(found):
        weight = 1.0
        for l in range(found):
            if l != k:
                weight *= (x - times[l]) / (times[k] - times[l])
        source = m.stage_a[rows[k, 0], rows[k, 1]]
        for j in range(a.size):
            a[j] += weight * source[j]


@routine
def filtered_error(p, tableau, h, controls, m, ws, slow):
    """Error of the step in the mass norm, in position and by what its velocity error does later: (metres, metres).

    The velocity error is filtered once more, as if by a step as long as `memory`: what is left of it is the part that
    no elastic force turns round, and that moves the mechanism by memory times its size before the run ends.

    With J the Jacobian of the index-1 equations, (1 - g J) eps = e gives eps_q = e_q + g eps_v and
    (M + g D + b K) eps_v + Phi_q^T mu = M e_v - g K e_q, Phi_q eps_v = (Phi_q e_v - beta^2 g Phi_q e_q) / scale,
    for springs J eps_v - C mu / b = -J e_q / g and for dampers J eps_v - C mu / g = 0, with b = g^2.
    """
    stages = tableau.c.size
    g = tableau.A[stages - 1, stages - 1] * h
    for j in range(m.q.size):
        m.eq[j] = 0.0
        m.ev[j] = 0.0
    for s in range(stages):
        weight = h * tableau.error[s]
        for j in range(m.q.size):
            m.eq[j] += weight * m.stage_v[s, j]
            m.ev[j] += weight * m.stage_a[1, s, j]
    filter_error(p, g, controls, m.eq, m.ev, ws)
    for j in range(m.q.size):
        m.eq[j] += g * ws.x[j]
    position = mass_norm(p, ws, m.eq)
    if m.counts[STEPS] % SLOW_AGE == 0:
        note_friction(p, m.q, m.v, slow.mu, slow.compliance)
        factor_system(p, controls.memory * controls.memory, m.q, slow)
    for j in range(m.q.size):
        m.eq[j] = 0.0
        m.ev[j] = ws.x[j]
    filter_error(p, controls.memory, controls, m.eq, m.ev, slow)
    return position, controls.memory * mass_norm(p, slow, slow.x)


@routine
def filter_error(p, g, controls, eq, ev, ws):
    """eps_v of (1 - g J) eps = (e_q, e_v) into ws.x, with the factor in ws made for b = g^2."""
    scale = 1.0 + 2.0 * controls.alpha * g + controls.beta * controls.beta * g * g
    for j in range(eq.size):
        ws.x[j] = ev[j]
        ws.f[j] = eq[j]
    fill(ws.mu, 0.0)
    for i in range(p.bodies.size):
        body = p.bodies[i]
        to_body_frame(p, i, ws, ws.x)
        to_body_frame(p, i, ws, ws.f)
        jacobian_times(p, i, ws, ws.x, 1.0 / scale, 0.0, 0.0, ws.mu)
        jacobian_times(p, i, ws, ws.f, -controls.beta * controls.beta * g / scale, -1.0 / g, 0.0, ws.mu)
        mass_times(p, i, ws, ws.mass, ws.x)
        e = body.offset + 3
        for j in range(body.nf):
            ws.x[e + j] -= g * p.modal[OMEGA2, body.flex + j] * eq[e + j]
        subtract_geometric(p, i, ws.geometric, g, eq, ws.x)
        to_ground_frame(p, i, ws, ws.x)
    solve_system(p, ws, ws.x, ws.mu)


@routine
def renew_factor(p, g, m, ws):
    """Factor the bodies for stages of this g at the present deformation."""
    note_all_axial_forces(p, m.q, m.v, m.stage_a[1, 0], m.stage_lam[0], ws, ws.geometric)
    factor_bodies(p, g * g, m.q, ws)
    m.counts[FACTORS] += 1
    m.clock[FACTOR_G], m.clock[RATE], m.counts[AGE] = g, WORST_RATE, 0


@routine
def note_passage(t, h, m):
    """Keep from when to when a run is at a singular position; steps that touch are of one."""
    last = m.counts[PASSAGES] - 1
    if last >= 0:
        if t <= m.passages[1, last]:
            m.passages[1, last] = max(t + h, m.passages[1, last])
            return
    if last + 1 < m.passages.shape[1]:
        m.passages[0, last + 1], m.passages[1, last + 1] = t, t + h
        m.counts[PASSAGES] += 1


@routine
def attempt(p, signals, tableau, controls, t, h, m, ws, slow):
    """One step from t: all stages and the error estimate, relative to what is allowed.

    Returns
    -------
    cause, error
        cause is PAUSED where the stages were solved.
    """
    stages = tableau.c.size
    g = tableau.A[stages - 1, stages - 1] * h
    b = g * g
    fresh = m.clock[FACTOR_G] != g
    if fresh:
        renew_factor(p, g, m, ws)
    note_friction(p, m.q, m.v, ws.mu, ws.compliance)
    # Rows that depend on others here keep their multipliers: so a singular position is passed.
    if orient(p, m.q, ws, controls.dependent_part) > controls.dependent_rows:
        note_passage(t, h, m)
    tolerance = controls.newton_fraction * controls.rate * h
    slowest = 0
    i = 1
    while i < stages:
        for j in range(m.q.size):
            m.vs[j] = m.v[j]
            m.qs[j] = m.q[j]
        for s in range(i):
            weight = h * tableau.A[i, s]
            for j in range(m.q.size):
                m.vs[j] += weight * m.stage_a[1, s, j]
                m.qs[j] += weight * m.stage_v[s, j]
        for j in range(m.q.size):
            m.qs[j] += g * m.vs[j]
        m.stage_t[1, i] = t + tableau.c[i] * h
        predict(tableau, i, t, h, m)
        copy(m.stage_lam[i - 1], m.stage_lam[i])
        status, iterations, rate = solve_stage(
            p, signals, m.stage_t[1, i], g, b, controls.alpha, controls.beta, m.qs, m.vs,
            m.stage_a[1, i], m.stage_lam[i], m.torques, tolerance, controls.newton_memory, m.clock[RATE], ws,
        )  # fmt: skip
        m.counts[ITERATIONS] += iterations
        m.clock[RATE] = rate
        if status != CONVERGED:
            if fresh:
                return NO_CONVERGENCE, 0.0
            # An old factor may be to blame: once more with a new one before the step is cut.
            renew_factor(p, g, m, ws)
            orient(p, m.q, ws, controls.dependent_part)
            fresh = True
            continue
        slowest = max(slowest, iterations)
        copy(ws.q, m.stage_q[i])
        copy(ws.v, m.stage_v[i])
        m.power[i] = input_power(p, signals, m.stage_t[1, i], ws.q, ws.v, m.stage_lam[i], m.torques, ws)
        i += 1
    error_q, error_v = filtered_error(p, tableau, h, controls, m, ws, slow)
    if slowest > ENOUGH_ITERATIONS and m.counts[AGE] >= SERVED:
        m.clock[FACTOR_G] = -1.0
    error = max(error_q, error_v) / (controls.rate * h)
    if not isfinite(error):
        return NOT_FINITE, 0.0
    return PAUSED, error
