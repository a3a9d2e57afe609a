"""Paths of the end-effector in the plane, with their time laws."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import pi
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
import scipy

from paraflex.arguments import CheckedFields, checked_arguments, given_as
from paraflex.arrays import Array
from paraflex.errors import InputError
from paraflex.kinematics.laws import TrapezoidalLaw

# Of Gauss's rule for the length between two knots of a path.
_LENGTH_POINTS = 40


class PathMotion(NamedTuple):
    """Position [m], velocity [m/s] and acceleration [m/s^2] in the ground frame, each (k, 2)."""

    position: Array
    velocity: Array
    acceleration: Array


@given_as("a path", "a path: Polygon, Line, Circle or PointPath, or one that paraflex.load_path reads")
@runtime_checkable
class Path(Protocol):
    """A motion of a point in the plane: from rest to rest, then dwell."""

    @property
    def duration(self) -> float:
        """Duration of the motion before the dwell [s]."""
        ...

    @property
    def knots(self) -> tuple[float, ...]:
        """Times between which the motion is smooth [s]."""
        ...

    def evaluate(self, t: Array) -> PathMotion:
        """The motion at times t [s]; values, velocities and accelerations are exact derivatives of one another."""
        ...


given_as("a path", "a path such as Polygon, Line, Circle or PointPath; or with a model the name of one of its paths")(
    Path | str
)


@dataclass(frozen=True)
class Polygon(CheckedFields):
    """Straight segments from corner to corner, each from rest to rest under the modified trapezoidal law.

    Attributes
    ----------
    corners : sequence of (x, y)
        [m]
    max_acceleration : float
        [m/s^2]
    closed : bool
        Whether the last corner leads back to the first.
    """

    _own = ("corners",)
    corners: tuple[tuple[float, float], ...]
    max_acceleration: float
    closed: bool = True

    def __post_init__(self) -> None:
        super().__post_init__()
        corners = _points(self.corners, "corners", 2)
        object.__setattr__(self, "corners", tuple(map(tuple, corners.tolist())))
        _acceleration(self.max_acceleration)
        for length in self._lengths:
            if not length > 0.0:
                raise InputError(
                    "two neighbouring corners coincide", field="corners", value=self.corners, remedy="drop one of them"
                )

    @cached_property
    def _vertices(self) -> Array:
        corners = np.array(self.corners)
        return np.vstack([corners, corners[:1]]) if self.closed else corners

    @cached_property
    def _lengths(self) -> Array:
        return np.sqrt(np.sum(np.diff(self._vertices, axis=0) ** 2, axis=1))

    @cached_property
    def _laws(self) -> list[TrapezoidalLaw]:
        return [TrapezoidalLaw(length.item(), self.max_acceleration) for length in self._lengths]

    @cached_property
    def _starts(self) -> Array:
        return np.cumsum([0.0] + [law.duration for law in self._laws])

    @property
    def duration(self) -> float:
        """Duration of the motion [s]."""
        end = self._starts[-1]
        return end if np.iscomplexobj(end) else float(end)

    @property
    def knots(self) -> tuple[float, ...]:
        """Ends of the phases of every segment [s]."""
        times = [start + knot for start, law in zip(self._starts, self._laws, strict=False) for knot in law.knots[:-1]]
        return (*times, self.duration)

    def evaluate(self, t: Array) -> PathMotion:
        """The motion at times t."""
        t = np.atleast_1d(t) * 1.0
        kind = np.result_type(t, self._starts, self._vertices)
        position = np.tile(self._vertices[0].astype(kind), (t.size, 1))
        velocity, acceleration = np.zeros((t.size, 2), kind), np.zeros((t.size, 2), kind)
        directions = np.diff(self._vertices, axis=0) / self._lengths[:, None]
        for start, law, direction in zip(self._starts, self._laws, directions, strict=False):
            s, speed, rate = law.evaluate(t - start)
            position += s[:, None] * direction
            velocity += speed[:, None] * direction
            acceleration += rate[:, None] * direction
        return PathMotion(position, velocity, acceleration)


@checked_arguments()
def Line(start: Sequence[float], end: Sequence[float], max_acceleration: float) -> Polygon:
    """A straight line from rest to rest: a polygon of one segment.

    Parameters
    ----------
    start, end : (x, y)
        [m]
    max_acceleration : float
        [m/s^2]
    """
    return Polygon((_pair(start, "start"), _pair(end, "end")), max_acceleration, closed=False)


@dataclass(frozen=True)
class Circle(CheckedFields):
    """An arc under the modified trapezoidal law along its length.

    Attributes
    ----------
    centre : (x, y)
        [m]
    radius : float
        [m]
    max_acceleration : float
        Along the path [m/s^2]; the centripetal one comes on top.
    start_angle : float
        Of the first point, seen from the centre [rad].
    sweep : float
        Angle swept, positive counter-clockwise; a full turn by default [rad].
    """

    _own = ("centre",)
    centre: tuple[float, float]
    radius: float
    max_acceleration: float
    start_angle: float = 0.0
    sweep: float = 2.0 * pi

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "centre", _pair(self.centre, "centre"))
        if not (np.isfinite(self.radius) and self.radius > 0.0):
            raise InputError("must be positive", field="radius", value=self.radius, remedy="give it in metres")
        if not np.isfinite(self.start_angle):
            raise InputError(
                "not a finite number", field="start_angle", value=self.start_angle, remedy="give it in rad"
            )
        if not (np.isfinite(self.sweep) and self.sweep != 0.0):
            raise InputError("no angle to sweep", field="sweep", value=self.sweep, remedy="give it in rad, not zero")
        _acceleration(self.max_acceleration)

    @cached_property
    def _law(self) -> TrapezoidalLaw:
        return TrapezoidalLaw(self.radius * self.sweep * np.sign(np.real(self.sweep)), self.max_acceleration)

    @property
    def duration(self) -> float:
        """Duration of the motion [s]."""
        return self._law.duration

    @property
    def knots(self) -> tuple[float, ...]:
        """Ends of the phases of the law [s]."""
        return self._law.knots

    def evaluate(self, t: Array) -> PathMotion:
        """The motion at times t."""
        s, speed, rate = self._law.evaluate(np.atleast_1d(t) * 1.0)
        sense = np.sign(np.real(self.sweep)) / self.radius
        angle, turn, dturn = self.start_angle + sense * s, sense * speed, sense * rate
        radial = np.column_stack([np.cos(angle), np.sin(angle)])
        tangent = np.column_stack([-radial[:, 1], radial[:, 0]])
        return PathMotion(
            np.array(self.centre) + self.radius * radial,
            self.radius * turn[:, None] * tangent,
            self.radius * (dturn[:, None] * tangent - (turn**2)[:, None] * radial),
        )


@dataclass(frozen=True)
class PointPath(CheckedFields):
    """A smooth motion through points: a quintic spline in time, from rest to rest without acceleration.

    Attributes
    ----------
    points : sequence of (x, y) or (x, y, angle)
        At least two [m]; the angles of the end-effector there, where they are given [rad].
    motion_time : float
        From the first point to the last [s]; points are passed at times in proportion to the chords between them.
    """

    _own = ("points",)
    points: tuple[tuple[float, ...], ...]
    motion_time: float

    def __post_init__(self) -> None:
        super().__post_init__()
        points = _points(self.points, "points", 2, (2, 3))
        object.__setattr__(self, "points", tuple(map(tuple, points.tolist())))
        if not (np.isfinite(self.motion_time) and self.motion_time > 0.0):
            raise InputError(
                "must be positive", field="motion_time", value=self.motion_time, remedy="give it in seconds"
            )
        if np.any(np.linalg.norm(np.diff(points[:, :2], axis=0), axis=1) == 0.0):
            raise InputError("two neighbouring points coincide", field="points", remedy="drop one of them")

    @cached_property
    def _spline(self) -> scipy.interpolate.BSpline:
        points = np.array(self.points)
        chords = np.linalg.norm(np.diff(points[:, :2], axis=0), axis=1)
        times = self.motion_time * np.concatenate([[0.0], np.cumsum(chords)]) / chords.sum()
        still = np.zeros(points.shape[1])
        rest = [(1, still), (2, still)]
        return scipy.interpolate.make_interp_spline(times, points, k=5, bc_type=(rest, rest))

    @property
    def duration(self) -> float:
        """Duration of the motion [s]."""
        return self.motion_time

    @property
    def knots(self) -> tuple[float, ...]:
        """Start and end, between which the spline is smooth [s]."""
        return (0.0, self.motion_time)

    def evaluate(self, t: Array) -> PathMotion:
        """The motion at times t."""
        return PathMotion(*self._motion(t)[:, :, :2])

    def turning(self, t: Array) -> Array | None:
        """Angle [rad] of the end-effector, its rate and acceleration at times t (3, k); None without angles."""
        return self._motion(t)[:, :, 2] if len(self.points[0]) > 2 else None

    def _motion(self, t: Array) -> Array:
        t = np.atleast_1d(np.asarray(t, dtype=float))
        inside = ((t >= 0.0) & (t <= self.motion_time))[:, None]
        x = np.clip(t, 0.0, self.motion_time)
        return np.stack([self._spline(x), *(np.where(inside, self._spline(x, k), 0.0) for k in (1, 2))])


@checked_arguments()
def length_fraction(path: Path, end: float) -> float:
    """Fraction of a path's length passed by a time [s]: from 0 to 1."""
    if end >= path.duration:
        return 1.0
    return _length(path, end) / _length(path, path.duration)


