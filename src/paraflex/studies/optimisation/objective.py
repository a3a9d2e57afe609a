"""Objectives and targets: numbers of a design from the metrics of its runs, and their derivatives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from paraflex.arrays import Array
from paraflex.mechanism.quantities import known

WORST, MEAN = "worst", "mean"


class Measured(Protocol):
    """A design with complete runs."""

    def metric(self, column: str) -> Array:
        """A metric of every run, (runs,)."""
        ...


@dataclass(frozen=True)
class Objective:
    """A weighted sum of metrics, and limits of metrics.

    Attributes
    ----------
    weights : mapping of str to float
        By column of the table.
    over : str
        "worst" or "mean": what is taken of a metric's values in all paths and modes.
    relative : bool
        Whether each metric is divided by its value at the start.
    limits : tuple of (str, float)
        Columns and what they are at most, in their units.
    """

    weights: Mapping[str, float]
    over: str = WORST
    relative: bool = True
    limits: tuple[tuple[str, float], ...] = ()

    def __post_init__(self) -> None:
        known(self.over, (WORST, MEAN), "objective.over", "way to take all runs together")

    @property
    def columns(self) -> tuple[str, ...]:
        """Every metric of the objective and its limits, once."""
        return tuple(dict.fromkeys([*self.weights, *(column for column, _ in self.limits)]))

    def metrics(self, design: Measured) -> dict[str, float]:
        """The worst or mean value of every metric."""
        return {column: float(self._shares(design, column) @ design.metric(column)) for column in self.columns}

    def scales(self, start: Measured) -> dict[str, float]:
        """Divisors of metrics, from the design at the start; a metric that is zero there has none."""
        metrics = self.metrics(start)
        return {column: abs(metrics[column]) if self.relative else 1.0 for column in self.weights}

    def value(self, design: Measured, scales: Mapping[str, float]) -> float:
        """Sum of weight times metric over its scale."""
        metrics = self.metrics(design)
        return sum(weight * metrics[column] / scales[column] for column, weight in self.weights.items())

    def slope(self, design: Measured, scales: Mapping[str, float], slopes: Mapping[str, Array]) -> Array:
        """Derivatives of `value`, from those of the metrics (runs, parameters): of the worst run, or the mean."""
        terms = [
            weight / scales[column] * (self._shares(design, column) @ slopes[column])
            for column, weight in self.weights.items()
        ]
        return np.sum(terms, axis=0)

    def room(self, design: Measured) -> Array:
        """Distance of metrics from their limits, relative to the limit (to 1 if it is 0); (limits,)."""
        metrics = self.metrics(design)
        return np.array([(limit - metrics[column]) / (abs(limit) or 1.0) for column, limit in self.limits])

    def room_slope(self, design: Measured, slopes: Mapping[str, Array]) -> Array:
        """Derivatives of `room`, (limits, parameters)."""
        rows = [-(self._shares(design, column) @ slopes[column]) / (abs(limit) or 1.0) for column, limit in self.limits]
        return np.array(rows)

    def violation(self, design: Measured) -> float:
        """Sum of the relative violations of the limits."""
        return float(np.sum(np.maximum(-self.room(design), 0.0)))

    def _shares(self, design: Measured, column: str) -> Array:
        """Contribution of each run to the worst or mean of a metric."""
        values = design.metric(column)
        if self.over == MEAN:
            return np.full(values.size, 1.0 / values.size)
        return np.eye(values.size)[int(np.argmax(values))]


@dataclass(frozen=True)
class Target:
    """A number to be reproduced.

    Attributes
    ----------
    column : str
        Of the table.
    run : int
        Among those of a design: paths, and modes of each.
    path, mode : str
    value : float
        In the metric's unit.
    weight : float
    relative : bool
        Whether its residual is divided by the value.
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
        """Factor of the difference."""
        return self.weight / (abs(self.value) if self.relative else 1.0)

    def residual(self, design: Measured) -> float:
        """Weight times difference of the metric from the target, divided by the target if `relative`."""
        return self.factor * float(design.metric(self.column)[self.run] - self.value)

    def slope(self, slopes: Mapping[str, Array]) -> Array:
        """Derivatives of `residual`, (parameters,)."""
        return self.factor * slopes[self.column][self.run]

    def to_dict(self) -> dict[str, Any]:
        """The target in plain values."""
        return {"path": self.path, "mode": self.mode, "metric": self.column, "value": self.value}
