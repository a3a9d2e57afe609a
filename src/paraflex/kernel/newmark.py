"""Step of the Newmark family on the index-3 equations, with the algorithmic acceleration as a state.

    (1 - alpha_m) a_1 + alpha_m a_0 = (1 - alpha_f) v_1' + alpha_f v_0'
    q_1 = q_0 + h v_0 + h^2 ((1/2 - beta) a_0 + beta a_1),    v_1 = v_0 + h ((1 - gamma) a_0 + gamma a_1)

with balance and Phi = 0 at the end of the step (Arnold and Brüls 2007). Newmark's own method has alpha_m = alpha_f = 0,
the method of Hilber, Hughes and Taylor has alpha_m = 0. The stored a_0 approximates v' at t + (alpha_m - alpha_f) h and
is adjusted if h changes. Wilson's method assumes a linear acceleration up to t + theta h, satisfies balance and Phi = 0
there, and projects its result at t + h onto the constraints and their two derivatives.
"""

from . import indices as at
from .arrays import add, copy
from .compiling import routine
from .packed import CONSTRAINT, INDEX_1
from .projection import least_change, project
from .stage import equations


@routine
def newmark_start(numbers, t, h, march):
    """Compute the explicit parts of the stage into march.qs and march.vs.

    Returns its time, and g and b of q = q* + b v', v = v* + g v'.
    """
    a0, theta = march.algorithmic[0], numbers[at.THETA]
    if theta > 1.0:
        h = theta * h
        for j in range(march.q.size):
            march.qs[j] = march.q[j] + h * march.v[j] + h * h / 3.0 * a0[j]
            march.vs[j] = march.v[j] + 0.5 * h * a0[j]
        return t + h, 0.5 * h, h * h / 6.0
    alpha_m, alpha_f, beta, gamma = numbers[at.ALPHA_M], numbers[at.ALPHA_F], numbers[at.BETA], numbers[at.GAMMA]
    part = (1.0 - alpha_f) / (1.0 - alpha_m)
    moved = shifted(alpha_m - alpha_f, h, march)
    for j in range(march.q.size):
        a = a0[j] + moved * (march.stage_a[1, 0, j] - march.stage_a[0, 0, j])
        carried = (alpha_f * march.stage_a[1, 0, j] - alpha_m * a) / (1.0 - alpha_m)
        march.qs[j] = march.q[j] + h * march.v[j] + h * h * ((0.5 - beta) * a + beta * carried)
        march.vs[j] = march.v[j] + h * ((1.0 - gamma) * a + gamma * carried)
    return t + h, gamma * h * part, beta * h * h * part


@routine
def shifted(where, h, march):
    """Return the fraction of the last step's change of acceleration to add if the step size changes."""
    last = march.clock[at.LAST_STEP]
    return where * (h - last) / last if last > 0.0 else 0.0


@routine
def restart_algorithmic(numbers, march):
    """Set the algorithmic acceleration from true accelerations, after steps that were divided."""
    where = numbers[at.ALPHA_M] - numbers[at.ALPHA_F] if march.clock[at.LAST_STEP] > 0.0 else 0.0
    for j in range(march.q.size):
        a = march.stage_a[1, 0, j]
        march.algorithmic[0, j] = a + where * (a - march.stage_a[0, 0, j])


@routine
def newmark_end(system, signals, numbers, varying, t, h, march, work):
    """Compute the end of the step from the stage: work.q, work.v and the new algorithmic acceleration.

    If the step size varies, and with Wilson's method, velocities and algorithmic accelerations are projected onto their
    constraints: a step corrects the Phi' that the previous step has left, and if it is shorter, by a larger force.
    """
    if numbers[at.THETA] > 1.0:
        wilson_end(numbers[at.THETA], h, march, work)
    else:
        carry(numbers, h, march)
    if numbers[at.THETA] > 1.0 or varying:
        project(system, signals, t + h, work.q, work.v, work)
        allow_acceleration(system, signals, t + h, march.algorithmic[1], march, work)
    if numbers[at.THETA] > 1.0:
        copy(march.algorithmic[1], march.stage_a[1, 1])


@routine
def carry(numbers, h, march):
    """Compute the new algorithmic acceleration from the old one and the accelerations at both ends."""
    a0, a1, start, end = march.algorithmic[0], march.algorithmic[1], march.stage_a[1, 0], march.stage_a[1, 1]
    alpha_m, alpha_f = numbers[at.ALPHA_M], numbers[at.ALPHA_F]
    moved = shifted(alpha_m - alpha_f, h, march)
    for j in range(march.q.size):
        a = a0[j] + moved * (start[j] - march.stage_a[0, 0, j])
        a1[j] = ((1.0 - alpha_f) * end[j] + alpha_f * start[j] - alpha_m * a) / (1.0 - alpha_m)


@routine
def wilson_end(theta, h, march, work):
    """Compute the state at t + h from the solution at t + theta h; accelerations and multipliers are linear in time."""
    a0, a1, found = march.algorithmic[0], march.algorithmic[1], march.stage_a[1, 1]
    for j in range(march.q.size):
        a1[j] = a0[j] + (found[j] - a0[j]) / theta
        work.q[j] = march.q[j] + h * march.v[j] + h * h / 6.0 * (2.0 * a0[j] + a1[j])
        work.v[j] = march.v[j] + 0.5 * h * (a0[j] + a1[j])
    lam = march.stage_lam[1]
    for r in range(lam.shape[1]):
        lam[1, r] = lam[0, r] + (lam[1, r] - lam[0, r]) / theta


@routine
def allow_acceleration(system, signals, t, a, march, work):
    """Change an acceleration to the nearest one that satisfies the constraints at work.q and work.v."""
    equations(system, signals, t, INDEX_1, work.q, work.v, a, march.stage_lam[1, 1], march.torques, work)
    for r in range(work.rows.size):
        if system.rows[r].kind != CONSTRAINT:
            work.rows[r] = 0.0
    least_change(system, work.rows, work)
    add(work.x, a)
