"""Laws in time, of prescribed motions, loads and torques: functions, constant speed, pieces, a table."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from itertools import pairwise
from typing import Protocol, runtime_checkable

import numpy as np
import scipy

from paraflex.arguments import CheckedFields, given_as
from paraflex.arrays import Array
from paraflex.errors import InputError

Values = tuple[Array, Array, Array]

# What a law and its rate may jump by at a knot, as a fraction of their size: rounding of its expressions.
_SMOOTH = 1e-9
# A run may end this far beyond a table, as a fraction of it: rounding of times.
_BEYOND_TABLE = 1e-9
_DEGREE = 5
# Kinks of a linear table at which integration steps end, at most: error control does without the less sharp ones.
_MOST_STOPS = 200


@given_as("a law", "a law in time: ConstantSpeed, PiecewiseLaw, TabulatedLaw or SampledAngle")
@runtime_checkable
class AngleLaw(Protocol):
    """An angle, a travel, a force or a torque as a function of time."""

    def evaluate(self, t: Array) -> tuple[Array, Array, Array]:
        """Value [rad, m, N or N m] and its first and second derivatives at times t [s]."""
        ...

    @property
    def knots(self) -> tuple[float, ...]:
        """Times [s] at which a derivative of the law jumps; steps end there, or at its `stops` if it has any."""
        ...


@dataclass(frozen=True)
class SampledAngle(CheckedFields):
    """A law from three functions of time: the angle, or whatever it is a law of, and its first two derivatives."""

    angle: Callable[[Array], Array]
    rate: Callable[[Array], Array]
    acceleration: Callable[[Array], Array]
    knots: tuple[float, ...] = ()

    def evaluate(self, t: Array) -> tuple[Array, Array, Array]:
        """Angle, rate and acceleration at times t."""
        return self.angle(t), self.rate(t), self.acceleration(t)


@dataclass(frozen=True)
class HeldAngle:
    """An angle [rad], or a travel [m], that does not change."""

    value: float
    knots: tuple[float, ...] = ()
    breaks: tuple[float, ...] = ()

    def evaluate(self, t: Array) -> Values:
        """Value, rate and acceleration at times t."""
        return np.full(t.shape, self.value), np.zeros(t.shape), np.zeros(t.shape)


@dataclass(frozen=True)
class ConstantSpeed(CheckedFields):
    """A start value [rad or m] and a constant speed [rad/s or m/s].

    With `from_assembly` the start value of a prescribed motion is not given: it is that of the assembly or start which
    a run begins from, and `angle` is its number there.
    """

    _table = "law"

    angle: float
    speed: float
    knots: tuple[float, ...] = ()
    from_assembly: bool = field(default=False, compare=False)

    def evaluate(self, t: Array) -> Values:
        """Value, rate and acceleration at times t."""
        return self.angle + self.speed * t, np.full_like(t, self.speed), np.zeros_like(t)


@dataclass(frozen=True)
class PiecewiseLaw(CheckedFields):
    """Laws in succession. Those of a prescribed motion must meet in value and rate; loads and torques may jump.

    Attributes
    ----------
    pieces : tuple of AngleLaw
        Each a function of the same time.
    ends : tuple of float
        Of all pieces but the last, ascending [s].

    Raises
    ------
    InputError
        Ends that do not ascend.
    """

    _table = "law"

    pieces: tuple[AngleLaw, ...]
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
        """Ends of the pieces, and knots of the pieces themselves [s]."""
        starts, ends = (-np.inf, *self.ends), (*self.ends, np.inf)
        inner = [k for a, piece, b in zip(starts, self.pieces, ends, strict=True) for k in piece.knots if a < k < b]
        return tuple(sorted([*self.ends, *inner]))

    def evaluate(self, t: Array) -> Values:
        """Value, rate and acceleration at times t; at a knot those of the later piece."""
        t = np.asarray(t, dtype=float)
        which = np.searchsorted(self.ends, t, side="right")
        out = np.zeros((3, *t.shape))
        for k, piece in enumerate(self.pieces):
            here = which == k
            if np.any(here):
                out[:, here] = piece.evaluate(t[here])
        return out[0], out[1], out[2]


class Interpolation(Enum):
    """How a table is interpolated: by a quintic spline with four continuous derivatives, or by straight lines."""

    SPLINE = "spline"
    LINEAR = "linear"


@dataclass(frozen=True)
class TabulatedLaw(CheckedFields):
    """A quintic spline through values at times, or straight lines between them, for loads and torques alone.

    Fewer than six points are passed by the polynomial through them.

    Attributes
    ----------
    times : tuple of float
        Ascending, at least two [s].
    values : tuple of float
        [rad, m, N or N m]
    interpolation : Interpolation
        "spline" or "linear".

    Raises
    ------
    InputError
        Too few rows, numbers that are not finite, or times that do not ascend.
    """

    _table = "law"

    times: tuple[float, ...]
    values: tuple[float, ...]
    interpolation: Interpolation = Interpolation.SPLINE

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.times) < 2 or len(self.times) != len(self.values):
            raise InputError(
                "a table needs two rows", field="table", value=len(self.times), remedy="give at least 2 of [t, value]"
            )
        for row in zip(self.times, self.values, strict=True):
            if not np.all(np.isfinite(row)):
                raise InputError("not a finite number", field="table", value=row, remedy="give times and values")
        for row, (before, after) in enumerate(pairwise(self.times), start=2):
            if not after > before:
                raise InputError(
                    f"its times must ascend, row {row} does not", field="table", value=after,
                    remedy=f"it follows t = {before:g} s",
                )  # fmt: skip

    @cached_property
    def _spline(self) -> scipy.interpolate.BSpline:
        degree = min(_DEGREE, len(self.times) - 1)
        return scipy.interpolate.make_interp_spline(self.times, self.values, k=degree)

    @cached_property
    def _slopes(self) -> Array:
        return np.diff(self.values) / np.diff(self.times)

    @property
    def linear(self) -> bool:
        """Whether straight lines join the rows."""
        return self.interpolation is Interpolation.LINEAR

    @property
    def knots(self) -> tuple[float, ...]:
        """Inner times of a linear table [s]; none of a spline."""
        return self.times[1:-1] if self.linear else ()

    @cached_property
    def stops(self) -> tuple[float, ...]:
        """Knots at which integration steps end [s]: all, but of a long table only the sharpest kinks."""
        sharpest = np.argsort(-np.abs(np.diff(self._slopes)), kind="stable")[:_MOST_STOPS]
        return tuple(self.knots[k] for k in np.sort(sharpest)) if self.linear else ()

    @property
    def breaks(self) -> tuple[float, ...]:
        """Times between which the law is one polynomial of degree five at most [s]."""
        return self.times

    def evaluate(self, t: Array) -> Values:
        """Value, rate and acceleration at times t; at a kink the rate after it.

        Raises
        ------
        InputError
            A time that the table does not cover.
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


