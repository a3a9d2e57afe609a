"""One step of a scheme given as data: its stages and its error.

The scheme is diagonally implicit with an explicit first stage, and stiffly accurate: stage i has
q_i = q_n + h sum_j A_ij v_j and v_i = v_n + h sum_j A_ij a_j, which include its own v_i and a_i, and the last stage is
the first of the next step. The Newmark family takes its only stage from `kernel.newmark`.
"""

from math import isfinite

from . import indices as at, near
from .arrays import copy, fill, largest
from .axes import axis_power
from .bending import note_all_axial_forces
from .compiling import routine
from .constraints import dissipated_power, note_friction
from .error import allowed_part, embedded_error, filtered_error, force_error, history_error, note_lost_vibrations
from .factor import factor_bodies
from .guesses import extrapolate_accelerations, guess, learn
from .joints import line_energy, marker_angle, modal_damping_power
from .linear import SINGULAR_PART, orient
from .loads import line_power, load_power
from .newmark import newmark_end, newmark_start
from .packed import INDEX_1
from .run_state import ENTERS, GGL, NO_CONVERGENCE, NOT_FINITE, PAUSED, POSITION, PROJECTION
from .signals import evaluate_signal
from .stage import CONVERGED, SINGULAR, SLOW, WORST_CONTRACTION, place, solve_stage

# A new factor costs about as much as this many iterations, so it pays once the old one has cost as many more. In
# second-order geometry it costs more.
FACTOR_COST, BENT_FACTOR_COST = 2, 3
# With flexible bodies, schemes of more stages learn the weights of their guesses; others need no fewer iterations so.
LEARN_FROM = 3
# Number of steps that get a new factor each, after a factor that cost that much in its second step.
IMPATIENCE = 20
# Largest number of times that a stage is continued: with friction slopes at its current rates, or since it contracts
# and the step size is fixed.
ROUNDS = 6
# Assumed duration of a velocity error that Newton's iteration leaves, as a fraction of the cycle: it must count for
# more than one step, since it has the same sign while a factor is in use.
NEWTON_MEMORY = 0.02
# Part of the error allowed in forces that Newton's iteration may leave, if forces are controlled.
FORCE_FRACTION = 0.03
# Largest Baumgarte coefficients, times the step size.
LARGEST_GAIN = 0.3


@routine
def input_power(system, signals, t, q, v, lam, torques, work):
    """Return the power of the motors, of prescribed motion and of loads, less that of dampers, friction and damping."""
    registers = work.scratch.registers
    total = load_power(system, q, v, torques, registers) + line_power(system, q, v, torques, registers)
    total += axis_power(system, q, v, torques) - line_energy(system, q, v)[1]
    total -= dissipated_power(system, q, v, lam, work.mu) + modal_damping_power(system, v)
    for k in range(system.motor_sides.size):
        side = system.motor_sides[k]
        total += side.sign * torques[side.signal] * marker_angle(system, system.markers[side.marker], v)
    for r in range(system.rows.size):
        if system.rows[r].signal >= 0:
            _, rate, _ = evaluate_signal(signals, system.rows[r].signal, t)
            total -= lam[r] * rate
    return total


@routine
def renew_factor(system, b, march, work):
    """Factor the bodies for stages with this b at the current deformation."""
    note_all_axial_forces(system, march.q, march.v, march.stage_a[1, 0], march.stage_lam[1, 0], work, work.geometric)
    factor_bodies(system, b, march.q, work)
    march.counts[at.FACTORS] += 1
    march.clock[at.FACTOR_B], march.clock[at.CONTRACTION] = b, WORST_CONTRACTION


@routine
def note_excess(system, iterations, fresh, march):
    """Count the cost of a step beyond that of the first step of its factor, and request a new factor if it is large.

    If it is large in the second step of a factor, the next steps get a new factor each.
    """
    cost = FACTOR_COST if system.bending is None else BENT_FACTOR_COST
    if fresh:
        march.counts[at.FRESH] = (
            min(iterations, march.counts[at.FRESH] + 1) if march.counts[at.FRESH] > 0 else iterations
        )
        march.counts[at.EXCESS], march.counts[at.REUSED] = 0, 0
        march.counts[at.IMPATIENT] = max(0, march.counts[at.IMPATIENT] - 1)
        if march.counts[at.IMPATIENT] > 0:
            march.clock[at.FACTOR_B] = -1.0
        return
    march.counts[at.REUSED] += 1
    march.counts[at.EXCESS] += max(0, iterations - march.counts[at.FRESH])
    if march.counts[at.EXCESS] >= cost:
        march.clock[at.FACTOR_B] = -1.0
        if march.counts[at.REUSED] == 1 and march.counts[at.EXCESS] > cost:
            march.counts[at.IMPATIENT] = IMPATIENCE


