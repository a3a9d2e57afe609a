"""Properties of a driven motion that designers ask for: transmission angles, dead points, time ratios, coupler curves.

Samples only bracket an event; it is located with the exact motion at times between them.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
import scipy

from paraflex.arrays import Array, Brief, Indices
from paraflex.dynamics import axis_angle, joint_coordinate
from paraflex.dynamics.joint_coordinates import unit_vectors
from paraflex.dynamics.points import PointMotion, cross, marker_position, point_motion
from paraflex.mechanism import GROUND, Joint, PointRef
from .exact import ExactMotion

# Rates below this part of the largest are zero.
_ZERO = 1e-11
# Relative error of times that are located.
_SHARP = 4.0 * np.finfo(float).eps
# Relative error of times of smooth extremes, whose values are sharp to rounding.
_LOCATED = 1e-9
# Speed at a cusp, as a part of the largest speed of the point; smallest angle at which two branches cross [rad].
_STILL, _CROSSING = 1e-8, 1e-3
# Segments of paths of which the crossings with all others are found at a time, for memory.
_AT_A_TIME = 256
# Distance of a path after a rest from that before it, as a part of the way, below which it is the same path.
_SAME_PATH = 1e-4
# A curve with more crossings in a turn of the drive retraces itself.
_MOST_CROSSINGS = 50


@dataclass(frozen=True)
class Extreme:
    """Extreme of a quantity: its value, and the time [s] and value of the drive's joint [rad, m] there."""

    value: float
    time: float
    drive: float | None


@dataclass(frozen=True)
class Transmission:
    """Transmission angle at a joint, the acute angle between a coupler and the normal to the motion it imparts.

    Attributes
    ----------
    joint, coupler : str
        Joint, and the body or rod with two joints that transmits the force.
    smallest, largest : Extreme
        Extremes [rad]: the nearer to a right angle, the better the force is transmitted.
    """

    joint: str
    coupler: str
    smallest: Extreme
    largest: Extreme


@dataclass(frozen=True)
class Cusp:
    """Position at which a point comes to rest on its path and reverses: (x, y) [m], time [s], value of the drive."""

    position: tuple[float, float]
    time: float
    drive: float | None


@dataclass(frozen=True)
class Crunode:
    """Position at which the path of a point crosses itself: (x, y) [m], both times [s] and values of the drive."""

    position: tuple[float, float]
    times: tuple[float, float]
    drives: tuple[float | None, float | None]


@dataclass(frozen=True)
class Trail:
    """Path of a point of a body that is not guided by the ground alone.

    Attributes
    ----------
    cusps : tuple of Cusp
        Cusps in order of time.
    crunodes : tuple of Crunode
        Crossings; none if the path retraces itself.
    """

    cusps: tuple[Cusp, ...]
    crunodes: tuple[Crunode, ...]