def marks(law: AngleLaw) -> tuple[float, ...]:
    """Times at which a law may be largest between those that are looked at anyhow: its knots and rows [s]."""
    return (*law.knots, *getattr(law, "breaks", ()))


def stops(law: AngleLaw) -> tuple[float, ...]:
    """Times at which integration steps end [s]: all knots of a law but those that it can do without."""
    return getattr(law, "stops", law.knots)


def check_motion(law: AngleLaw) -> None:
    """Check that a law can be that of a motion, in which only the acceleration may jump.

    Raises
    ------
    InputError
        A jump between pieces of the law or its rate, or a linear table.
    """
    if isinstance(law, TabulatedLaw) and law.linear:
        raise InputError(
            "the rate of a motion between straight lines jumps", field="interpolation", value="linear",
            remedy='give "spline", or pieces that meet in value and rate',
        )  # fmt: skip
    if not isinstance(law, PiecewiseLaw):
        return
    for piece in law.pieces:
        check_motion(piece)
    for end, (left, right) in zip(law.ends, pairwise(law.pieces), strict=True):
        at = np.array([end])
        for what, a, b in zip(("law", "rate"), left.evaluate(at), right.evaluate(at), strict=False):
            jump = float(b[0] - a[0])
            if abs(jump) > _SMOOTH * max(1.0, abs(float(a[0]))):
                raise InputError(
                    f"the {what} jumps by {jump:.6g} at t = {end:g} s", field="pieces",
                    value=f"{float(a[0]):.9g} before, {float(b[0]):.9g} after",
                    remedy="make value and rate of the pieces meet; t is the same time in all",
                )  # fmt: skip
