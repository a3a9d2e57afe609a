"""What an agent observes: readings at the instants of its actions, less those of the plan, and the plan ahead."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from paraflex.arrays import Array
from paraflex.control.estimators import rounded
from paraflex.control.references import readings_of
from paraflex.control.simulation import Simulation
from paraflex.errors import InputError
from paraflex.mechanism import Mechanism
from paraflex.mechanism.measured import encoders_of
from paraflex.mechanism.quantities import all_known, known
from paraflex.tracking import TrackingTask

# Observations beyond are cut off there: spaces are to be bounded, and no run that goes on comes near.
WIDEST = 1e6


class Observer:
    """Observations at the instants of an environment.

    Parameters
    ----------
    mechanism : Mechanism
    task : TrackingTask or None
        The plan.
    names : tuple of str
        Sensors.
    times : (k,) array
        Instants [s].
    errors : bool
        Whether readings on the planned motion are taken off, those that it tells.
    ahead : sequence of float
        So much later [s] the plan is shown as well.
    noise, quantise, scales : mapping of str to float
        By sensor, in its unit: standard deviation, resolution, and what is observed as one.

    Attributes
    ----------
    names : tuple of str
        Of what is observed: sensors, then those of the plan with the time ahead, "x+0.01".

    Raises
    ------
    InputError
        A look ahead without a plan, or to times that are not positive; numbers of other sensors.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        task: TrackingTask | None,
        names: tuple[str, ...],
        times: Array,
        *,
        errors: bool,
        ahead: Sequence[float],
        noise: Mapping[str, float] | None,
        quantise: Mapping[str, float] | None,
        scales: Mapping[str, float] | None,
    ) -> None:
        self._sensors = names
        self._deviations = _by_sensor(noise, names, "noise", 0.0)
        self._resolution = _by_sensor(quantise, names, "quantise", 0.0)
        scale = _by_sensor(scales, names, "scales", 1.0)
        if ahead and task is None:
            raise InputError("there is no plan to look ahead in", field="ahead", value=ahead, remedy="leave it out")
        if not all(np.isfinite(time) and time > 0.0 for time in ahead):
            raise InputError("not positive numbers", field="ahead", value=ahead, remedy="give times in seconds")
        self._planned = np.zeros((times.size, len(names)))
        self._changes = np.zeros((times.size, 0))
        self.names: tuple[str, ...] = names
        if task is not None:
            now, *later = (_planned(task, mechanism, names, times + time) for time in (0.0, *ahead))
            told = [k for k, name in enumerate(names) if name in now]
            if errors:
                self._planned[:, told] = np.stack(list(now.values()), axis=1) if now else 0.0
            changes = [each[name] - now[name] for each in later for name in now]
            self._changes = np.stack(changes, axis=1) if changes else self._changes
            scale = np.concatenate([scale, *(scale[told] for _ in ahead)])
            self.names = (*names, *(f"{name}+{time:g}" for time in ahead for name in now))
        self._scale = scale

    def __call__(self, k: int, readings: Mapping[str, float], random: np.random.Generator) -> Array:
        """The observation (names,) at instant k, from readings of all sensors."""
        y = np.array([readings[name] for name in self._sensors])
        if np.any(self._deviations):
            y += self._deviations * random.standard_normal(y.size)
        y = rounded(y, self._resolution)
        seen = np.concatenate([y - self._planned[k], self._changes[k]]) / self._scale
        return np.clip(seen, -WIDEST, WIDEST)


def observed_sensors(given: Sequence[str] | None, simulation: Simulation) -> tuple[str, ...]:
    """Names of sensors to observe; by default encoders of the motors and the end-effector's place.

    Raises
    ------
    InputError
        Unknown ones.
    """
    if given is not None:
        all_known(given, simulation.sensors_read, "sensors", "sensor")
        return tuple(given)
    mechanism, effector = simulation.mechanism, simulation.mechanism.end_effector
    joints = encoders_of(mechanism, simulation.motors)
    axes = [] if effector is None else [axis for axis in ("x", "y") if axis in effector.coordinates]
    return tuple(dict.fromkeys([*joints, *axes]))


def _planned(task: TrackingTask, mechanism: Mechanism, names: tuple[str, ...], times: Array) -> dict[str, Array]:
    """Planned readings (k,) at times (k,), those of the end after it."""
    motion = task.plan.follow(np.minimum(times, task.motion.t[-1]))
    return readings_of(motion, mechanism, names)


def _by_sensor(given: Mapping[str, float] | None, names: tuple[str, ...], field: str, otherwise: float) -> Array:
    """Positive numbers (names,) by sensor, a default for the others."""
    for name, value in (given or {}).items():
        known(name, names, field, "observed sensor")
        if not (np.isfinite(value) and value > 0.0):
            raise InputError("not a positive number", field=f"{field}.{name}", value=value,
                             remedy="give one in the unit of the sensor, or leave it out")  # fmt: skip
    return np.array([(given or {}).get(name, otherwise) for name in names], dtype=float)
