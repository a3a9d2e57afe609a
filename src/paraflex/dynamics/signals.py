"""Time profiles for the kernels: motor torques, loads and prescribed angles as piecewise quintics."""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from paraflex.arrays import Array, brief
from paraflex.errors import InputError, within
from paraflex.kernel.packed import PackedSystem, Signals
from paraflex.mechanism import Mechanism, TabulatedProfile, TimeProfile
from .inputs import inputs_of

# Initial number of quintic Hermite pieces of a prescribed motion per run, and largest numbers of pieces and halvings.
# Pieces are halved until their midpoints are within _NEAR_PROFILE of it, relative to its largest value, or within
# _NEARLY_PROFILE if errors no longer fall to the fraction _FALLING.
_PROFILE_PIECES, _MOST_PIECES, _HALVINGS = 2000, 500_000, 20
_NEAR_PROFILE, _NEARLY_PROFILE, _FALLING = 1e-10, 1e-3, 0.25
# Rounding error of cancelling terms of a prescribed motion [rad or m]; relative to values above one.
LEFT = 2e-14
_SHORTEST_PIECE = 1e-6
# Changes of loads within this time excite vibrations as jumps do [s].
_RISE = 1e-3
_DEGREE = 5


class InputSignals(NamedTuple):
    """A piecewise polynomial: breaks (k + 1,) and coefficients (k, 6), ascending powers of t - break."""

    breaks: Array
    coefficients: Array
    __repr__ = brief


def piecewise_quintic(t: Array, value: Array, rate: Array, acceleration: Array, left: float = 0.0) -> InputSignals:
    """Return the quintic Hermite interpolant of values with two derivatives, all three exact at t.

    Parameters
    ----------
    t, value, rate, acceleration : (k + 1,) arrays
        Times, strictly increasing [s], and the values with their first and second derivatives there.
    left : float
        Rounding error of values, relative to those above one; zero by default. If the change of value over a piece
        agrees with that of the rates within this error, the latter is used: the second derivative of the rounding error
        would appear as an acceleration.
    """
    h = np.diff(t)
    c0, c1, c2 = value[:-1], rate[:-1], 0.5 * acceleration[:-1]
    # Residual of the first three terms at the right end, in value, rate and acceleration.
    d0 = value[1:] - (c0 + h * (c1 + h * c2))
    d1 = (rate[1:] - (c1 + 2.0 * h * c2)) * h
    d2 = (acceleration[1:] - 2.0 * c2) * h**2
    of_rates = 0.5 * d1 - d2 / 12.0
    d0 = np.where(np.abs(d0 - of_rates) <= left * np.maximum(1.0, np.abs(value[1:])), of_rates, d0)
    c3 = (10.0 * d0 - 4.0 * d1 + 0.5 * d2) / h**3
    c4 = (-15.0 * d0 + 7.0 * d1 - d2) / h**4
    c5 = (6.0 * d0 - 3.0 * d1 + 0.5 * d2) / h**5
    return InputSignals(np.asarray(t, dtype=float), np.column_stack([c0, c1, c2, c3, c4, c5]))


def constant_signals(values: Sequence[float], end: float) -> list[InputSignals]:
    """Return constant signals on [0, end]."""
    breaks = np.array([0.0, end])
    return [InputSignals(breaks, np.array([[value, 0.0, 0.0, 0.0, 0.0, 0.0]])) for value in values]


def no_signals(packed: PackedSystem) -> Signals:
    """Return zero for every motor torque and prescribed value of a packed system."""
    numbers = [packed.rows["signal"], packed.motor_sides["signal"]]
    return _pack(constant_signals([0.0] * (1 + max(int(group.max(initial=-1)) for group in numbers)), 1.0))


