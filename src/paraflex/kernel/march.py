"""The time loop: steps accepted or not, their size, energy, dense output."""

from __future__ import annotations

from math import ceil, sqrt

from paraflex.kernel.arrays import add, copy, fill
from paraflex.kernel.bodies import system_energy, weight_work
from paraflex.kernel.compiling import inlined, lasting, routine, seldom
from paraflex.kernel.constraints import constraint_values, note_friction
from paraflex.kernel.factor import factor_bodies
from paraflex.kernel.joints import line_energy, spring_energy
from paraflex.kernel.linear import SINGULAR_PART, orient, right_hand_side, solve_system
from paraflex.kernel.metric import mass_norm
from paraflex.kernel.near import note_crossing
from paraflex.kernel.newmark import restart_algorithmic
from paraflex.kernel.packed import INDEX_1
from paraflex.kernel.projection import project
from paraflex.kernel.run_state import (
    BALANCE,
    BAUMGARTE,
    DPHI_MAX,
    DRIFTED,
    ENERGY_0,
    ENTERS,
    ERROR_TEST,
    FACTOR_B,
    FAILURES,
    FINISHED,
    HELD_END,
    LAST_ERROR,
    LAST_STEP,
    NEAR,
    PART,
    PART_END,
    PAUSED,
    PHI_MAX,
    PREPARED,
    PROJECTION,
    REJECTED,
    ROOT_STEP,
    SAMPLE,
    SLOPE,
    STEP,
    STEPS,
    STOP,
    TIME,
    WEIGHT_0,
    WIDEST,
    WORK,
)
from paraflex.kernel.stage import equations
from paraflex.kernel.step import attempt, input_power

SAFETY, MIN_FACTOR, MAX_FACTOR = 0.8, 0.2, 2.0
# Errors of vibrations rise and fall within a period: the error before has a say as well (Gustafsson 1994). None counts
# as smaller than this part of what is allowed.
BY_ERROR, BY_LAST_ERROR, SMALLEST_ERROR = 0.7, 0.4, 1e-3
# A new step this close to the old one is not worth a new factorisation.
KEEP_ABOVE, KEEP_BELOW = 0.92, 1.2
# A run comes near a singular position no further off the constraints than this many times the error allowed there.
ENTRY = 100.0
# Near a singular position the change in a step, of the root of what the row nearest to dependence has left.
LEAST_PACE = 3e-3
# There a step with an error so small, as part of what is allowed, may be twice as long.
GROWING = 0.05
# A fixed step in which Newton's iteration does not converge is divided, and its parts down to this part of it.
SMALLEST_PART = 1e-4


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
def write_samples(p, tableau, t, h, m, ws, out):
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
        interpolate_multipliers(tableau, (time - t) / h, m, out.lam[i])
        out.energy[i, 0], out.energy[i, 1] = system_energy(p, out.q[i], out.v[i], ws.scratch)
        out.energy[i, 1] += spring_energy(p, out.lam[i]) + line_energy(p, out.q[i], out.v[i])[0]
        # Within the step by the cubic with the power at its ends; over the whole step by the scheme's own quadrature.
        done, last = min(max((time - t) / h, 0.0), 1.0), m.power.size - 1
        left = 1.0 - done
        out.energy[i, 2] = m.clock[WORK] + done * done * (3.0 - 2.0 * done) * step_work(tableau, h, m)
        out.energy[i, 2] += h * done * left * (left * m.power[0] - done * m.power[last])
        out.energy[i, 2] += weight_work(p, out.q[i], ws.scratch) - m.clock[WEIGHT_0]
        i += 1
    m.counts[SAMPLE] = i


@routine
def step_work(tableau, h, m):
    """Work done in the step, by the scheme's own quadrature."""
    last, work = tableau.c.size - 1, 0.0
    for s in range(last + 1):
        work += h * tableau.A[last, s] * m.power[s]
    return work


@routine
def interpolate_multipliers(tableau, x, m, lam):
    """Multipliers at fraction x of the step: the polynomial through those at the nodes."""
    fill(lam, 0.0)
    for k in tableau.nodes:
        weight = 1.0
        for l in tableau.nodes:
            if l != k:
                weight *= (x - tableau.c[l]) / (tableau.c[k] - tableau.c[l])
        for r in range(lam.size):
            lam[r] += weight * m.stage_lam[k, r]


