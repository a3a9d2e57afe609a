"""Functions of time for the kernels: motor torques and prescribed angles as piecewise quintics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from paraflex.kernel.packed import PackedSystem, Signals
from paraflex.mechanism import Mechanism

# Breaks of a prescribed law: its quintic Hermite pieces are this short, as a fraction of the run.
_LAW_PIECES = 2000
_DEGREE = 5


@dataclass(frozen=True)
class InputSignals:
    """One piecewise polynomial: breaks (k + 1,) and coefficients (k, 6), ascending powers of t - break."""

    breaks: NDArray[np.float64]
    coefficients: NDArray[np.float64]


def piecewise_quintic(
    t: NDArray[np.float64], value: NDArray[np.float64], rate: NDArray[np.float64], acceleration: NDArray[np.float64]
) -> InputSignals:
    """The quintic Hermite interpolant of values with two derivatives; each of them is reproduced at t.

    Parameters
    ----------
    t, value, rate, acceleration : (k + 1,) arrays
        Times strictly increasing [s].
    """
    h = np.diff(t)
    c0, c1, c2 = value[:-1], rate[:-1], 0.5 * acceleration[:-1]
    # What the first three terms miss at the right end, in value, rate and acceleration.
    d0 = value[1:] - (c0 + h * (c1 + h * c2))
    d1 = (rate[1:] - (c1 + 2.0 * h * c2)) * h
    d2 = (acceleration[1:] - 2.0 * c2) * h**2
    c3 = (10.0 * d0 - 4.0 * d1 + 0.5 * d2) / h**3
    c4 = (-15.0 * d0 + 7.0 * d1 - d2) / h**4
    c5 = (6.0 * d0 - 3.0 * d1 + 0.5 * d2) / h**5
    return InputSignals(np.asarray(t, dtype=float), np.column_stack([c0, c1, c2, c3, c4, c5]))


def constant_signals(values: Sequence[float], end: float) -> list[InputSignals]:
    """Signals that do not change on [0, end]."""
    signals = []
    for value in values:
        coefficients = np.zeros((1, _DEGREE + 1))
        coefficients[0, 0] = value
        signals.append(InputSignals(np.array([0.0, end]), coefficients))
    return signals


def no_signals(packed: PackedSystem) -> Signals:
    """Zero for every motor torque and prescribed value that a packed system asks for."""
    numbers = [packed.rows["signal"], packed.efforts["signal"]]
    return _pack(constant_signals([0.0] * (1 + max(int(group.max(initial=-1)) for group in numbers)), 1.0))


def pack_signals(mechanism: Mechanism, torques: Sequence[InputSignals], end: float) -> tuple[Signals, list[float]]:
    """Motor torques and the mechanism's prescribed angles, for the kernels.

    Parameters
    ----------
    mechanism : Mechanism
    torques : sequence of InputSignals
        One a motor.
    end : float
        Of the run [s].

    Returns
    -------
    Signals, knots
        The knots are the times at which a prescribed law is not smooth.
    """
    signals, knots = list(torques), []
    for prescribed in mechanism.prescribed:
        inner = sorted(knot for knot in prescribed.law.knots if 0.0 < knot < end)
        knots += inner
        edges = np.array([0.0, *inner, end])
        # The law may jump in a derivative at a knot: pieces on either side take its one-sided limits.
        parts = []
        for a, b in pairwise(edges):
            count = max(8, round(_LAW_PIECES * (b - a) / end))
            t = np.linspace(a, b, count + 1)
            inside = t.copy()
            inside[0] += 1e-12 * (b - a)
            inside[-1] -= 1e-12 * (b - a)
            parts.append(piecewise_quintic(t, *prescribed.law.evaluate(inside)))
        signals.append(_join(parts))
    return _pack(signals), knots


def resting_signals(mechanism: Mechanism, time: float) -> Signals:
    """Motors without torque and the mechanism's prescribed angles, for what is asked at one instant [s]."""
    end = time + 1.0
    return pack_signals(mechanism, constant_signals([0.0] * len(mechanism.motors), end), end)[0]


def _join(parts: Sequence[InputSignals]) -> InputSignals:
    breaks = np.concatenate([part.breaks[:-1] for part in parts] + [parts[-1].breaks[-1:]])
    return InputSignals(breaks, np.vstack([part.coefficients for part in parts]))


def _pack(signals: Sequence[InputSignals]) -> Signals:
    filler = np.zeros((1, _DEGREE + 1))
    pieces = [np.zeros((0, _DEGREE + 1))]
    for signal in signals:
        pieces += [signal.coefficients, filler]
    return Signals(
        start=np.cumsum([0] + [signal.breaks.size for signal in signals]),
        breaks=np.concatenate([np.zeros(0), *(signal.breaks for signal in signals)]),
        coefficients=np.ascontiguousarray(np.vstack(pieces)),
    )
