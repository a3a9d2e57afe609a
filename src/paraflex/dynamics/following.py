"""Start of prescribed motions away from an assembly: the assembly is moved there by continuation, on its branch."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial

import numpy as np

from paraflex.arrays import Array
from paraflex.dynamics.inputs import inputs_of
from paraflex.dynamics.joint_coordinates import value_text
from paraflex.dynamics.projection import LeastChange, assemble, closed, constraint_change
from paraflex.dynamics.rank import DENSE_ROWS
from paraflex.dynamics.system import System
from paraflex.kernel.packed import CONSTRAINT, Signals
from paraflex.mechanism import PrescribedAngle

# Weight of stiffness against mass [s^2] when loops are closed: links move, their deflections stay as given.
POSITION_STIFFNESS = 1.0
# Prescribed motions nearer to the pose than this start there [sizes of the mechanism, rad].
_NEAR = 1e-9
# Longest predicted step [sizes of the mechanism, rad], shortest as a part of the way, largest number of steps.
_LONGEST, _SHORTEST, _MAX_STEPS = 0.25, 1e-9, 2000
# A step is accepted if its correction, and the change of the direction, are smaller than these parts of it.
_CORRECTION, _TURN = 0.25, 0.5


def follow_drives(system: System, signals: Signals, t: float, q: Array) -> tuple[Array, str]:
    """Move a pose until prescribed motions are at their values, along the poses that the joints allow.

    Predictor and corrector in steps so short that the branch is kept. Whole turns of a drive are added to the angles
    of what it turns; if the rest of the way is barred, all of it is tried.

    Parameters
    ----------
    system, signals
    t : float
        Time of the values [s].
    q : (n,) array
        Approximate coordinates of the pose.

    Returns
    -------
    q : (n,) array
        Coordinates with the drives at their values; as given where the way there is barred.
    limit : str
        Description of the limit of reach that bars the way; empty for none.
    """
    away = _away(system, signals, t, q)
    if system.gap(away) <= _NEAR:
        return q, ""
    turned = _turned(system, signals, t, q, away)
    limit = ""
    for begun in [turned, q] if turned is not q else [q]:
        found, limit = _follow(system, signals, t, begun)
        if found is not None:
            return found, ""
    return q, limit


def driven_rows(system: System) -> Iterator[tuple[PrescribedAngle, int]]:
    """Prescribed motions, each with the number of its constraint row."""
    signals = system.packed.rows["signal"].tolist()
    for motion, signal in zip(system.mechanism.prescribed, inputs_of(system.mechanism).prescribed, strict=True):
        yield motion, signals.index(signal)


def _away(system: System, signals: Signals, t: float, q: Array) -> Array:
    """Coordinates of driven joints less their prescribed values in their rows (m,), zero in the others."""
    return np.where(system.packed.rows["signal"] >= 0, system.constraints(signals, t, q)[0], 0.0)


def _turned(system: System, signals: Signals, t: float, q: Array, away: Array) -> Array:
    """The pose with whole turns added to bodies, so that drives of angles are within half a turn of their values."""
    found = q
    for motion, row in driven_rows(system):
        joint = system.mechanism.joint(motion.joint)
        turns = 0 if joint.slides else -round(away[row] / (2.0 * math.pi))
        if turns:
            trial = found.copy()
            moved, sign = (joint.b, 1.0) if not joint.b.on_ground else (joint.a, -1.0)
            trial[system.body(moved.body).angle] += sign * turns * 2.0 * math.pi
            change = system.constraints(signals, t, trial)[0] - system.constraints(signals, t, found)[0]
            change[row] = 0.0
            # Gears, and joints that hold angles, turn other bodies as well: those are followed all the way.
            found = trial if system.gap(change) <= _NEAR * abs(turns) else found
    return found


def _follow(system: System, signals: Signals, t: float, q: Array) -> tuple[Array | None, str]:
    """The pose followed until drives are at their values; None, and where the way ends, if it is barred."""
    change_at = partial(constraint_change, system, stiffness=POSITION_STIFFNESS)
    away = _away(system, signals, t, q)

    def pose_at(part: float, q: Array) -> Array | None:
        offset = (1.0 - part) * away
        pose, phi = assemble(system, signals, t, q, change_at, offset=offset)
        return pose if closed(system, pose, phi) else None

    def rate_at(q: Array) -> Array:
        change: LeastChange = change_at(q)
        return -change(away) / system.units

    pose, part, step = pose_at(0.0, q), 0.0, 1.0
    if pose is None:
        return None, ""
    rate, side = rate_at(pose), _side(system, pose)
    for _ in range(_MAX_STEPS):
        size = float(np.max(np.abs(rate)))
        step = min(step, 1.0 - part, _LONGEST / max(size, _LONGEST))
        predicted = pose + step * system.units * rate
        found = pose_at(part + step, predicted)
        if found is not None and np.max(np.abs(found - predicted) / system.units) <= _CORRECTION * step * size:
            onwards = rate_at(found)
            if np.max(np.abs(onwards - rate)) <= _TURN * size and _side(system, found) == side:
                pose, rate, part, step = found, onwards, part + step, 2.0 * step
                if part >= 1.0:
                    return pose, ""
                continue
        step *= 0.5
        if step < _SHORTEST:
            break
    return None, _limit(system, away, pose)


def _side(system: System, q: Array) -> float:
    """Sign of det Phi_q for a rigid mechanism in which all is driven: it changes where branches meet. Else zero."""
    rows = system.packed.rows["kind"] == CONSTRAINT
    rigid = [body.offset + k for body in system.bodies for k in range(3)]
    if np.sum(rows) != len(rigid) or np.sum(rows) > DENSE_ROWS:
        return 0.0
    return float(np.linalg.slogdet(system.jacobian(q)[np.ix_(rows, rigid)])[0])


def _limit(system: System, away: Array, q: Array) -> str:
    """Names of drives with the values at which a pose bars their way."""
    held = ", ".join(
        f"{motion.name} at {value_text(system, motion.joint, q)}" for motion, row in driven_rows(system) if away[row]
    )
    return f"the joints bar the way from the assembly to where prescribed motions start: they hold {held}"
