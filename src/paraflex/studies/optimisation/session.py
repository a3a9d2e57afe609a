"""One session of a search: it locks the folder, starts workers, and writes rows however it ends."""

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
from paraflex.studies.optimisation.evaluate import Evaluate, Evaluated, LimitReached, RunTask
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
        With all designs asked for.
    stopped : str
        Why it ended, in words.
    interrupted : bool
        Whether the user stopped it.
    seconds : float
        It took.
    """

    evaluate: Evaluate
    stopped: str
    interrupted: bool
    seconds: float


class Found(Protocol):
    """What a search finds."""

    def write(self, study: DesignStudy[Result], folder: Path) -> None:
        """Write it into a folder."""


R = TypeVar("R", bound=Found)


def search(
    study: DesignStudy[Result],
    folder: Path,
    open_workers: Callable[[], Engine],
    solve: Callable[[Evaluate], str],
    on_evaluated: Callable[[Evaluate, Evaluated], None] | None = None,
    *,
    run: RunTask | None = None,
    result: Callable[[Session], R],
) -> R:
    """Solve a study in a folder, which is locked meanwhile.

    Parameters
    ----------
    study : DesignStudy
    folder : Path
        One that another session left is gone on with: what it has rows of is read.
    open_workers : callable
        Gives who computes.
    solve : callable
        Asks for designs; tells why it ended.
    on_evaluated : callable, optional
        Called with each design as it is done.
    run : callable, optional
        What is done for a task: `run_task` but in tests.
    result : callable
        Makes the result of a session, which is written with the table.

    Raises
    ------
    InputError
        The study cannot be, the folder is another's, or the engine cannot be had.
    OutputError
        The folder cannot be written any more; what was written stays, and the same call goes on from there.
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
    """Columns of the table: those of a sweep, and exact derivatives of the metrics."""
    import pyarrow as pa

    schema = table_schema(study.setting, study.base.members)
    names = [slope_column(column, name) for column in study.columns for name in study.setting.names] if slopes else []
    for name in names:
        schema = schema.append(pa.field(name, pa.float64()))
    return schema.append(pa.field(NO_SLOPES, pa.string())) if slopes else schema


def sampled_start(
    study: DesignStudy[Result], evaluate: Evaluate, best: Callable[[list[Evaluated]], Evaluated | None]
) -> Evaluated:
    """The best of the start and the initial samples of the study."""
    number, asked = study.search.samples, [study.start]
    if number:
        points = designs(study.parameters, SOBOL, number, study.search.seed)
        asked += [study.design(study.unit(point)) for point in points.tolist()]
    done = evaluate(asked)
    return best(done) or done[0]


def _solved(evaluate: Evaluate, solve: Callable[[Evaluate], str]) -> str:
    with evaluate.engine:
        try:
            return solve(evaluate)
        except LimitReached:
            return f"evaluations = {evaluate.study.search.evaluations} are done"


def _slopes_run(study: DesignStudy[Result], run: RunTask | None) -> RunTask | None:
    """Function for exact derivatives; None if differences are taken.

    Raises
    ------
    InputError
        They are asked for, and there are none.
    """
    asked = study.search.gradients
    if asked == DIFFERENCES or (asked is None and (run is not None or not study.least_squares)):
        return None
    method = study.search.method or DEFAULT_SEARCH
    if not study.least_squares and method not in WITH_SLOPES:
        raise InputError(
            f"{method} uses no gradients", field="search.gradients", value=EXACT,
            remedy=f"leave it out, or choose from {', '.join(WITH_SLOPES)}",
        )  # fmt: skip
    reason = no_exact_slopes(study)
    if reason and asked == EXACT:
        raise InputError(
            f"no exact derivatives ({reason})", field="search.gradients", value=EXACT, remedy='say "differences"'
        )
    sizes = tuple(high - low for low, high in (p.ends for p in study.parameters))
    return None if reason else partial(run_slopes, study.columns, sizes)
