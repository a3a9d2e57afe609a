"""Metrics of runs as columns of a table, and as smooth functions of a run near another."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paraflex.equilibria.given import Conditions
from paraflex.equilibria.result import Statics
from paraflex.errors import InputError, IntegrationError, Moment, as_enum, suggestion
from paraflex.integrators.between import COARSE
from paraflex.mechanism import Mechanism
from paraflex.motion import MotionRun
from paraflex.results.following import HEADLINE, ErrorSpan
from paraflex.results.metrics import (
    ALWAYS,
    COORDINATE,
    DIRECTION,
    DRIVE,
    JOINT,
    METRICS,
    MOTION,
    MOTOR,
    PATH,
    STATICS,
    VALIDITY,
    Members,
    Metric,
    metric_name,
    sliding,
)
from paraflex.results.run_traces import MotionTraces, RunTraces, StaticsTraces, run_traces
from paraflex.tracking import TrackingRun
from paraflex.validity import shared_loads, unresolved_loads

Runs = TrackingRun | MotionRun | Statics
RunsTraces = RunTraces | MotionTraces | StaticsTraces
_OF_RUNS = {PATH: "runs along a path", MOTION: "runs without a path", STATICS: "statics"}

# Metrics of loads that redundant constraints may share, and those that short peaks between samples may be missing from.
_SHARED_LOADS = ("drive_torque_max", "drive_power_max", "joint_force_max")
_LARGEST_LOADS = ("stress_max", "safety_factor_min", "section_moment_max", *_SHARED_LOADS)
# Metrics that have derivatives.
SMOOTH = tuple(metric.name for metric in METRICS.values() if metric.smooth)


def metric_of(column: str) -> Metric:
    """The metric of a column."""
    return METRICS[metric_name(column)]


def check_metric(column: str, field: str = "metrics", known: Sequence[str] = tuple(METRICS)) -> None:
    """None if there is such a metric.

    Raises
    ------
    InputError
        There is none; it proposes one of those known.
    """
    name = metric_name(column)
    if name not in METRICS:
        raise InputError("unknown metric", field=field, value=column, remedy=suggestion(name, list(known)))
    metric_of(column)


def members_of(mechanism: Mechanism, given: Conditions | None = None) -> Members:
    """What of a mechanism metrics have a column each of, by name, and of these what slides.

    Motors, drives (prescribed motions) and joints, or of equilibria what is given: named coordinates, and those with a
    stiffness.
    """
    if given is not None:
        straight = tuple(one.name for one in given.coordinates if one.unit == "m")
        found = {COORDINATE: given.coordinates, DIRECTION: given.measured}
        names = {kind: tuple(one.name for one in each) for kind, each in found.items()}
        return names | {sliding(kind): straight for kind in names}
    found = {MOTOR: mechanism.motors, DRIVE: mechanism.prescribed, JOINT: mechanism.joints}
    slides = {joint.name for joint in mechanism.joints if joint.slides}
    return {kind: tuple(one.name for one in each) for kind, each in found.items()} | {
        sliding(kind): tuple(one.name for one in each if getattr(one, "joint", one.name) in slides)
        for kind, each in found.items()
    }


def metrics_of(
    names: Sequence[str], error: ErrorSpan | str, mechanism: Mechanism | None = None, runs: str = PATH
) -> tuple[str, ...]:
    """Metrics in the given order; if none is given those that are kept of such runs, with the ranking error first.

    Parameters
    ----------
    names : sequence of str
    error : ErrorSpan or str
        The tracking error that ranks runs along a path.
    mechanism : Mechanism, optional
        Of the runs: without motors no metrics of these are kept.
    runs : str
        "path", "motion" or "statics".

    Raises
    ------
    InputError
        An unknown name, or one that such runs do not have.
    """
    for name in names:
        check_metric(name)
        if name not in METRICS:
            raise InputError(
                f"a metric of each {metric_of(name).each or 'run'} is kept of all", field="metrics", value=name,
                remedy=f'say "{metric_of(name).name}"',
            )  # fmt: skip
        if runs not in METRICS[name].runs:
            raise InputError(
                f"a metric of {' or '.join(_OF_RUNS[each] for each in METRICS[name].runs)}, not of "
                f"{_OF_RUNS[runs]}, which this study is of", field="metrics", value=name,
                remedy="choose from " + ", ".join(each.name for each in METRICS.values() if runs in each.runs),
            )  # fmt: skip
    if names:
        return tuple(dict.fromkeys([*names, *ALWAYS[runs]]))
    motors = mechanism is None or mechanism.motors
    kept = [one.name for one in METRICS.values() if one.is_kept_of(runs) and (motors or not one.of_motors)]
    # First what such runs are made for.
    first = {PATH: [HEADLINE[as_enum(ErrorSpan, error, "error")]],
             STATICS: [name for name in kept if METRICS[name].runs == (STATICS,)]}.get(runs, [])  # fmt: skip
    return tuple(dict.fromkeys([*first, *kept, *ALWAYS[runs]]))


def metric_columns(run: Runs, names: Sequence[str]) -> tuple[str, ...]:
    """Columns of the metrics by name, NAME.MEMBER for those of each motor, joint or other member."""
    if isinstance(run, Statics):
        members = members_of(run.system.described, run.equations.given)
    else:
        members = members_of(run.system.described if isinstance(run, MotionRun) else run.task.mechanism)
    return tuple(column for name in names for column in METRICS[name].columns(members))


def metric_values(traces: RunsTraces, nominal: RunsTraces, names: Sequence[str]) -> NDArray[Any]:
    """Numbers of `metric_columns` for a run near another."""
    return np.concatenate([np.zeros(0), *(np.ravel(METRICS[name].formula(traces, nominal)) for name in names)])


def measure(run: Runs, names: Sequence[str]) -> dict[str, float | int]:
    """Metrics of a run that ran to its end by column, in the order of the names.

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
    traces = run_traces(run)
    values = zip(metric_columns(run, names), metric_values(traces, traces, names), strict=True)
    return {column: int(value) if metric_of(column).whole else float(value) for column, value in values}


def coarseness(run: Runs, names: Sequence[str]) -> str:
    """Why metrics of loads may be off: peaks between samples, errors of integration, shared loads; or nothing."""
    found = [one for one in run.solution.findings if one.code == COARSE] if set(names) & set(_LARGEST_LOADS) else []
    if set(names) & set(_SHARED_LOADS):
        system = run_traces(run).system
        found += [*shared_loads(system, run.solution), *unresolved_loads(system, run.solution)]
    return "; ".join(f"{one.text}; {one.remedy}" for one in found)


def coarse_runs(runs: int) -> str:
    """A sentence on runs whose loads `coarseness` doubts."""
    which = "one run has" if runs == 1 else f"{runs} runs have"
    what = "larger between samples, off by errors of integration, or not determined"
    return f"{which} loads that are {what} (column reason)"


def smooth_metrics(names: Sequence[str]) -> tuple[str, ...]:
    """The metrics that have derivatives."""
    return tuple(name for name in names if METRICS[name].smooth)


def check_smooth(names: Sequence[str]) -> None:
    """None if every metric of these names has derivatives.

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


def beyond_limits(runs: int) -> str:
    """A sentence on runs whose validity is above 1."""
    which = "one run is" if runs == 1 else f"{runs} runs are"
    return f"{which} beyond what the model can describe (column {VALIDITY} above 1): use second-order geometry"
