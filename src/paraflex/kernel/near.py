"""Steps near and across a singular position, where constraint rows depend on one another for an instant.

There motion is smooth but multipliers have a pole, and what is left of the constraints, Phi, moves the mechanism by
Phi / root, with root^2 the part of its square that the row nearest to dependence has left when others are eliminated.
So a run is brought back to the constraints where it comes near (`kernel.march.enter`), and at the end of each step
there. A stage factors its matrix where it stands. Rows closer to dependence than their own lag leave accelerations as
extrapolated from the stages before: the constraints' second derivatives do not determine them there. Steps keep
their length meanwhile, so that a handful of them straddles the position.
"""

from __future__ import annotations

from math import sqrt

from paraflex.kernel.arrays import add, copy, fill
from paraflex.kernel.compiling import inlined, routine
from paraflex.kernel.constraints import constraint_values
from paraflex.kernel.linear import own_square, solve_system
from paraflex.kernel.metric import mass_norm
from paraflex.kernel.projection import NO_VIOLATION, largest_violation, least_change
from paraflex.kernel.run_state import (
    DRIFTED,
    HELD_END,
    LAST_STEP,
    NEAR,
    PASSAGES,
    ROOT,
    ROOT_B,
    ROOT_RATE,
    ROOT_STEP,
    STEPS,
    WIDEST,
)

# A run is near a singular position where it could be there within so many steps, or where the root of what some row
# has left is less than this of the most that rows had left; in either case what it has left is less than this part.
NEAR_STEPS, NEAR_ROOT, NEAR_PART = 8.0, 0.02, 0.1
# Rows are not trusted closer to a singular position than this many times their lag behind its motion, and not closer
# than so many g.
HELD, LEAST_HELD, MOST_HELD = 3.0, 0.5, 0.3
# How fast what is known of a row's speed is forgotten, by step.
FORGETTING = 0.9
# What has gathered in a step that ended that close no shorter one takes back: at the end of the next ones that distance
# counts by this fraction.
LEAVING = 0.03
# Corrections of position, and of velocity, towards the constraints.
PASSES = 2
# Singular positions closer than so many steps are one.
SAME_POSITION = 2.0
# Rows this many times further from dependence than those that are held are as good as any.
FAR = 10.0


@inlined
def elastic_measure_changes(system, b, march):
    """Whether this is the first attempt of a step whose b is not the last one's, in a mechanism with elastic links."""
    first = 0 <= march.counts[ROOT_STEP] < march.counts[STEPS]
    return first and b != march.clock[ROOT_B] and system.modal.size > 0


@routine
def note_root(system, march, work):
    """Note how near to dependence constraint rows are at the start of a step, and the rate of change.

    Both are in the metric M + b K of a step. Where welds are redundant but for elasticity the root falls with longer
    steps: what changes with b at one pose is no approach to a singular position, and rescales what is compared with it.
    """
    root, change, b = sqrt(max(work.least[0], 0.0)), 0.0, work.step[0]
    if march.counts[ROOT_STEP] == march.counts[STEPS]:
        before = abs(march.clock[ROOT])
        if system.modal.size > 0 and b != march.clock[ROOT_B] and before > 0.0:
            widest = march.clock[WIDEST] * (root / before) ** 2
            march.clock[WIDEST] = max(work.least[0], min(1.0, widest))
            march.clock[ROOT] *= root / before
            march.clock[ROOT_B] = b
        return
    if march.counts[ROOT_STEP] >= 0:
        change = (root - march.clock[ROOT]) / march.clock[LAST_STEP]
    size = max(abs(change), FORGETTING * abs(march.clock[ROOT_RATE]))
    march.clock[ROOT_RATE] = size if change > 0.0 else -size
    march.clock[ROOT], march.counts[ROOT_STEP], march.clock[ROOT_B] = root, march.counts[STEPS], b
    march.clock[WIDEST] = max(march.clock[WIDEST], work.least[0])


