"""Paths of the end-effector in the plane, with their motion profiles."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from itertools import pairwise
from math import pi
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
import scipy

from paraflex.arguments import CheckedFields, checked_arguments, named_in_errors
from paraflex.arrays import Array, Numbers
from paraflex.errors import InputError
from paraflex.limits import PATH_POINTS, at_most
from paraflex.mechanism.quantities import check_numbers, field_metadata, finite, not_negative, optional, positive
from .profiles import CruiseProfile, TrapezoidalProfile

# Number of Gauss points for the length between two knots of a path, or two points of a curve.
_LENGTH_POINTS = 40
# Largest number of Newton iterations for the position at a length, and tolerance relative to the whole length.
_NEWTON, _ON_CURVE = 30, 1e-14
# Number of bisections that find a time to its last digits, and least separation of two knots relative to the motion.
_BISECTIONS, _SAME_KNOT = 60, 1e-6
_LEAST_POINTS = 4
# Largest gap between paths of a sequence, relative to coordinates above 1 m: rounding of coordinates in files.
_GAP = 1e-9
_ALONG = field_metadata("the largest acceleration along the path in m/s^2", positive)
_TIME = field_metadata("the time from the first point to the last in s", positive, "seconds")


class PathMotion(NamedTuple):
    """Position [m], velocity [m/s] and acceleration [m/s^2] in the ground frame, each (k, 2)."""

    position: Array
    velocity: Array
    acceleration: Array


@named_in_errors(
    "a path",
    "a path: Polygon, Line, Circle, PointPath, TabulatedPath, SequencePath or ShapedPath, or one that "
    "paraflex.load_path reads",
)
@runtime_checkable
class Path(Protocol):
    """Motion of a point in the plane, from rest to rest, followed by a dwell."""

    @property
    def duration(self) -> float:
        """Duration of the motion before the dwell [s]."""
        ...

    @property
    def knots(self) -> tuple[float, ...]:
        """Times between which the motion is smooth [s]."""
        ...

    def evaluate(self, t: Array) -> PathMotion:
        """Return the motion at times t [s]; velocity and acceleration are exact derivatives of the position."""
        ...


named_in_errors(
    "a path", "a path such as Polygon, Line, Circle or PointPath; or with a model the name of one of its paths"
)(Path | str)


@dataclass(frozen=True)
class Polygon(CheckedFields):
    """Straight segments from corner to corner, each from rest to rest under the modified trapezoidal profile.

    Attributes
    ----------
    corners : sequence of (x, y)
        Corners [m].
    max_acceleration : float
        Largest acceleration [m/s^2].
    closed : bool
        Whether the last corner leads back to the first.
    """

    _own = ("corners",)
    corners: tuple[tuple[float, float], ...] = field(metadata=field_metadata("a list of [x, y] in m"))
    max_acceleration: float = field(metadata=field_metadata("the largest acceleration in m/s^2", positive))
    closed: bool = optional(True, "whether the path returns to its start")

    def __post_init__(self) -> None:
        super().__post_init__()
        corners = _points(self.corners, "corners", 2)
        object.__setattr__(self, "corners", tuple(map(tuple, corners.tolist())))
        check_numbers(self)
        if not np.all(self._lengths > 0.0):
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
    def _profiles(self) -> list[TrapezoidalProfile]:
        return [TrapezoidalProfile(length.item(), self.max_acceleration) for length in self._lengths]

    @cached_property
    def _starts(self) -> Array:
        return np.cumsum([0.0] + [profile.duration for profile in self._profiles])

    @property
    def duration(self) -> float:
        """Duration of the motion [s]."""
        end = self._starts[-1]
        return end if np.iscomplexobj(end) else float(end)

    @property
    def knots(self) -> tuple[float, ...]:
        """Ends of the phases of every segment [s]."""
        times = [
            start + knot
            for start, profile in zip(self._starts, self._profiles, strict=False)
            for knot in profile.knots[:-1]
        ]
        return (*times, self.duration)

    def evaluate(self, t: Array) -> PathMotion:
        """Return the motion at times t [s]."""
        t = np.atleast_1d(t) * 1.0
        kind = np.result_type(t, self._starts, self._vertices)
        position = np.tile(self._vertices[0].astype(kind), (t.size, 1))
        velocity, acceleration = np.zeros((t.size, 2), kind), np.zeros((t.size, 2), kind)
        directions = np.diff(self._vertices, axis=0) / self._lengths[:, None]
        for start, profile, direction in zip(self._starts, self._profiles, directions, strict=False):
            s, speed, rate = profile.evaluate(t - start)
            position += s[:, None] * direction
            velocity += speed[:, None] * direction
            acceleration += rate[:, None] * direction
        return PathMotion(position, velocity, acceleration)


@checked_arguments()
def Line(start: Sequence[float], end: Sequence[float], max_acceleration: float) -> Polygon:
    """Return a straight line from rest to rest: a polygon of one segment.

    Parameters
    ----------
    start, end : (x, y)
        Ends of the line [m].
    max_acceleration : float
        Largest acceleration [m/s^2].
    """
    return Polygon((_pair(start, "start"), _pair(end, "end")), max_acceleration, closed=False)


@dataclass(frozen=True)
class KnownPath:
    """Path known at some times only, possibly with a complex step."""

    motion: PathMotion
    angles: Numbers | None = None
    duration: float = 0.0

    @property
    def knots(self) -> tuple[float, ...]:
        """Start and end, as a path known at some times has no knots between them."""
        return (0.0, self.duration)

    def evaluate(self, t: Array) -> PathMotion:
        """Return the motion at the known times; `t` is not used."""
        return self.motion

    def turning(self, t: Array) -> Numbers | None:
        """Return the angle of the end-effector and its derivatives if the path prescribes it, else None."""
        return self.angles


@dataclass(frozen=True)
class Circle(CheckedFields):
    """An arc under the modified trapezoidal profile along its length.

    Attributes
    ----------
    centre : (x, y)
        Centre [m].
    radius : float
        Radius [m].
    max_acceleration : float
        Largest acceleration along the path [m/s^2], without the centripetal one.
    start_angle : float
        Angle of the first point, seen from the centre [rad].
    sweep : float
        Angle swept, positive counter-clockwise; a full turn by default [rad].
    """

    _own = ("centre",)
    centre: tuple[float, float] = field(metadata=field_metadata("[x, y] in m"))
    radius: float = field(metadata=field_metadata("the radius in m", positive, "metres"))
    max_acceleration: float = field(metadata=_ALONG)
    start_angle: float = optional(0.0, "the angle of the first point in rad", finite)
    sweep: float = optional(2.0 * pi, "the angle swept in rad, positive counter-clockwise", finite)

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "centre", _pair(self.centre, "centre"))
        if not (np.isfinite(self.sweep) and self.sweep != 0.0):
            raise InputError("no angle to sweep", field="sweep", value=self.sweep, remedy="give it in rad, not zero")
        check_numbers(self)

    @cached_property
    def _profile(self) -> TrapezoidalProfile:
        return TrapezoidalProfile(self.radius * self.sweep * np.sign(np.real(self.sweep)), self.max_acceleration)

    @property
    def duration(self) -> float:
        """Duration of the motion [s]."""
        return self._profile.duration

    @property
    def knots(self) -> tuple[float, ...]:
        """Ends of the phases of the profile [s]."""
        return self._profile.knots

    def evaluate(self, t: Array) -> PathMotion:
        """Return the motion at times t [s]."""
        s, speed, rate = self._profile.evaluate(np.atleast_1d(t) * 1.0)
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
    """A smooth motion through points: a quintic spline in time, from rest to rest without acceleration at its ends.

    Attributes
    ----------
    points : sequence of (x, y) or (x, y, angle)
        Two points or more [m]; optionally with the angles of the end-effector there [rad].
    motion_time : float
        Time from the first point to the last [s]; points are passed at times in proportion to the chords between them.
    """

    _own = ("points",)
    points: tuple[tuple[float, ...], ...] = field(
        metadata=field_metadata("a list of [x, y] in m, or of [x, y, angle] in m and rad")
    )
    motion_time: float = field(metadata=_TIME)

    def __post_init__(self) -> None:
        super().__post_init__()
        points = _points(self.points, "points", 2, (2, 3))
        object.__setattr__(self, "points", tuple(map(tuple, points.tolist())))
        check_numbers(self)
        if np.any(np.linalg.norm(np.diff(points[:, :2], axis=0), axis=1) == 0.0):
            raise InputError("two neighbouring points coincide", field="points", remedy="drop one of them")

    @cached_property
    def _spline(self) -> "scipy.interpolate.BSpline":
        points = np.array(self.points)
        chords = np.linalg.norm(np.diff(points[:, :2], axis=0), axis=1)
        return _resting(self.motion_time * np.concatenate([[0.0], np.cumsum(chords)]) / chords.sum(), points)

    @property
    def duration(self) -> float:
        """Duration of the motion [s]."""
        return self.motion_time

    @property
    def knots(self) -> tuple[float, ...]:
        """Start and end, between which the spline is smooth [s]."""
        return (0.0, self.motion_time)

    def evaluate(self, t: Array) -> PathMotion:
        """Return the motion at times t [s]."""
        return PathMotion(*_rest_to_rest(self._spline, t, self.motion_time)[:, :, :2])

    def turning(self, t: Array) -> Array | None:
        """Return the end-effector's angle [rad], its rate and acceleration at times t (3, k); None without angles."""
        return _rest_to_rest(self._spline, t, self.motion_time)[:, :, 2] if len(self.points[0]) > 2 else None


