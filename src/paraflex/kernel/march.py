"""Time loop: accepted and rejected steps, step size control, energy, dense output."""

from math import ceil, inf, pi, sqrt

from . import indices as at, samples
from .arrays import copy, fill, last_before
from .bodies import stored_energy
from .compiling import kernel, releases_lock, routine
from .constraints import constraint_values, note_friction
from .error import note_errors
from .factor import factor_bodies
from .guesses import note_inertias
from .linear import SINGULAR_PART, orient
from .metric import mass_norm
from .near import note_crossing
from .newmark import restart_algorithmic
from .packed import INDEX_1
from .projection import project
from .run_state import BAUMGARTE, ENTERS, ERROR_TEST, FINISHED, LAW_FAILED, PAUSED, PROJECTION
from .sampled import CHANGED, FAILED, SLACK, control, next_instant
from .stage import solve_linear
from .step import attempt, input_power

SAFETY, MIN_FACTOR, MAX_FACTOR = 0.8, 0.2, 2.0
# Step size after a jump, relative to one in which the jump moves the mechanism by the tolerance.
AFTER_JUMP = 1e-3
# Errors of vibrations vary within a period, so the step size depends on the previous error as well (Gustafsson 1994).
# No error counts as smaller than this part of the allowed one.
BY_ERROR, BY_LAST_ERROR, SMALLEST_ERROR = 0.7, 0.4, 1e-3
# A new step size within these factors of the old one is not worth a new factorisation.
KEEP_ABOVE, KEEP_BELOW = 0.92, 1.2
# Largest distance from the constraints at which a run can enter a singular position, in errors allowed there.
ENTRY = 100.0
# Near a singular position: least change of the root per step, as a part of its largest value.
LEAST_PACE = 3e-3
# Near a singular position the step size may double if the error is below this part of the allowed one.
GROWING = 0.05
# The step size does not grow if the smallest relative pivot is below this part: rounding would hide a contribution
# of elasticity alone.
LEAST_PART = 1e-11
# A fixed step in which Newton's iteration does not converge is divided, down to this part of it.
SMALLEST_PART = 1e-4
TURN = 2.0 * pi
# Steps whose sizes differ by less than this part of them, by rounding, count as equal.
SAME_STEP = 1e-11


@routine
def first_stage(system, signals, t, controls, march, work):
    """Solve for accelerations and multipliers at (t, q, v) to rounding, as the first stage."""
    a, lam = march.stage_a[1, 0], march.stage_lam[1, 0]
    note_friction(system, march.q, march.v, work.mu, work.compliance)
    factor_bodies(system, 0.0, march.q, work)
    orient(system, march.q, work, controls.dependent_part)
    march.clock[at.FACTOR_B] = -1.0
    if work.least[0] < SINGULAR_PART and march.counts[at.STEPS] > 0:
        return
    weights = INDEX_1
    if controls.treatment == BAUMGARTE and controls.gain == 0.0:
        weights = (1.0, 2.0 * controls.alpha, controls.beta * controls.beta)
    solve_linear(system, signals, t, weights, march.q, march.v, a, lam, march.torques, work)


@routine
def enter(system, signals, t, controls, march, work):
    """Project the state onto the constraints near a singular position, as residuals would grow there.

    If no position on the constraints is close enough, the mechanism is driven beyond its reach and cannot pass.
    """
    copy(march.q, march.eq)
    copy(march.v, march.ev)
    project(system, signals, t, march.q, march.v, work)
    for j in range(march.q.size):
        work.x[j] = march.q[j] - march.eq[j]
    march.counts[at.PREPARED] = 1
    if not mass_norm(system, work, work.x) <= ENTRY * controls.near_error:
        copy(march.eq, march.q)
        copy(march.ev, march.v)
        march.counts[at.PREPARED] = -1
        return
    copy(march.q, march.stage_q[0])
    copy(march.v, march.stage_v[0])
    copy(march.v, march.stage_d[0])
    first_stage(system, signals, t, controls, march, work)


