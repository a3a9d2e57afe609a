"""Derivatives of metrics by the place of a design in the unit cube: differences, or exact derivatives of the runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from paraflex.arrays import Array
from paraflex.campaign import Row
from paraflex.campaign.study import Result
from paraflex.designs.run import Outcome, Task, trouble
from paraflex.designs.setting import Setting
from paraflex.errors import InputError, NumericalError
from paraflex.studies.optimisation.evaluate import Evaluate, Evaluated
from paraflex.studies.optimisation.noise import NOISE_POINTS, noise_of
from paraflex.studies.optimisation.study import DesignStudy

EXACT, DIFFERENCES = "exact", "differences"
# Column with the reason why a run has no exact derivatives.
NO_SLOPES = "slope.reason"
# Bounds of a step adapted to noise, as a fraction of the ranges: beyond the upper one curvature dominates.
_LEAST_STEP, _MOST_STEP = 1e-3, 0.05


def slope_column(column: str, parameter: str) -> str:
    """Column of a metric's exact derivative by a parameter."""
    return f"slope.{column}.{parameter}"


class Slopes(Protocol):
    """Derivatives of the metrics of an objective or of targets."""

    def __call__(self, at: Evaluated) -> Mapping[str, Array]:
        """Derivatives by column (runs, parameters), at a complete design."""
        ...


def slopes_of(study: DesignStudy[Result], evaluate: Evaluate) -> Slopes:
    """Derivatives of the kind a study asks for; exact ones if the evaluation has them."""
    differing = Differences(study, evaluate)
    return differing if evaluate.run_slopes is None else ExactSlopes(study, evaluate, differing)


class Differences:
    """Central differences with the step of the study, or one adapted to the noise of its metrics.

    Noise is measured once, where derivatives are first asked for. The step that balances it against what a smooth
    metric bends by, if it bends by itself over a range, is its cubic root (Press et al., Numerical Recipes, 5.7).
    """

    def __init__(self, study: DesignStudy[Result], evaluate: Evaluate) -> None:
        self.study = study
        self.evaluate = evaluate
        self.step = study.search.difference

    def __call__(self, at: Evaluated) -> Mapping[str, Array]:
        """See `Slopes`."""
        if self.step is None:
            self.step = float(np.clip(np.cbrt(relative_noise(self.study, self.evaluate, at)), _LEAST_STEP, _MOST_STEP))
        return differences(self.study, self.evaluate, at, self.step)


@dataclass
class ExactSlopes:
    """Exact derivatives of the runs; differences at designs that have none, with the reasons."""

    study: DesignStudy[Result]
    evaluate: Evaluate
    otherwise: Slopes
    reasons: list[str] = field(default_factory=list)

    def __call__(self, at: Evaluated) -> Mapping[str, Array]:
        """See `Slopes`."""
        if not _has_slopes(self.study, at):
            at = self.evaluate.add_slopes(at)
        for row in at.rows:
            if row.get(NO_SLOPES):
                self.reasons.append(f'mode "{row["mode"]}": {row[NO_SLOPES]}')
                return self.otherwise(at)
        return exact_slopes(self.study, at)


def relative_noise(study: DesignStudy[Result], evaluate: Evaluate, at: Evaluated) -> float:
    """Largest relative noise of a metric, from designs close together on a line."""
    middle = study.unit(at.design)
    # Along the diagonal, inwards; as far in all as the least difference reaches.
    along = np.where(middle > 0.5, -1.0, 1.0) * 2.0 * _LEAST_STEP
    done = evaluate([study.design(middle + share * along) for share in np.linspace(0.0, 1.0, NOISE_POINTS)])
    complete = [each for each in done if each.complete]
    if len(complete) < NOISE_POINTS:
        return 0.0
    noise = 0.0
    for column in study.columns:
        values = np.array([each.metric(column) for each in complete])
        size = np.maximum(np.abs(values).max(axis=0), np.finfo(float).tiny)
        noise = max(noise, float(np.max(noise_of(values) / size)))
    return noise


