"""Error of a step: an estimate, filtered through the iteration matrix, in metres.

Without the filter (Hosea and Shampine 1996) an undamped axial mode would determine the step size.
"""

from math import exp, isinf

from . import indices as at
from .arrays import copy, fill, largest
from .bending import subtract_geometric
from .compiling import inlined, routine
from .constraints import note_friction
from .linear import factor_system, jacobian_times, solve_system, to_body_frame, to_ground_frame
from .metric import mass_norm, mass_times
from .packed import OMEGA2
from .stage import largest_part

# Number of steps after which the factor that filters velocity errors is renewed; a norm needs no recent one.
SLOW_AGE = 25
# A velocity error that no elastic force reverses displaces the mechanism on average by the error times this fraction of
# the cycle.
MEMORY_PART = 0.25
# Vibrations are lost in steps longer than the last one by this factor. The error is this multiple of the loss found, as
# only half of a vibration with a period of one step is found.
GROWN = 1.2
LOST_SHARE = 1.5
# Gains with which velocity errors enter the constraints unchanged.
UNCHANGED = (1.0, 0.0, 0.0)
# Smallest error allowed in forces in a step, as a part of the largest force, well above rounding.
LEAST_PART = 1e-6


@routine
def embedded_error(tableau, h, march):
    """Compute the difference from the embedded formula, in q and v, into march.eq and march.ev."""
    fill(march.eq, 0.0)
    fill(march.ev, 0.0)
    for s in range(tableau.c.size):
        weight = h * tableau.error[s]
        for j in range(march.q.size):
            march.eq[j] += weight * march.stage_d[s, j]
            march.ev[j] += weight * march.stage_a[1, s, j]


@routine
def history_error(h, march):
    """Compute the difference from formulas of higher order through the last step's acceleration.

    For v the formula is the integral of the parabola through the accelerations at t - h_0, t and t + h, for q that of
    the cubic with the velocities and accelerations at t and t + h. The results are written to march.eq and march.ev.
    """
    h0 = march.clock[at.LAST_STEP]
    if h0 > 0.0:
        before, end = -h * h * h / (6.0 * h0 * (h0 + h)), h * (h / 3.0 + 0.5 * h0) / (h + h0)
    else:
        # The third derivative is unknown: it is assumed to change the acceleration as much as the second does.
        before, end = -h / 12.0, 5.0 * h / 12.0
    middle, last = h - before - end, march.stage_v.shape[0] - 1
    for j in range(march.q.size):
        a0, a1 = march.stage_a[1, 0, j], march.stage_a[1, last, j]
        a_before = march.stage_a[0, 0, j] if h0 > 0.0 else a0
        march.ev[j] = march.stage_v[last, j] - march.v[j] - before * a_before - middle * a0 - end * a1
        march.eq[j] = (
            march.stage_q[last, j]
            - march.q[j]
            - 0.5 * h * (march.v[j] + march.stage_v[last, j])
            - h * h / 12.0 * (a0 - a1)
        )


@routine
def filtered_error(system, g, gains, march, work, slow):
    """Return the mass norms [m] of the position error and of the later effect of the velocity error.

    The errors are those in march.eq and march.ev. The velocity error is filtered once more, as by a step as long as a
    part of the cycle, its memory. The remainder is the part that no elastic force reverses, and that moves the
    mechanism by the memory times its size.

    With J the Jacobian of the index-1 equations, (1 - g J) eps = e gives eps_q = e_q + g eps_v and (M + g D + b K)
    eps_v + Phi_q^T mu = M e_v - g K e_q, Phi_q eps_v = (Phi_q e_v - beta^2 g Phi_q e_q) / scale, for springs J eps_v -
    C mu / b = -J e_q / g and for dampers J eps_v - C mu / g = 0, with b = g^2. If Phi' = 0 is imposed and not
    integrated, Phi_q eps_v = 0. `gains` selects the case: 1, alpha and beta, or zeros. Divided by g these are a stage's
    equations for an acceleration error, so mu / g is the effect of the error on the multipliers.
    """
    filter_error(system, g, gains, march.eq, march.ev, work)
    for r in range(work.mu.size):
        march.forces[at.LOCAL, r] = abs(work.mu[r]) / g
    for j in range(march.q.size):
        march.eq[j] += g * work.x[j]
        march.errors[at.LOCAL, j] = abs(march.eq[j])
    position = mass_norm(system, work, march.eq)
    if march.counts[at.STEPS] % SLOW_AGE == 0:
        note_friction(system, march.q, march.v, slow.mu, slow.compliance)
        march.clock[at.MEMORY] = MEMORY_PART * march.clock[at.CYCLE]
        factor_system(system, march.clock[at.MEMORY] * march.clock[at.MEMORY], march.q, slow)
    memory = march.clock[at.MEMORY]
    copy(work.x, march.ev)
    filter_error(system, memory, gains, None, march.ev, slow)
    return position, memory * mass_norm(system, slow, slow.x)


