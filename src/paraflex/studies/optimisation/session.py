"""Session of a search, which locks the folder, starts the workers, and always writes the rows."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Generic, TypeVar

from paraflex.campaign import OnProgress, Progress, Result, Workers, kept_in, open_campaign
from paraflex.compilation import compile_kernels_for
from paraflex.designs.reopen import study_account
from paraflex.designs.run import RunTask, is_row_of, run_task, table_schema
from paraflex.designs.samples import SOBOL, designs
from paraflex.errors import InputError
from .evaluate import Evaluate, EvaluatedDesign, LimitReached, Session
from .minimise import DEFAULT_SEARCH, WITH_SLOPES
from .result import SearchResult
from .slopes import DIFFERENCES, EXACT, NO_SLOPES, no_exact_slopes, run_slopes, slope_column
from .study import DesignStudy

if TYPE_CHECKING:
    import pyarrow as pa


R_co = TypeVar("R_co", bound=SearchResult, covariant=True)


class Solver(ABC, Generic[R_co]):
    """Solution of a search in one session."""

    @abstractmethod
    def solve(self, evaluate: Evaluate) -> str:
        """Request designs from the evaluator until the search ends, and return the reason of termination."""

    @abstractmethod
    def least(self, done: EvaluatedDesign) -> float | None:
        """Return the least objective or residual so far, that of a newly evaluated design included; None if none."""

    @abstractmethod
    def result(self, session: Session) -> R_co:
        """Return the result of the session, which is written together with the table."""


@dataclass(frozen=True)
class SearchStudy(DesignStudy[R_co]):
    """Search study that is run in a folder; see `DesignStudy`."""

    @abstractmethod
    def _solver(self) -> Solver[R_co]:
        """Return the solver of a session."""

    def run(
        self,
        folder: str | Path | None = None,
        *,
        workers: Workers | None = None,
        on_progress: OnProgress | None = None,
        run: RunTask | None = None,
    ) -> R_co:
        """Search for the best design; see `Study.run`.

        The table of all runs, `result.json` and `best.toml` are written into the folder. A folder left by an earlier
        session is continued: designs with rows in it are read.

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
        folder, solver, began = kept_in(folder), self._solver(), time.perf_counter()
        exact = _slopes_run(self, run)
        account = study_account(self.name, self.setting, self.parameters, self.content())
        schema = record_schema(self, slopes=exact is not None)
        watch = None if on_progress is None else partial(_report, on_progress, solver)
        with open_campaign(folder, account, schema, partial(is_row_of, self.setting)) as campaign:
            compile_kernels_for(self.base.model().mechanism)
            engine = (workers or Workers()).open()
            evaluate = Evaluate(self, campaign.journal, engine, run or run_task, watch, exact)
            try:
                stopped, interrupted = _solved(evaluate, solver.solve), False
            except KeyboardInterrupt:
                stopped, interrupted = "interrupted", True
            with campaign.published(finished=not interrupted) as new:
                found = solver.result(Session(folder, evaluate, stopped, interrupted, time.perf_counter() - began))
                found.write(self, new)
        return found


def _report(on_progress: OnProgress, solver: Solver[SearchResult], evaluate: Evaluate, done: EvaluatedDesign) -> None:
    total = evaluate.study.search.evaluations
    on_progress(Progress(len(evaluate.known), total, evaluate.fresh, best=solver.least(done)))


def record_schema(study: DesignStudy[Result], *, slopes: bool) -> pa.Schema:
    """Return the columns of the table: those of a sweep, and exact derivatives of the metrics if `slopes` is True."""
    import pyarrow as pa

    schema = table_schema(study.setting, study.base.members)
    names = [slope_column(column, name) for column in study.columns for name in study.setting.names] if slopes else []
    for name in names:
        schema = schema.append(pa.field(name, pa.float64()))
    return schema.append(pa.field(NO_SLOPES, pa.string())) if slopes else schema


def sampled_start(
    evaluate: Evaluate, best: Callable[[list[EvaluatedDesign]], EvaluatedDesign | None]
) -> EvaluatedDesign:
    """Evaluate the start and the initial samples of the study, and return the best of them."""
    study = evaluate.study
    number, batch = study.search.samples, [study.start]
    if number:
        points = designs(study.parameters, SOBOL, number, study.search.seed)
        batch += [study.design(study.unit(point)) for point in points.tolist()]
    done = evaluate(batch)
    return best(done) or done[0]


def _solved(evaluate: Evaluate, solve: Callable[[Evaluate], str]) -> str:
    with evaluate.engine:
        try:
            return solve(evaluate)
        except LimitReached:
            return f"evaluations = {evaluate.study.search.evaluations} are done"


def _slopes_run(study: DesignStudy[Result], run: RunTask | None) -> RunTask | None:
    """Return the function that computes exact derivatives; None if finite differences are used.

    Raises
    ------
    InputError
        Exact derivatives requested but not available, or not used by the method.
    """
    requested = study.search.gradients
    if requested == DIFFERENCES or (requested is None and (run is not None or not study.least_squares)):
        return None
    method = study.search.method or DEFAULT_SEARCH
    if not study.least_squares and method not in WITH_SLOPES:
        raise InputError(
            f"{method} uses no gradients", field="search.gradients", value=EXACT,
            remedy=f"leave it out, or choose from {', '.join(WITH_SLOPES)}",
        )  # fmt: skip
    reason = no_exact_slopes(study)
    if reason and requested == EXACT:
        raise InputError(
            f"no exact derivatives ({reason})", field="search.gradients", value=EXACT, remedy='write "differences"'
        )
    sizes = tuple(high - low for low, high in (p.ends for p in study.parameters))
    return None if reason else partial(run_slopes, study.columns, sizes)