def differences(study: DesignStudy[Result], evaluate: Evaluate, at: Evaluated, step: float) -> Mapping[str, Array]:
    """Central differences, all of their designs evaluated at once.

    The step is a share of the range: long against what the choice of time steps makes of a metric, short against the
    metric's own bends. At a bound, and beside a design that fails, the difference is one-sided; beside two that fail
    it is zero.
    """
    middle = study.unit(at.design)
    sides = np.clip(middle[:, None] + step * np.array([-1.0, 1.0]), 0.0, 1.0)
    done = evaluate([_moved(study, at, k, x) for k in range(middle.size) for x in sides[k]])
    columns = {column: np.zeros((study.runs, middle.size)) for column in study.columns}
    for k in range(middle.size):
        usable = [each for each in (done[2 * k], at, done[2 * k + 1]) if each.complete]
        apart = study.unit(usable[-1].design)[k] - study.unit(usable[0].design)[k]
        for column, out in columns.items():
            rise = usable[-1].metric(column) - usable[0].metric(column)
            out[:, k] = rise / apart if apart > 0.0 else 0.0
    return columns


def _moved(study: DesignStudy[Result], at: Evaluated, k: int, place: float) -> tuple[float, ...]:
    """A design with one of its numbers changed within its range."""
    if place == study.unit(at.design)[k]:
        return at.design
    moved = study.design(np.full(len(at.design), place))[k]
    return (*at.design[:k], moved, *at.design[k + 1 :])


def exact_slopes(study: DesignStudy[Result], at: Evaluated) -> Mapping[str, Array]:
    """Derivatives in the rows; see `run_slopes`."""
    scale = study.per_unit(at.design)
    return {
        column: scale * np.array([[row[slope_column(column, name)] for name in study.setting.names] for row in at.rows])
        for column in study.columns
    }


def _has_slopes(study: DesignStudy[Result], at: Evaluated) -> bool:
    columns = [slope_column(column, name) for column in study.columns for name in study.setting.names]
    return all(row.get(NO_SLOPES) or all(row.get(each) is not None for each in columns) for row in at.rows)


def no_exact_slopes(study: DesignStudy[Result]) -> str:
    """Reason why a study has no exact derivatives; empty if it has."""
    from paraflex.designs.derivatives.plans import check_differentiable_study

    try:
        check_differentiable_study(study.setting, study.start, study.columns)
    except InputError as error:
        return str(error)
    return ""


def run_slopes(
    columns: tuple[str, ...],
    sizes: tuple[float, ...],
    setting: Setting,
    task: Task,
    watch: Callable[[float], None] | None = None,
) -> Outcome:
    """Exact derivatives of some metrics, or the reason why there are none, one row per mode.

    Parameters
    ----------
    columns : tuple of str
    sizes : tuple of float
        What steps of parameters are parts of where these are zero.
    setting, task, watch
        See `run_task`.
    """
    from paraflex.designs.derivatives.gradient import metric_gradients

    single = {mode: replace(setting, modes=(mode,)) for mode in setting.modes}
    chosen = [size if value == 0.0 else None for size, value in zip(sizes, task.values, strict=True)]
    rows: list[Row] = []
    for mode, alone in single.items():
        row: Row = {"path": task.path, "mode": mode, NO_SLOPES: None}
        try:
            ((_, _, slopes),) = metric_gradients(alone, task, sizes=chosen)
            for column in columns:
                found = [float(x) for x in slopes[column]]
                if not np.all(np.isfinite(found)):
                    raise NumericalError(f"the derivative of {column} is not finite")
                row |= {slope_column(column, name): x for name, x in zip(setting.names, found, strict=True)}
        # Any failure of exact derivatives is replaced by differences.
        except Exception as error:
            row[NO_SLOPES] = trouble(error)["reason"]
        rows.append(row)
    return Outcome(task, rows)
