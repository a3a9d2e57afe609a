"""Estimates from readings: the steady Kalman filter, and rates of quantised angles."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array
from paraflex.control.linear_law import LinearLaw
from paraflex.errors import InputError
from paraflex.mechanism.quantities import positive


@checked_arguments()
def quantisation_noise(resolution: float) -> float:
    """Standard deviation of what rounding to multiples of a resolution adds, resolution / sqrt(12), in its unit.

    The error of a signal that moves over several multiples is spread evenly over one (Widrow and Kollar, Quantization
    Noise, 2008). Of a signal that stands still it is constant.

    Raises
    ------
    InputError
        A resolution that is not positive.
    """
    positive(resolution, "resolution", "the unit of the reading")
    return resolution / float(np.sqrt(12.0))


def rounded(readings: Array, resolution: Array) -> Array:
    """Readings (k,) as multiples of their resolutions (k,); of those whose resolution is zero nothing is taken."""
    coarse = resolution > 0.0
    steps = np.where(coarse, resolution, 1.0)
    return np.where(coarse, steps * np.round(readings / steps), readings)


# Poles that SciPy's solution moves by less than this from the unit circle may be there by rounding.
_STABLE = 1.0 - 1e-8
# Doublings reach 2^60 samples; the last one changes nothing.
_DOUBLINGS, _CONVERGED = 60, 1e-15


@dataclass(frozen=True)
class KalmanFilter:
    """Steady Kalman filter of x_k+1 = A x_k + B u_k + w_k, y_k = C x_k + e_k.

    At a sample the estimate is corrected, x + L (y - C x), then carried on with the torques that act, A x + B u.

    Attributes
    ----------
    A, B, C : (n, n), (n, inputs) and (outputs, n) arrays
    gain : (n, outputs) array
        L.
    covariance : (n, n) array
        Of the error before a reading is taken.
    """

    A: Array
    B: Array
    C: Array
    gain: Array
    covariance: Array

    @cached_property
    def poles(self) -> NDArray[np.complex128]:
        """How the error decays: eigenvalues z (n,) of A (1 - L C)."""
        return np.asarray(np.linalg.eigvals(self.A - self.A @ self.gain @ self.C), dtype=complex)

    def corrected(self, x: Array, y: Array) -> Array:
        """The estimate (n,) after readings (outputs,)."""
        return x + self.gain @ (y - self.C @ x)

    def carried_on(self, x: Array, u: Array) -> Array:
        """The estimate (n,) of the next sample, under torques (inputs,)."""
        return self.A @ x + self.B @ u


def kalman_filter(A: Array, B: Array, C: Array, process: Array, noise: Array) -> KalmanFilter:
    """The filter whose error is smallest, from the stationary Riccati equation.

    P = A P A^T - A P C^T (C P C^T + R)^-1 C P A^T + W, L = P C^T (C P C^T + R)^-1 (Anderson and Moore, Optimal
    Filtering, section 4.4).

    Parameters
    ----------
    A, B, C : (n, n), (n, inputs) and (outputs, n) arrays
    process : (n, n) array
        W, covariance of w_k.
    noise : (outputs, outputs) array
        R, covariance of e_k.

    Raises
    ------
    InputError
        There is none: something grows that readings do not show, or vibrates undamped unexcited.
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
    """Stabilising solution P (n, n) of P = A^T P A - A^T P B (R + B^T P B)^-1 B^T P A + Q, R diagonal.

    By doubling (Chu, Fan, Lin and Wang, Int. J. Control 77 (2004) 767), in states of one size: the k-th step is the
    optimum over 2^k samples. Torques under way make A singular, with which the reordering of eigenvalues within
    `scipy.linalg.solve_discrete_are` fails now and then. Where doubling loses too much to rounding, of vibrations that
    decay over 10^5 samples say, that is tried as well.

    Raises
    ------
    numpy.linalg.LinAlgError
        There is none.
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
    """Spectral radius of A with the feedback of a solution P, and R = 1; infinite if it is not finite."""
    if not np.all(np.isfinite(P)):
        return np.inf
    gain = np.linalg.solve(np.eye(B.shape[1]) + B.T @ P @ B, B.T @ P @ A)
    return float(np.max(np.abs(np.linalg.eigvals(A - B @ gain)), initial=0.0))


def _symmetric(matrix: Array) -> Array:
    return 0.5 * (matrix + matrix.T)


class Differentiator:
    """Values and rates of quantised readings: the steady Kalman filter of a motion whose acceleration is random.

    Between samples the acceleration is constant, with standard deviation `acceleration`; readings have the noise of
    their resolution. The filter is the alpha-beta one (Kalata, IEEE Trans. Aerosp. Electron. Syst. 20 (1984) 174): the
    larger acceleration T^2 / noise, the more it trusts the readings. Of steady motion the rate has no lag.

    Parameters
    ----------
    period : float
        [s]
    resolution : float
        Of the readings.
    acceleration : float
        What is usual of the motion, in the unit of the readings [1/s^2].

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
        # In units of T and of the resolution, as numbers far from one another blur the Riccati equation.
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
        """The gains without units."""
        return float(self.gain[0]), float(self.gain[1]) * self.period

    def start(self) -> None:
        """Forget what was read: the next reading begins at rest."""
        self._x = None

    def step(self, y: Array | float) -> tuple[Array, Array]:
        """Estimated values and rates (readings,) after the readings (readings,) of a sample."""
        y = np.atleast_1d(np.asarray(y, dtype=float))
        before = np.array([y, np.zeros_like(y)]) if self._x is None else self._A @ self._x
        found = before + self.gain[:, None] * (y - before[0])
        self._x = found
        return found[0].copy(), found[1].copy()


