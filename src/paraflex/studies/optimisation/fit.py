"""Least-squares problem of an identification."""

from collections.abc import Mapping, Sequence

import numpy as np

from paraflex.arrays import Array
from .evaluate import Evaluate, EvaluatedDesign
from .objective import Target
from .slopes import Slopes

# Default tolerance of the fit: relative change of the cost and of the parameters, and norm of the gradient.
_FIT_TOLERANCE = 1e-6


def residuals(targets: Sequence[Target], design: EvaluatedDesign) -> Array:
    """Compute the residuals of all targets (targets,); they are infinite for a design that does not run."""
    if not design.complete:
        return np.full(len(targets), np.inf)
    return np.array([target.residual(design) for target in targets])


def root_mean_square(targets: Sequence[Target], design: EvaluatedDesign) -> float:
    """Compute the root mean square of the residuals."""
    return float(np.sqrt(np.mean(residuals(targets, design) ** 2)))


def closest(targets: Sequence[Target], designs: Sequence[EvaluatedDesign]) -> EvaluatedDesign | None:
    """Return the complete design with the smallest residuals, the earliest of equal ones; None if there is none."""
    complete = [design for design in designs if design.complete]
    return min(complete, key=lambda each: (root_mean_square(targets, each), each.number), default=None)


def fit(targets: Sequence[Target], evaluate: Evaluate, slopes: Slopes, start: EvaluatedDesign) -> str:
    """Minimise the residuals from a start, and return the reason of termination as text.

    A trial design that does not run has infinite residuals, and SciPy's trust-region method then shortens the step.

    Raises
    ------
    LimitReached
        Limit of evaluated designs reached.
    """
    from scipy.optimize import least_squares

    study = evaluate.study
    given = study.search.tolerance
    tolerance = _FIT_TOLERANCE if given is None else given

    found = least_squares(
        lambda x: residuals(targets, evaluate.at(x)),
        study.unit(start.design),
        jac=lambda x: residual_slopes(targets, slopes(evaluate.at(x))),  # pyright: ignore[reportArgumentType]
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
    """Compute the Jacobian of the residuals with respect to the unit-cube coordinates (targets, parameters)."""
    return np.array([target.slope(slopes) for target in targets])