@routine
def first_stage(p, signals, t, controls, m, ws):
    """Accelerations and multipliers at (t, q, v), solved exactly, as the first stage."""
    a, lam = m.stage_a[1, 0], m.stage_lam[0]
    note_friction(p, m.q, m.v, ws.mu, ws.compliance)
    factor_bodies(p, 0.0, m.q, ws)
    orient(p, m.q, ws, controls.dependent_part)
    m.clock[FACTOR_B] = -1.0
    if ws.least[0] < SINGULAR_PART and m.counts[STEPS] > 0:
        return
    weights = INDEX_1
    if controls.treatment == BAUMGARTE and controls.gain == 0.0:
        weights = (1.0, 2.0 * controls.alpha, controls.beta * controls.beta)
    # Linear in a and lambda with this very matrix: the second pass only removes rounding.
    for _ in range(2):
        equations(p, signals, t, weights, m.q, m.v, a, lam, m.torques, ws)
        right_hand_side(p, ws, 1.0)
        solve_system(p, ws, ws.x, ws.mu)
        add(ws.x, a)
        add(ws.mu, lam)


@routine
def enter(p, signals, t, controls, m, ws):
    """Where a run comes near a singular position: bring it back to the constraints, what is left of them would grow.

    Where there is no place on them so near by the mechanism is driven beyond its reach, and cannot pass.
    """
    copy(m.q, m.eq)
    copy(m.v, m.ev)
    project(p, signals, t, m.q, m.v, ws)
    for j in range(m.q.size):
        ws.x[j] = m.q[j] - m.eq[j]
    m.counts[PREPARED] = 1
    if not mass_norm(p, ws, ws.x) <= ENTRY * controls.near_error:
        copy(m.eq, m.q)
        copy(m.ev, m.v)
        m.counts[PREPARED] = -1
        return
    copy(m.q, m.stage_q[0])
    copy(m.v, m.stage_v[0])
    copy(m.v, m.stage_d[0])
    first_stage(p, signals, t, controls, m, ws)


@seldom
def start(p, signals, tableau, controls, m, ws, out):
    """First stage and first sample of a run."""
    t = m.clock[TIME]
    first_stage(p, signals, t, controls, m, ws)
    a, lam = m.stage_a[1, 0], m.stage_lam[0]
    m.stage_t[1, 0] = t
    copy(m.q, m.stage_q[0])
    copy(m.v, m.stage_v[0])
    copy(m.v, m.stage_d[0])
    copy(a, m.algorithmic[0])
    m.clock[LAST_STEP], m.clock[LAST_ERROR] = 0.0, 1.0
    m.clock[PART_END] = t
    m.clock[SLOPE], m.counts[ROOT_STEP] = 0.0, -1
    m.power[0] = input_power(p, signals, t, m.q, m.v, lam, m.torques, ws)
    kinetic, strain = system_energy(p, m.q, m.v, ws.scratch)
    strain += spring_energy(p, lam) + line_energy(p, m.q, m.v)[0]
    m.clock[ENERGY_0] = kinetic + strain
    m.clock[WEIGHT_0] = weight_work(p, m.q, ws.scratch)
    note_constraints(p, signals, t, m, ws)
    if out.times.size > 0 and out.times[0] <= t:
        copy(m.q, out.q[0])
        copy(m.v, out.v[0])
        copy(a, out.a[0])
        copy(lam, out.lam[0])
        out.energy[0, 0], out.energy[0, 1], out.energy[0, 2] = kinetic, strain, 0.0
        m.counts[SAMPLE] = 1


@routine
def note_constraints(p, signals, t, m, ws):
    """Keep the largest constraint violation seen at accepted steps."""
    constraint_values(p, signals, t, m.q, m.v, ws.scratch, ws.rows, ws.mu)
    for r in range(ws.rows.size):
        m.clock[PHI_MAX] = max(m.clock[PHI_MAX], abs(ws.rows[r]))
        m.clock[DPHI_MAX] = max(m.clock[DPHI_MAX], abs(ws.mu[r]))


@routine
def accept(p, signals, tableau, controls, t, h, m, ws, out):
    """Take the step: move on, sample, count, and keep the stages for the next starting guess."""
    last = tableau.c.size - 1
    if m.counts[NEAR] > 0:
        note_crossing(p, t, h, m, ws)
    if controls.treatment == PROJECTION and m.counts[NEAR] == 0:
        project(p, signals, t + h, m.stage_q[last], m.stage_v[last], ws)
    write_samples(p, tableau, t, h, m, ws, out)
    copy(m.stage_q[last], m.q)
    copy(m.stage_v[last], m.v)
    m.clock[WORK] += step_work(tableau, h, m)
    m.clock[LAST_STEP] = h
    copy(m.stage_t[1], m.stage_t[0])
    for s in range(last + 1):
        copy(m.stage_a[1, s], m.stage_a[0, s])
    m.stage_t[1, 0] = t + h
    copy(m.q, m.stage_q[0])
    copy(m.v, m.stage_v[0])
    copy(m.stage_d[last], m.stage_d[0])
    copy(m.algorithmic[1], m.algorithmic[0])
    copy(m.stage_a[0, last], m.stage_a[1, 0])
    copy(m.stage_lam[last], m.stage_lam[0])
    m.power[0] = m.power[last]
    m.counts[STEPS] += 1
    m.counts[FAILURES] = 0
    m.counts[DRIFTED] = m.counts[HELD_END]
    if m.counts[NEAR] == 0:
        m.counts[PREPARED] = 0
    kinetic, strain = system_energy(p, m.q, m.v, ws.scratch)
    strain += spring_energy(p, m.stage_lam[0]) + line_energy(p, m.q, m.v)[0]
    done = m.clock[WORK] + weight_work(p, m.q, ws.scratch) - m.clock[WEIGHT_0]
    balance = abs(kinetic + strain - m.clock[ENERGY_0] - done)
    m.clock[BALANCE] = max(m.clock[BALANCE], balance)
    note_constraints(p, signals, t + h, m, ws)