def checked_cutoff(cutoff: float | None) -> float | None:
    """The cut-off frequency of a low-pass of rates [Hz], or none.

    Raises
    ------
    InputError
        It is not positive.
    """
    if cutoff is not None:
        positive(cutoff, "cutoff", "Hz")
    return cutoff


class BackwardDifference:
    """Rates of readings by backward differences and a low-pass of first order: r + a ((y - y_before) / T - r).

    Resolution and period alone give steps of resolution / T; the low-pass, with a = 1 - exp(-2 pi cutoff T), spreads
    them and lags by 1 / (2 pi cutoff), beside half a period of the difference.

    Parameters
    ----------
    period : float
        [s]
    cutoff : float, optional
        [Hz]; without one, differences as they are.

    Raises
    ------
    InputError
        A number that is not positive.
    """

    @checked_arguments()
    def __init__(self, period: float, cutoff: float | None = None) -> None:
        positive(period, "period", "s")
        self.period: float = period
        self.cutoff: float | None = checked_cutoff(cutoff)
        self.share: float = 1.0 if cutoff is None else 1.0 - float(np.exp(-2.0 * np.pi * cutoff * period))
        self._before: Array | None = None
        self._rate: Array = np.zeros(0)

    def start(self) -> None:
        """Forget what was read: the next reading begins at rest."""
        self._before = None

    def step(self, y: Array | float) -> tuple[Array, Array]:
        """Readings (readings,) as they are, and their rates."""
        y = np.atleast_1d(np.asarray(y, dtype=float))
        if self._before is None:
            self._rate = np.zeros_like(y)
        else:
            self._rate = self._rate + self.share * ((y - self._before) / self.period - self._rate)
        self._before = y
        return y, self._rate.copy()

    def linear_law(self, readings: int) -> LinearLaw:
        """From readings to rates: states are the readings before, then their rates."""
        none, one = np.zeros((readings, readings)), np.eye(readings)
        by = self.share / self.period * one
        left = (1.0 - self.share) * one
        return LinearLaw(
            np.block([[none, none], [-by, left]]), np.vstack([one, by]), np.hstack([-by, left]), by,
            first=np.vstack([one, none]),
        )  # fmt: skip
