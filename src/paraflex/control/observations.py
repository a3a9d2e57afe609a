"""Observations of an agent: readings, optionally less the planned readings, and a preview of the plan."""

from collections.abc import Mapping, Sequence

import numpy as np

from paraflex.arrays import Array
from paraflex.errors import InputError
from paraflex.mechanism import Mechanism
from paraflex.mechanism.measured import encoders_of
from paraflex.mechanism.quantities import all_known, known
from paraflex.tracking import TrackingTask
from .laws.estimators import rounded
from .loop.references import readings_of
from .loop.simulation import Simulation

# Observations are clipped to this magnitude, as observation spaces must be bounded; readings of a run that has not
# diverged stay far below.
WIDEST = 1e6


class Observer:
    """Observation function of an environment.

    Parameters
    ----------
    mechanism : Mechanism
        Mechanism whose sensors are observed.
    task : TrackingTask or None
        Plan; None without a path.
    names : tuple of str
        Names of the sensors.
    times : (k,) array
        Times of the observations [s].
    errors : bool
        Whether the planned readings are subtracted, for sensors whose readings follow from the plan.
    ahead : sequence of float
        Preview times [s]: the change of the planned readings over each of them is observed as well.
    noise, quantise, scales : mapping of str to float
        Standard deviation of noise, resolution, and reading that is observed as one, by sensor and in its unit.

    Attributes
    ----------
    names : tuple of str
        Names of the observed values: sensors, then the planned readings with their preview time, such as "x+0.01".

    Raises
    ------
    InputError
        A preview without a plan, preview times that are not positive, or values for sensors that are not observed.
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
            # After the end of the plan, the readings are those at its end.
            motions = (task.plan.follow(np.minimum(times + time, task.motion.t[-1])) for time in (0.0, *ahead))
            now, *later = (readings_of(motion, mechanism, names) for motion in motions)
            planned = [k for k, name in enumerate(names) if name in now]
            if errors:
                self._planned[:, planned] = np.stack(list(now.values()), axis=1) if now else 0.0
            changes = [each[name] - now[name] for each in later for name in now]
            self._changes = np.stack(changes, axis=1) if changes else self._changes
            scale = np.concatenate([scale, *(scale[planned] for _ in ahead)])
            self.names = (*names, *(f"{name}+{time:g}" for time in ahead for name in now))
        self._scale = scale

    def __call__(self, k: int, readings: Mapping[str, float], random: np.random.Generator) -> Array:
        """Return the observation (names,) at instant k from the readings of all sensors, with noise from `random`."""
        y = np.array([readings[name] for name in self._sensors])
        if np.any(self._deviations):
            y += self._deviations * random.standard_normal(y.size)
        y = rounded(y, self._resolution)
        seen = np.concatenate([y - self._planned[k], self._changes[k]]) / self._scale
        return np.clip(seen, -WIDEST, WIDEST)


def observed_sensors(given: Sequence[str] | None, simulation: Simulation) -> tuple[str, ...]:
    """Return the given names of sensors, by default those of the motors' encoders and of the end-effector's x and y.

    Raises
    ------
    InputError
        Unknown sensors.
    """
    if given is not None:
        all_known(given, simulation.sensors_read, "sensors", "sensor")
        return tuple(given)
    mechanism, effector = simulation.mechanism, simulation.mechanism.end_effector
    joints = encoders_of(mechanism, simulation.motors)
    axes = [] if effector is None else [axis for axis in ("x", "y") if axis in effector.coordinates]
    return tuple(dict.fromkeys([*joints, *axes]))


def _by_sensor(given: Mapping[str, float] | None, names: tuple[str, ...], field: str, otherwise: float) -> Array:
    """Return one positive number for each sensor (names,), with a default for sensors that are not given."""
    for name, value in (given or {}).items():
        known(name, names, field, "observed sensor")
        if not (np.isfinite(value) and value > 0.0):
            raise InputError("not a positive number", field=f"{field}.{name}", value=value,
                             remedy="give one in the unit of the sensor, or leave it out")  # fmt: skip
    return np.array([(given or {}).get(name, otherwise) for name in names], dtype=float)
