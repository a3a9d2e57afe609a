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

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from paraflex.kernel.arrays import add, apart, copy, fill, largest
from paraflex.kernel.bending import note_all_axial_forces
from paraflex.kernel.bodies import system_energy, weight_work
from paraflex.kernel.compiling import inlined, kernel, routine
from paraflex.kernel.constraints import note_friction
from paraflex.kernel.factor import factor_bodies
from paraflex.kernel.joints import line_energy, spring_energy
from paraflex.kernel.linear import orient, right_hand_side, solve_system
from paraflex.kernel.march import interpolate, step_work, write_samples
from paraflex.kernel.packed import INDEX_1, Signals
from paraflex.kernel.records import by_reference
from paraflex.kernel.run_state import SAMPLE, WORK
from paraflex.kernel.signals import evaluate_signal
from paraflex.kernel.stage import equations, place
from paraflex.kernel.step import input_power, stage_start
from paraflex.kernel.tangent import note_slopes, residual_tangent

# Central differences of fourth order over this part of a parameter's size, and their places and weights.
STEP = 1e-3
PLACES, WEIGHTS = (-2.0, -1.0, 1.0, 2.0), (1.0 / 12.0, -8.0 / 12.0, 8.0 / 12.0, -1.0 / 12.0)
# Corrections end where they are this part of what they correct, or where, below the second bound, they fall no more.
ROUNDING, NEARLY, FALLING = 2e-16, 1e-9, 0.9
MOST_CORRECTIONS = 200
# What is no more than this part of the largest accelerations of a run, or forces, is solved no more closely than that.
NOTHING = 1e-6


@by_reference
class History(NamedTuple):
    """Steps of a run, one after the other, with the motion at every stage.

    Until `settle_steps` has solved them accelerations and multipliers are guesses.
    """

    t: NDArray[np.float64]  # (steps,) when each begins
    h: NDArray[np.float64]
    restart: NDArray[np.int64]  # (steps,) whether its first stage is solved anew
    q: NDArray[np.float64]  # (steps, stages, n)
    v: NDArray[np.float64]
    a: NDArray[np.float64]
    lam: NDArray[np.float64]  # (steps, stages, m)
    power: NDArray[np.float64]  # (steps, stages)
    left: NDArray[np.float64]  # (steps,) largest last correction, as a part of what it corrected
    least: NDArray[np.float64]  # (2,) accelerations and multipliers, or derivatives, that are but rounding of a run's


@by_reference
class Variation(NamedTuple):
    """Derivatives of the motion by one parameter: what it moves, where the motion stands, and samples."""

    t: NDArray[np.float64]  # (steps,) of when steps begin
    h: NDArray[np.float64]  # and of their lengths
    gains: NDArray[np.float64]  # (4, 2) Baumgarte's alpha and beta at the places of the difference
    q: NDArray[np.float64]  # (stages, n) of the step at hand; the first is where the last one ended
    v: NDArray[np.float64]
    a: NDArray[np.float64]
    lam: NDArray[np.float64]  # (stages, m)
    power: NDArray[np.float64]  # (stages,)
    f: NDArray[np.float64]  # (n,) R_s of the equations of motion
    rows: NDArray[np.float64]  # (m,) and of the rows
    moved_q: NDArray[np.float64]  # scratch
    moved_v: NDArray[np.float64]
    moved_lam: NDArray[np.float64]
    work: NDArray[np.float64]  # (2,) work until now and its derivative
    count: NDArray[np.int64]  # (1,) samples until now
    left: NDArray[np.float64]  # (steps,) as in `History`
    times: NDArray[np.float64]  # (times,) of the samples
    sample_times: NDArray[np.float64]  # and their derivatives
    sample_q: NDArray[np.float64]  # (times, n)
    sample_v: NDArray[np.float64]
    sample_a: NDArray[np.float64]
    sample_lam: NDArray[np.float64]  # (times, m)
    sample_work: NDArray[np.float64]  # (times,) without that of weight


def make_history(steps: int, stages: int, n: int, m: int) -> History:
    """Room for so many steps."""
    motion = (apart((steps, stages, n)) for _ in range(3))
    return History(
        apart(steps), apart(steps), apart(steps, np.int64), *motion, apart((steps, stages, m)), apart((steps, stages)),
        apart(steps), apart(2),
    )  # fmt: skip


