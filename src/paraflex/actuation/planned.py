"""Planned motions of joints as profiles in time, for motors that follow them."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import scipy

from paraflex.dynamics import piecewise_quintic
from paraflex.dynamics.quasi_static import joint_accelerations
from paraflex.mechanism import SampledAngle
from .feed_forward import FeedForward, TorquePlan

# The motion just before a knot of the path is that earlier by this fraction of the run.
_BEFORE = 1e-8


def planned_profiles(plan: TorquePlan, torques: FeedForward, joints: Sequence[str]) -> dict[str, SampledAngle]:
    """Return the planned angle or travel of joints over time, quintic between the instants of the plan.

    The acceleration may jump at the knots of the path.
    """
    knots, inner = torques.knots, torques.knots[1:-1]
    # The motion before a knot is that a little earlier, extrapolated.
    early = _BEFORE * (knots[-1] - knots[0])
    times = np.unique(np.concatenate([torques.times, inner - early]))
    rigid = plan.follow(times)
    found = {}
    for joint in joints:
        value, rate, acceleration = joint_accelerations(rigid.system, joint, rigid.q, rigid.v, rigid.a)
        breaks, coefficients = [], []
        for a, b in pairwise(knots):
            here = (times >= a) & (times < b - 0.5 * early)
            if b == knots[-1]:
                here |= times == b
            t, end = times[here].copy(), b - times[here][-1]
            parts = [x[here].copy() for x in (value, rate, acceleration)]
            parts[0][-1] += end * (parts[1][-1] + 0.5 * end * parts[2][-1])
            parts[1][-1] += end * parts[2][-1]
            t[-1] = b
            signal = piecewise_quintic(t, parts[0], parts[1], parts[2])
            breaks.append(signal.breaks[:-1])
            coefficients.append(signal.coefficients)
        polynomial = scipy.interpolate.PPoly(
            np.concatenate(coefficients).T[::-1], np.concatenate([*breaks, knots[-1:]])
        )
        found[joint] = SampledAngle(
            polynomial, polynomial.derivative(), polynomial.derivative(2), tuple(inner.tolist())
        )
    return found
