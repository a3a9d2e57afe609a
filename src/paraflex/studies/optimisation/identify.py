"""Identification of the parameters that reproduce given metrics, with their confidence intervals."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from paraflex.arguments import checked_arguments, named_in_errors
from paraflex.arrays import Array, Brief
from paraflex.campaign import OnProgress, Workers
from paraflex.campaign.study import Result
from paraflex.designs.run import RunTask
from paraflex.designs.schema import StudyFile, study_table
from paraflex.designs.units import check_unit_of_metric
from paraflex.errors import InputError, suggestion
from paraflex.results.numbers import finite_or_none
from .evaluate import Evaluate, EvaluatedDesign, LimitReached, Session
from .fit import closest, fit, residual_slopes, residuals, root_mean_square
from .objective import Target
from .problem import running_start
from .result import SearchResult, at_bounds, of_session
from .schema import StudyTable, TargetTable
from .session import SearchStudy, Solver, sampled_start
from .slopes import ExactSlopes, no_exact_slopes, slopes_of
from .study import DesignStudy, SweepStudy, base_study, read_search

# Condition number of the Jacobian, with parameters as fractions of their ranges, above which its weakest direction is
# undetermined.
ILL_CONDITIONED = 1e3
# Largest accepted relative difference between a change of the residuals and the prediction by the Jacobian.
_AGREES = 0.5
# Probability of a normally distributed value within one standard deviation of its mean.
ONE_DEVIATION = math.erf(math.sqrt(0.5))


@dataclass(frozen=True)
class Confidence(Brief):
    """Accuracy to which the targets determine the parameters, linearised about the identified design.

    Attributes
    ----------
    deviations : mapping of str to float or None
        Half-widths of the 68.27 % confidence intervals of the parameters, in their units: standard errors, from the
        residuals of the fit, times the factor of Student's distribution. None for parameters listed in `reasons`.
    errors : mapping of str to float or None
        Standard errors, the square roots of the diagonal of s^2 (J^T J)^-1.
    reasons : mapping of str to str
        Reasons why parameters have no deviation.
    freedom : int
        Degrees of freedom: number of targets minus number of free parameters.
    correlation : (free, free) array
        Correlation matrix of the free parameters.
    free : tuple of str
        Names of the free parameters, which are not at a bound.
    condition : float
        Condition number of the Jacobian, with parameters as fractions of their ranges.
    weakest : mapping of str to float
        Direction of unit length, in fractions of the ranges, that changes the residuals least.
    """

    deviations: Mapping[str, float | None]
    errors: Mapping[str, float | None]
    reasons: Mapping[str, str]
    freedom: int
    free: tuple[str, ...]
    correlation: Array = field(repr=False)
    condition: float
    weakest: Mapping[str, float]

    @property
    def identifiable(self) -> bool:
        """Whether the targets distinguish the parameters: the condition number is below `ILL_CONDITIONED`."""
        return self.condition < ILL_CONDITIONED

    def to_dict(self) -> dict[str, Any]:
        """Return the estimate as plain values, with None for infinity and NaN, which JSON does not have."""
        return vars(self) | {
            "free": list(self.free),
            "correlation": [[finite_or_none(x) for x in row] for row in self.correlation.tolist()],
            "condition": finite_or_none(self.condition),
            "telling": self.identifiable,
        }

    def without_errors(self, reason: str) -> "Confidence":
        """Return a copy without deviations and standard errors, with a reason for each free parameter."""
        none = dict.fromkeys(self.deviations)
        reasons = {name: self.reasons[name] if name not in self.free else reason for name in none}
        return replace(self, deviations=none, errors=none, reasons=reasons)


def student_factor(freedom: int) -> float:
    """Return the half-width of the 68.27 % interval of Student's distribution, in standard errors.

    The factor is 1.84 for one degree of freedom, 1.32 for two, and 1 in the limit of infinitely many.
    """
    from scipy.special import stdtrit

    return float(stdtrit(freedom, 0.5 * (1.0 + ONE_DEVIATION)))


def confidence(
    study: DesignStudy[Result],
    targets: Sequence[Target],
    design: EvaluatedDesign,
    jacobian: Array,
    bound: Mapping[str, str],
) -> Confidence:
    """Estimate the deviations of the parameters from the Jacobian at the identified design.

    Parameters
    ----------
    study : DesignStudy
        Study with the parameters and their ranges.
    targets : sequence of Target
        Targets of the identification.
    design : EvaluatedDesign
        Identified design.
    jacobian : (targets, parameters) array
        Jacobian of the residuals with respect to the coordinates in the unit cube.
    bound : mapping of str to str
        Parameters at a bound, with the name of that bound; they are treated as known.
    """
    names = study.setting.names
    free = [k for k, name in enumerate(names) if name not in bound]
    _, stretches, directions = np.linalg.svd(jacobian[:, free], full_matrices=True)
    stretches = np.concatenate([stretches, np.zeros(len(free) - stretches.size)])
    sharp = bool(free) and stretches[-1] > np.finfo(float).eps * stretches[0]
    freedom = len(targets) - len(free)
    none: dict[str, float | None] = dict.fromkeys(names)
    found = Confidence(
        deviations=none,
        errors=none,
        reasons={name: f"at its {side} bound" for name, side in bound.items()},
        freedom=freedom,
        correlation=np.full((len(free), len(free)), np.nan),
        free=tuple(names[k] for k in free),
        condition=float(stretches[0] / stretches[-1]) if sharp else np.inf if free else 1.0,
        weakest={names[k]: float(x) for k, x in zip(free, directions[-1], strict=True)} if free else {},
    )
    if not free:
        return found
    spread = np.full(len(free), np.nan)
    if sharp:
        covariance = directions.T @ np.diag(stretches**-2.0) @ directions
        spread = np.sqrt(np.diag(covariance))
        found = replace(found, correlation=covariance / np.outer(spread, spread))
    if freedom <= 0:
        return found.without_errors(f"{len(targets)} targets are too few to judge {len(free)} free parameters")
    if not found.identifiable:
        return found.without_errors("the targets cannot tell the parameters apart")
    left = _standard_deviation(targets, design, freedom)
    scaled = left * spread * study.per_unit(design.design)[free]
    errors = none | {names[k]: float(x) for k, x in zip(free, scaled, strict=True)}
    factor = student_factor(freedom)
    return replace(
        found, errors=errors, deviations={name: None if x is None else factor * x for name, x in errors.items()}
    )


def checked(
    study: DesignStudy[Result],
    targets: Sequence[Target],
    evaluate: Callable[[Sequence[tuple[float, ...]]], list[EvaluatedDesign]],
    design: EvaluatedDesign,
    jacobian: Array,
    found: Confidence,
) -> Confidence:
    """Remove the deviations if the residuals do not change as the Jacobian predicts.

    Along every principal direction of the Jacobian, two designs are evaluated one standard error to either side. If the
    Jacobian is correct and the residuals are linear, the residuals differ between the two by twice their standard
    deviation. Noise of the runs, wrong derivatives and nonlinearity all appear as a deviation from this prediction.
    """
    if all(value is None for value in found.deviations.values()):
        return found
    free = [study.setting.names.index(name) for name in found.free]
    _, stretches, directions = np.linalg.svd(jacobian[:, free], full_matrices=False)
    middle = study.unit(design.design)
    steps = np.zeros((len(free), middle.size))
    steps[:, free] = directions * (_standard_deviation(targets, design, found.freedom) / stretches)[:, None]
    for step in steps:
        # Shorten the step so that both sides lie within the bounds.
        room = np.minimum(middle, 1.0 - middle) / np.maximum(np.abs(step), np.finfo(float).tiny)
        step *= min(1.0, float(room[free].min()))
    done = evaluate([study.design(middle + sign * step) for step in steps for sign in (-1.0, 1.0)])
    for k, step in enumerate(steps):
        sides = done[2 * k : 2 * k + 2]
        along = ", ".join(f"{1e2 * step[j]:+.2g} % {study.setting.names[j]}" for j in free)
        if not all(each.complete for each in sides):
            return found.without_errors(f"a design one standard error away does not run (along {along} of the ranges)")
        change = 0.5 * (residuals(targets, sides[1]) - residuals(targets, sides[0]))
        predicted = jacobian @ step
        off = float(np.linalg.norm(change - predicted) / np.linalg.norm(predicted))
        if not off <= _AGREES:
            return found.without_errors(
                f"one standard error along {along} of the ranges changes the residuals by {1e2 * off:.0f} % otherwise "
                "than their derivatives say: noise of the runs, or no straight line"
            )
    return found


def _standard_deviation(targets: Sequence[Target], design: EvaluatedDesign, freedom: int) -> float:
    """Estimate the standard deviation of the residuals from the fit."""
    return float(np.sqrt(np.sum(residuals(targets, design) ** 2) / freedom))


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
def load_identification(file: StudyFile) -> IdentificationStudy:
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
    study: IdentificationStudy | StudyFile,
    folder: str | Path,
    *,
    workers: Workers | int | None = None,
    on_progress: OnProgress | None = None,
    run: RunTask | None = None,
) -> IdentificationResult:
    """Identify the parameters that reproduce the targets of a study.

    Parameters
    ----------
    study : IdentificationStudy, str, Path or mapping
        Study, its file, or the contents of one.
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
