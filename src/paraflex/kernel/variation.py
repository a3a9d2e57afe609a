"""Derivatives of a run by its parameters: its steps solved to rounding, and the linear equations of each stage.

With the steps of a run as they are, the stages of a scheme are smooth functions of whatever the equations hold. Along
a parameter s stage i of a step changes by

    dv_i = dv_n + sum_j A_ij (h da_j + dh a_j),  dq_i = dq_n + sum_j A_ij (h dv_j + dh v_j)
    R_q dq_i + R_v dv_i + R_a da_i + R_lambda dlambda_i + R_s = 0

where R are the residuals of `kernel.stage.equations`. The first four terms are those of `kernel.tangent`, exact. R_s is
what the residuals change by where the motion does not: they are polynomials of low degree in the numbers of a packed
system, in signals and weights, so that a central difference over four places is exact but for rounding. Equations are
solved with the iteration matrix of a run, turned to where each stage stands, until nothing is left but rounding.
"""

from __future__ import annotations

import numpy as np

from paraflex.kernel.arrays import add, apart, copy, fill
from paraflex.kernel.compiling import inlined, lasting, routine
from paraflex.kernel.constraints import note_friction
from paraflex.kernel.krylov import exact_correction
from paraflex.kernel.linear import right_hand_side, solve_system
from paraflex.kernel.packed import Signals
from paraflex.kernel.settle import (
    MOST_CORRECTIONS,
    MOST_EXACT,
    baumgarte_weights,
    ended,
    multiplier_unit,
    prepare_matrix,
    relative,
)
from paraflex.kernel.signals import piece_at
from paraflex.kernel.stage import equations, note_torques
from paraflex.kernel.step import input_power
from paraflex.kernel.tangent import note_slopes, residual_tangent
from paraflex.kernel.variation_samples import PLACES, STEP, WEIGHTS, vary_samples, vary_step_work


def make_piece(signals: Signals) -> Signals:
    """Room for one piece of every signal."""
    count = signals.start.size - 1
    return Signals(2 * np.arange(count + 1), apart(2 * count), apart((2 * count, signals.coefficients.shape[1])))


@routine
def take_pieces(signals, t, moved, pieces):
    """The piece of every signal at a time alone, from moved signals: near a break no place may see the next piece."""
    for k in range(signals.start.size - 1):
        at = piece_at(signals, k, t)
        for e in range(4):
            pieces[e].breaks[2 * k] = moved[e].breaks[at]
            copy(moved[e].coefficients[at], pieces[e].coefficients[2 * k])


@inlined
def gather_residual(p, signals, t, weights, q, v, a, lam, torques, share, y, ws):
    """Add a share of the residuals of a moved system to R_s."""
    equations(p, signals, t, weights, q, v, a, lam, torques, ws)
    for j in range(y.f.size):
        y.f[j] += share * ws.f[j]
    for r in range(y.rows.size):
        y.rows[r] += share * ws.rows[r]


@routine
def find_parametric(moved, signals, times, weights, q, v, a, lam, torques, y, ws):
    """R_s of a stage: by four moved systems, signals, times and weights."""
    fill(y.f, 0.0)
    fill(y.rows, 0.0)
    p0, p1, p2, p3 = moved
    s0, s1, s2, s3 = signals
    # From the outside in: what is small first.
    gather_residual(p0, s0, times[0], weights[0], q, v, a, lam, torques, WEIGHTS[0] / STEP, y, ws)
    gather_residual(p3, s3, times[3], weights[3], q, v, a, lam, torques, WEIGHTS[3] / STEP, y, ws)
    gather_residual(p1, s1, times[1], weights[1], q, v, a, lam, torques, WEIGHTS[1] / STEP, y, ws)
    gather_residual(p2, s2, times[2], weights[2], q, v, a, lam, torques, WEIGHTS[2] / STEP, y, ws)


@routine
def respond_to_parameter(p, g, b, weights, dependent_part, q, v, a, lam, least, i, torques, y, d, space, ws):
    """Solve the linear equations of a stage for y.a[i] and y.lam[i]; the last relative correction.

    y.q[i] and y.v[i] hold what they are without the stage's own y.a, and then all.
    """
    scale = 1.0 / (weights[0] + weights[1] * g + weights[2] * b)
    da, dlam = y.a[i], y.lam[i]
    prepare_matrix(p, b, q, v, a, lam, dependent_part, ws)
    note_slopes(p, q, v, ws.mu, ws.compliance, d)
    change, previous = 0.0, 0.0
    for iteration in range(MOST_CORRECTIONS + MOST_EXACT):
        if iteration == MOST_CORRECTIONS:
            fill(da, 0.0)
            fill(dlam, 0.0)
        for j in range(da.size):
            d.q[j] = y.q[i, j] + b * da[j]
            d.v[j] = y.v[i, j] + g * da[j]
            d.a[j] = da[j]
        copy(dlam, d.lam)
        residual_tangent(p, weights, q, v, a, lam, torques, ws.compliance, 0, p.bodies.size, d)
        for j in range(da.size):
            ws.f[j] = d.f[j] + y.f[j]
        for r in range(dlam.size):
            ws.rows[r] = d.rows[r] + y.rows[r]
        right_hand_side(p, ws, scale)
        solve_system(p, ws, ws.x, ws.mu)
        if iteration >= MOST_CORRECTIONS:
            exact_correction(p, g, b, weights, q, v, a, lam, torques, multiplier_unit(least), d, space, ws)
        add(ws.x, da)
        add(ws.mu, dlam)
        change = relative(ws.x, ws.mu, da, dlam, least[0], least[1])
        if ended(change, previous, iteration):
            break
        previous = change
    for j in range(da.size):
        y.q[i, j] += b * da[j]
        y.v[i, j] += g * da[j]
    return change


