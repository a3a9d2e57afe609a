"""The implicit stage solver: equations of motion and constraints, solved for accelerations and multipliers.

With q = q* + b a and v = v* + g a the unknowns of a stage are a and lambda,

    M a + h + K q + Phi_q^T lambda - F = 0
    w_a Phi'' + w_v Phi' + w_q Phi = 0

Weights (1, 2 alpha, beta^2) make the second line Baumgarte's (Eqs. 56-57, index 1), (0, 1, 0) that of index 2 and
(0, 0, 1) that of index 3. DIRK schemes have g = d h and b = g^2, the Newmark family other numbers; one solver serves
all. The iteration matrix is [M + b K, Phi_q^T; Phi_q, 0]: gyroscopic terms are dropped, and the constraint row is
divided by w_a + w_v g + w_q b, which makes it symmetric and keeps it well conditioned however small the step.
"""

from __future__ import annotations

from math import isfinite

from paraflex.kernel.arrays import add, largest
from paraflex.kernel.axes import apply_axes
from paraflex.kernel.bodies import begin_body
from paraflex.kernel.compiling import inlined, routine, unoptimised
from paraflex.kernel.constraints import constraint_values
from paraflex.kernel.factor import factor_bodies
from paraflex.kernel.joints import (
    add_joints,
    add_motors,
    apply_lines,
    apply_loads,
    finish_friction,
    start_compliant_rows,
    start_rows,
)
from paraflex.kernel.linear import SINGULAR_PART, orient, right_hand_side, solve_system
from paraflex.kernel.metric import mass_norm
from paraflex.kernel.near import hold_rows
from paraflex.kernel.projection import least_change
from paraflex.kernel.signals import evaluate_signal
from paraflex.kernel.sums import hand_on

MAX_ITERATIONS, NEAR_ITERATIONS = 8, 24
# SLOW: it still contracts after so many iterations.
CONVERGED, DIVERGED, SINGULAR, SLOW = range(4)
# The slowest contraction worth going on with, assumed of a new factor until one is measured.
WORST_CONTRACTION = 0.5
# After a guess that was right but for a direction that the norm hardly sees, the second change may be larger than the
# first by so much.
SECOND_CONTRACTION = 20.0
# Forces below this part of the largest, N and N m alike, are controlled as if they had it.
SMALL_FORCE = 1e-2
# A factor ages: the contraction assumed of it grows by this much with every stage that does not measure it. It is not
# taken to be better than this: motion that sets in makes it worse at once.
AGEING, BEST_CONTRACTION = 1.05, 0.02
# Changes that fall no more are rounding where they are smaller than this part of the accelerations, or where they
# move nothing further than this part of the mechanism's size: there are no more digits to be had.
ROUNDING, FINEST = 1e-8, 4e-15


@unoptimised
def equations(system, signals, t, weights, q, v, a, lam, torques, work):
    """Residuals of the equations of motion (work.f) and of the constraints (work.rows) at one instant.

    The latter are w_a Phi'' + w_v Phi' + w_q Phi for weights (w_a, w_v, w_q).
    """
    note_torques(signals, t, torques)
    residuals(system, signals, t, weights, q, v, a, lam, torques, work)


@inlined
def note_torques(signals, t, torques):
    """Torques of the motors, and of loads what is given in time, at a time."""
    for k in range(torques.size):
        torques[k] = evaluate_signal(signals, k, t)[0]


@routine
def residuals(system, signals, t, weights, q, v, a, lam, torques, work):
    """Residuals as by `equations`, with given torques."""
    start_rows(system, signals, t, weights, work.rows)
    start_compliant_rows(system, lam, work.rows)
    for i in range(system.bodies.size):
        begin_body(system, i, q, v, a, work.f, work.scratch, work.scratch.points)
        add_joints(system, i, q, v, a, lam, weights, work.scratch, work.f, work.rows)
        add_motors(system, i, torques, work.scratch, work.f)
        hand_on(system, i, work.scratch, work.f)
    apply_axes(system, q, v, a, lam, weights, torques, work.f, work.rows)
    finish_friction(system, lam, work.compliance, work.rows)
    apply_loads(system, q, torques, work.f)
    apply_lines(system, q, v, work.f)


