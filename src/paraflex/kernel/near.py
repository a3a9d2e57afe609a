"""Steps near and across a singular position, where constraint rows are linearly dependent at one time.

The motion is smooth there, but the multipliers have a pole, and a residual Phi of the constraints displaces the
mechanism by Phi / root. The *root* is the square root of the relative pivot of the row nearest to dependence. A run is
therefore projected onto the constraints where it comes near such a position (`kernel.march.enter`), and at the end of
each step there. Stages factor the matrix at their current position. Rows closer to dependence than their own lag leave
the accelerations as extrapolated from earlier stages: the constraints' second derivatives do not determine them there.
The step size is kept meanwhile, so that a few steps span the position.
"""

from math import sqrt

from . import indices as at
from .arrays import add, copy, fill
from .compiling import inlined, routine
from .constraints import constraint_values
from .linear import own_square, solve_system
from .metric import mass_norm
from .projection import NO_VIOLATION, largest_violation, least_change

# A run is near a singular position if it could reach it within this many steps, or if the root is less than this part
# of its largest value so far; in either case only if the relative pivot is less than this part of its largest value.
NEAR_STEPS, NEAR_ROOT, NEAR_PART = 8.0, 0.02, 0.1
# Rows are held closer to a singular position than this many times their lag, or than this many g, but not above this
# root.
HELD, LEAST_HELD, MOST_HELD = 3.0, 0.5, 0.3
# Factor per step by which the recorded rate of change of the root decays.
FORGETTING = 0.9
# Shorter steps do not remove the drift of a step that ended with held rows: at the end of the next step the distance
# counts by this fraction.
LEAVING = 0.03
# Number of corrections of position, and of velocity, towards the constraints.
PASSES = 2
# Singular positions closer than this many steps count as one.
SAME_POSITION = 2.0
# Rows with a root above this many times the limit for held rows are not changed.
FAR = 10.0


@inlined
def elastic_measure_changes(system, b, march):
    """Return whether this is a step's first attempt with a b other than the last step's, with elastic links."""
    first = 0 <= march.counts[at.ROOT_STEP] < march.counts[at.STEPS]
    return first and b != march.clock[at.ROOT_B] and system.modal.size > 0


@routine
def note_root(system, march, work):
    """Record the root of the row nearest to dependence at the start of a step, and its rate of change.

    Both are in the metric M + b K of a step. If welds are independent only by elasticity, the root falls with longer
    steps. A change of the root with b at the same pose is therefore not an approach to a singular position; it rescales
    the values that the root is compared with.
    """
    root, change, b = sqrt(max(work.least[0], 0.0)), 0.0, work.step[0]
    if march.counts[at.ROOT_STEP] == march.counts[at.STEPS]:
        before = abs(march.clock[at.ROOT])
        if system.modal.size > 0 and b != march.clock[at.ROOT_B] and before > 0.0:
            widest = march.clock[at.WIDEST] * (root / before) ** 2
            march.clock[at.WIDEST] = max(work.least[0], min(1.0, widest))
            march.clock[at.ROOT] *= root / before
            march.clock[at.ROOT_B] = b
        return
    if march.counts[at.ROOT_STEP] >= 0:
        change = (root - march.clock[at.ROOT]) / march.clock[at.LAST_STEP]
    size = max(abs(change), FORGETTING * abs(march.clock[at.ROOT_RATE]))
    march.clock[at.ROOT_RATE] = size if change > 0.0 else -size
    march.clock[at.ROOT], march.counts[at.ROOT_STEP], march.clock[at.ROOT_B] = root, march.counts[at.STEPS], b
    march.clock[at.WIDEST] = max(march.clock[at.WIDEST], work.least[0])


@routine
def comes_near(h, march):
    """Return whether a step begins near a singular position."""
    return march.clock[at.ROOT] < max(
        NEAR_STEPS * abs(march.clock[at.ROOT_RATE]) * h, NEAR_ROOT * sqrt(march.clock[at.WIDEST])
    )


@routine
def share_of_passage(h, march):
    """Return the fraction of the passage through a singular position that a step covers."""
    return min(1.0, abs(march.clock[at.ROOT_RATE]) * h / (NEAR_ROOT * sqrt(march.clock[at.WIDEST])))


@routine
def trust(weights, g, b, ahead, march):
    """Return `held` and `lag` of `hold_rows`, the weights of constraint rows near a singular position.

    With root(t) the root of a row, constraint rows w_a Phi'' + w_v Phi' + w_q Phi of a stage change with its
    acceleration along the opening direction by root (w_a + w_v g + w_q b) + root' (2 w_a g + w_v b). The matrix
    contains the first term only, and before a singular position the two cancel. The stage is at the time `ahead` after
    the start of the step.
    """
    lag = (2.0 * weights[0] * g + weights[1] * b) / (weights[0] + weights[1] * g + weights[2] * b)
    speed = abs(march.clock[at.ROOT_RATE])
    held = min(max(HELD * lag, LEAST_HELD * g) * speed, MOST_HELD)
    before = march.clock[at.ROOT_RATE] < 0.0 and march.clock[at.ROOT] > speed * ahead
    return held, -lag * speed if before else lag * speed


