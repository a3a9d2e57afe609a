"""Derivatives of metrics with respect to unit-cube coordinates: finite differences, or exact derivatives of runs."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from paraflex.arrays import Array
from paraflex.campaign import Result, Row
from paraflex.designs.run import Outcome, Task, error_row
from paraflex.designs.setting import Setting
from paraflex.errors import InputError, NumericalError
from .evaluate import Evaluate, EvaluatedDesign
from .study import DesignStudy

EXACT, DIFFERENCES = "exact", "differences"
# Column of the reason why a run has no exact derivatives.
NO_SLOPES = "slope.reason"
# Bounds of the step adapted to noise, as fractions of the ranges; above the upper bound curvature dominates the error.
_LEAST_STEP, _MOST_STEP = 1e-3, 0.05
# Number of closely spaced values from which noise is estimated.
NOISE_POINTS = 8
# Largest ratio of the estimates of three successive orders that agree.
_AGREE = 4.0


def slope_column(column: str, parameter: str) -> str:
    """Return the name of the column of a metric's exact derivative by a parameter."""
    return f"slope.{column}.{parameter}"


# Function that computes, at a complete design, the derivatives of metrics: a (runs, parameters) array for each column.
Slopes = Callable[[EvaluatedDesign], Mapping[str, Array]]


def slopes_of(evaluate: Evaluate) -> Slopes:
    """Return exact derivatives if the evaluator computes them, else finite differences."""
    differing = Differences(evaluate, evaluate.study.search.difference)
    return differing if evaluate.run_slopes is None else ExactSlopes(evaluate, differing)


@dataclass
class Differences:
    """Central differences with the step of the study, or with a step adapted to the noise of its metrics.

    The noise is measured once, at the design where derivatives are first requested. The step that balances relative
    noise against truncation error is the cube root of the noise, for a metric whose scale of variation is the range of
    the parameter (Press et al., Numerical Recipes, 5.7).
    """

    evaluate: Evaluate
    step: float | None

    def __call__(self, at: EvaluatedDesign) -> Mapping[str, Array]:
        """Compute the derivatives; see `Slopes`."""
        if self.step is None:
            self.step = float(np.clip(np.cbrt(relative_noise(self.evaluate, at)), _LEAST_STEP, _MOST_STEP))
        return differences(self.evaluate, at, self.step)


@dataclass
class ExactSlopes:
    """Exact derivatives of the runs, replaced by differences at designs without them; `reasons` holds the reasons."""

    evaluate: Evaluate
    otherwise: Slopes
    reasons: list[str] = field(default_factory=list)

    def __call__(self, at: EvaluatedDesign) -> Mapping[str, Array]:
        """Compute the derivatives; see `Slopes`."""
        study = self.evaluate.study
        names = {column: [slope_column(column, name) for name in study.setting.names] for column in study.columns}
        needed = [name for each in names.values() for name in each]
        if any(not row.get(NO_SLOPES) and any(row.get(name) is None for name in needed) for row in at.rows):
            at = self.evaluate.add_slopes(at)
        for row in at.rows:
            if row.get(NO_SLOPES):
                self.reasons.append(f'mode "{row["mode"]}": {row[NO_SLOPES]}')
                return self.otherwise(at)
        # Scaled to unit-cube coordinates.
        scale = study.per_unit(at.design)
        return {
            column: scale * np.array([[row[name] for name in each] for row in at.rows])
            for column, each in names.items()
        }


def relative_noise(evaluate: Evaluate, at: EvaluatedDesign) -> float:
    """Estimate the largest relative noise of a metric from closely spaced designs on a line; 0 if one does not run."""
    study = evaluate.study
    middle = study.unit(at.design)
    # Along the diagonal, away from the nearer bounds, over the span of the smallest central difference.
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


