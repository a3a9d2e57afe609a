"""Metrics of runs as columns of a table, and as smooth functions of a perturbed run."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from paraflex.arguments import checked_arguments
from paraflex.arrays import NDArray
from paraflex.equilibria.result import Statics
from paraflex.errors import InputError, IntegrationError, Moment, as_enum, renamed, suggestion
from paraflex.expressions.evaluate import expressed_in
from paraflex.integrators.between import COARSE
from paraflex.mechanism import Mechanism
from paraflex.mechanism.quantities import all_listed
from paraflex.motion import MotionRun
from paraflex.results.following import HEADLINE, ErrorSpan
from paraflex.results.metric_expressions import dotted_names, parsed
from paraflex.results.metrics import (
    ALWAYS,
    METRICS,
    MOTION,
    PATH,
    STATICS,
    VALIDITY,
    Metric,
    MetricMembers,
    has_loads,
    metric_name,
)
from paraflex.results.numbers import finite_or_none
from paraflex.results.run_traces import MotionTraces, RunTraces, StaticsTraces, run_traces
from paraflex.tracking import TrackingRun
from paraflex.validity import shared_loads, unresolved_loads

Runs = TrackingRun | MotionRun | Statics
RunsTraces = RunTraces | MotionTraces | StaticsTraces
_OF_RUNS = {PATH: "runs along a path", MOTION: "runs without a path", STATICS: "statics"}

# Metrics of loads that redundant constraints may share, and those that may miss short peaks between samples.
_SHARED_LOADS = ("drive_torque_max", "drive_power_max", "joint_force_max")
_LARGEST_LOADS = ("stress_max", "safety_factor_min", "section_moment_max", *_SHARED_LOADS)
# Metrics that are differentiable.
SMOOTH = tuple(metric.name for metric in METRICS.values() if metric.smooth)


def metric_of(column: str) -> Metric:
    """Return the metric of a column."""
    return METRICS[metric_name(column)]


def check_metric(
    column: str, field: str = "metrics", known: Sequence[str] = tuple(METRICS), members: MetricMembers | None = None
) -> None:
    """Check that the metric of a column exists.

    Parameters
    ----------
    column : str
        Metric, or column NAME.MEMBER.
    field : str
        Field of the error.
    known : sequence of str
        Names that the error suggests; by default those of all metrics.
    members : MetricMembers, optional
        Members of the mechanism, in which the quantities of an expression are looked up before its units.

    Raises
    ------
    InputError
        The metric does not exist.
    """
    name = metric_name(column)
    if name not in METRICS:
        remedy = suggestion(name, list(known))
        if name != column:
            near = f"; else {remedy}" if remedy.startswith("did") else ""
            remedy = f"a quantity of a run needs a function of its samples, as max(abs({column})){near}"
        raise InputError("unknown metric", field=field, value=column, remedy=remedy)
    with renamed(field, only="metrics"):
        try:
            _ = METRICS[name]
        except InputError:
            if members is not None:
                list(map(members.quantity, dotted_names(name)))
            raise


def metrics_of(
    names: Sequence[str],
    error: ErrorSpan | str,
    mechanism: Mechanism | None = None,
    runs: str = PATH,
    duration: float | None = None,
) -> tuple[str, ...]:
    """Return the metrics of a study in the given order, followed by those that are always kept.

    Parameters
    ----------
    names : sequence of str
        Names of the metrics; if empty, those kept by default for such runs, with the ranking error first.
    error : ErrorSpan or str
        Tracking error that ranks runs along a path.
    mechanism : Mechanism, optional
        Mechanism of the runs; without motors, metrics of motors are not kept by default.
    runs : str
        Kind of runs: "path", "motion" or "statics".
    duration : float, optional
        Duration of the runs [s], within which windows of expressions must lie.

    Raises
    ------
    InputError
        A name is unknown, such runs do not have the metric, or an expression does not fit the mechanism.
    """
    members = None if mechanism is None or runs == STATICS else MetricMembers(mechanism)
    own = [one.name for one in METRICS.values() if runs in one.runs]
    for name in names:
        check_metric(name, known=own, members=members)
        if name not in METRICS:
            raise InputError(
                f"a metric of each {metric_of(name).each or 'run'} is kept of all", field="metrics", value=name,
                remedy=f'write "{metric_of(name).name}"',
            )  # fmt: skip
        if members is not None:
            METRICS[name].columns(members)
            check_window(name, duration)
        if runs not in METRICS[name].runs:
            raise InputError(
                f"a metric of {' or '.join(_OF_RUNS[each] for each in METRICS[name].runs)}, not of "
                f"{_OF_RUNS[runs]}, which this study is of", field="metrics", value=name,
                remedy="choose from " + ", ".join(each.name for each in METRICS.values() if runs in each.runs),
            )  # fmt: skip
    if names:
        return tuple(dict.fromkeys([*names, *ALWAYS[runs]]))
    motors = mechanism is None or mechanism.motors
    known = [one for one in METRICS.values() if runs in (one.runs if one.kept_of is None else one.kept_of)]
    kept = [one.name for one in known if motors or not one.of_motors]
    # The metrics for which such runs are made come first.
    first = {PATH: [HEADLINE[as_enum(ErrorSpan, error, "error")]],
             STATICS: [name for name in kept if METRICS[name].runs == (STATICS,)]}.get(runs, [])  # fmt: skip
    return tuple(dict.fromkeys([*first, *kept, *ALWAYS[runs]]))


def check_window(name: str, duration: float | None) -> None:
    """Check that the windows of a metric by expression lie within runs of a duration [s], if it is known."""
    if duration is not None and "(" in name:
        with expressed_in("metrics", name):
            parsed(name).check_windows(duration)


def metric_columns(run: Runs, names: Sequence[str]) -> tuple[str, ...]:
    """Return the columns of metrics: NAME, or NAME.MEMBER for those of each motor, joint or other member."""
    members = _members(run)
    return tuple(column for name in names for column in METRICS[name].columns(members))


def _members(run: Runs) -> MetricMembers:
    if isinstance(run, Statics):
        return MetricMembers(run.system.described, run.equations.conditions)
    return MetricMembers(run.system.mechanism if isinstance(run, MotionRun) else run.task.mechanism)


def metric_values(traces: RunsTraces, nominal: RunsTraces, names: Sequence[str]) -> NDArray[Any]:
    """Return the values of `metric_columns` for a run, with maxima and signs decided by a nominal run."""
    return np.concatenate([np.zeros(0), *(np.ravel(METRICS[name].formula(traces, nominal)) for name in names)])


def measure(run: Runs, names: Sequence[str]) -> dict[str, float | int]:
    """Return the metrics of a complete run by column, in the order of the names.

    Raises
    ------
    IntegrationError
        The run was stopped by an event, such as the end of a beam, so that metrics of a whole run do not exist.
    """
    solution = run.solution
    if solution.event:
        cause = f"the run stopped before its end, at {solution.event}, so that it has no metrics,"
        remedy = 'lengthen the beam, or let runs go on with at_end = "warn"'
        raise IntegrationError(cause, Moment(solution.event_time, solution.steps), run, remedy)
    traces = run_traces(run)
    values = zip(metric_columns(run, names), metric_values(traces, traces, names), strict=True)
    return {column: int(value) if metric_of(column).whole else float(value) for column, value in values}


@checked_arguments()
def metrics(run: Runs, names: Sequence[str]) -> dict[str, float | int]:
    """Return metrics of a complete run in SI units, by name or expression, such as "max(abs(stage.T.y))".

    Parameters
    ----------
    run : TrackingRun, MotionRun or Statics
        Run, or equilibria.
    names : sequence of str
        Names of metrics and expressions; see docs/sweeps.md. A metric of each motor, joint or other member has a
        number NAME.MEMBER for each.

    Raises
    ------
    InputError
        Unknown metric, one that such runs do not have, or expression that does not fit the run.
    IntegrationError
        The run was stopped by an event.
    """
    kind = STATICS if isinstance(run, Statics) else MOTION if isinstance(run, MotionRun) else PATH
    metrics_of(names, ErrorSpan.MOTION, _members(run).mechanism, kind)
    return measure(run, names)


def metric_figures(run: Runs, names: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Return metrics of a run as plain values: `value` and `unit` by column; `value` is None if there is none."""
    members, out = _members(run), {}
    complete = run.solution.status == "complete"
    for name in names:
        columns, why = METRICS[name].columns(members), dict[str, str]()
        try:
            found = measure(run, [name]) if complete else {}
        # A window may have no sample; the results of the run are kept all the same.
        except InputError as error:
            found, why = {}, {"reason": error.problem}
        for column in columns:
            value = finite_or_none(found.get(column, float("nan")))
            out[column] = {"value": value, "unit": METRICS[name].unit_of(column, members), **why}
    return out


