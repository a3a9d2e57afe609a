"""The time loop of an ESDIRK scheme: steps, error control, dense output. A tableau is data.

A diagonally implicit scheme with explicit first stage and stiffly accurate last one: stage i stands at
q_i = q_n + h sum_j A_ij v_j and v_i = v_n + h sum_j A_ij a_j, its own v_i and a_i among them, and the last stage is
the new step's first. The error estimate is filtered through the iteration matrix (Hosea and Shampine 1996): without
that an undamped axial mode would dictate the step.
"""

from __future__ import annotations

from math import isfinite

from paraflex.kernel.arrays import copy, fill
from paraflex.kernel.bodies import system_energy
from paraflex.kernel.compiling import inlined, kernel, routine
from paraflex.kernel.joints import constraint_values, marker_angle
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
    BALANCE,
    DPHI_MAX,
    ENERGY_0,
    ERROR_TEST,
    FACTOR_G,
    FACTORS,
    FAILURES,
    FINISHED,
    ITERATIONS,
    NO_CONVERGENCE,
    NOT_FINITE,
    PAUSED,
    PHI_MAX,
    RATE,
    REJECTED,
    SAMPLE,
    SINGULAR,
    STEP,
    STEPS,
    STOP,
    TIME,
    WORK,
)
from paraflex.kernel.signals import evaluate_signal
from paraflex.kernel.stage import CONVERGED, WORST_RATE, equations, solve_stage

SAFETY, MIN_FACTOR, MAX_FACTOR = 0.8, 0.2, 2.0
# A new step this close to the old one is not worth a new factorisation.
KEEP_ABOVE, KEEP_BELOW = 0.92, 1.2
# A stage that takes more iterations than this asks for a new factor, once the old one has served a few steps.
ENOUGH_ITERATIONS, SERVED = 2, 5
# Steps after which the factor that filters velocity errors is renewed; it serves a norm, so an old one will do.
SLOW_AGE = 25
# The smallest step, as a fraction of the time span.
MIN_STEP = 1e-12


@routine
def input_power(p, signals, t, q, v, lam, torques):
    """Power of the motors and of prescribed motion."""
    total = 0.0
    for k in range(p.efforts.size):
        effort = p.efforts[k]
        total += effort.sign * torques[effort.signal] * marker_angle(p, p.markers[effort.marker], v)
    for r in range(p.rows.size):
        if p.rows[r].signal >= 0:
            _, rate, _ = evaluate_signal(signals, p.rows[r].signal, t)
            total -= lam[r] * rate
    return total


@inlined
def interpolate(q0, v0, a0, q1, v1, a1, h, x):
    """Cubic Hermite q and v at fraction x of an interval h, and the derivative of v as a."""
    y = 1.0 - x
    h00, h10, h01, h11 = (1.0 + 2.0 * x) * y * y, x * y * y, x * x * (3.0 - 2.0 * x), -x * x * y
    d00, d10, d11 = -6.0 * x * y, y * (1.0 - 3.0 * x), x * (3.0 * x - 2.0)
    q = h00 * q0 + h01 * q1 + h * (h10 * v0 + h11 * v1)
    v = h00 * v0 + h01 * v1 + h * (h10 * a0 + h11 * a1)
    a = d00 * (v0 - v1) / h + d10 * a0 + d11 * a1
    return q, v, a


