"""What a run is judged by in a sweep: one number each, straight from the solution.

A dataset of a run takes longer to make than all of these; metrics of the same name there have the same values.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from paraflex.dynamics import joint_coordinate
from paraflex.results.motion import point_motion, tip_deflection
from paraflex.simulate import TrackingRun

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Traces:
    """What metrics are made of, at the k samples of a run that ran to its end.

    Attributes
    ----------
    run : TrackingRun
    position : (k, 2) array
        Of the end-effector [m].
    distance : (k,) array
        Of the end-effector from its desired place [m].
    torque : (k, motors) array
        [N m], or [N] of motors that slide.
    """

    run: TrackingRun
    position: Array
    distance: Array
    torque: Array


@dataclass(frozen=True)
class Metric:
    """A number that a run is judged by.

    Attributes
    ----------
    meaning, unit : str
    value : callable
        From `Traces`; a metric per motor gives one number each.
    per_motor : bool
    whole : bool
        Whether it is a count.
    """

    meaning: str
    unit: str
    value: Callable[[Traces], float | Array]
    per_motor: bool = False
    whole: bool = False


def measure(run: TrackingRun, names: tuple[str, ...]) -> dict[str, float | int]:
    """Columns of a run that ran to its end, in the order of the names; those per motor are called NAME.MOTOR."""
    traces = make_traces(run)
    motors = [motor.name for motor in run.task.mechanism.motors]
    out: dict[str, float | int] = {}
    for name in names:
        metric = METRICS[name]
        value = metric.value(traces)
        if metric.per_motor:
            out |= {f"{name}.{motor}": float(each) for motor, each in zip(motors, np.asarray(value), strict=True)}
        else:
            out[name] = int(value) if metric.whole else float(value)  # pyright: ignore[reportArgumentType]
    return out


def make_traces(run: TrackingRun) -> Traces:
    """Traces of a run that ran to its end."""
    task, q = run.task, run.solution.q
    effector = task.mechanism.end_effector
    assert effector is not None
    position = point_motion(task.system, effector.point, q, run.solution.v, run.solution.a).position
    away = position - task.motion.desired.position
    return Traces(run, position, np.hypot(away[:, 0], away[:, 1]), run.torques.evaluate(task.motion.t))


def _rms(values: Array) -> Array:
    return np.sqrt(np.mean(values**2, axis=0))


def _residual_vibration(traces: Traces) -> float:
    after = traces.position[traces.run.task.motion.t > traces.run.task.path.duration]
    if after.size == 0:
        return float("nan")
    return float(np.sqrt(np.mean(np.sum((after - after.mean(axis=0)) ** 2, axis=1))))


def _deflection(traces: Traces) -> float:
    system, q = traces.run.task.system, traces.run.solution.q
    tips = [tip_deflection(system, body.name, q) for body in system.bodies if body.nf]
    return max((float(np.nanmax(np.hypot(tip[:, 0], tip[:, 1]), initial=0.0)) for tip in tips), default=0.0)


def _motor_energy(traces: Traces) -> float:
    task, solution = traces.run.task, traces.run.solution
    power = np.zeros(solution.t.size)
    for motor, torque in zip(task.mechanism.motors, traces.torque.T, strict=True):
        if motor.name in traces.run.mode.motors:
            rate = joint_coordinate(task.system, motor.joint, solution.q, solution.v).rate
            power += np.abs(torque * rate)
    return float(np.sum(0.5 * (power[1:] + power[:-1]) * np.diff(solution.t)))


# Kept of every run: numbers of a model that does not hold are not to be taken for others.
VALIDITY = "validity"


def beyond_limits(runs: int) -> str:
    """What to tell of runs whose validity is above 1."""
    which = "one run is" if runs == 1 else f"{runs} runs are"
    return f"{which} beyond what the model can describe (column {VALIDITY} above 1): use second-order geometry"


def _validity(traces: Traces) -> float:
    return 0.0 if traces.run.validity is None else traces.run.validity.ratio


METRICS: Mapping[str, Metric] = {
    "tracking_rms": Metric(
        "root mean square distance of the end-effector from its path", "m", lambda x: _rms(x.distance)
    ),
    "tracking_max": Metric("largest such distance", "m", lambda x: np.max(x.distance)),
    "residual_vibration": Metric(
        "root mean square distance of the end-effector from its mean after the motion", "m", _residual_vibration
    ),
    "deflection_max": Metric("largest tip displacement of any body in its frame", "m", _deflection),
    "peak_torque_max": Metric("largest magnitude of any motor's torque", "N m", lambda x: np.max(np.abs(x.torque))),
    "rms_torque_norm": Metric(
        "root mean square of the torques' Euclidean norm",
        "N m",
        lambda x: np.sqrt(np.mean(np.sum(x.torque**2, axis=1))),
    ),
    "peak_torque": Metric(
        "largest magnitude of each motor's torque", "N m", lambda x: np.max(np.abs(x.torque), axis=0), per_motor=True
    ),
    "rms_torque": Metric("root mean square of each motor's torque", "N m", lambda x: _rms(x.torque), per_motor=True),
    "work": Metric("work done on the mechanism until the end", "J", lambda x: x.run.solution.work[-1]),
    "motor_energy": Metric("integral of the magnitudes of all motors' powers, from the samples", "J", _motor_energy),
    "strain_energy_max": Metric("largest strain energy", "J", lambda x: np.max(x.run.solution.strain_energy)),
    "kinetic_energy_max": Metric("largest kinetic energy", "J", lambda x: np.max(x.run.solution.kinetic_energy)),
    "total_mass": Metric("mass of all bodies", "kg", lambda x: x.run.task.system.total_mass),
    "actuation_condition_max": Metric(
        "largest condition number of the actuation matrix", "1", lambda x: np.max(x.run.condition)
    ),
    "constraint_position_max": Metric(
        "largest constraint violation", "m", lambda x: x.run.solution.constraint_position_max
    ),
    "energy_balance_max": Metric("largest imbalance of energy", "J", lambda x: x.run.solution.energy_balance_max),
    VALIDITY: Metric(
        "what the model leaves out, over its limit: it holds up to 1, and 0 where nothing bends", "1", _validity
    ),
    "steps": Metric("accepted steps", "1", lambda x: x.run.solution.steps, whole=True),
    "rejected": Metric("rejected steps", "1", lambda x: x.run.solution.rejected, whole=True),
    "newton_iterations": Metric("Newton iterations", "1", lambda x: x.run.solution.newton_iterations, whole=True),
}
