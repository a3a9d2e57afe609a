"""Sweeps: thousands of runs of a mechanism, one row each, whose results do not depend on workers and restarts."""

import hashlib
import re
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from paraflex.arguments import checked_arguments, named_in_errors
from paraflex.arrays import Array, Mask
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
    check_shared,
    kept_in,
    open_campaign,
    outcomes,
    shard_folder,
    table_name,
)
from paraflex.compilation import compile_kernels_for
from paraflex.equilibria.conditions import conditions
from paraflex.errors import InputError
from paraflex.files import Model, model_from
from paraflex.folders import check_inside
from paraflex.results.metrics import METRICS, VALIDITY, MetricMembers
from paraflex.results.storage import write_results
from paraflex.results.tables import read_parquet
from paraflex.writing import GO_ON, write_json
from .reopen import study_account
from .run import STATUS_COMPLETE, Outcome, RunTask, Task, is_row_of, lost, run_id, run_task, table_schema
from .samples import SweptParameter, check_varied, designs
from .schema import StudyFile, SweepTable, study_table
from .setting import Setting, make_setting


@dataclass(frozen=True)
class SweepResult(KeptResult):
    """State of a sweep after a session.

    Attributes
    ----------
    name : str
        Name of the study.
    folder : Path
        Folder of the results.
    total : int
        Number of runs of the study.
    counts : mapping of str to int
        Number of rows by status: "complete", "failed", "invalid".
    fresh : int
        Number of runs in this session.
    seconds : float
        Duration of this session [s].
    interrupted : bool
        Whether the user stopped the session.
    beyond : int
        Number of runs outside the range of validity of their model (validity above 1).
    coarse : int
        Number of complete runs with doubtful largest loads, for which the rows give a reason (see `coarseness`).
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
        """Number of rows written."""
        return sum(self.counts.values())

    @property
    def complete(self) -> bool:
        """Whether every run has its row."""
        return self.done == self.total

    def to_dict(self) -> dict[str, Any]:
        """Return the counts as plain values; the computing time is left out because it is not a result."""
        counts = {"runs": self.total, "done": self.done, "status": dict(self.counts)}
        return {"name": self.name} | counts | {"beyond_validity": self.beyond, "too_few_samples": self.coarse}


@dataclass(frozen=True)
class SweptResult(KeptResult):
    """Base class of results evaluated from the runs of a sweep, stored in their folder.

    Attributes
    ----------
    sweep : SweepResult
        State of the sweep.
    """

    sweep: SweepResult

    @property
    def folder(self) -> Path:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Folder of the runs and of the results evaluated from them."""
        return self.sweep.folder

    @property
    def complete(self) -> bool:
        """Whether all runs are done."""
        return self.sweep.complete


@named_in_errors("a sweep", "a SweepStudy")
@dataclass(frozen=True)
class SweepStudy(Study["SweepResult"]):
    """Parameter sweep of a mechanism: its settings, parameters and designs.

    Attributes
    ----------
    name : str
        Name of the study.
    setting : Setting
        Common settings of all runs.
    parameters : tuple of SweptParameter
        Parameters.
    kind : str
        Kind of sampling.
    designs : (k, parameters) array
        Values of the parameters of each design.
    members : mapping of str to tuple of str
        Names of the mechanism's motors, drives, joints or named coordinates, each of which has a column of a metric.
    """

    name: str
    setting: Setting
    parameters: tuple[SweptParameter, ...]
    kind: str
    designs: Array
    members: MetricMembers

    @property
    def runs(self) -> int:
        """Number of runs: number of designs times paths times modes."""
        return len(self.designs) * len(self.setting.paths) * len(self.setting.modes)

    def model(self) -> Model:
        """Return the model of the mechanism as its file describes it."""
        return model_from(dict(self.setting.data), self.setting.source)

    def content(self) -> dict[str, Any]:
        """Return all inputs that determine the results, as plain values: equal contents give equal tables."""
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
        shard: str | None = None,
        run: RunTask = run_task,
    ) -> SweepResult:
        """Do the runs for which a folder has no rows yet; see `Study.run`.

        Rows of shards in the folder are taken over.

        Parameters
        ----------
        folder, workers, on_progress
            Folder of the results, workers and progress callback; see `Study.run`.
        limit : int, optional
            Largest number of runs in this session, rounded up to whole tasks (all modes of a design along a path); no
            limit by default.
        shard : str, optional
            Part of the runs, "3/8" for the third of eight, for several processes that share no memory, as in a batch
            system: it is done in a folder of its own within the folder, `shard-3-of-8`. All runs by default.
        run : callable
            Function that does a task; by default `run_task`.
        """
        folder, setting = kept_in(folder), self.setting
        part, parts = (1, 1) if shard is None else _part(shard)
        if limit is not None and limit < 1:
            raise InputError("must be positive", field="--limit", value=limit, remedy="give the number of runs")
        account = study_account(self.name, setting, self.parameters, self.content(), runs=self.runs, sampling=self.kind)
        if shard is not None:
            check_shared(folder, account)
            folder = shard_folder(folder, part, parts)
        with open_campaign(folder, account, table_schema(setting, self.members), self._has) as campaign:
            session = _Session(self, campaign, on_progress, slice(part - 1, None, parts))
            if session.complete:
                return session.end(interrupted=False)
            compile_kernels_for(self.model().mechanism)
            return session.end(session.go((workers or Workers()).open(), partial(run, setting), limit))

    def _task(self, number: int) -> Task:
        design, path = divmod(number, len(self.setting.paths))
        return Task(number, design, tuple(self.designs[design].tolist()), self.setting.paths[path])

    def _has(self, row: Row) -> bool:
        """Check whether a row belongs to this study, and to the run whose number it has."""
        number, mode = divmod(row["run"], len(self.setting.modes))
        if not 0 <= row["run"] < self.runs or not is_row_of(self.setting, row):
            return False
        return row["id"] == run_id(self.setting, self._task(number), self.setting.modes[mode])