@routine
def write_samples(p, tableau, t, h, m, out):
    """Fill every sample time within the accepted step from t to t + h."""
    piece = 0
    i = m.counts[SAMPLE]
    while i < out.times.size and out.times[i] <= t + h * (1.0 + 1e-12):
        time = out.times[i]
        while piece < tableau.dense.size - 2 and time > t + tableau.c[tableau.dense[piece + 1]] * h:
            piece += 1
        s0, s1 = tableau.dense[piece], tableau.dense[piece + 1]
        width = (tableau.c[s1] - tableau.c[s0]) * h
        x = min(max((time - t - tableau.c[s0] * h) / width, 0.0), 1.0)
        for j in range(m.q.size):
            out.q[i, j], out.v[i, j], out.a[i, j] = interpolate(
                m.stage_q[s0, j], m.stage_v[s0, j], m.stage_a[1, s0, j],
                m.stage_q[s1, j], m.stage_v[s1, j], m.stage_a[1, s1, j], width, x,
            )  # fmt: skip
        for r in range(m.stage_lam.shape[1]):
            out.lam[i, r] = (1.0 - x) * m.stage_lam[s0, r] + x * m.stage_lam[s1, r]
        out.energy[i, 0], out.energy[i, 1] = system_energy(p, out.q[i], out.v[i])
        # Work by the trapezoidal rule within the step: the sum over whole steps is the scheme's own quadrature.
        done = (time - t) / h
        out.energy[i, 2] = m.clock[WORK] + h * done * (
            (1.0 - 0.5 * done) * m.power[0] + 0.5 * done * m.power[m.power.size - 1]
        )
        i += 1
    m.counts[SAMPLE] = i


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
def first_stage(p, signals, t, controls, m, ws):
    """Accelerations and multipliers at (t, q, v), solved exactly, as the first stage; number of dependent rows."""
    a, lam = m.stage_a[1, 0], m.stage_lam[0]
    dependent = factor_system(p, 0.0, m.q, ws)
    m.clock[FACTOR_G] = -1.0
    # Linear in a and lambda with this very matrix: the second pass only removes rounding.
    for _ in range(2):
        equations(p, signals, t, controls.alpha, controls.beta, m.q, m.v, a, lam, m.torques, ws)
        for j in range(a.size):
            ws.x[j] = -ws.f[j]
        for r in range(lam.size):
            ws.mu[r] = -ws.rows[r]
        solve_system(p, ws, ws.x, ws.mu)
        for j in range(a.size):
            a[j] += ws.x[j]
        for r in range(lam.size):
            lam[r] += ws.mu[r]
    return dependent


@kernel
def start(p, signals, tableau, controls, m, ws, out):
    """First stage and first sample of a run."""
    t = m.clock[TIME]
    if first_stage(p, signals, t, controls, m, ws) > controls.dependent_rows:
        return SINGULAR
    a, lam = m.stage_a[1, 0], m.stage_lam[0]
    m.stage_t[1, 0] = t
    copy(m.q, m.stage_q[0])
    copy(m.v, m.stage_v[0])
    m.power[0] = input_power(p, signals, t, m.q, m.v, lam, m.torques)
    kinetic, strain = system_energy(p, m.q, m.v)
    m.clock[ENERGY_0] = kinetic + strain
    note_constraints(p, signals, t, m, ws)
    if out.times.size > 0 and out.times[0] <= t:
        copy(m.q, out.q[0])
        copy(m.v, out.v[0])
        copy(a, out.a[0])
        copy(lam, out.lam[0])
        out.energy[0, 0], out.energy[0, 1], out.energy[0, 2] = kinetic, strain, 0.0
        m.counts[SAMPLE] = 1
    return PAUSED


@routine
def note_constraints(p, signals, t, m, ws):
    """Keep the largest constraint violation seen at accepted steps."""
    constraint_values(p, signals, t, m.q, m.v, ws.rows, ws.mu)
    for r in range(ws.rows.size):
        m.clock[PHI_MAX] = max(m.clock[PHI_MAX], abs(ws.rows[r]))
        m.clock[DPHI_MAX] = max(m.clock[DPHI_MAX], abs(ws.mu[r]))