@dataclass(frozen=True)
class TabulatedPath(CheckedFields):
    """A smooth curve through many points, for example those of a file, from rest to rest.

    With times, the path is a quintic spline in time that passes the points at these times, at rest at both ends.
    Without times, it is the natural quintic spline over the lengths of the chords, followed under a motion profile
    along its length: the modified trapezoidal one for a given time or acceleration, or a `CruiseProfile`.
    Accelerations are along the path, without the centripetal one.

    Attributes
    ----------
    points : sequence of (x, y)
        Four points or more [m].
    times : sequence of float, optional
        Times at which the points are passed, ascending; the motion starts with the first [s].
    motion_time, max_acceleration, max_speed : float, optional
        Motion profile without times: its duration [s], or its largest acceleration [m/s^2] and optionally speed [m/s].

    Raises
    ------
    InputError
        There are fewer points, two neighbours coincide, times do not ascend, or no or several profiles are given.
    """

    _own = ("points",)
    points: tuple[tuple[float, float], ...]
    times: tuple[float, ...] | None = None
    motion_time: float | None = field(default=None, metadata=_TIME)
    max_acceleration: float | None = field(default=None, metadata=_ALONG)
    max_speed: float | None = optional(None, "the largest speed along the path in m/s", positive)

    def __post_init__(self) -> None:
        super().__post_init__()
        points = _points(self.points, "points", _LEAST_POINTS)
        at_most(len(points), PATH_POINTS, "points")
        object.__setattr__(self, "points", tuple(map(tuple, points.tolist())))
        same = np.flatnonzero(np.all(points[1:] == points[:-1], axis=1))
        if same.size:
            raise InputError(
                f"points {same[0] + 1} and {same[0] + 2} coincide", field="points", value=self.points[same[0]],
                remedy="drop one of them",
            )  # fmt: skip
        self._check_profile()
        if self.times is not None:
            self._check_times(np.array(self.times, dtype=float))

    def _check_profile(self) -> None:
        given = [name for name in ("times", "motion_time", "max_acceleration") if getattr(self, name) is not None]
        if len(given) != 1:
            raise InputError(
                "its motion profile is given in two ways" if given else "its motion profile is not given",
                field=given[-1] if given else "max_acceleration", value=", ".join(given) or None,
                remedy=f"drop all but {given[0]}" if given else "give max_acceleration, motion_time, or times",
            )  # fmt: skip
        check_numbers(self)
        if self.max_speed is not None and self.max_acceleration is None:
            raise InputError(
                "a largest speed needs a largest acceleration", field="max_speed", value=self.max_speed,
                remedy="give max_acceleration too, or leave it out",
            )  # fmt: skip

    def _check_times(self, times: Array) -> None:
        if times.size != len(self.points) or not np.all(np.isfinite(times)):
            raise InputError(
                f"there are {len(self.points)} points and {times.size} times", field="times",
                remedy="give a finite time in s for every point",
            )  # fmt: skip
        late = np.flatnonzero(np.diff(times) <= 0.0)
        if late.size:
            raise InputError(
                f"its times must ascend, but that of point {late[0] + 2} does not", field="times",
                value=float(times[late[0] + 1]), remedy=f"it follows t = {times[late[0]]:g} s",
            )  # fmt: skip

    @cached_property
    def _timed(self) -> "scipy.interpolate.BSpline":
        times = np.array(self.times)
        return _resting(times - times[0], np.array(self.points))

    @cached_property
    def _curve(self) -> "_Curve":
        if any(isinstance(value, complex) for point in self.points for value in point):
            raise InputError("no derivative by a point of a path", field="points", remedy="leave it out")
        return _Curve(np.array(self.points))

    @cached_property
    def _profile(self) -> TrapezoidalProfile | CruiseProfile:
        length = self._curve.length
        if self.motion_time is not None:
            return TrapezoidalProfile(length, pi * length / (self.motion_time / 1.5) ** 2)
        assert self.max_acceleration is not None
        if self.max_speed is None:
            return TrapezoidalProfile(length, self.max_acceleration)
        return CruiseProfile(length, self.max_acceleration, self.max_speed)

    @property
    def duration(self) -> float:
        """Duration of the motion [s]."""
        return self._profile.duration if self.times is None else self.times[-1] - self.times[0]

    @property
    def knots(self) -> tuple[float, ...]:
        """Times of the points, where higher derivatives may jump, and ends of the phases of the profile [s]."""
        if self.times is not None:
            return tuple(time - self.times[0] for time in self.times)
        phases, passed = np.array(self._profile.knots), self._passed
        apart = np.abs(passed[:, None] - phases) > _SAME_KNOT * np.abs(self.duration)
        return tuple(np.sort(np.concatenate([phases, passed[apart.all(axis=1)]])).tolist())

    @cached_property
    def _passed(self) -> Array:
        """Times at which the profile passes the inner points [s]."""
        profile, at = self._profile, self._curve.lengths[1:-1]
        real = type(profile)(*(float(np.real(getattr(profile, each.name))) for each in fields(profile)))
        low, high = np.zeros(at.size), np.full(at.size, real.duration)
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            short = real.evaluate(middle)[0] < at
            low, high = np.where(short, middle, low), np.where(short, high, middle)
        if profile == real:
            return low
        # One Newton step carries the complex step of a profile to the times.
        covered, speed, _ = profile.evaluate(low)
        return low - (covered - at) / speed

    def evaluate(self, t: Array) -> PathMotion:
        """Return the motion at times t [s]."""
        if self.times is None:
            return self._curve.motion(*self._profile.evaluate(np.atleast_1d(np.asarray(t, dtype=float))))
        return PathMotion(*_rest_to_rest(self._timed, t, self.duration))


