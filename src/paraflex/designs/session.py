"""Thousands of runs of a mechanism whose numbers vary: one row each, whoever computes them and however often begun."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from paraflex.arguments import checked_arguments
from paraflex.campaign import (
    RESULTS,
    THREADS,
    TRAJECTORIES,
    UNFINISHED,
    Engine,
    Journal,
    LostWorker,
    open_campaign,
    open_engine,
    outcomes,
    write_table,
)
from paraflex.compilation import compile_kernels_for
from paraflex.designs.reopen import study_account
from paraflex.designs.run import Outcome, Task, lost, run_task, table_schema
from paraflex.designs.study import SweepStudy, load_sweep
from paraflex.display import Shown
from paraflex.errors import InputError
from paraflex.results.metrics import VALIDITY
from paraflex.results.storage import write_results
from paraflex.writing import GO_ON, write_json

SUMMARY = "summary.json"

RunTask = Callable[..., Outcome]


@dataclass(frozen=True)
class SweepProgress:
    """How far a sweep is.

    Attributes
    ----------
    done, total : int
        Runs, those of earlier sessions among the done ones.
    fresh : int
        Of this session.
    seconds : float
        Since it began.
    """

    done: int
    total: int
    fresh: int
    seconds: float

    @property
    def rate(self) -> float:
        """Runs a second in this session."""
        return self.fresh / self.seconds if self.seconds > 0.0 else 0.0

    @property
    def left(self) -> float | None:
        """Time left [s]; None before it can be told."""
        return (self.total - self.done) / self.rate if self.rate > 0.0 else None


@dataclass(frozen=True)
class SweepResult(Shown):
    """Where a sweep stands after a session.

    Attributes
    ----------
    folder : Path
    total : int
        Runs of the study.
    counts : mapping of str to int
        Rows by status: "complete", "failed", "invalid".
    fresh : int
        Runs of this session.
    seconds : float
        It took.
    interrupted : bool
        Whether the user stopped it.
    beyond : int
        Runs beyond what their model can describe: validity above 1.
    """

    folder: Path
    total: int
    counts: Mapping[str, int] = field(default_factory=dict)
    fresh: int = 0
    seconds: float = 0.0
    interrupted: bool = False
    beyond: int = 0

    @property
    def done(self) -> int:
        """Rows written."""
        return sum(self.counts.values())

    @property
    def finished(self) -> bool:
        """Whether every run has its row: then `table` is there."""
        return self.done == self.total

    @property
    def table(self) -> Path:
        """The one table, or that of the runs done while the sweep is unfinished."""
        return self.folder / (RESULTS if self.finished else UNFINISHED)


@checked_arguments()
def sweep(
    study: SweepStudy | str | Path,
    folder: str | Path,
    *,
    engine: str | Engine = THREADS,
    workers: int | None = None,
    cluster: str | None = None,
    limit: int | None = None,
    on_progress: Callable[[SweepProgress], None] | None = None,
    run: RunTask = run_task,
) -> SweepResult:
    """Do the runs of a study that a folder has no rows of yet.

    Parameters
    ----------
    study : SweepStudy, str or Path
        A study, or its file.
    folder : str or Path
        For the table; one that another session left is gone on with.
    engine : str or Engine
        "threads" of this process, "processes", or "dask". Results are the same to the last bit.
    workers : int, optional
        As many as there are processors by default.
    cluster : str, optional
        Address of a Dask scheduler.
    limit : int, optional
        Of runs in this session, rounded up to whole designs.
    on_progress : callable, optional
        Called with how far it is whenever a design is done.
    run : callable
        What is done for a task: `run_task` but in tests.

    Returns
    -------
    SweepResult
        A KeyboardInterrupt ends the session with what is there, marked so.

    Raises
    ------
    InputError
        The study cannot be, the folder is another's, or the engine cannot be had.
    OutputError
        The folder cannot be written any more; what was written stays, and the same call goes on from there.
    """
    study = study if isinstance(study, SweepStudy) else load_sweep(study)
    folder, setting = Path(folder), study.setting
    if limit is not None and limit < 1:
        raise InputError("must be positive", field="--limit", value=limit, remedy="say how many runs")
    account = study_account(study, study.content(), runs=study.runs, sampling=study.kind)
    with open_campaign(folder, account, table_schema(setting, study.motors)) as journal:
        session = _Session(study, folder, journal, on_progress)
        interrupted = False
        if not session.finished:
            compile_kernels_for(study.model().mechanism)
            interrupted = session.go(open_engine(engine, workers, cluster), partial(run, setting), limit)
        return session.end(interrupted)


class _Session:
    """One session of a sweep: what is done, and how it ended."""

    def __init__(
        self, study: SweepStudy, folder: Path, journal: Journal, on_progress: Callable[[SweepProgress], None] | None
    ) -> None:
        self.study, self.setting, self.folder, self.journal = study, study.setting, folder, journal
        self.on_progress = on_progress
        self.began, self.fresh = time.perf_counter(), 0
        rows = np.zeros(study.runs // len(self.setting.modes), dtype=np.intp)
        for number in journal.runs():
            rows[number // len(self.setting.modes)] += 1
        # Of a task that lacks a row all are made again.
        self.done: NDArray[np.bool_] = rows == len(self.setting.modes)

    @property
    def finished(self) -> bool:
        return bool(np.all(self.done))

    def go(self, engine: Engine, run: Callable[..., Outcome], limit: int | None) -> bool:
        """Do what is left; whether the user stopped it. The engine is closed."""
        began = time.perf_counter()
        try:
            with engine:
                for task, outcome in outcomes(engine, run, self._tasks(limit)):
                    self._take(lost(self.setting, task, str(outcome)) if isinstance(outcome, LostWorker) else outcome)
                    if self.on_progress is not None:
                        done, seconds = int(np.count_nonzero(self.done)), time.perf_counter() - began
                        modes = len(self.setting.modes)
                        self.on_progress(SweepProgress(done * modes, self.study.runs, self.fresh, seconds))
        except KeyboardInterrupt:
            return True
        return False

    def end(self, interrupted: bool) -> SweepResult:
        """Write the table, and counts beside it; the time taken stands nowhere in them, for it is no result."""
        import pyarrow.parquet as pq

        folder, runs = self.folder, self.study.runs
        table = pq.read_table(write_table(folder, self.journal, finished=self.finished), columns=["status", VALIDITY])
        counts = {each["values"]: each["counts"] for each in table["status"].value_counts().to_pylist()}
        beyond = int(np.sum(table[VALIDITY].to_numpy() > 1.0))
        summary = {"name": self.study.name, "runs": runs, "done": len(table), "status": counts}
        write_json(folder / SUMMARY, summary | {"beyond_validity": beyond}, remedy=GO_ON)
        seconds = time.perf_counter() - self.began
        return SweepResult(folder, runs, counts, self.fresh, seconds, interrupted, beyond)

    def _tasks(self, limit: int | None) -> Iterator[Task]:
        given = 0
        for number in range(self.done.size):
            if limit is not None and given >= limit:
                return
            if not self.done[number]:
                design, path = divmod(number, len(self.setting.paths))
                given += len(self.setting.modes)
                yield Task(number, design, tuple(self.study.designs[design].tolist()), self.setting.paths[path])

    def _take(self, outcome: Outcome) -> None:
        # A trajectory stands before its row does: a row without one would never be made again.
        for name, data in outcome.trajectories.items():
            write_results(data, self.folder / TRAJECTORIES / f"{name}.nc", remedy=GO_ON)
        self.journal.add(outcome.rows)
        self.done[outcome.task.number] = True
        self.fresh += len(outcome.rows)
