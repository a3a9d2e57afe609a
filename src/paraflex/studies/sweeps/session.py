"""Thousands of runs of a mechanism whose numbers vary: one row each, whoever computes them and however often begun."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paraflex.arguments import checked_arguments
from paraflex.compilation import compile_kernels_for
from paraflex.errors import InputError, OutputError
from paraflex.results import save_results
from paraflex.studies.sweeps.engines import THREADS, Engine, LostWorker, open_engine, outcomes
from paraflex.studies.sweeps.folder import TRAJECTORIES, claim, done_runs, forget_unfinished, held
from paraflex.studies.sweeps.run import Outcome, Row, Task, lost, run_task
from paraflex.studies.sweeps.study import SweepStudy, load_sweep
from paraflex.studies.sweeps.table import (
    RESULTS,
    PartsWriter,
    beyond_counts,
    merge,
    parts,
    status_counts,
    table_schema,
    write_json,
)

# Rows are written when so many wait, or the first has waited so long [s]: what a crash can cost.
_ROWS, _SECONDS = 2048, 2.0
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
class SweepResult:
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
        """The one table, or the folder of its parts while the sweep is unfinished; pandas reads either."""
        return self.folder / (RESULTS if self.finished else "parts")

    def _repr_html_(self) -> str:
        """In notebooks."""
        from paraflex.studies.html import sweep_html

        return sweep_html(self)


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
    folder = Path(folder)
    if limit is not None and limit < 1:
        raise InputError("must be positive", field="--limit", value=limit, remedy="say how many runs")
    with held(folder):
        claim(folder, study)
        forget_unfinished(folder)
        session = _Session(study, folder, on_progress)
        began = time.perf_counter()
        interrupted = False
        if not session.finished:
            compile_kernels_for(study.model().mechanism)
            made = open_engine(engine, workers, cluster) if isinstance(engine, str) else engine
            interrupted = session.go(made, partial(run, study.setting), limit)
        counts = session.end()
    return SweepResult(
        folder, study.runs, counts, session.fresh, time.perf_counter() - began, interrupted, session.beyond
    )


class _Session:
    """One session of a sweep: what is done, what waits to be written."""

    def __init__(self, study: SweepStudy, folder: Path, on_progress: Callable[[SweepProgress], None] | None) -> None:
        setting = study.setting
        self.study, self.folder, self.on_progress = study, folder, on_progress
        self.schema = table_schema(setting.names, setting.whole, setting.metrics, study.motors)
        done, self.ranges = done_runs(folder, study.runs)
        # All rows of a task are written at once.
        self.done: NDArray[np.bool_] = done[:: len(setting.modes)].copy()
        self.writer = PartsWriter(folder, self.schema)
        self.waiting: list[Row] = []
        self.written, self.fresh, self.began = time.monotonic(), 0, time.monotonic()

    @property
    def finished(self) -> bool:
        return bool(np.all(self.done))

    def go(self, engine: Engine, run: Callable[..., Outcome], limit: int | None) -> bool:
        """Do what is left; whether the user stopped it. The engine is closed."""
        abandon, self.began = True, time.monotonic()
        try:
            for task, outcome in outcomes(engine, run, self._tasks(limit)):
                self._take(lost(self.study.setting, task, str(outcome)) if isinstance(outcome, LostWorker) else outcome)
            abandon = False
            return False
        except KeyboardInterrupt:
            return True
        finally:
            try:
                engine.close(abandon=abandon)
            finally:
                self._write()

    def end(self) -> dict[str, int]:
        """Merge the parts if every run is there; how many runs ended how."""
        table = self.folder / RESULTS
        if self.finished and not table.exists():
            merge(self.folder, self.schema, self.ranges)
        files = [table] if table.exists() else parts(self.folder)
        counts, self.beyond = status_counts(files), beyond_counts(files)
        self._summarise(counts)
        return counts

    def _tasks(self, limit: int | None) -> Iterator[Task]:
        setting, given = self.study.setting, 0
        for number in range(self.done.size):
            if limit is not None and given >= limit:
                return
            if not self.done[number]:
                design, path = divmod(number, len(setting.paths))
                given += len(setting.modes)
                yield Task(number, design, tuple(self.study.designs[design].tolist()), setting.paths[path])

    def _take(self, outcome: Outcome) -> None:
        # A trajectory stands before its row does: a row without one would never be made again.
        for name, data in outcome.trajectories.items():
            self._keep(name, data)
        self.waiting += outcome.rows
        self.done[outcome.task.number] = True
        self.fresh += len(outcome.rows)
        now = time.monotonic()
        if len(self.waiting) >= _ROWS or now - self.written > _SECONDS:
            self._write()
        if self.on_progress is not None:
            total, done = self.study.runs, int(np.count_nonzero(self.done)) * len(self.study.setting.modes)
            self.on_progress(SweepProgress(done, total, self.fresh, now - self.began))

    def _keep(self, name: str, data: Any) -> None:
        try:
            (self.folder / TRAJECTORIES).mkdir(exist_ok=True)
        except OSError as error:
            raise OutputError(
                f"cannot be written ({error.strerror or error})", field=str(self.folder / TRAJECTORIES)
            ) from error
        save_results(data, self.folder / TRAJECTORIES / f"{name}.nc")

    def _write(self) -> None:
        if self.waiting:
            rows, self.waiting = self.waiting, []
            self.writer.append(rows)
            runs = [row["run"] for row in rows]
            self.ranges = np.vstack([self.ranges, [[min(runs), max(runs)]]])
        self.written = time.monotonic()

    def _summarise(self, counts: dict[str, int]) -> None:
        """Counts beside the table; the time taken stands nowhere in it, for it is no result."""
        told = {
            "name": self.study.name,
            "runs": self.study.runs,
            "done": sum(counts.values()),
            "status": counts,
            "beyond_validity": self.beyond,
        }
        write_json(self.folder / SUMMARY, told)