@routine
def stage_start(tableau, i, t, h, march):
    """Compute the explicit parts of stage i into march.qs and march.vs; return its time, g and b."""
    g = tableau.A[i, i] * h
    for j in range(march.q.size):
        march.vs[j] = march.v[j]
        march.qs[j] = march.q[j]
    for s in range(i):
        weight = h * tableau.A[i, s]
        for j in range(march.q.size):
            march.vs[j] += weight * march.stage_a[1, s, j]
            march.qs[j] += weight * march.stage_d[s, j]
    for j in range(march.q.size):
        march.qs[j] += g * march.vs[j]
    return t + tableau.c[i] * h, g, g * g


@routine
def baumgarte_gains(controls, alpha, beta, h):
    """Return Baumgarte's coefficients for a step: in long steps no larger than needed for decay within the step.

    Larger coefficients would turn the residual that Newton's iteration leaves in the constraints into more than the
    accelerations of slow motions.
    """
    if controls.gain > 0.0:
        return controls.gain / h, controls.gain / h
    return min(alpha, LARGEST_GAIN / h), min(beta, LARGEST_GAIN / h)


@routine
def constraint_weights(controls, h):
    """Return the weights of Phi'', Phi' and Phi in the stage equations, and the `gains` of `filtered_error`."""
    if controls.treatment == POSITION:
        return (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)
    if controls.treatment == GGL:
        return (0.0, 1.0, 0.0), (0.0, 0.0, 0.0)
    if controls.treatment == PROJECTION:
        return INDEX_1, (0.0, 0.0, 0.0)
    alpha, beta = baumgarte_gains(controls, controls.alpha, controls.beta, h)
    return (1.0, 2.0 * alpha, beta * beta), (1.0, alpha, beta)


