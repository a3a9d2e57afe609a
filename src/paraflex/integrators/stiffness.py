"""Stiffness of a mechanism for explicit methods."""

from __future__ import annotations

import math

import numpy as np
import scipy

from paraflex.errors import StiffnessWarning
from paraflex.findings import Finding, warn_of
from paraflex.integrators.forms import OdeForm
from paraflex.integrators.method import Method
from paraflex.integrators.run import Problem

# Number of steps above which a warning is issued.
MANY_STEPS = 20_000
# Number of unknowns up to which all eigenvalues are computed; beyond, the largest one by Arnoldi's method.
_MOST_DENSE = 600


def largest_rate(form: OdeForm, problem: Problem) -> float:
    """Return the largest eigenvalue of the ODE form's Jacobian at the start, in magnitude [1/s].

    The Jacobian is that of the constrained mechanism, with springs, damping and Baumgarte's terms.
    """
    initial = problem.initial
    jacobian = form.jacobian(initial.time, form.pack(initial.time, initial.q, initial.v, 0.0))
    if not np.all(np.isfinite(jacobian)):
        # The run itself reports values that are not finite.
        return 0.0
    if jacobian.shape[0] <= _MOST_DENSE:
        return float(np.max(np.abs(np.linalg.eigvals(jacobian))))
    start = np.ones(jacobian.shape[0])
    values = scipy.sparse.linalg.eigs(jacobian, k=1, which="LM", v0=start, return_eigenvectors=False)
    return float(np.max(np.abs(values)))


def warn_if_stiff(form: OdeForm, problem: Problem, method: Method) -> None:
    """Warn once of the number of steps that stability requires, if it is large."""
    if not method.explicit or method.stability_limit is None:
        return
    rate = largest_rate(form, problem)
    step = method.stability_limit / rate if rate > 0.0 else math.inf
    steps = problem.span / step
    if steps > MANY_STEPS:
        text = (
            f"{method} is explicit and this mechanism stiff: no step can be longer than about {step:.2g} s, "
            f"{steps:,.0f} steps for this run"
        )
        remedy = "choose an implicit method, such as tr-bdf2, whose steps only accuracy limits"
        warn_of([Finding("stability", "method", text, remedy)], StiffnessWarning)