@routine
def comes_near(h, march):
    """Whether a step begins near a singular position."""
    return march.clock[ROOT] < max(NEAR_STEPS * abs(march.clock[ROOT_RATE]) * h, NEAR_ROOT * sqrt(march.clock[WIDEST]))


@routine
def share_of_passage(h, march):
    """The fraction of the passage of a singular position that a step covers."""
    return min(1.0, abs(march.clock[ROOT_RATE]) * h / (NEAR_ROOT * sqrt(march.clock[WIDEST])))


@routine
def trust(weights, g, b, ahead, march):
    """Weights of constraint rows near a singular position: `held` and `lag` of `hold_rows`.

    With root(t) what is left of a row, constraint rows w_a Phi'' + w_v Phi' + w_q Phi of a stage change with its
    acceleration along the opening direction by root (w_a + w_v g + w_q b) + root' (2 w_a g + w_v b): the matrix knows
    the first only, and before a singular position both cancel. The stage is so long `ahead` of the start of the step.
    """
    lag = (2.0 * weights[0] * g + weights[1] * b) / (weights[0] + weights[1] * g + weights[2] * b)
    speed = abs(march.clock[ROOT_RATE])
    held = min(max(HELD * lag, LEAST_HELD * g) * speed, MOST_HELD)
    before = march.clock[ROOT_RATE] < 0.0 and march.clock[ROOT] > speed * ahead
    return held, -lag * speed if before else lag * speed


@routine
def hold_rows(system, work, held, lag, rows, scratch):
    """Right-hand sides of rows that nearly depend on others, reduced as by `trust`.

    A row whose part left has a root below `held` gets what follows from the others: the solution does not move along
    the direction in which it nearly depends on them. Of others the true derivative along that direction is the
    matrix's times 1 + lag / root.
    """
    for i in range(system.rows.size):
        follows, inverse, root = rest_of_row(system, work, i, scratch)
        scratch[i] = (rows[i] - follows) * inverse
        if inverse == 0.0 or work.redundant[i] > 0.0 or root > FAR * held:
            continue
        scratch[i] = 0.0 if root < held else scratch[i] / (1.0 + lag / root)
        rows[i] = follows + scratch[i] / inverse


@routine
def damp_rows(system, work, held, rows, scratch):
    """Right-hand sides of rows, reduced as if roots below `held` were `held`."""
    for i in range(system.rows.size):
        follows, inverse, root = rest_of_row(system, work, i, scratch)
        scratch[i] = (rows[i] - follows) * inverse
        if inverse != 0.0 and root < held and work.redundant[i] == 0.0:
            scratch[i] *= root / held
            rows[i] = follows + scratch[i] / inverse


@inlined
def rest_of_row(system, work, i, scratch):
    """Contribution of the reduced rows before row i, inverse of its pivot, and root of its part left."""
    first, start = system.rows[i].first, system.rows[i].start - system.rows[i].first
    follows, square = 0.0, 0.0
    for k in range(first, i):
        follows += work.schur[start + k] * scratch[k]
        square += work.schur[start + k] * work.schur[start + k]
    inverse = work.schur[start + i]
    if inverse == 0.0:
        return follows, inverse, 1.0
    pivot = 1.0 / (inverse * inverse)
    own, before = pivot + square, system.rows[i - 1].start - first
    if system.rows[i].second and work.schur[before + i - 1] > 0.0:
        diagonal = 1.0 / work.schur[before + i - 1]
        product, first_square = work.schur[start + i - 1] * diagonal, diagonal * diagonal
        for k in range(first, i - 1):
            product += work.schur[start + k] * work.schur[before + k]
            first_square += work.schur[before + k] * work.schur[before + k]
        own = own_square(own, product, first_square)
    return follows, inverse, min(sqrt(pivot / own), 1.0)


