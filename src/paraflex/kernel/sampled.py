"""Sampled controller in the time loop: its readings, a linear control law with limits, torques held between samples.

With readings y, quantised and filtered, errors e = y - r_k and states x the law is

    w = P_k (h + C x + D e),   g = w within the limits,   x' = A x + B e + E (w - g),

or a compiled function computes w from the errors and updates x. Torques g of sample k act (whole + part) periods later.
"""

from math import cos, inf, isfinite, sin
from typing import Annotated, Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from .arrays import Floats, Ints, allocated, copy, fill
from .compiling import by_reference, routine

# Indices of SampledLaw.counts: number of the next sample, number of the next torques to act, whole periods of delay,
# error of the next sample (0, NOT_FINITE or RAISED), address of a compiled function.
SAMPLED, ACTED, WHOLE, WRONG, FUNCTION = range(5)
# Indices of SampledLaw.clock: time of the first sample [s], period [s], fraction of a period of delay, and the
# difference below which times count as equal [s].
START, PERIOD, PART, SLACK = range(4)
# Return values of `control`.
NOTHING, CHANGED, FAILED = range(3)
# Torques that are not finite, or an exception in a compiled function, whose previous states are then in `scratch[1]`.
NOT_FINITE, RAISED = 1, 2


@by_reference
class SampledLaw(NamedTuple):
    """Controller, its state, and its records; without a controller all arrays are empty."""

    clock: Annotated[Floats, "numbers"]  # see START
    counts: Annotated[Ints, "numbers"]  # see SAMPLED
    angle: Annotated[Ints, "inputs"]  # index of an angle in each reading, see `control.loop.readings.Affine`
    value: Annotated[Floats, "inputs"]
    rows_q: Annotated[Floats, "inputs", "n"]
    rows_v: Annotated[Floats, "inputs", "n"]
    rows_a: Annotated[Floats, "inputs", "n"]
    turning: Annotated[Floats, "inputs", "n"]
    points: Annotated[Ints, "places", 5]  # reading, indices of r, angle and u, size of u: see `Place`
    shapes: Annotated[Floats, "places", "numbers"]  # e, x0, N and B
    resolution: Annotated[Floats, "inputs"]  # zero without quantisation
    filter_A: Annotated[Floats, "filters", "filters"]  # matrix of all filters together
    filter_B: Annotated[Floats, "filters", "inputs"]
    filter_C: Annotated[Floats, "inputs", "filters"]
    filter_D: Annotated[Floats, "inputs"]
    filter_start: Annotated[Floats, "filters", "inputs"]  # steady state of the filters for the first readings
    reference: Annotated[Floats, "samples", "inputs"]
    A: Annotated[Floats, "states", "states"]
    B: Annotated[Floats, "states", "inputs"]
    C: Annotated[Floats, "outputs", "states"]
    D: Annotated[Floats, "outputs", "inputs"]
    E: Annotated[Floats, "states", "outputs"]
    holding: Annotated[Floats, "outputs"]  # h
    first: Annotated[Floats, "states", "inputs"]  # initial states for the first errors
    waiting: Annotated[Floats, "states"]  # one for states that are held while a torque is limited
    projector: Annotated[Floats, "samples", "outputs", "outputs"]  # empty without one
    lowest: Annotated[Floats, "outputs"]
    highest: Annotated[Floats, "outputs"]
    most: Annotated[Floats, "outputs"]  # largest change from sample to sample
    outputs: Annotated[Ints, "outputs"]  # number of each motor
    base: Annotated[Floats, "breaks"]  # first coefficients of the signals without the controller's torques
    filtered: Annotated[Floats, "filters"]  # states of filters
    x: Annotated[Floats, "states"]
    last: Annotated[Floats, "outputs"]  # torques of the last sample
    held: Annotated[Floats, "motors"]  # torques that act
    scratch: Annotated[Floats, 2, "widest"]  # for filters, states, inputs and outputs
    t: Annotated[Floats, "samples"]  # sample times
    acted: Annotated[Floats, "samples"]  # times from which on the torques of each sample act
    readings: Annotated[Floats, "samples", "inputs"]
    wanted: Annotated[Floats, "samples", "outputs"]  # torques before the limits
    given: Annotated[Floats, "samples", "outputs"]  # torques after the limits