@routine
def begin(system, signals, controls, march, work):
    """Compute the first stage of a run, or after a jump."""
    t = march.clock[at.TIME]
    march.counts[at.JUMPED] = 0
    first_stage(system, signals, t, controls, march, work)
    a, lam = march.stage_a[1, 0], march.stage_lam[1, 0]
    # Starting guesses must not extrapolate across a jump: stages before it do not count as other times.
    fill(march.stage_t[0], t)
    march.stage_t[1, 0] = t
    copy(march.q, march.stage_q[0])
    copy(march.v, march.stage_v[0])
    copy(march.v, march.stage_d[0])
    copy(a, march.algorithmic[0])
    march.clock[at.LAST_STEP], march.clock[at.LAST_ERROR] = 0.0, 1.0
    march.clock[at.PART_END] = t
    march.clock[at.ROOT_RATE], march.counts[at.ROOT_STEP] = 0.0, -1
    march.power[0] = input_power(system, signals, t, march.q, march.v, lam, march.torques, work)
    note_constraints(system, signals, t, march, work)


@routine
def resume(system, signals, controls, march, work, aside):
    """Compute the first stage after a jump with a matrix in the workspace `aside`, so that the factor in use stays.

    If the change of acceleration would move the mechanism by the tolerance in a step as long as the last one, the next
    step is much shorter than a step in which it would: the error estimate of a long step does not contain the effect of
    a jump.
    """
    factor = march.clock[at.FACTOR_B]
    copy(work.redundant, aside.redundant)
    copy(march.stage_a[1, 0], march.eq)
    begin(system, signals, controls, march, aside)
    march.clock[at.FACTOR_B] = factor
    for j in range(march.eq.size):
        march.eq[j] -= march.stage_a[1, 0, j]
    change = mass_norm(system, aside, march.eq)
    if controls.fixed_step == 0.0 and change * march.clock[at.STEP] ** 2 > 2.0 * controls.tolerance:
        march.clock[at.STEP] = AFTER_JUMP * sqrt(2.0 * controls.tolerance / change)


@kernel
def start(system, signals, controls, march, work, out):
    """Compute the first stage and the first sample of a run."""
    note_inertias(system, march)
    begin(system, signals, controls, march, work)
    t, a, lam = march.clock[at.TIME], march.stage_a[1, 0], march.stage_lam[1, 0]
    kinetic, strain, march.clock[at.WEIGHT_0] = stored_energy(system, march.q, march.v, lam, work.scratch)
    march.clock[at.ENERGY_0] = kinetic + strain
    if out.times.size > 0 and out.times[0] <= t:
        copy(march.q, out.q[0])
        copy(march.v, out.v[0])
        copy(a, out.a[0])
        copy(lam, out.lam[0])
        out.energy[0, 0], out.energy[0, 1], out.energy[0, 2] = kinetic, strain, 0.0
        march.counts[at.SAMPLE] = 1


@routine
def note_constraints(system, signals, t, march, work):
    """Record the largest constraint violation at accepted steps."""
    constraint_values(system, signals, t, march.q, march.v, work.scratch, work.rows, work.mu)
    for r in range(work.rows.size):
        march.clock[at.PHI_MAX] = max(march.clock[at.PHI_MAX], abs(work.rows[r]))
        march.clock[at.DPHI_MAX] = max(march.clock[at.DPHI_MAX], abs(work.mu[r]))


@routine
def note_cycle(system, controls, march):
    """Update the time in which errors may add up to the tolerance.

    It is the time of one revolution of the fastest body so far, at most that of the run. A body whose speed is the size
    of the mechanism per second counts as rotating at 1 rad/s.
    """
    if controls.by_cycle == 0:
        return
    for i in range(system.bodies.size):
        o = system.bodies[i].offset
        rate = max(abs(march.v[o + 2]), sqrt(march.v[o] ** 2 + march.v[o + 1] ** 2) / system.size)
        march.clock[at.FASTEST] = max(march.clock[at.FASTEST], rate)
    if march.clock[at.FASTEST] * controls.span > TURN:
        march.clock[at.CYCLE] = TURN / march.clock[at.FASTEST]


@routine
def resolved(controls, t, h, march):
    """Return a step size of at most h from t that resolves the inputs, and the rotation of forces on bodies."""
    for j in controls.turning:
        if abs(march.v[j]) * h > controls.turn_in_step:
            h = controls.turn_in_step / abs(march.v[j])
    k = last_before(controls.limit_t, 0, controls.limit_t.size - 1, t)
    while k < controls.limit_t.size and controls.limit_t[k] < t + h:
        h = min(h, max(controls.limit_h[k], controls.limit_t[k] - t))
        k += 1
    return h


