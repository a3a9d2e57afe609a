"""Torques as smooth functions of time: splines between the path's knots, fine enough to be exact in effect."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from math import factorial

import numpy as np
import scipy
from numpy.typing import NDArray

from paraflex.actuation.allocation import Effort, allocate, required_effort
from paraflex.dynamics import InputSignals
from paraflex.errors import NumericalError
from paraflex.kinematics import RigidMotion
from paraflex.mechanism import ActuationMode

_DEGREE = 5
# The spline's largest error, as a fraction of the peak torque of the run.
_ACCURACY = 1e-8
# Points of a smooth stretch to begin with, at least, and seconds between them at most.
_FEWEST, _SPACING = 12, 2e-3
_REFINEMENTS = 6


@dataclass(frozen=True)
class FeedForward:
    """The torques of a mode in time.

    Attributes
    ----------
    mode : ActuationMode
    signals : tuple of InputSignals
        One a motor, zero for passive ones [N m].
    knots : (j,) array
        Times between which the torques are smooth [s].
    """

    mode: ActuationMode
    signals: tuple[InputSignals, ...]
    knots: NDArray[np.float64]

    def evaluate(self, t: NDArray[np.float64]) -> NDArray[np.float64]:
        """Torques (k, motors) at times t [N m]."""
        columns = []
        for signal in self.signals:
            piece = np.clip(np.searchsorted(signal.breaks, t, side="right") - 1, 0, len(signal.coefficients) - 1)
            x = t - signal.breaks[piece]
            columns.append(sum(signal.coefficients[piece, power] * x**power for power in range(_DEGREE + 1)))
        return np.column_stack(columns)


@dataclass(frozen=True)
class TorquePlan:
    """Efforts of a rigid motion on a grid fine enough for splines of the torques of any mode.

    Attributes
    ----------
    coarse, fine : Effort
        The fine grid has the coarse one's points and the middles between them: it is what the spline of the coarse
        one is checked against, and then the spline's own grid.
    knots : (j,) array
        Times between which the motion is smooth [s].
    follow : callable
        Gives the rigid motion at any times, to refine.
    """

    coarse: Effort
    fine: Effort
    knots: NDArray[np.float64]
    follow: Callable[[NDArray[np.float64]], RigidMotion]

    def feed_forward(self, mode: ActuationMode) -> FeedForward:
        """Torques of a mode, minimum norm, as smooth functions of time.

        Raises
        ------
        ActuationError, SingularActuationError
            See `allocate`.
        NumericalError
            Torques too steep for a spline: the path passes very close to a singularity of the mode.
        """
        coarse, fine = self.coarse, self.fine
        for _ in range(_REFINEMENTS):
            low, high = allocate(coarse, mode), allocate(fine, mode)
            checked = _splines(coarse.motion.t, low, self.knots)
            plan = FeedForward(mode, tuple(checked), self.knots)
            error = np.max(np.abs(plan.evaluate(fine.motion.t) - high))
            if error <= _ACCURACY * max(np.max(np.abs(high)), np.finfo(float).tiny):
                return FeedForward(mode, tuple(_splines(fine.motion.t, high, self.knots)), self.knots)
            coarse, fine = fine, required_effort(self.follow(_with_middles(fine.motion.t)))
        raise NumericalError(f'the torques of mode "{mode.name}" are too steep to interpolate: near a singularity')


def plan_torques(follow: Callable[[NDArray[np.float64]], RigidMotion], knots: NDArray[np.float64]) -> TorquePlan:
    """Efforts of a rigid motion on grids for `TorquePlan.feed_forward`.

    Parameters
    ----------
    follow : callable
        Gives the rigid motion at times (k,).
    knots : (j,) array
        Times between which the motion is smooth, its start and end among them [s].
    """
    stretches = [np.linspace(a, b, max(_FEWEST, int(np.ceil((b - a) / _SPACING)) + 1)) for a, b in pairwise(knots)]
    times = np.unique(np.concatenate(stretches))
    return TorquePlan(
        required_effort(follow(times)), required_effort(follow(_with_middles(times))), np.asarray(knots), follow
    )


def _with_middles(t: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.sort(np.concatenate([t, 0.5 * (t[1:] + t[:-1])]))


def _splines(t: NDArray[np.float64], values: NDArray[np.float64], knots: NDArray[np.float64]) -> list[InputSignals]:
    """A quintic spline of each column between neighbouring knots, joined."""
    breaks, coefficients = [], []
    edges = np.searchsorted(t, knots)
    for a, b in pairwise(edges):
        spline = scipy.interpolate.make_interp_spline(t[a : b + 1], values[a : b + 1], k=_DEGREE)
        start = np.unique(spline.t)[:-1]
        breaks.append(start)
        # Taylor coefficients at the left end of every piece: (6, pieces, motors).
        coefficients.append(np.stack([spline(start, nu) / factorial(nu) for nu in range(_DEGREE + 1)]))
    x = np.append(np.concatenate(breaks), t[-1])
    joined = np.concatenate(coefficients, axis=1)
    return [InputSignals(x, np.ascontiguousarray(joined[:, :, j].T)) for j in range(values.shape[1])]
