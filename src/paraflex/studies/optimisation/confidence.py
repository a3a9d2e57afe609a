"""Confidence intervals of identified parameters, and checks of their validity."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from paraflex.arrays import Array
from paraflex.campaign.study import Result
from paraflex.results.numbers import finite_or_none
from .evaluate import EvaluatedDesign
from .fit import residuals
from .objective import Target
from .study import DesignStudy

# Condition number of the Jacobian, with parameters as fractions of their ranges, above which its weakest direction is
# undetermined.
ILL_CONDITIONED = 1e3
# Largest accepted relative difference between a change of the residuals and the prediction by the Jacobian.
_AGREES = 0.5
# Probability of a normally distributed value within one standard deviation of its mean.
ONE_DEVIATION = math.erf(math.sqrt(0.5))


@dataclass(frozen=True)
class Confidence:
    """Accuracy to which the targets determine the parameters, linearised about the identified design.

    Attributes
    ----------
    deviations : mapping of str to float or None
        Half-widths of the 68.27 % confidence intervals of the parameters, in their units: standard errors, from the
        residuals of the fit, times the factor of Student's distribution. None for parameters listed in `reasons`.
    errors : mapping of str to float or None
        Standard errors, the square roots of the diagonal of s^2 (J^T J)^-1.
    reasons : mapping of str to str
        Reasons why parameters have no deviation.
    freedom : int
        Degrees of freedom: number of targets minus number of free parameters.
    correlation : (free, free) array
        Correlation matrix of the free parameters.
    free : tuple of str
        Names of the free parameters, which are not at a bound.
    condition : float
        Condition number of the Jacobian, with parameters as fractions of their ranges.
    weakest : mapping of str to float
        Direction of unit length, in fractions of the ranges, that changes the residuals least.
    """

    deviations: Mapping[str, float | None]
    errors: Mapping[str, float | None]
    reasons: Mapping[str, str]
    freedom: int
    free: tuple[str, ...]
    correlation: Array = field(repr=False)
    condition: float
    weakest: Mapping[str, float]

    @property
    def identifiable(self) -> bool:
        """Whether the targets distinguish the parameters: the condition number is below `ILL_CONDITIONED`."""
        return self.condition < ILL_CONDITIONED

    def to_dict(self) -> dict[str, Any]:
        """Return the estimate as plain values, with None for infinity and NaN, which JSON does not have."""
        return vars(self) | {
            "free": list(self.free),
            "correlation": [[finite_or_none(x) for x in row] for row in self.correlation.tolist()],
            "condition": finite_or_none(self.condition),
            "telling": self.identifiable,
        }

    def without_errors(self, reason: str) -> "Confidence":
        """Return a copy without deviations and standard errors, with a reason for each free parameter."""
        none = dict.fromkeys(self.deviations)
        reasons = {name: self.reasons[name] if name not in self.free else reason for name in none}
        return replace(self, deviations=none, errors=none, reasons=reasons)


def student_factor(freedom: int) -> float:
    """Return the half-width of the 68.27 % interval of Student's distribution, in standard errors.

    The factor is 1.84 for one degree of freedom, 1.32 for two, and 1 in the limit of infinitely many.
    """
    from scipy.special import stdtrit

    return float(stdtrit(freedom, 0.5 * (1.0 + ONE_DEVIATION)))


def confidence(
    study: DesignStudy[Result],
    targets: Sequence[Target],
    design: EvaluatedDesign,
    jacobian: Array,
    bound: Mapping[str, str],
) -> Confidence:
    """Estimate the deviations of the parameters from the Jacobian at the identified design.

    Parameters
    ----------
    study : DesignStudy
        Study with the parameters and their ranges.
    targets : sequence of Target
        Targets of the identification.
    design : EvaluatedDesign
        Identified design.
    jacobian : (targets, parameters) array
        Jacobian of the residuals with respect to the coordinates in the unit cube.
    bound : mapping of str to str
        Parameters at a bound, with the name of that bound; they are treated as known.
    """
    names = study.setting.names
    free = [k for k, name in enumerate(names) if name not in bound]
    _, stretches, directions = np.linalg.svd(jacobian[:, free], full_matrices=True)
    stretches = np.concatenate([stretches, np.zeros(len(free) - stretches.size)])
    sharp = bool(free) and stretches[-1] > np.finfo(float).eps * stretches[0]
    freedom = len(targets) - len(free)
    none: dict[str, float | None] = dict.fromkeys(names)
    found = Confidence(
        deviations=none,
        errors=none,
        reasons={name: f"at its {side} bound" for name, side in bound.items()},
        freedom=freedom,
        correlation=np.full((len(free), len(free)), np.nan),
        free=tuple(names[k] for k in free),
        condition=float(stretches[0] / stretches[-1]) if sharp else np.inf if free else 1.0,
        weakest={names[k]: float(x) for k, x in zip(free, directions[-1], strict=True)} if free else {},
    )
    if not free:
        return found
    spread = np.full(len(free), np.nan)
    if sharp:
        covariance = directions.T @ np.diag(stretches**-2.0) @ directions
        spread = np.sqrt(np.diag(covariance))
        found = replace(found, correlation=covariance / np.outer(spread, spread))
    if freedom <= 0:
        return found.without_errors(f"{len(targets)} targets are too few to judge {len(free)} free parameters")
    if not found.identifiable:
        return found.without_errors("the targets cannot tell the parameters apart")
    left = _standard_deviation(targets, design, freedom)
    scaled = left * spread * study.per_unit(design.design)[free]
    errors = none | {names[k]: float(x) for k, x in zip(free, scaled, strict=True)}
    factor = student_factor(freedom)
    return replace(
        found, errors=errors, deviations={name: None if x is None else factor * x for name, x in errors.items()}
    )


def checked(
    study: DesignStudy[Result],
    targets: Sequence[Target],
    evaluate: Callable[[Sequence[tuple[float, ...]]], list[EvaluatedDesign]],
    design: EvaluatedDesign,
    jacobian: Array,
    found: Confidence,
) -> Confidence:
    """Remove the deviations if the residuals do not change as the Jacobian predicts.

    Along every principal direction of the Jacobian, two designs are evaluated one standard error to either side. If the
    Jacobian is correct and the residuals are linear, the residuals differ between the two by twice their standard
    deviation. Noise of the runs, wrong derivatives and nonlinearity all appear as a deviation from this prediction.
    """
    if all(value is None for value in found.deviations.values()):
        return found
    free = [study.setting.names.index(name) for name in found.free]
    _, stretches, directions = np.linalg.svd(jacobian[:, free], full_matrices=False)
    middle = study.unit(design.design)
    steps = np.zeros((len(free), middle.size))
    steps[:, free] = directions * (_standard_deviation(targets, design, found.freedom) / stretches)[:, None]
    for step in steps:
        # Shorten the step so that both sides lie within the bounds.
        room = np.minimum(middle, 1.0 - middle) / np.maximum(np.abs(step), np.finfo(float).tiny)
        step *= min(1.0, float(room[free].min()))
    done = evaluate([study.design(middle + sign * step) for step in steps for sign in (-1.0, 1.0)])
    for k, step in enumerate(steps):
        sides = done[2 * k : 2 * k + 2]
        along = ", ".join(f"{1e2 * step[j]:+.2g} % {study.setting.names[j]}" for j in free)
        if not all(each.complete for each in sides):
            return found.without_errors(f"a design one standard error away does not run (along {along} of the ranges)")
        change = 0.5 * (residuals(targets, sides[1]) - residuals(targets, sides[0]))
        predicted = jacobian @ step
        off = float(np.linalg.norm(change - predicted) / np.linalg.norm(predicted))
        if not off <= _AGREES:
            return found.without_errors(
                f"one standard error along {along} of the ranges changes the residuals by {1e2 * off:.0f} % otherwise "
                "than their derivatives say: noise of the runs, or no straight line"
            )
    return found


def _standard_deviation(targets: Sequence[Target], design: EvaluatedDesign, freedom: int) -> float:
    """Estimate the standard deviation of the residuals from the fit."""
    return float(np.sqrt(np.sum(residuals(targets, design) ** 2) / freedom))