@routine
def accept(system, signals, tableau, controls, t, h, march, work, out, aside):
    """Accept the step: advance, sample, count, and keep the stages for the next starting guess."""
    last = tableau.c.size - 1
    if march.counts[at.NEAR] > 0:
        note_crossing(system, t, h, march, work)
    if controls.treatment == PROJECTION and march.counts[at.NEAR] == 0:
        project(system, signals, t + h, march.stage_q[last], march.stage_v[last], work)
    long = samples.is_long(system, tableau, controls, h)
    if long:
        samples.power_along_curve(system, signals, tableau, t, h, march, work)
    first = samples.place_samples(tableau, t, h, long, march, out)
    samples.solve_samples(system, signals, controls, t, h, first, march, work, out, aside)
    samples.write_energies(system, tableau, t, h, first, march, work, out)
    copy(march.stage_q[last], march.q)
    copy(march.stage_v[last], march.v)
    march.clock[at.WORK] += samples.step_work(tableau, h, march)
    march.clock[at.LAST_STEP] = h
    copy(march.stage_t[1], march.stage_t[0])
    for s in range(last + 1):
        copy(march.stage_a[1, s], march.stage_a[0, s])
        copy(march.stage_lam[1, s], march.stage_lam[0, s])
    march.stage_t[1, 0] = t + h
    copy(march.q, march.stage_q[0])
    copy(march.v, march.stage_v[0])
    copy(march.stage_d[last], march.stage_d[0])
    copy(march.algorithmic[1], march.algorithmic[0])
    copy(march.stage_a[0, last], march.stage_a[1, 0])
    copy(march.stage_lam[1, last], march.stage_lam[1, 0])
    march.power[0] = march.power[last]
    march.counts[at.STEPS] += 1
    march.counts[at.FAILURES] = 0
    march.counts[at.DRIFTED] = march.counts[at.HELD_END]
    if march.counts[at.NEAR] == 0:
        march.counts[at.PREPARED] = 0
    note_errors(controls, h, march)
    note_cycle(system, controls, march)
    kinetic, strain, weight = stored_energy(system, march.q, march.v, march.stage_lam[1, 0], work.scratch)
    done = march.clock[at.WORK] + weight - march.clock[at.WEIGHT_0]
    balance = abs(kinetic + strain - march.clock[at.ENERGY_0] - done)
    march.clock[at.BALANCE] = max(march.clock[at.BALANCE], balance)
    note_constraints(system, signals, t + h, march, work)


@releases_lock
def march(system, signals, tableau, controls, stops, max_steps, march, work, slow, out, law, aside):
    """Advance by up to max_steps attempted steps, with steps that end exactly at each of the times in `stops`.

    Under a sampled controller steps also end at its sample and actuation times, and actions due at the start come
    first.

    Returns
    -------
    int
        PAUSED, FINISHED, LAW_FAILED, or the cause of a failure.
    """
    if law.counts.size == 0:
        if march.counts[at.JUMPED] == 1:
            resume(system, signals, controls, march, work, aside)
        return advance(system, signals, tableau, controls, stops, inf, 0.0, max_steps, march, work, slow, out, aside)
    most = march.counts[at.STEPS] + march.counts[at.REJECTED] + max_steps
    while True:
        t = march.clock[at.TIME]
        done = control(law, signals, t, march.q, march.v, march.stage_a[1, 0])
        if done == FAILED:
            return LAW_FAILED
        taken = march.counts[at.STEPS] + march.counts[at.REJECTED]
        if done == CHANGED and taken == 0:
            start(system, signals, controls, march, work, out)
        elif done == CHANGED or march.counts[at.JUMPED] == 1:
            resume(system, signals, controls, march, work, aside)
        pause = next_instant(law)
        code = advance(
            system, signals, tableau, controls, stops, pause, law.clock[SLACK], most - taken, march, work, slow, out,
            aside,
        )  # fmt: skip
        if code != FINISHED or march.clock[at.TIME] >= stops[stops.size - 1]:
            return code


