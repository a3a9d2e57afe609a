"""Samples within a step: positions and velocities between its stages, and the equations of motion solved there."""

from math import isfinite

import numpy as np

from . import indices as at
from .arrays import add, copy, fill, largest
from .bending import note_all_axial_forces
from .bodies import stored_energy
from .compiling import inlined, routine
from .constraints import note_friction
from .factor import factor_bodies
from .linear import SINGULAR_PART, orient, solve_residuals
from .metric import mass_norm
from .packed import INDEX_1
from .run_state import BAUMGARTE
from .stage import ROUNDING, WORST_CONTRACTION, largest_part, note_torques, place, residuals
from .step import constraint_weights, input_power

# A sample within this part of a step before its end is at its end.
SAME_TIME = 1e-9
# Forces at a sample are solved to this part of the largest force, in at most this many iterations.
FORCES, MOST = 1e-6, 12
# If they change by less than this part, the interpolated values are kept.
NO_CHANGE = 1e-5
# Error allowed in interpolated forces at samples that are not kept, as a part of the largest force.
FORCES_BETWEEN = 2e-2
# Gauss quadrature over the first part of a step, for polynomials through the powers at its stages.
GAUSS_X, GAUSS_W = (0.5 * values for values in np.polynomial.legendre.leggauss(4))
GAUSS_X += 0.5


@inlined
def interpolate(q0, v0, a0, q1, v1, a1, h, x):
    """Return cubic Hermite values of q and v at fraction x of an interval h, and the derivative of v as a."""
    y = 1.0 - x
    h00, h10, h01, h11 = (1.0 + 2.0 * x) * y * y, x * y * y, x * x * (3.0 - 2.0 * x), -x * x * y
    d00, d10, d11 = -6.0 * x * y, y * (1.0 - 3.0 * x), x * (3.0 * x - 2.0)
    q = h00 * q0 + h01 * q1 + h * (h10 * v0 + h11 * v1)
    v = h00 * v0 + h01 * v1 + h * (h10 * a0 + h11 * a1)
    a = d00 * (v0 - v1) / h + d10 * a0 + d11 * a1
    return q, v, a


@inlined
def is_long(system, tableau, controls, h):
    """Return whether a step is long compared with vibrations of flexible bodies and has stages to interpolate."""
    return system.modal.shape[1] > 0 and h >= controls.long_from and tableau.nodes.size > 2


@routine
def place_samples(tableau, t, h, long, march, out):
    """Interpolate state, accelerations and multipliers at every sample time in the step; return the first sample.

    In a step that is long compared with vibrations, deflections follow the loads, and the velocities of its stages are
    not accurate: positions are then interpolated through all stages, and velocities are the derivative of that
    polynomial.
    """
    piece, first = 0, march.counts[at.SAMPLE]
    i = first
    while i < out.times.size and out.times[i] <= t + h * (1.0 + 1e-12):
        time = out.times[i]
        while piece < tableau.dense.size - 2 and time > t + tableau.c[tableau.dense[piece + 1]] * h:
            piece += 1
        s0, s1 = tableau.dense[piece], tableau.dense[piece + 1]
        width = (tableau.c[s1] - tableau.c[s0]) * h
        x = min(max((time - t - tableau.c[s0] * h) / width, 0.0), 1.0)
        for j in range(march.q.size):
            out.q[i, j], out.v[i, j], out.a[i, j] = interpolate(
                march.stage_q[s0, j], march.stage_v[s0, j], march.stage_a[1, s0, j],
                march.stage_q[s1, j], march.stage_v[s1, j], march.stage_a[1, s1, j], width, x,
            )  # fmt: skip
        interpolate_nodes(tableau, (time - t) / h, march.stage_lam[1], out.lam[i])
        if long:
            interpolate_nodes(tableau, (time - t) / h, march.stage_q, out.q[i])
            differentiate_nodes(tableau, (time - t) / h, h, march.stage_q, out.v[i])
        i += 1
    march.counts[at.SAMPLE] = i
    return first


