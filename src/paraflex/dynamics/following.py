"""Start of prescribed motions away from an assembly: the pose is moved there by continuation, on its own branch."""

import math
from collections.abc import Iterator
from functools import partial

import numpy as np

from paraflex.arrays import Array
from paraflex.errors import AssemblyError, Moment
from paraflex.kernel.packed import Signals
from paraflex.mechanism import PrescribedAngle
from .inputs import inputs_of
from .joint_coordinates import value_text
from .projection import assemble, closed, constraint_change
from .system import DENSE_ROWS, System

# Weight of stiffness in `link_metric` when loops are closed: links move, their deflections stay as given.
POSITION_STIFFNESS = 1e6
# Prescribed motions nearer to the pose than this start there [sizes of the mechanism, rad].
_NEAR = 1e-9
# Poses nearer to one another than this are equal [sizes of the mechanism, rad].
_SAME = 1e-5
# Longest predicted step [sizes of the mechanism, rad], shortest as a fraction of the way, largest number of steps.
_LONGEST, _SHORTEST, _MAX_STEPS = 0.25, 1e-9, 2000
# Where steps shrink indefinitely, drives nearer to their start than this start at a singular pose.
_BARELY = 1e-4
# A pose whose least singular value is below this fraction of the largest, and as close to a singular pose, is taken as
# singular; and the step of the finite difference for the slope of that value.
_SINGULAR, _PROBE = 3e-6, 1e-4
# A step is accepted if its correction and the change of its direction are below these fractions of it.
_CORRECTION, _TURN = 0.25, 0.5


def follow_drives(system: System, signals: Signals, t: float, q: Array) -> Array:
    """Move a pose until prescribed motions are at their values, along the poses that the joints allow.

    Whole turns of a drive are added to the angle of the body it turns. If the shorter way is barred, or gears turn
    other bodies too, the motion is followed all the way.

    Parameters
    ----------
    system : System
        System of the mechanism.
    signals : Signals
        Signals with the prescribed values.
    t : float
        Time of the values [s].
    q : (n,) array
        Approximate coordinates of the pose.

    Returns
    -------
    (n,) array
        Coordinates with the drives at their values. The given ones if closing the loops from there leads to the same
        pose, or if the loops do not close nearby.

    Raises
    ------
    AssemblyError
        A limit of reach, or a pose where branches meet, bars the way.
    """
    away = _away(system, signals, t, q)
    joints = [one.joint for one in system.mechanism.prescribed]
    # Contradicting motions of one joint have no pose.
    if system.gap(away) <= _NEAR or len(set(joints)) < len(joints):
        return q
    limits = []
    for begun in _ways(system, signals, t, q, away):
        found, limit = _follow(system, signals, t, begun)
        if found is not None:
            # If closing the loops directly leads to the same pose, the caller does so, with less rounding.
            direct, _ = assemble(
                system, signals, t, q, partial(constraint_change, system, stiffness=POSITION_STIFFNESS)
            )
            same = np.max(np.abs(direct - found) / system.units) <= _SAME
            sharp = _sharpened(system, found)
            return q if same and sharp is found else sharp
        limits.append(limit)
    if not limits[0]:
        return q
    remedy = "start prescribed motions within reach of the assembly, or give one near to where they start"
    raise AssemblyError(limits[0], Moment(t, 0), q, remedy)


def driven_rows(system: System) -> Iterator[tuple[PrescribedAngle, int]]:
    """Yield the prescribed motions, each with the number of its constraint row."""
    signals = system.packed.rows["signal"].tolist()
    for motion, signal in zip(system.mechanism.prescribed, inputs_of(system.mechanism).prescribed, strict=True):
        yield motion, signals.index(signal)


def drives_at(system: System, q: Array, rows: set[int]) -> str:
    """List the prescribed motions of constraint rows by name, with the values of their joints; empty for none."""
    driven = (one for one, row in driven_rows(system) if row in rows)
    return ", ".join(f"{one.name} at {value_text(system, one.joint, q)}" for one in driven)


def _away(system: System, signals: Signals, t: float, q: Array) -> Array:
    """Return the coordinates of driven joints less their prescribed values in their rows (m,), zero in the others."""
    return np.where(system.packed.rows["signal"] >= 0, system.constraints(signals, t, q)[0], 0.0)


