"""Optimisation of a design: the search for the minimum of an objective."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

from paraflex.arguments import checked_arguments, named_in_errors
from paraflex.campaign import OnProgress, Progress, Workers, kept_in
from paraflex.designs.schema import study_table
from paraflex.designs.units import check_unit_of_metric
from paraflex.errors import InputError
from paraflex.results.metrics import Members
from paraflex.studies.optimisation.evaluate import Evaluate, EvaluatedDesign, RunTask
from paraflex.studies.optimisation.minimise import DEFAULT_SEARCH, minimise
from paraflex.studies.optimisation.objective import Objective
from paraflex.studies.optimisation.problem import DesignProblem, best_of, holds_limits
from paraflex.studies.optimisation.result import SearchResult, of_session
from paraflex.studies.optimisation.schema import ObjectiveTable, StudyTable
from paraflex.studies.optimisation.session import Session, sampled_start, search
from paraflex.studies.optimisation.slopes import slopes_of
from paraflex.studies.optimisation.study import DesignStudy, base_study, read_search

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
class OptimisationStudy(DesignStudy[OptimisationResult]):
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
        return {"objective": vars(self.objective) | {"weights": dict(self.objective.weights)}}

    def run(
        self,
        folder: str | Path | None = None,
        *,
        workers: Workers | None = None,
        on_progress: OnProgress | None = None,
        run: RunTask | None = None,
    ) -> OptimisationResult:
        """Search for the best design; see `Study.run`.

        The table of all runs, `result.json` and `best.toml` are written into the folder.

        Parameters
        ----------
        folder, workers, on_progress
            See `Study.run`.
        run : callable, optional
            Function that runs a task; `run_task` by default.

        Raises
        ------
        InputError
            Start that cannot be run; see `Study.run` for other reasons.
        """
        folder = kept_in(folder)
        watch = _ProgressCallback(self, on_progress)
        result, solve = partial(_result, self, folder), partial(_solve, self)
        return search(self, folder, (workers or Workers()).open, solve, watch, run=run, result=result)


@checked_arguments()
def load_optimisation(file: str | Path) -> OptimisationStudy:
    """Read the study file of an optimisation.

    Parameters
    ----------
    file : str or Path
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
        columns |= {f"objective.at_most.{k}.metric": each.metric for k, each in enumerate(table.objective.at_most)}
        base = base_study(table, folder, columns)
        objective = _objective(table.objective, base.members)
        search = read_search(table.search)
        if search.difference is None:
            search = replace(search, difference=_DIFFERENCE_SHARE)
        return OptimisationStudy(base, search, objective)


@checked_arguments()
def optimise(
    study: OptimisationStudy | str | Path,
    folder: str | Path,
    *,
    workers: Workers | int | None = None,
    on_progress: OnProgress | None = None,
    run: RunTask | None = None,
) -> OptimisationResult:
    """Search for the design of a study with the least objective.

    Parameters
    ----------
    study : OptimisationStudy, str or Path
        Study, or its file.
    folder, workers, on_progress
        See `Study.run`; an integer number of workers is a number of threads.
    run : callable, optional
        Function that runs a task; `run_task` by default.
    """
    study = study if isinstance(study, OptimisationStudy) else load_optimisation(study)
    return study.run(folder, workers=Workers.of(workers), on_progress=on_progress, run=run)


def _objective(table: ObjectiveTable, members: Members) -> Objective:
    if not table.minimise:
        raise InputError("nothing to minimise", field="objective.minimise", remedy="write { tracking_rms = 1.0 }")
    for column, weight in table.minimise.items():
        if not weight > 0.0:
            raise InputError(
                "must be positive", field=f"objective.minimise.{column}", value=weight, remedy="leave the metric out"
            )
    for k, each in enumerate(table.at_most):
        check_unit_of_metric(each.value, each.metric, members, f"objective.at_most.{k}.value")
    limits = tuple((each.metric, float(each.value)) for each in table.at_most)
    return Objective(dict(table.minimise), table.over, table.relative, limits)


def _solve(study: OptimisationStudy, evaluate: Evaluate) -> str:
    objective = study.objective
    problem = DesignProblem(study, objective, evaluate, slopes_of(study, evaluate))
    start = sampled_start(study, evaluate, lambda designs: best_of(objective, problem.scales, designs))
    return minimise(problem, study.search.method, study.unit(start.design))


def _result(study: OptimisationStudy, folder: Path, session: Session) -> OptimisationResult:
    history, objective = session.evaluate.history, study.objective
    start = session.evaluate.known.get(study.start)
    running = start is not None and start.complete
    scales = objective.scales(start) if start is not None and running else {}
    best = best_of(objective, scales, history) if running else None
    return OptimisationResult(
        **of_session(study, folder, session, best),
        method=study.search.method or DEFAULT_SEARCH,
        goal=study.goal()["objective"],
        objective=None if best is None else objective.value(best, scales),
        start_objective=objective.value(start, scales) if start is not None and running else None,
        metrics={} if best is None else objective.metrics(best),
        start_metrics=objective.metrics(start) if start is not None and running else {},
        holds_limits=best is not None and holds_limits(objective, best),
        history=tuple(
            (each.number, objective.value(each, scales), holds_limits(objective, each))
            if running and each.complete
            else (each.number, None, False)
            for each in history
        ),
    )


class _ProgressCallback:
    """Callback that reports the progress of an optimisation, with the best objective so far."""

    def __init__(self, study: OptimisationStudy, on_progress: OnProgress | None) -> None:
        self.study, self.objective, self.on_progress = study, study.objective, on_progress
        self.best: EvaluatedDesign | None = None
        self.scales: Mapping[str, float] | None = None

    def __call__(self, evaluate: Evaluate, done: EvaluatedDesign) -> None:
        """Record an evaluated design and report the progress; the first design is the start."""
        if self.on_progress is None:
            return
        if self.scales is None and done.complete:
            self.scales = self.objective.scales(done)
        best = None
        if self.scales is not None and all(self.scales.values()):
            compared = [done] if self.best is None else [self.best, done]
            self.best = best_of(self.objective, self.scales, compared)
            best = None if self.best is None else self.objective.value(self.best, self.scales)
        self.on_progress(Progress(len(evaluate.known), self.study.search.evaluations, evaluate.fresh, best=best))
