"""Steps of a run solved again to rounding, as the base of derivatives."""

from typing import Annotated, NamedTuple

from . import indices as at, samples
from .arrays import Floats, Ints, add, copy, largest
from .bending import note_all_axial_forces
from .bodies import stored_energy, weight_work
from .compiling import by_reference, inlined, kernel, releases_lock, routine
from .constraints import note_friction
from .factor import factor_bodies
from .krylov import exact_correction
from .linear import orient, solve_residuals
from .packed import INDEX_1
from .stage import equations, note_torques, place
from .step import baumgarte_gains, input_power, stage_start
from .tangent import note_slopes

# Corrections end if the next one is expected below the first bound, relative to the corrected values, or if they no
# longer decrease below the second bound; the third is the ratio from which on they count as not decreasing.
LAST_CORRECTION, NEARLY, FALLING = 2e-16, 1e-9, 0.5
# Largest number of corrections with the iteration matrix, and after these with the exact matrix.
MOST_CORRECTIONS, MOST_EXACT = 60, 20
# Accelerations and forces below this part of the largest of a run are solved with the absolute accuracy of that size.
NEGLIGIBLE = 1e-6


@by_reference
class History(NamedTuple):
    """Steps of a run in order, with the motion at every stage.

    Accelerations and multipliers are guesses until `solve_steps_to_rounding` has solved the steps.
    """

    t: Annotated[Floats, "steps"]  # start times
    h: Annotated[Floats, "steps"]  # step sizes
    restart: Annotated[Ints, "steps"]  # whether the first stage is solved again
    q: Annotated[Floats, "steps", "stages", "n"]
    v: Annotated[Floats, "steps", "stages", "n"]
    a: Annotated[Floats, "steps", "stages", "n"]
    lam: Annotated[Floats, "steps", "stages", "m"]
    power: Annotated[Floats, "steps", "stages"]
    left: Annotated[Floats, "steps"]  # largest last relative correction
    least: Annotated[Floats, 2]  # negligible sizes of accelerations and multipliers, or of their derivatives


@routine
def baumgarte_weights(controls, alpha, beta, h):
    """Return the weights of Phi'', Phi' and Phi in a step's stages; for h = 0 those of a first stage."""
    if h > 0.0:
        alpha, beta = baumgarte_gains(controls, alpha, beta, h)
    elif controls.gain > 0.0:
        return INDEX_1
    return 1.0, 2.0 * alpha, beta * beta


@routine
def ended(change, previous, iteration):
    """Return whether corrections have reached rounding, from the last two relative ones."""
    if iteration == 0:
        return change <= LAST_CORRECTION
    return change * change <= LAST_CORRECTION * previous or (change < NEARLY and change > FALLING * previous)


@inlined
def relative(x, mu, a, lam, least_a, least_lam):
    """Return the correction of accelerations and multipliers relative to these, or to their negligible sizes."""
    change, size = largest(x), max(largest(a), least_a)
    if size > 0.0:
        change /= size
    other, size = largest(mu), max(largest(lam), least_lam)
    if size > 0.0:
        change = max(change, other / size)
    return change


@routine
def prepare_matrix(system, b, q, v, a, lam, dependent_part, work):
    """Prepare the iteration matrix for a stage at (q, v, a, lambda)."""
    note_friction(system, q, v, work.mu, work.compliance)
    if work.step[0] != b or b == 0.0:
        note_all_axial_forces(system, q, v, a, lam, work, work.geometric)
        factor_bodies(system, b, q, work)
    orient(system, q, work, dependent_part)


@inlined
def multiplier_unit(least):
    """Return the unit of multipliers relative to accelerations: the ratio of the largest ones of a run."""
    return least[1] / least[0] if least[0] > 0.0 and least[1] > 0.0 else 1.0


@routine
def solve_to_rounding(system, signals, t, g, b, weights, dependent_part, march, a, lam, least, direction, space, work):
    """Solve a stage from march.qs and march.vs to rounding; return the last relative correction.

    The solution is in a and lam, with q and v in `work`. If corrections with the iteration matrix do not converge, they
    restart from the guess with the exact matrix.
    """
    scale = 1.0 / (weights[0] + weights[1] * g + weights[2] * b)
    change, previous = 0.0, 0.0
    copy(a, space.guess_a)
    copy(lam, space.guess_lam)
    for iteration in range(MOST_CORRECTIONS + MOST_EXACT):
        exact = iteration >= MOST_CORRECTIONS
        if iteration == MOST_CORRECTIONS:
            copy(space.guess_a, a)
            copy(space.guess_lam, lam)
        place(march.qs, march.vs, g, b, a, march.shift, work)
        if iteration == 0 or exact:
            prepare_matrix(system, b, work.q, work.v, a, lam, dependent_part, work)
        if exact:
            note_slopes(system, work.q, work.v, work.mu, work.compliance, direction)
        equations(system, signals, t, weights, work.q, work.v, a, lam, march.torques, work)
        solve_residuals(system, work, scale)
        if exact:
            unit = multiplier_unit(least)
            exact_correction(system, g, b, weights, work.q, work.v, a, lam, march.torques, unit, direction, space, work)
        add(work.x, a)
        add(work.mu, lam)
        change = relative(work.x, work.mu, a, lam, least[0], least[1])
        if ended(change, previous, iteration):
            break
        previous = change
    place(march.qs, march.vs, g, b, a, march.shift, work)
    return change


