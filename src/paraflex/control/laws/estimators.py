"""State estimation from readings: the steady-state Kalman filter, and rates of quantised readings."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import scipy

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array, Brief, Complex
from paraflex.errors import InputError
from paraflex.mechanism.quantities import positive
from .linear_law import LinearLaw


@checked_arguments()
def quantisation_noise(resolution: float) -> float:
    """Return the standard deviation of the quantisation error of a resolution, resolution / sqrt(12), in its unit.

    The error of a signal that moves over several multiples of the resolution is uniformly distributed (Widrow and
    Kollar, Quantization Noise, 2008). The error of a constant signal is constant.

    Raises
    ------
    InputError
        A resolution that is not positive.
    """
    positive(resolution, "resolution", "the unit of the reading")
    return resolution / float(np.sqrt(12.0))


def rounded(readings: Array, resolution: Array) -> Array:
    """Round readings (k,) to multiples of their resolutions (k,); readings of resolution zero are not rounded."""
    coarse = resolution > 0.0
    steps = np.where(coarse, resolution, 1.0)
    return np.where(coarse, steps * np.round(readings / steps), readings)


# A spectral radius of SciPy's solution above this may be one but for rounding: the solution is rejected.
_STABLE = 1.0 - 1e-8
# Largest number of doublings, 2^60 samples, and relative change at which they have converged.
_DOUBLINGS, _CONVERGED = 60, 1e-15


@dataclass(frozen=True)
class KalmanFilter(Brief):
    """Steady-state Kalman filter of x_k+1 = A x_k + B u_k + w_k, y_k = C x_k + e_k.

    At a sample the estimate is corrected, x + L (y - C x), then propagated with the torques that act, A x + B u.

    Attributes
    ----------
    A, B, C : (n, n), (n, inputs) and (outputs, n) arrays
        Matrices of the plant.
    gain : (n, outputs) array
        Filter gain L.
    covariance : (n, n) array
        Covariance of the estimation error before a reading is taken.
    """

    A: Array
    B: Array
    C: Array
    gain: Array
    covariance: Array

    @cached_property
    def poles(self) -> Complex:
        """Poles z (n,) of the estimation error: eigenvalues of A (1 - L C)."""
        return np.asarray(np.linalg.eigvals(self.A - self.A @ self.gain @ self.C), dtype=complex)

    def corrected(self, x: Array, y: Array) -> Array:
        """Return the estimate (n,) corrected by readings (outputs,)."""
        return x + self.gain @ (y - self.C @ x)


def kalman_filter(A: Array, B: Array, C: Array, process: Array, noise: Array) -> KalmanFilter:
    """Return the filter of least error covariance, from the stationary Riccati equation.

    P = A P A^T - A P C^T (C P C^T + R)^-1 C P A^T + W, L = P C^T (C P C^T + R)^-1 (Anderson and Moore, Optimal
    Filtering, section 4.4).

    Parameters
    ----------
    A, B, C : (n, n), (n, inputs) and (outputs, n) arrays
        Matrices of the plant.
    process : (n, n) array
        Covariance W of w_k.
    noise : (outputs, outputs) array
        Covariance R of e_k.

    Raises
    ------
    InputError
        No steady filter exists: a growing motion is not observable, or an undamped vibration is not excited.
    """
    try:
        P = riccati(A.T, C.T, process, noise)
    except (np.linalg.LinAlgError, ValueError):
        raise InputError(
            "no steady filter exists", field="measured",
            remedy="measure more, or let the disturbance reach all that vibrates undamped",
        ) from None  # fmt: skip
    return KalmanFilter(A, B, C, scipy.linalg.solve(C @ P @ C.T + noise, C @ P, assume_a="pos").T, P)


def riccati(A: Array, B: Array, Q: Array, R: Array) -> Array:
    """Return the stabilising solution P (n, n) of P = A^T P A - A^T P B (R + B^T P B)^-1 B^T P A + Q, R diagonal.

    The doubling algorithm (Chu, Fan, Lin and Wang, Int. J. Control 77 (2004) 767) is used in balanced states: its k-th
    iterate is the optimum over 2^k samples. Delayed torques make A singular, for which the reordering of eigenvalues in
    `scipy.linalg.solve_discrete_are` fails occasionally. Where doubling loses too much to rounding, for example with
    vibrations that decay over 10^5 samples, SciPy's solver is tried as well.

    Raises
    ------
    numpy.linalg.LinAlgError
        No stabilising solution exists.
    """
    size = np.asarray(scipy.linalg.matrix_balance(A, permute=False, separate=True)[1][0])
    scaled, columns = A * size / size[:, None], B / size[:, None] / np.sqrt(np.diag(R))
    eye, step = np.eye(len(A)), scaled
    G, H = columns @ columns.T, Q * np.outer(size, size)
    for _ in range(_DOUBLINGS):
        change = step.T @ H @ np.linalg.solve(eye + G @ H, step)
        half = np.linalg.solve(eye + G @ H, np.hstack([step, G]))
        G = _symmetric(G + step @ half[:, len(A) :] @ step.T)
        H = _symmetric(H + change)
        step = step @ half[:, : len(A)]
        if np.linalg.norm(change) <= _CONVERGED * np.linalg.norm(H):
            break
    if _radius(scaled, columns, H) >= 1.0:
        H = scipy.linalg.solve_discrete_are(scaled, columns, Q * np.outer(size, size), np.eye(B.shape[1]))
        if _radius(scaled, columns, H) >= _STABLE:
            raise np.linalg.LinAlgError("no stabilising solution")
    return H / np.outer(size, size)


def _radius(A: Array, B: Array, P: Array) -> float:
    """Return the spectral radius of A with the feedback of a solution P and R = 1; infinite if P is not finite."""
    if not np.all(np.isfinite(P)):
        return np.inf
    gain = np.linalg.solve(np.eye(B.shape[1]) + B.T @ P @ B, B.T @ P @ A)
    return float(np.max(np.abs(np.linalg.eigvals(A - B @ gain)), initial=0.0))


def _symmetric(matrix: Array) -> Array:
    return 0.5 * (matrix + matrix.T)


class Differentiator:
    """Steady-state Kalman filter for values and rates of quantised readings of a motion with random acceleration.

    The acceleration is constant between samples, with standard deviation `acceleration`; readings have the quantisation
    noise of their resolution. This is the alpha-beta filter (Kalata, IEEE Trans. Aerosp. Electron. Syst. 20 (1984)
    174): the larger acceleration T^2 / noise, the more it trusts the readings. For a motion of constant rate the
    estimated rate has no lag.

    Parameters
    ----------
    period : float
        Sampling period T [s].
    resolution : float
        Resolution of the readings.
    acceleration : float
        Typical acceleration of the motion, in the unit of the readings [1/s^2].

    Raises
    ------
    InputError
        A number that is not positive.
    """

    @checked_arguments()
    def __init__(self, period: float, resolution: float, acceleration: float) -> None:
        positive(period, "period", "s")
        positive(acceleration, "acceleration", "the unit of the readings per s^2")
        A, G = np.array([[1.0, period], [0.0, 1.0]]), np.array([[0.5 * period**2], [period]])
        # The Riccati equation is solved in units of T and of the noise, as badly scaled numbers would cost accuracy.
        noise, size = quantisation_noise(resolution), np.array([1.0, 1.0 / period])
        unit = np.outer(1.0 / size, 1.0 / size) / noise**2
        found = kalman_filter(
            A * size / size[:, None], G, np.array([[1.0, 0.0]]), acceleration**2 * (G @ G.T) * unit, np.eye(1)
        )
        self.period: float = period
        self.gain: Array = found.gain[:, 0] * size
        self._A = A
        self._x: Array | None = None

    @property
    def alpha_beta(self) -> tuple[float, float]:
        """Dimensionless gains alpha and beta."""
        return float(self.gain[0]), float(self.gain[1]) * self.period

    def start(self) -> None:
        """Reset the estimate: the next reading is taken to be at rest."""
        self._x = None

    def step(self, y: Array | float) -> tuple[Array, Array]:
        """Return the estimated values and rates (readings,) from the readings (readings,) of a sample."""
        y = np.atleast_1d(np.asarray(y, dtype=float))
        before = np.array([y, np.zeros_like(y)]) if self._x is None else self._A @ self._x
        found = before + self.gain[:, None] * (y - before[0])
        self._x = found
        return found[0].copy(), found[1].copy()


# Description, check and unit of the field `cutoff` of control laws.
CUTOFF: Any = "the cut-off frequency of the low-pass of rates in Hz", positive, "Hz"


class Rates(NamedTuple):
    """Readings (readings,) of a sample, and their rates."""

    readings: Array
    rates: Array


class BackwardDifference:
    """Rates by backward differences and a first-order low-pass filter: r + a ((y - y_before) / T - r).

    Differences of readings have steps of resolution / T. The low-pass filter, with a = 1 - exp(-2 pi cutoff T), spreads
    them, and lags by 1 / (2 pi cutoff) in addition to half a period of the difference.

    Parameters
    ----------
    period : float
        Sampling period T [s].
    cutoff : float, optional
        Cut-off frequency [Hz]; no filter by default.

    Raises
    ------
    InputError
        A number that is not positive.
    """

    @checked_arguments()
    def __init__(self, period: float, cutoff: float | None = None) -> None:
        positive(period, "period", "s")
        if cutoff is not None:
            positive(cutoff, "cutoff", "Hz")
        self.period: float = period
        self.cutoff: float | None = cutoff
        self.share: float = 1.0 if cutoff is None else 1.0 - float(np.exp(-2.0 * np.pi * cutoff * period))
        self._last: Rates | None = None

    def start(self) -> None:
        """Reset the states: the next reading is taken to be at rest."""
        self._last = None

    def step(self, y: Array | float) -> tuple[Array, Array]:
        """Return the readings (readings,) unchanged, and their rates."""
        self._last = self.after(self._last, np.atleast_1d(np.asarray(y, dtype=float)))
        return self._last.readings, self._last.rates.copy()

    def after(self, last: Rates | None, y: Array) -> Rates:
        """Return readings (readings,) and their rates from those of the last sample; None before the first one."""
        if last is None:
            return Rates(y, np.zeros_like(y))
        return Rates(y, last.rates + self.share * ((y - last.readings) / self.period - last.rates))

    def linear_law(self, readings: int) -> LinearLaw:
        """Return the linear law from readings to rates; its states are the previous readings, then their rates."""
        none, one = np.zeros((readings, readings)), np.eye(readings)
        by = self.share / self.period * one
        left = (1.0 - self.share) * one
        return LinearLaw(
            np.block([[none, none], [-by, left]]), np.vstack([one, by]), np.hstack([-by, left]), by,
            first=np.vstack([one, none]),
        )  # fmt: skip