@dataclass(frozen=True)
class KinematicFeatures(Brief):
    """Properties of a driven motion.

    Attributes
    ----------
    freedoms : int
        Degrees of freedom without the drives.
    transmissions : tuple of Transmission
        Transmission angles where a coupler moves a body that is guided by the ground and not driven.
    dead_points : mapping of str to tuple of Extreme
        Positions at which a joint reverses, by joint, in order of time: the value is that of the joint [rad, m].
    time_ratios : mapping of str to float
        Ratio of the times of the slower and the faster stroke, for joints with two dead points in a cycle.
    trails : mapping of str to Trail
        Paths of coupler points by name.
    cycle : int, optional
        Turns of the drive after which the motion repeats: the properties are those of the first cycle. None for a
        motion that does not repeat; the properties are those of the whole motion.
    """

    freedoms: int
    transmissions: tuple[Transmission, ...]
    dead_points: Mapping[str, tuple[Extreme, ...]]
    time_ratios: Mapping[str, float]
    trails: Mapping[str, Trail]
    cycle: int | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return plain numbers, in SI units and radians."""
        names = {"freedoms": "degrees_of_freedom", "transmissions": "transmission_angles"}
        return {names.get(name, name): value for name, value in asdict(self).items()}


def features_of(motion: ExactMotion) -> KinematicFeatures:
    """Compute the properties of a driven motion; see `KinematicFeatures`."""
    mechanism = motion.system.mechanism
    prescribed = {one.joint for one in mechanism.prescribed}
    followers = [one.name for one in mechanism.joints if one.moves and one.name not in prescribed]
    dead = {name: ends for name in followers if (ends := tuple(_dead_points(motion, name)))}
    ratios = {}
    if motion.drive is not None and motion.repeats:
        strokes = {name: abs(ends[1].time - ends[0].time) for name, ends in dead.items() if len(ends) == 2}
        whole = motion.drive.duration
        ratios = {name: max(t, whole - t) / min(t, whole - t) for name, t in strokes.items()}
    trails = {str(ref): _trail(motion, ref) for ref in _coupler_points(motion)}
    cycle = round(motion.drive.turns) if motion.drive is not None and motion.repeats else None
    return KinematicFeatures(motion.mobility.freedoms, tuple(_transmissions(motion)), dead, ratios, trails, cycle)


def _driven(motion: ExactMotion) -> set[str]:
    """Return the joints that drives move, themselves or through gears and other relations."""
    mechanism = motion.system.mechanism
    found = {one.joint for one in mechanism.prescribed}
    if motion.rigid is not None:
        found |= {motor.joint for motor in mechanism.motors}
    for _ in mechanism.relations:
        found |= {one for each in mechanism.relations if len(left := {*each.joints} - found) == 1 for one in left}
    return found


def _drive_at(motion: ExactMotion, t: float) -> float | None:
    return None if motion.drive is None else motion.drive.at(t)


def _at(motion: ExactMotion, value: float, t: float) -> Extreme:
    return Extreme(value, t, _drive_at(motion, t))


def _root(function: Callable[[float], float], a: float, b: float) -> float:
    # A value that is zero to rounding may have either sign.
    if function(a) * function(b) >= 0.0:
        return a if abs(function(a)) < abs(function(b)) else b
    return float(scipy.optimize.brentq(function, a, b, xtol=_SHARP * max(abs(a), abs(b)), rtol=_SHARP))


def _sign_changes(
    t: Array, values: Array, zero: float, rate: Callable[[float], float], *, repeats: bool
) -> Iterator[float]:
    """Yield the times at which a quantity changes its sign; at the end of a motion that repeats, if it does there."""
    signs = np.where(np.abs(values) <= zero, 0.0, np.sign(values))
    clear = np.flatnonzero(signs)
    for i, j in pairwise(clear):
        if signs[i] != signs[j]:
            yield float(t[(i + j) // 2]) if j - i > 1 else _root(rate, t[i], t[j])
    if repeats and clear.size and (clear[0] > 0 or clear[-1] < t.size - 1) and signs[clear[0]] != signs[clear[-1]]:
        yield float(t[0])


def _dead_points(motion: ExactMotion, name: str) -> Iterator[Extreme]:
    """Yield the positions at which a joint reverses."""
    solution, system = motion.solution, motion.system
    rates = joint_coordinate(system, name, solution.q, solution.v).rate
    largest = float(np.max(np.abs(rates)))
    if not largest > _ZERO * (1.0 if motion.drive is None else motion.drive.speed):
        return

    def rate(t: float) -> float:
        there = motion.at(t)
        return float(joint_coordinate(system, name, there.q, there.v).rate[0])

    for t in sorted(_sign_changes(solution.t, rates, _ZERO * largest, rate, repeats=motion.repeats)):
        yield _at(motion, float(joint_coordinate(system, name, motion.at(t).q).value[0]), t)


def _guides(motion: ExactMotion) -> dict[str, Joint]:
    """Return the joint that guides each body on the ground: a pivot or an axis; bodies with others are left out."""
    found: dict[str, list[Joint]] = {}
    for joint in motion.system.mechanism.joints:
        if joint.a.on_ground or joint.b.on_ground:
            found.setdefault(joint.b.body if joint.a.on_ground else joint.a.body, []).append(joint)
    return {body: joints[0] for body, joints in found.items() if len(joints) == 1 and joints[0].moves}


def _ends(joint: Joint, body: str) -> tuple[PointRef, PointRef]:
    """Return the points of a joint on a body and on the other body."""
    return (joint.a, joint.b) if joint.a.body == body else (joint.b, joint.a)


def _couplers(motion: ExactMotion) -> Iterator[tuple[str, str, PointRef, PointRef]]:
    """Yield the links with two pins: name, joint at the far end, that point of the other body, the near point."""
    mechanism = motion.system.mechanism
    for body in mechanism.bodies:
        joints = [one for one in mechanism.joints if body.name in (one.a.body, one.b.body)]
        if len(joints) == 2 and all(one.holds == ("points",) for one in joints):
            for near, far in (joints, joints[::-1]):
                yield body.name, far.name, _ends(far, body.name)[1], _ends(near, body.name)[0]
    for one in mechanism.joints:
        if one.holds == ("distance",):
            yield one.name, one.name, one.b, one.a
            yield one.name, one.name, one.a, one.b


def transmission_angles(motion: ExactMotion, q: Array) -> list[tuple[str, str, Array]]:
    """Return the transmission angles (k,) at poses (k, n) [rad], with joints and couplers: see `Transmission`."""
    return [(joint, coupler, 0.5 * math.pi - np.abs(pressure(q))) for joint, coupler, pressure in _pressures(motion)]


def _pressures(motion: ExactMotion) -> Iterator[tuple[str, str, Callable[[Array], Array]]]:
    """Yield joint, coupler and pressure angle of couplers at bodies that are guided by the ground and not driven."""
    guides, driven = _guides(motion), _driven(motion)
    for coupler, joint, far, near in _couplers(motion):
        guide = guides.get(far.body)
        if not (far.on_ground or guide is None or guide.name in driven or near.body == GROUND):
            yield joint, coupler, partial(_pressure_angle, motion, far, near, guide)


def _transmissions(motion: ExactMotion) -> Iterator[Transmission]:
    """Yield the transmission angles of couplers at bodies that are guided by the ground and not driven."""
    t = motion.solution.t
    for joint, coupler, pressure in _pressures(motion):
        values = pressure(motion.solution.q)

        def at(time: float, pressure: Callable[[Array], Array] = pressure) -> float:
            return float(pressure(motion.at(time).q)[0])

        worst = _peak(t, np.abs(values), lambda time, at=at: abs(at(time)))
        best = next(_sign_changes(t, values, 0.0, at, repeats=False), None)
        if best is None:
            best = _peak(t, -np.abs(values), lambda time, at=at: -abs(at(time)))
        ends = [_at(motion, 0.5 * math.pi - abs(at(time)), time) for time in (worst, best)]
        yield Transmission(joint, coupler, *ends)


def _pressure_angle(motion: ExactMotion, far: PointRef, near: PointRef, guide: Joint, q: Array) -> Array:
    """Return the angle (k,) between the line of a coupler and the motion that it imparts, in [-pi/2, pi/2]."""
    system = motion.system
    along = _places(motion, far, q) - _places(motion, near, q)
    if guide.slides:
        normal = unit_vectors(axis_angle(system, guide, q) + 0.5 * math.pi)
    else:
        normal = _places(motion, far, q) - _places(motion, _ends(guide, far.body)[1], q)
    # The angle between along and normal is the transmission angle: its deviation from a right angle is wanted.
    cosine = np.sum(along * normal, axis=1) / (np.linalg.norm(along, axis=1) * np.linalg.norm(normal, axis=1))
    return np.arcsin(np.clip(cosine, -1.0, 1.0))


def _places(motion: ExactMotion, ref: PointRef, q: Array) -> Array:
    return marker_position(motion.system, motion.system.marker(ref), q)


def _peak(t: Array, values: Array, function: Callable[[float], float]) -> float:
    """Return the time of the largest value of a smooth function near its largest sample."""
    k = int(np.argmax(values))
    span = t[max(k - 1, 0)], t[min(k + 1, t.size - 1)]
    found = scipy.optimize.minimize_scalar(
        lambda time: -function(time), bounds=span, method="bounded", options={"xatol": _LOCATED * t[-1]}
    )
    return float(found.x) if -found.fun > values[k] else float(t[k])


def _coupler_points(motion: ExactMotion) -> list[PointRef]:
    """Return the named points of bodies that are not guided by the ground alone, one at each joint."""
    mechanism, guides = motion.system.mechanism, _guides(motion)
    taken = {one.b for one in mechanism.joints} | {one.a for one in mechanism.joints if one.b.on_ground}
    guided = {ref for one in mechanism.joints if one.holds[0] == "points" for ref in (one.a, one.b)
              if one.a.body in guides or one.b.body in guides}  # fmt: skip
    refs = [PointRef(body.name, point) for body in mechanism.bodies for point in body.points]
    return [ref for ref in refs if ref.body not in guides and ref not in taken | guided]


def _pace(motion: ExactMotion, v: Array) -> float:
    """Return the largest speed of any body in velocities (k, n) [sizes of the mechanism/s, rad/s]."""
    return float(np.max(np.abs(v / motion.system.units)))


def _trail(motion: ExactMotion, ref: PointRef) -> Trail:
    """Return cusps and crossings of the path of a point."""
    system, solution = motion.system, motion.solution

    def there(t: float) -> PointMotion:
        return point_motion(system, ref, *motion.at(t))

    path = point_motion(system, ref, solution.q, solution.v, solution.a)
    speeds = np.linalg.norm(path.velocity, axis=1)
    fastest = float(np.max(speeds))
    if not fastest > 0.0:
        return Trail((), ())

    def gain(t: float) -> float:
        here = there(t)
        return float(np.sum(here.velocity * here.acceleration))

    gains = np.sum(path.velocity * path.acceleration, axis=1)
    zero = _ZERO * fastest * float(np.max(np.linalg.norm(path.acceleration, axis=1)))
    slowest = _sign_changes(solution.t, gains, zero, gain, repeats=motion.repeats)
    cusps = []
    for t in sorted(slowest):
        here = there(t)
        # Where a path pauses, all points do.
        pauses = _pace(motion, motion.at(t)[1]) < _STILL * _pace(motion, solution.v)
        if np.linalg.norm(here.velocity) < _STILL * fastest and not pauses and not _retraced(motion, there, t):
            cusps.append(Cusp(_pair(here.position[0]), t, _drive_at(motion, t)))
    crunodes = []
    for t in _crossings(motion, path.position, there):
        where = _pair(there(t[0]).position[0])
        crunodes.append(Crunode(where, t, (_drive_at(motion, t[0]), _drive_at(motion, t[1]))))
    return Trail(tuple(cusps), tuple(crunodes))


def _retraced(motion: ExactMotion, there: Callable[[float], PointMotion], t: float) -> bool:
    """Return whether a point that comes to rest goes back on its path, as where a drive reverses."""
    times = motion.solution.t
    step = min(2.0 * (times[1] - times[0]), t - times[0], times[-1] - t)
    if not step > 0.0:
        return True
    rest, after = there(t).position, there(t + step).position
    apart = scipy.optimize.minimize_scalar(
        lambda back: float(np.linalg.norm(there(back).position - after)), bounds=(max(t - 2.0 * step, times[0]), t),
        method="bounded", options={"xatol": _LOCATED * step},
    )  # fmt: skip
    return bool(apart.fun < _SAME_PATH * np.linalg.norm(after - rest))


def _pair(xy: Array) -> tuple[float, float]:
    return float(xy[0]), float(xy[1])


def _crossings(
    motion: ExactMotion, path: Array, there: Callable[[float], PointMotion]
) -> Sequence[tuple[float, float]]:
    """Return the pairs of times at which a path (k, 2) crosses itself; none if it retraces itself."""
    t, found = motion.solution.t, []
    pairs = _crossed(path)
    if len(pairs) > _MOST_CROSSINGS * (1.0 if motion.drive is None else max(motion.drive.turns, 1.0)):
        return []
    for i, j in pairs:
        times = np.array([t[i] + t[i + 1], t[j] + t[j + 1]]) / 2.0
        for _ in range(20):
            one, two = there(times[0]), there(times[1])
            rates = np.column_stack([one.velocity[0], -two.velocity[0]])
            sizes = np.linalg.norm(rates, axis=0)
            if not abs(np.linalg.det(rates)) > _CROSSING * sizes[0] * sizes[1]:
                break
            move = np.linalg.solve(rates, (two.position - one.position)[0])
            times = np.clip(times + move, t[0], t[-1])
            if np.max(np.abs(move)) < 1e-13 * t[-1]:
                # A path that ends where it starts does not cross itself there.
                if times[0] > _LOCATED * t[-1] or times[1] < (1.0 - _LOCATED) * t[-1]:
                    found.append((float(times[0]), float(times[1])))
                break
    return found


def _crossed(path: Array) -> Indices:
    """Return the pairs (pairs, 2) of segments of a polyline that cross, the earlier one first, neighbours excluded."""
    a, b, found = path[:-1], path[1:], []
    for first in range(0, len(a), _AT_A_TIME):
        p, q = a[first : first + _AT_A_TIME, None], b[first : first + _AT_A_TIME, None]
        side = cross(q - p, path[first:] - p)
        apart = side[:, :-1] * side[:, 1:] < 0.0
        apart &= cross((b - a)[first:], p - a[first:]) * cross((b - a)[first:], q - a[first:]) < 0.0
        found.append(np.argwhere(np.triu(apart, 2)) + first)
    pairs = np.concatenate(found)
    if np.allclose(path[0], path[-1], rtol=0.0, atol=1e-9 * float(np.max(np.ptp(path, axis=0)))):
        return pairs[(pairs[:, 0] > 0) | (pairs[:, 1] < len(a) - 1)]
    return pairs
