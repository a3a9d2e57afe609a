"""Optimisation problem as functions on the unit cube, defined everywhere, even for designs that do not run."""

from collections.abc import Mapping, Sequence
from functools import cached_property

import numpy as np

from paraflex.arrays import Array
from paraflex.campaign.study import Result
from paraflex.errors import InputError
from .evaluate import Evaluate, EvaluatedDesign
from .objective import Objective
from .slopes import Slopes, slopes_of
from .study import DesignStudy

# Relative violation of a limit that is tolerated.
_LIMIT_EXCESS = 1e-6
# Cost of a design that violates a limit, and of one that does not run, as multiples of the objective at the start.
_OUTSIDE, _FAILED = 1e2, 1e4
# Cost of a failed design for gradient-based methods. They accept no design worse than the start, and a larger value
# would spoil their approximation of the curvature.
_REFUSED = 3.0


class DesignProblem:
    """Objective and limits as functions on the unit cube.

    Parameters
    ----------
    objective : Objective
        Objective function and limits.
    evaluate : Evaluate
        Evaluator of designs.

    Raises
    ------
    InputError
        Start that cannot be run, or metric that is zero at the start and therefore cannot serve as a scale.
    """

    def __init__(self, objective: Objective, evaluate: Evaluate) -> None:
        self.study: DesignStudy[Result] = evaluate.study
        self.evaluate = evaluate
        self.slopes: Slopes = slopes_of(evaluate)
        self.objective = objective
        self.scales: Mapping[str, float] = objective.scales(running_start(evaluate))
        for column, scale in self.scales.items():
            if scale == 0.0:
                raise InputError(
                    "the metric is zero at the start, so nothing can be relative to it",
                    field=f"objective.minimise.{column}", remedy="write relative = false",
                )  # fmt: skip
        self.start: Array = self.study.unit(self.study.start)
        # The gradient at a failed design points away from the last successful one.
        self._safe = self.start

    @cached_property
    def cost(self) -> float:
        """Absolute objective at the start, or 1 if that is 0: the scale of penalties and of tolerances."""
        (start,) = self.evaluate([self.study.start])
        return abs(self.objective.value(start, self.scales)) or 1.0

    def scores(self, places: Sequence[Array]) -> list[float]:
        """Compute the objective, with penalties for violated limits and failed designs, for gradient-free methods."""
        return [self._score(design) for design in self.evaluate([self.study.design(x) for x in places])]

    def value(self, x: Array) -> float:
        """Compute the objective for gradient-based methods; a failed design costs more than the start."""
        design = self.evaluate.at(x)
        if design.complete:
            return self.objective.value(design, self.scales)
        return _REFUSED * self.cost * (1.0 + float(np.linalg.norm(x - self._safe)))

    def slope(self, x: Array) -> Array:
        """Compute the derivatives of `value` (parameters,)."""
        design = self.evaluate.at(x)
        if design.complete:
            self._safe = np.array(x)
            return self.objective.slope(design, self.scales, self.slopes(design))
        away = x - self._safe
        return _REFUSED * self.cost * away / (float(np.linalg.norm(away)) or 1.0)

    def slack(self, x: Array) -> Array:
        """Compute the margins of metrics to their limits (limits,); -1 if the design fails."""
        design = self.evaluate.at(x)
        return self.objective.slack(design) if design.complete else np.full(len(self.objective.limits), -1.0)

    def slack_gradient(self, x: Array) -> Array:
        """Compute the derivatives of `slack` (limits, parameters); zero if the design fails."""
        design = self.evaluate.at(x)
        if design.complete:
            return self.objective.slack_gradient(design, self.slopes(design))
        return np.zeros((len(self.objective.limits), x.size))

    def _score(self, design: EvaluatedDesign) -> float:
        if not design.complete:
            return _FAILED * self.cost
        violation = self.objective.violation(design)
        if violation > _LIMIT_EXCESS:
            return _OUTSIDE * self.cost * (1.0 + violation)
        return self.objective.value(design, self.scales)


def running_start(evaluate: Evaluate) -> EvaluatedDesign:
    """Evaluate the start, and raise an `InputError` unless it can be run."""
    study = evaluate.study
    (start,) = evaluate([study.start])
    if not start.complete:
        values = ", ".join(f"{name} = {value:g}" for name, value in zip(study.setting.names, study.start, strict=True))
        raise InputError(
            f"the start cannot be run ({start.reason})", field="vary", value=values, remedy="give another start"
        )
    return start


def best_of(
    objective: Objective, scales: Mapping[str, float], designs: Sequence[EvaluatedDesign]
) -> EvaluatedDesign | None:
    """Return the complete design of least objective within the limits, or else of least violation; None without any."""

    def rank(design: EvaluatedDesign) -> tuple[float, float, int]:
        violation = objective.violation(design)
        return violation if violation > _LIMIT_EXCESS else 0.0, objective.value(design, scales), design.number

    return min((design for design in designs if design.complete), key=rank, default=None)


def holds_limits(objective: Objective, design: EvaluatedDesign) -> bool:
    """Check whether a design satisfies all limits."""
    return objective.violation(design) <= _LIMIT_EXCESS