@routine
def attempt(system, signals, tableau, controls, t, h, march, work, slow):
    """Attempt one step from t: all stages and the error estimate, relative to the allowed error.

    Returns
    -------
    cause, error
        Cause of the return, PAUSED if the stages were solved, and relative error.
    """
    stages, one_stage = tableau.c.size, tableau.newmark.size > 0
    weights, gains = constraint_weights(controls, h)
    x, g, b = t, tableau.A[1, 1] * h, (tableau.A[1, 1] * h) ** 2
    if one_stage:
        x, g, b = newmark_start(tableau.newmark, t, h, march)
    fresh = march.clock[at.FACTOR_B] != b
    if fresh:
        if near.elastic_measure_changes(system, b, march):
            # The rate of change of the root is computed from matrices with the same b, that of the last step.
            orient(system, march.q, work, controls.dependent_part)
            near.note_root(system, march, work)
        renew_factor(system, b, march, work)
    rubs = note_friction(system, march.q, march.v, work.mu, work.compliance)
    orient(system, march.q, work, controls.dependent_part)
    at_singular = work.least[0] < SINGULAR_PART
    near.note_root(system, march, work)
    perhaps_near = work.least[0] < near.NEAR_PART * march.clock[at.WIDEST] and march.counts[at.PREPARED] >= 0
    march.counts[at.NEAR], march.counts[at.HELD_END] = 0, 0
    if perhaps_near and near.comes_near(h, march):
        if march.counts[at.PREPARED] == 0:
            return ENTERS, 0.0
        near.begin_near(system, march, work)
    allowed = controls.tolerance * h / march.clock[at.CYCLE]
    newton_tolerance, newton_memory = controls.newton_fraction * allowed, NEWTON_MEMORY * march.clock[at.CYCLE]
    force, force_tolerance = largest(march.forces[at.PEAK]), 0.0
    if controls.force_part > 0.0 and force > 0.0:
        force_tolerance = FORCE_FRACTION * allowed_part(controls, h, march)
        newton_tolerance = min(
            newton_tolerance, force_tolerance * force / system.total_mass * max(b, g * newton_memory)
        )
    before = march.counts[at.ITERATIONS]
    learns = stages > LEARN_FROM and system.modal.shape[1] > 0
    i, rounds, held = 1, 0, 0.0
    while i < stages:
        if not one_stage:
            x, g, b = stage_start(tableau, i, t, h, march)
        march.stage_t[1, i] = t + tableau.c[i] * h
        held, lag = near.trust(weights, g, b, x - t, march)
        if rounds == 0:
            guess(i, (x - t) / h, h, learns, march.counts[at.NEAR] > 0, tableau, march)
            fill(march.shift, 0.0)
        status, iterations, contraction = solve_stage(
            system, signals, x, g, b, weights, march.qs, march.vs, march.stage_a[1, i], march.stage_lam[1, i],
            march.shift, march.torques, newton_tolerance, newton_memory, march.clock[at.CONTRACTION],
            controls.dependent_part, march.counts[at.NEAR] > 0, held, lag, march.forces[at.PEAK], force_tolerance, work,
        )  # fmt: skip
        march.counts[at.ITERATIONS] += iterations
        march.clock[at.CONTRACTION] = contraction
        if status == SINGULAR:
            if at_singular:
                near.note_passage(t, h, march)
                march.counts[at.NEAR], perhaps_near, rounds = 0, False, 0
                continue
            near.note_position(march.stage_t[1, i], t, h, march)
            # The constraints do not determine the accelerations here, so they are extrapolated.
            extrapolate_accelerations(i, (x - t) / h, h, tableau, march)
            place(march.qs, march.vs, g, b, march.stage_a[1, i], march.shift, work)
        elif status != CONVERGED:
            if fresh and perhaps_near and march.counts[at.NEAR] == 0 and not at_singular:
                if march.counts[at.PREPARED] == 0:
                    return ENTERS, 0.0
                near.begin_near(system, march, work)
                rounds = 0
                continue
            can_continue = rubs or (status == SLOW and controls.fixed_step > 0.0)
            if fresh and (rounds == ROUNDS or not can_continue):
                return NO_CONVERGENCE, 0.0
            rounds = rounds + 1 if can_continue else 0
            # The cause may be an old factor: try again with a new one before the step is reduced.
            if not fresh:
                renew_factor(system, b, march, work)
                fresh = True
            if rubs:
                note_friction(system, march.q, work.v, work.mu, work.compliance)
            orient(system, march.q, work, controls.dependent_part)
            continue
        elif learns and iterations > 1 and march.counts[at.NEAR] == 0:
            learn(i, (x - t) / h, h, tableau, march)
        rounds = 0
        if one_stage:
            varying = controls.fixed_step == 0.0 or t < march.clock[at.PART_END]
            newmark_end(system, signals, tableau.newmark, varying, t, h, march, work)
        copy(work.q, march.stage_q[i])
        copy(work.v, march.stage_v[i])
        if march.shift.size > 0:
            for j in range(march.q.size):
                march.stage_d[i, j] = work.v[j] + march.shift[j] / g
        march.power[i] = input_power(
            system, signals, march.stage_t[1, i], work.q, work.v, march.stage_lam[1, i], march.torques, work
        )
        i += 1
    march.clock[at.STAGE_G], march.clock[at.STAGE_B] = g, b
    note_excess(system, march.counts[at.ITERATIONS] - before, fresh, march)
    moved = 0.0
    if march.counts[at.NEAR] > 0:
        march.clock[at.FACTOR_B] = -1.0
        moved = near.return_to_constraints(system, signals, t + h, held, march, work) / controls.near_error
    error = 0.0
    if controls.fixed_step == 0.0:
        if tableau.error.size > 0:
            embedded_error(tableau, h, march)
        else:
            history_error(h, march)
        error_q, error_v = filtered_error(system, b**0.5, gains, march, work, slow)
        if march.counts[at.NEAR] > 0:
            allowed = max(allowed, controls.near_error * near.share_of_passage(h, march))
        note_lost_vibrations(system, controls, h, b**0.5, march, work)
        error = max(max(error_q, error_v) / allowed, moved, force_error(controls, h, march))
    if not isfinite(error):
        return NOT_FINITE, 0.0
    return PAUSED, error
