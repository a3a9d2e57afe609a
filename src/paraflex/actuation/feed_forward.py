"""Torques as smooth functions of time: splines between the path's knots, exact to the tolerance."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from paraflex.arrays import Array, Brief
from paraflex.dynamics import InputSignals, constant_signals
from paraflex.errors import Moment, NumericalError
from paraflex.mechanism import ActuationMode
from paraflex.paths import RigidMotion
from .allocation import PAST_SINGULAR, Effort, allocate, required_effort
from .quintic import DEGREE, quintic_splines

# Largest error of the spline, as a fraction of the peak torque of the run.
_SPLINE_ERROR = 1e-8
# Least factor by which halving the interval reduces the error; it is 2^6 for smooth torques.
_ERROR_FALL = 32.0
# Initial grid: least number of points of a smooth interval, and largest spacing [s].
_FEWEST_POINTS, _LONGEST_SPACING = 12, 2e-3
_REFINEMENTS = 6
# Delayed breaks closer than this fraction of the run are merged.
_SAME_TIME = 1e-12
_IN_TIME = ("t", "q", "v", "a", "basis")


@dataclass(frozen=True)
class FeedForward(Brief):
    """Torque profiles of a mode.

    Attributes
    ----------
    mode : ActuationMode
        Mode whose motors give the torques.
    signals : tuple of InputSignals
        Signal of each motor, zero for passive ones [N m].
    knots : (j,) array
        Times between which the torques are smooth [s].
    times : (k,) array
        Interpolation times of the splines, knots included [s].
    """

    mode: ActuationMode
    signals: tuple[InputSignals, ...]
    knots: Array
    times: Array

    def evaluate(self, t: Array) -> Array:
        """Return the torques (k, motors) at times t [N m]."""
        columns = []
        for signal in self.signals:
            piece = np.clip(np.searchsorted(signal.breaks, t, side="right") - 1, 0, len(signal.coefficients) - 1)
            x = t - signal.breaks[piece]
            columns.append(sum(signal.coefficients[piece, power] * x**power for power in range(DEGREE + 1)))
        return np.column_stack(columns)

    def without(self, following: Sequence[bool]) -> "FeedForward":
        """Return the torques of the motors that do not follow the plan, as if those that do were passive."""
        zero = constant_signals([0.0], float(self.knots[-1]))[0]
        return replace(
            self, signals=tuple(zero if off else one for off, one in zip(following, self.signals, strict=True))
        )

    def shaped(self, delays: Array, weights: Array) -> "FeedForward":
        """Return the weighted sum of delayed copies of these torques; before the first instant its torque holds.

        Parameters
        ----------
        delays, weights : (i,) arrays
            Delays from zero [s], and weights. The torques keep their end time, at which delayed copies are cut off.
        """
        return FeedForward(
            self.mode,
            tuple(_shaped(signal, delays, weights) for signal in self.signals),
            _delayed(self.knots, delays),
            _delayed(self.times, delays),
        )


def _delayed(times: Array, delays: Array) -> Array:
    """Return times (k,) with each delay added, sorted, merged where equal to rounding, and cut off at the last time."""
    end = times[-1]
    every = np.unique(np.minimum(times[:, None] + delays, end))
    apart = np.diff(every, prepend=-np.inf) > _SAME_TIME * (end - times[0])
    return np.append(every[apart & (every < end - _SAME_TIME * (end - times[0]))], end)


def _shaped(signal: InputSignals, delays: Array, weights: Array) -> InputSignals:
    """Return the sum of delayed copies of a piecewise polynomial, exactly: with pieces between all delayed breaks."""
    breaks = _delayed(signal.breaks, delays)
    middle, coefficients = 0.5 * (breaks[1:] + breaks[:-1]), np.zeros((breaks.size - 1, DEGREE + 1))
    for delay, weight in zip(delays, weights, strict=True):
        piece = np.searchsorted(signal.breaks, middle - delay, side="right") - 1
        inside = piece >= 0
        piece = np.minimum(piece, len(signal.coefficients) - 1)[inside]
        moved = breaks[:-1][inside] - delay - signal.breaks[piece]
        coefficients[inside] += weight * about(signal.coefficients[piece], moved)
        coefficients[~inside, 0] += weight * signal.coefficients[0, 0]
    return InputSignals(breaks, coefficients)


def about(coefficients: Array, places: Array) -> Array:
    """Return the coefficients (k, 6) of polynomials about other origins (k,), by repeated Horner's scheme."""
    out = coefficients.T.copy()
    for order in range(DEGREE):
        for power in range(DEGREE - 1, order - 1, -1):
            out[power] += places * out[power + 1]
    return out.T


