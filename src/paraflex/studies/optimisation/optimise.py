"""The design whose metrics are least."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from paraflex.arguments import checked_arguments
from paraflex.campaign import THREADS, Engine, open_engine
from paraflex.studies.optimisation.best import write_best
from paraflex.studies.optimisation.evaluate import Evaluate, Evaluated, RunTask
from paraflex.studies.optimisation.minimise import DEFAULT_METHOD, minimise
from paraflex.studies.optimisation.objective import Objective
from paraflex.studies.optimisation.problem import Problem, best_of, holds_limits
from paraflex.studies.optimisation.result import SearchResult
from paraflex.studies.optimisation.session import RESULT, Progress, Session, sampled_start, search
from paraflex.studies.optimisation.slopes import slopes_of
from paraflex.studies.optimisation.study import DesignStudy, load_optimisation
from paraflex.writing import GO_ON, write_json

# So near a bound, as a share of the range, a parameter is at it.
_AT_BOUND = 1e-4
# Different reasons of failures that are listed.
_REASONS = 5


@dataclass(frozen=True, kw_only=True)
class OptimisationResult(SearchResult):
    """Where an optimisation stands after a session: see `SearchResult`; its history tells objectives.

    Attributes
    ----------
    objective, start_objective : float or None
        None before the start has run.
    metrics, start_metrics : mapping of str to float
        Worst or mean of all runs, as the study says.
    holds_limits : bool
        Whether the best design passes no limit.
    """

    objective: float | None
    start_objective: float | None
    metrics: Mapping[str, float]
    start_metrics: Mapping[str, float]
    holds_limits: bool


@checked_arguments()
def optimise(
    study: DesignStudy | str | Path,
    folder: str | Path,
    *,
    engine: str | Engine = THREADS,
    workers: int | None = None,
    cluster: str | None = None,
    on_progress: Callable[[Progress], None] | None = None,
    run: RunTask | None = None,
) -> OptimisationResult:
    """Look for the design whose objective is least.

    Parameters
    ----------
    study : DesignStudy, str or Path
        A study, or its file.
    folder : str or Path
        For the table of all runs, `result.json` and `best.toml`; one that another session left is gone on with.
    engine : str or Engine
        "threads" of this process, "processes", or "dask". Results are the same to the last bit.
    workers : int, optional
        As many as there are processors by default.
    cluster : str, optional
        Address of a Dask scheduler.
    on_progress : callable, optional
        Called with how far it is whenever a design is done.
    run : callable, optional
        What is done for a task: the simulation but in tests.

    Returns
    -------
    OptimisationResult
        A KeyboardInterrupt ends the session with what is there, marked so.

    Raises
    ------
    InputError
        The study cannot be, its start cannot be run, the folder is another's, or the engine cannot be had.
    OutputError
        The folder cannot be written any more; what was written stays, and the same call goes on from there.
    """
    study = study if isinstance(study, DesignStudy) else load_optimisation(study)
    assert study.objective is not None
    watch = _Watch(study, study.objective, on_progress)
    opened = partial(open_engine, engine, workers, cluster)
    session = search(study, Path(folder), opened, partial(_solve, study, study.objective), watch, run=run)
    result = _result(study, study.objective, Path(folder), session)
    write_json(
        Path(folder) / RESULT,
        {"kind": "optimisation", "name": study.name} | _said(study) | result.figures(),
        remedy=GO_ON,
    )
    if result.objective is not None:
        write_best(Path(folder), study, tuple(result.values.values()))
    return result


def at_bounds(study: DesignStudy, design: Sequence[float]) -> dict[str, str]:
    """Which numbers of a design are at an end of their range."""
    places = dict(zip(study.setting.names, study.unit(design), strict=True))
    low = {name: "low" for name, place in places.items() if place < _AT_BOUND}
    return low | {name: "high" for name, place in places.items() if place > 1.0 - _AT_BOUND}


def failures(history: Sequence[Evaluated]) -> tuple[int, tuple[str, ...]]:
    """How many designs do not run, and some of the reasons."""
    reasons = [each.reason for each in history if not each.complete]
    return len(reasons), tuple(dict.fromkeys(reasons))[:_REASONS]


def _solve(study: DesignStudy, objective: Objective, evaluate: Evaluate) -> str:
    problem = Problem(study, evaluate, slopes_of(study, evaluate))
    start = sampled_start(study, evaluate, lambda designs: best_of(objective, problem.scales, designs))
    return minimise(problem, study.search.method, study.unit(start.design))


def _result(study: DesignStudy, objective: Objective, folder: Path, session: Session) -> OptimisationResult:
    history, names = session.evaluate.history, study.setting.names
    start = session.evaluate.known.get(study.start)
    running = start is not None and start.complete
    scales = objective.scales(start) if start is not None and running else {}
    best = best_of(objective, scales, history) if running else None
    failed, reasons = failures(history)
    return OptimisationResult(
        folder=folder,
        table=session.table,
        values={} if best is None else dict(zip(names, best.design, strict=True)),
        start=dict(zip(names, study.start, strict=True)),
        objective=None if best is None else objective.value(best, scales),
        start_objective=objective.value(start, scales) if start is not None and running else None,
        metrics={} if best is None else objective.metrics(best),
        start_metrics=objective.metrics(start) if start is not None and running else {},
        holds_limits=best is not None and holds_limits(objective, best),
        bounds={} if best is None else at_bounds(study, best.design),
        evaluations=len(history),
        fresh=session.evaluate.fresh,
        failed=failed,
        reasons=reasons,
        stopped=session.stopped,
        interrupted=session.interrupted,
        seconds=session.seconds,
        history=tuple(
            (each.number, objective.value(each, scales), holds_limits(objective, each))
            if running and each.complete
            else (each.number, None, False)
            for each in history
        ),
    )


def _said(study: DesignStudy) -> dict[str, Any]:
    assert study.objective is not None
    objective = vars(study.objective) | {"weights": dict(study.objective.weights)}
    return {"method": study.search.method or DEFAULT_METHOD, "sought": objective | {"limits": study.objective.limits}}


class _Watch:
    """Tells how far an optimisation is, and the best objective until then."""

    def __init__(
        self, study: DesignStudy, objective: Objective, on_progress: Callable[[Progress], None] | None
    ) -> None:
        self.study, self.objective, self.on_progress = study, objective, on_progress
        self.best: Evaluated | None = None
        self.scales: Mapping[str, float] | None = None

    def __call__(self, evaluate: Evaluate, done: Evaluated) -> None:
        """Take note of a design; the start is the first."""
        if self.on_progress is None:
            return
        if self.scales is None and done.complete:
            self.scales = self.objective.scales(done)
        told = None
        if self.scales is not None and all(self.scales.values()):
            compared = [done] if self.best is None else [self.best, done]
            self.best = best_of(self.objective, self.scales, compared)
            told = None if self.best is None else self.objective.value(self.best, self.scales)
        self.on_progress(Progress(len(evaluate.known), self.study.search.evaluations, told))
