"""Objectives and targets: scalar values of a design from the metrics of its runs, and their derivatives."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from paraflex.arrays import Array, Brief
from paraflex.mechanism.quantities import known
from .evaluate import EvaluatedDesign

WORST, MEAN = "worst", "mean"


@dataclass(frozen=True)
class Objective(Brief):
    """Objective function, a weighted sum of metrics and of squared differences from targets, with limits of metrics.

    Attributes
    ----------
    weights : mapping of str to float
        Weights of the metrics by column of the table.
    over : str
        Aggregation of a metric over all paths and modes: "worst" or "mean".
    relative : bool
        Whether each metric is divided by its value at the start.
    limits : tuple of (str, float)
        Columns and their upper limits, in the units of the metrics.
    targets : tuple of (str, float, float)
        Columns, the values that they shall have, and weights of the squares of their relative differences from these.
    """

    weights: Mapping[str, float]
    over: str = WORST
    relative: bool = True
    limits: tuple[tuple[str, float], ...] = ()
    targets: tuple[tuple[str, float, float], ...] = ()

    def __post_init__(self) -> None:
        known(self.over, (WORST, MEAN), "objective.over", "way to take all runs together")

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns of the objective, its targets and its limits, each once."""
        others = (column for column, *_ in (*self.targets, *self.limits))
        return tuple(dict.fromkeys([*self.weights, *others]))

    def metrics(self, design: EvaluatedDesign) -> dict[str, float]:
        """Compute the worst or mean value of every metric; of one with a target, the worst is the farthest from it."""
        worst = dict.fromkeys(self.columns, 0.0) | {column: self._worst(design, column) for column in self.weights}
        worst |= {column: self._worst(design, column, target) for column, target, _ in self.targets}
        return worst | {column: self._worst(design, column) for column, _ in self.limits}

    def scales(self, start: EvaluatedDesign) -> dict[str, float]:
        """Compute the scales by which metrics are divided, from the design at the start; 1 if not `relative`."""
        return {column: abs(self._worst(start, column)) if self.relative else 1.0 for column in self.weights}

    def value(self, design: EvaluatedDesign, scales: Mapping[str, float]) -> float:
        """Compute the objective: weight times metric divided by its scale, and weight times squared difference."""
        total = sum(weight * self._worst(design, column) / scales[column] for column, weight in self.weights.items())
        for column, target, weight in self.targets:
            off = design.metric(column) / target - 1.0
            total += weight * float(self._shares(np.abs(off)) @ off**2)
        return total

    def slope(self, design: EvaluatedDesign, scales: Mapping[str, float], slopes: Mapping[str, Array]) -> Array:
        """Compute the derivatives of `value` (parameters,) from those of the metrics (runs, parameters)."""
        terms = [
            weight / scales[column] * (self._shares(design.metric(column)) @ slopes[column])
            for column, weight in self.weights.items()
        ]
        for column, target, weight in self.targets:
            off = design.metric(column) / target - 1.0
            terms.append(weight * ((self._shares(np.abs(off)) * 2.0 * off / target) @ slopes[column]))
        return np.sum(terms, axis=0)

    def slack(self, design: EvaluatedDesign) -> Array:
        """Compute the margins of metrics to their limits (limits,), relative to the limit (to 1 if it is 0)."""
        return np.array([(limit - self._worst(design, column)) / (abs(limit) or 1.0) for column, limit in self.limits])

    def slack_gradient(self, design: EvaluatedDesign, slopes: Mapping[str, Array]) -> Array:
        """Compute the derivatives of `slack` (limits, parameters)."""
        rows = [
            -(self._shares(design.metric(column)) @ slopes[column]) / (abs(limit) or 1.0)
            for column, limit in self.limits
        ]
        return np.array(rows)

    def violation(self, design: EvaluatedDesign) -> float:
        """Compute the sum of the relative violations of the limits."""
        return float(np.sum(np.maximum(-self.slack(design), 0.0)))

    def to_dict(self) -> dict[str, Any]:
        """Return the objective as plain values, without targets if it has none."""
        return {name: value for name, value in vars(self).items() if name != "targets" or value} | {
            "weights": dict(self.weights)
        }

    def _worst(self, design: EvaluatedDesign, column: str, target: float | None = None) -> float:
        """Compute the worst or mean value of a metric."""
        values = design.metric(column)
        return float(self._shares(values if target is None else np.abs(values - target)) @ values)

    def _shares(self, values: Array) -> Array:
        """Compute the weight of each run in the worst (largest) or mean of values (runs,)."""
        if self.over == MEAN:
            return np.full(values.size, 1.0 / values.size)
        return np.eye(values.size)[int(np.argmax(values))]


@dataclass(frozen=True)
class Target:
    """Value of a metric to be reproduced by an identification.

    Attributes
    ----------
    column : str
        Column of the metric in the table.
    run : int
        Index of the run among those of a design, which are ordered by path, then by mode.
    path, mode : str
        Names of the path and the mode of the run.
    value : float
        Value to reproduce, in the unit of the metric.
    weight : float
        Weight of the residual.
    relative : bool
        Whether the residual is divided by the absolute value of `value`.
    """

    column: str
    run: int
    path: str
    mode: str
    value: float
    weight: float = 1.0
    relative: bool = True

    @property
    def factor(self) -> float:
        """Factor of the difference in the residual."""
        return self.weight / (abs(self.value) if self.relative else 1.0)

    def residual(self, design: EvaluatedDesign) -> float:
        """Compute weight times metric minus target value, divided by the absolute target value if `relative`."""
        return self.factor * float(design.metric(self.column)[self.run] - self.value)

    def slope(self, slopes: Mapping[str, Array]) -> Array:
        """Compute the derivatives of `residual` (parameters,) from those of the metrics (runs, parameters)."""
        return self.factor * slopes[self.column][self.run]
