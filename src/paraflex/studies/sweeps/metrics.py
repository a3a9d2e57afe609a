"""What a run is judged by in a sweep: one number each, straight from the solution.

A dataset of a run takes longer to make than all of these; metrics of the same name there have the same values.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from paraflex.dynamics import joint_coordinate
from paraflex.dynamics.points import point_motion
from paraflex.errors import IntegrationError, Moment
from paraflex.results.metrics import drift_speed, during_motion, largest, rms, vibration
from paraflex.results.outlines import deflections
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

    @property
    def moving(self) -> NDArray[np.bool_]:
        """Which samples (k,) are of the motion along the path; the others are after it."""
        return during_motion(self.run.solution.t, self.run.task.path.duration)


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
    """Columns of a run that ran to its end, in the order of the names; those per motor are called NAME.MOTOR.

    Raises
    ------
    IntegrationError
        The run stopped before, at the end of a beam say: its numbers are not those of a whole run.
    """
    solution = run.solution
    if solution.event:
        cause = f"the run stopped before its end, at {solution.event}, so that it has no metrics,"
        remedy = 'lengthen the beam, or let runs go on with at_end = "warn"'
        raise IntegrationError(cause, Moment(solution.event_time, solution.steps), run, remedy)
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
    return Traces(run, position, np.hypot(away[:, 0], away[:, 1]), run.applied)


def after_motion(traces: Traces) -> tuple[Array, Array]:
    """Times (j,) of the samples after the motion [s], and where the end-effector is at them (j, 2) [m]."""
    after = ~traces.moving
    return traces.run.solution.t[after], traces.position[after]


def _deflection(traces: Traces) -> float:
    bent = np.abs(deflections(traces.run.task.system, traces.run.solution.q))
    if bent.size == 0:
        return 0.0
    return float(np.nanmax(bent)) if np.isfinite(bent).any() else float("nan")


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
    "tracking_rms_motion": Metric(
        "root mean square distance of the end-effector from its desired place during the motion",
        "m",
        lambda x: rms(x.distance[x.moving]),
    ),
    "tracking_max_motion": Metric(
        "largest distance of the end-effector from its desired place during the motion",
        "m",
        lambda x: largest(x.distance[x.moving]),
    ),
    "tracking_rms_after": Metric(
        "root mean square distance of the end-effector from its desired place after the motion",
        "m",
        lambda x: rms(x.distance[~x.moving]),
    ),
    "tracking_max_after": Metric(
        "largest distance of the end-effector from its desired place after the motion",
        "m",
        lambda x: largest(x.distance[~x.moving]),
    ),
    "tracking_rms": Metric(
        "root mean square distance of the end-effector from its desired place over the whole run, dwell included",
        "m",
        lambda x: rms(x.distance),
    ),
    "tracking_max": Metric(
        "largest distance of the end-effector from its desired place over the whole run",
        "m",
        lambda x: largest(x.distance),
    ),
    "residual_vibration": Metric(
        "root mean square distance of the end-effector from its drift after the motion",
        "m",
        lambda x: vibration(*after_motion(x)),
    ),
    "drift_speed": Metric(
        "mean speed of the end-effector's drift after the motion", "m/s", lambda x: drift_speed(*after_motion(x))
    ),
    "deflection_max": Metric("largest deflection of any body from its chord", "m", _deflection),
    "peak_torque_max": Metric("largest magnitude of any motor's torque", "N m", lambda x: np.max(np.abs(x.torque))),
    "rms_torque_norm": Metric(
        "root mean square of the torques' Euclidean norm",
        "N m",
        lambda x: np.sqrt(np.mean(np.sum(x.torque**2, axis=1))),
    ),
    "peak_torque": Metric(
        "largest magnitude of each motor's torque", "N m", lambda x: np.max(np.abs(x.torque), axis=0), per_motor=True
    ),
    "rms_torque": Metric("root mean square of each motor's torque", "N m", lambda x: rms(x.torque), per_motor=True),
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