def pack_signals(mechanism: Mechanism, torques: Sequence[InputSignals], end: float) -> tuple[Signals, list[float]]:
    """Pack motor torques and the mechanism's loads in time and prescribed angles for the kernels.

    Parameters
    ----------
    mechanism : Mechanism
        Mechanism with its loads and prescribed motions.
    torques : sequence of InputSignals
        Torque of each motor; see `Inputs` for their order.
    end : float
        End of the run [s].

    Returns
    -------
    Signals, knots
        Packed signals, and the times at which a profile is not smooth.

    Raises
    ------
    InputError
        A profile does not cover the run or is not finite in it.
    """
    signals, knots = list(torques), []
    for place, profile in _profiles(mechanism):
        signal, inner = profile_signal(place, profile, end, LEFT if place.startswith("prescribed.") else 0.0)
        signals.append(signal)
        knots += inner
    return _pack(signals), knots


def profile_signal(place: str, profile: TimeProfile, end: float, left: float = 0.0) -> tuple[InputSignals, list[float]]:
    """Convert a profile in time on [0, end] to a signal and the times between which it is smooth.

    Parameters
    ----------
    place : str
        Position of the profile in a file, for errors.
    profile : TimeProfile
        Profile in time.
    end : float
        End of the run [s].
    left : float
        Rounding error of its values, below which pieces are not refined; zero by default.

    Raises
    ------
    InputError
        The profile does not cover the run or is not finite in it.
    """
    inner = sorted(knot for knot in profile.knots if 0.0 < knot < end)
    if isinstance(profile, TabulatedProfile) and profile.linear:
        t = _grid(profile, 0.0, end, end)
        value, lines = _evaluate(place, profile, t)[0], np.zeros((t.size - 1, _DEGREE + 1))
        lines[:, 0], lines[:, 1] = value[:-1], np.diff(value) / np.diff(t)
        return InputSignals(t, lines), [stop for stop in profile.stops if 0.0 < stop < end]
    if getattr(profile, "breaks", None) is not None:
        left = 0.0  # quintic already
    # The profile or a derivative may jump at a knot: the pieces on either side take its one-sided limits.
    intervals = pairwise([0.0, *inner, end])
    parts = [_refined(place, profile, _grid(profile, a, b, end), left) for a, b in intervals]
    breaks = np.concatenate([part.breaks[:-1] for part in parts] + [parts[-1].breaks[-1:]])
    return InputSignals(breaks, np.vstack([part.coefficients for part in parts])), inner


def _refined(place: str, profile: TimeProfile, t: Array, left: float) -> InputSignals:
    """Return quintic pieces of a profile between breaks, halved where the profile changes too fast for them.

    Raises
    ------
    InputError
        The profile fails as in `profile_signal`, or it changes so fast that there are too many pieces.
    """
    a, b = t[0], t[-1]
    # Values and derivatives at the ends of a smooth interval are those inside it.
    low, high = max(a + 1e-12 * (b - a), np.nextafter(a, b)), min(b - 1e-12 * (b - a), np.nextafter(b, a))
    last = np.inf
    for _ in range(_HALVINGS):
        value, rate, acceleration = _evaluate(place, profile, np.clip(t, low, high))
        outside = t - np.clip(t, low, high)
        pieces = piecewise_quintic(t, value + outside * rate, rate + outside * acceleration, acceleration, left)
        half = 0.5 * np.diff(t)
        value = _evaluate(place, profile, t[:-1] + half)[0]
        powers = half[:, None] ** np.arange(_DEGREE + 1)
        off = np.abs(np.sum(powers * pieces.coefficients, axis=1) - value)
        size, worst = np.max(np.abs(value)), np.max(off)
        near = max(_NEAR_PROFILE * size, left)
        coarse = off > near
        # Errors of rounding and of kinks do not decrease with the length of pieces.
        if worst <= near or (worst <= _NEARLY_PROFILE * size and worst > _FALLING * last):
            return pieces
        last = worst
        t = np.sort(np.append(t, t[:-1][coarse] + half[coarse]))
        if t.size > _MOST_PIECES:
            break
    raise InputError(
        f"it changes too fast between t = {a:g} and {b:g} s to be followed", field=place,
        remedy="give a shorter duration, or smoother profiles; where it jumps or has a kink, pieces that end there",
    )  # fmt: skip


