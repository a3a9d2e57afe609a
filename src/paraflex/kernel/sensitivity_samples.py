"""Derivatives of a run at its samples within a step, before the equations of motion are solved there."""

from typing import Annotated, NamedTuple

from paraflex.arrays import Array
from .arrays import Floats, Ints, fill
from .compiling import by_reference, inlined, routine
from .samples import differentiate_nodes, interpolate, node_slope, node_value, work_weight

# Step of central differences of fourth order, as a part of a parameter's size, and their points and weights.
DIFFERENCE_STEP = 1e-3
PLACES, WEIGHTS = (-2.0, -1.0, 1.0, 2.0), (1.0 / 12.0, -8.0 / 12.0, 8.0 / 12.0, -1.0 / 12.0)


@by_reference
class Sensitivity(NamedTuple):
    """Derivatives of the motion by one parameter: derivatives of the inputs, of the state, and of the samples."""

    t: Annotated[Floats, "steps"]  # derivatives of the start times of steps
    h: Annotated[Floats, "steps"]  # derivatives of the step sizes
    gains: Annotated[Floats, 4, 2]  # Baumgarte's alpha and beta at the points of the difference
    q: Annotated[Floats, "states", "n"]  # at the stages of the current step, the first its start, and at a sample
    v: Annotated[Floats, "states", "n"]
    a: Annotated[Floats, "states", "n"]
    lam: Annotated[Floats, "states", "m"]
    power: Annotated[Floats, "stages"]
    f: Annotated[Floats, "n"]  # R_s of the equations of motion
    rows: Annotated[Floats, "m"]  # R_s of the constraint rows
    moved_q: Annotated[Floats, "n"]  # scratch
    moved_v: Annotated[Floats, "n"]
    moved_lam: Annotated[Floats, "m"]
    work: Annotated[Floats, 2]  # work so far and its derivative
    taken: Annotated[Ints, 1]  # number of samples so far
    left: Annotated[Floats, "steps"]  # largest last relative correction, as in `History`
    times: Array  # (times,) sample times
    sample_times: Array  # (times,) derivatives of the sample times
    sample_q: Annotated[Floats, "times", "n"]
    sample_v: Annotated[Floats, "times", "n"]
    sample_a: Annotated[Floats, "times", "n"]
    sample_lam: Annotated[Floats, "times", "m"]
    sample_work: Annotated[Floats, "times"]  # without the work of weight


@routine
def work_sensitivity(tableau, k, history, sensitivity):
    """Return the work of the motors in step k, and its derivative."""
    last, work, d_work = tableau.c.size - 1, 0.0, 0.0
    for s in range(last + 1):
        work += history.h[k] * tableau.A[last, s] * history.power[k, s]
        d_work += tableau.A[last, s] * (history.h[k] * sensitivity.power[s] + sensitivity.h[k] * history.power[k, s])
    return work, d_work


@routine
def velocity_along_curve(tableau, k, x, d_x, history, sensitivity, v, dv):
    """Compute the velocity v at fraction x of long step k, by `differentiate_nodes`, and its derivative dv."""
    h = history.h[k]
    differentiate_nodes(tableau, x, h, history.q[k], v)
    differentiate_nodes(tableau, x, h, sensitivity.q, dv)
    for j in range(v.size):
        dv[j] -= sensitivity.h[k] / h * v[j]
    for s in tableau.nodes:
        bend = 0.0
        for e in range(4):
            bend += WEIGHTS[e] * node_slope(tableau, s, x + PLACES[e] * DIFFERENCE_STEP) / DIFFERENCE_STEP
        for j in range(v.size):
            dv[j] += d_x * bend / h * history.q[k, s, j]


@routine
def node_sensitivity(tableau, fraction, d_fraction, stages, derivatives, out):
    """Differentiate `interpolate_nodes` by a parameter that changes the stages and the fraction of the step."""
    fill(out, 0.0)
    for s in tableau.nodes:
        weight, slope = node_value(tableau, s, fraction), node_slope(tableau, s, fraction)
        for r in range(out.size):
            out[r] += weight * derivatives[s, r] + slope * d_fraction * stages[s, r]


@routine
def sensitivity_at_sample(tableau, k, i, long, history, sensitivity):
    """Compute derivatives of the values at sample i in step k; leave interpolated accelerations in moved_v."""
    t, h = history.t[k], history.h[k]
    time, d_time = sensitivity.times[i], sensitivity.sample_times[i] - sensitivity.t[k]
    piece = 0
    while piece < tableau.dense.size - 2 and time > t + tableau.c[tableau.dense[piece + 1]] * h:
        piece += 1
    s0, s1 = tableau.dense[piece], tableau.dense[piece + 1]
    width, d_width = (tableau.c[s1] - tableau.c[s0]) * h, (tableau.c[s1] - tableau.c[s0]) * sensitivity.h[k]
    z = min(max((time - t - tableau.c[s0] * h) / width, 0.0), 1.0)
    d_z = (d_time - tableau.c[s0] * sensitivity.h[k] - z * d_width) / width
    shifts = d_z != 0.0 or d_width != 0.0
    for j in range(sensitivity.q.shape[1]):
        sensitivity.sample_q[i, j], sensitivity.sample_v[i, j], sensitivity.sample_a[i, j] = interpolate(
            sensitivity.q[s0, j], sensitivity.v[s0, j], sensitivity.a[s0, j],
            sensitivity.q[s1, j], sensitivity.v[s1, j], sensitivity.a[s1, j], width, z,
        )  # fmt: skip
        sensitivity.moved_v[j] = curve(history, k, s0, s1, j, width, z)[2]
        if shifts:
            for e in range(4):
                moved = PLACES[e] * DIFFERENCE_STEP
                q, v, a = curve(history, k, s0, s1, j, width + moved * d_width, z + moved * d_z)
                sensitivity.sample_q[i, j] += WEIGHTS[e] * q / DIFFERENCE_STEP
                sensitivity.sample_v[i, j] += WEIGHTS[e] * v / DIFFERENCE_STEP
                sensitivity.sample_a[i, j] += WEIGHTS[e] * a / DIFFERENCE_STEP
    fraction = (time - t) / h
    done = min(max(fraction, 0.0), 1.0)
    d_done = (d_time - fraction * sensitivity.h[k]) / h
    node_sensitivity(tableau, fraction, d_done, history.lam[k], sensitivity.lam, sensitivity.sample_lam[i])
    if long:
        node_sensitivity(tableau, fraction, d_done, history.q[k], sensitivity.q, sensitivity.sample_q[i])
        velocity_along_curve(
            tableau, k, fraction, d_done, history, sensitivity, sensitivity.moved_q, sensitivity.sample_v[i]
        )
    sensitivity.sample_work[i] = sensitivity.work[1]
    for s in range(history.power.shape[1]):
        weight, slope = work_weight(tableau, s, done)
        sensitivity.sample_work[i] += weight * (h * sensitivity.power[s] + sensitivity.h[k] * history.power[k, s])
        sensitivity.sample_work[i] += h * slope * d_done * history.power[k, s]


@inlined
def curve(history, k, s0, s1, j, width, z):
    """Interpolate coordinate j, its velocity and acceleration between two stages of step k."""
    return interpolate(
        history.q[k, s0, j], history.v[k, s0, j], history.a[k, s0, j],
        history.q[k, s1, j], history.v[k, s1, j], history.a[k, s1, j], width, z,
    )  # fmt: skip
