"""Optimisation methods of SciPy and Optuna, applied to one problem in the unit cube."""

import warnings
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from paraflex.arrays import Array
from paraflex.errors import InputError, optional_package
from .problem import DesignProblem

SLSQP, TRUST, LBFGSB, SIMPLEX = "slsqp", "trust-constr", "l-bfgs-b", "nelder-mead"
EVOLUTION, OPTUNA = "differential-evolution", "optuna"
WITH_SLOPES = (SLSQP, TRUST, LBFGSB)
DEFAULT_SEARCH = SLSQP

# Relative accuracy of metrics, limited because time steps are chosen anew for each design: the default tolerance.
_METRIC_TOLERANCE = 1e-4
# Exceeds any limit of evaluations, which ends the search instead.
_ITERATION_LIMIT = 100_000
# Edge length of the initial simplex, as a fraction of the ranges.
_SIMPLEX = 0.1
# Members of the population per parameter.
_POPULATION = 8
# Designs requested from Optuna at a time, fixed so that results do not depend on the number of workers.
_BATCH = 4


def minimise(problem: DesignProblem, method: str | None, start: Array) -> str:
    """Minimise the objective from a start, and return the reason of termination as text.

    Parameters
    ----------
    problem : DesignProblem
        Objective and limits over the unit cube.
    method : str or None
        Name of the method; None for `DEFAULT_SEARCH`.
    start : (parameters,) array
        Initial point in the unit cube.

    Raises
    ------
    InputError
        Limits given to a method that accepts none, or Optuna not installed.
    LimitReached
        Limit of evaluated designs reached.
    """
    name = method or DEFAULT_SEARCH
    if name == LBFGSB and problem.objective.limits:
        raise InputError(
            "the method takes no limits (at_most)",
            field="search.method",
            value=name,
            remedy=f'write "{SLSQP}" or "{TRUST}", or drop at_most',
        )
    with warnings.catch_warnings():
        # SciPy warns of quasi-Newton updates whose gradients do not change, as at bounds and near failures.
        warnings.filterwarnings("ignore", message="delta_grad == 0.0")
        return _METHODS[name](problem, start)


def _tolerance(problem: DesignProblem) -> float:
    given = problem.study.search.tolerance
    return _METRIC_TOLERANCE if given is None else given


def _slsqp(problem: DesignProblem, start: Array) -> str:
    limits = {"type": "ineq", "fun": problem.slack, "jac": problem.slack_gradient}
    constraints = [limits] if problem.objective.limits else []
    options = {"ftol": _tolerance(problem) * problem.cost, "maxiter": _ITERATION_LIMIT}
    return _scipy(problem, start, "SLSQP", constraints=constraints, options=options)


def _trust(problem: DesignProblem, start: Array) -> str:
    from scipy.optimize import NonlinearConstraint

    limits = NonlinearConstraint(problem.slack, 0.0, np.inf, jac=problem.slack_gradient)  # pyright: ignore[reportArgumentType]
    constraints = [limits] if problem.objective.limits else []
    tolerance = _tolerance(problem)
    options = {"gtol": tolerance * problem.cost, "xtol": tolerance, "barrier_tol": tolerance}
    options |= {"maxiter": _ITERATION_LIMIT}
    return _scipy(problem, start, "trust-constr", constraints=constraints, options=options)


def _lbfgsb(problem: DesignProblem, start: Array) -> str:
    options = {"ftol": _tolerance(problem), "maxfun": _ITERATION_LIMIT, "maxiter": _ITERATION_LIMIT}
    return _scipy(problem, start, "L-BFGS-B", options=options)


def _scipy(problem: DesignProblem, start: Array, method: str, **given: Any) -> str:
    from scipy.optimize import minimize

    functions = {"fun": problem.value, "jac": problem.slope}
    return _why_ended(minimize(**(functions | given), x0=start, method=method, bounds=[(0.0, 1.0)] * start.size))


def _simplex(problem: DesignProblem, start: Array) -> str:
    # The edges point away from the nearer bound.
    corners = np.vstack([start, start + np.diag(np.where(start > 0.5, -_SIMPLEX, _SIMPLEX))])
    tolerance = _tolerance(problem)
    problem.scores(list(corners))
    options = {"initial_simplex": corners, "xatol": np.sqrt(tolerance), "fatol": tolerance * problem.cost}
    options |= {"maxiter": _ITERATION_LIMIT, "maxfev": _ITERATION_LIMIT}
    return _scipy(problem, start, "Nelder-Mead", fun=lambda x: problem.scores([x])[0], jac=None, options=options)


def _evolution(problem: DesignProblem, start: Array) -> str:
    from scipy.optimize import differential_evolution

    return _why_ended(
        differential_evolution(
            lambda population: np.array(problem.scores(list(np.atleast_2d(population.T)))),
            [(0.0, 1.0)] * start.size,
            x0=start,
            seed=problem.study.search.seed,  # pyright: ignore[reportCallIssue]
            popsize=_POPULATION,
            tol=_tolerance(problem),
            init="sobol",
            maxiter=_ITERATION_LIMIT,
            polish=False,
            vectorized=True,
            updating="deferred",
        )
    )


def _optuna(problem: DesignProblem, start: Array) -> str:
    remedy = "pip install 'paraflex[optuna]'"
    with optional_package("Optuna is not installed", field="search.method", value=OPTUNA, remedy=remedy):
        import optuna
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    names = problem.study.setting.names
    study = optuna.create_study(sampler=optuna.samplers.TPESampler(seed=problem.study.search.seed))
    study.enqueue_trial(dict(zip(names, start.tolist(), strict=True)))
    while True:
        trials = [study.ask() for _ in range(_BATCH)]
        places = [np.array([trial.suggest_float(name, 0.0, 1.0) for name in names]) for trial in trials]
        for trial, score in zip(trials, problem.scores(places), strict=True):
            study.tell(trial, score)


def _why_ended(result: Any) -> str:
    text = str(result.message).strip().rstrip(".")
    return text[0].lower() + text[1:]


_METHODS: Mapping[str, Callable[[DesignProblem, Array], str]] = {
    SLSQP: _slsqp,
    TRUST: _trust,
    LBFGSB: _lbfgsb,
    SIMPLEX: _simplex,
    EVOLUTION: _evolution,
    OPTUNA: _optuna,
}
