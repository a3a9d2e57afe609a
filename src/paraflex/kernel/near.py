"""Near a singular position, where for an instant constraint rows depend on one another, and across it.

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
from paraflex.kernel.compiling import routine
from paraflex.kernel.constraints import constraint_values
from paraflex.kernel.linear import solve_system
from paraflex.kernel.metric import mass_norm
from paraflex.kernel.projection import CLOSED, largest_violation, least_change
from paraflex.kernel.run_state import (
    DRIFTED,
    HELD_END,
    LAST_STEP,
    NEAR,
    PASSAGES,
    ROOT,
    ROOT_STEP,
    SLOPE,
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


@routine
def note_root(m, ws):
    """Keep how near to dependence constraint rows are at the start of a step, and how fast that changes."""
    m.clock[WIDEST] = max(m.clock[WIDEST], ws.least[0])
    if m.counts[ROOT_STEP] == m.counts[STEPS]:
        return
    root, change = sqrt(max(ws.least[0], 0.0)), 0.0
    if m.counts[ROOT_STEP] >= 0:
        change = (root - m.clock[ROOT]) / m.clock[LAST_STEP]
    size = max(abs(change), FORGETTING * abs(m.clock[SLOPE]))
    m.clock[SLOPE] = size if change > 0.0 else -size
    m.clock[ROOT], m.counts[ROOT_STEP] = root, m.counts[STEPS]


@routine
def comes_near(h, m):
    """Whether a step begins near a singular position."""
    return m.clock[ROOT] < max(NEAR_STEPS * abs(m.clock[SLOPE]) * h, NEAR_ROOT * sqrt(m.clock[WIDEST]))


@routine
def share_of_passage(h, m):
    """The part that a step is of the way past a singular position."""
    return min(1.0, abs(m.clock[SLOPE]) * h / (NEAR_ROOT * sqrt(m.clock[WIDEST])))


@routine
def trust(weights, g, b, ahead, m):
    """How far constraint rows are trusted near a singular position: `held` and `lag` of `hold_rows`.

    With root(t) what is left of a row, constraint rows w_a Phi'' + w_v Phi' + w_q Phi of a stage change with its
    acceleration along the opening direction by root (w_a + w_v g + w_q b) + root' (2 w_a g + w_v b): the matrix knows
    the first only, and before a singular position both cancel. The stage is so long `ahead` of the start of the step.
    """
    lag = (2.0 * weights[0] * g + weights[1] * b) / (weights[0] + weights[1] * g + weights[2] * b)
    speed = abs(m.clock[SLOPE])
    held = min(max(HELD * lag, LEAST_HELD * g) * speed, MOST_HELD)
    before = m.clock[SLOPE] < 0.0 and m.clock[ROOT] > speed * ahead
    return held, -lag * speed if before else lag * speed


@routine
def hold_rows(p, ws, held, lag, rows, scratch):
    """Right-hand sides of rows that nearly depend on others, as far as these rows are to be trusted.

    A row whose part left has a root below `held` gets what follows from the others: the solution does not move along
    the direction in which it nearly depends on them. Of others the true derivative along that direction is the
    matrix's times 1 + lag / root.
    """
    for i in range(p.rows.size):
        first, start = p.rows[i].first, p.rows[i].start - p.rows[i].first
        follows, square = 0.0, 0.0
        for k in range(first, i):
            follows += ws.schur[start + k] * scratch[k]
            square += ws.schur[start + k] * ws.schur[start + k]
        inverse = ws.schur[start + i]
        if inverse == 0.0:
            scratch[i] = 0.0
            continue
        scratch[i] = (rows[i] - follows) * inverse
        root = 1.0 / sqrt(1.0 + square * inverse * inverse)
        if ws.redundant[i] > 0.0 or root > FAR * held:
            continue
        scratch[i] = 0.0 if root < held else scratch[i] / (1.0 + lag / root)
        rows[i] = follows + scratch[i] / inverse


@routine
def damp_rows(p, ws, held, rows, scratch):
    """Right-hand sides of rows such that those with a root below `held` count as if they had that much left."""
    for i in range(p.rows.size):
        first, start = p.rows[i].first, p.rows[i].start - p.rows[i].first
        follows, square = 0.0, 0.0
        for k in range(first, i):
            follows += ws.schur[start + k] * scratch[k]
            square += ws.schur[start + k] * ws.schur[start + k]
        inverse = ws.schur[start + i]
        if inverse == 0.0:
            scratch[i] = 0.0
            continue
        root = 1.0 / sqrt(1.0 + square * inverse * inverse)
        scratch[i] = (rows[i] - follows) * inverse
        if root < held and ws.redundant[i] == 0.0:
            scratch[i] *= root / held
            rows[i] = follows + scratch[i] / inverse


@routine
def return_to_constraints(p, signals, t, held, m, ws):
    """Bring the end of a step near a singular position back to the constraints; how far it was from them [m].

    Only as far as rows are trusted. Where they are not, what they are off by, and its rate times the time it takes to
    where they are, still tell of that distance.
    """
    last = m.stage_q.shape[0] - 1
    q, v = m.stage_q[last], m.stage_v[last]
    constraint_values(p, signals, t, q, v, ws.scratch, ws.rows, ws.mu)
    distance = damped_distance(p, ws.rows, held, ws)
    if m.clock[SLOPE] != 0.0:
        constraint_values(p, signals, t, q, v, ws.scratch, ws.mu, ws.rows)
        distance = max(distance, held / abs(m.clock[SLOPE]) * damped_distance(p, ws.rows, held, ws))
    m.counts[HELD_END] = 1 if ws.least[0] < held * held else 0
    for _ in range(PASSES):
        constraint_values(p, signals, t, q, v, ws.scratch, ws.rows, ws.mu)
        if largest_violation(p, ws.rows) > CLOSED:
            hold_rows(p, ws, held, 0.0, ws.rows, ws.mu)
            least_change(p, ws.rows, ws)
            add(ws.x, q)
    for _ in range(PASSES):
        constraint_values(p, signals, t, q, v, ws.scratch, ws.mu, ws.rows)
        if largest_violation(p, ws.rows) > CLOSED:
            hold_rows(p, ws, held, 0.0, ws.rows, ws.mu)
            least_change(p, ws.rows, ws)
            add(ws.x, v)
    return distance * LEAVING if m.counts[DRIFTED] > 0 else distance


@routine
def damped_distance(p, rows, held, ws):
    """How far constraints of these values are from being met [m], rows not trusted counting as far as they are."""
    if largest_violation(p, rows) <= CLOSED:
        return 0.0
    damp_rows(p, ws, held, rows, ws.mu)
    least_change(p, rows, ws)
    return mass_norm(p, ws, ws.x)


@routine
def begin_near(p, m, ws):
    """Near a singular position: keep what opens the row that is nearest to dependence, at the start of the step."""
    m.counts[NEAR] = 1 + int(ws.least[1])
    open_row(p, m.counts[NEAR] - 1, ws)
    copy(ws.x, m.opening)


@routine
def open_row(p, row, ws):
    """The least change of coordinates that opens one row by one unit, into ws.x: infinite at a singular position."""
    fill(ws.x, 0.0)
    fill(ws.mu, 0.0)
    ws.mu[row] = 1.0
    solve_system(p, ws, ws.x, ws.mu)


@routine
def note_crossing(p, t, h, m, ws):
    """Keep when a step has straddled a singular position: what opens the row has changed sign, through infinity."""
    open_row(p, m.counts[NEAR] - 1, ws)
    product, start, end = 0.0, 0.0, 0.0
    for j in range(ws.x.size):
        product += m.opening[j] * ws.x[j]
        start += m.opening[j] * m.opening[j]
        end += ws.x[j] * ws.x[j]
    if product >= 0.0:
        return
    m.clock[ROOT] = -m.clock[ROOT]
    # Both grow as one over the time from it.
    note_position(t + h * sqrt(end) / (sqrt(start) + sqrt(end)), t, h, m)


@routine
def note_position(at, t, h, m):
    """Keep when a step from t was at a singular position, and as long before and after that as the step lasts."""
    last, around = m.counts[PASSAGES] - 1, max(at - t, t + h - at)
    if last >= 0:
        if abs(0.5 * (m.passages[0, last] + m.passages[1, last]) - at) < SAME_POSITION * h:
            return
    if last + 1 < m.passages.shape[1]:
        m.passages[0, last + 1], m.passages[1, last + 1] = at - around, at + around
        m.counts[PASSAGES] += 1


@routine
def note_passage(t, h, m):
    """Keep from when to when a run is at a singular position; steps that touch are of one."""
    last = m.counts[PASSAGES] - 1
    if last >= 0:
        if t <= m.passages[1, last]:
            m.passages[1, last] = max(t + h, m.passages[1, last])
            return
    if last + 1 < m.passages.shape[1]:
        m.passages[0, last + 1], m.passages[1, last + 1] = t, t + h
        m.counts[PASSAGES] += 1