def make_variation(
    steps: int, stages: int, n: int, m: int, times: NDArray[np.float64], sample_times: NDArray[np.float64]
) -> Variation:
    """Room for the derivatives by one parameter; zero."""
    k = times.size
    return Variation(
        t=apart(steps),
        h=apart(steps),
        gains=apart((4, 2)),
        q=apart((stages, n)),
        v=apart((stages, n)),
        a=apart((stages, n)),
        lam=apart((stages, m)),
        power=apart(stages),
        f=apart(n),
        rows=apart(m),
        moved_q=apart(n),
        moved_v=apart(n),
        moved_lam=apart(m),
        work=apart(2),
        count=apart(1, np.int64),
        left=apart(steps),
        times=times,
        sample_times=sample_times,
        sample_q=apart((k, n)),
        sample_v=apart((k, n)),
        sample_a=apart((k, n)),
        sample_lam=apart((k, m)),
        sample_work=apart(k),
    )


def make_piece(signals: Signals) -> Signals:
    """Room for one piece of every signal."""
    count = signals.start.size - 1
    return Signals(2 * np.arange(count + 1), apart(2 * count), apart((2 * count, signals.coefficients.shape[1])))


@routine
def baumgarte_weights(controls, alpha, beta, h):
    """Weights of Phi'', Phi' and Phi in a step's stages; without a step, h = 0, those of a first stage."""
    if controls.gain > 0.0:
        if h == 0.0:
            return INDEX_1
        alpha = beta = controls.gain / h
    return 1.0, 2.0 * alpha, beta * beta


@routine
def ended(change, previous, iteration):
    """Whether corrections are down to rounding; relative ones, this and the last."""
    return change <= ROUNDING or (iteration > 0 and change < NEARLY and change > FALLING * previous)


@inlined
def relative(x, mu, a, lam, least_a, least_lam):
    """Corrections of accelerations and multipliers as parts of these, or of the least that count."""
    change, size = largest(x), max(largest(a), least_a)
    if size > 0.0:
        change /= size
    other, size = largest(mu), max(largest(lam), least_lam)
    if size > 0.0:
        change = max(change, other / size)
    return change


@routine
def prepare_matrix(p, b, q, v, a, lam, dependent_part, ws):
    """The iteration matrix for a stage at (q, v, a, lambda)."""
    note_friction(p, q, v, ws.mu, ws.compliance)
    if ws.step[0] != b or b == 0.0:
        note_all_axial_forces(p, q, v, a, lam, ws, ws.geometric)
        factor_bodies(p, b, q, ws)
    orient(p, q, ws, dependent_part)


@routine
def settle(p, signals, t, g, b, weights, dependent_part, m, a, lam, least, ws):
    """Solve a stage from m.qs and m.vs to rounding: a and lam, and its q and v in ws; the last relative correction."""
    scale = 1.0 / (weights[0] + weights[1] * g + weights[2] * b)
    place(m.qs, m.vs, g, b, a, m.shift, ws)
    prepare_matrix(p, b, ws.q, ws.v, a, lam, dependent_part, ws)
    change, previous = 0.0, 0.0
    for iteration in range(MOST_CORRECTIONS):
        place(m.qs, m.vs, g, b, a, m.shift, ws)
        equations(p, signals, t, weights, ws.q, ws.v, a, lam, m.torques, ws)
        right_hand_side(p, ws, scale)
        solve_system(p, ws, ws.x, ws.mu)
        add(ws.x, a)
        add(ws.mu, lam)
        change = relative(ws.x, ws.mu, a, lam, least[0], least[1])
        if ended(change, previous, iteration):
            break
        previous = change
    place(m.qs, m.vs, g, b, a, m.shift, ws)
    return change


