"""Stability margins of a sampled loop at each of its motors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array, Brief, Complex
from .closed_loops import ClosedLoop, closed_loop, warn_if_unstable

if TYPE_CHECKING:
    import pandas as pd

# Lowest frequency of the grid: fraction of the slowest pole's frequency, but at least this fraction of the Nyquist
# frequency.
_LOWEST, _OF_NYQUIST = 1e-2, 1e-5
_GRID = 1500
# At zero frequency a loop with free motions or integrators has no finite response; rounding gives one larger than this.
_INFINITE = 1e7
# Grid points about a resonance, in units of its half width.
_ABOUT = np.array([0.0, 0.15, 0.4, 0.8, 1.5, 3.0, 6.0, 12.0, 25.0])


@dataclass(frozen=True)
class MotorMargins(Brief):
    """Margins of a loop opened at one motor, the others closed.

    Attributes
    ----------
    gain_up, gain_down : float
        Upper and lower bound of the factor on the gain; inf and 0 without limit.
    phase : float
        Phase margin, the smaller of the phase that may be lost or gained [rad]; inf if the gain is nowhere one.
    delay : float
        Delay margin: additional delay of the torque [s], the phase that may be lost over the frequency; exact for whole
        samples.
    peak : float
        Peak sensitivity Ms, the largest |1 / (1 + L)|: 1 / Ms is the distance of L from -1.
    peak_frequency : float
        Angular frequency of the peak [rad/s].
    crossovers : (k,) array
        Gain crossover frequencies, at which the gain is one [rad/s].
    phase_crossovers : (k,) array
        Phase crossover frequencies, at which the phase is -180 degrees [rad/s].
    """

    gain_up: float
    gain_down: float
    phase: float
    delay: float
    peak: float
    peak_frequency: float
    crossovers: Array
    phase_crossovers: Array


@dataclass(frozen=True)
class Margins(Brief):
    """Margins of a sampled loop at each motor, and at all motors together.

    Attributes
    ----------
    loop : ClosedLoop
        Closed loop.
    motors : mapping of str to MotorMargins
        Margins by motor.
    peak, peak_frequency : float
        Largest singular value of the sensitivity at all motors over frequencies, and its angular frequency [rad/s].
    """

    loop: ClosedLoop
    motors: dict[str, MotorMargins]
    peak: float
    peak_frequency: float

    def to_frame(self) -> pd.DataFrame:
        """Return a table with one row per motor.

        Its columns are `gain_up`, `gain_down`, `phase` [deg], `delay` [ms], `samples`, `peak`, highest `crossover` [Hz]
        and `stable`.
        """
        import pandas as pd

        period = self.loop.plant.period
        rows = {
            name: {
                "gain_up": one.gain_up, "gain_down": one.gain_down, "phase": float(np.rad2deg(one.phase)),
                "delay": 1e3 * one.delay, "samples": one.delay / period, "peak": one.peak,
                "crossover": float(np.max(one.crossovers, initial=0.0)) / (2.0 * np.pi) if self.loop.stable else np.nan,
                "stable": self.loop.stable,
            }
            for name, one in self.motors.items()
        }  # fmt: skip
        return pd.DataFrame.from_dict(rows, orient="index")


@checked_arguments()
def margins(model: Any, controller: Any = None, **settings: Any) -> Margins:
    """Compute gain, phase and delay margins and peak sensitivities of a sampled loop.

    The loop is opened at one motor at a time: 1 + L_i = 1 / S_ii. Crossovers and peaks are bracketed on a grid that is
    refined about resonances, even very narrow ones, and then solved to rounding by Brent's methods.

    Parameters
    ----------
    model : ClosedLoop, or a model
        Closed loop, or model of the plant as for `closed_loop`.
    controller : LQGDesign, law, SampledController, or state space, optional
        Controller as for `closed_loop`, with its `settings`.

    Returns
    -------
    Margins
        Margins by motor.

    Raises
    ------
    InputError
        See `closed_loop`.

    Warns
    -----
    ResultWarning
        The loop is unstable: all margins are nan.
    """
    loop = model if isinstance(model, ClosedLoop) else closed_loop(model, controller, **settings)
    names = loop.plant.inputs
    if not loop.stable:
        warn_if_unstable(loop)
        nothing, nan = np.zeros(0), float("nan")
        none = MotorMargins(nan, nan, nan, nan, nan, nan, nothing, nothing)
        return Margins(loop, dict.fromkeys(names, none), nan, nan)
    grid = _grid(loop)
    S = loop.sensitivity(grid)
    found = {name: _of_motor(loop, k, grid, S[:, k, k]) for k, name in enumerate(names)}
    largest = np.linalg.norm(S, 2, axis=(1, 2))
    where, peak = _peak(lambda omega: float(np.linalg.norm(loop.sensitivity(omega)[0], 2)), grid, largest)
    return Margins(loop, found, peak, where)


def _of_motor(loop: ClosedLoop, motor: int, grid: Array, S: Complex) -> MotorMargins:
    """Return the margins at a motor from its sensitivity (k,) on a grid of frequencies."""

    def response(omega: float) -> complex:
        return complex(loop.loop(omega)[0, motor])

    L = 1.0 / S - 1.0
    gains = _roots(lambda omega: np.log(abs(response(omega))), grid, np.log(np.abs(L)))
    real = _roots(lambda omega: response(omega).imag / (1.0 + abs(response(omega))), grid, L.imag / (1.0 + np.abs(L)))
    # Responses are real at zero and at half the sampling frequency.
    turned = np.array([0.0, *real[real < (1.0 - 1e-9) * grid[-1]], grid[-1]])
    at = np.array([response(omega).real for omega in turned])
    negative = (at < 0.0) & (at > -_INFINITE)
    factors = -1.0 / at[negative]
    phases = np.array([np.angle(-response(omega)) for omega in gains])
    lost = np.mod(phases, 2.0 * np.pi)
    where, peak = _peak(lambda omega: abs(loop.sensitivity(omega)[0, motor, motor]), grid, np.abs(S))
    return MotorMargins(
        float(np.min(factors[factors > 1.0], initial=np.inf)),
        float(np.max(factors[factors < 1.0], initial=0.0)),
        float(np.min(np.abs(phases), initial=np.inf)),
        float(np.min(lost / gains, initial=np.inf)),
        peak, where, gains, turned[negative],
    )  # fmt: skip


def _grid(loop: ClosedLoop) -> Array:
    """Return a grid of frequencies [rad/s] up to half the sampling frequency, dense about lightly damped poles."""
    plant, law, period = loop.plant, loop.controller, loop.plant.period
    poles = np.concatenate([loop.poles, plant.poles, np.linalg.eigvals(law.A) if len(law.A) else []])
    s = np.log(poles[np.abs(poles) > 1e-6].astype(complex)) / period
    last = np.pi / period
    sizes = np.abs(s)[np.abs(s) > 1e-6 * last]
    first = max(_OF_NYQUIST * last, _LOWEST * float(np.min(sizes, initial=last)))
    own = np.abs(s.imag[s.imag != 0.0])
    width = np.maximum(np.abs(s.real[s.imag != 0.0]), 1e-6 * own)
    near = own[:, None] + width[:, None] * np.concatenate([-_ABOUT[:0:-1], _ABOUT])
    near = near[(near > first) & (near < last)]
    return np.unique(np.concatenate([np.geomspace(first, last, _GRID), near, [last]]))


def _roots(function: Callable[[float], float], grid: Array, values: Array) -> Array:
    """Return the sign changes of a function between points of a grid (k,), solved to rounding."""
    good = np.isfinite(values)
    ends = [k for k in range(len(grid) - 1) if good[k] and good[k + 1] and values[k] * values[k + 1] < 0.0]
    return np.array([scipy.optimize.brentq(function, grid[k], grid[k + 1], xtol=1e-13 * grid[k], rtol=1e-13)
                     for k in ends])  # fmt: skip


def _peak(function: Callable[[float], float], grid: Array, values: Array) -> tuple[float, float]:
    """Return the maximiser and the maximum of a function, from the highest points of a grid, refined."""
    best: tuple[float, float] = (float(grid[np.argmax(values)]), float(np.max(values)))
    inner = np.flatnonzero((values[1:-1] >= values[:-2]) & (values[1:-1] >= values[2:])) + 1
    # The three highest local maxima.
    for k in inner[np.argsort(-values[inner])][:3]:
        # The variable is the offset from the grid point, as the search resolves it to a relative 1e-8 only.
        middle, width = grid[k], grid[k + 1] - grid[k - 1]
        found = scipy.optimize.minimize_scalar(
            lambda part, middle=middle, width=width: -function(middle + width * part),
            bounds=tuple((grid[[k - 1, k + 1]] - middle) / width), method="bounded", options={"xatol": 1e-9},
        )  # fmt: skip
        if -found.fun > best[1]:
            best = float(middle + width * found.x), float(-found.fun)
    return best
