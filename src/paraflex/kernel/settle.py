"""Steps of a run solved once more, each to rounding: what derivatives are taken of."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from paraflex.kernel.arrays import add, apart, copy, largest
from paraflex.kernel.bending import note_all_axial_forces
from paraflex.kernel.bodies import system_energy, weight_work
from paraflex.kernel.compiling import by_reference, inlined, kernel, lasting, routine
from paraflex.kernel.constraints import note_friction
from paraflex.kernel.factor import factor_bodies
from paraflex.kernel.joints import line_energy, spring_energy
from paraflex.kernel.krylov import exact_correction
from paraflex.kernel.linear import orient, right_hand_side, solve_system
from paraflex.kernel.march import step_work, write_samples
from paraflex.kernel.packed import INDEX_1
from paraflex.kernel.run_state import SAMPLE, WORK
from paraflex.kernel.stage import equations, place
from paraflex.kernel.step import input_power, stage_start
from paraflex.kernel.tangent import note_slopes

# Corrections end where the next is to be expected below this part of what they correct, or where, below the second
# bound, they fall no more.
ROUNDING, NEARLY, FALLING = 2e-16, 1e-9, 0.5
# With the matrix of a run; after these, with the exact one.
MOST_CORRECTIONS, MOST_EXACT = 60, 20
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


def make_history(steps: int, stages: int, n: int, m: int) -> History:
    """Room for so many steps."""
    q, v, a = (apart((steps, stages, n)) for _ in range(3))
    lam, power, restart = apart((steps, stages, m)), apart((steps, stages)), apart(steps, np.int64)
    return History(apart(steps), apart(steps), restart, q, v, a, lam, power, apart(steps), apart(2))


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
    if iteration == 0:
        return change <= ROUNDING
    return change * change <= ROUNDING * previous or (change < NEARLY and change > FALLING * previous)


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


@inlined
def multiplier_unit(least):
    """What multipliers are measured in beside accelerations: the ratio of the largest ones of a run."""
    return least[1] / least[0] if least[0] > 0.0 and least[1] > 0.0 else 1.0


@routine
def settle(p, signals, t, g, b, weights, dependent_part, m, a, lam, least, d, space, ws):
    """Solve a stage from m.qs and m.vs to rounding: a and lam, and its q and v in ws; the last relative correction.

    Where corrections with the iteration matrix do not get there, they begin anew from the guess with the exact one.
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
        place(m.qs, m.vs, g, b, a, m.shift, ws)
        if iteration == 0 or exact:
            prepare_matrix(p, b, ws.q, ws.v, a, lam, dependent_part, ws)
        if exact:
            note_slopes(p, ws.q, ws.v, ws.mu, ws.compliance, d)
        equations(p, signals, t, weights, ws.q, ws.v, a, lam, m.torques, ws)
        right_hand_side(p, ws, scale)
        solve_system(p, ws, ws.x, ws.mu)
        if exact:
            unit = multiplier_unit(least)
            exact_correction(p, g, b, weights, ws.q, ws.v, a, lam, m.torques, unit, d, space, ws)
        add(ws.x, a)
        add(ws.mu, lam)
        change = relative(ws.x, ws.mu, a, lam, least[0], least[1])
        if ended(change, previous, iteration):
            break
        previous = change
    place(m.qs, m.vs, g, b, a, m.shift, ws)
    return change


@lasting
def settle_steps(p, signals, tableau, controls, count, x, m, d, space, ws, out):
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
                d,
                space,
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
                d,
                space,
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


@kernel
def sample_energies(p, q, v, lam, scratch, out):
    """Kinetic energy, strain energy with that of springs, and what gravity has done at samples, into out (k, 3)."""
    for i in range(q.shape[0]):
        out[i, 0], out[i, 1] = system_energy(p, q[i], v[i], scratch)
        out[i, 1] += spring_energy(p, lam[i]) + line_energy(p, q[i], v[i])[0]
        out[i, 2] = weight_work(p, q[i], scratch)