def no_law() -> SampledLaw:
    """Return an empty law, for a run without a controller."""
    names = (
        "numbers",
        "inputs",
        "n",
        "places",
        "filters",
        "samples",
        "states",
        "outputs",
        "breaks",
        "motors",
        "widest",
    )
    return allocated(SampledLaw, dict.fromkeys(names, 0))


def _function_called(typingctx, address, k, t, y, x, torques):
    """Generate the call of a C function by its address, with numbers and pointers to vectors; returns its result."""
    signature = types.int64(address, k, t, y, x, torques)

    def code(context, builder, given, arguments):
        number, real = ir.IntType(64), ir.DoubleType()
        kind = ir.FunctionType(number, [number, real, *3 * [real.as_pointer()]])
        arrays = [
            cgutils.create_struct_proxy(array)(context, builder, value=value).data
            for array, value in zip(given.args[3:], arguments[3:], strict=True)
        ]
        return builder.call(builder.inttoptr(arguments[0], kind.as_pointer()), [arguments[1], arguments[2], *arrays])

    return signature, code


call_function: Any = intrinsic(_function_called)


@routine
def multiply_add(A, x, out):
    """Add A x to a vector."""
    for i in range(A.shape[0]):
        total = 0.0
        for j in range(A.shape[1]):
            total += A[i, j] * x[j]
        out[i] += total


@routine
def read(law, q, v, a, y):
    """Compute the readings (inputs,) at a state, quantised."""
    for i in range(law.value.size):
        total, turned = law.value[i], 0.0
        for j in range(q.size):
            total += law.rows_q[i, j] * q[j] + law.rows_v[i, j] * v[j] + law.rows_a[i, j] * a[j]
            turned += law.turning[i, j] * q[j]
        rate = v[law.angle[i]]
        y[i] = total + rate * rate * turned
    for p in range(law.points.shape[0]):
        y[law.points[p, 0]] = place_of(law, p, q)
    for i in range(law.value.size):
        if law.resolution[i] > 0.0:
            y[i] = law.resolution[i] * np.rint(y[i] / law.resolution[i])


@routine
def place_of(law, p, q):
    """Return the position of a point along an axis: see `control.loop.readings.Place`."""
    offset, angle, first, nf, numbers = law.points[p, 1], law.points[p, 2], law.points[p, 3], law.points[p, 4], 4
    x, y, bent = law.shapes[p, 2], law.shapes[p, 3], 0.0
    for i in range(nf):
        x += law.shapes[p, numbers + i] * q[first + i]
        y += law.shapes[p, numbers + nf + i] * q[first + i]
        for j in range(nf):
            bent += q[first + i] * law.shapes[p, numbers + 2 * nf + i * nf + j] * q[first + j]
    x -= 0.5 * bent
    c, s = cos(q[angle]), sin(q[angle])
    return law.shapes[p, 0] * (q[offset] + c * x - s * y) + law.shapes[p, 1] * (q[offset + 1] + s * x + c * y)


@routine
def filter_readings(law, k, y):
    """Filter the readings and advance the filters to the next sample."""
    before, after = law.filtered, law.scratch[1]
    if k == 0:
        fill(before, 0.0)
        multiply_add(law.filter_start, y, before)
    fill(after, 0.0)
    multiply_add(law.filter_A, before, after)
    multiply_add(law.filter_B, y, after)
    for i in range(law.value.size):
        y[i] *= law.filter_D[i]
    multiply_add(law.filter_C, before, y)
    for i in range(before.size):
        before[i] = after[i]