@routine
def return_to_constraints(system, signals, t, held, march, work):
    """Project the end of a step near a singular position onto the constraints; the distance from them [m].

    Only as far as rows are trusted. Where they are not, what they are off by, and its rate times the time it takes to
    where they are, still tell of that distance.
    """
    last = march.stage_q.shape[0] - 1
    q, v = march.stage_q[last], march.stage_v[last]
    constraint_values(system, signals, t, q, v, work.scratch, work.rows, work.mu)
    distance = damped_distance(system, work.rows, held, work)
    if march.clock[ROOT_RATE] != 0.0:
        constraint_values(system, signals, t, q, v, work.scratch, work.mu, work.rows)
        distance = max(distance, held / abs(march.clock[ROOT_RATE]) * damped_distance(system, work.rows, held, work))
    march.counts[HELD_END] = 1 if work.least[0] < held * held else 0
    for _ in range(PASSES):
        constraint_values(system, signals, t, q, v, work.scratch, work.rows, work.mu)
        remove_violation(system, held, q, work)
    for _ in range(PASSES):
        constraint_values(system, signals, t, q, v, work.scratch, work.mu, work.rows)
        remove_violation(system, held, v, work)
    return distance * LEAVING if march.counts[DRIFTED] > 0 else distance


@routine
def remove_violation(system, held, x, work):
    """Change coordinates or velocities x so that rows with the violations in work.rows hold: see `hold_rows`."""
    if largest_violation(system, work.rows) > NO_VIOLATION:
        hold_rows(system, work, held, 0.0, work.rows, work.mu)
        least_change(system, work.rows, work)
        add(work.x, x)


@routine
def damped_distance(system, rows, held, work):
    """Distance from the constraints with these values [m], with nearly dependent rows reduced."""
    if largest_violation(system, rows) <= NO_VIOLATION:
        return 0.0
    damp_rows(system, work, held, rows, work.mu)
    least_change(system, rows, work)
    return mass_norm(system, work, work.x)


@routine
def begin_near(system, march, work):
    """Near a singular position: keep the direction that opens the row nearest to dependence, at the step's start."""
    march.counts[NEAR] = 1 + int(work.least[1])
    open_row(system, march.counts[NEAR] - 1, work)
    copy(work.x, march.opening)


@routine
def open_row(system, row, work):
    """The least change of coordinates that opens one row by one unit, into work.x: infinite at a singular position."""
    fill(work.x, 0.0)
    fill(work.mu, 0.0)
    work.mu[row] = 1.0
    solve_system(system, work, work.x, work.mu)


@routine
def note_crossing(system, t, h, march, work):
    """Note that a step has passed a singular position: the opening direction has changed sign, through infinity."""
    open_row(system, march.counts[NEAR] - 1, work)
    product, start, end = 0.0, 0.0, 0.0
    for j in range(work.x.size):
        product += march.opening[j] * work.x[j]
        start += march.opening[j] * march.opening[j]
        end += work.x[j] * work.x[j]
    if product >= 0.0:
        return
    march.clock[ROOT] = -march.clock[ROOT]
    # Both grow as one over the time from it.
    note_position(t + h * sqrt(end) / (sqrt(start) + sqrt(end)), t, h, march)


@routine
def note_position(at, t, h, march):
    """Note that a step from t was at a singular position, with an interval of the step's length to both sides."""
    last, around = march.counts[PASSAGES] - 1, max(at - t, t + h - at)
    if last >= 0:
        if abs(0.5 * (march.passages[0, last] + march.passages[1, last]) - at) < SAME_POSITION * h:
            return
    if last + 1 < march.passages.shape[1]:
        march.passages[0, last + 1], march.passages[1, last + 1] = at - around, at + around
        march.counts[PASSAGES] += 1


@routine
def note_passage(t, h, march):
    """Note the interval of a singular position; adjacent steps are of one interval."""
    last = march.counts[PASSAGES] - 1
    if last >= 0:
        if t <= march.passages[1, last]:
            march.passages[1, last] = max(t + h, march.passages[1, last])
            return
    if last + 1 < march.passages.shape[1]:
        march.passages[0, last + 1], march.passages[1, last + 1] = t, t + h
        march.counts[PASSAGES] += 1
