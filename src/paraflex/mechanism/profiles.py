"""Profiles of prescribed motions, loads and torques in time: functions, constant speed, pieces and tables."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import cached_property
from itertools import pairwise
from typing import Protocol, runtime_checkable

import numpy as np
import scipy

from paraflex.arguments import CheckedFields, named_in_errors
from paraflex.arrays import Array
from paraflex.errors import InputError

Values = tuple[Array, Array, Array]

# Admissible jump of a profile and its rate at a knot, relative to its value: rounding of its expressions.
_SMOOTH = 1e-9
# A run may end beyond a table by this fraction of its duration: rounding of times.
_BEYOND_TABLE = 1e-9
_DEGREE = 5
# Largest number of kinks of a linear table at which integration steps end; error control handles the less sharp ones.
_MOST_STOPS = 200
# Points of Gauss' formula, halvings of an interval, and relative error of an integral.
_GAUSS, _HALVINGS, _INTEGRATED = 10, 30, 1e-15


@named_in_errors("a profile", "a profile in time: ConstantSpeed, PiecewiseProfile, TabulatedProfile or SampledAngle")
@runtime_checkable
class TimeProfile(Protocol):
    """Profile of an angle, a travel, a force or a torque in time."""

    def evaluate(self, t: Array) -> tuple[Array, Array, Array]:
        """Return the value [rad, m, N or N m] and its first and second derivatives at times t [s]."""
        ...

    @property
    def knots(self) -> tuple[float, ...]:
        """Times at which a derivative jumps [s]; steps end there, or at the attribute `stops` if it exists."""
        ...


@dataclass(frozen=True)
class SampledAngle(CheckedFields):
    """Profile given by three functions of time: the value and its first two derivatives.

    Attributes
    ----------
    angle, rate, acceleration : callable
        Functions of times t [s]: angle or another quantity, and its first and second derivatives.
    knots : tuple of float
        Times at which a derivative jumps [s]; none by default.
    """

    angle: Callable[[Array], Array]
    rate: Callable[[Array], Array]
    acceleration: Callable[[Array], Array]
    knots: tuple[float, ...] = ()

    def evaluate(self, t: Array) -> tuple[Array, Array, Array]:
        """Return the angle, its rate and its acceleration at times t [s]."""
        return self.angle(t), self.rate(t), self.acceleration(t)


@dataclass(frozen=True)
class ConstantSpeed(CheckedFields):
    """Profile of constant speed [rad/s or m/s] with a value at t = 0, `angle` [rad or m].

    With `from_assembly` the start value of a prescribed motion is not given by the user but taken from the assembly or
    initial state of a run, which replaces `angle`.
    """

    _table = "profile"

    angle: float
    speed: float
    knots: tuple[float, ...] = ()
    from_assembly: bool = field(default=False, compare=False)

    def evaluate(self, t: Array) -> Values:
        """Return the value, its rate and its acceleration at times t [s]."""
        return self.angle + self.speed * t, np.full_like(t, self.speed), np.zeros_like(t)

    def begun(self, value: float, time: float) -> "ConstantSpeed":
        """Return the profile with a value at a time [s], if its start is not given."""
        return replace(self, angle=value - time * self.speed) if self.from_assembly else self


@dataclass(frozen=True)
class SpeedProfile(CheckedFields):
    """Profile whose speed is given over time: its integral, from a value at t = 0, `angle` [rad or m].

    Between the knots of the speed it is integrated by Gauss' formula with ten points, on intervals that are halved
    until their halves agree to rounding.

    Attributes
    ----------
    angle : float
        Value at t = 0 [rad or m].
    speed : TimeProfile
        Speed over time [rad/s or m/s], continuous for a prescribed motion.
    from_assembly : bool
        Whether the start value is taken from the assembly or initial state of a run: see `ConstantSpeed`.
    """

    _table = "profile"

    angle: float
    speed: TimeProfile
    from_assembly: bool = field(default=False, compare=False)

    @property
    def knots(self) -> tuple[float, ...]:
        """Times at which the acceleration jumps [s]."""
        return self.speed.knots

    def evaluate(self, t: Array) -> Values:
        """Return the value, its rate and its acceleration at times t [s]."""
        rate, acceleration, _ = self.speed.evaluate(t)
        return self.angle + self._travel(np.asarray(t, dtype=float)), rate, acceleration

    def begun(self, value: float, time: float) -> "SpeedProfile":
        """Return the profile with a value at a time [s], if its start is not given."""
        if not self.from_assembly:
            return self
        return replace(self, angle=value - float(self._travel(np.array([time]))[0]))

    def _travel(self, t: Array) -> Array:
        """Return the integral of the speed from 0 to times t [s]."""
        end = float(np.max(t, initial=0.0))
        if not end > 0.0:
            return np.zeros(t.shape)
        edges = np.array([0.0, *(knot for knot in self.knots if 0.0 < knot < end), end])
        for _ in range(_HALVINGS):
            middle = 0.5 * (edges[1:] + edges[:-1])
            whole = self._integrals(edges[:-1], edges[1:])
            halves = self._integrals(edges[:-1], middle) + self._integrals(middle, edges[1:])
            coarse = np.abs(whole - halves) > _INTEGRATED * np.max(np.abs(np.cumsum(halves)), initial=1e-300)
            if not np.any(coarse):
                break
            edges = np.sort(np.concatenate([edges, middle[coarse]]))
        before = np.concatenate([[0.0], np.cumsum(self._integrals(edges[:-1], edges[1:]))])
        piece = np.clip(np.searchsorted(edges, t, side="right") - 1, 0, edges.size - 2)
        return before[piece] + self._integrals(edges[piece], t)

    def _integrals(self, a: Array, b: Array) -> Array:
        """Return the integrals of the speed between times a and b, each (k,)."""
        places, weights = np.polynomial.legendre.leggauss(_GAUSS)
        times = 0.5 * (a + b)[:, None] + 0.5 * (b - a)[:, None] * places
        return 0.5 * (b - a) * (self.speed.evaluate(times.ravel())[0].reshape(times.shape) @ weights)


@dataclass(frozen=True)
class PiecewiseProfile(CheckedFields):
    """Profile of successive pieces, continuous in value and rate for a prescribed motion; loads and torques may jump.

    Attributes
    ----------
    pieces : tuple of TimeProfile
        Pieces in order, each a function of the same absolute time.
    ends : tuple of float
        End times of all pieces but the last, ascending [s].

    Raises
    ------
    InputError
        The end times do not ascend from 0.
    """

    _table = "profile"

    pieces: tuple[TimeProfile, ...]
    ends: tuple[float, ...]

    def __post_init__(self) -> None:
        super().__post_init__()
        for before, end in pairwise((0.0, *self.ends)):
            if not end > before:
                raise InputError(
                    "the times of pieces must ascend from 0", field="pieces", value=end,
                    remedy=f"let this one end after t = {before:g} s",
                )  # fmt: skip

    @property
    def knots(self) -> tuple[float, ...]:
        """End times of the pieces, and knots within the pieces [s]."""
        starts, ends = (-np.inf, *self.ends), (*self.ends, np.inf)
        inner = [k for a, piece, b in zip(starts, self.pieces, ends, strict=True) for k in piece.knots if a < k < b]
        return tuple(sorted([*self.ends, *inner]))

    def evaluate(self, t: Array) -> Values:
        """Return the value, its rate and its acceleration at times t [s]; at a knot those of the later piece."""
        t = np.asarray(t, dtype=float)
        which = np.searchsorted(self.ends, t, side="right")
        out = np.zeros((3, *t.shape))
        for k, piece in enumerate(self.pieces):
            here = which == k
            if np.any(here):
                out[:, here] = piece.evaluate(t[here])
        return out[0], out[1], out[2]


def check_ascending(column: Sequence[float], what: str = "times", unit: str = "s") -> None:
    """Check that the first column of a table ascends, and name its quantity in the error."""
    for row, (before, after) in enumerate(pairwise(column), start=2):
        if not after > before:
            problem = f"its {what} must ascend, but row {row} does not"
            raise InputError(problem, field="table", value=after, remedy=f"it follows {before:g} {unit}".strip())


class Interpolation(Enum):
    """Interpolation of a table: a quintic spline with four continuous derivatives, or straight lines."""

    SPLINE = "spline"
    LINEAR = "linear"


@dataclass(frozen=True)
class TabulatedProfile(CheckedFields):
    """Profile interpolated from a table, by a quintic spline or, for loads and torques only, by straight lines.

    Fewer than six points are interpolated by the polynomial through all of them.

    Attributes
    ----------
    times : tuple of float
        Times, ascending, at least two [s].
    values : tuple of float
        Values at the times [rad, m, N or N m].
    interpolation : Interpolation
        Interpolation, "spline" (default) or "linear".

    Raises
    ------
    InputError
        There are fewer than two rows, a number is not finite, or the times do not ascend.
    """

    _table = "profile"

    times: tuple[float, ...]
    values: tuple[float, ...]
    interpolation: Interpolation = Interpolation.SPLINE

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.times) < 2 or len(self.times) != len(self.values):
            raise InputError("a table needs two rows", field="table", value=len(self.times), remedy="give at least two")
        for row in zip(self.times, self.values, strict=True):
            if not np.all(np.isfinite(row)):
                raise InputError("not a finite number", field="table", value=row, remedy="give times and values")
        check_ascending(self.times)

    @cached_property
    def _spline(self) -> "scipy.interpolate.BSpline":
        degree = min(_DEGREE, len(self.times) - 1)
        return scipy.interpolate.make_interp_spline(self.times, self.values, k=degree)

    @cached_property
    def _slopes(self) -> Array:
        return np.diff(self.values) / np.diff(self.times)

    @property
    def linear(self) -> bool:
        """Whether the interpolation is linear."""
        return self.interpolation is Interpolation.LINEAR

    @property
    def knots(self) -> tuple[float, ...]:
        """Inner times of a linear table [s]; empty for a spline."""
        return self.times[1:-1] if self.linear else ()

    @cached_property
    def stops(self) -> tuple[float, ...]:
        """Knots at which integration steps end [s]: all of them, or the sharpest kinks of a long table."""
        sharpest = np.argsort(-np.abs(np.diff(self._slopes)), kind="stable")[:_MOST_STOPS]
        return tuple(self.knots[k] for k in np.sort(sharpest)) if self.linear else ()

    @property
    def breaks(self) -> tuple[float, ...]:
        """Times between which the profile is a polynomial of degree five at most [s]."""
        return self.times

    def evaluate(self, t: Array) -> Values:
        """Return the value, its rate and its acceleration at times t [s]; at a kink the rate after it.

        Raises
        ------
        InputError
            The table does not cover a time.
        """
        first, last = self.times[0], self.times[-1]
        slack = _BEYOND_TABLE * (last - first)
        for time, beyond in ((np.min(t), np.min(t) < first - slack), (np.max(t), np.max(t) > last + slack)):
            if beyond:
                raise InputError(
                    f"it covers t = {first:g} to {last:g} s, the run goes to t = {time:g} s", field="table",
                    remedy="add rows, or shorten the run",
                )  # fmt: skip
        x = np.clip(t, first, last)
        if self.linear:
            after = np.clip(np.searchsorted(self.times, x, side="right") - 1, 0, self._slopes.size - 1)
            return np.interp(x, self.times, self.values), self._slopes[after], np.zeros_like(x)
        return self._spline(x), self._spline(x, 1), self._spline(x, 2)


def marks(profile: TimeProfile) -> tuple[float, ...]:
    """Return the times at which a profile may have a peak between samples: its knots and table rows [s]."""
    return (*profile.knots, *getattr(profile, "breaks", ()))


def stops(profile: TimeProfile) -> tuple[float, ...]:
    """Return the times at which integration steps end [s]: the `stops` of a profile, by default all its knots."""
    return getattr(profile, "stops", profile.knots)


def check_motion(profile: TimeProfile) -> None:
    """Check that a profile is suitable for a prescribed motion, in which only the acceleration may jump.

    Raises
    ------
    InputError
        The profile or its rate jumps between pieces, or it is a linear table.
    """
    if isinstance(profile, SpeedProfile):
        _check_pieces(profile.speed, ("speed",))
        return
    if isinstance(profile, TabulatedProfile) and profile.linear:
        raise InputError(
            "the rate of a motion between straight lines jumps", field="interpolation", value="linear",
            remedy='give "spline", or pieces that meet in value and rate',
        )  # fmt: skip
    for piece in profile.pieces if isinstance(profile, PiecewiseProfile) else ():
        check_motion(piece)
    _check_pieces(profile, ("profile", "rate"))


def _check_pieces(profile: TimeProfile, quantities: tuple[str, ...]) -> None:
    """Check that the pieces of a profile meet in its value, or in its value and rate, by their names in errors."""
    if not isinstance(profile, PiecewiseProfile):
        return
    for piece in profile.pieces:
        _check_pieces(piece, quantities)
    for end, (left, right) in zip(profile.ends, pairwise(profile.pieces), strict=True):
        at = np.array([end])
        for what, a, b in zip(quantities, left.evaluate(at), right.evaluate(at), strict=False):
            jump = float(b[0] - a[0])
            if abs(jump) > _SMOOTH * max(1.0, abs(float(a[0]))):
                raise InputError(
                    f"the {what} jumps by {jump:.6g} at t = {end:g} s", field="pieces",
                    value=f"{float(a[0]):.9g} before, {float(b[0]):.9g} after",
                    remedy=f"make the {' and '.join(quantities).replace('profile', 'value')} of the pieces meet; "
                    "t is the same time in all",
                )  # fmt: skip