@routine
def filtered_error(p, tableau, h, controls, m, ws, slow):
    """Error of the step in the mass norm, in position and by what its velocity error does later: (metres, metres).

    The velocity error is filtered once more, as if by a step as long as `memory`: what is left of it is the part that
    no elastic force turns round, and that moves the mechanism by memory times its size before the run ends.

    With J the Jacobian of the index-1 equations, (1 - g J) eps = e gives eps_q = e_q + g eps_v and
    (M + b K) eps_v + Phi_q^T mu = M e_v - g K e_q, Phi_q eps_v = (Phi_q e_v - beta^2 g Phi_q e_q) / scale.
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
        jacobian_times(p, i, ws, ws.x, 1.0 / scale, ws.mu)
        jacobian_times(p, i, ws, ws.f, -controls.beta * controls.beta * g / scale, ws.mu)
        mass_times(p, i, ws, ws.x)
        e = body.offset + 3
        for j in range(body.nf):
            ws.x[e + j] -= g * p.modal[OMEGA2, body.flex + j] * eq[e + j]
        to_ground_frame(p, i, ws, ws.x)
    solve_system(p, ws, ws.x, ws.mu)


@routine
def renew_factor(p, g, m, ws):
    """Factor the bodies for stages of this g at the present deformation."""
    factor_bodies(p, g * g, m.q, ws)
    m.counts[FACTORS] += 1
    m.clock[FACTOR_G], m.clock[RATE], m.counts[AGE] = g, WORST_RATE, 0


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
    if orient(p, m.q, ws) > controls.dependent_rows:
        return SINGULAR, 0.0
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
            if orient(p, m.q, ws) > controls.dependent_rows:
                return SINGULAR, 0.0
            fresh = True
            continue
        slowest = max(slowest, iterations)
        copy(ws.q, m.stage_q[i])
        copy(ws.v, m.stage_v[i])
        m.power[i] = input_power(p, signals, m.stage_t[1, i], ws.q, ws.v, m.stage_lam[i], m.torques)
        i += 1
    error_q, error_v = filtered_error(p, tableau, h, controls, m, ws, slow)
    if slowest > ENOUGH_ITERATIONS and m.counts[AGE] >= SERVED:
        m.clock[FACTOR_G] = -1.0
    error = max(error_q, error_v) / (controls.rate * h)
    if not isfinite(error):
        return NOT_FINITE, 0.0
    return PAUSED, error


@routine
def accept(p, signals, tableau, t, h, m, ws, out):
    """Take the step: move on, sample, count, and keep the stages for the next starting guess."""
    last = tableau.c.size - 1
    write_samples(p, tableau, t, h, m, out)
    copy(m.stage_q[last], m.q)
    copy(m.stage_v[last], m.v)
    for s in range(last + 1):
        m.clock[WORK] += h * tableau.A[last, s] * m.power[s]
    copy(m.stage_t[1], m.stage_t[0])
    for s in range(last + 1):
        copy(m.stage_a[1, s], m.stage_a[0, s])
    m.stage_t[1, 0] = t + h
    copy(m.q, m.stage_q[0])
    copy(m.v, m.stage_v[0])
    copy(m.stage_a[0, last], m.stage_a[1, 0])
    copy(m.stage_lam[last], m.stage_lam[0])
    m.power[0] = m.power[last]
    m.counts[STEPS] += 1
    m.counts[AGE] += 1
    m.counts[FAILURES] = 0
    kinetic, strain = system_energy(p, m.q, m.v)
    balance = abs(kinetic + strain - m.clock[ENERGY_0] - m.clock[WORK])
    m.clock[BALANCE] = max(m.clock[BALANCE], balance)
    note_constraints(p, signals, t + h, m, ws)


@kernel
def march(p, signals, tableau, controls, stops, max_steps, m, ws, slow, out):
    """Advance by up to max_steps attempted steps, ending steps exactly at each of the times in `stops`.

    Returns
    -------
    int
        PAUSED, FINISHED, or why it cannot go on.
    """
    exponent = 1.0 / tableau.order
    span = stops[stops.size - 1]
    for _ in range(max_steps):
        t = m.clock[TIME]
        while m.counts[STOP] < stops.size and stops[m.counts[STOP]] <= t:
            m.counts[STOP] += 1
        if m.counts[STOP] == stops.size:
            return FINISHED
        left = stops[m.counts[STOP]] - t
        h = min(m.clock[STEP], controls.max_step)
        landing = False
        if left <= h * (1.0 + 1e-9):
            h, landing = left, True
        elif left < 2.0 * h:
            h = 0.5 * left
        cause, error = attempt(p, signals, tableau, controls, t, h, m, ws, slow)
        if cause == PAUSED and error <= 1.0:
            after_failure = m.counts[FAILURES] > 0
            accept(p, signals, tableau, t, h, m, ws, out)
            m.clock[TIME] = stops[m.counts[STOP]] if landing else t + h
            factor = min(MAX_FACTOR, SAFETY * (1.0 / max(error, 1e-12)) ** exponent)
            # Keep the step, and with it the factor, unless the change is worth it; a step cut short to land on a stop
            # says nothing about longer ones.
            if factor < KEEP_ABOVE or (factor > KEEP_BELOW and h >= m.clock[STEP] and not after_failure):
                m.clock[STEP] = factor * h
            continue
        m.counts[REJECTED] += 1
        if m.counts[FAILURES] == 1:
            # The first stage is the last step's last, with the error its longer step could bear: not so a shorter one.
            first_stage(p, signals, t, controls, m, ws)
        m.counts[FAILURES] += 1
        if cause == PAUSED:
            cause = ERROR_TEST
            m.clock[STEP] = h * max(MIN_FACTOR, SAFETY * (1.0 / error) ** exponent)
        else:
            m.clock[STEP] = h * MIN_FACTOR
        if m.clock[STEP] < MIN_STEP * span:
            return cause
    return PAUSED
