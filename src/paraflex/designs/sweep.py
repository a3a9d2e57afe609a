"""Sweeps: thousands of runs of a mechanism, one row each, independent of the workers and of restarts."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paraflex.arguments import checked_arguments, given_as
from paraflex.arrays import Array
from paraflex.campaign import (
    TRAJECTORIES,
    Campaign,
    Engine,
    KeptResult,
    LostWorker,
    OnProgress,
    Progress,
    Row,
    Study,
    Workers,
    kept_in,
    open_campaign,
    outcomes,
    table_name,
)
from paraflex.compilation import compile_kernels_for
from paraflex.designs.measure import members_of
from paraflex.designs.reopen import study_account
from paraflex.designs.run import STATUS_COMPLETE, Outcome, Task, is_row_of, lost, run_id, run_task, table_schema
from paraflex.designs.samples import Varied, check_varied, designs
from paraflex.designs.schema import SweepTable, study_table
from paraflex.designs.setting import Setting, make_setting
from paraflex.equilibria.given import conditions
from paraflex.errors import InputError
from paraflex.files import Model, model_from
from paraflex.folders import check_inside
from paraflex.results.metrics import VALIDITY, Members
from paraflex.results.parquet import read_parquet
from paraflex.results.storage import write_results
from paraflex.writing import GO_ON, write_json

RunTask = Callable[..., Outcome]


@dataclass(frozen=True)
class SweepResult(KeptResult):
    """State of a sweep after a session.

    Attributes
    ----------
    name : str
        Of the study.
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
    coarse : int
        Runs with too few samples for their largest loads: complete, with a reason.
    """

    values_file = "summary.json"
    name: str
    folder: Path
    total: int
    counts: Mapping[str, int] = field(default_factory=dict)
    fresh: int = 0
    seconds: float = 0.0
    interrupted: bool = False
    beyond: int = 0
    coarse: int = 0

    @property
    def done(self) -> int:
        """Rows written."""
        return sum(self.counts.values())

    @property
    def complete(self) -> bool:
        """Whether every run has its row."""
        return self.done == self.total

    def to_dict(self) -> dict[str, Any]:
        """Counts in plain values; the time taken stands nowhere in them, for it is no result."""
        counts = {"runs": self.total, "done": self.done, "status": dict(self.counts)}
        return {"name": self.name} | counts | {"beyond_validity": self.beyond, "too_few_samples": self.coarse}


@dataclass(frozen=True)
class SweptResult(KeptResult):
    """What is found from the runs of a sweep; it stands in their folder.

    Attributes
    ----------
    sweep : SweepResult
    """

    sweep: SweepResult

    @property
    def folder(self) -> Path:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Of the runs, and of what is found from them."""
        return self.sweep.folder

    @property
    def complete(self) -> bool:
        """Whether all runs are done."""
        return self.sweep.complete


@given_as("a sweep", "a SweepStudy")
@dataclass(frozen=True)
class SweepStudy(Study["SweepResult"]):
    """A sweep: a mechanism, what varies in it, what is run and what is kept.

    Attributes
    ----------
    name : str
    setting : Setting
    parameters : tuple of Varied
    kind : str
        Of sampling.
    designs : (k, parameters) array
    members : mapping of str to tuple of str
        Names of the mechanism's motors, drives, joints or named coordinates, of which metrics have a column each.
    """

    name: str
    setting: Setting
    parameters: tuple[Varied, ...]
    kind: str
    designs: Array
    members: Members

    @property
    def runs(self) -> int:
        """Number of runs: designs times paths times modes."""
        return len(self.designs) * len(self.setting.paths) * len(self.setting.modes)

    def model(self) -> Model:
        """The mechanism as its file has it."""
        return model_from(dict(self.setting.data), self.setting.source)

    def content(self) -> dict[str, Any]:
        """What the results depend on, in plain values: the same content gives the same table."""
        setting = self.setting
        return {
            "mechanism": dict(setting.data),
            "paths": list(setting.paths),
            "modes": list(setting.modes),
            "duration": setting.duration,
            "samples": setting.samples,
            "assembly": setting.assembly,
            **{name: True for name in ("balanced", "statics") if getattr(setting, name)},
            "integration": dict(setting.integration),
            "metrics": list(setting.metrics),
            "trajectories": setting.trajectories,
            "parameters": [
                {"name": p.name, "places": [list(place) for place in places], "whole": p.whole}
                for p, places in zip(self.parameters, setting.places, strict=True)
            ],
            "designs": hashlib.sha256(np.ascontiguousarray(self.designs, dtype="<f8").tobytes()).hexdigest(),
        }

    def run(
        self,
        folder: str | Path | None = None,
        *,
        workers: Workers | None = None,
        on_progress: OnProgress | None = None,
        limit: int | None = None,
        run: RunTask = run_task,
    ) -> SweepResult:
        """Do the runs that a folder has no rows for yet; see `Study.run`.

        Parameters
        ----------
        folder, workers, on_progress
            See `Study.run`.
        limit : int, optional
            Of runs in this session, rounded up to whole designs.
        run : callable
            What is done for a task.
        """
        folder, setting = kept_in(folder), self.setting
        if limit is not None and limit < 1:
            raise InputError("must be positive", field="--limit", value=limit, remedy="say how many runs")
        account = study_account(self.name, setting, self.parameters, self.content(), runs=self.runs, sampling=self.kind)
        with open_campaign(folder, account, table_schema(setting, self.members), self._has) as campaign:
            session = _Session(self, campaign, on_progress)
            interrupted = False
            if not session.complete:
                compile_kernels_for(self.model().mechanism)
                interrupted = session.go((workers or Workers()).open(), partial(run, setting), limit)
            return session.end(interrupted)

    def _task(self, number: int) -> Task:
        design, path = divmod(number, len(self.setting.paths))
        return Task(number, design, tuple(self.designs[design].tolist()), self.setting.paths[path])

    def _has(self, row: Row) -> bool:
        """Whether a row is of this study, and of the run that it says."""
        number, mode = divmod(row["run"], len(self.setting.modes))
        if not 0 <= row["run"] < self.runs or not is_row_of(self.setting, row):
            return False
        return row["id"] == run_id(self.setting, self._task(number), self.setting.modes[mode])


