"""Implicit stage solver: equations of motion and constraints, solved for accelerations and multipliers.

With q = q* + b a and v = v* + g a the unknowns of a stage are a and lambda,

    M a + h + K q + Phi_q^T lambda - F = 0
    w_a Phi'' + w_v Phi' + w_q Phi = 0

With the weights (1, 2 alpha, beta^2) the second line is Baumgarte's (Eqs. 56-57, index 1), with (0, 1, 0) it is that of
index 2, with (0, 0, 1) that of index 3. DIRK schemes have g = d h and b = g^2, the Newmark family has other values; one
solver serves all. The iteration matrix is [M + b K, Phi_q^T; Phi_q, 0]: gyroscopic terms are dropped, and the
constraint row is divided by w_a + w_v g + w_q b, which makes the matrix symmetric and well conditioned for any step
size.
"""

from math import isfinite

from . import joints
from .arrays import add, largest
from .axes import apply_axes
from .bodies import begin_body
from .compiling import inlined, routine, unoptimised
from .constraints import constraint_values
from .factor import factor_bodies
from .linear import SINGULAR_PART, orient, right_hand_side, solve_residuals, solve_system
from .loads import apply_lines, apply_loads
from .metric import mass_norm
from .near import hold_rows
from .projection import least_change
from .signals import evaluate_signal
from .sums import hand_on

MAX_ITERATIONS, NEAR_ITERATIONS = 8, 24
# SLOW: the iteration still contracts after the largest number of iterations.
CONVERGED, DIVERGED, SINGULAR, SLOW = range(4)
# The slowest contraction with which the iteration goes on; assumed for a new factor until one is measured.
WORST_CONTRACTION = 0.5
# After a guess that was right except in a direction with little weight in the norm, the second change may exceed the
# first by this factor.
SECOND_CONTRACTION = 20.0
# Forces below this part of the largest (N and N m alike) are controlled as if they were that large.
SMALL_FORCE = 1e-2
# The contraction assumed for an old factor grows by this much with every stage that does not measure it. It is not
# assumed better than this bound: motion that sets in makes it worse at once.
AGEING, BEST_CONTRACTION = 1.05, 0.02
# Changes that no longer decrease are rounding if they are smaller than this part of the accelerations, or if they
# displace nothing by more than this part of the mechanism's size.
ROUNDING, FINEST = 1e-8, 4e-15


@unoptimised
def equations(system, signals, t, weights, q, v, a, lam, torques, work):
    """Compute the residuals of the equations of motion (work.f) and of the constraints (work.rows) at one time.

    The latter are w_a Phi'' + w_v Phi' + w_q Phi for weights (w_a, w_v, w_q).
    """
    note_torques(signals, t, torques)
    residuals(system, signals, t, weights, q, v, a, lam, torques, work)


@routine
def solve_linear(system, signals, t, weights, q, v, a, lam, torques, work):
    """Solve for accelerations and multipliers at (t, q, v), in which the equations are linear, with their factor."""
    # The second pass only removes rounding.
    for _ in range(2):
        equations(system, signals, t, weights, q, v, a, lam, torques, work)
        solve_residuals(system, work, 1.0)
        add(work.x, a)
        add(work.mu, lam)


@inlined
def note_torques(signals, t, torques):
    """Evaluate the motor torques, and the time-dependent components of loads, at a time."""
    for k in range(torques.size):
        torques[k] = evaluate_signal(signals, k, t)[0]


@routine
def residuals(system, signals, t, weights, q, v, a, lam, torques, work):
    """Compute the residuals of `equations` with given torques."""
    joints.start_rows(system, signals, t, weights, work.rows)
    joints.start_compliant_rows(system, lam, work.rows)
    for i in range(system.bodies.size):
        begin_body(system, i, q, v, a, work.f, work.scratch, work.scratch.points)
        joints.add_joints(system, i, q, v, a, lam, weights, work.scratch, work.f, work.rows)
        joints.add_motors(system, i, torques, work.scratch, work.f)
        hand_on(system, i, work.scratch, work.f)
    apply_axes(system, q, v, a, lam, weights, torques, work.f, work.rows)
    joints.finish_friction(system, lam, work.compliance, work.rows)
    apply_loads(system, q, v, torques, work.scratch.registers, work.f)
    apply_lines(system, q, v, torques, work.scratch.registers, work.f)


@routine
def solve_stage(
    system, signals, t, g, b, weights, qs, vs, a, lam, shift, torques, newton_tolerance, time_scale, contraction,
    dependent_part, renew, held, lag, peaks, force_tolerance, work,
):  # fmt: skip
    """Solve one stage by Newton's iteration; a and lam are starting guesses and then the solution.

    Parameters
    ----------
    qs, vs : (n,) arrays
        Explicit parts q*, v*.
    shift : (n,) array
        Additional change of q in stabilised index 2 (Gear, Gupta and Leimkuhler), such that Phi = 0 as well; a guess
        and then the solution. Empty for all other treatments.
    newton_tolerance : float
        Largest remaining error of q, in the mass norm; in v it is newton_tolerance / time_scale.
    contraction : float
        Contraction measured in earlier stages with this factor.
    dependent_part : float
        Relative pivot below which a row is dependent, see `factor_schur`.
    renew : bool
        Whether every iteration factors the matrix at its current position, as near a singular position.
    peaks, force_tolerance : (m,) array, float
        Scale of each multiplier, and largest remaining error of the multipliers as a part of these; zero if only
        positions are controlled. If the constraints leave no degree of freedom, accelerations do not reflect errors of
        multipliers.
    held, lag : float
        Limits of trust in rows near a singular position, see `hold_rows`.

    Returns
    -------
    status, iterations, contraction
        Status, number of iterations and contraction; work.q and work.v hold the stage's q and v.
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
            # After a good guess the second change may be larger than the first; later changes have to decrease.
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
    """Return the largest multiplier relative to peaks, where small peaks count as a part of the largest."""
    part, least = 0.0, SMALL_FORCE * largest(peaks)
    for r in range(mu.size):
        part = max(part, abs(mu[r]) / max(peaks[r], least))
    return part


@inlined
def place(qs, vs, g, b, a, shift, work):
    """Compute positions and velocities of a stage into work.q and work.v."""
    for j in range(a.size):
        work.q[j] = qs[j] + b * a[j]
        work.v[j] = vs[j] + g * a[j]
    for j in range(shift.size):
        work.q[j] += shift[j]
