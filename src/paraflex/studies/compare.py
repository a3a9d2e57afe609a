"""Work-precision comparison of integration methods on one motion, with errors relative to a converged run."""

import math
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from paraflex.arguments import CheckedFields, checked_arguments
from paraflex.arrays import Array
from paraflex.campaign import OnProgress, Progress, Result, WholeStudy, Workers, no_workers
from paraflex.errors import InputError, IntegrationError, NumericalError
from paraflex.integrators import METHODS, IntegrationOptions, Solution
from paraflex.integrators.methods import Family, Method, find_method
from .cases import Case
from .comparison import Measurement, MethodComparison, Reference

# The reference run uses the tightest tolerance divided by the first number, its check run twice that tolerance. Their
# time limit is that of a run times the second number.
_FINER, _REFERENCE_PATIENCE = 10.0, 20.0
# Only short runs are repeated: no repetition starts after this total wall time [s].
_LONG_ENOUGH = 3.0
_RUN_COUNTS = (
    "wall_time",
    "steps",
    "rejected",
    "newton_iterations",
    "factorisations",
    "evaluations",
    "constraint_position_max",
    "constraint_velocity_max",
    "energy_balance_max",
)


@dataclass(frozen=True)
class ComparisonOptions(CheckedFields):
    """Options of a comparison of methods.

    Attributes
    ----------
    tolerances : tuple of float
        Tolerances of the methods with error control [m].
    steps : tuple of float
        Step sizes of the methods that accept a fixed step [s]; none by default.
    limit : float
        Wall time at which a run is stopped [s].
    repetitions : int
        Largest number of repetitions of each run; the fastest counts.
    """

    tolerances: tuple[float, ...] = (1e-3, 1e-4, 1e-5, 1e-6)
    steps: tuple[float, ...] = ()
    limit: float = 60.0
    repetitions: int = 3

    def __post_init__(self) -> None:
        super().__post_init__()
        named = [("tolerances", x) for x in self.tolerances] + [("steps", x) for x in self.steps]
        for field, value in [*named, ("limit", self.limit), ("repetitions", self.repetitions)]:
            if not (math.isfinite(value) and value > 0):
                raise InputError("must be positive", field=field, value=value, remedy="leave it out for the default")
        if not (self.tolerances or self.steps):
            raise InputError("nothing to compare", field="tolerances", remedy="give a tolerance or a step")

    @property
    def tightest(self) -> float:
        """Tightest tolerance, or that of the defaults if there are none [m]."""
        return min(self.tolerances or ComparisonOptions.tolerances)


class _TooSlowError(Exception):
    """Error raised when a run exceeds the time limit."""


@dataclass(frozen=True)
class ComparisonStudy(WholeStudy[MethodComparison], CheckedFields):
    """Comparison of integration methods: one motion by every method at every tolerance, with time, work and error.

    The runs are sequential, so that their wall times are comparable; workers are not accepted.

    Attributes
    ----------
    case : Case
        Motion to integrate, built by `studies.tracking_case` or `studies.motion_case`.
    methods : sequence of Method or str, or None
        Methods of `METHODS` with their default parameters; None for all. A method that cannot run is listed with the
        reason, and the comparison continues with the others.
    options : ComparisonOptions or None
        Options of the comparison; None for the defaults.
    parameters : dict or None
        Parameters stored as provenance.

    Raises
    ------
    InputError
        Unknown method, or one with parameters other than the defaults; raised by `run` before anything runs.
    IntegrationError
        No converged run to compare with; raised by `run`.
    """

    gives: ClassVar[type[Result]] = MethodComparison
    case: Case
    methods: Sequence[Method | str] | None = None
    options: ComparisonOptions | None = None
    parameters: dict[str, Any] | None = None

    def _prepare(self, workers: Workers | None) -> Callable[[OnProgress | None], MethodComparison]:
        no_workers(workers, "runs are made one after another")
        return self._run

    def _run(self, on_progress: OnProgress | None) -> MethodComparison:
        case, options = self.case, self.options or ComparisonOptions()
        chosen = _chosen(METHODS if self.methods is None else self.methods)
        plans = {method.name: _plan(method, options) for method in chosen}
        total = sum(map(len, plans.values()))
        found: list[Measurement] = []
        reference, interrupted = None, False

        def report(what: str) -> None:
            if on_progress is not None:
                on_progress(Progress(len(found), total, len(found), doing=what))

        try:
            report("reference")
            reference, places = _reference(case, options)
            for method in chosen:
                for measurement in _measurements(case, method, plans[method.name], places, options, report):
                    found.append(measurement)
        except KeyboardInterrupt:
            interrupted = True
        return MethodComparison(
            case=case.name,
            mechanism=case.system.mechanism.name,
            duration=case.duration,
            samples=case.samples,
            coordinates=case.system.n,
            rows=case.system.m,
            reference=reference,
            measurements=tuple(found),
            interrupted=interrupted,
            parameters=self.parameters,
        )


