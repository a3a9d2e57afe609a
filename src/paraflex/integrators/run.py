"""Interface of every run, by any stepper: problem, state and counts, which is all that `integrate` uses.

Steps end where torques, loads or prescribed motions jump.
"""

from dataclasses import dataclass
from math import factorial
from typing import Protocol

import numpy as np
from numpy.polynomial.polynomial import polyder, polyval

from paraflex.arrays import Array, Mask
from paraflex.dynamics import Inputs, State, System, inputs_of
from paraflex.dynamics.load_values import check_laws
from paraflex.errors import InputError
from paraflex.kernel.arrays import allocated
from paraflex.kernel.packed import Signals
from paraflex.kernel.run_state import Samples
from .limits import StepLimits, step_limits

# Size of the first step, as a fraction of the run; error control adjusts it at once.
FIRST_STEP = 1e-6
# Relative pivot below which constraint rows are dependent: for own methods rows that were dependent at the start,
# whatever errors add to them; for external solvers any rows, which is then so within a thousandth of a radian.
DEPENDENT_PART = 1e-7
# A jump counts above this fraction of the largest value or derivative of the signal, and above this rounding of values.
_SMOOTH, _ROUNDING = 1e-9, 1e-13


@dataclass(frozen=True)
class Problem:
    """Problem to be integrated.

    Attributes
    ----------
    system : System
        System to integrate.
    signals : Signals
        Motor torques, loads and prescribed motions as functions of time.
    initial : State
        Initial state.
    times : (k,) array
        Sample times [s].
    stops : (s,) array
        Times at which steps end [s]; the last is the end of the run.
    jumps : (j,) array
        Stops at which an input jumps [s]: no step may use the values after the jump.
    limits : StepLimits
        Longest steps that resolve the inputs.
    stored : (k,) array of bool
        Whether a sample is kept; others serve to find the largest loads.
    """

    system: System
    signals: Signals
    initial: State
    times: Array
    stops: Array
    jumps: Array
    limits: StepLimits
    stored: Mask

    @property
    def span(self) -> float:
        """Duration from the start to the end [s]."""
        return float(self.stops[-1] - self.initial.time)

    def signals_from(self, time: float) -> Signals:
        """Return the signals for steps from a time on, extrapolated smoothly beyond the next jump."""
        ahead = self.jumps[self.jumps > time]
        if not ahead.size:
            return self.signals
        breaks = self.signals.breaks
        return self.signals._replace(breaks=np.where(breaks >= ahead[0], np.inf, breaks))


@dataclass(frozen=True)
class Instant:
    """State of a run between two steps, in new arrays; work [J] from the start, without the work of weight."""

    t: float
    q: Array
    v: Array
    a: Array
    multipliers: Array
    work: float


@dataclass(frozen=True)
class Figures:
    """Counts, residuals and errors of a run: see `Solution`. Passages (2, p) are the intervals with dependent rows."""

    steps: int
    rejected: int
    newton_iterations: int
    factorisations: int
    evaluations: int
    constraint_position_max: float
    constraint_velocity_max: float
    energy_balance_max: float
    passages: Array
    multiplier_errors: Array | None = None
    coordinate_errors: Array | None = None


class Run(Protocol):
    """Run between calls."""

    @property
    def problem(self) -> Problem:
        """Problem to be integrated."""
        ...

    @property
    def samples(self) -> Samples:
        """Samples, filled up to the current time."""
        ...

    @property
    def dependent_rows(self) -> int:
        """Number of redundant constraint rows; if the start is a singular position, that beside the start."""
        ...

    @property
    def dependent_at_start(self) -> int:
        """Number of dependent constraint rows at the start."""
        ...

    def start(self) -> None:
        """Compute the initial accelerations and multipliers, and take the first sample."""
        ...

    def march(self, attempts: int) -> int:
        """Attempt a number of steps; return a code of `kernel.run_state`."""
        ...

    @property
    def time(self) -> float:
        """Current time [s]."""
        ...

    def now(self) -> Instant:
        """Return the current state."""
        ...

    @property
    def singular_ahead(self) -> float | None:
        """Time at which an index-3 method is about to reach a singular position [s], or None."""
        ...

    @property
    def attempts(self) -> int:
        """Number of attempted steps."""
        ...

    @property
    def reached(self) -> int:
        """Number of samples taken."""
        ...

    def figures(self) -> Figures:
        """Return counts and residuals so far."""
        ...