@kernel
def settle_steps(p, signals, tableau, controls, count, x, m, ws, out):
    """Solve the first `count` steps of a history again, each to rounding, from where m stands; samples into out.

    m holds q, v and, unless the first step restarts, the accelerations and multipliers of its first stage.
    """
    last = tableau.c.size - 1
    for k in range(count):
        for i in range(1, last + 1):
            x.least[0] = max(x.least[0], NOTHING * largest(x.a[k, i]))
            x.least[1] = max(x.least[1], NOTHING * largest(x.lam[k, i]))
    for k in range(count):
        t, h = x.t[k], x.h[k]
        x.left[k] = 0.0
        if x.restart[k] != 0:
            copy(m.q, m.qs)
            copy(m.v, m.vs)
            weights = baumgarte_weights(controls, controls.alpha, controls.beta, 0.0)
            x.left[k] = settle(
                p,
                signals,
                t,
                0.0,
                0.0,
                weights,
                controls.dependent_part,
                m,
                m.stage_a[1, 0],
                m.stage_lam[0],
                x.least,
                ws,
            )
            m.power[0] = input_power(p, signals, t, m.q, m.v, m.stage_lam[0], m.torques, ws)
        copy(m.q, m.stage_q[0])
        copy(m.v, m.stage_v[0])
        if m.counts[SAMPLE] == 0 and out.times[0] <= t:
            copy(m.q, out.q[0])
            copy(m.v, out.v[0])
            copy(m.stage_a[1, 0], out.a[0])
            copy(m.stage_lam[0], out.lam[0])
            out.energy[0, 2] = weight_work(p, m.q, ws.scratch)
            m.counts[SAMPLE] = 1
        weights = baumgarte_weights(controls, controls.alpha, controls.beta, h)
        for i in range(1, last + 1):
            time, g, b = stage_start(tableau, i, t, h, m)
            copy(x.a[k, i], m.stage_a[1, i])
            copy(x.lam[k, i], m.stage_lam[i])
            left = settle(
                p,
                signals,
                time,
                g,
                b,
                weights,
                controls.dependent_part,
                m,
                m.stage_a[1, i],
                m.stage_lam[i],
                x.least,
                ws,
            )
            x.left[k] = max(x.left[k], left)
            copy(ws.q, m.stage_q[i])
            copy(ws.v, m.stage_v[i])
            m.power[i] = input_power(p, signals, time, ws.q, ws.v, m.stage_lam[i], m.torques, ws)
        for i in range(last + 1):
            copy(m.stage_q[i], x.q[k, i])
            copy(m.stage_v[i], x.v[k, i])
            copy(m.stage_a[1, i], x.a[k, i])
            copy(m.stage_lam[i], x.lam[k, i])
            x.power[k, i] = m.power[i]
        write_samples(p, tableau, t, h, m, ws, out)
        m.clock[WORK] += step_work(tableau, h, m)
        copy(m.stage_q[last], m.q)
        copy(m.stage_v[last], m.v)
        copy(m.stage_a[1, last], m.stage_a[1, 0])
        copy(m.stage_lam[last], m.stage_lam[0])
        m.power[0] = m.power[last]


@inlined
def piece_at(s, k, t):
    """Which piece `signals.evaluate_signal` evaluates."""
    low, high = s.start[k], s.start[k + 1] - 2
    while low < high:
        middle = (low + high + 1) // 2
        if s.breaks[middle] <= t:
            low = middle
        else:
            high = middle - 1
    return low


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
def respond_to_parameter(p, g, b, weights, dependent_part, q, v, a, lam, least, i, torques, y, d, ws):
    """Solve the linear equations of a stage for y.a[i] and y.lam[i]; the last relative correction.

    y.q[i] and y.v[i] hold what they are without the stage's own y.a, and then all.
    """
    scale = 1.0 / (weights[0] + weights[1] * g + weights[2] * b)
    da, dlam = y.a[i], y.lam[i]
    prepare_matrix(p, b, q, v, a, lam, dependent_part, ws)
    note_slopes(p, q, v, ws.mu, ws.compliance, d)
    change, previous = 0.0, 0.0
    for iteration in range(MOST_CORRECTIONS):
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
    for k in range(torques.size):
        torques[k] = evaluate_signal(signals, k, t)[0]
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


@routine
def vary_step_work(tableau, k, x, y):
    """Work of the motors in step k, and its derivative."""
    last, work, d_work = tableau.c.size - 1, 0.0, 0.0
    for s in range(last + 1):
        work += x.h[k] * tableau.A[last, s] * x.power[k, s]
        d_work += tableau.A[last, s] * (x.h[k] * y.power[s] + y.h[k] * x.power[k, s])
    return work, d_work


@routine
def vary_multipliers(tableau, k, fraction, d_fraction, x, y, out):
    """Derivative of the multipliers at a fraction of step k that moves itself: see `march.interpolate_multipliers`."""
    fill(out, 0.0)
    for s in tableau.nodes:
        weight = 1.0
        for l in tableau.nodes:
            if l != s:
                weight *= (fraction - tableau.c[l]) / (tableau.c[s] - tableau.c[l])
        slope = 0.0
        for skipped in tableau.nodes:
            if skipped != s:
                product = 1.0 / (tableau.c[s] - tableau.c[skipped])
                for l in tableau.nodes:
                    if l != s and l != skipped:
                        product *= (fraction - tableau.c[l]) / (tableau.c[s] - tableau.c[l])
                slope += product
        for r in range(out.size):
            out[r] += weight * y.lam[s, r] + slope * d_fraction * x.lam[k, s, r]


