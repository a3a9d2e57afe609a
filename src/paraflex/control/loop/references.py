"""References that are subtracted from readings: numbers, functions of time, the planned motion, or another run."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from paraflex.actuation import required_effort
from paraflex.arrays import Array
from paraflex.control.laws.controllers import Plant
from paraflex.dynamics.sensors import SensorReader
from paraflex.errors import InputError
from paraflex.mechanism import Mechanism, TimeProfile
from paraflex.mechanism.measured import measured_sensors
from paraflex.mechanism.quantities import all_known
from paraflex.motion import MotionRun
from paraflex.paths import RigidMotion
from paraflex.tracking import TrackingRun
from .together import OPEN_LOOP, PLAN

Reference = Callable[[float], float]


def references(given: Mapping[str, Any] | TrackingRun | MotionRun | str | None, plant: Plant) -> list[Reference | None]:
    """Return the reference of each of a plant's inputs, given as for `SampledController`; None for inputs without one.

    Raises
    ------
    InputError
        An unknown sensor, "plan" or "open-loop" without a plan, or a value that is neither a number nor a function.
    IntegrationError
        The run of "open-loop", without controllers by the default method, cannot continue.
    """
    if given is None:
        return [None] * len(plant.inputs)
    if isinstance(given, str):
        if given == OPEN_LOOP:
            motion = planned_motion(plant)
            assert plant.task is not None
            task = replace(plant.task, motion=motion, effort=required_effort(motion))
            return list(readings_in(task.simulate(plant.mode, warning=False), plant))
        if given != PLAN:
            remedy = f'write "{PLAN}" or "{OPEN_LOOP}", or give a run, or numbers or functions of time by sensor'
            raise InputError("is not a reference", field="reference", value=given, remedy=remedy)
        return list(planned_readings(plant))
    if isinstance(given, TrackingRun | MotionRun):
        return list(readings_in(given, plant))
    all_known(given, plant.inputs, "reference", "sensor")
    return [_reference(given[name], f"reference.{name}") if name in given else None for name in plant.inputs]


def _reference(given: Any, field: str) -> Reference:
    if isinstance(given, TimeProfile):
        return lambda t: float(given.evaluate(np.array([t]))[0][0])
    if callable(given):
        function: Callable[[float], Any] = given
        return lambda t: float(function(t))
    if isinstance(given, int | float | np.floating) and np.isfinite(given):
        value = float(given)
        return lambda t: value
    raise InputError("is not a reference", field=field, value=given, remedy="give a number or a function of time")


class AtSamples:
    """Values (k, ...) at the samples of a controller from its start on, looked up by time; the last value is kept."""

    def __init__(self, plant: Plant, values: Array) -> None:
        self._start, self._period = plant.state.time, plant.period
        self.values: Array = values

    def __call__(self, t: float) -> Any:
        """Return the value at a time [s]."""
        sample = round((t - self._start) / self._period)
        return self.values[min(max(sample, 0), len(self.values) - 1)]


def planned_motion(plant: Plant) -> RigidMotion:
    """Return the rigid motion of a plan at the samples of a controller.

    Raises
    ------
    InputError
        No plan.
    """
    task = plant.task
    if task is None:
        raise InputError("there is no planned motion", field="reference", value=PLAN,
                         remedy="give numbers or functions of time by sensor, or a path to plan along")  # fmt: skip
    end = float(task.motion.t[-1])
    count = int(np.floor((end - plant.state.time) / plant.period * (1.0 + 1e-12))) + 1
    times = plant.state.time + plant.period * np.arange(max(count, 2))
    return task.plan.follow(np.minimum(times, end))


def planned_readings(plant: Plant) -> list[AtSamples | None]:
    """Return planned readings at a controller's samples; None for sensors that the plan does not cover."""
    found = readings_of(planned_motion(plant), plant.mechanism, plant.inputs)
    return [AtSamples(plant, found[name]) if name in found else None for name in plant.inputs]


def readings_in(run: TrackingRun | MotionRun, plant: Plant) -> list[AtSamples]:
    """Return the readings of a controller's sensors in another run at its samples, by linear interpolation.

    Raises
    ------
    InputError
        A sensor that the run's mechanism does not have.
    """
    system, solution = (run.task.system if isinstance(run, TrackingRun) else run.system), run.solution
    sensors = {sensor.name: sensor for sensor in measured_sensors(system.mechanism)}
    all_known(plant.inputs, sensors, "reference", "sensor")
    k = solution.t.size
    reader = SensorReader(system, [sensors[name] for name in plant.inputs])
    values = reader(solution.q, solution.v, solution.a, solution.multipliers, run.applied[:k])
    times = np.arange(plant.state.time, solution.t[-1] + 0.5 * plant.period, plant.period)
    return [AtSamples(plant, np.interp(times, solution.t, column)) for column in values.T]


def readings_of(motion: RigidMotion, mechanism: Mechanism, names: Sequence[str]) -> dict[str, Array]:
    """Return the readings (k,) on a rigid motion by name, of encoders, tachometers and point sensors only."""
    sensors = {sensor.name: sensor for sensor in measured_sensors(mechanism)}
    rigid = [sensors[name] for name in names if sensors[name].rigid]
    system = motion.system
    nothing = np.zeros((motion.t.size, system.m)), np.zeros((motion.t.size, len(system.mechanism.motors)))
    values = SensorReader(system, rigid)(motion.q, motion.v, motion.a, *nothing)
    return {sensor.name: values[:, k] for k, sensor in enumerate(rigid)}
