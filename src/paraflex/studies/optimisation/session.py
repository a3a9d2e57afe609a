"""One session of a search: the folder held, workers had, rows written whatever ends it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from paraflex.compilation import compile_kernels_for
from paraflex.errors import InputError
from paraflex.studies.optimisation.evaluate import Evaluate, Evaluated, LimitReached, RunTask
from paraflex.studies.optimisation.minimise import DEFAULT_METHOD, WITH_SLOPES
from paraflex.studies.optimisation.record import Record, record_schema
from paraflex.studies.optimisation.slopes import DIFFERENCES, EXACT, no_exact_slopes, run_slopes
from paraflex.studies.optimisation.study import DesignStudy
from paraflex.studies.sweeps.engines import THREADS, Engine, open_engine
from paraflex.studies.sweeps.folder import claim_for, forget_unfinished, held, ranges_of
from paraflex.studies.sweeps.run import run_task
from paraflex.studies.sweeps.samples import SOBOL, designs

INTERRUPTED = "interrupted"


@dataclass(frozen=True)
class Workers:
    """Who computes.

    Attributes
    ----------
    engine : str or Engine
        "threads", "processes" or "dask".
    number : int, optional
        As many as there are processors by default.
    cluster : str, optional
        Address of a Dask scheduler.
    run : callable, optional
        What is done for a task: `run_task` but in tests.
    """

    engine: str | Engine = THREADS
    number: int | None = None
    cluster: str | None = None
    run: RunTask | None = None

    def open(self) -> Engine:
        """The engine."""
        return open_engine(self.engine, self.number, self.cluster) if isinstance(self.engine, str) else self.engine


@dataclass(frozen=True)
class Progress:
    """How far a search is.

    Attributes
    ----------
    evaluations, limit : int
        Designs, those of earlier sessions among the done ones.
    best : float or None
        The least objective, or root mean square residual, until now.
    """

    evaluations: int
    limit: int
    best: float | None


@dataclass(frozen=True)
class Session:
    """What a session of a search leaves.

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
    table : Path
        Of its rows.
    """

    evaluate: Evaluate
    stopped: str
    interrupted: bool
    seconds: float
    table: Path


def search(
    study: DesignStudy,
    folder: Path,
    workers: Workers,
    solve: Callable[[Evaluate], str],
    on_evaluated: Callable[[Evaluate, Evaluated], None] | None = None,
) -> Session:
    """Solve a study in a folder, which is held while it lasts.

    Parameters
    ----------
    study : DesignStudy
    folder : Path
        One that another session left is gone on with: what it has rows of is read.
    workers : Workers
    solve : callable
        Asks for designs; tells why it ended.
    on_evaluated : callable, optional
        Called with each design as it is done.

    Raises
    ------
    InputError
        The study cannot be, the folder is another's, or the engine cannot be had.
    OutputError
        The folder cannot be written any more; what was written stays, and the same call goes on from there.
    """
    with held(folder):
        told = {"name": study.name, "ranges": ranges_of(study.parameters)}
        claim_for(folder, study.content(), study.setting.versions, told)
        forget_unfinished(folder)
        began = time.perf_counter()
        exact = _slopes_run(study, workers)
        record = Record(folder, record_schema(study, slopes=exact is not None))
        compile_kernels_for(study.base.model().mechanism)
        engine = workers.open()
        evaluate = Evaluate(study, record, engine, workers.run or run_task, on_evaluated, exact)
        stopped = _solved(evaluate, solve)
        if stopped != INTERRUPTED:
            record.finish()
        return Session(evaluate, stopped, stopped == INTERRUPTED, time.perf_counter() - began, record.table)


def sampled_start(
    study: DesignStudy, evaluate: Evaluate, best: Callable[[list[Evaluated]], Evaluated | None]
) -> Evaluated:
    """The start, or what is best of it and the samples that the study wants looked at first."""
    number, asked = study.search.samples, [study.start]
    if number:
        points = designs(study.parameters, SOBOL, number, study.search.seed)
        asked += [study.design(study.unit(point)) for point in points.tolist()]
    done = evaluate(asked)
    return best(done) or done[0]


def _solved(evaluate: Evaluate, solve: Callable[[Evaluate], str]) -> str:
    abandon = True
    try:
        stopped = solve(evaluate)
        abandon = False
        return stopped
    except LimitReached:
        abandon = False
        return f"evaluations = {evaluate.study.search.evaluations} are done"
    except KeyboardInterrupt:
        return INTERRUPTED
    finally:
        try:
            evaluate.engine.close(abandon=abandon)
        finally:
            evaluate.record.write()


def _slopes_run(study: DesignStudy, workers: Workers) -> RunTask | None:
    """What is done for exact derivatives; None where differences are taken.

    Raises
    ------
    InputError
        They are asked for, and there are none.
    """
    asked = study.search.gradients
    if asked == DIFFERENCES or (asked is None and (study.objective is not None or workers.run is not None)):
        return None
    method = study.search.method or DEFAULT_METHOD
    if study.objective is not None and method not in WITH_SLOPES:
        raise InputError(
            f"{method} uses no gradients", field="search.gradients", value=EXACT,
            remedy=f"leave it out, or choose from {', '.join(WITH_SLOPES)}",
        )  # fmt: skip
    reason = no_exact_slopes(study)
    if reason and asked == EXACT:
        raise InputError(
            f"no exact derivatives ({reason})", field="search.gradients", value=EXACT, remedy='say "differences"'
        )
    sizes = tuple(float(p.high) - float(p.low) for p in study.parameters)  # pyright: ignore[reportArgumentType]
    return None if reason else partial(run_slopes, study.columns, sizes)