def _resting(times: Array, points: Array) -> "scipy.interpolate.BSpline":
    """Return the quintic spline through points (k, columns) at times (k,), at rest and unaccelerated at both ends."""
    rest = [(order, np.zeros(points.shape[1])) for order in (1, 2)]
    return scipy.interpolate.make_interp_spline(times, points, k=5, bc_type=(rest, rest))


def _rest_to_rest(spline: "scipy.interpolate.BSpline", t: Array, end: float) -> Array:
    """Return values and two derivatives (3, k, columns) of a spline on [0, end] at times t; at rest outside."""
    t = np.atleast_1d(np.asarray(t, dtype=float))
    inside, x = ((t >= 0.0) & (t <= end))[:, None], np.clip(t, 0.0, end)
    return np.stack([spline(x), *(np.where(inside, spline(x, order), 0.0) for order in (1, 2))])


class _Curve:
    """A spline p(u) through points, u the lengths of their chords, and its arc length s(u)."""

    def __init__(self, points: Array) -> None:
        chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
        self._u = np.concatenate([[0.0], np.cumsum(chords)])
        # These end conditions give the curve of least third derivative through the points, which oscillates little.
        free = [(3, np.zeros(2)), (4, np.zeros(2))]
        self._spline = scipy.interpolate.make_interp_spline(self._u, points, k=5, bc_type=(free, free))
        self._z, self._w = np.polynomial.legendre.leggauss(_LENGTH_POINTS)
        self.lengths = np.concatenate([[0.0], np.cumsum(self._arc(self._u[:-1], self._u[1:]))])
        self.length = float(self.lengths[-1])

    def _arc(self, a: Array, b: Array) -> Array:
        """Return the lengths between parameters a and b, each pair in one piece."""
        half = 0.5 * (b - a)
        speed = np.linalg.norm(self._spline(0.5 * (a + b)[:, None] + half[:, None] * self._z, 1), axis=-1)
        return half * (speed @ self._w)

    def _parameter(self, s: Array) -> Array:
        """Return the parameters u (k,) at lengths s, by Newton's iteration in the piece of each."""
        piece = np.clip(np.searchsorted(self.lengths, s, side="right") - 1, 0, self._u.size - 2)
        left, right = self._u[piece], self._u[piece + 1]
        u = left + (right - left) * (s - self.lengths[piece]) / (self.lengths[piece + 1] - self.lengths[piece])
        for _ in range(_NEWTON):
            off = self.lengths[piece] + self._arc(left, u) - s
            if np.max(np.abs(off)) <= _ON_CURVE * self.length:
                break
            u = np.clip(u - off / np.linalg.norm(self._spline(u, 1), axis=1), left, right)
        return u

    def motion(self, s: Array, rate: Array, second: Array) -> PathMotion:
        """Return the motion of a point at lengths (k,), given with their time derivatives."""
        u = self._parameter(s)
        p, dp, ddp = (self._spline(u, k) for k in range(3))
        slope = np.linalg.norm(dp, axis=1)
        du = rate / slope
        ddu = (second - np.sum(dp * ddp, axis=1) / slope * du**2) / slope
        return PathMotion(p, dp * du[:, None], ddp * (du**2)[:, None] + dp * ddu[:, None])