@routine
def vary_samples(tableau, k, x, y):
    """Derivatives at every sample time within step k: those of what `march.write_samples` finds."""
    t, h, last = x.t[k], x.h[k], tableau.c.size - 1
    piece, i = 0, y.count[0]
    while i < y.times.size and y.times[i] <= t + h * (1.0 + 1e-12):
        time, d_time = y.times[i], y.sample_times[i] - y.t[k]
        while piece < tableau.dense.size - 2 and time > t + tableau.c[tableau.dense[piece + 1]] * h:
            piece += 1
        s0, s1 = tableau.dense[piece], tableau.dense[piece + 1]
        width, d_width = (tableau.c[s1] - tableau.c[s0]) * h, (tableau.c[s1] - tableau.c[s0]) * y.h[k]
        z = min(max((time - t - tableau.c[s0] * h) / width, 0.0), 1.0)
        d_z = (d_time - tableau.c[s0] * y.h[k] - z * d_width) / width
        shifts = d_z != 0.0 or d_width != 0.0
        for j in range(y.q.shape[1]):
            y.sample_q[i, j], y.sample_v[i, j], y.sample_a[i, j] = interpolate(
                y.q[s0, j], y.v[s0, j], y.a[s0, j], y.q[s1, j], y.v[s1, j], y.a[s1, j], width, z
            )
            if shifts:
                for e in range(4):
                    q, v, a = interpolate(
                        x.q[k, s0, j], x.v[k, s0, j], x.a[k, s0, j], x.q[k, s1, j], x.v[k, s1, j], x.a[k, s1, j],
                        width + PLACES[e] * STEP * d_width, z + PLACES[e] * STEP * d_z,
                    )  # fmt: skip
                    y.sample_q[i, j] += WEIGHTS[e] * q / STEP
                    y.sample_v[i, j] += WEIGHTS[e] * v / STEP
                    y.sample_a[i, j] += WEIGHTS[e] * a / STEP
        vary_multipliers(tableau, k, (time - t) / h, (d_time - (time - t) / h * y.h[k]) / h, x, y, y.sample_lam[i])
        work, d_work = vary_step_work(tableau, k, x, y)
        done = min(max((time - t) / h, 0.0), 1.0)
        d_done, left = (d_time - done * y.h[k]) / h, 1.0 - done
        first, end = x.power[k, 0], x.power[k, last]
        y.sample_work[i] = y.work[1] + done * done * (3.0 - 2.0 * done) * d_work + 6.0 * done * left * d_done * work
        bend = done * left * (left * first - done * end)
        d_bend = (left - done) * (left * first - done * end) - done * left * (first + end)
        y.sample_work[i] += y.h[k] * bend + h * d_done * d_bend
        y.sample_work[i] += h * done * left * (left * y.power[0] - done * y.power[last])
        i += 1
    y.count[0] = i


@kernel
def vary_steps(p, signals, moved, moved_signals, pieces, tableau, controls, count, x, y, d, torques, ws):
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
            for l in range(torques.size):
                torques[l] = evaluate_signal(signals, l, t)[0]
            here = baumgarte_weights(controls, controls.alpha, controls.beta, length)
            left = respond_to_parameter(
                p, g, g * g, here, controls.dependent_part, q, v, a, lam, x.least, i, torques, y, d, ws
            )
            y.left[k] = max(y.left[k], left)
            vary_power(moved, pieces, times, i, q, v, lam, torques, y, ws)
        if y.count[0] == 0 and y.times[0] <= x.t[k]:
            copy(y.q[0], y.sample_q[0])
            copy(y.v[0], y.sample_v[0])
            copy(y.a[0], y.sample_a[0])
            copy(y.lam[0], y.sample_lam[0])
            y.count[0] = 1
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


@kernel
def sample_energies(p, q, v, lam, scratch, out):
    """Kinetic energy, strain energy with that of springs, and what gravity has done at samples, into out (k, 3)."""
    for i in range(q.shape[0]):
        out[i, 0], out[i, 1] = system_energy(p, q[i], v[i], scratch)
        out[i, 1] += spring_energy(p, lam[i]) + line_energy(p, q[i], v[i])[0]
        out[i, 2] = weight_work(p, q[i], scratch)
