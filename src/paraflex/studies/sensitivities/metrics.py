"""Metrics as smooth functions of a run near another: what a maximum or a sign decides is decided there."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paraflex.dynamics import joint_coordinate
from paraflex.dynamics.points import point_motion
from paraflex.errors import InputError
from paraflex.results.outlines import deflections
from paraflex.simulate import TrackingRun
from paraflex.studies.sweeps.metrics import METRICS, Traces

Array = NDArray[np.float64]

# Of a run, by what decides at the nominal one: at the sample where that has its maximum, say.
# Sums, products and roots alone: a complex step goes through them.
Smooth = Callable[[Traces, Traces], Any]


def _largest(trace: Callable[[Traces], Array]) -> Smooth:
    """The largest of an array, where it is largest in the nominal run."""

    def value(moved: Traces, nominal: Traces) -> Any:
        at_nominal = trace(nominal)
        return trace(moved).flat[int(np.nanargmax(at_nominal))] if at_nominal.size else float("nan")

    return value


def _largest_magnitudes(moved: Traces, nominal: Traces) -> Array:
    """Of every motor's torque."""
    at, motors = np.argmax(np.abs(nominal.torque), axis=0), np.arange(nominal.torque.shape[1])
    return np.sign(nominal.torque[at, motors]) * moved.torque[at, motors]


def _largest_magnitude(moved: Traces, nominal: Traces) -> Any:
    return _largest_magnitudes(moved, nominal)[int(np.argmax(np.max(np.abs(nominal.torque), axis=0)))]


def _length(away: Array) -> Array:
    """Of vectors (k, 2)."""
    return np.sqrt(away[:, 0] ** 2 + away[:, 1] ** 2)


def _deflection(moved: Traces, nominal: Traces) -> Any:
    """With the sign of the nominal run's."""
    bent = _deflections(nominal)
    if bent.size == 0:
        return 0.0
    if not np.any(np.isfinite(bent)):
        return float("nan")
    at = int(np.nanargmax(np.abs(bent)))
    return np.sign(bent.flat[at]) * _deflections(moved).flat[at]


def _deflections(traces: Traces) -> Array:
    return deflections(traces.run.task.system, traces.run.solution.q)


def _motor_energy(moved: Traces, nominal: Traces) -> Any:
    """With the signs of the nominal run's powers."""
    power = np.sum(np.sign(_powers(nominal)) * _powers(moved), axis=1)
    return np.sum(0.5 * (power[1:] + power[:-1]) * np.diff(moved.run.solution.t))


def _powers(traces: Traces) -> Array:
    """Of all motors, (k, motors); zero of those that are not active."""
    task, solution = traces.run.task, traces.run.solution
    power = np.zeros_like(traces.torque)
    for k, motor in enumerate(task.mechanism.motors):
        if motor.name in traces.run.mode.motors:
            power[:, k] = traces.torque[:, k] * joint_coordinate(task.system, motor.joint, solution.q, solution.v).rate
    return power


def _as_it_is(name: str) -> Smooth:
    return lambda moved, _: METRICS[name].value(moved)


SMOOTH: Mapping[str, Smooth] = {
    "tracking_rms_motion": _as_it_is("tracking_rms_motion"),
    "tracking_max_motion": _largest(lambda x: x.distance[x.moving]),
    "tracking_rms_after": _as_it_is("tracking_rms_after"),
    "tracking_max_after": _largest(lambda x: x.distance[~x.moving]),
    "tracking_rms": _as_it_is("tracking_rms"),
    "tracking_max": _largest(lambda x: x.distance),
    "residual_vibration": _as_it_is("residual_vibration"),
    "drift_speed": _as_it_is("drift_speed"),
    "deflection_max": _deflection,
    "peak_torque_max": _largest_magnitude,
    "rms_torque_norm": _as_it_is("rms_torque_norm"),
    "peak_torque": _largest_magnitudes,
    "rms_torque": _as_it_is("rms_torque"),
    "work": _as_it_is("work"),
    "motor_energy": _motor_energy,
    "strain_energy_max": _largest(lambda x: x.run.solution.strain_energy),
    "kinetic_energy_max": _largest(lambda x: x.run.solution.kinetic_energy),
    "total_mass": lambda moved, _: sum(body.integrals.m for body in moved.run.task.system.bodies),
    "actuation_condition_max": _largest(lambda x: x.run.condition),
}


def smooth_traces(run: TrackingRun) -> Traces:
    """`make_traces` of a run that may have a complex step."""
    task, solution = run.task, run.solution
    effector = task.mechanism.end_effector
    assert effector is not None
    position = point_motion(task.system, effector.point, solution.q, solution.v, solution.a).position
    distance = _length(position - task.motion.desired.position)
    return Traces(run, position, distance, run.torques.evaluate(task.motion.t))


def check_smooth(names: tuple[str, ...]) -> None:
    """Nothing, if every metric of these names has derivatives.

    Raises
    ------
    InputError
        One that counts or measures what the integration did.
    """
    for name in names:
        if name not in SMOOTH:
            raise InputError(
                "has no derivative", field="metrics", value=name, remedy=f"choose from {', '.join(SMOOTH)}"
            )


def columns(run: TrackingRun, names: tuple[str, ...]) -> tuple[str, ...]:
    """Numbers that metrics give by name, NAME.MOTOR of those per motor; metrics without derivatives are left out."""
    motors = [motor.name for motor in run.task.mechanism.motors]
    return tuple(
        column
        for name in names
        if name in SMOOTH
        for column in ([f"{name}.{motor}" for motor in motors] if METRICS[name].per_motor else [name])
    )


def smooth_values(moved: Traces, nominal: Traces, names: tuple[str, ...]) -> Array:
    """Numbers of `columns` of a run near another."""
    values = [np.ravel(SMOOTH[name](moved, nominal)) for name in names if name in SMOOTH]
    return np.concatenate([np.zeros(0), *values])