def table_curve(table: TabulatedProfile) -> InputSignals:
    """Return the pieces of a table over another quantity than time, one more before it and after it with its ends.

    There is a piece for every break, the first before the table.
    """
    t, values = np.array(table.times), np.array(table.values)
    inner = np.zeros((t.size - 1, _DEGREE + 1), dtype=np.result_type(t, values))
    if table.linear:
        inner[:, 0], inner[:, 1] = values[:-1], np.diff(values) / np.diff(t)
    else:
        inner = piecewise_quintic(t, *table.evaluate(t)).coefficients
    ends = np.zeros((2, _DEGREE + 1), dtype=inner.dtype)
    ends[:, 0] = values[[0, -1]]
    return InputSignals(np.array([t[0] - (t[-1] - t[0]), *t]), np.vstack([ends[:1], inner, ends[1:]]))


def still_signals(mechanism: Mechanism, end: float) -> tuple[Signals, list[float]]:
    """Return the signals of `pack_signals` without motor torques."""
    return pack_signals(mechanism, _no_torques(mechanism, end), end)


def moment_signals(mechanism: Mechanism, time: float) -> Signals:
    """Return signals valid at one time: no torques; profiles with their rate and acceleration."""
    signals = _no_torques(mechanism, 1.0)
    for place, profile in _profiles(mechanism):
        value, rate, acceleration = (float(x[0]) for x in _evaluate(place, profile, np.array([time])))
        taylor = np.array([[value, rate, 0.5 * acceleration, 0.0, 0.0, 0.0]])
        signals.append(InputSignals(np.array([time, time + 1.0]), taylor))
    return _pack(signals)


def acting_loads(mechanism: Mechanism, t: Array, *, before: bool = False) -> Array:
    """Return the load components (k, acting) that are profiles in time, at given times; zero for motors [N, N m].

    Parameters
    ----------
    mechanism : Mechanism
        Mechanism of the loads.
    t : (k,) array
        Times [s].
    before : bool
        Whether to evaluate just before these times, where a load may jump.
    """
    inputs = inputs_of(mechanism)
    acting = np.zeros((t.size, inputs.acting))
    at = np.nextafter(t, -np.inf) if before else t
    for k, (place, profile) in zip(inputs.loads, _profiles(mechanism), strict=False):
        acting[:, k] = _evaluate(place, profile, at)[0]
    return acting


def steep_times(mechanism: Mechanism, end: float) -> Array:
    """Return the knots (j,) after which a load changes by half its size or more within a millisecond [s].

    Rows of a table that are close to one another stand for a jump.
    """
    knots = np.unique([k for load in mechanism.loads for each in load.profiles for k in each.knots if 0.0 < k < end])
    before, after = acting_loads(mechanism, knots, before=True), acting_loads(mechanism, np.minimum(knots + _RISE, end))
    size = np.max(np.abs([before, after]), axis=(0, 1), initial=0.0)
    return knots[np.any((np.abs(after - before) >= 0.5 * size) & (size > 0.0), axis=1)]


def _profiles(mechanism: Mechanism) -> Iterator[tuple[str, TimeProfile]]:
    """Yield the profiles of loads, then of prescribed motions, each with its position in a file."""
    yield from ((f"load.{load.name}", profile) for load in mechanism.loads for profile in load.profiles)
    yield from ((f"prescribed.{one.name}", one.profile) for one in mechanism.prescribed)


def _no_torques(mechanism: Mechanism, end: float) -> list[InputSignals]:
    return constant_signals([0.0 for _ in inputs_of(mechanism).motors], end)


def _grid(profile: TimeProfile, a: float, b: float, end: float) -> Array:
    """Return the breaks of a profile's pieces on [a, b]: its own if it is a quintic between them, else many."""
    breaks = getattr(profile, "breaks", None)
    if breaks is None:
        return np.linspace(a, b, max(8, round(_PROFILE_PIECES * (b - a) / end)) + 1)
    # A piece of nearly zero length would have no accurate second derivative.
    margin = _SHORTEST_PIECE * (b - a)
    return np.array([a, *(t for t in breaks if a + margin < t < b - margin), b])


def _evaluate(place: str, profile: TimeProfile, t: Array) -> tuple[Array, Array, Array]:
    with within(place):
        return profile.evaluate(t)


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
