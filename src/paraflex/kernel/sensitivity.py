"""Forward sensitivities of a run: steps solved to rounding, and the linear equations of each stage.

With the steps of a run kept, the stages of a scheme are smooth functions of the parameters of the equations. For a
parameter s stage i of a step changes by

    dv_i = dv_n + sum_j A_ij (h da_j + dh a_j),  dq_i = dq_n + sum_j A_ij (h dv_j + dh v_j)
    R_q dq_i + R_v dv_i + R_a da_i + R_lambda dlambda_i + R_s = 0

where R are the residuals of `kernel.stage.equations`. The first four terms are exact, from `kernel.tangent`. R_s is the
change of the residuals for an unchanged motion. The residuals are polynomials of low degree in the numbers of a packed
system, in signals and weights, so a central difference over four points is exact except for rounding. The equations are
solved with the iteration matrix of a run, rotated to the pose of each stage, until only rounding remains.
"""

import numpy as np

from . import rounding
from .arrays import add, apart, copy, fill
from .compiling import releases_lock, routine
from .constraints import note_friction
from .krylov import exact_correction
from .linear import solve_residuals
from .packed import Signals
from .samples import is_long
from .sensitivity_samples import (
    DIFFERENCE_STEP,
    PLACES,
    WEIGHTS,
    sensitivity_at_sample,
    velocity_along_curve,
    work_sensitivity,
)
from .signals import piece_at
from .stage import equations, note_torques
from .step import input_power
from .tangent import note_slopes, residual_tangent

# Points of the difference from the outside in, so that small terms are added first.
OUTSIDE_IN = (0, 3, 1, 2)


def make_piece(signals: Signals) -> Signals:
    """Allocate one piece of every signal."""
    count = signals.start.size - 1
    return Signals(2 * np.arange(count + 1), apart(2 * count), apart((2 * count, signals.coefficients.shape[1])))


@routine
def take_pieces(signals, t, moved, pieces):
    """Copy the piece of every signal at a time from the moved signals.

    With one piece only, no point of the difference can use the next piece.
    """
    for k in range(signals.start.size - 1):
        at = piece_at(signals, k, t)
        for e in range(4):
            pieces[e].breaks[2 * k] = moved[e].breaks[at]
            copy(moved[e].coefficients[at], pieces[e].coefficients[2 * k])


@routine
def find_parametric(moved, signals, controls, t, d_t, length, d_length, q, v, a, lam, torques, sensitivity, work):
    """Compute R_s of a stage in a step of some length, from four moved systems, signals, times and weights."""
    fill(sensitivity.f, 0.0)
    fill(sensitivity.rows, 0.0)
    for e in OUTSIDE_IN:
        step, share = PLACES[e] * DIFFERENCE_STEP, WEIGHTS[e] / DIFFERENCE_STEP
        alpha, beta = sensitivity.gains[e, 0], sensitivity.gains[e, 1]
        weights = rounding.baumgarte_weights(controls, alpha, beta, length + step * d_length)
        equations(moved[e], signals[e], t + step * d_t, weights, q, v, a, lam, torques, work)
        for j in range(sensitivity.f.size):
            sensitivity.f[j] += share * work.f[j]
        for r in range(sensitivity.rows.size):
            sensitivity.rows[r] += share * work.rows[r]


@routine
def respond_to_parameter(
    system, g, b, weights, dependent_part, q, v, a, lam, least, i, torques, sensitivity, direction, space, work
):
    """Solve the linear equations of a stage for sensitivity.a[i] and sensitivity.lam[i].

    On entry q[i] and v[i] of the sensitivity hold the derivatives without the stage's own a, on return the full ones.
    Returns the last relative correction.
    """
    scale = 1.0 / (weights[0] + weights[1] * g + weights[2] * b)
    da, dlam = sensitivity.a[i], sensitivity.lam[i]
    rounding.prepare_matrix(system, b, q, v, a, lam, dependent_part, work)
    note_slopes(system, q, v, work.mu, work.compliance, direction)
    change, previous = 0.0, 0.0
    for iteration in range(rounding.MOST_CORRECTIONS + rounding.MOST_EXACT):
        if iteration == rounding.MOST_CORRECTIONS:
            fill(da, 0.0)
            fill(dlam, 0.0)
        for j in range(da.size):
            direction.q[j] = sensitivity.q[i, j] + b * da[j]
            direction.v[j] = sensitivity.v[i, j] + g * da[j]
            direction.a[j] = da[j]
        copy(dlam, direction.lam)
        residual_tangent(system, weights, q, v, a, lam, torques, work.compliance, 0, system.bodies.size, direction)
        for j in range(da.size):
            work.f[j] = direction.f[j] + sensitivity.f[j]
        for r in range(dlam.size):
            work.rows[r] = direction.rows[r] + sensitivity.rows[r]
        solve_residuals(system, work, scale)
        if iteration >= rounding.MOST_CORRECTIONS:
            exact_correction(
                system, g, b, weights, q, v, a, lam, torques, rounding.multiplier_unit(least), direction, space, work
            )
        add(work.x, da)
        add(work.mu, dlam)
        change = rounding.relative(work.x, work.mu, da, dlam, least[0], least[1])
        if rounding.ended(change, previous, iteration):
            break
        previous = change
    for j in range(da.size):
        sensitivity.q[i, j] += b * da[j]
        sensitivity.v[i, j] += g * da[j]
    return change


