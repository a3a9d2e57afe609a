"""Loads over the duration of a study: onset and size of each load, and directions of the first joint movements."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from paraflex.arrays import Array
from paraflex.dynamics import System, joint_coordinate
from paraflex.formatting import number, quantity
from paraflex.mechanism import Load, Mechanism, PrescribedAngle, TabulatedProfile, TimeProfile
from paraflex.mechanism.profiles import marks

# Number of times at which a profile is evaluated, besides its knots and rows, and the default end of these times [s].
_LOOKS, _FIRST = 1001, 1.0
# Values below this fraction of the largest count as zero: rounding of expressions.
_NOTHING = 1e-9
# A joint has moved if its displacement exceeds this fraction of its travel.
_MOVED = 1e-2
_HALVINGS = 50
# A load with an onset before this fraction of the study acts from the start.
_AT_ONCE = 1e-6


@dataclass(frozen=True)
class ActingLoad:
    """Onset and size of a load over a study.

    Attributes
    ----------
    load : Load
        Force or torque.
    shown : (c,) array
        Components at the start, or at the time of the largest magnitude if the load is zero at the start [N, N m].
    begins : float or None
        Onset [s]; None if the load is zero throughout.
    largest : float
        Largest magnitude [N, N m].
    grows : bool
        Whether the load is zero at the start and acts immediately after it.
    at_pose : bool
        Whether the load is a law over the motion, and known in the start pose only.
    """

    load: Load
    shown: Array
    begins: float | None
    largest: float
    grows: bool = False
    at_pose: bool = False

    @property
    def later(self) -> bool:
        """Whether the load does not act from the start."""
        return self.begins != 0.0

    @property
    def size(self) -> str:
        """Description of the size with unit: value at the start, or largest value and onset."""
        unit = self.load.unit
        if self.at_pose:
            return f"{_sized(self.largest, unit)} at the start, varies with the motion"
        if self.begins is None:
            return f"0 {unit}"
        if self.later:
            return f"{_sized(self.largest, unit)} from {number(self.begins, 3)} s"
        if self.grows:
            return f"up to {_sized(self.largest, unit)}"
        first = float(np.linalg.norm(self.shown))
        more = f", up to {_sized(self.largest, unit)}" if self.largest > (1.0 + 1e-6) * first else ""
        return _sized(first, unit) + more


def acting_load(load: Load, duration: float | None = None, at_start: Array | None = None) -> ActingLoad:
    """Return the onset and size of a load over a study.

    Parameters
    ----------
    load : Load
        Force or torque.
    duration : float, optional
        Duration of the study [s]; by default the first second, or up to the last knot if that is later.
    at_start : (3,) array, optional
        Force [N] and torque [N m] in the start pose at rest, of a load that has laws over the motion.
    """
    if load.laws:
        shown = np.zeros(3) if at_start is None else at_start
        shown = shown[:2] if load.kind == "force" else shown[2:]
        return ActingLoad(load, shown, 0.0, float(np.linalg.norm(shown)), at_pose=True)
    times = _times(load.profiles, duration)
    values = load.evaluate(times)
    sizes = np.linalg.norm(values, axis=1)
    least = _NOTHING * float(sizes.max())
    acts = np.flatnonzero(sizes > least)
    if not acts.size:
        return ActingLoad(load, values[0], None, 0.0)
    first = int(acts[0])
    if first == 0:
        return ActingLoad(load, values[0], 0.0, float(sizes.max()))
    begins = _onset(load, float(times[first - 1]), float(times[first]), least)
    grows = begins < _AT_ONCE * float(times[-1])
    return ActingLoad(load, values[int(np.argmax(sizes))], 0.0 if grows else begins, float(sizes.max()), grows)


def _onset(load: Load, before: float, after: float, least: float) -> float:
    """Return the time [s] at which a load first exceeds a magnitude, found by bisection between two times."""
    for _ in range(_HALVINGS):
        middle = 0.5 * (before + after)
        acts = float(np.linalg.norm(load.evaluate(np.array([middle])))) > least
        before, after = (before, middle) if acts else (middle, after)
    return after


def drive_speed(drive: PrescribedAngle, slides: bool, duration: float | None = None) -> str:
    """Format the largest speed of a prescribed motion over a study, with its unit."""
    rates = np.abs(drive.profile.evaluate(_times((drive.profile,), duration))[1])
    constant = np.ptp(rates) <= _NOTHING * rates.max()
    return ("" if constant else "up to ") + _sized(float(rates.max()), "m/s" if slides else "rad/s")


def first_movements(mechanism: Mechanism, duration: float | None = None) -> dict[str, int]:
    """Return the signs of the first movement of joints with prescribed motions, 0 for joints at rest."""
    return {
        drive.joint: _first_sign(drive.profile.evaluate(_times((drive.profile,), duration))[1], _NOTHING)
        for drive in mechanism.prescribed
    }


def first_movements_along(system: System, q: Array) -> dict[str, int]:
    """Return the signs of the first movement of joints with motors along a motion q (k, n), 0 for joints at rest."""
    mechanism, moved = system.mechanism, {}
    for motor in mechanism.motors:
        travel = joint_coordinate(system, motor.joint, q).value
        moved[motor.joint] = _first_sign(travel - travel[0], _MOVED) if np.ptp(travel) > _NOTHING else 0
    return moved


def load_variables(mechanism: Mechanism, times: Array) -> Mapping[str, tuple[tuple[str, ...], Array]]:
    """Return forces and torques of all loads at times (k,): zero where a load has none, empty without loads.

    Empty with laws over the motion as well: the links of a run have the values of their loads.
    """
    if not mechanism.loads or any(load.laws for load in mechanism.loads):
        return {}
    force, torque = np.zeros((len(times), len(mechanism.loads), 2)), np.zeros((len(times), len(mechanism.loads)))
    for k, load in enumerate(mechanism.loads):
        values = load.evaluate(times)
        if load.kind == "force":
            force[:, k] = values
        else:
            torque[:, k] = values[:, 0]
    return {"load_force": (("time", "load", "axis"), force), "load_torque": (("time", "load"), torque)}


def _sized(value: float, unit: str) -> str:
    return quantity(value, unit, digits=4, padded=False)


def _times(profiles: tuple[TimeProfile, ...], duration: float | None) -> Array:
    """Return the times at which profiles are evaluated: all knots, and a grid over the study up to the end of tables.

    Without a duration [s] the grid covers the first second, or up to the last knot if that is later.
    """
    known = [time for profile in profiles for time in marks(profile)]
    end = max([_FIRST, *known]) if duration is None else duration
    end = min([end, *(profile.times[-1] for profile in profiles if isinstance(profile, TabulatedProfile))])
    return np.unique([*np.linspace(0.0, end, _LOOKS), *(time for time in known if 0.0 <= time <= end)])


def _first_sign(values: Array, least: float) -> int:
    """Return the sign of the first value above a fraction of the largest magnitude, 0 if all values are zero."""
    moves = np.flatnonzero(np.abs(values) > least * np.max(np.abs(values)))
    return int(np.sign(values[moves[0]])) if moves.size else 0