@routine
def solve_samples(system, signals, controls, t, h, first, march, work, out, aside):
    """Solve the equations of motion at the samples within the step that are not at its end.

    Samples that only serve to find the largest loads keep their interpolated values if these are expected to be
    accurate, judging by the last sample solved, and in steps short compared with vibrations. Each sample is a stage of
    its own, with g and b of the last stage and explicit parts such that q and v are the interpolated ones for the
    interpolated acceleration. Deflections of flexible bodies cannot be interpolated as accurately as forces: with
    flexible bodies such samples are always solved in long steps.

    Each sample is solved with the factor of the step, rotated to the step's middle, or with a factor made at the sample
    if that fails. Near a singular position, where rows of the step's factor are held, the factor is made at once. A
    kept sample does not depend on the others.
    """
    near, g, b = march.counts[at.NEAR] > 0, march.clock[at.STAGE_G], march.clock[at.STAGE_B]
    weights = INDEX_1
    if controls.treatment == BAUMGARTE:
        weights = constraint_weights(controls, march.clock[at.TRIED])[0]
    rotated = near
    for i in range(first, march.counts[at.SAMPLE]):
        needed = near or out.stored[i] or (h >= controls.long_from and march.clock[at.SAMPLE_CHANGE] > FORCES_BETWEEN)
        if needed and out.times[i] < t + h * (1.0 - SAME_TIME):
            if not rotated:
                rotated = True
                for j in range(march.q.size):
                    work.q[j] = 0.5 * (march.q[j] + march.stage_q[march.power.size - 1, j])
                orient(system, work.q, work, controls.dependent_part)
            explicit_parts(out.q[i], out.v[i], out.a[i], g, b, march)
            copy(out.a[i], march.eq)
            copy(out.lam[i], march.guess_lam)
            solved = not near and solve_at(
                system, signals, out.times[i], weights, g, b, march.clock[at.CONTRACTION], march, work, out.a[i],
                out.lam[i], march.torques,
            )  # fmt: skip
            if not solved:
                solved = solve_anew(system, signals, controls, i, weights, march, work, out, aside)
            out.solved[i] = end_sample(system, i, solved, march, work, out)


@routine
def solve_anew(system, signals, controls, i, weights, march, work, out, aside):
    """Solve a sample with a factor made there; return whether the iteration succeeds."""
    q, v, a, lam = out.q[i], out.v[i], out.a[i], out.lam[i]
    g, b = march.clock[at.STAGE_G], march.clock[at.STAGE_B]
    copy(march.eq, a)
    copy(march.guess_lam, lam)
    copy(work.redundant, aside.redundant)
    note_friction(system, q, v, aside.mu, aside.compliance)
    note_all_axial_forces(system, q, v, a, lam, aside, aside.geometric)
    factor_bodies(system, b, q, aside)
    orient(system, q, aside, controls.dependent_part)
    return aside.least[0] >= SINGULAR_PART and solve_at(
        system, signals, out.times[i], weights, g, b, WORST_CONTRACTION, march, aside, a, lam, march.torques
    )


@routine
def end_sample(system, i, solved, march, work, out):
    """Keep the solved values if they change anything, else restore the interpolated ones; return whether they do."""
    q, v, a, lam = out.q[i], out.v[i], out.a[i], out.lam[i]
    for r in range(lam.size):
        work.mu[r] = lam[r] - march.guess_lam[r] if solved else 0.0
    known = system.modal.shape[1] == 0 and largest(march.forces[at.PEAK]) > 0.0
    march.clock[at.SAMPLE_CHANGE] = largest_part(work.mu, march.forces[at.PEAK]) if known else 1.0
    if not solved or march.clock[at.SAMPLE_CHANGE] <= NO_CHANGE:
        copy(march.eq, a)
        copy(march.guess_lam, lam)
        solved = False
    for j in range(q.size):
        q[j], v[j] = march.qs[j] + march.clock[at.STAGE_B] * a[j], march.vs[j] + march.clock[at.STAGE_G] * a[j]
    return solved


@inlined
def explicit_parts(q, v, a, g, b, march):
    """Compute explicit parts of a sample into march.qs and march.vs, such that q and v belong to the acceleration a."""
    for j in range(q.size):
        march.qs[j], march.vs[j] = q[j] - b * a[j], v[j] - g * a[j]


