"""Evaluation of designs, each once and several in parallel, with the rows of their runs."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from paraflex.arrays import Array, Brief
from paraflex.campaign import Engine, Journal, LostWorker, Result, Row, checked_rows, outcomes
from paraflex.designs.run import STATUS_COMPLETE, Outcome, RunTask, Task, lost, run_id, run_task
from paraflex.designs.setting import Setting
from .study import DesignStudy

Design = tuple[float, ...]


class LimitReached(Exception):
    """Exception raised when the limit of evaluated designs is reached."""


@dataclass(frozen=True)
class EvaluatedDesign(Brief):
    """Evaluated design and the rows of its runs.

    Attributes
    ----------
    number : int
        Number of the design, in the order of requests.
    design : tuple of float
        Parameter values.
    rows : tuple of dict
        Rows of all runs of the design, ordered by path, then by mode.
    counting : tuple of str
        Columns whose values must be finite.
    """

    number: int
    design: Design
    rows: tuple[Row, ...]
    counting: tuple[str, ...] = ()

    @property
    def reason(self) -> str:
        """Reason why the design cannot be used; empty if all runs are complete with finite metrics."""
        for row in self.rows:
            whose = f'{row["path"]}, mode "{row["mode"]}": ' if row["mode"] else ""
            if row["status"] != STATUS_COMPLETE:
                return f"{whose}{row['reason']}"
            for column in self.counting:
                if row.get(column) is None or not math.isfinite(row[column]):
                    return f"{whose}{column} is not a number"
        return ""

    @property
    def complete(self) -> bool:
        """Whether all runs of the design are complete."""
        return not self.reason

    def metric(self, column: str) -> Array:
        """Return a metric of every run (runs,)."""
        return np.array([row[column] for row in self.rows], dtype=float)


@dataclass(eq=False)
class Evaluate:
    """Evaluator of designs, which reads existing rows from the journal instead of computing them again.

    Attributes
    ----------
    study : DesignStudy
        Study whose designs are evaluated.
    journal : Journal
        Journal of the study's folder; designs with rows in it are not computed again.
    engine : Engine
        Workers that compute the runs.
    run : callable
        Function that runs a task: `run_task`, replaced in tests only.
    on_evaluated : callable, optional
        Function called with the evaluator and each design when it is evaluated.
    run_slopes : callable, optional
        Function that computes exact derivatives for a task, in rows as those of `slopes.run_slopes`.
    """

    study: DesignStudy[Result]
    journal: Journal
    engine: Engine
    run: RunTask = run_task
    on_evaluated: "Callable[[Evaluate, EvaluatedDesign], None] | None" = None
    run_slopes: RunTask | None = None

    def __post_init__(self) -> None:
        self.known: dict[Design, EvaluatedDesign] = {}
        self.fresh: int = 0
        self._rows = {row["id"]: row for row in checked_rows(self.journal)}
        self._numbers: dict[Design, int] = {}
        self._single = [replace(self.study.setting, modes=(mode,)) for mode in self.study.setting.modes]

    @property
    def history(self) -> list[EvaluatedDesign]:
        """Evaluated designs in the order in which they were requested."""
        return sorted(self.known.values(), key=lambda each: each.number)

    def __call__(self, designs: Sequence[Design]) -> list[EvaluatedDesign]:
        """Evaluate designs, and return them with their rows in the given order.

        Raises
        ------
        LimitReached
            Limit of designs exceeded; the designs within the limit have been evaluated.
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

    def at(self, x: Array) -> EvaluatedDesign:
        """Evaluate the design at a point of the unit cube."""
        return self([self.study.design(x)])[0]

    def add_slopes(self, at: EvaluatedDesign) -> EvaluatedDesign:
        """Compute exact derivatives at a design, store them in its rows, and return the extended design."""
        assert self.run_slopes is not None
        for _, found in self._compute([at.design], self.run_slopes):
            rows = tuple(row | more for row, more in zip(at.rows, found, strict=True))
            self.journal.add(rows)
            self.known[at.design] = replace(at, rows=rows)
        return self.known[at.design]

    def _read(self, design: Design) -> bool:
        setting = self.study.setting
        ids = [run_id(setting, Task(0, 0, design, path), mode) for path in setting.paths for mode in setting.modes]
        found = all(each in self._rows for each in ids)
        if found:
            self._keep(design, tuple(self._rows[each] for each in ids))
        return found

    def _keep(self, design: Design, rows: tuple[Row, ...]) -> None:
        done = EvaluatedDesign(self._numbers[design], design, rows, self.study.columns)
        self.known[design] = done
        if self.on_evaluated is not None:
            self.on_evaluated(self, done)

    def _compute(self, designs: list[Design], run: RunTask) -> Iterator[tuple[Design, tuple[Row, ...]]]:
        """Compute designs, and yield each with all its rows in order of completion."""
        # Those of one design.
        setting, runs = self.study.setting, self.study.base.runs
        rows: dict[Design, dict[tuple[str, str], Row]] = {design: {} for design in designs}
        for job, outcome in outcomes(self.engine, partial(_do, run), self._jobs(designs)):
            if isinstance(outcome, LostWorker):
                outcome = lost(job.setting, job.task, str(outcome))
            design = job.task.values
            rows[design] |= {(row["path"], row["mode"]): row for row in outcome.rows}
            if len(rows[design]) == runs:
                ordered = [rows[design][path, mode] for path in setting.paths for mode in setting.modes]
                number = self._numbers[design]
                first = number * runs
                yield design, tuple(row | {"run": first + k, "design": number} for k, row in enumerate(ordered))

    def _jobs(self, designs: list[Design]) -> "Iterator[Job]":
        """Yield one job per design and path, or one per mode if workers would be idle; rows do not depend on it."""
        setting = self.study.setting
        apart = len(designs) * len(setting.paths) < self.engine.workers
        for design in designs:
            for number, path in enumerate(setting.paths):
                task = Task(number, self._numbers[design], design, path)
                yield from (Job(each, task) for each in (self._single if apart else (setting,)))


@dataclass(frozen=True)
class Session:
    """Results of a session of a search.

    Attributes
    ----------
    folder : Path
        Folder of the study.
    evaluate : Evaluate
        Evaluator with all evaluated designs.
    stopped : str
        Reason of termination, as text.
    interrupted : bool
        Whether the user stopped the session.
    seconds : float
        Wall time of the session [s].
    """

    folder: Path
    evaluate: Evaluate
    stopped: str
    interrupted: bool
    seconds: float

    @property
    def start(self) -> EvaluatedDesign | None:
        """Start of the search; None if it does not run."""
        start = self.evaluate.known.get(self.evaluate.study.start)
        return start if start is not None and start.complete else None


class Job(NamedTuple):
    """Task with the setting that holds its modes."""

    setting: Setting
    task: Task


def _do(run: RunTask, job: Job, *watch: Any) -> Outcome:
    return run(job.setting, job.task, *watch)