@routine
def advance(system, signals, tableau, controls, stops, pause, slack, max_steps, march, work, slow, out, aside):
    """Advance to the last of the stops, to a pause before it, or to a stop within a slack of the pause: see `march`."""
    exponent = 1.0 / tableau.order
    for _ in range(max_steps):
        t = march.clock[at.TIME]
        while march.counts[at.STOP] < stops.size and stops[march.counts[at.STOP]] <= t:
            march.counts[at.STOP] += 1
        if march.counts[at.STOP] == stops.size or t >= pause - slack:
            return FINISHED
        end, longest = stops[march.counts[at.STOP]], controls.fixed_step
        if end > pause + slack:
            end = pause
        if t < march.clock[at.PART_END]:
            end, longest = march.clock[at.PART_END], march.clock[at.PART]
        left = end - t
        h = min(march.clock[at.STEP], controls.max_step)
        landing = False
        if controls.fixed_step == 0.0:
            h = resolved(controls, t, h, march)
        if controls.fixed_step > 0.0:
            # Divide intervals between stops evenly.
            h = left / max(1.0, ceil(left / longest - 1e-6))
            # If only rounding differs, keep the step size, and with it the factor.
            if abs(h - march.clock[at.STEP]) <= 1e-9 * h:
                h = march.clock[at.STEP]
            march.clock[at.STEP] = h
        if left <= h * (1.0 + 1e-9):
            h, landing = left, True
        elif left < 2.0 * h and controls.fixed_step == 0.0:
            h = 0.5 * left
        # After a jump, if only rounding differs, keep the step size before it, and with it the factor.
        if march.clock[at.LAST_STEP] == 0.0 and abs(h - march.clock[at.TRIED]) <= SAME_STEP * h:
            h = march.clock[at.TRIED]
        march.clock[at.TRIED] = h
        cause, error = attempt(system, signals, tableau, controls, t, h, march, work, slow)
        if cause == ENTERS:
            enter(system, signals, t, controls, march, work)
            continue
        if cause == PAUSED and error <= 1.0:
            after_failure = march.counts[at.FAILURES] > 0
            accept(system, signals, tableau, controls, t, h, march, work, out, aside)
            march.clock[at.TIME] = end if landing else t + h
            if controls.fixed_step > 0.0:
                continue
            # Near a singular position the step size is constant, and not so small that rounding dominates.
            if march.counts[at.NEAR] > 0:
                pace = abs(march.clock[at.ROOT_RATE]) * h
                if pace < LEAST_PACE * sqrt(march.clock[at.WIDEST]) and error < GROWING and not after_failure:
                    march.clock[at.STEP] = MAX_FACTOR * h
                continue
            error = max(error, SMALLEST_ERROR) / SAFETY**tableau.order
            factor = error ** (-BY_ERROR * exponent) * march.clock[at.LAST_ERROR] ** (BY_LAST_ERROR * exponent)
            factor = min(MAX_FACTOR, factor)
            march.clock[at.LAST_ERROR] = error
            # Keep the step size, and with it the factor, unless the change is worth it; a step reduced to end at a stop
            # gives no information about longer ones.
            grows = h >= march.clock[at.STEP] and not after_failure and work.least[0] > LEAST_PART
            if factor < KEEP_ABOVE or (factor > KEEP_BELOW and grows):
                march.clock[at.STEP] = factor * h
            continue
        march.counts[at.REJECTED] += 1
        if controls.fixed_step > 0.0:
            if h <= SMALLEST_PART * controls.fixed_step:
                return cause
            if t >= march.clock[at.PART_END]:
                march.clock[at.PART_END] = end if landing else t + h
            march.clock[at.PART] = MIN_FACTOR * h
        if march.counts[at.FAILURES] == 1:
            # The first stage is the last stage of the previous step; its error may be too large for a shorter step.
            first_stage(system, signals, t, controls, march, work)
            if tableau.newmark.size > 0:
                restart_algorithmic(tableau.newmark, march)
        march.counts[at.FAILURES] += 1
        if controls.fixed_step > 0.0:
            continue
        if cause == PAUSED:
            cause = ERROR_TEST
            march.clock[at.STEP] = h * max(MIN_FACTOR, SAFETY * (1.0 / error) ** exponent)
        else:
            march.clock[at.STEP] = h * MIN_FACTOR
        if march.clock[at.STEP] < controls.least_step:
            return cause
    return PAUSED