@routine
def take_sample(law, k, q, v, a):
    """Take the readings and compute the torques of sample k; return whether they are finite."""
    y, wanted, given = law.readings[k], law.wanted[k], law.given[k]
    read(law, q, v, a, y)
    if law.filter_D.size > 0:
        filter_readings(law, k, y)
    errors, x = law.scratch[0], law.x
    for i in range(y.size):
        errors[i] = y[i] - law.reference[k, i]
    if law.counts[FUNCTION] != 0:
        copy(x, law.scratch[1])
        fill(wanted, 0.0)
        if call_function(law.counts[FUNCTION], k, law.t[k], errors, x, wanted) != 0:
            law.counts[WRONG] = RAISED
            return False
    else:
        if k == 0:
            fill(x, 0.0)
            multiply_add(law.first, errors, x)
        copy(law.holding, wanted)
        multiply_add(law.C, x, wanted)
        multiply_add(law.D, errors, wanted)
        if law.projector.size > 0:
            plain = law.scratch[1]
            copy(wanted, plain)
            fill(wanted, 0.0)
            multiply_add(law.projector[k], plain, wanted)
    limited = False
    for i in range(wanted.size):
        if not isfinite(wanted[i]):
            law.counts[WRONG] = NOT_FINITE
            return False
        within = min(max(wanted[i], law.lowest[i]), law.highest[i])
        given[i] = min(max(within, law.last[i] - law.most[i]), law.last[i] + law.most[i])
        law.last[i] = given[i]
        limited = limited or given[i] != wanted[i]
    if law.counts[FUNCTION] == 0:
        go_on_to_next(law, errors, wanted, given, limited)
    return True


@routine
def go_on_to_next(law, errors, wanted, given, limited):
    """Update the states of a linear law to the next sample."""
    x, after = law.x, law.scratch[1]
    fill(after, 0.0)
    multiply_add(law.A, x, after)
    multiply_add(law.B, errors, after)
    if limited:
        for i in range(x.size):
            for j in range(given.size):
                after[i] += law.E[i, j] * (wanted[j] - given[j])
    for i in range(x.size):
        if not (limited and law.waiting[i] == 1.0):
            x[i] = after[i]


@routine
def next_instant(law):
    """Return the time of the next sample or of the next torques to act."""
    clock, counts = law.clock, law.counts
    sample = clock[START] + counts[SAMPLED] * clock[PERIOD] if counts[SAMPLED] < law.t.size else inf
    if counts[ACTED] == counts[SAMPLED]:
        return sample
    return min(sample, clock[START] + (counts[ACTED] + counts[WHOLE] + clock[PART]) * clock[PERIOD])


@routine
def control(law, signals, t, q, v, a):
    """Perform the actions due at a time: take a sample, and apply torques.

    Returns
    -------
    int
        NOTHING, CHANGED if the torques change at this time, or FAILED.
    """
    clock, counts = law.clock, law.counts
    now = t + clock[SLACK]
    k = counts[SAMPLED]
    if clock[START] + k * clock[PERIOD] <= now and k < law.t.size:
        law.t[k] = clock[START] + k * clock[PERIOD]
        if not take_sample(law, k, q, v, a):
            return FAILED
        counts[SAMPLED] += 1
    k = counts[ACTED]
    if k == counts[SAMPLED] or clock[START] + (k + counts[WHOLE] + clock[PART]) * clock[PERIOD] > now:
        return NOTHING
    law.acted[k] = t
    counts[ACTED] += 1
    changed = False
    for i in range(law.outputs.size):
        changed = changed or law.held[law.outputs[i]] != law.given[k, i]
        law.held[law.outputs[i]] = law.given[k, i]
    if not changed:
        return NOTHING
    for i in range(law.held.size):
        for piece in range(signals.start[i], signals.start[i + 1] - 1):
            signals.coefficients[piece, 0] = law.base[piece] + law.held[i]
    return CHANGED
