"""Evaluation of designs: each once, several in parallel, each with its rows of the table."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from paraflex.arrays import Array
from paraflex.campaign import Engine, Journal, LostWorker, Row, check_rows, outcomes
from paraflex.campaign.study import Result
from paraflex.designs.run import STATUS_COMPLETE, Outcome, Task, lost, run_id, run_task
from paraflex.designs.setting import Setting
from paraflex.studies.optimisation.study import DesignStudy

Design = tuple[float, ...]
RunTask = Callable[..., Outcome]


class LimitReached(Exception):
    """The limit of evaluated designs has been reached."""


@dataclass(frozen=True)
class Evaluated:
    """A design and its rows.

    Attributes
    ----------
    number : int
        In the order designs were asked for.
    design : tuple of float
        Its numbers.
    rows : tuple of dict
        Of all its runs: paths, and modes of each.
    counting : tuple of str
        Columns that must be numbers.
    """

    number: int
    design: Design
    rows: tuple[Row, ...]
    counting: tuple[str, ...] = ()

    @property
    def reason(self) -> str:
        """Reason why the design cannot be used; empty if all runs are complete."""
        for row in self.rows:
            whose = f'{row["path"]}, mode "{row["mode"]}": ' if row["mode"] else ""
            if row["status"] != STATUS_COMPLETE:
                return f"{whose}{row['reason']}"
            for column in self.counting:
                if row.get(column) is None or not math.isfinite(row[column]):
                    return f"{whose}{column} is no number"
        return ""

    @property
    def complete(self) -> bool:
        """Whether all its runs are complete."""
        return not self.reason

    def metric(self, column: str) -> Array:
        """A metric of every run, (runs,)."""
        return np.array([row[column] for row in self.rows], dtype=float)


class Evaluate:
    """Evaluation of designs; rows of a folder are read, not computed.

    Parameters
    ----------
    study : DesignStudy
    journal : Journal
        What has rows there is read.
    engine : Engine
    run : callable
        What is done for a task: `run_task` but in tests.
    on_evaluated : callable, optional
        Called with each design as it is done.
    run_slopes : callable, optional
        What is done for exact derivatives: its rows hold what `slopes.run_slopes` finds.
    """

    def __init__(
        self,
        study: DesignStudy[Result],
        journal: Journal,
        engine: Engine,
        run: RunTask = run_task,
        on_evaluated: Callable[[Evaluate, Evaluated], None] | None = None,
        run_slopes: RunTask | None = None,
    ) -> None:
        self.study = study
        self.journal = journal
        self.engine = engine
        self.run = run
        self.on_evaluated = on_evaluated
        self.run_slopes = run_slopes
        self.known: dict[Design, Evaluated] = {}
        self.fresh: int = 0
        check_rows(journal)
        self._rows = {row["id"]: row for row in journal.rows()}
        self._numbers: dict[Design, int] = {}
        self._single = {mode: replace(study.setting, modes=(mode,)) for mode in study.setting.modes}

    @property
    def history(self) -> list[Evaluated]:
        """All designs requested and evaluated, in that order."""
        return sorted(self.known.values(), key=lambda each: each.number)

    def __call__(self, designs: Sequence[Design]) -> list[Evaluated]:
        """Designs with their rows, in the order given.

        Raises
        ------
        LimitReached
            Not all of them are within the limit; those that are have been evaluated.
        """
        for design in designs:
            self._numbers.setdefault(design, len(self._numbers))
        limit = self.study.search.evaluations
        within = [design for design in dict.fromkeys(designs) if self._numbers[design] < limit]
        lacking = [design for design in within if design not in self.known and not self._read(design)]
        for design, rows in self._compute(lacking, self.run):
            self.journal.add(rows)
            self.fresh += 1
            self._keep(design, rows)
        if len(within) < len(set(designs)):
            raise LimitReached
        return [self.known[design] for design in designs]

    def add_slopes(self, at: Evaluated) -> Evaluated:
        """A design with the derivatives of `run_slopes` in its rows, which are kept with it."""
        assert self.run_slopes is not None
        for _, found in self._compute([at.design], self.run_slopes):
            rows = tuple(row | more for row, more in zip(at.rows, found, strict=True))
            self.journal.add(rows)
            self.known[at.design] = replace(at, rows=rows)
        return self.known[at.design]

    def _read(self, design: Design) -> bool:
        setting = self.study.setting
        tasks = [Task(0, 0, design, path) for path in setting.paths]
        ids = [run_id(setting, task, mode) for task in tasks for mode in setting.modes]
        found = all(each in self._rows for each in ids)
        if found:
            self._keep(design, tuple(self._rows[each] for each in ids))
        return found

    def _keep(self, design: Design, rows: tuple[Row, ...]) -> None:
        done = Evaluated(self._numbers[design], design, rows, self.study.columns)
        self.known[design] = done
        if self.on_evaluated is not None:
            self.on_evaluated(self, done)

    def _compute(self, designs: list[Design], run: RunTask) -> Iterator[tuple[Design, tuple[Row, ...]]]:
        """Designs and all their rows, in order of completion."""
        setting = self.study.setting
        rows: dict[Design, dict[tuple[str, str], Row]] = {design: {} for design in designs}
        for job, outcome in outcomes(self.engine, partial(_do, run), self._jobs(designs)):
            if isinstance(outcome, LostWorker):
                outcome = lost(job.setting, job.task, str(outcome))
            design = job.task.values
            rows[design] |= {(row["path"], row["mode"]): row for row in outcome.rows}
            if len(rows[design]) == self.study.runs:
                ordered = [rows[design][path, mode] for path in setting.paths for mode in setting.modes]
                number = self._numbers[design]
                first = number * self.study.runs
                yield design, tuple(row | {"run": first + k, "design": number} for k, row in enumerate(ordered))

    def _jobs(self, designs: list[Design]) -> Iterator[Job]:
        """One job per design and path, or per mode if workers would be idle. Rows do not depend on it."""
        setting = self.study.setting
        apart = len(designs) * len(setting.paths) < self.engine.workers
        for design in designs:
            for number, path in enumerate(setting.paths):
                task = Task(number, self._numbers[design], design, path)
                yield from (Job(each, task) for each in (self._single.values() if apart else (setting,)))


class Job(NamedTuple):
    """A task, and its modes."""

    setting: Setting
    task: Task


def _do(run: RunTask, job: Job, *watch: Any) -> Outcome:
    return run(job.setting, job.task, *watch)