@routine
def solve_at(system, signals, t, weights, g, b, contraction, march, work, a, lam, torques):
    """Solve a sample by Newton's iteration until forces are accurate to FORCES of the largest; return the success."""
    previous = 0.0
    scale = 1.0 / (weights[0] + weights[1] * g + weights[2] * b)
    note_torques(signals, t, torques)
    for _ in range(MOST):
        place(march.qs, march.vs, g, b, a, march.shift[:0], work)
        residuals(system, signals, t, weights, work.q, work.v, a, lam, torques, work)
        solve_residuals(system, work, scale)
        add(work.x, a)
        add(work.mu, lam)
        # Accelerations times the mass are the forces of the equations of motion.
        change = max(largest(work.mu), system.total_mass * mass_norm(system, work, work.x))
        if not isfinite(change):
            return False
        if previous > 0.0:
            contraction = change / previous
        size = largest(lam)
        # Where forces of the joints are large enough, the other norm is not needed.
        if change * contraction > FORCES * size:
            size = max(size, system.total_mass * mass_norm(system, work, a))
        if change <= ROUNDING * size or change * contraction <= FORCES * size:
            return True
        if contraction > WORST_CONTRACTION and previous > 0.0:
            return False
        previous = change
    return False


@routine
def write_energies(system, tableau, t, h, first, march, work, out):
    """Compute energies and work at the samples of the step from `first` on that are kept."""
    for i in range(first, march.counts[at.SAMPLE]):
        if not out.stored[i]:
            continue
        kinetic, strain, weight = stored_energy(system, out.q[i], out.v[i], out.lam[i], work.scratch)
        out.energy[i, 0], out.energy[i, 1] = kinetic, strain
        out.energy[i, 2] = march.clock[at.WORK]
        done = min(max((out.times[i] - t) / h, 0.0), 1.0)
        for s in range(march.power.size):
            out.energy[i, 2] += h * work_weight(tableau, s, done)[0] * march.power[s]
        out.energy[i, 2] += weight - march.clock[at.WEIGHT_0]


@routine
def work_weight(tableau, s, x):
    """Return the weight of stage s in the work done until fraction x of a step, and its derivative by x.

    Both are relative to the step size. The polynomial through the powers at the nodes is integrated; a cubic corrects
    the whole to the scheme's quadrature.
    """
    part, value, left = 0.0, 0.0, tableau.A[tableau.c.size - 1, s]
    for k in tableau.nodes:
        if k == s:
            value = node_value(tableau, s, x)
            for g in range(GAUSS_X.size):
                part += x * GAUSS_W[g] * node_value(tableau, s, x * GAUSS_X[g])
                left -= GAUSS_W[g] * node_value(tableau, s, GAUSS_X[g])
    return part + x * x * (3.0 - 2.0 * x) * left, value + 6.0 * x * (1.0 - x) * left


@routine
def step_work(tableau, h, march):
    """Return the work done in the step, by the scheme's own quadrature."""
    last, work = tableau.c.size - 1, 0.0
    for s in range(last + 1):
        work += h * tableau.A[last, s] * march.power[s]
    return work


@routine
def power_along_curve(system, signals, tableau, t, h, march, work):
    """Compute the power at the stages of a long step, with velocities of the polynomial through all of them."""
    for i in range(march.power.size):
        time = t + tableau.c[i] * h
        differentiate_nodes(tableau, tableau.c[i], h, march.stage_q, work.v)
        note_torques(signals, time, march.torques)
        march.power[i] = input_power(
            system, signals, time, march.stage_q[i], work.v, march.stage_lam[1, i], march.torques, work
        )


@inlined
def node_value(tableau, k, x):
    """Return the value at fraction x of the polynomial that is one at node k and zero at the others."""
    value = 1.0
    for l in tableau.nodes:
        if l != k:
            value *= (x - tableau.c[l]) / (tableau.c[k] - tableau.c[l])
    return value


@inlined
def node_slope(tableau, k, x):
    """Return the derivative at fraction x of the polynomial that is one at node k and zero at the others."""
    slope = 0.0
    for skipped in tableau.nodes:
        if skipped != k:
            product = 1.0 / (tableau.c[k] - tableau.c[skipped])
            for l in tableau.nodes:
                if l != k and l != skipped:
                    product *= (x - tableau.c[l]) / (tableau.c[k] - tableau.c[l])
            slope += product
    return slope


@routine
def interpolate_nodes(tableau, x, stages, out):
    """Evaluate the polynomial through the values of stages (stages, k) at the nodes, at fraction x of the step."""
    fill(out, 0.0)
    for k in tableau.nodes:
        weight = node_value(tableau, k, x)
        for r in range(out.size):
            out[r] += weight * stages[k, r]


@routine
def differentiate_nodes(tableau, x, h, stages, out):
    """Compute the time derivative of the polynomial of `interpolate_nodes`, in a step of length h."""
    fill(out, 0.0)
    for k in tableau.nodes:
        slope = node_slope(tableau, k, x) / h
        for r in range(out.size):
            out[r] += slope * stages[k, r]
