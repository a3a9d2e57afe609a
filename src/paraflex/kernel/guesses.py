"""Guesses of accelerations and multipliers of a stage, from those of the stages before it.

A polynomial in time is a poor guess while a step is long compared with vibrations. Stages of vibrations, decaying ones
too, satisfy a linear recurrence, which is the same in every step of one size. A guess is therefore the combination of
the nearest stages that would have been the best one in the last steps: by least squares with the kinetic energy as
norm, in which a step counts half as much as the next. Weights add up to 1, so that constant values are exact.
"""

from math import inf, sqrt

from .arrays import fill
from .compiling import inlined, routine
from .run_state import GUESS_FROM
from .vectors import LANES, add_scaled, load, store, zeros

# Number of stages in a polynomial, for steps without weights.
POLYNOMIAL = 3
# Stages closer than this part of a step count as one time.
SAME_TIME = 1e-6
# The next step keeps this part of the sums, and this part of their trace is added to the diagonal against rounding.
KEPT, RIDGE = 0.5, 1e-8
# Weights serve if the sizes of two steps differ by no more than this factor.
SIMILAR = 2.0


@routine
def note_inertias(system, march):
    """Note the inertia of every coordinate: masses, moments of inertia, and 1 for modes."""
    fill(march.inertias, 1.0)
    for i in range(system.bodies.size):
        o = system.bodies[i].offset
        march.inertias[o] = march.inertias[o + 1] = system.bodies[i].m
        march.inertias[o + 2] = system.bodies[i].I0


@routine
def guess(i, place, h, learns, singular, tableau, march):
    """Guess accelerations and multipliers of stage i, at `place` steps after the start of a step of size h.

    `learns` is whether weights are learned. Near a `singular` position multipliers have a pole, and the nearest ones
    are taken.
    """
    if learns and not singular and are_similar(h, march):
        found = nearest_stages(i, place, 1.0, GUESS_FROM, tableau, march)
        if fit(i, found, march):
            combine(march.stage_a, found, march, march.stage_a[1, i])
            combine(march.stage_lam, found, march, march.stage_lam[1, i])
            return
    found = extrapolate_accelerations(i, place, h, tableau, march)
    if singular:
        found = 1
        polynomial(found, place, march)
    combine(march.stage_lam, found, march, march.stage_lam[1, i])


@inlined
def are_similar(h, march):
    """Return whether this step of size h is of a size similar to that of the last one."""
    before = march.stage_t[0, march.stage_t.shape[1] - 1] - march.stage_t[0, 0]
    return h < SIMILAR * before and before < SIMILAR * h


@routine
def extrapolate_accelerations(i, place, h, tableau, march):
    """Extrapolate accelerations of stage i by a polynomial through the nearest stages; return their number."""
    last = march.stage_a.shape[1] - 1
    ratio = (march.stage_t[0, last] - march.stage_t[0, 0]) / h
    found = nearest_stages(i, place, ratio, POLYNOMIAL, tableau, march)
    polynomial(found, place, march)
    combine(march.stage_a, found, march, march.stage_a[1, i])
    return found


@routine
def nearest_stages(i, place, ratio, most, tableau, march):
    """Find the stages of this step and the last one that are nearest to a place in this step, for stage i.

    `ratio` is the size of the last step in units of this one; in these units times from the start of this step are
    written to march.guess_t, and indices to march.guess_s, the nearest first. Returns their number, at most `most`.
    """
    stages, times, rows = tableau.c.size, march.guess_t, march.guess_s
    found = 0
    for k in range(i + stages):
        # Of stages at one time the latest counts.
        step, s = (1, i - 1 - k) if k < i else (0, stages - 1 - (k - i))
        time, slot = (tableau.c[s] if step == 1 else ratio * (tableau.c[s] - 1.0)), found
        while slot > 0 and abs(time - place) < abs(times[slot - 1] - place):
            slot -= 1
        for l in range(found):
            if abs(time - times[l]) < SAME_TIME:
                slot = most
        if slot < most:
            found = min(found + 1, most)
            for l in range(found - 1, slot, -1):
                times[l], rows[l, 0], rows[l, 1] = times[l - 1], rows[l - 1, 0], rows[l - 1, 1]
            times[slot], rows[slot, 0], rows[slot, 1] = time, step, s
    return found