@routine
def hold_rows(system, work, held, lag, rows, scratch):
    """Reduce the right-hand sides of rows that nearly depend on others, by `held` and `lag` of `trust`.

    A row with a root below `held` gets the value that follows from the other rows: the solution does not move along the
    direction in which it nearly depends on them. For the others the true derivative along that direction is that of the
    matrix times 1 + lag / root.
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
    """Reduce the right-hand sides of rows as if roots below `held` were equal to `held`."""
    for i in range(system.rows.size):
        follows, inverse, root = rest_of_row(system, work, i, scratch)
        scratch[i] = (rows[i] - follows) * inverse
        if inverse != 0.0 and root < held and work.redundant[i] == 0.0:
            scratch[i] *= root / held
            rows[i] = follows + scratch[i] / inverse


@inlined
def rest_of_row(system, work, i, scratch):
    """Return the contribution of the reduced rows before row i, the inverse of its pivot, and its root."""
    first, start = system.rows[i].first, system.rows[i].start - system.rows[i].first
    follows, square = 0.0, 0.0
    for k in range(first, i):
        follows += work.schur[start + k] * scratch[k]
        square += work.schur[start + k] * work.schur[start + k]
    inverse = work.schur[start + i]
    if inverse == 0.0:
        return follows, inverse, 1.0
    pivot = 1.0 / (inverse * inverse)
    own, second = pivot + square, system.rows[i].second > 0
    before = system.rows[i - 1].start - first if second else 0
    if second and work.schur[before + i - 1] > 0.0:
        diagonal = 1.0 / work.schur[before + i - 1]
        product, first_square = work.schur[start + i - 1] * diagonal, diagonal * diagonal
        for k in range(first, i - 1):
            product += work.schur[start + k] * work.schur[before + k]
            first_square += work.schur[before + k] * work.schur[before + k]
        own = own_square(own, product, first_square)
    return follows, inverse, min(sqrt(pivot / own), 1.0)


@routine
def return_to_constraints(system, signals, t, held, march, work):
    """Project the end of a step near a singular position onto the constraints; return the distance from them [m].

    Rows are projected only as far as they are trusted. For the others, the violation and its rate, times the time until
    the rows are trusted again, still contribute to the distance.
    """
    last = march.stage_q.shape[0] - 1
    q, v = march.stage_q[last], march.stage_v[last]
    constraint_values(system, signals, t, q, v, work.scratch, work.rows, work.mu)
    distance = damped_distance(system, work.rows, held, work)
    if march.clock[at.ROOT_RATE] != 0.0:
        constraint_values(system, signals, t, q, v, work.scratch, work.mu, work.rows)
        distance = max(distance, held / abs(march.clock[at.ROOT_RATE]) * damped_distance(system, work.rows, held, work))
    march.counts[at.HELD_END] = 1 if work.least[0] < held * held else 0
    for _ in range(PASSES):
        constraint_values(system, signals, t, q, v, work.scratch, work.rows, work.mu)
        remove_violation(system, held, q, work)
    for _ in range(PASSES):
        constraint_values(system, signals, t, q, v, work.scratch, work.mu, work.rows)
        remove_violation(system, held, v, work)
    return distance * LEAVING if march.counts[at.DRIFTED] > 0 else distance


@routine
def remove_violation(system, held, x, work):
    """Change coordinates or velocities x so that rows with the violations in work.rows hold: see `hold_rows`."""
    if largest_violation(system, work.rows) > NO_VIOLATION:
        hold_rows(system, work, held, 0.0, work.rows, work.mu)
        least_change(system, work.rows, work)
        add(work.x, x)


@routine
def damped_distance(system, rows, held, work):
    """Return the distance from the constraints for these violations [m], with nearly dependent rows reduced."""
    if largest_violation(system, rows) <= NO_VIOLATION:
        return 0.0
    damp_rows(system, work, held, rows, work.mu)
    least_change(system, rows, work)
    return mass_norm(system, work, work.x)


@routine
def begin_near(system, march, work):
    """Store the direction that opens the row nearest to dependence, at the start of a step near a singular position."""
    march.counts[at.NEAR] = 1 + int(work.least[1])
    open_row(system, march.counts[at.NEAR] - 1, work)
    copy(work.x, march.opening)


@routine
def open_row(system, row, work):
    """Compute the least change of coordinates that opens one row by one unit, into work.x.

    It is infinite at a singular position.
    """
    fill(work.x, 0.0)
    fill(work.mu, 0.0)
    work.mu[row] = 1.0
    solve_system(system, work, work.x, work.mu)


@routine
def note_crossing(system, t, h, march, work):
    """Record the passage of a singular position if the opening direction changes sign in a step, through infinity."""
    open_row(system, march.counts[at.NEAR] - 1, work)
    product, start, end = 0.0, 0.0, 0.0
    for j in range(work.x.size):
        product += march.opening[j] * work.x[j]
        start += march.opening[j] * march.opening[j]
        end += work.x[j] * work.x[j]
    if product >= 0.0:
        return
    march.clock[at.ROOT] = -march.clock[at.ROOT]
    # Both directions grow as the inverse of the time from the position.
    note_position(t + h * sqrt(end) / (sqrt(start) + sqrt(end)), t, h, march)


@routine
def note_position(time, t, h, march):
    """Record that a step from t reached a singular position, with an interval of the step's length on both sides."""
    last, around = march.counts[at.PASSAGES] - 1, max(time - t, t + h - time)
    if last < 0 or abs(0.5 * (march.passages[0, last] + march.passages[1, last]) - time) >= SAME_POSITION * h:
        add_passage(time - around, time + around, march)


@routine
def note_passage(t, h, march):
    """Record the interval of a singular position; adjacent steps form one interval."""
    last = march.counts[at.PASSAGES] - 1
    if last >= 0 and t <= march.passages[1, last]:
        march.passages[1, last] = max(t + h, march.passages[1, last])
    else:
        add_passage(t, t + h, march)


@inlined
def add_passage(start, end, march):
    """Add an interval to those of singular positions, unless there is no room."""
    count = march.counts[at.PASSAGES]
    if count < march.passages.shape[1]:
        march.passages[0, count], march.passages[1, count] = start, end
        march.counts[at.PASSAGES] += 1
