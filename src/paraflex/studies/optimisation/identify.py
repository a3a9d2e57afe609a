"""The parameters that reproduce given metrics."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from paraflex.arguments import checked_arguments
from paraflex.campaign import THREADS, Engine, open_engine
from paraflex.studies.optimisation.best import write_best
from paraflex.studies.optimisation.confidence import Confidence, checked, confidence
from paraflex.studies.optimisation.evaluate import Evaluate, Evaluated, LimitReached, RunTask
from paraflex.studies.optimisation.fit import closest, fit, residual_slopes, root_mean_square
from paraflex.studies.optimisation.objective import Target
from paraflex.studies.optimisation.optimise import at_bounds, failures
from paraflex.studies.optimisation.problem import running_start
from paraflex.studies.optimisation.result import SearchResult
from paraflex.studies.optimisation.session import RESULT, Progress, Session, sampled_start, search
from paraflex.studies.optimisation.slopes import ExactSlopes, no_exact_slopes, slopes_of
from paraflex.studies.optimisation.study import DesignStudy, load_identification
from paraflex.writing import GO_ON, write_json


@dataclass(frozen=True)
class Reached:
    """A target and what the best design makes of it.

    Attributes
    ----------
    target : Target
    reached, start : float
        The metric at the best design and at the start.
    residual : float
        weight (reached - value) / value, or without the division.
    """

    target: Target
    reached: float
    start: float
    residual: float

    def told(self) -> dict[str, Any]:
        """In plain values."""
        return self.target.told() | {"reached": self.reached, "start": self.start, "residual": self.residual}


@dataclass(frozen=True, kw_only=True)
class IdentificationResult(SearchResult):
    """Where an identification stands after a session: see `SearchResult`; its history tells root mean square residuals.

    Attributes
    ----------
    residual, start_residual : float or None
        Root mean square of all residuals; None before the start has run.
    targets : tuple of Reached
    confidence : Confidence or None
        None where the search ended before derivatives at the best design were known.
    derivatives : str
        "exact", or "differences" and why.
    """

    residual: float | None
    start_residual: float | None
    targets: tuple[Reached, ...]
    confidence: Confidence | None
    derivatives: str

    def figures(self) -> dict[str, Any]:
        """In plain values; without times and counts of a session, which are no results."""
        return super().figures() | {
            "targets": [each.told() for each in self.targets],
            "confidence": None if self.confidence is None else self.confidence.figures(),
        }


@checked_arguments()
def identify(
    study: DesignStudy | str | Path,
    folder: str | Path,
    *,
    engine: str | Engine = THREADS,
    workers: int | None = None,
    cluster: str | None = None,
    on_progress: Callable[[Progress], None] | None = None,
    run: RunTask | None = None,
) -> IdentificationResult:
    """Look for the parameters that reproduce the targets of a study, by least squares within bounds.

    Parameters
    ----------
    study : DesignStudy, str or Path
        A study, or its file.
    folder : str or Path
        For the table of all runs, `result.json` and `best.toml`; one that another session left is gone on with.
    engine, workers, cluster, on_progress, run
        See `optimise`.

    Returns
    -------
    IdentificationResult
        A KeyboardInterrupt ends the session with what is there, marked so.

    Raises
    ------
    InputError
        The study cannot be, its start cannot be run, the folder is another's, or the engine cannot be had.
    OutputError
        The folder cannot be written any more; what was written stays, and the same call goes on from there.
    """
    study = study if isinstance(study, DesignStudy) else load_identification(study)
    solution = _Solution(study)
    watch = None if on_progress is None else _watch(study, on_progress)
    opened = partial(open_engine, engine, workers, cluster)
    session = search(study, Path(folder), opened, solution.solve, watch, run=run)
    result = _result(study, Path(folder), session, solution)
    write_json(Path(folder) / RESULT, {"kind": "identification", "name": study.name} | result.figures(), remedy=GO_ON)
    if result.residual is not None:
        write_best(Path(folder), study, tuple(result.values.values()))
    return result


class _Solution:
    """The search itself; keeps where it ended, what derivatives there say, and how they were taken."""

    def __init__(self, study: DesignStudy) -> None:
        self.study = study
        self.best: Evaluated | None = None
        self.confidence: Confidence | None = None
        self.derivatives = ""

    def solve(self, evaluate: Evaluate) -> str:
        """From the start, or the best of samples, to the least residuals."""
        study, slopes = self.study, slopes_of(self.study, evaluate)
        running_start(study, evaluate)
        start = sampled_start(study, evaluate, lambda designs: closest(study.targets, designs))
        stopped = fit(study, evaluate, slopes, start)
        self.best = best = closest(study.targets, evaluate.history)
        assert best is not None
        try:
            jacobian = residual_slopes(study.targets, slopes(best))
            found = confidence(study, best, jacobian, at_bounds(study, best.design))
            self.confidence = checked(study, evaluate, best, jacobian, found)
        except LimitReached:
            pass
        self.derivatives = _how(study, slopes)
        return stopped


def _how(study: DesignStudy, slopes: object) -> str:
    """How derivatives were taken, and why not exactly."""
    if isinstance(slopes, ExactSlopes):
        others = list(dict.fromkeys(slopes.reasons))
        return f"exact; differences at {len(slopes.reasons)} designs ({others[0]})" if others else "exact"
    reason = no_exact_slopes(study) if study.search.gradients is None else ""
    return f"differences ({reason})" if reason else "differences"


def _result(study: DesignStudy, folder: Path, session: Session, solution: _Solution) -> IdentificationResult:
    history, names = session.evaluate.history, study.setting.names
    start, best = session.evaluate.known.get(study.start), solution.best or closest(study.targets, history)
    running = start is not None and start.complete
    failed, reasons = failures(history)
    return IdentificationResult(
        folder=folder,
        table=session.table,
        values={} if best is None else dict(zip(names, best.design, strict=True)),
        start=dict(zip(names, study.start, strict=True)),
        residual=None if best is None else root_mean_square(study.targets, best),
        start_residual=root_mean_square(study.targets, start) if start is not None and running else None,
        targets=tuple(_reached(target, best, start) for target in study.targets) if best and start and running else (),
        confidence=solution.confidence,
        derivatives=solution.derivatives,
        bounds={} if best is None else at_bounds(study, best.design),
        evaluations=len(history),
        fresh=session.evaluate.fresh,
        failed=failed,
        reasons=reasons,
        stopped=session.stopped,
        interrupted=session.interrupted,
        seconds=session.seconds,
        history=tuple(
            (each.number, root_mean_square(study.targets, each) if each.complete else None, each.complete)
            for each in history
        ),
    )


def _reached(target: Target, best: Evaluated, start: Evaluated) -> Reached:
    reached, before = (float(each.metric(target.column)[target.run]) for each in (best, start))
    return Reached(target, reached, before, target.residual(best))


def _watch(study: DesignStudy, on_progress: Callable[[Progress], None]) -> Callable[[Evaluate, Evaluated], None]:
    least: list[float] = []

    def watch(evaluate: Evaluate, done: Evaluated) -> None:
        if done.complete:
            least[:] = [min([root_mean_square(study.targets, done), *least])]
        on_progress(Progress(len(evaluate.known), study.search.evaluations, least[0] if least else None))

    return watch