@releases_lock
def solve_steps_to_rounding(system, signals, tableau, controls, count, history, march, direction, space, work, out):
    """Solve the first `count` steps of a history again to rounding, from the state in `march`; samples into out.

    march holds q, v and, unless the first step restarts, the accelerations and multipliers of its first stage.
    """
    last = tableau.c.size - 1
    for k in range(count):
        for i in range(1, last + 1):
            history.least[0] = max(history.least[0], NEGLIGIBLE * largest(history.a[k, i]))
            history.least[1] = max(history.least[1], NEGLIGIBLE * largest(history.lam[k, i]))
    for k in range(count):
        t, h = history.t[k], history.h[k]
        history.left[k] = 0.0
        if history.restart[k] != 0:
            copy(march.q, march.qs)
            copy(march.v, march.vs)
            weights = baumgarte_weights(controls, controls.alpha, controls.beta, 0.0)
            history.left[k] = solve_to_rounding(
                system, signals, t, 0.0, 0.0, weights, controls.dependent_part, march, march.stage_a[1, 0],
                march.stage_lam[1, 0], history.least, direction, space, work,
            )  # fmt: skip
            march.power[0] = input_power(
                system, signals, t, march.q, march.v, march.stage_lam[1, 0], march.torques, work
            )
        copy(march.q, march.stage_q[0])
        copy(march.v, march.stage_v[0])
        if march.counts[at.SAMPLE] == 0 and out.times[0] <= t:
            copy(march.q, out.q[0])
            copy(march.v, out.v[0])
            copy(march.stage_a[1, 0], out.a[0])
            copy(march.stage_lam[1, 0], out.lam[0])
            out.energy[0, 2] = weight_work(system, march.q, work.scratch)
            march.counts[at.SAMPLE] = 1
        weights = baumgarte_weights(controls, controls.alpha, controls.beta, h)
        for i in range(1, last + 1):
            time, g, b = stage_start(tableau, i, t, h, march)
            copy(history.a[k, i], march.stage_a[1, i])
            copy(history.lam[k, i], march.stage_lam[1, i])
            left = solve_to_rounding(
                system, signals, time, g, b, weights, controls.dependent_part, march, march.stage_a[1, i],
                march.stage_lam[1, i], history.least, direction, space, work,
            )  # fmt: skip
            history.left[k] = max(history.left[k], left)
            copy(work.q, march.stage_q[i])
            copy(work.v, march.stage_v[i])
            march.power[i] = input_power(
                system, signals, time, work.q, work.v, march.stage_lam[1, i], march.torques, work
            )
        long = samples.is_long(system, tableau, controls, h)
        if long:
            samples.power_along_curve(system, signals, tableau, t, h, march, work)
        for i in range(last + 1):
            copy(march.stage_q[i], history.q[k, i])
            copy(march.stage_v[i], history.v[k, i])
            copy(march.stage_a[1, i], history.a[k, i])
            copy(march.stage_lam[1, i], history.lam[k, i])
            history.power[k, i] = march.power[i]
        first, g = samples.place_samples(tableau, t, h, long, march, out), tableau.A[last, last] * h
        for i in range(first, march.counts[at.SAMPLE]):
            if out.solved[i]:
                samples.explicit_parts(out.q[i], out.v[i], out.a[i], g, g * g, march)
                note_torques(signals, out.times[i], march.torques)
                left = solve_to_rounding(
                    system, signals, out.times[i], g, g * g, weights, controls.dependent_part, march, out.a[i],
                    out.lam[i], history.least, direction, space, work,
                )  # fmt: skip
                history.left[k] = max(history.left[k], left)
                copy(work.q, out.q[i])
                copy(work.v, out.v[i])
        samples.write_energies(system, tableau, t, h, first, march, work, out)
        march.clock[at.WORK] += samples.step_work(tableau, h, march)
        copy(march.stage_q[last], march.q)
        copy(march.stage_v[last], march.v)
        copy(march.stage_a[1, last], march.stage_a[1, 0])
        copy(march.stage_lam[1, last], march.stage_lam[1, 0])
        march.power[0] = march.power[last]


@kernel
def sample_energies(system, q, v, lam, scratch, out):
    """Compute kinetic energy, strain energy including springs, and work of gravity at samples, into out.

    q, v : (k, n) arrays; lam : (k, m) array; out : (k, 3) array.
    """
    for i in range(q.shape[0]):
        out[i, 0], out[i, 1], out[i, 2] = stored_energy(system, q[i], v[i], lam[i], scratch)
