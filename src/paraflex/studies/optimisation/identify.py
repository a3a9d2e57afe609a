"""Identification of the parameters that reproduce given metrics."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from paraflex.arguments import checked_arguments, named_in_errors
from paraflex.campaign import OnProgress, Workers
from paraflex.designs.run import RunTask
from paraflex.designs.schema import study_table
from paraflex.designs.units import check_unit_of_metric
from paraflex.errors import InputError, suggestion
from .confidence import Confidence, checked, confidence
from .evaluate import Evaluate, EvaluatedDesign, LimitReached, Session
from .fit import closest, fit, residual_slopes, root_mean_square
from .objective import Target
from .problem import running_start
from .result import SearchResult, at_bounds, of_session
from .schema import StudyTable, TargetTable
from .session import SearchStudy, Solver, sampled_start
from .slopes import ExactSlopes, no_exact_slopes, slopes_of
from .study import SweepStudy, base_study, read_search


@dataclass(frozen=True)
class TargetResult:
    """Target with its metric at the best design and at the start.

    Attributes
    ----------
    target : Target
        Target with its value and weight.
    reached, start : float
        Values of the metric at the best design and at the start.
    residual : float
        Residual weight (reached - value) / |value|, without the division if the target is not relative.
    """

    target: Target
    reached: float
    start: float
    residual: float

    def to_dict(self) -> dict[str, Any]:
        """Return target, metric and residual as plain values."""
        target = self.target
        of_target = {"path": target.path, "mode": target.mode, "metric": target.column, "value": target.value}
        return of_target | {"reached": self.reached, "start": self.start, "residual": self.residual}


@dataclass(frozen=True, kw_only=True)
class IdentificationResult(SearchResult):
    """State of an identification after a session; see `SearchResult`. Its history holds RMS residuals.

    Attributes
    ----------
    residual, start_residual : float or None
        Root mean square of all residuals at the best design and at the start; None before the start has run.
    targets : tuple of TargetResult
        Targets with the values reached.
    confidence : Confidence or None
        Confidence intervals of the parameters; None if the search ended before the derivatives at the best design were
        computed.
    derivatives : str
        Kind of derivatives: "exact" or "differences", with the reason for differences; empty if the search ended early.
    """

    kind: ClassVar[str] = "identification"
    residual: float | None
    start_residual: float | None
    targets: tuple[TargetResult, ...]
    confidence: Confidence | None
    derivatives: str

    def to_dict(self) -> dict[str, Any]:
        """Return the result as plain values, without the times and counts of the session."""
        return super().to_dict() | {
            "targets": [each.to_dict() for each in self.targets],
            "confidence": None if self.confidence is None else self.confidence.to_dict(),
        }


@named_in_errors("an identification", "what load_identification returns")
@dataclass(frozen=True)
class IdentificationStudy(SearchStudy[IdentificationResult]):
    """Identification of the parameters that reproduce targets, by bounded least squares; see `DesignStudy`.

    Attributes
    ----------
    targets : tuple of Target
        Metrics to reproduce.
    """

    targets: tuple[Target, ...]
    least_squares: ClassVar[bool] = True

    @property
    def columns(self) -> tuple[str, ...]:
        """Metrics of the targets."""
        return tuple(dict.fromkeys(target.column for target in self.targets))

    def goal(self) -> dict[str, Any]:
        """Return the targets as plain values."""
        return {"targets": [vars(target) for target in self.targets]}

    def _solver(self) -> Solver[IdentificationResult]:
        return _Identifier(self)


@checked_arguments()
def load_identification(file: str | Path) -> IdentificationStudy:
    """Read the study file of an identification; see `load_optimisation`."""
    with study_table(StudyTable, file) as (table, folder):
        if not table.target:
            raise InputError("is missing", field="target", remedy="add [[target]] tables with metric and value")
        if table.search.method is not None:
            raise InputError(
                "an identification is a problem of least squares", field="search.method", value=table.search.method,
                remedy="leave it out",
            )  # fmt: skip
        columns = {f"target.{k}.metric": target.metric for k, target in enumerate(table.target)}
        base = base_study(table, folder, columns)
        targets = tuple(_target(entry, k, base) for k, entry in enumerate(table.target))
        return IdentificationStudy(base, read_search(table.search), targets)


@checked_arguments()
def identify(
    study: IdentificationStudy | str | Path,
    folder: str | Path,
    *,
    workers: Workers | int | None = None,
    on_progress: OnProgress | None = None,
    run: RunTask | None = None,
) -> IdentificationResult:
    """Identify the parameters that reproduce the targets of a study.

    Parameters
    ----------
    study : IdentificationStudy, str or Path
        Study, or its file.
    folder, workers, on_progress
        See `Study.run`; an integer number of workers is a number of threads.
    run : callable, optional
        Function that runs a task; `run_task` by default.
    """
    study = study if isinstance(study, IdentificationStudy) else load_identification(study)
    return study.run(folder, workers=Workers.of(workers), on_progress=on_progress, run=run)


def _target(entry: TargetTable, number: int, base: SweepStudy) -> Target:
    field, setting = f"target.{number}", base.setting
    check_unit_of_metric(entry.value, entry.metric, base.members, f"{field}.value")
    path = _one(f"{field}.path", entry.path, setting.paths)
    mode = _one(f"{field}.mode", entry.mode, setting.modes)
    if entry.relative and entry.value == 0.0:
        raise InputError(
            "nothing is relative to zero", field=f"{field}.value", value=0.0, remedy="write relative = false"
        )
    if not entry.weight > 0.0:
        raise InputError("must be positive", field=f"{field}.weight", value=entry.weight, remedy="leave the target out")
    run = setting.paths.index(path) * len(setting.modes) + setting.modes.index(mode)
    return Target(entry.metric, run, path, mode, float(entry.value), entry.weight, entry.relative)


def _one(field: str, name: str | None, known: tuple[str, ...]) -> str:
    if name is None and len(known) == 1:
        return known[0]
    if name is None:
        raise InputError(
            "the study has several, and none is named", field=field, remedy=f"choose from {', '.join(known)}"
        )
    if name not in known:
        raise InputError("the study has none of that name", field=field, value=name, remedy=suggestion(name, known))
    return name


@dataclass
class _Identifier(Solver[IdentificationResult]):
    """Least-squares fit: best design, confidence intervals there, kind of derivatives, and least residual so far."""

    study: IdentificationStudy
    best: EvaluatedDesign | None = None
    confidence: Confidence | None = None
    derivatives: str = ""
    residual: float | None = None

    def solve(self, evaluate: Evaluate) -> str:
        """Minimise the residuals from the best of the start and the initial samples; return the reason of the end."""
        study, targets, slopes = self.study, self.study.targets, slopes_of(evaluate)
        running_start(evaluate)
        start = sampled_start(evaluate, lambda designs: closest(targets, designs))
        stopped = fit(targets, evaluate, slopes, start)
        self.best = best = closest(targets, evaluate.history)
        assert best is not None
        try:
            jacobian = residual_slopes(targets, slopes(best))
            found = confidence(study, targets, best, jacobian, at_bounds(study, best.design))
            self.confidence = checked(study, targets, evaluate, best, jacobian, found)
        except LimitReached:
            pass
        self.derivatives = _how(study, slopes)
        return stopped

    def least(self, done: EvaluatedDesign) -> float | None:
        """Return the least RMS residual so far; see `Solver`."""
        if done.complete:
            residual = root_mean_square(self.study.targets, done)
            self.residual = residual if self.residual is None else min(residual, self.residual)
        return self.residual

    def result(self, session: Session) -> IdentificationResult:
        """Return the design with the smallest residuals, with its metrics and those of the start."""
        history, targets, start = session.evaluate.history, self.study.targets, session.start
        best = self.best or closest(targets, history)
        return IdentificationResult(
            **of_session(session, best),
            residual=None if best is None else root_mean_square(targets, best),
            start_residual=None if start is None else root_mean_square(targets, start),
            targets=tuple(_reached(target, best, start) for target in targets) if best and start else (),
            confidence=self.confidence,
            derivatives=self.derivatives,
            history=tuple(
                (each.number, root_mean_square(targets, each) if each.complete else None, each.complete)
                for each in history
            ),
        )


def _how(study: IdentificationStudy, slopes: object) -> str:
    """Describe the kind of derivatives used, with the reason if they are not exact."""
    if isinstance(slopes, ExactSlopes):
        others = list(dict.fromkeys(slopes.reasons))
        return f"exact; differences at {len(slopes.reasons)} designs ({others[0]})" if others else "exact"
    reason = no_exact_slopes(study) if study.search.gradients is None else ""
    return f"differences ({reason})" if reason else "differences"


def _reached(target: Target, best: EvaluatedDesign, start: EvaluatedDesign) -> TargetResult:
    reached, before = (float(each.metric(target.column)[target.run]) for each in (best, start))
    return TargetResult(target, reached, before, target.residual(best))