@routine
def power_sensitivity(moved, signals, t, d_t, i, q, v, dv, lam, torques, sensitivity, work):
    """Compute the derivative of the power of all forces at stage i, for a velocity v with the derivative dv."""
    total = 0.0
    for e in OUTSIDE_IN:
        step = PLACES[e] * DIFFERENCE_STEP
        for j in range(q.size):
            sensitivity.moved_q[j] = q[j] + step * sensitivity.q[i, j]
            sensitivity.moved_v[j] = v[j] + step * dv[j]
        for r in range(lam.size):
            sensitivity.moved_lam[r] = lam[r] + step * sensitivity.lam[i, r]
        time = t + step * d_t
        note_torques(signals[e], time, torques)
        total += WEIGHTS[e] * input_power(
            moved[e], signals[e], time, sensitivity.moved_q, sensitivity.moved_v, sensitivity.moved_lam, torques, work
        )
    sensitivity.power[i] = total / DIFFERENCE_STEP


@routine
def stage_sensitivity(
    system, signals, moved, moved_signals, pieces, controls, t, d_t, length, d_length, g, q, v, a, lam, least, i,
    torques, sensitivity, direction, space, work,
):  # fmt: skip
    """Compute derivatives of a stage or sample from those without its own a; return the last relative correction."""
    note_friction(system, q, v, work.mu, work.compliance)
    take_pieces(signals, t, moved_signals, pieces)
    find_parametric(moved, pieces, controls, t, d_t, length, d_length, q, v, a, lam, torques, sensitivity, work)
    note_torques(signals, t, torques)
    here = rounding.baumgarte_weights(controls, controls.alpha, controls.beta, length)
    return respond_to_parameter(
        system, g, g * g, here, controls.dependent_part, q, v, a, lam, least, i, torques, sensitivity, direction, space,
        work,
    )  # fmt: skip