@routine
def note_lost_vibrations(system, controls, h, g, march, work):
    """Record multipliers and deflections of undamped vibrations lost in a step that is much longer than the last one.

    A vibration with acceleration A phi, (K - omega^2 M) phi + Phi_q^T nu = 0, has multipliers A nu / omega^2. Filtering
    its acceleration gives g^2 A nu / (1 + g^2 omega^2): all of them if it is much faster than the step, zero for
    motions without deflection. Filtering twice leaves out vibrations that are resolved, and gives g^2 omega^2 A phi /
    (1 + g^2 omega^2)^2, which is the deflection A phi / omega^2 over g^2. The stages of the last step have all phases.
    """
    fill(march.forces[at.LOST], 0.0)
    fill(march.errors[at.LOST], 0.0)
    if not isinf(controls.force_cycles) or h < GROWN * march.clock[at.LAST_STEP]:
        return
    for s in range(march.stage_a.shape[1]):
        copy(march.stage_a[1, 0] if s == 0 else march.stage_a[0, s], march.ev)
        filter_error(system, g, UNCHANGED, None, march.ev, work)
        for j in range(march.ev.size):
            march.ev[j] -= work.x[j]
        filter_error(system, g, UNCHANGED, None, march.ev, work)
        for r in range(work.mu.size):
            march.forces[at.LOST, r] = max(march.forces[at.LOST, r], abs(work.mu[r]))
        for j in range(march.ev.size):
            march.errors[at.LOST, j] = max(march.errors[at.LOST, j], g * g * abs(work.x[j]))


@routine
def force_error(controls, h, march):
    """Return the effect of the step's error on the multipliers, relative to the allowed effect.

    It is zero if forces are not controlled.
    """
    if controls.force_control == 0 or march.counts[at.NEAR] > 0 or largest(march.forces[at.PEAK]) == 0.0:
        return 0.0
    return largest_part(march.forces[at.LOCAL], march.forces[at.PEAK]) / allowed_part(controls, h, march)


@inlined
def allowed_part(controls, h, march):
    """Return the error allowed in forces in a step, as a part of the largest force."""
    return max(controls.force_part * h / march.clock[at.CYCLE], LEAST_PART)


@routine
def note_errors(controls, h, march):
    """Record the largest multipliers, their changes by local errors within some cycles, and all of the coordinates."""
    forgotten = exp(-h / (controls.force_cycles * march.clock[at.CYCLE]))
    for r in range(march.guess_lam.size):
        march.forces[at.PEAK, r] = max(march.forces[at.PEAK, r], abs(march.stage_lam[1, 0, r]))
        if march.counts[at.NEAR] == 0:
            march.forces[at.RECENT, r] = forgotten * march.forces[at.RECENT, r] + march.forces[at.LOCAL, r]
            unresolved = max(march.forces[at.RECENT, r], LOST_SHARE * march.forces[at.LOST, r])
            march.forces[at.UNRESOLVED, r] = max(march.forces[at.UNRESOLVED, r], unresolved)
    # It is not known how fast these decay: a damped beam may swing for many cycles of a faster body.
    for j in range(march.q.size):
        march.errors[at.RECENT, j] += march.errors[at.LOCAL, j]
        unresolved = max(march.errors[at.RECENT, j], LOST_SHARE * march.errors[at.LOST, j])
        march.errors[at.UNRESOLVED, j] = max(march.errors[at.UNRESOLVED, j], unresolved)


@routine
def filter_error(system, g, gains, eq, ev, work):
    """Compute eps_v of (1 - g J) eps = (e_q, e_v) into work.x, with the factor in `work` made for b = g^2.

    `eq` is None if e_q is zero.
    """
    of_v, alpha, beta = gains
    scale = 1.0 + 2.0 * alpha * g + beta * beta * g * g
    copy(ev, work.x)
    if eq is not None:
        copy(eq, work.f)
    fill(work.mu, 0.0)
    for i in range(system.bodies.size):
        body = system.bodies[i]
        to_body_frame(system, i, work, work.x)
        jacobian_times(system, i, work, work.x, of_v / scale, 0.0, 0.0, work.mu)
        mass_times(system, i, work, work.mass, work.x)
        if eq is not None:
            to_body_frame(system, i, work, work.f)
            jacobian_times(system, i, work, work.f, -beta * beta * g / scale, -1.0 / g, 0.0, work.mu)
            e = body.offset + 3
            for j in range(body.nf):
                work.x[e + j] -= g * system.modal[OMEGA2, body.flex + j] * eq[e + j]
            subtract_geometric(system, i, work.geometric, g, eq, work.x)
        to_ground_frame(system, i, work, work.x)
    solve_system(system, work, work.x, work.mu)