def _length(path: Path, end: float) -> float:
    """Length passed by a time, by Gauss's rule between the knots [m]."""
    knots = np.unique([0.0, end, *(knot for knot in path.knots if 0.0 < knot < end)])
    z, w = np.polynomial.legendre.leggauss(_LENGTH_POINTS)
    half, middle = 0.5 * np.diff(knots)[:, None], 0.5 * (knots[1:] + knots[:-1])[:, None]
    speed = np.linalg.norm(path.evaluate((middle + half * z).ravel()).velocity, axis=1)
    return float(np.sum(half * w * speed.reshape(len(half), z.size)))


def _pair(value: Sequence[float], field: str) -> tuple[float, float]:
    x, y = _points([value], field, 1)[0]
    return float(x), float(y)


def _points(values: Sequence[Sequence[float]], field: str, at_least: int, columns: Sequence[int] = (2,)) -> Array:
    try:
        points = np.array(values, dtype=float)
    except (TypeError, ValueError):
        points = np.zeros((0, 0))
    if (
        points.ndim != 2
        or points.shape[1] not in columns
        or points.shape[0] < at_least
        or not np.all(np.isfinite(points))
    ):
        raise InputError(
            "not a list of points", field=field, value=values,
            remedy=f"give at least {at_least} of [x, y] in metres{', or all of [x, y, angle]' if 3 in columns else ''}",
        )  # fmt: skip
    return points


def _acceleration(value: float) -> None:
    if not (np.isfinite(value) and value > 0.0):
        raise InputError("must be positive", field="max_acceleration", value=value, remedy="give it in m/s^2")