def differences(evaluate: Evaluate, at: EvaluatedDesign, step: float) -> Mapping[str, Array]:
    """Compute central differences, with all designs evaluated at once.

    The step is a fraction of the range. It should be large compared with the noise from the choice of time steps, and
    small compared with the curvature of the metric. At a bound, or if one of the two designs fails, the difference is
    one-sided; if both fail it is zero.
    """
    study = evaluate.study
    middle = study.unit(at.design)
    sides = np.clip(middle[:, None] + step * np.array([-1.0, 1.0]), 0.0, 1.0)
    done = evaluate([_moved(study, at, k, x) for k in range(middle.size) for x in sides[k]])
    columns = {column: np.zeros((study.base.runs, middle.size)) for column in study.columns}
    for k in range(middle.size):
        usable = [each for each in (done[2 * k], at, done[2 * k + 1]) if each.complete]
        apart = study.unit(usable[-1].design)[k] - study.unit(usable[0].design)[k]
        for column, out in columns.items():
            rise = usable[-1].metric(column) - usable[0].metric(column)
            out[:, k] = rise / apart if apart > 0.0 else 0.0
    return columns


def _moved(study: DesignStudy[Result], at: EvaluatedDesign, k: int, place: float) -> tuple[float, ...]:
    """Return a design with one parameter moved to another unit-cube coordinate."""
    if place == study.unit(at.design)[k]:
        return at.design
    moved = study.design(np.full(len(at.design), place))[k]
    return (*at.design[:k], moved, *at.design[k + 1 :])


def no_exact_slopes(study: DesignStudy[Result]) -> str:
    """Return the reason why a study has no exact derivatives; empty if it has them."""
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
    """Compute exact derivatives of metrics, or the reason why there are none, as one row per mode.

    Parameters
    ----------
    columns : tuple of str
        Columns of the metrics to differentiate.
    sizes : tuple of float
        Sizes of the parameters from which the steps are chosen where a parameter is zero.
    setting, task, watch
        See `run_task`; `watch` is not used.
    """
    from paraflex.designs.derivatives.gradient import metric_gradients

    chosen = [size if value == 0.0 else None for size, value in zip(sizes, task.values, strict=True)]
    rows: list[Row] = []
    for mode in setting.modes:
        row: Row = {"path": task.path, "mode": mode, NO_SLOPES: None}
        try:
            ((_, _, slopes),) = metric_gradients(replace(setting, modes=(mode,)), task, sizes=chosen)
            for column in columns:
                found = [float(x) for x in slopes[column]]
                if not np.all(np.isfinite(found)):
                    raise NumericalError(f"the derivative of {column} is not finite")
                row |= {slope_column(column, name): x for name, x in zip(setting.names, found, strict=True)}
        # After any failure of exact derivatives, finite differences are used.
        except Exception as error:
            row[NO_SLOPES] = error_row(error)["reason"]
        rows.append(row)
    return Outcome(task, rows)


def noise_of(values: Array) -> Array:
    """Estimate the standard deviation of the noise in values at closely and equally spaced points.

    Differences of order k of independent noise of variance s^2 have variance s^2 (2k)! / (k!)^2, while those of a
    smooth function vanish with growing k. The noise is given by the first order whose differences change sign and whose
    estimate agrees with those of the next two orders. If there is none, the smallest estimate is a bound (More and
    Wild, Estimating computational noise, SIAM J. Sci. Comput. 33, 2011).

    Parameters
    ----------
    values : (points, ...) array
        Values at the points; the noise of each component is estimated separately.
    """
    return np.apply_along_axis(_noise, 0, values)


def _noise(values: Array) -> float:
    estimates, changes, rest, factor = [], [], values, 1.0
    for order in range(1, values.size):
        rest = np.diff(rest)
        factor *= 0.5 * order / (2.0 * order - 1.0)
        estimates.append(float(np.sqrt(factor * np.mean(rest**2))))
        changes.append(bool(rest.min() < 0.0 < rest.max()))
    for k in range(len(estimates) - 2):
        three = estimates[k : k + 3]
        if changes[k] and max(three) <= _AGREE * min(three):
            return estimates[k]
    return min(estimates)