@checked_arguments()
def load_sweep(file: str | Path) -> SweepStudy:
    """Read a study file.

    Parameters
    ----------
    file : str or Path
        TOML; see docs/sweeps.md.

    Raises
    ------
    InputError
        Anything in it that does not fit the file or the mechanism: it names file, field, value and remedy.
    """
    with study_table(SweepTable, file) as (table, folder):
        return make_study(table, folder)


def make_study(table: SweepTable, folder: Path) -> SweepStudy:
    """A study from a file in a folder; see `load_sweep`."""
    setting, parameters, model = make_setting(table, folder)
    for parameter in parameters:
        check_varied(parameter, table.sampling.kind)
    sampling = table.sampling
    return SweepStudy(
        name=table.name,
        setting=setting,
        parameters=parameters,
        kind=sampling.kind,
        designs=designs(parameters, sampling.kind, sampling.number, sampling.seed),
        members=members_of(model.mechanism, conditions(model.mechanism, model.statics) if setting.statics else None),
    )


@checked_arguments()
def sweep(
    study: SweepStudy | str | Path,
    folder: str | Path,
    *,
    workers: Workers | int | None = None,
    limit: int | None = None,
    on_progress: OnProgress | None = None,
    run: RunTask = run_task,
) -> SweepResult:
    """Do the runs of a study, or of its file, that a folder has no rows for yet.

    `study.run(folder)` in one call: see there and `Workers`.
    """
    study = study if isinstance(study, SweepStudy) else load_sweep(study)
    return study.run(folder, workers=Workers.of(workers), on_progress=on_progress, limit=limit, run=run)


class _Session:
    """One session of a sweep: its finished runs, and how it ended."""

    def __init__(self, study: SweepStudy, campaign: Campaign, on_progress: OnProgress | None) -> None:
        self.study, self.setting, self.campaign = study, study.setting, campaign
        self.on_progress = on_progress
        self.began, self.fresh = time.perf_counter(), 0
        rows = np.zeros(study.runs // len(self.setting.modes), dtype=np.intp)
        for number in self._runs():
            if 0 <= number < study.runs:  # others are of whoever sent the folder
                rows[number // len(self.setting.modes)] += 1
        # Of a task that lacks a row all are made again.
        self.done: NDArray[np.bool_] = rows == len(self.setting.modes)

    def _runs(self) -> Iterator[int]:
        """The runs of all rows, but for those whose trajectory was taken out of the folder to be made again."""
        kept = self.campaign.folder.path / TRAJECTORIES
        if not (self.setting.trajectories and kept.is_dir()):
            return self.campaign.journal.runs()
        there = {each.stem for each in kept.iterdir()}
        rows = self.campaign.journal.rows()
        return (row["run"] for row in rows if row.get("status") != STATUS_COMPLETE or row["id"] in there)

    @property
    def complete(self) -> bool:
        return bool(np.all(self.done))

    def go(self, engine: Engine, run: Callable[..., Outcome], limit: int | None) -> bool:
        """Do the remaining runs; whether the user stopped it. The engine is closed."""
        began = time.perf_counter()
        try:
            with engine:
                for task, outcome in outcomes(engine, run, self._tasks(limit)):
                    self._take(lost(self.setting, task, str(outcome)) if isinstance(outcome, LostWorker) else outcome)
                    if self.on_progress is not None:
                        done, seconds = int(np.count_nonzero(self.done)), time.perf_counter() - began
                        modes = len(self.setting.modes)
                        self.on_progress(Progress(done * modes, self.study.runs, self.fresh, seconds))
        except KeyboardInterrupt:
            return True
        return False

    def end(self, interrupted: bool) -> SweepResult:
        """Write the table, and counts beside it."""
        with self.campaign.published(finished=self.complete) as new:
            table = read_parquet(new / table_name(finished=self.complete), ["status", "reason", VALIDITY])
            complete = table["status"].to_numpy() == STATUS_COMPLETE
            result = SweepResult(
                name=self.study.name,
                folder=self.campaign.folder.path,
                total=self.study.runs,
                counts={each["values"]: each["counts"] for each in table["status"].value_counts().to_pylist()},
                fresh=self.fresh,
                seconds=time.perf_counter() - self.began,
                interrupted=interrupted,
                beyond=int(np.sum(table[VALIDITY].to_numpy() > 1.0)),
                coarse=int(np.sum(complete & (table["reason"].to_numpy() != ""))),
            )
            write_json(new / result.values_file, result.to_dict(), remedy=GO_ON)
        return result

    def _tasks(self, limit: int | None) -> Iterator[Task]:
        given = 0
        for number in range(self.done.size):
            if limit is not None and given >= limit:
                return
            if not self.done[number]:
                given += len(self.setting.modes)
                yield self.study._task(number)

    def _take(self, outcome: Outcome) -> None:
        # A trajectory is written before its row, as a run with a row is not repeated.
        folder = self.campaign.folder.path
        for name, data in outcome.trajectories.items():
            check_inside(folder, f"{TRAJECTORIES}/{name}.nc")
            write_results(data, folder / TRAJECTORIES / f"{name}.nc", remedy=GO_ON)
        self.campaign.journal.add(outcome.rows)
        self.done[outcome.task.number] = True
        self.fresh += len(outcome.rows)
