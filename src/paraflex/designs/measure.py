"""Metrics of runs as columns of a table, and as smooth functions of a run near another."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paraflex.errors import InputError, IntegrationError, Moment, as_enum, suggestion
from paraflex.results.following import HEADLINE, ErrorSpan
from paraflex.results.metrics import METRICS, VALIDITY, Metric
from paraflex.results.run_traces import run_traces
from paraflex.results.traces import Traces
from paraflex.tracking import TrackingRun

# Metrics that have derivatives.
SMOOTH = tuple(metric.name for metric in METRICS.values() if metric.smooth)


def metric_of(column: str) -> Metric:
    """The metric of a column."""
    return METRICS[column.partition(".")[0]]


def check_metric(column: str, field: str = "metrics", known: Sequence[str] = tuple(METRICS)) -> None:
    """None if there is such a metric.

    Raises
    ------
    InputError
        There is none; it proposes one of those known.
    """
    name = column.partition(".")[0]
    if name not in METRICS:
        raise InputError("unknown metric", field=field, value=column, remedy=suggestion(name, list(known)))


def metrics_of(names: Sequence[str], error: ErrorSpan | str) -> tuple[str, ...]:
    """Metrics in the given order; all if none is given, with the ranking error first.

    Raises
    ------
    InputError
        An unknown name.
    """
    for name in names:
        check_metric(name)
    return tuple(dict.fromkeys([*(names or [HEADLINE[as_enum(ErrorSpan, error, "error")], *METRICS]), VALIDITY]))


def metric_columns(run: TrackingRun, names: Sequence[str]) -> tuple[str, ...]:
    """Columns of the metrics by name, NAME.MOTOR for those per motor."""
    motors = [motor.name for motor in run.task.mechanism.motors]
    return tuple(column for name in names for column in METRICS[name].columns(motors))


def metric_values(traces: Traces, nominal: Traces, names: Sequence[str]) -> NDArray[Any]:
    """Numbers of `metric_columns` for a run near another."""
    return np.concatenate([np.zeros(0), *(np.ravel(METRICS[name].formula(traces, nominal)) for name in names)])


def measure(run: TrackingRun, names: Sequence[str]) -> dict[str, float | int]:
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
