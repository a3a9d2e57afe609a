"""Residuals of targets as a problem of least squares, and what its Jacobian says of the parameters found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from paraflex.studies.optimisation.evaluate import Evaluate, Evaluated
from paraflex.studies.optimisation.objective import Target
from paraflex.studies.optimisation.slopes import Slopes
from paraflex.studies.optimisation.study import DesignStudy

Array = NDArray[np.float64]
# Relative change at which it ends, of residuals and parameters.
_TOLERANCE = 1e-6
# Slopes by differences are known to about a hundredth: beyond this condition the weakest direction is not.
ILL_CONDITIONED = 1e3


@dataclass(frozen=True)
class Confidence:
    """How well targets fix the parameters, to first order about the design found.

    Attributes
    ----------
    deviations : mapping of str to float or None
        Standard deviations in the parameters' units, from the residuals that are left; None for parameters at a bound,
        and for all where there are no more targets than parameters.
    correlation : (free, free) array
        Of the parameters that are not at a bound.
    free : tuple of str
        Their names.
    condition : float
        Of the Jacobian, parameters as shares of their ranges.
    weakest : mapping of str to float
        The direction of unit length, in shares of the ranges, that changes residuals least.
    """

    deviations: Mapping[str, float | None]
    correlation: Array = field(repr=False)
    free: tuple[str, ...]
    condition: float
    weakest: Mapping[str, float]

    @property
    def telling(self) -> bool:
        """Whether the targets tell the parameters apart."""
        return self.condition < ILL_CONDITIONED


def residuals(targets: Sequence[Target], design: Evaluated) -> Array:
    """Of all targets, (targets,); infinite for a design that does not run."""
    if not design.complete:
        return np.full(len(targets), np.inf)
    return np.array([target.residual(design) for target in targets])


def root_mean_square(targets: Sequence[Target], design: Evaluated) -> float:
    """Of the residuals."""
    return float(np.sqrt(np.mean(residuals(targets, design) ** 2)))


def closest(targets: Sequence[Target], designs: Sequence[Evaluated]) -> Evaluated | None:
    """The complete design with the least residuals, the earliest of equal ones."""
    complete = [design for design in designs if design.complete]
    return min(complete, key=lambda each: (root_mean_square(targets, each), each.number), default=None)


def fit(study: DesignStudy, evaluate: Evaluate, slopes: Slopes, start: Evaluated) -> str:
    """Reduce the residuals from a start; why it stopped, in words.

    A trial that does not run has infinite residuals, which SciPy's trust region answers by a shorter step.

    Raises
    ------
    LimitReached
        As many designs as the study allows.
    """
    from scipy.optimize import least_squares

    given = study.search.tolerance
    tolerance = _TOLERANCE if given is None else given

    def values(x: Array) -> Array:
        return residuals(study.targets, evaluate([study.design(x)])[0])

    def jacobian(x: Array) -> Array:
        return residual_slopes(study.targets, slopes(evaluate([study.design(x)])[0]))

    found = least_squares(
        values,
        study.unit(start.design),
        jac=jacobian,  # pyright: ignore[reportArgumentType]
        bounds=(0.0, 1.0),
        method="trf",
        ftol=tolerance,
        xtol=tolerance,
        gtol=tolerance,
        max_nfev=study.search.evaluations,
    )
    text = str(found.message).strip().rstrip(".").replace("`", "")
    return text[0].lower() + text[1:]


def residual_slopes(targets: Sequence[Target], slopes: Mapping[str, Array]) -> Array:
    """Jacobian of the residuals by the place in the unit cube, (targets, parameters)."""
    return np.array([target.slope(slopes) for target in targets])


def confidence(study: DesignStudy, design: Evaluated, jacobian: Array, bound: Sequence[str]) -> Confidence:
    """What a Jacobian says of a design found.

    Parameters
    ----------
    study : DesignStudy
    design : Evaluated
    jacobian : (targets, parameters) array
        By the place in the unit cube.
    bound : sequence of str
        Parameters at a bound: these are taken as known.
    """
    names = study.setting.names
    free = [k for k, name in enumerate(names) if name not in bound]
    _, stretches, directions = np.linalg.svd(jacobian[:, free], full_matrices=True)
    stretches = np.concatenate([stretches, np.zeros(len(free) - stretches.size)])
    sharp = bool(free) and stretches[-1] > np.finfo(float).eps * stretches[0]
    deviations: dict[str, float | None] = dict.fromkeys(names)
    correlation = np.full((len(free), len(free)), np.nan)
    if sharp:
        covariance = directions.T @ np.diag(stretches**-2.0) @ directions
        spread = np.sqrt(np.diag(covariance))
        correlation = covariance / np.outer(spread, spread)
        more = len(study.targets) - len(free)
        if more > 0:
            left = float(np.sum(residuals(study.targets, design) ** 2)) / more
            scaled = np.sqrt(left) * spread * study.per_unit(design.design)[free]
            deviations |= {names[k]: float(x) for k, x in zip(free, scaled, strict=True)}
    return Confidence(
        deviations=deviations,
        correlation=correlation,
        free=tuple(names[k] for k in free),
        condition=float(stretches[0] / stretches[-1]) if sharp else np.inf if free else 1.0,
        weakest={names[k]: float(x) for k, x in zip(free, directions[-1], strict=True)} if free else {},
    )