@checked_arguments()
def load_sweep(file: StudyFile) -> SweepStudy:
    """Read the study file of a sweep.

    Parameters
    ----------
    file : str, Path or mapping
        TOML file; see docs/sweeps.md.

    Raises
    ------
    InputError
        A field does not fit the schema or the mechanism; the error names file, field, value and remedy.
    """
    with study_table(SweepTable, file) as (table, folder):
        return make_study(table, folder)


def make_study(table: SweepTable, folder: Path) -> SweepStudy:
    """Return the sweep that a study file in a folder describes; see `load_sweep`."""
    setting, parameters, model = make_setting(table, folder)
    for parameter in parameters:
        check_varied(parameter, table.sampling.kind)
    sampling = table.sampling
    members = MetricMembers(model.mechanism, conditions(model.mechanism, model.statics) if setting.statics else None)
    for name in setting.metrics:
        METRICS[name].columns(members)
    return SweepStudy(
        name=table.name,
        setting=setting,
        parameters=parameters,
        kind=sampling.kind,
        designs=designs(parameters, sampling.kind, sampling.number, sampling.seed),
        members=members,
    )


@checked_arguments()
def sweep(
    study: SweepStudy | StudyFile,
    folder: str | Path,
    *,
    workers: Workers | int | None = None,
    limit: int | None = None,
    shard: str | None = None,
    on_progress: OnProgress | None = None,
    run: RunTask = run_task,
) -> SweepResult:
    """Do the runs of a sweep for which a folder has no rows yet; equivalent to `study.run(folder)`.

    Parameters
    ----------
    study : SweepStudy, str, Path or mapping
        Sweep, its study file, or the contents of one.
    folder : str or Path
        Folder of the results.
    workers : Workers or int, optional
        Workers, or number of threads: see `Workers`.
    limit, shard, on_progress, run
        Arguments of `SweepStudy.run`.
    """
    study = study if isinstance(study, SweepStudy) else load_sweep(study)
    return study.run(folder, workers=Workers.of(workers), on_progress=on_progress, limit=limit, shard=shard, run=run)


def _part(shard: str) -> tuple[int, int]:
    """Return the number of a shard and that of all shards."""
    found = re.fullmatch(r"\s*(\d{1,9})\s*/\s*(\d{1,9})\s*", shard, re.ASCII)
    part, parts = map(int, found.groups()) if found else (0, 0)
    if not 1 <= part <= parts:
        raise InputError(
            "not a part of a study", field="--shard", value=shard, remedy="write 3/8 for the third of eight"
        )
    return part, parts


class _Session:
    """Session of a sweep, with its finished tasks."""

    def __init__(self, study: SweepStudy, campaign: Campaign, on_progress: OnProgress | None, own: slice) -> None:
        self.study, self.setting, self.campaign, self.own = study, study.setting, campaign, own
        self.on_progress = on_progress
        self.began, self.fresh = time.perf_counter(), 0
        rows = np.zeros(study.runs // len(self.setting.modes), dtype=np.intp)
        for number in self._runs():
            if 0 <= number < study.runs:  # a foreign folder may have others
                rows[number // len(self.setting.modes)] += 1
        # A task with a missing row is repeated completely.
        self.done: Mask = rows == len(self.setting.modes)

    def _runs(self) -> Iterator[int]:
        """Yield the run numbers of all rows, except of complete runs whose trajectory was removed from the folder."""
        kept = self.campaign.folder.path / TRAJECTORIES
        if not (self.setting.trajectories and kept.is_dir()):
            return self.campaign.journal.runs()
        there = {each.stem for each in kept.iterdir()}
        rows = self.campaign.journal.rows()
        return (row["run"] for row in rows if row.get("status") != STATUS_COMPLETE or row["id"] in there)

    @property
    def complete(self) -> bool:
        return bool(np.all(self.done[self.own]))

    @property
    def runs(self) -> int:
        return self.done[self.own].size * len(self.setting.modes)

    def go(self, engine: Engine, run: Callable[..., Outcome], limit: int | None) -> bool:
        """Do the remaining runs, close the engine, and return whether the user stopped the session."""
        began = time.perf_counter()
        try:
            with engine:
                for task, outcome in outcomes(engine, run, self._tasks(limit)):
                    self._take(lost(self.setting, task, str(outcome)) if isinstance(outcome, LostWorker) else outcome)
                    if self.on_progress is not None:
                        done, seconds = int(np.count_nonzero(self.done)), time.perf_counter() - began
                        modes = len(self.setting.modes)
                        self.on_progress(Progress(done * modes, self.runs, self.fresh, seconds))
        except KeyboardInterrupt:
            return True
        return False

    def end(self, interrupted: bool) -> SweepResult:
        """Write the table and the counts, and return the state of the sweep."""
        with self.campaign.published(finished=self.complete) as new:
            table = read_parquet(new / table_name(finished=self.complete), ["status", "reason", VALIDITY])
            complete = table["status"].to_numpy() == STATUS_COMPLETE
            result = SweepResult(
                name=self.study.name,
                folder=self.campaign.folder.path,
                total=self.runs,
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
        for number in range(self.done.size)[self.own]:
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
