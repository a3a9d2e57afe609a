"""Design of rate feedback gains that maximise the damping of vibrations in the sampled closed loop."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import scipy

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array, Brief, Complex
from paraflex.control.laws.discrete import side_by_side
from paraflex.control.laws.kinds.rate_feedback import RateFeedback
from paraflex.errors import InputError
from paraflex.linear import LinearModel, ReducedModel
from paraflex.mechanism import Mechanism
from paraflex.mechanism.quantities import known, positive
from .closed_loops import ClosedLoop, closed_loop, damped_frequency, named_law
from .sampled import SampledPlant, as_sampled

# A pole within this distance of z = 1 belongs to a free motion, which strain feedback does not affect.
_FREE = 1e-5
# Accuracy of poles on the unit circle; relative difference below which two decay rates count as equal.
_ON_CIRCLE, _AS_SLOW = 1e-9, 1e-3
# Gains that are tried in one direction: fractions of the gains for critical damping if damping were linear in them.
_TRIED = np.geomspace(1e-4, 30.0, 70)
# A step in following poles is accepted if each is found this close to its prediction, as a fraction of the distance to
# the next pole; largest number of times that a step is halved.
_NEAR, _HALVED = 0.25, 12
# Largest number of rounds over all pairs, and relative growth of the damping ratio below which they end.
_ROUNDS, _GROWS = 4, 1e-4


@dataclass(frozen=True)
class RateGains(Brief):
    """Rate feedback gains, and the vibrations for which they were designed.

    Attributes
    ----------
    gains : mapping of str to mapping of str to float
        Gains by motor and sensor, for `RateFeedback` [N m s per unit of the sensor].
    frequencies, frequencies_without : (k,) arrays
        Natural frequencies of the vibrations, with the gains and without [Hz].
    damping, damping_without : (k,) arrays
        Damping ratios of the vibrations, with the gains and without.
    spectral_radius : float
        Largest magnitude of the loop's poles, except those of free motions, which strains do not measure.
    bound : str
        Condition that prevents larger gains: "optimum", "largest" or "margin".
    loop : ClosedLoop
        Closed loop with the gains.
    cutoff : float or None
        Cut-off frequency of the low-pass filter of rates [Hz]; None without filter.
    """

    gains: Mapping[str, Mapping[str, float]]
    frequencies: Array
    frequencies_without: Array
    damping: Array
    damping_without: Array
    spectral_radius: float
    bound: str
    loop: ClosedLoop
    cutoff: float | None

    def law(self) -> RateFeedback:
        """Return the control law, for `SampledController` with the period and delay of the design."""
        return RateFeedback(self.gains, cutoff=self.cutoff)


@checked_arguments()
def rate_feedback_gains(
    model: Any,
    period: float,
    *,
    pairs: Mapping[str, str | Sequence[str]] | None = None,
    delay: float = 0.0,
    cutoff: float | None = None,
    beside: Any = None,
    frequencies: Sequence[float] | None = None,
    largest: float | None = None,
    margin: float = 2.0,
) -> RateGains:
    """Design gains of `RateFeedback` that maximise the damping of vibrations, in the sampled loop with its delay.

    The least of their damping ratios is maximised, while no pole becomes slower than the slowest one without gains.
    Poles are followed from zero gains on, in steps by their derivatives dz = w^H dA v / (w^H v). First a common factor
    of all pairs is sought, along the derivatives of the damping ratios, then each gain by itself, in turn.

    Parameters
    ----------
    model : LinearModel, ReducedModel, state space, (A, B, C, D) or SampledPlant
        Model of all states; for a reduced model, check the loop with the full one, as feedback may destabilise
        vibrations that are left out.
    period : float
        Sampling period [s].
    pairs : mapping of str to str or sequence of str, optional
        Sensors whose rate each motor feeds back. By default, for a model of a mechanism, the nearest `StrainGauge` on
        a link at the motor's joint.
    delay : float
        Delay from a sample until its torques act [s].
    cutoff : float, optional
        Cut-off frequency of the low-pass filter of rates [Hz]; no filter by default.
    beside : optional
        Linear controller that acts as well, with the same period and delay: a joint controller (`JointPID.sampled`), a
        design of `lqg`, or anything else that `closed_loop` accepts, with names of its sensors and motors.
    frequencies : sequence of float, optional
        Approximate frequencies of the vibrations [Hz]. By default the vibrations that decay slowest, as many as there
        are pairs.
    largest : float, optional
        Largest magnitude of the gains [N m s per unit of the sensor]; no limit by default.
    margin : float
        Gain margin: the loop stays stable with all gains multiplied by this factor; 1 for the stability limit itself.

    Returns
    -------
    RateGains
        Gains, vibrations and closed loop.

    Raises
    ------
    InputError
        Unknown names, numbers out of range, no pair, no vibration, a vibration that the rates do not damp, or a loop
        that is unstable without gains.
    """
    positive(period, "period", "s")
    if not (np.isfinite(margin) and margin >= 1.0):
        raise InputError("must be at least 1", field="margin", value=margin, remedy="give 2, or 1 for none")
    if largest is not None:
        positive(largest, "largest", "N m s by the sensor's unit")
    plant = as_sampled(model, period, delay)
    chosen = _pairs(model, plant, pairs)
    other = None if beside is None else named_law(beside)

    def loop_of(gains: Array, of: Any = plant) -> ClosedLoop:
        law = RateFeedback(_table(chosen, gains), cutoff=cutoff).sampled(period)
        return closed_loop(of, law if other is None else side_by_side([other, law]), period=period, delay=delay)

    search = _Search(loop_of, len(chosen), margin, np.inf if largest is None else largest)
    start = _Tried(np.zeros(len(chosen)), search.vibrations(frequencies))
    best = search.best(start)
    before, after = (np.array([damped_frequency(complex(z), period) for z in each.poles]).T for each in (start, best))
    return RateGains(
        _table(chosen, best.gains), after[0], before[0], after[1], before[1], search.radius(best.gains),
        search.bound(best), loop_of(best.gains, model), cutoff,
    )  # fmt: skip


class _Tried(NamedTuple):
    """Gains (pairs,) and the poles z (k,) of the vibrations with them."""

    gains: Array
    poles: Complex


class _Search:
    """Search for the gains, with A = A_0 + sum of g_i A_i from the loops with one unit gain at a time."""

    def __init__(self, loop_of: Callable[[Array], ClosedLoop], count: int, margin: float, largest: float) -> None:
        none = loop_of(np.zeros(count))
        self._period: float = none.plant.period
        self._A: Array = none.A
        self._each: Array = np.array([loop_of(row).A - self._A for row in np.eye(count)])
        self._margin, self._largest = margin, largest
        self._slowest: float = self.radius(np.zeros(count))
        if self._slowest > 1.0 + _ON_CIRCLE:
            raise InputError(
                f"is unstable without gains: |z| = {self._slowest:.6g}", field="model",
                remedy="give a controller that makes it stable: beside=...",
            )  # fmt: skip

    def _of(self, gains: Array) -> Array:
        return self._A + np.tensordot(gains, self._each, 1)

    def radius(self, gains: Array) -> float:
        """Return the largest magnitude of the poles that do not belong to free motions."""
        z = np.linalg.eigvals(self._of(gains))
        return float(np.max(np.abs(z[np.abs(z - 1.0) > _FREE]), initial=0.0))

    def _stable(self, gains: Array) -> bool:
        """Whether no pole is slower than without gains, and the loop with gains multiplied by the margin is stable."""
        slow = self.radius(gains) > self._slowest + _ON_CIRCLE
        return not slow and self.radius(self._margin * gains) <= 1.0 + _ON_CIRCLE

    def _allowed(self, gains: Array) -> bool:
        return bool(np.max(np.abs(gains)) <= self._largest) and self._stable(gains)

    def vibrations(self, frequencies: Sequence[float] | None) -> Complex:
        """Return poles without gains: nearest to frequencies [Hz], or those that decay slowest, one for each pair."""
        z = np.linalg.eigvals(self._A)
        z = z[(z.imag > _FREE) & (np.abs(z) > _FREE)].astype(complex)
        if not z.size:
            raise InputError("has no vibration", field="model", remedy="give one with flexible links")
        each = np.array([damped_frequency(complex(one), self._period)[0] for one in z])
        if frequencies is not None:
            return z[_nearest(each, frequencies)]
        decay = -np.log(np.abs(z))
        # Equally slow poles are ordered by frequency: without damping, only rounding distinguishes their decay rates.
        steps = np.round(np.log(np.maximum(decay, _ON_CIRCLE)) / _AS_SLOW)
        return z[np.lexsort([each, steps])[: len(self._each)]]

    def least(self, tried: _Tried) -> float:
        """Return the least damping ratio of the vibrations."""
        return min(damped_frequency(complex(z), self._period)[1] for z in tried.poles)

    def _derivatives(self, at: _Tried) -> tuple[Complex, Array]:
        """Return dz/dg (k, pairs) of simple poles, and the distance of each from the nearest other pole."""
        z, left, right = scipy.linalg.eig(self._of(at.gains), left=True)
        slopes, room = [], []
        for pole in at.poles:
            k = int(np.argmin(np.abs(z - pole)))
            w, v = left[:, k].conj(), right[:, k]
            slopes.append((w @ self._each @ v) / (w @ v))
            room.append(np.min(np.delete(np.abs(z - z[k]), k), initial=np.inf))
        return np.array(slopes), np.array(room)

    def _follow(self, start: _Tried, gains: Array, halved: int = 0) -> _Tried:
        """Return the poles at other gains, followed continuously; a step that is too large is halved."""
        slopes, room = self._derivatives(start)
        expected = start.poles + slopes @ (gains - start.gains)
        z = np.linalg.eigvals(self._of(gains))
        apart = np.abs(z[None] - expected[:, None])
        rows, columns = scipy.optimize.linear_sum_assignment(apart)
        if halved >= _HALVED or np.all(apart[rows, columns] <= _NEAR * room):
            return _Tried(gains, z[columns].astype(complex))
        middle = self._follow(start, 0.5 * (start.gains + gains), halved + 1)
        return self._follow(middle, gains, halved + 1)

    def directions(self, at: _Tried) -> Array:
        """Return the derivatives (k, pairs) of the damping ratios -Re s / |s|, with s = ln z / T."""
        slopes, _ = self._derivatives(at)
        s = (np.log(at.poles) / self._period)[:, None]
        ds = slopes / (at.poles[:, None] * self._period)
        return -ds.real / np.abs(s) + s.real * (s.conj() * ds).real / np.abs(s) ** 3

    def best(self, start: _Tried) -> _Tried:
        """Return the gains of largest damping."""
        slopes = self.directions(start)
        if not np.all(np.max(np.abs(slopes), axis=1) > 0.0):
            raise InputError("do not see a vibration, or their motors do not move it", field="pairs",
                             remedy="name other sensors or motors, or other frequencies")  # fmt: skip
        mean = np.mean(slopes, axis=0)
        best = self._along(start, mean / np.sum(mean**2))
        for _ in range(_ROUNDS if len(mean) > 1 else 0):
            before = best
            for k in range(len(mean)):
                best = self._restarted_search(best, k)
            if self.least(best) <= self.least(before) * (1.0 + _GROWS):
                break
        if not np.any(best.gains):
            raise InputError(
                "cannot damp the vibrations: the loop becomes unstable, or a pole slower, first", field="pairs",
                remedy="sample faster, delay less, raise the cut-off, or give links damping",
            )  # fmt: skip
        return best

    def _restarted_search(self, best: _Tried, k: int) -> _Tried:
        """Search the gain of one pair again, from zero on, in both directions."""
        without = best.gains.copy()
        without[k] = 0.0
        if not self._allowed(without):
            return best
        start = self._follow(best, without)
        slope = float(np.max(np.abs(self.directions(start)[:, k])))
        one = np.eye(len(without))[k] / slope if slope else np.zeros(len(without))
        return max([best, *(self._along(start, sign * one) for sign in (1.0, -1.0) if slope)], key=self.least)

    def _along(self, start: _Tried, direction: Array) -> _Tried:
        """Return the largest admissible damping with gains in one direction."""
        tried = [start]
        for part in _TRIED:
            gains = start.gains + part * direction
            allowed = self._allowed(gains)
            if not allowed:
                gains = start.gains + self._border(start.gains, direction, float(part)) * direction
            tried.append(self._follow(tried[-1], gains))
            if not allowed:
                break
        k = int(np.argmax([self.least(one) for one in tried]))
        if k in (0, len(tried) - 1):
            return tried[k]
        low, high = tried[k - 1], tried[k + 1]

        def between(part: float) -> _Tried:
            return self._follow(low, low.gains + part * (high.gains - low.gains))

        part = scipy.optimize.minimize_scalar(lambda part: -self.least(between(part)), bounds=(0.0, 1.0),
                                              method="bounded", options={"xatol": 1e-6}).x  # fmt: skip
        return max([tried[k], between(part)], key=self.least)

    def _border(self, base: Array, direction: Array, beyond: float) -> float:
        """Return the largest admissible multiple of a direction, by bisection below one that is not admissible."""
        low, high = 0.0, beyond
        while high - low > 1e-9 * high:
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self._allowed(base + middle * direction) else (low, middle)
        return low

    def bound(self, best: _Tried) -> str:
        """Return the condition that prevents larger gains."""
        more = (1.0 + 1e-6) * best.gains
        if np.max(np.abs(more)) > self._largest:
            return "largest"
        return "optimum" if self._stable(more) else "margin"


def _nearest(each: Array, frequencies: Sequence[float]) -> list[int]:
    """Return the indices of the vibrations nearest to frequencies [Hz]."""
    found = []
    for frequency in frequencies:
        positive(frequency, "frequencies", "Hz")
        found.append(int(np.argmin(np.abs(each - frequency))))
    if not found or len(set(found)) < len(found):
        raise InputError("no vibration, or one named twice", field="frequencies", value=list(frequencies),
                         remedy=f"choose from {', '.join(f'{one:.4g}' for one in np.sort(each)[:8])} Hz")  # fmt: skip
    return found


def _pairs(model: Any, plant: SampledPlant, given: Mapping[str, str | Sequence[str]] | None) -> list[tuple[str, str]]:
    """Return the pairs of motors and sensors, each once."""
    if given is None:
        given = _collocated(model, plant)
    found = []
    for motor, sensors in given.items():
        known(motor, plant.inputs, "pairs", "motor")
        for sensor in [sensors] if isinstance(sensors, str) else sensors:
            known(sensor, plant.outputs, f"pairs.{motor}", "sensor")
            found.append((motor, sensor))
    if not found:
        raise InputError("there is none", field="pairs", remedy="name the sensor of each motor")
    return list(dict.fromkeys(found))


def _collocated(model: Any, plant: SampledPlant) -> dict[str, str]:
    """Return, by motor, the nearest `StrainGauge` on a link at its joint."""
    linear = model.full if isinstance(model, ReducedModel) else model
    found = {}
    if isinstance(linear, LinearModel):
        mechanism = linear.minimal.system.mechanism
        joints = {one.name: one.joint for one in mechanism.motors}
        near = {name: _nearest_gauge(mechanism, joints[name], plant.outputs) for name in plant.inputs if name in joints}
        found = {motor: gauge for motor, gauge in near.items() if gauge is not None}
    if not found:
        raise InputError("no motor has a strain gauge on a link at its joint", field="pairs",
                         remedy='name the sensor of each motor: pairs={"motor": "sensor"}')  # fmt: skip
    return found


def _nearest_gauge(mechanism: Mechanism, name: str, outputs: Sequence[str]) -> str | None:
    joint, bodies = mechanism.joint(name), {body.name: body for body in mechanism.bodies}
    apart = {}
    for sensor in mechanism.sensors:
        location = sensor.location
        if location.at is not None and sensor.name in outputs:
            points: Any = getattr(bodies[location.frame], "points", {})
            at = [points[one.point] for one in (joint.a, joint.b) if one.body == location.frame]
            if at:
                apart[sensor.name] = min(abs(location.along(points) - place) for place in at)
    return min(apart, key=apart.__getitem__) if apart else None


def _table(pairs: Sequence[tuple[str, str]], gains: Array) -> dict[str, dict[str, float]]:
    table: dict[str, dict[str, float]] = {}
    for (motor, sensor), gain in zip(pairs, gains, strict=True):
        table.setdefault(motor, {})[sensor] = float(gain)
    return table