@checked_arguments()
def compare_methods(
    case: Case,
    methods: Sequence[Method | str] | None = None,
    *,
    options: ComparisonOptions | None = None,
    on_progress: OnProgress | None = None,
) -> MethodComparison:
    """Run a motion by every method at every tolerance: a shortcut for `ComparisonStudy(case, methods, options).run()`.

    Parameters
    ----------
    case, methods, options
        See `ComparisonStudy`.
    on_progress : callable, optional
        See `Study.run`.
    """
    return ComparisonStudy(case, methods, options).run(on_progress=on_progress)


def _chosen(methods: Iterable[Method | str]) -> list[Method]:
    """Return the methods, each once, because runs are distinguished by the name of their method."""
    chosen = list(dict.fromkeys(map(find_method, methods)))
    for method in chosen:
        if method != METHODS.get(method.name):
            raise InputError(
                "methods are compared with their default parameters", field="methods", value=method,
                remedy="choose from paraflex.METHODS",
            )  # fmt: skip
    return chosen


@dataclass(frozen=True)
class _Setting:
    """Tolerance of a run with error control, or step size with the tolerance of Newton's iteration."""

    tolerance: float
    step: float | None = None

    def options(self, method: str) -> IntegrationOptions:
        return IntegrationOptions(method=method, tolerance=self.tolerance, step=self.step)

    def row(self, method: str, status: str = "complete", reason: str = "", warned: Sequence[str] = ()) -> Measurement:
        """Return a row for a run, without results."""
        tolerance = self.tolerance if self.step is None else None
        return Measurement(method, tolerance, self.step, status, reason, warnings=tuple(warned))

    def __str__(self) -> str:
        return f"tolerance {self.tolerance:g} m" if self.step is None else f"step {self.step:g} s"


def _plan(method: Method, options: ComparisonOptions) -> list[_Setting]:
    """Return the settings of a method, loosest first; at least one, which the method may reject."""
    tolerances = [_Setting(value) for value in sorted(set(options.tolerances), reverse=True)]
    steps = [_Setting(options.tightest, value) for value in sorted(set(options.steps), reverse=True)]
    fitting = (tolerances if method.error_control else []) + (steps if method.fixed_step else [])
    return fitting or (tolerances + steps)[:1]


def _measurements(
    case: Case,
    method: Method,
    plan: Sequence[_Setting],
    places: Array,
    options: ComparisonOptions,
    report: Callable[[str], None],
) -> Iterator[Measurement]:
    slow: dict[bool, str] = {}
    for number, setting in enumerate(plan):
        by_step = setting.step is not None
        if by_step in slow:
            yield setting.row(method.name, "skipped", f"too slow at {slow[by_step]} already")
            continue
        report(f"{method.title}, {setting}")
        try:
            if number == 0:
                _warm_up(case, setting.options(method.name))
            measured = _measure(case, method.name, setting, places, options)
        except (InputError, ImportError) as error:
            # The method itself cannot run: it rejects an argument, or its package is not installed.
            yield Measurement(method.name, status="unavailable", reason=str(error))
            return
        if measured.status == "too slow":
            slow[by_step] = str(setting)
        yield measured


