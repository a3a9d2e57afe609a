"""Optimisation of a design: the search for the minimum of an objective."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

from paraflex.arguments import checked_arguments, named_in_errors
from paraflex.campaign import OnProgress, Workers
from paraflex.designs.run import RunTask
from paraflex.designs.schema import StudyFile, study_table
from paraflex.designs.units import check_unit_of_metric
from paraflex.errors import InputError
from paraflex.results.metrics import MetricMembers
from .evaluate import Evaluate, EvaluatedDesign, Session
from .minimise import DEFAULT_SEARCH, minimise
from .objective import Objective
from .problem import DesignProblem, best_of, holds_limits
from .result import SearchResult, of_session
from .schema import ObjectiveTable, StudyTable
from .session import SearchStudy, Solver, sampled_start
from .study import base_study, read_search

# Default step of finite differences, as a fraction of a parameter's range.
_DIFFERENCE_SHARE = 1e-3


@dataclass(frozen=True, kw_only=True)
class OptimisationResult(SearchResult):
    """State of an optimisation after a session; see `SearchResult`. Its history holds objectives.

    Attributes
    ----------
    method : str
        Name of the optimisation method.
    goal : mapping
        Objective function as plain values.
    objective, start_objective : float or None
        Objective at the best design and at the start; None before the start has run.
    metrics, start_metrics : mapping of str to float
        Metrics at the best design and at the start: worst or mean of all runs, as the objective specifies.
    holds_limits : bool
        Whether the best design violates no limit.
    """

    kind: ClassVar[str] = "optimisation"
    method: str
    goal: Mapping[str, Any]
    objective: float | None
    start_objective: float | None
    metrics: Mapping[str, float]
    start_metrics: Mapping[str, float]
    holds_limits: bool


@named_in_errors("an optimisation", "what load_optimisation returns")
@dataclass(frozen=True)
class OptimisationStudy(SearchStudy[OptimisationResult]):
    """Optimisation study: the search for the design with the least objective; see `DesignStudy`.

    Attributes
    ----------
    objective : Objective
        Objective function and limits.
    """

    objective: Objective

    @property
    def columns(self) -> tuple[str, ...]:
        """Metrics of the objective and its limits."""
        return self.objective.columns

    def goal(self) -> dict[str, Any]:
        """Return the objective as plain values."""
        return {"objective": self.objective.to_dict()}

    def _solver(self) -> Solver[OptimisationResult]:
        return _Optimiser(self)


@checked_arguments()
def load_optimisation(file: StudyFile) -> OptimisationStudy:
    """Read the study file of an optimisation.

    Parameters
    ----------
    file : str, Path or mapping
        Study file, TOML; see docs/optimisation.md.

    Raises
    ------
    InputError
        Invalid entry, or one that does not fit the mechanism. The error names file, field, value and remedy.
    """
    with study_table(StudyTable, file) as (table, folder):
        if table.objective is None:
            remedy = "write [objective] minimise = { tracking_rms = 1.0 }"
            raise InputError("is missing", field="objective", remedy=remedy)
        columns = {f"objective.minimise.{name}": name for name in table.objective.minimise}
        columns |= {f"objective.targets.{k}.metric": each.metric for k, each in enumerate(table.objective.targets)}
        columns |= {f"objective.at_most.{k}.metric": each.metric for k, each in enumerate(table.objective.at_most)}
        base = base_study(table, folder, columns)
        objective = _objective(table.objective, base.members)
        search = read_search(table.search)
        if search.difference is None:
            search = replace(search, difference=_DIFFERENCE_SHARE)
        return OptimisationStudy(base, search, objective)


@checked_arguments()
def optimise(
    study: OptimisationStudy | StudyFile,
    folder: str | Path,
    *,
    workers: Workers | int | None = None,
    on_progress: OnProgress | None = None,
    run: RunTask | None = None,
) -> OptimisationResult:
    """Search for the design of a study with the least objective.

    Parameters
    ----------
    study : OptimisationStudy, str, Path or mapping
        Study, its file, or the contents of one.
    folder, workers, on_progress
        See `Study.run`; an integer number of workers is a number of threads.
    run : callable, optional
        Function that runs a task; `run_task` by default.
    """
    study = study if isinstance(study, OptimisationStudy) else load_optimisation(study)
    return study.run(folder, workers=Workers.of(workers), on_progress=on_progress, run=run)


def _objective(table: ObjectiveTable, members: MetricMembers) -> Objective:
    if not table.minimise and not table.targets:
        raise InputError("nothing to minimise", field="objective.minimise",
                         remedy="write { tracking_rms = 1.0 }, or add [[objective.targets]]")  # fmt: skip
    weights = {f"minimise.{column}": weight for column, weight in table.minimise.items()}
    weights |= {f"targets.{k}.weight": each.weight for k, each in enumerate(table.targets)}
    for name, weight in weights.items():
        if not weight > 0.0:
            raise InputError("must be positive", field=f"objective.{name}", value=weight, remedy="leave the metric out")
    for k, each in enumerate(table.at_most):
        check_unit_of_metric(each.value, each.metric, members, f"objective.at_most.{k}.value")
    for k, each in enumerate(table.targets):
        check_unit_of_metric(each.target, each.metric, members, f"objective.targets.{k}.target")
        if each.target == 0.0:
            raise InputError(
                "nothing is relative to zero", field=f"objective.targets.{k}.target", value=0.0,
                remedy="minimise the magnitude of the metric instead, as abs(...)",
            )  # fmt: skip
        again = each.metric in table.minimise or each.metric in [other.metric for other in table.targets[:k]]
        if again:
            raise InputError("the objective has this metric already", field=f"objective.targets.{k}.metric",
                             value=each.metric, remedy="leave one of them out")  # fmt: skip
    limits = tuple((each.metric, float(each.value)) for each in table.at_most)
    targets = tuple((each.metric, float(each.target), each.weight) for each in table.targets)
    return Objective(dict(table.minimise), table.over, table.relative, limits, targets)


@dataclass
class _Optimiser(Solver[OptimisationResult]):
    """Minimisation of the objective, with the best of the designs reported so far."""

    study: OptimisationStudy
    best: EvaluatedDesign | None = None
    scales: Mapping[str, float] | None = None

    def solve(self, evaluate: Evaluate) -> str:
        """Minimise the objective; see `Solver`."""
        problem = DesignProblem(self.study.objective, evaluate)
        start = sampled_start(evaluate, lambda designs: best_of(self.study.objective, problem.scales, designs))
        return minimise(problem, self.study.search.method, self.study.unit(start.design))

    def least(self, done: EvaluatedDesign) -> float | None:
        """Return the objective of the best design so far; see `Solver`. The first design is the start."""
        if self.scales is None and done.complete:
            self.scales = self.study.objective.scales(done)
        if self.scales is None or not all(self.scales.values()):
            return None
        compared = [done] if self.best is None else [self.best, done]
        self.best = best_of(self.study.objective, self.scales, compared)
        return None if self.best is None else self.study.objective.value(self.best, self.scales)

    def result(self, session: Session) -> OptimisationResult:
        """Return the best of all designs, with its metrics and those of the start."""
        history, objective, start = session.evaluate.history, self.study.objective, session.start
        scales = {} if start is None else objective.scales(start)
        best = None if start is None else best_of(objective, scales, history)
        return OptimisationResult(
            **of_session(session, best),
            method=self.study.search.method or DEFAULT_SEARCH,
            goal=self.study.goal()["objective"],
            objective=None if best is None else objective.value(best, scales),
            start_objective=None if start is None else objective.value(start, scales),
            metrics={} if best is None else objective.metrics(best),
            start_metrics={} if start is None else objective.metrics(start),
            holds_limits=best is not None and holds_limits(objective, best),
            history=tuple(
                (each.number, objective.value(each, scales), holds_limits(objective, each))
                if start is not None and each.complete
                else (each.number, None, False)
                for each in history
            ),
        )
