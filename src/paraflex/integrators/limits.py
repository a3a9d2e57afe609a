"""Longest steps that resolve the inputs: loads, torques and prescribed motions."""

from typing import NamedTuple

import numpy as np

from paraflex.arrays import Array
from paraflex.dynamics import Inputs, System
from paraflex.dynamics.signals import LEFT
from paraflex.findings import Finding
from paraflex.kernel.packed import Signals
from paraflex.mechanism import FlexibleBeam

# Changes below these parts of the largest value, or of its derivative by the shortest piece, are rounding. So are the
# remainders of terms that cancel in motions, which derivatives of quintic pieces amplify by the last factor.
_SMALL, _ROUNDING, _ENLARGED = 1e-6, 1e-11, 20.0
# Step limits are rounded down to powers of this; one is kept for adjacent pieces with the same limit.
_GRADES = 2.0**0.5


class StepLimits(NamedTuple):
    """Longest steps [s] from given times on; empty if no input limits the step size.

    Attributes
    ----------
    times : (k,) array
        Times, ascending [s].
    steps : (k,) array
        Longest step from each time to the next [s]; infinite for no limit.
    """

    times: Array
    steps: Array


def step_limits(signals: Signals, inputs: Inputs) -> StepLimits:
    """Return the step limits of all signals: one radian, as if they were sines, h^2 |g''| <= max |g| in each piece.

    g is the signal itself, or the acceleration of a prescribed motion, without its constant part.
    """
    looked_at = [(k, 0) for k in (*inputs.motors, *inputs.loads)] + [(k, 2) for k in inputs.prescribed]
    own = [limits for k, order in looked_at if (limits := _limits_of(signals, k, order)).times.size]
    if not own:
        return StepLimits(np.zeros(0), np.zeros(0))
    times = np.unique(np.concatenate([limits.times for limits in own]))
    pieces = [np.clip(np.searchsorted(limits.times, times, side="right") - 1, 0, None) for limits in own]
    steps = np.min([limits.steps[piece] for limits, piece in zip(own, pieces, strict=True)], axis=0)
    first = np.append(True, steps[1:] != steps[:-1])
    return StepLimits(np.ascontiguousarray(times[first]), np.ascontiguousarray(steps[first]))


def elements_too_few(system: System, limits: StepLimits) -> list[Finding]:
    """Return findings on beams whose elements resolve only vibrations slower than the changes of loads or motions.

    The upper half of the modes of a mesh is inaccurate; with one element the modes are inaccurate from the third
    bending mode on.
    """
    fastest, found = 1.0 / float(np.min(limits.steps, initial=np.inf)), {}
    for body in system.bodies:
        name = system.carrier(body.name)[0]
        if body.nf and isinstance(system.described.body(name), FlexibleBeam):
            resolved = float(np.sort(body.modes.omega)[body.nf // 2 - 1])
            if resolved < fastest:
                found[name] = Finding(
                    "elements-few", f"body.{name}.elements",
                    f"loads or profiles change as fast as a vibration of {fastest:.2g} rad/s, but elements of {name} "
                    f"resolve vibrations only up to {resolved:.2g} rad/s: deflections, forces and stresses may be "
                    "far off",
                    "give it more elements",
                )  # fmt: skip
    return list(found.values())


def _limits_of(signals: Signals, k: int, order: int) -> StepLimits:
    first, last = int(signals.start[k]), int(signals.start[k + 1]) - 1
    starts, coefficients = signals.breaks[first:last], signals.coefficients[first:last]
    lengths = np.diff(signals.breaks[first : last + 1])
    # Evaluate at both ends and in the middle of each piece.
    places = lengths[:, None] * np.array([0.0, 0.5, 1.0])
    value, curvature = (_derivative(coefficients, n, places) for n in (order, order + 2))
    shortest = float(np.min(lengths))
    left = _ENLARGED * LEFT if order else 0.0
    rounding = max(_ROUNDING * float(np.max(np.abs(coefficients[:, 0]), initial=0.0)), left)
    scale = max(0.5 * float(np.ptp(value)), _SMALL * float(np.max(np.abs(value))), rounding / shortest**order)
    noise = rounding / shortest ** (order + 2)
    bending = np.maximum(np.max(np.abs(curvature), axis=1) - noise, 0.0)
    if scale == 0.0 or not bending.any():
        return StepLimits(np.zeros(0), np.zeros(0))
    with np.errstate(divide="ignore"):
        steps = np.sqrt(scale / bending)
        steps = _GRADES ** np.floor(np.log(steps) / np.log(_GRADES))
    return StepLimits(starts, steps)


def _derivative(coefficients: Array, order: int, x: Array) -> Array:
    """Return the derivative of each piece's polynomial (k, 6), of ascending powers, at its points (k, j)."""
    derived = np.polynomial.polynomial.polyder(coefficients.T, order)
    return np.stack([np.polynomial.polynomial.polyval(column, derived, tensor=False) for column in x.T], axis=1)