def make_problem(
    system: System,
    signals: Signals,
    initial: State,
    times: Array,
    knots: Array | None = None,
) -> Problem:
    """Return a problem with checked times: see `integrate` for the arguments.

    Raises
    ------
    InputError
        Times do not ascend from the start, or the law of a load is not finite there.
    """
    times = np.ascontiguousarray(times, dtype=float)
    if times.size == 0 or np.any(np.diff(times) <= 0.0) or times[0] < initial.time or times[-1] <= initial.time:
        raise InputError("times must ascend from the start", field="times", remedy="give at least one later time")
    check_laws(system, np.array([initial.time]), initial.q[None], initial.v[None])
    inner = np.array([] if knots is None else knots, dtype=float)
    inner = np.unique(inner[(inner > initial.time) & (inner < times[-1])])
    inputs = inputs_of(system.mechanism)
    jumps = jump_times(signals, inputs, inner)
    stored, limits = np.ones(times.size, dtype=bool), step_limits(signals, inputs)
    return Problem(system, signals, initial, times, np.append(inner, times[-1]), jumps, limits, stored)


def empty_samples(times: Array, system: System, stored: Mask | None = None) -> Samples:
    """Return samples to be filled."""
    stored = np.ones(times.size, dtype=bool) if stored is None else np.ascontiguousarray(stored)
    given = {"times": times, "stored": stored, "solved": np.zeros(times.size, dtype=bool)}
    samples = allocated(Samples, {"times": times.size, "n": system.n, "m": system.m}, **given)
    for array in (samples.q, samples.v, samples.a, samples.lam, samples.energy):
        array.fill(np.nan)
    return samples


def jump_times(signals: Signals, inputs: Inputs, knots: Array) -> Array:
    """Return the knots at which a torque or load jumps, or a prescribed motion in its value, rate or acceleration.

    Parameters
    ----------
    signals : Signals
        Signals to examine.
    inputs : Inputs
        Indices of motors, loads and prescribed motions among the signals.
    knots : (k,) array
        Times to examine [s].
    """
    jumps = np.zeros(knots.size, dtype=bool)
    for k in (*inputs.motors, *inputs.loads):
        jumps |= _jumps(signals, k, knots, 1)
    for k in inputs.prescribed:
        jumps |= _jumps(signals, k, knots, 3)
    return knots[jumps]


def _jumps(signals: Signals, k: int, times: Array, derivatives: int) -> Mask:
    """Return at which times (i,) a signal or one of so many derivatives, its value included, jumps."""
    first, last = int(signals.start[k]), int(signals.start[k + 1]) - 1
    breaks, coefficients = signals.breaks[first:last], signals.coefficients[first:last]
    piece = np.searchsorted(breaks, times, side="right") - 1
    jumps = (piece >= 1) & (breaks[piece] == times)
    at = piece[jumps]
    before, after, x = coefficients[at - 1], coefficients[at], breaks[at] - breaks[at - 1]
    largest = np.max(np.abs(coefficients), axis=0)
    # Rounding of the values is amplified in their derivatives, the more the shorter the pieces are.
    short = float(np.min(np.diff(signals.breaks[first : last + 1])))
    rounding = _ROUNDING * float(np.sum(largest * short ** np.arange(largest.size)))
    found = np.zeros(at.size, dtype=bool)
    for order in range(derivatives):
        left = polyval(x, polyder(before, order, axis=1).T, tensor=False)
        size = np.maximum(np.abs(left), factorial(order) * largest[order])
        step = np.abs(factorial(order) * after[:, order] - left)
        found |= step > np.maximum(_SMOOTH * size, rounding / short**order)
    jumps[jumps] = found
    return jumps