def coarseness(run: Runs, names: Sequence[str]) -> str:
    """Return the reasons why load metrics are doubtful: peaks between samples, integration errors, shared loads.

    The text is empty if there is no reason.
    """
    expressed = {name for name in names if has_loads(name, _members(run).mechanism)}
    largest = expressed | (set(names) & set(_LARGEST_LOADS))
    found = [one for one in run.solution.findings if one.code == COARSE] if largest else []
    if expressed | (set(names) & set(_SHARED_LOADS)):
        system = run_traces(run).system
        found += [*shared_loads(system, run.solution), *unresolved_loads(system, run.solution)]
    return "; ".join(f"{one.text}; {one.remedy}" for one in found)


def coarse_runs(runs: int) -> str:
    """Return a sentence on the number of runs for whose loads `coarseness` gives a reason."""
    which = "one run has" if runs == 1 else f"{runs} runs have"
    what = "larger between samples, off by errors of integration, or not determined"
    return f"{which} loads that are {what} (column reason)"


def smooth_metrics(names: Sequence[str]) -> tuple[str, ...]:
    """Return the metrics that are differentiable."""
    return tuple(name for name in names if METRICS[name].smooth)


def check_smooth(names: Sequence[str]) -> None:
    """Check that all metrics are differentiable.

    Raises
    ------
    InputError
        A metric is not differentiable, such as one that describes the integration.
    """
    all_listed([name for name in names if not METRICS[name].smooth], SMOOTH, "metrics", "has no derivative")


def beyond_limits(runs: int) -> str:
    """Return a sentence on the number of runs whose validity is above 1."""
    which = "one run is" if runs == 1 else f"{runs} runs are"
    return f"{which} beyond what the model can describe (column {VALIDITY} above 1): use second-order geometry"
