"""Session of a search, which locks the folder, starts the workers, and always writes the rows."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, TypeVar

from paraflex.campaign import Engine, open_campaign
from paraflex.campaign.study import Result
from paraflex.compilation import compile_kernels_for
from paraflex.designs.reopen import study_account
from paraflex.designs.run import is_row_of, run_task, table_schema
from paraflex.designs.samples import SOBOL, designs
from paraflex.errors import InputError
from paraflex.studies.optimisation.evaluate import Evaluate, EvaluatedDesign, LimitReached, RunTask
from paraflex.studies.optimisation.minimise import DEFAULT_SEARCH, WITH_SLOPES
from paraflex.studies.optimisation.slopes import (
    DIFFERENCES,
    EXACT,
    NO_SLOPES,
    no_exact_slopes,
    run_slopes,
    slope_column,
)
from paraflex.studies.optimisation.study import DesignStudy

if TYPE_CHECKING:
    import pyarrow as pa


@dataclass(frozen=True)
class Session:
    """Results of a session of a search.

    Attributes
    ----------
    evaluate : Evaluate
        Evaluator with all evaluated designs.
    stopped : str
        Reason of termination, as text.
    interrupted : bool
        Whether the user stopped the session.
    seconds : float
        Wall time of the session [s].
    """

    evaluate: Evaluate
    stopped: str
    interrupted: bool
    seconds: float


class SearchOutcome(Protocol):
    """Protocol of the result of a search."""

    def write(self, study: DesignStudy[Result], folder: Path) -> None:
        """Write the result into a folder."""


R = TypeVar("R", bound=SearchOutcome)


def search(
    study: DesignStudy[Result],
    folder: Path,
    open_workers: Callable[[], Engine],
    solve: Callable[[Evaluate], str],
    on_evaluated: Callable[[Evaluate, EvaluatedDesign], None] | None = None,
    *,
    run: RunTask | None = None,
    result: Callable[[Session], R],
) -> R:
    """Run a search in a folder, which is locked meanwhile, and return its result.

    Parameters
    ----------
    study : DesignStudy
        Study to solve.
    folder : Path
        Folder of the study. A folder left by an earlier session is continued: designs with rows in it are read.
    open_workers : callable
        Function that starts the workers.
    solve : callable
        Search method: it requests designs from the evaluator and returns the reason of termination.
    on_evaluated : callable, optional
        Function called with the evaluator and each design when it is evaluated.
    run : callable, optional
        Function that runs a task: `run_task`, replaced in tests only.
    result : callable
        Function that builds the result of a session, which is written together with the table.

    Raises
    ------
    InputError
        Invalid study, folder of another study, or engine that is not available.
    OutputError
        Folder that can no longer be written. Results written before are kept, and the same call continues from them.
    """
    began = time.perf_counter()
    exact = _slopes_run(study, run)
    account = study_account(study.name, study.setting, study.parameters, study.content())
    schema = record_schema(study, slopes=exact is not None)
    with open_campaign(folder, account, schema, partial(is_row_of, study.setting)) as campaign:
        compile_kernels_for(study.base.model().mechanism)
        evaluate = Evaluate(study, campaign.journal, open_workers(), run or run_task, on_evaluated, exact)
        try:
            stopped, interrupted = _solved(evaluate, solve), False
        except KeyboardInterrupt:
            stopped, interrupted = "interrupted", True
        with campaign.published(finished=not interrupted) as new:
            found = result(Session(evaluate, stopped, interrupted, time.perf_counter() - began))
            found.write(study, new)
    return found


def record_schema(study: DesignStudy[Result], *, slopes: bool) -> pa.Schema:
    """Return the columns of the table: those of a sweep, and exact derivatives of the metrics if `slopes` is True."""
    import pyarrow as pa

    schema = table_schema(study.setting, study.base.members)
    names = [slope_column(column, name) for column in study.columns for name in study.setting.names] if slopes else []
    for name in names:
        schema = schema.append(pa.field(name, pa.float64()))
    return schema.append(pa.field(NO_SLOPES, pa.string())) if slopes else schema


def sampled_start(
    study: DesignStudy[Result], evaluate: Evaluate, best: Callable[[list[EvaluatedDesign]], EvaluatedDesign | None]
) -> EvaluatedDesign:
    """Evaluate the start and the initial samples of the study, and return the best of them."""
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