@routine
def solve_stage(
    system, signals, t, g, b, weights, qs, vs, a, lam, shift, torques, newton_tolerance, time_scale, contraction,
    dependent_part, renew, held, lag, peaks, force_tolerance, work,
):  # fmt: skip
    """Newton iteration for one stage; a and lam are starting guesses and then the solution.

    Parameters
    ----------
    qs, vs : (n,) arrays
        The explicit parts q*, v*.
    shift : (n,) array
        Of stabilised index 2 (Gear, Gupta and Leimkuhler): what q takes besides, such that Phi = 0 as well; a guess
        and then the solution. Empty for all else.
    newton_tolerance : float
        Largest error left in q, in the mass norm; in v it is newton_tolerance / time_scale.
    contraction : float
        Contraction measured in earlier stages with this factor.
    dependent_part : float
        See `factor_schur`.
    renew : bool
        Whether every iteration factors the matrix where it stands, as near a singular position.
    peaks, force_tolerance : (m,) array, float
        Largest error left in each multiplier, as a part of these; zero where positions alone count. Where constraints
        leave nothing free accelerations tell nothing of multipliers.
    held, lag : float
        There what rows say is trusted as far as these tell: see `hold_rows`.

    Returns
    -------
    status, iterations, contraction
        work.q and work.v hold the stage's q and v.
    """
    scale = 1.0 / (weights[0] + weights[1] * g + weights[2] * b)
    previous = 0.0
    note_torques(signals, t, torques)
    for iteration in range(1, (NEAR_ITERATIONS if renew else MAX_ITERATIONS) + 1):
        place(qs, vs, g, b, a, shift, work)
        if renew:
            factor_bodies(system, b, work.q, work)
            orient(system, work.q, work, dependent_part)
            if work.least[0] < SINGULAR_PART:
                return SINGULAR, iteration, contraction
        residuals(system, signals, t, weights, work.q, work.v, a, lam, torques, work)
        right_hand_side(system, work, scale)
        if renew:
            hold_rows(system, work, held, lag, work.mu, work.rows)
        solve_system(system, work, work.x, work.mu)
        add(work.x, a)
        add(work.mu, lam)
        size = mass_norm(system, work, work.x)
        change = size * max(b, g * time_scale)
        if force_tolerance > 0.0:
            change = max(change, newton_tolerance / force_tolerance * largest_part(work.mu, peaks))
        if shift.size > 0:
            place(qs, vs, g, b, a, shift, work)
            constraint_values(system, signals, t, work.q, work.v, work.scratch, work.rows, work.mu)
            if renew:
                hold_rows(system, work, held, 0.0, work.rows, work.mu)
            least_change(system, work.rows, work)
            add(work.x, shift)
            change = max(change, mass_norm(system, work, work.x))
        if not isfinite(change):
            return DIVERGED, iteration, contraction
        if iteration > 1:
            contraction = change / previous
            # From a good guess the second change may be larger than the first; from then on each has to be smaller.
            if change > newton_tolerance and contraction > (
                SECOND_CONTRACTION if iteration == 2 else WORST_CONTRACTION
            ):
                if b * size > FINEST * system.size and size > ROUNDING * mass_norm(system, work, a):
                    return DIVERGED, iteration, contraction
                contraction = 0.0
        else:
            contraction = min(WORST_CONTRACTION, max(BEST_CONTRACTION, AGEING * contraction))
        if change * contraction <= newton_tolerance * (1.0 - min(contraction, WORST_CONTRACTION)):
            place(qs, vs, g, b, a, shift, work)
            return CONVERGED, iteration, min(contraction, WORST_CONTRACTION)
        previous = change
    return SLOW, MAX_ITERATIONS, contraction


@inlined
def largest_part(mu, peaks):
    """The largest of multipliers relative to peaks, of which small ones count as a part of the largest."""
    part, least = 0.0, SMALL_FORCE * largest(peaks)
    for r in range(mu.size):
        part = max(part, abs(mu[r]) / max(peaks[r], least))
    return part


@inlined
def place(qs, vs, g, b, a, shift, work):
    """Positions and velocities of a stage into work.q and work.v."""
    for j in range(a.size):
        work.q[j] = qs[j] + b * a[j]
        work.v[j] = vs[j] + g * a[j]
    for j in range(shift.size):
        work.q[j] += shift[j]