def _ways(system: System, signals: Signals, t: float, q: Array, away: Array) -> Iterator[Array]:
    """Yield poses from which to follow drives: the shorter way to their start, the whole way, the other way round."""
    ways = (_turned(system, signals, t, q, away), q, _turned(system, signals, t, q, away, other_way=True))
    for k, way in enumerate(ways):
        if not any(np.array_equal(way, earlier) for earlier in ways[:k]):
            yield way


def _turned(system: System, signals: Signals, t: float, q: Array, away: Array, *, other_way: bool = False) -> Array:
    """Return the pose with whole turns of drives for the shorter or other way; unchanged if constraints bar turns."""
    turned = q.copy()
    for motion, row in driven_rows(system):
        joint = system.mechanism.joint(motion.joint)
        moved, sign = (joint.a, 1.0) if joint.b.on_ground else (joint.b, -1.0)
        if not joint.slides:
            turns = away[row] / (2.0 * math.pi)
            whole = round(turns) + (int(math.copysign(1.0, turns - round(turns))) if other_way else 0)
            turned[system.body(moved.body).angle] += sign * 2.0 * math.pi * whole
    others = system.packed.rows["signal"] < 0
    change = (system.constraints(signals, t, turned)[0] - system.constraints(signals, t, q)[0]) * others
    return turned if system.gap(change) <= _NEAR * max(1.0, system.gap(away)) else q


def _follow(system: System, signals: Signals, t: float, q: Array) -> tuple[Array | None, str]:
    """Return the pose with the drives at their values, by predictor-corrector; None with the limit if barred."""
    change_at = partial(constraint_change, system, stiffness=POSITION_STIFFNESS)
    away = _away(system, signals, t, q)

    def pose_at(part: float, q: Array) -> Array | None:
        pose, phi = assemble(system, signals, t, q, change_at, offset=(1.0 - part) * away)
        return pose if closed(system, pose, phi) else None

    pose, part, step = pose_at(0.0, q), 0.0, 1.0
    if pose is None:
        return None, ""
    rate, side = -change_at(pose)(away) / system.units, _side(system, pose)
    for _ in range(_MAX_STEPS):
        size = float(np.max(np.abs(rate)))
        step = min(step, 1.0 - part, _LONGEST / max(size, _LONGEST))
        predicted = pose + step * system.units * rate
        found = pose_at(part + step, predicted)
        if found is not None and np.max(np.abs(found - predicted) / system.units) <= _CORRECTION * step * size:
            onwards = -change_at(found)(away) / system.units
            if np.max(np.abs(onwards - rate)) <= _TURN * size and _side(system, found) == side:
                if part + step >= 1.0:
                    return found, ""
                pose, rate, part, step = found, onwards, part + step, 4.0 * step
        step *= 0.5
        if step < _SHORTEST:
            break
    if (1.0 - part) * system.gap(away) < _BARELY:
        # Steps shrink indefinitely where branches meet.
        found = pose_at(1.0, pose)
        if found is not None and np.max(np.abs(found - pose) / system.units) < np.sqrt(_BARELY):
            return found, ""
    held = drives_at(system, pose, set(np.flatnonzero(away).tolist()))
    way = "the joints block the way from the assembly to the start of prescribed motions"
    return None, f"{way}, {held}, the limit of their reach or a change point,"


def _side(system: System, q: Array) -> float:
    """Return the sign of det Phi_q of a fully driven rigid mechanism, which changes where branches meet; else zero."""
    rigid = [body.offset + k for body in system.bodies for k in range(3)]
    if system.n_constraints != len(rigid) or len(rigid) > DENSE_ROWS:
        return 0.0
    return float(np.linalg.slogdet(system.jacobian(q)[system.constrained][:, rigid])[0])


def _sharpened(system: System, q: Array) -> Array:
    """Return the singular pose within the square root of rounding of a closed pose; else the pose itself.

    The gap of the loops is quadratic along the direction in which they hardly open; the least singular value is linear.
    """
    rows = system.constrained
    if not 0 < system.n_constraints <= min(DENSE_ROWS, system.n):
        return q
    left, sizes, right = np.linalg.svd(system.dimensionless_jacobian(q)[rows], full_matrices=False)
    if sizes[-1] > _SINGULAR * sizes[0]:
        return q
    u, v = left[:, -1], right[-1]
    beside = system.dimensionless_jacobian(q + _PROBE * system.units * v)[rows]
    slope = (u @ beside @ v - sizes[-1]) / _PROBE
    move = -sizes[-1] / slope if slope else np.inf
    return q + move * system.units * v if abs(move) <= _SINGULAR else q