@inlined
def moved_power(p, signals, t, place, i, q, v, lam, torques, y, ws):
    """Power of the motors and all else at one place of the difference."""
    for j in range(q.size):
        y.moved_q[j] = q[j] + place * STEP * y.q[i, j]
        y.moved_v[j] = v[j] + place * STEP * y.v[i, j]
    for r in range(lam.size):
        y.moved_lam[r] = lam[r] + place * STEP * y.lam[i, r]
    note_torques(signals, t, torques)
    return input_power(p, signals, t, y.moved_q, y.moved_v, y.moved_lam, torques, ws)


@routine
def vary_power(moved, signals, times, i, q, v, lam, torques, y, ws):
    """Derivative of the power at stage i."""
    p0, p1, p2, p3 = moved
    s0, s1, s2, s3 = signals
    total = WEIGHTS[0] * moved_power(p0, s0, times[0], PLACES[0], i, q, v, lam, torques, y, ws)
    total += WEIGHTS[3] * moved_power(p3, s3, times[3], PLACES[3], i, q, v, lam, torques, y, ws)
    total += WEIGHTS[1] * moved_power(p1, s1, times[1], PLACES[1], i, q, v, lam, torques, y, ws)
    total += WEIGHTS[2] * moved_power(p2, s2, times[2], PLACES[2], i, q, v, lam, torques, y, ws)
    y.power[i] = total / STEP


@lasting
def vary_steps(p, signals, moved, moved_signals, pieces, tableau, controls, count, x, y, d, space, torques, ws):
    """Derivatives of the motion by one parameter over the first `count` steps of a history.

    Parameters
    ----------
    moved, moved_signals : tuples of 4
        The packed system and the signals at the PLACES times STEP of the parameter.
    pieces : tuple of 4 Signals
        Scratch, from `make_piece`.
    x : History
        After `settle_steps`.
    y : Variation
        Where the last steps left it: y.q[0] and y.v[0] and, unless the first step restarts, y.a[0] and y.lam[0].
    d : Tangent
    """
    last = tableau.c.size - 1
    # Another parameter left its factor.
    ws.step[0] = -1.0
    for k in range(count):
        h, y.left[k] = x.h[k], 0.0
        dt, dh = y.t[k], y.h[k]
        for i in range(0 if x.restart[k] != 0 else 1, last + 1):
            length = h if i > 0 else 0.0
            t, d_t = x.t[k] + tableau.c[i] * length, dt + (tableau.c[i] * dh if i > 0 else 0.0)
            g = tableau.A[i, i] * length
            if i > 0:
                vary_start(tableau, i, k, g, x, y)
                copy(y.a[i - 1], y.a[i])
                copy(y.lam[i - 1], y.lam[i])
            times = (
                t + PLACES[0] * STEP * d_t, t + PLACES[1] * STEP * d_t,
                t + PLACES[2] * STEP * d_t, t + PLACES[3] * STEP * d_t,
            )  # fmt: skip
            d_length = dh if i > 0 else 0.0
            weights = (
                baumgarte_weights(controls, y.gains[0, 0], y.gains[0, 1], length + PLACES[0] * STEP * d_length),
                baumgarte_weights(controls, y.gains[1, 0], y.gains[1, 1], length + PLACES[1] * STEP * d_length),
                baumgarte_weights(controls, y.gains[2, 0], y.gains[2, 1], length + PLACES[2] * STEP * d_length),
                baumgarte_weights(controls, y.gains[3, 0], y.gains[3, 1], length + PLACES[3] * STEP * d_length),
            )
            q, v, a, lam = x.q[k, i], x.v[k, i], x.a[k, i], x.lam[k, i]
            note_friction(p, q, v, ws.mu, ws.compliance)
            take_pieces(signals, t, moved_signals, pieces)
            find_parametric(moved, pieces, times, weights, q, v, a, lam, torques, y, ws)
            note_torques(signals, t, torques)
            here = baumgarte_weights(controls, controls.alpha, controls.beta, length)
            left = respond_to_parameter(
                p, g, g * g, here, controls.dependent_part, q, v, a, lam, x.least, i, torques, y, d, space, ws
            )
            y.left[k] = max(y.left[k], left)
            vary_power(moved, pieces, times, i, q, v, lam, torques, y, ws)
        if y.taken[0] == 0 and y.times[0] <= x.t[k]:
            copy(y.q[0], y.sample_q[0])
            copy(y.v[0], y.sample_v[0])
            copy(y.a[0], y.sample_a[0])
            copy(y.lam[0], y.sample_lam[0])
            y.taken[0] = 1
        vary_samples(tableau, k, x, y)
        work, d_work = vary_step_work(tableau, k, x, y)
        y.work[0] += work
        y.work[1] += d_work
        copy(y.q[last], y.q[0])
        copy(y.v[last], y.v[0])
        copy(y.a[last], y.a[0])
        copy(y.lam[last], y.lam[0])
        y.power[0] = y.power[last]


@routine
def vary_start(tableau, i, k, g, x, y):
    """What y.q[i] and y.v[i] are without the stage's own accelerations: the derivative of `step.stage_start`."""
    h, dh = x.h[k], y.h[k]
    for j in range(y.q.shape[1]):
        dv, dq = y.v[0, j], y.q[0, j]
        for s in range(i):
            dv += tableau.A[i, s] * (h * y.a[s, j] + dh * x.a[k, s, j])
            dq += tableau.A[i, s] * (h * y.v[s, j] + dh * x.v[k, s, j])
        dv += tableau.A[i, i] * dh * x.a[k, i, j]
        dq += tableau.A[i, i] * dh * x.v[k, i, j]
        y.v[i, j] = dv
        y.q[i, j] = dq + g * dv