@dataclass(frozen=True)
class SequencePath(CheckedFields):
    """Paths in sequence in one motion, each from the end of the one before.

    Attributes
    ----------
    paths : sequence of Path
        Two paths or more.
    dwell : float
        Rest between consecutive paths [s]; none by default.

    Raises
    ------
    InputError
        There are fewer paths, a path does not begin at the end of the one before, or only some have angles of the
        end-effector.
    """

    paths: tuple[Path, ...] = field(metadata=field_metadata("names of other [path.NAME] tables, in order"))
    dwell: float = optional(0.0, "the dwell between two paths in s", not_negative, "seconds")

    def __post_init__(self) -> None:
        super().__post_init__()
        check_numbers(self)
        if len(self.paths) < 2:
            raise InputError("a sequence needs two paths", field="paths", value=len(self.paths), remedy="name them")
        for number, (before, after) in enumerate(pairwise(self.paths), start=2):
            end, start = (path.evaluate(np.array([t])) for path, t in ((before, before.duration), (after, 0.0)))
            gap = float(np.linalg.norm(start.position - end.position))
            if not gap <= _GAP * max(1.0, float(np.max(np.abs(end.position)))):
                x, y = end.position[0].tolist()
                raise InputError(
                    f"path {number} starts {gap:.6g} m from where the one before ends", field="paths",
                    value=f"({start.position[0, 0]:g}, {start.position[0, 1]:g})",
                    remedy=f"let it start at ({x:.9g}, {y:.9g}), or put a line between them",
                )  # fmt: skip
        turning = [turning_of(path, np.zeros(1)) is not None for path in self.paths]
        if any(turning) and not all(turning):
            raise InputError(
                "some of its paths give angles of the end-effector and some do not", field="paths",
                remedy="give them in all, or in none",
            )  # fmt: skip

    @property
    def _starts(self) -> list[float]:
        """Start times of the paths, and end of the last [s]."""
        starts: list[float] = [0.0]
        for path in self.paths:
            starts.append(starts[-1] + path.duration + self.dwell)
        starts[-1] = starts[-1] - self.dwell
        return starts

    @property
    def duration(self) -> float:
        """Duration of the motion [s]."""
        return self._starts[-1]

    @property
    def knots(self) -> tuple[float, ...]:
        """Knots of all paths [s]."""
        return tuple(start + knot for start, path in zip(self._starts, self.paths, strict=False) for knot in path.knots)

    def evaluate(self, t: Array) -> PathMotion:
        """Return the motion at times t [s]."""
        return PathMotion(*self._joined(t, (2,), lambda path, time: path.evaluate(time)))

    def turning(self, t: Array) -> Array | None:
        """Return the end-effector's angle [rad], its rate and acceleration at times t (3, k); None without angles."""
        return None if turning_of(self.paths[0], np.zeros(1)) is None else self._joined(t, (), turning_of)

    def _joined(self, t: Array, columns: tuple[int, ...], of: Callable[[Path, Array], Any]) -> Array:
        """Return values and two derivatives (3, k, ...) at times t, each of its path at the time since its start."""
        t = np.atleast_1d(np.asarray(t, dtype=float))
        which, out = np.searchsorted(self._starts[1:-1], t, side="right"), np.zeros((3, t.size, *columns))
        for k, path in enumerate(self.paths):
            if np.any(which == k):
                out[:, which == k] = of(path, t[which == k] - self._starts[k])
        return out


def turning_of(path: Path, t: Array) -> Array | None:
    """Return the end-effector's angle and two derivatives at times t (3, k); None if the path does not prescribe it."""
    turning = getattr(path, "turning", None)
    return None if turning is None else turning(t)


@checked_arguments()
def length_fraction(path: Path, end: float) -> float:
    """Return the fraction of a path's length passed by a time [s], from 0 to 1."""
    if end >= path.duration:
        return 1.0
    return _length(path, end) / _length(path, path.duration)


def _length(path: Path, end: float) -> float:
    """Return the length passed by a time, by Gauss quadrature between the knots [m]."""
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
    except (TypeError, ValueError, OverflowError):
        points = np.zeros((0, 0))
    shaped = points.ndim == 2 and points.shape[1] in columns and len(points) >= at_least
    if not (shaped and np.all(np.isfinite(points))):
        raise InputError(
            "not a list of points", field=field, value=values,
            remedy=f"give at least {at_least} of [x, y] in metres{', or all of [x, y, angle]' if 3 in columns else ''}",
        )  # fmt: skip
    finite(points.ravel(), field)
    return points
