"""Input shapers: short impulse sequences whose convolution with a command leaves modes of known frequency at rest."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cached_property, reduce
from math import comb, inf, pi
from typing import Any

import numpy as np
import scipy

from paraflex.arguments import CheckedFields, checked_arguments, named_in_errors
from paraflex.arrays import Array, Numbers
from paraflex.errors import InputError
from paraflex.limits import SHAPER_IMPULSES, at_most
from paraflex.mechanism.quantities import finite, positive

# Impulses closer than this fraction of the shaper's duration are merged, as for two modes of equal frequency.
_SAME_TIME = 1e-12
# The EI conditions are solved by continuation from zero damping: step of the damping ratio, and residual that is
# accepted.
_DAMPING_STEP, _SOLVED = 0.02, 1e-10
# Damping ratio up to which EI shapers are published.
_EI_DAMPING = 0.3
# The residual is scanned in steps of this fraction of the frequency change that turns the phase of the last impulse by
# 2 pi, up to this multiple of the modelled frequency; it may exceed the tolerance by this rounding error.
_SCAN_STEP, _SCAN_END, _ROUNDING = 0.005, 5.0, 1e-9


class ShaperKind(Enum):
    """Conditions on the residual vibration of a shaper at the modelled frequency.

    ZV
        Zero vibration: two impulses.
    ZVD
        Zero vibration and zero first derivative by frequency: three impulses.
    ZVDD
        Zero vibration and zero first and second derivatives by frequency: four impulses.
    EI
        Extra-insensitive shaper: residual equal to the tolerance there and zero at a frequency on either side, three
        impulses.
    """

    ZV = "zv"
    ZVD = "zvd"
    ZVDD = "zvdd"
    EI = "ei"


_ORDERS = {ShaperKind.ZV: 1, ShaperKind.ZVD: 2, ShaperKind.ZVDD: 3}


@named_in_errors("a shaper", "a shaper, as paraflex.shaper makes it")
@dataclass(frozen=True)
class Shaper(CheckedFields):
    """Input shaper: impulses at `times` with `amplitudes` of sum one, so that a shaped command keeps its final value.

    For n frequencies it is the convolution of n shapers, one for each frequency.

    Attributes
    ----------
    kind : ShaperKind or str
        Kind of shaper: "zv", "zvd", "zvdd" or "ei".
    frequencies : float or sequence of float
        Undamped natural frequencies of the modes [Hz].
    damping : float or sequence of float
        Damping ratio of all modes, or of each.
    tolerance : float
        Residual of an EI shaper at its frequency, as a fraction of the vibration without shaper.

    Raises
    ------
    InputError
        A frequency that is not positive, a damping ratio outside [0, 1) or above 0.3 for EI, a number of damping ratios
        other than one or that of the frequencies, a tolerance for which there is no EI shaper or that is given for
        another kind, or too many impulses.

    References
    ----------
    Singer and Seering 1990, ASME J. Dyn. Syst. Meas. Control 112, 76-82 (ZV, ZVD, ZVDD); Singhose, Seering and Singer
    1994, ASME J. Mech. Des. 116, 654-659 (EI).
    """

    kind: ShaperKind
    frequencies: tuple[float, ...]
    damping: tuple[float, ...] = (0.0,)
    tolerance: float = 0.05

    def __post_init__(self) -> None:
        for name in ("frequencies", "damping"):
            if isinstance(values := getattr(self, name), np.ndarray):
                object.__setattr__(self, name, values.ravel().tolist())
        super().__post_init__()
        self._check_modes()
        if self.kind is not ShaperKind.EI and self.tolerance != type(self).tolerance:
            raise InputError("only an EI shaper has a tolerance", field="tolerance", value=self.tolerance,
                             remedy='leave it out, or choose "ei"')  # fmt: skip
        _check_fraction(self.tolerance)
        _ = self._impulses
        at_most((_ORDERS.get(self.kind, 2) + 1) ** len(self.frequencies), SHAPER_IMPULSES, "frequencies",
                "too many: the shaper would have this many impulses")  # fmt: skip

    def _check_modes(self) -> None:
        if not self.frequencies:
            raise InputError("no frequency", field="frequencies", remedy="give those of the modes in Hz")
        for frequency in self.frequencies:
            positive(frequency, "frequencies", "Hz")
        most = _EI_DAMPING if self.kind is ShaperKind.EI else 1.0
        for ratio in self.damping:
            if not (0.0 <= ratio < 1.0 and ratio <= most):
                raise InputError(
                    "not a valid damping ratio", field="damping", value=ratio,
                    remedy=f"give a number from 0 to {most:g}; shapers are for modes that vibrate",
                )  # fmt: skip
        if len(self.damping) not in (1, len(self.frequencies)):
            raise InputError(
                f"there are {len(self.frequencies)} frequencies and {len(self.damping)} damping ratios",
                field="damping", remedy="give one for all, or one for each frequency",
            )  # fmt: skip

    @property
    def times(self) -> Array:
        """Times (k,) of the impulses, the first zero [s]."""
        return self._impulses[0]

    @property
    def amplitudes(self) -> Array:
        """Amplitudes (k,) of the impulses; their sum is one."""
        return self._impulses[1]

    @property
    def duration(self) -> float:
        """Time of the last impulse, by which the end of a motion is delayed [s]."""
        return self.times[-1]

    @cached_property
    def _impulses(self) -> tuple[Numbers, Numbers]:
        each = len(self.frequencies) // len(self.damping)
        modes = zip(self.frequencies, self.damping * each, strict=True)
        return reduce(_convolved, [_impulses(self.kind, *mode, self.tolerance) for mode in modes])

    @checked_arguments()
    def residual(self, frequency: float | Sequence[float] | Array, damping: float | None = None) -> Array:
        """Return the residual vibration of a mode, as a fraction of that after one impulse at the end.

        With omega = 2 pi f, omega_d = omega sqrt(1 - zeta^2) and t_n the time of the last impulse,
        V = exp(-zeta omega t_n) |sum A_i exp((zeta omega + j omega_d) t_i)|.

        Parameters
        ----------
        frequency : float or (k,) array
            Undamped natural frequency of the mode [Hz].
        damping : float, optional
            Damping ratio of the mode; that of the first modelled mode by default.

        Returns
        -------
        Array
            Residual, with the shape of `frequency`.
        """
        ratio = self.damping[0] if damping is None else damping
        finite(np.ravel(frequency).tolist(), "frequency")
        omega = 2.0 * pi * np.asarray(frequency, dtype=float)[..., None]
        return np.abs(_vibration(omega, ratio, self.times, self.amplitudes)[0])

    @checked_arguments()
    def insensitivity(self, tolerance: float = 0.05) -> float:
        """Return the width of the band about the first modelled frequency where the residual is within tolerance.

        The width is relative to that frequency; the mode has the modelled damping ratio. It is zero if the residual
        exceeds the tolerance at the modelled frequency, infinite if it does not exceed it up to five times that
        frequency.
        """
        _check_fraction(tolerance)
        step = _SCAN_STEP / (self.frequencies[0] * self.duration)
        below, above = (self._edge(tolerance, places) for places in (
            np.append(np.arange(1.0, step, -step), 0.0), np.arange(1.0, _SCAN_END + step, step)
        ))  # fmt: skip
        return above - below

    def _edge(self, tolerance: float, places: Array) -> float:
        """Return the first of ordered relative frequencies beyond which the residual exceeds a tolerance."""

        def excess(place: Any) -> Any:
            return self.residual(place * self.frequencies[0]) - tolerance

        values = excess(places)
        beyond = np.flatnonzero(values > _ROUNDING)
        if not beyond.size:
            return inf
        k = int(beyond[0])
        if k == 0 or values[k - 1] >= 0.0:
            return float(places[max(k - 1, 0)])
        return float(scipy.optimize.brentq(excess, places[k - 1], places[k], xtol=1e-14))

    @checked_arguments()
    def shaped(self, values: Callable[[Any], Any], start: float = 0.0) -> Callable[[Any], Any]:
        """Return a shaped function of time, sum A_i f(t - t_i), where f keeps its initial value before the start.

        Parameters
        ----------
        values : callable
            Function f that returns a number or an array at a time, or arrays (k, ...) at times (k,).
        start : float
            Time at which f starts [s].
        """
        finite(start, "start")
        impulses = list(zip(self.times, self.amplitudes, strict=True))

        def of_time(t: Any) -> Any:
            return sum(weight * np.asarray(values(np.maximum(t - delay, start))) for delay, weight in impulses)

        return of_time


@checked_arguments()
def shaper(
    kind: ShaperKind | str,
    frequencies: float | Sequence[float] | Array,
    damping: float | Sequence[float] | Array = 0.0,
    tolerance: float = 0.05,
) -> Shaper:
    """Return a shaper for one mode or several: for a path, see `ShapedPath`, or for torques, see `shape_torques`.

    With K = exp(-zeta pi / sqrt(1 - zeta^2)) and T_d = 1 / (f sqrt(1 - zeta^2)):

    - ZV: [1, K] / (1 + K) at 0, T_d/2;
    - ZVD: [1, 2K, K^2] / (1 + K)^2 at 0, T_d/2, T_d;
    - ZVDD: [1, 3K, 3K^2, K^3] / (1 + K)^3 at 0, T_d/2, T_d, 3T_d/2;
    - EI of tolerance V without damping: [(1 + V)/4, (1 - V)/2, (1 + V)/4] at 0, T/2, T; with damping it solves the
      conditions that the residual has the maximum V at f and is zero at a frequency on either side.

    Parameters
    ----------
    kind : str
        Kind of shaper: "zv", "zvd", "zvdd" or "ei".
    frequencies : float or sequence of float
        Undamped natural frequencies f of the modes [Hz]. `LinearModel.frequencies`, for a mechanism driven by torques,
        and `held_frequencies()`, for one whose motors follow a motion whatever the torque, are in rad/s: divide them by
        2 pi.
    damping : float or sequence of float
        Damping ratio zeta of all modes, or of each.
    tolerance : float
        Residual V of an EI shaper at f, as a fraction of the vibration without shaper.

    Raises
    ------
    InputError
        See `Shaper`.
    """
    return Shaper(kind, frequencies, damping, tolerance)  # type: ignore[reportArgumentType]  # converted there


def _check_fraction(tolerance: float) -> None:
    if not 0.0 < tolerance < 1.0:
        raise InputError("not a fraction of the vibration without shaper", field="tolerance", value=tolerance,
                         remedy="give a number between 0 and 1, such as 0.05")  # fmt: skip


def _vibration(omega: Any, damping: float, times: Array, amplitudes: Array) -> tuple[Any, Any]:
    """Return the complex amplitude after the last impulse, and its derivative by omega: see `Shaper.residual`."""
    pole = (damping + 1j * np.sqrt(1.0 - damping**2)) * times - damping * times[-1]
    terms = amplitudes * np.exp(pole * omega)
    return np.sum(terms, axis=-1), np.sum(pole * terms, axis=-1)


def _impulses(kind: ShaperKind, frequency: Any, damping: Any, tolerance: Any) -> tuple[Numbers, Numbers]:
    """Return the times and amplitudes of the impulses for one mode."""
    if kind is ShaperKind.EI:
        if np.iscomplexobj([damping, tolerance]):
            raise InputError(
                "no derivative by damping or tolerance of an EI shaper", field="shaper", remedy="leave it out"
            )
        times, amplitudes = _extra_insensitive(damping, tolerance)
        return times / (2.0 * pi * frequency), amplitudes
    order, root = _ORDERS[kind], np.sqrt(1.0 - damping**2)
    decay = np.exp(-damping * pi / root)
    powers = np.arange(order + 1)
    binomial = np.array([comb(order, k) for k in powers])
    return powers * (0.5 / (frequency * root)), binomial * decay**powers / (1.0 + decay) ** order


def _extra_insensitive(damping: float, tolerance: float) -> tuple[Array, Array]:
    """Return the times and amplitudes of the EI shaper for a mode of one radian per second.

    The unknowns are the amplitudes A_1 and A_3, the times t_2 and t_3, and the two frequencies of zero residual.
    """
    # Without damping the residual is |(1 - V) + (1 + V) cos(pi omega)| / 2, with omega = 1 at the mode.
    off = np.arccos((1.0 - tolerance) / (1.0 + tolerance)) / pi
    outer = 0.25 * (1.0 + tolerance)
    found = np.array([outer, outer, pi, 2.0 * pi, 1.0 - off, 1.0 + off])
    for ratio in np.linspace(0.0, damping, int(np.ceil(damping / _DAMPING_STEP)) + 1)[1:]:
        solution = scipy.optimize.root(_ei_conditions, found, args=(ratio, tolerance), tol=1e-14)
        if np.max(np.abs(_ei_conditions(solution.x, ratio, tolerance))) > _SOLVED:
            raise InputError(
                f"there is no EI shaper of this tolerance with a damping ratio of {damping:g}", field="tolerance",
                value=tolerance, remedy='give a smaller one, or choose "zvd"',
            )  # fmt: skip
        found = solution.x
    return _ei_impulses(found)


def _ei_impulses(unknown: Array) -> tuple[Array, Array]:
    first, last, second_time, last_time = unknown[:4]
    return np.array([0.0, second_time, last_time]), np.array([first, 1.0 - first - last, last])


def _ei_conditions(unknown: Array, damping: float, tolerance: float) -> Array:
    """Return the residuals of the EI conditions.

    They are: zero vibration at two frequencies; at the mode, the tolerance and zero slope, as the residual is largest
    there.
    """
    impulses = _ei_impulses(unknown)
    low, high = (_vibration(omega, damping, *impulses)[0] for omega in unknown[4:])
    here, slope = _vibration(1.0, damping, *impulses)
    return np.array(
        [low.real, low.imag, high.real, high.imag, np.abs(here) - tolerance, np.real(np.conj(here) * slope)]
    )


def _convolved(one: tuple[Numbers, Numbers], other: tuple[Numbers, Numbers]) -> tuple[Numbers, Numbers]:
    """Return the convolution of two impulse sequences, in order of time."""
    times, amplitudes = (one[0][:, None] + other[0]).ravel(), (one[1][:, None] * other[1]).ravel()
    order = np.argsort(np.real(times), kind="stable")
    times, amplitudes = times[order], amplitudes[order]
    first = np.flatnonzero(np.diff(np.real(times), prepend=-inf) > _SAME_TIME * np.real(times[-1]))
    return times[first], np.add.reduceat(amplitudes, first)