@lasting
def march(p, signals, tableau, controls, stops, max_steps, m, ws, slow, out):
    """Advance by up to max_steps attempted steps, ending steps exactly at each of the times in `stops`.

    Returns
    -------
    int
        PAUSED, FINISHED, or why it cannot go on.
    """
    exponent = 1.0 / tableau.order
    for _ in range(max_steps):
        t = m.clock[TIME]
        while m.counts[STOP] < stops.size and stops[m.counts[STOP]] <= t:
            m.counts[STOP] += 1
        if m.counts[STOP] == stops.size:
            return FINISHED
        end, longest = stops[m.counts[STOP]], controls.fixed_step
        if t < m.clock[PART_END]:
            end, longest = m.clock[PART_END], m.clock[PART]
        left = end - t
        h = min(m.clock[STEP], controls.max_step)
        landing = False
        if controls.fixed_step > 0.0:
            # Stretches between stops are divided evenly.
            h = left / max(1.0, ceil(left / longest - 1e-6))
            # But for rounding the same step: its factor still serves.
            if abs(h - m.clock[STEP]) <= 1e-9 * h:
                h = m.clock[STEP]
            m.clock[STEP] = h
        if left <= h * (1.0 + 1e-9):
            h, landing = left, True
        elif left < 2.0 * h and controls.fixed_step == 0.0:
            h = 0.5 * left
        cause, error = attempt(p, signals, tableau, controls, t, h, m, ws, slow)
        if cause == ENTERS:
            enter(p, signals, t, controls, m, ws)
            continue
        if cause == PAUSED and error <= 1.0:
            after_failure = m.counts[FAILURES] > 0
            accept(p, signals, tableau, controls, t, h, m, ws, out)
            m.clock[TIME] = end if landing else t + h
            if controls.fixed_step > 0.0:
                continue
            # Near a singular position steps are of one length, and not so short that rounding tells.
            if m.counts[NEAR] > 0:
                pace = abs(m.clock[SLOPE]) * h
                if pace < LEAST_PACE * sqrt(m.clock[WIDEST]) and error < GROWING and not after_failure:
                    m.clock[STEP] = MAX_FACTOR * h
                continue
            error = max(error, SMALLEST_ERROR) / SAFETY**tableau.order
            factor = error ** (-BY_ERROR * exponent) * m.clock[LAST_ERROR] ** (BY_LAST_ERROR * exponent)
            factor = min(MAX_FACTOR, factor)
            m.clock[LAST_ERROR] = error
            # Keep the step, and with it the factor, unless the change is worth it; a step cut short to land on a stop
            # says nothing about longer ones.
            if factor < KEEP_ABOVE or (factor > KEEP_BELOW and h >= m.clock[STEP] and not after_failure):
                m.clock[STEP] = factor * h
            continue
        m.counts[REJECTED] += 1
        if controls.fixed_step > 0.0:
            if h <= SMALLEST_PART * controls.fixed_step:
                return cause
            if t >= m.clock[PART_END]:
                m.clock[PART_END] = end if landing else t + h
            m.clock[PART] = MIN_FACTOR * h
        if m.counts[FAILURES] == 1:
            # The first stage is the last step's last, with the error its longer step could bear: not so a shorter one.
            first_stage(p, signals, t, controls, m, ws)
            if tableau.newmark.size > 0:
                restart_algorithmic(tableau.newmark, m)
        m.counts[FAILURES] += 1
        if controls.fixed_step > 0.0:
            continue
        if cause == PAUSED:
            cause = ERROR_TEST
            m.clock[STEP] = h * max(MIN_FACTOR, SAFETY * (1.0 / error) ** exponent)
        else:
            m.clock[STEP] = h * MIN_FACTOR
        if m.clock[STEP] < controls.least_step:
            return cause
    return PAUSED