@routine
def polynomial(found, place, march):
    """Compute into march.guess_w the weights of the polynomial through the stages of `nearest_stages`."""
    times = march.guess_t
    for k in range(found):
        weight = 1.0
        for l in range(found):
            if l != k:
                weight *= (place - times[l]) / (times[k] - times[l])
        march.guess_w[k] = weight


@routine
def combine(values, found, march, out):
    """Sum values (2, stages, k) at the stages of `nearest_stages` by the weights in march.guess_w."""
    fill(out, 0.0)
    for k in range(found):
        weight, source = march.guess_w[k], values[march.guess_s[k, 0], march.guess_s[k, 1]]
        for j in range(out.size):
            out[j] += weight * source[j]


@routine
def fit(i, found, march):
    """Compute into march.guess_w the weights learned for stage i; return whether there are any.

    The last row of the sums is the right-hand side of the normal equations, and is substituted as they are factored.
    """
    count, sums, factor, w = found - 1, march.guess_sums, march.guess_factor, march.guess_w
    first = i * GUESS_FROM * LANES
    trace = 0.0
    for k in range(count):
        trace += sums[first + (LANES + 1) * k]
    if not 0.0 < trace < inf:
        return False
    for r in range(found):
        for c in range(min(r + 1, count)):
            total = sums[first + LANES * r + c]
            for k in range(c):
                total -= factor[r, k] * factor[c, k]
            factor[r, c] = total * factor[c, c] if c < r else 1.0 / sqrt(max(total, 0.0) + RIDGE * trace)
    w[0] = 1.0
    for r in range(count - 1, -1, -1):
        total = factor[count, r]
        for k in range(r + 1, count):
            total -= factor[k, r] * w[k + 1]
        w[r + 1] = total * factor[r, r]
        w[0] -= w[r + 1]
    return True


@routine
def learn(i, place, h, tableau, march):
    """Add the solution of stage i to the sums of which `fit` computes weights; see `guess` for place and h."""
    if not are_similar(h, march):
        return
    found = nearest_stages(i, place, 1.0, GUESS_FROM, tableau, march)
    d, rows, sums, first = march.guess_d, march.guess_s, march.guess_sums, i * GUESS_FROM * LANES
    base = march.stage_a[rows[0, 0], rows[0, 1]]
    for k in range(found):
        # After the differences of the other stages comes that of the solution.
        values = march.stage_a[rows[k + 1, 0], rows[k + 1, 1]] if k + 1 < found else march.stage_a[1, i]
        for j in range(base.size):
            d[LANES * j + k] = values[j] - base[j]
    g0, g1, g2, g3, g4, g5 = zeros(), zeros(), zeros(), zeros(), zeros(), zeros()
    for j in range(base.size):
        at, m = LANES * j, march.inertias[j]
        row = load(d, at)
        g0, g1 = add_scaled(g0, row, m * d[at]), add_scaled(g1, row, m * d[at + 1])
        g2, g3 = add_scaled(g2, row, m * d[at + 2]), add_scaled(g3, row, m * d[at + 3])
        g4, g5 = add_scaled(g4, row, m * d[at + 4]), add_scaled(g5, row, m * d[at + 5])
    store(sums, first, add_scaled(g0, load(sums, first), KEPT))
    store(sums, first + LANES, add_scaled(g1, load(sums, first + LANES), KEPT))
    store(sums, first + 2 * LANES, add_scaled(g2, load(sums, first + 2 * LANES), KEPT))
    store(sums, first + 3 * LANES, add_scaled(g3, load(sums, first + 3 * LANES), KEPT))
    store(sums, first + 4 * LANES, add_scaled(g4, load(sums, first + 4 * LANES), KEPT))
    store(sums, first + 5 * LANES, add_scaled(g5, load(sums, first + 5 * LANES), KEPT))