def _warm_up(case: Case, options: IntegrationOptions) -> None:
    """Start a run and stop it at once, so that compiling and loading are not part of the measured times."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            _solve(case, options, 0.0)
        except (_TooSlowError, NumericalError):
            # A failure is reported when the run is measured.
            return


def _measure(case: Case, method: str, setting: _Setting, places: Array, options: ComparisonOptions) -> Measurement:
    """Measure a run, and repeat it if it is short."""
    chosen, solutions = setting.options(method), list[Solution]()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            while len(solutions) < options.repetitions and sum(x.wall_time for x in solutions) < _LONG_ENOUGH:
                solutions.append(_solve(case, chosen, options.limit))
        except _TooSlowError:
            if not solutions:
                reason = f"stopped after {options.limit:g} s"
                return setting.row(method, "too slow", reason, _texts(caught))
        except NumericalError as error:
            return setting.row(method, "failed", str(error), _texts(caught))
    best = min(solutions, key=lambda solution: solution.wall_time)
    counts = {name: getattr(best, name) for name in _RUN_COUNTS}
    error = _distance(case.places(best), places)
    return replace(setting.row(method, warned=_texts(caught)), error=error, repetitions=len(solutions), **counts)


def _solve(case: Case, options: IntegrationOptions, limit: float) -> Solution:
    """Integrate a case to its end.

    Raises
    ------
    _TooSlowError
        Run longer than the limit.
    KeyboardInterrupt
        Run stopped by the user.
    """
    began, over = time.perf_counter(), False

    def watch(reached: float) -> None:
        nonlocal over
        over = time.perf_counter() - began > limit
        if over:
            raise KeyboardInterrupt

    solution = case.solve(options, watch)
    if solution.status == "interrupted":
        raise _TooSlowError if over else KeyboardInterrupt
    return solution


def _reference(case: Case, options: ComparisonOptions) -> tuple[Reference, Array]:
    """Compute two runs at tight tolerances with the ESDIRK methods of highest order that succeed.

    Errors of other runs are distances from the first of them. Returns the reference and the positions of its points.
    """
    ours = sorted((x for x in METHODS.values() if x.family is Family.ESDIRK), key=lambda x: -x.order)
    tolerance, patience = options.tightest / _FINER, _REFERENCE_PATIENCE * options.limit
    runs: list[tuple[Method, float, Solution]] = []
    reasons = []
    # If only one method succeeds, it is compared with itself at another tolerance.
    for method, times in [(x, y) for y in (1.0, 4.0) for x in ours]:
        finer = tolerance * (2.0 if runs and times == 1.0 else times)
        try:
            solved = _solve(case, IntegrationOptions(method=method.name, tolerance=finer), patience)
        except _TooSlowError:
            reasons.append(f"{method.title} takes longer than {patience:g} s at {finer:g} m")
        except NumericalError as error:
            reasons.append(f"{method.title} at {finer:g} m: {error}")
        else:
            runs.append((method, finer, solved))
        if len(runs) == 2:
            break
    if len(runs) < 2:
        raise IntegrationError(
            f"fewer than two runs reached their end to serve as a reference ({'; '.join(reasons)})",
            remedy="choose coarser tolerances, a shorter duration, or a longer limit of time for each run",
        )
    (method, own, solution), (other, loose, check) = runs
    places = case.places(solution)
    uncertainty = _distance(places, case.places(check))
    return Reference(method.name, own, other.name, loose, uncertainty, solution.wall_time), places


def _distance(one: Array, other: Array) -> float:
    """Compute the largest distance over points and samples [m]."""
    return float(np.max(np.linalg.norm(one - other, axis=-1)))


def _texts(caught: Sequence[warnings.WarningMessage]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(str(warning.message) for warning in caught))