@dataclass(frozen=True)
class TorquePlan(Brief):
    """Efforts of a rigid motion on a grid fine enough for splines of the torques of any mode.

    Attributes
    ----------
    fine : Effort
        Effort on the grid of the splines. Every other instant of it belongs to a coarse grid, whose spline is checked
        against the instants between.
    knots : (j,) array
        Times between which the motion is smooth [s].
    follow : callable
        Function that returns the rigid motion at any times, for refinement.
    jumping : Effort or None
        Effort just before each knot where loads change in time; None if it is continuous.
    finer : list of Effort
        Efforts on refined grids, computed when a mode needs them and kept for the other modes.
    """

    fine: Effort
    knots: Array
    follow: Callable[[Array], RigidMotion]
    jumping: Effort | None = None
    finer: list[Effort] = field(default_factory=list, repr=False, compare=False)

    def feed_forward(self, mode: ActuationMode) -> FeedForward:
        """Compute the torques of a mode, of minimum norm, as smooth functions of time.

        Raises
        ------
        ActuationError, SingularActuationError
            See `allocate`.
        NumericalError
            Torques too steep for a spline: the path passes very close to a singularity of the mode.
        """
        time, worst = 0.0, 0
        for refined in range(_REFINEMENTS):
            effort = self._effort(refined)
            t, torques = effort.motion.t, allocate(effort, mode)
            before = None if self.jumping is None else allocate(self.jumping, mode)
            checked = FeedForward(mode, tuple(splines(t[::2], torques[::2], self.knots, before)), self.knots, t[::2])
            error = np.max(np.abs(checked.evaluate(t) - torques), axis=1)
            if np.max(error) <= _ERROR_FALL * _SPLINE_ERROR * max(np.max(np.abs(torques)), np.finfo(float).tiny):
                return FeedForward(mode, tuple(splines(t, torques, self.knots, before)), self.knots, t)
            worst = int(np.argmax(error))
            time = float(t[worst])
        raise NumericalError(
            f'the torques of mode "{mode.name}" rise too steeply to be interpolated, as near a Type II singularity,',
            Moment(time, worst),
            remedy=PAST_SINGULAR,
        )

    def _effort(self, refined: int) -> Effort:
        """Return the effort on the fine grid with every interval halved a number of times."""
        efforts = [self.fine, *self.finer]
        while len(efforts) <= refined:
            t = efforts[-1].motion.t
            between = required_effort(self.follow(0.5 * (t[1:] + t[:-1])))
            efforts.append(_interleaved(efforts[-1], between))
        # Another thread may compute the same for its mode; either result may be kept.
        self.finer[:] = max(self.finer, efforts[1:], key=len)
        return efforts[refined]


def plan_torques(follow: Callable[[Array], RigidMotion], knots: Array) -> TorquePlan:
    """Compute the efforts of a rigid motion on grids for `TorquePlan.feed_forward`.

    Parameters
    ----------
    follow : callable
        Function that returns the rigid motion at times (k,).
    knots : (j,) array
        Times between which the motion is smooth, start and end included [s].
    """
    intervals = [
        np.linspace(a, b, max(_FEWEST_POINTS, int(np.ceil((b - a) / _LONGEST_SPACING)) + 1)) for a, b in pairwise(knots)
    ]
    times = np.unique(np.concatenate(intervals))
    fine = required_effort(follow(_alternating(times, 0.5 * (times[1:] + times[:-1]))))
    return TorquePlan(fine, np.asarray(knots), follow, _before(fine.motion, knots))


def _before(motion: RigidMotion, knots: Array) -> Effort | None:
    """Return the effort just before each knot of a motion whose loads change in time; else None."""
    if not any(load.profiles for load in motion.mechanism.loads):
        return None
    at = np.searchsorted(motion.t, knots)
    return required_effort(replace(motion, **{name: getattr(motion, name)[at] for name in _IN_TIME}), before=True)


def _alternating(a: Array, b: Array) -> Array:
    """Return an array (k + 1, ...) interleaved with the rows of another (k, ...)."""
    out = np.empty((len(a) + len(b), *a.shape[1:]))
    out[::2], out[1::2] = a, b
    return out


def _interleaved(effort: Effort, between: Effort) -> Effort:
    """Return an effort interleaved with that at the instants between, in order of time."""
    parts = {name: _alternating(getattr(effort.motion, name), getattr(between.motion, name)) for name in _IN_TIME}
    return Effort(
        replace(effort.motion, **parts),
        _alternating(effort.required, between.required),
        _alternating(effort.matrix, between.matrix),
    )


def splines(t: Array, values: Array, knots: Array, before: Array | None = None) -> list[InputSignals]:
    """Return quintic splines of the columns between neighbouring knots, joined to one signal per column.

    Parameters
    ----------
    t : (k,) array
        Times, knots included [s].
    values : (k, columns) array
        Values at these times.
    knots : (j,) array
        Times at which the splines are joined [s].
    before : (j, columns) array, optional
        Values just before each knot, where they may jump; continuous by default.
    """
    edges = np.searchsorted(t, knots)
    # Each spline has both of its end points.
    sizes = np.diff(edges) + 1
    points = np.arange(sizes.sum()) - np.repeat(np.arange(sizes.size), sizes) + edges[0]
    through = values[points]
    if before is not None:
        through[np.cumsum(sizes) - 1] = before[1:]
    starts, coefficients = quintic_splines(t[points], through, sizes)
    x = np.append(starts, t[-1])
    return [InputSignals(x, np.ascontiguousarray(coefficients[:, :, j].T)) for j in range(values.shape[1])]