@releases_lock
def sensitivity_steps(
    system, signals, moved, moved_signals, pieces, tableau, controls, count, history, sensitivity, direction, space,
    torques, work, out,
):  # fmt: skip
    """Compute derivatives of the motion by one parameter over the first `count` steps of a history.

    Parameters
    ----------
    moved, moved_signals : tuples of 4
        Packed system and signals with the parameter moved by PLACES times DIFFERENCE_STEP.
    pieces : tuple of 4 Signals
        Scratch, from `make_piece`.
    history : History
        Steps after `solve_steps_to_rounding`, with samples in `out`.
    sensitivity : Sensitivity
        State after the last steps: q[0] and v[0] and, unless the first step restarts, a[0] and lam[0].
    direction : Tangent
        Scratch.
    """
    last = tableau.c.size - 1
    # Discard the factor, which may belong to another parameter.
    work.step[0] = -1.0
    for k in range(count):
        h, sensitivity.left[k] = history.h[k], 0.0
        dt, dh, long = sensitivity.t[k], sensitivity.h[k], is_long(system, tableau, controls, h)
        for i in range(0 if history.restart[k] != 0 else 1, last + 1):
            length, d_length = (h, dh) if i > 0 else (0.0, 0.0)
            t, d_t = history.t[k] + tableau.c[i] * length, dt + tableau.c[i] * d_length
            g = tableau.A[i, i] * length
            if i > 0:
                start_sensitivity(tableau, i, k, g, history, sensitivity)
                copy(sensitivity.a[i - 1], sensitivity.a[i])
                copy(sensitivity.lam[i - 1], sensitivity.lam[i])
            q, v, a, lam = history.q[k, i], history.v[k, i], history.a[k, i], history.lam[k, i]
            left = stage_sensitivity(
                system, signals, moved, moved_signals, pieces, controls, t, d_t, length, d_length, g, q, v, a, lam,
                history.least, i, torques, sensitivity, direction, space, work,
            )  # fmt: skip
            sensitivity.left[k] = max(sensitivity.left[k], left)
            if not long:
                power_sensitivity(moved, pieces, t, d_t, i, q, v, sensitivity.v[i], lam, torques, sensitivity, work)
        for i in range(last + 1 if long else 0):
            t, d_t = history.t[k] + tableau.c[i] * h, dt + tableau.c[i] * dh
            q, v, dv, lam = history.q[k, i], work.v, work.x, history.lam[k, i]
            velocity_along_curve(tableau, k, tableau.c[i], 0.0, history, sensitivity, v, dv)
            take_pieces(signals, t, moved_signals, pieces)
            power_sensitivity(moved, pieces, t, d_t, i, q, v, dv, lam, torques, sensitivity, work)
        if sensitivity.taken[0] == 0 and sensitivity.times[0] <= history.t[k]:
            keep_sample(0, 0, sensitivity)
            sensitivity.taken[0] = 1
        g, dg, sample = tableau.A[last, last] * h, tableau.A[last, last] * dh, last + 1
        i = sensitivity.taken[0]
        while i < sensitivity.times.size and sensitivity.times[i] <= history.t[k] + h * (1.0 + 1e-12):
            sensitivity_at_sample(tableau, k, i, long, history, sensitivity)
            if out.solved[i]:
                for j in range(sensitivity.f.size):
                    da, jump = sensitivity.sample_a[i, j], out.a[i, j] - sensitivity.moved_v[j]
                    sensitivity.q[sample, j] = sensitivity.sample_q[i, j] - g * g * da + 2.0 * g * dg * jump
                    sensitivity.v[sample, j] = sensitivity.sample_v[i, j] - g * da + dg * jump
                copy(sensitivity.sample_a[i], sensitivity.a[sample])
                copy(sensitivity.sample_lam[i], sensitivity.lam[sample])
                left = stage_sensitivity(
                    system, signals, moved, moved_signals, pieces, controls, out.times[i], sensitivity.sample_times[i],
                    h, dh, g, out.q[i], out.v[i], out.a[i], out.lam[i], history.least, sample, torques, sensitivity,
                    direction, space, work,
                )  # fmt: skip
                sensitivity.left[k] = max(sensitivity.left[k], left)
                keep_sample(sample, i, sensitivity)
            i += 1
        sensitivity.taken[0] = i
        done, d_done = work_sensitivity(tableau, k, history, sensitivity)
        sensitivity.work[0] += done
        sensitivity.work[1] += d_done
        copy(sensitivity.q[last], sensitivity.q[0])
        copy(sensitivity.v[last], sensitivity.v[0])
        copy(sensitivity.a[last], sensitivity.a[0])
        copy(sensitivity.lam[last], sensitivity.lam[0])
        sensitivity.power[0] = sensitivity.power[last]


@routine
def keep_sample(stage, i, sensitivity):
    """Copy the derivatives of a stage to those of sample i."""
    copy(sensitivity.q[stage], sensitivity.sample_q[i])
    copy(sensitivity.v[stage], sensitivity.sample_v[i])
    copy(sensitivity.a[stage], sensitivity.sample_a[i])
    copy(sensitivity.lam[stage], sensitivity.sample_lam[i])


@routine
def start_sensitivity(tableau, i, k, g, history, sensitivity):
    """Compute q[i] and v[i] of the sensitivity without the stage's own a: the derivative of `step.stage_start`."""
    h, dh = history.h[k], sensitivity.h[k]
    for j in range(sensitivity.q.shape[1]):
        dv, dq = sensitivity.v[0, j], sensitivity.q[0, j]
        for s in range(i):
            dv += tableau.A[i, s] * (h * sensitivity.a[s, j] + dh * history.a[k, s, j])
            dq += tableau.A[i, s] * (h * sensitivity.v[s, j] + dh * history.v[k, s, j])
        dv += tableau.A[i, i] * dh * history.a[k, i, j]
        dq += tableau.A[i, i] * dh * history.v[k, i, j]
        sensitivity.v[i, j] = dv
        sensitivity.q[i, j] = dq + g * dv
