"""Inputs of a run, values and sizes of its parameters, and checks that derivatives exist."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from paraflex.actuation import FeedForward, actuation_condition
from paraflex.arrays import Array
from paraflex.designs.measure import check_smooth, metric_of
from paraflex.designs.run import Task
from paraflex.designs.setting import INTEGRATION, Setting
from paraflex.dynamics import pack_signals
from paraflex.errors import InputError
from paraflex.files import Model
from paraflex.files.overlay import Place, number_at
from paraflex.integrators import IntegrationOptions
from paraflex.integrators.run import Problem, make_problem
from paraflex.integrators.sensitivity import check_differentiable
from paraflex.tracking import TrackingTask, path_stops

# Integration options that determine the steps of a run; derivatives are for fixed steps.
_STEP_OPTIONS = ("tolerance", "step")


@dataclass(frozen=True)
class RunInputs:
    """Inputs of the run of one mode.

    Attributes
    ----------
    task : TrackingTask
        Planned motion.
    options : IntegrationOptions
        Integration options.
    torques : FeedForward
        Feed-forward torques.
    condition : (k,) array
        Condition number of the actuation matrix.
    problem : Problem
        Initial-value problem.
    """

    task: TrackingTask
    options: IntegrationOptions
    torques: FeedForward
    condition: Array
    problem: Problem


def nominal_values(setting: Setting, chosen: Collection[str] = ()) -> tuple[float, ...]:
    """Return the values of the parameters in the mechanism's file, or in the study's [integration] table.

    Parameters
    ----------
    setting : Setting
        Common settings of the study.
    chosen : collection of str
        Names of parameters with a value from elsewhere, for which NaN is returned.

    Raises
    ------
    InputError
        Several fields of one parameter have different values.
    """
    return tuple(
        float("nan") if name in chosen else _nominal(setting, name, places)
        for name, places in zip(setting.names, setting.places, strict=True)
    )


def size_of(setting: Setting, task: Task, k: int, size: float | None = None) -> float:
    """Return the size of parameter k, to which difference steps are relative: by default the magnitude of its value.

    Raises
    ------
    InputError
        Runs are not differentiable by the parameter, or it is zero and no size is given.
    """
    name, value = setting.names[k], task.values[k]
    where = f"vary.{name}"
    if setting.whole[k] or any(place[0] == INTEGRATION and place[1] in _STEP_OPTIONS for place in setting.places[k]):
        raise InputError("has no derivative", field=where, value=value, remedy="leave it out")
    size = abs(value) if size is None else abs(size)
    if not size > 0.0:
        raise InputError(
            "is zero, so steps of differences have no size", field=where, value=value,
            remedy="give low and high, whose distance is its size",
        )  # fmt: skip
    return size


def check_has_path(setting: Setting) -> None:
    """Check that runs are along paths; the derivative of the start of other runs is not implemented.

    Raises
    ------
    InputError
        The study has no path, or is of statics.
    """
    if not setting.has_path:
        why = "not of statics" if setting.statics else "which the mechanism does not have"
        raise InputError(
            f"derivatives need runs along a path, {why}", field="mechanism", value=setting.source,
            remedy="take a sweep, or an optimisation with differences",
        )  # fmt: skip


def check_open_and_whole(model: Model) -> None:
    """Check that runs of a design have only planned torques, unshaped and without controllers, and unreduced bodies."""
    if model.acting():
        raise InputError(
            "derivatives need runs without controllers", field="study.controllers",
            value=", ".join(model.study.controllers), remedy="leave them out",
        )  # fmt: skip
    if model.study.shaper is not None:
        raise InputError(
            "derivatives need runs whose torques are not shaped", field="study.shaper",
            value=model.study.shaper.kind.value, remedy="leave it out, or shape the path",
        )  # fmt: skip
    if model.study.reduced:
        raise InputError(
            "derivatives need runs with all flexible coordinates", field="study.reduced", value=model.study.reduced,
            remedy='leave it out, or write reduction = "craig-bampton" and modes in the tables of beams',
        )  # fmt: skip


def check_differentiable_study(setting: Setting, values: Sequence[float], columns: Collection[str]) -> None:
    """Check that metrics of a design's runs have exact derivatives with respect to all parameters.

    Parameters
    ----------
    setting : Setting
        Common settings of the study.
    values : sequence of float
        Values of the parameters of the design.
    columns : collection of str
        Metrics, those of each motor as NAME.MOTOR.

    Raises
    ------
    InputError
        The mechanism has no path, or a metric, the integration method or a parameter is not differentiable.
    """
    check_has_path(setting)
    check_smooth(tuple(metric_of(column).name for column in columns))
    model, options = setting.design(tuple(values))
    check_differentiable(options)
    check_open_and_whole(model)
    for k in range(len(setting.names)):
        size_of(setting, Task(0, 0, tuple(values), setting.paths[0]), k, 1.0)


def run_inputs(planned: TrackingTask, options: IntegrationOptions, torques: FeedForward) -> RunInputs:
    """Return the inputs of a run with feed-forward torques, as in `simulate`."""
    times = planned.motion.t
    signals, knots = pack_signals(planned.mechanism, torques.signals, float(times[-1]))
    stops = np.sort(np.concatenate([path_stops(torques.knots, planned.mechanism), knots]))
    problem = make_problem(planned.system, signals, planned.start, times, stops)
    return RunInputs(planned, options, torques, actuation_condition(planned.effort, torques.mode), problem)


def _nominal(setting: Setting, name: str, places: tuple[Place, ...]) -> float:
    values = [_value(setting, place) for place in places]
    if any(value != values[0] for value in values):
        raise InputError(
            "its fields have different values in the mechanism's file, so that there is no nominal one",
            field=f"vary.{name}.fields",
            value=values, remedy=f"write --at {name}=VALUE, or give each a parameter of its own",
        )  # fmt: skip
    return values[0]


def _value(setting: Setting, place: Place) -> float:
    if place[0] == INTEGRATION:
        return float(setting.integration.get(str(place[1]), getattr(IntegrationOptions(), str(place[1])) or 0.0))
    return number_at(setting.data, place)
