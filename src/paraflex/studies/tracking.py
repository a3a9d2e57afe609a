"""Tracking study, as in the paper: one path in several actuation modes, with the results in one dataset."""

import os
import threading
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from typing import Any, ClassVar, Protocol

import numpy as np
import xarray as xr

from paraflex.arguments import CheckedFields, checked_arguments, refused
from paraflex.campaign import THREADS, OnProgress, Progress, Result, WholeStudy, Workers
from paraflex.campaign.workers import Calls
from paraflex.control import ControllerDescription, simulate_controlled
from paraflex.designs.measure import metric_figures, metrics_of
from paraflex.display import Played
from paraflex.dynamics.sparse import stiffness_diagonal
from paraflex.errors import ControllerError, InputError, IntegrationError, NumericalError
from paraflex.findings import Finding
from paraflex.folders import RUN
from paraflex.integrators import IntegrationOptions
from paraflex.mechanism import ActuationMode
from paraflex.reduced_bodies import Reduction, size_of
from paraflex.results import summary, tracking_dataset
from paraflex.results.beside import with_beside
from paraflex.results.following import ErrorSpan
from paraflex.results.metrics import PATH, keep_metrics
from paraflex.results.reduced_runs import compared_with_full, with_estimate
from paraflex.tracking import TrackingRun, TrackingTask, simulate


class Simulator(Protocol):
    """Function that runs one mode of a task in place of `simulate`, such as `simulate_ked`."""

    def __call__(
        self, task: TrackingTask, mode: str | ActuationMode, *, on_progress: Callable[[float], None] | None = None
    ) -> TrackingRun:
        """Run the mode and return the run; an IntegrationError carries the partial run."""
        ...


@dataclass(frozen=True)
class StudyResult(Result, Played):
    """Results of the modes of a study.

    Attributes
    ----------
    dataset : xarray.Dataset or None
        Dataset of every mode that ran, completely or in part; None if no mode ran.
    failed : dict
        Reasons of failure by mode, for modes that could not start.
    interrupted : bool
        Whether the user stopped the study.
    """

    kept_as = RUN
    data_file = "results.nc"
    values_file = "summary.json"
    dataset: xr.Dataset | None
    failed: dict[str, str]
    interrupted: bool

    @property
    def data(self) -> xr.Dataset | None:
        """Dataset of every mode that ran, completely or in part; None if no mode ran."""
        return self.dataset

    @property
    def begun(self) -> bool:
        """Whether any mode ran."""
        return self.data is not None

    @property
    def complete(self) -> bool:
        """Whether every mode ran to its end, or to an event."""
        return (
            not self.failed and self.data is not None and bool(self.data["status"].isin(["complete", "stopped"]).all())
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the results of all modes as plain values, or the reasons of failure if no mode ran."""
        return {"failed": self.failed} if self.data is None else summary(self.data, self.failed)


@dataclass(frozen=True)
class TrackingStudy(WholeStudy[StudyResult], CheckedFields):
    """Study of one path in several actuation modes.

    A mode that fails is reported, and the study continues with the others. Progress counts the simulated seconds of
    each mode. Workers are threads.

    Attributes
    ----------
    task : TrackingTask
        Planned motion along the path.
    modes : sequence of str or ActuationMode
        Actuation modes.
    options : IntegrationOptions or None
        Integration options; None for the defaults.
    parameters : dict or None
        Parameters stored as provenance.
    method : Simulator or None
        Function that runs a mode; None for `simulate` with the options.
    error : ErrorSpan or str
        Time span of the tracking error that ranks the modes: the "motion", or the "whole" run including the dwell.
    warning : bool
        Whether to issue a `ValidityWarning` for each run beyond the validity of its model, and a `ResultWarning` for
        implausible results.
    findings : iterable of Finding
        Doubts about the model found beforehand; stored with the results.
    full : TrackingTask, optional
        Task with all flexible coordinates, if the bodies of `task` are reduced. Each mode is run with it as well, and
        the results contain the deviation of the reduced run from it.
    controllers : sequence of ControllerDescription
        Controllers that act in every mode in addition to the planned torques.
    reduction : Reduction, optional
        Reduction by which the bodies of `task` are reduced, from `planned_reduction`; its estimated deviation is stored
        with the results.
    beside : TrackingTask, optional
        Task with another geometry of the beams. Each mode is run with it as well, with the same tolerance by the
        default method, and the results contain the tracking errors beside those of `task`.
    elsewhere : mapping
        Tracking errors from other sources shown with them, by geometry, source and mode [m].
    metrics : sequence of str
        Metrics, or expressions of metrics, of every complete run; stored with the results.

    Raises
    ------
    InputError
        Unknown mode or metric, or workers that are not threads; raised by `run` before anything runs.
    """

    _own = ("method",)
    gives: ClassVar[type[Result]] = StudyResult
    task: TrackingTask
    modes: Sequence[str | ActuationMode]
    options: IntegrationOptions | None = None
    parameters: dict[str, Any] | None = None
    method: Simulator | None = None
    error: ErrorSpan | str = ErrorSpan.MOTION
    warning: bool = True
    findings: Iterable[Finding] = ()
    full: TrackingTask | None = None
    controllers: Sequence[ControllerDescription] = ()
    reduction: Reduction | None = None
    beside: TrackingTask | None = None
    elsewhere: Mapping[str, Any] = field(default_factory=dict)
    metrics: Sequence[str] = ()

    def _prepare(self, workers: Workers | None) -> Callable[[OnProgress | None], StudyResult]:
        if self.method is not None and not callable(self.method):
            remedy = "name it in options=IntegrationOptions(method=...); a function runs modes in its own way"
            raise refused(self.method, "method", "a function", remedy)
        if self.method is not None and self.controllers:
            raise InputError("a function runs modes in its own way, without controllers", field="controllers",
                             remedy="leave one of the two out")  # fmt: skip
        workers = workers or Workers()
        if workers.engine != THREADS:
            raise InputError("modes run in threads", field="workers", value=workers.engine, remedy="leave it out")
        chosen = list(dict.fromkeys(self.task.mode(mode) for mode in self.modes))
        metrics_of(self.metrics, self.error, self.task.mechanism, PATH, float(self.task.motion.t[-1]))
        return partial(self._run, chosen, workers)

    def _run(self, chosen: Sequence[ActuationMode], workers: Workers, on_progress: OnProgress | None) -> StudyResult:
        stop = threading.Event()
        # The kernels release the GIL, so threads run in parallel; results do not depend on the thread.
        with ThreadPoolExecutor(workers.number or os.cpu_count()) as pool:
            futures: dict[str, Future[TrackingRun | str | None]] = {}
            whole: dict[str, Future[TrackingRun | str | None]] = {}
            beside: dict[str, Future[TrackingRun | str | None]] = {}
            calls = Calls()
            try:
                tasks = ((self.task, futures, on_progress), (self.full, whole, None), (self.beside, beside, None))
                for task, into, watch in tasks:
                    for mode in chosen if task is not None else ():
                        into[mode.name] = calls.submit(pool.submit, self._mode, task, mode, stop, watch)
                left = {*futures.values(), *whole.values(), *beside.values()}
                while left:
                    left -= calls.done()
            except KeyboardInterrupt:
                # Only the main thread receives Ctrl-C; runs stop at their next progress report and keep their samples.
                stop.set()
        outcomes, full, other = (
            {name: future.result() for name, future in each.items()} for each in (futures, whole, beside)
        )
        return self._result(outcomes, full, other, interrupted=stop.is_set())

    def _mode(
        self, task: TrackingTask, mode: ActuationMode, stop: threading.Event, on_progress: OnProgress | None
    ) -> TrackingRun | str | None:
        """Run a mode of a task; return the reason of failure if there is no run, None if it was not started."""
        end, began = float(self.task.motion.t[-1]), time.perf_counter()

        def report(reached: float) -> None:
            if stop.is_set():
                raise KeyboardInterrupt
            if on_progress is not None:
                on_progress(Progress(reached, end, reached, time.perf_counter() - began, mode.name))

        if stop.is_set():
            return None
        try:
            if self.method is not None:
                return self.method(task, mode, on_progress=report)
            if self.controllers:
                return simulate_controlled(task, mode, self.controllers, options=self.options, on_progress=report)
            options = self._options_beside if task is self.beside else self.options
            return simulate(task, mode, options=options, on_progress=report, warning=False)
        except (IntegrationError, ControllerError) as error:
            return error.partial
        except NumericalError as error:
            return str(error)

    def _result(
        self,
        outcomes: Mapping[str, TrackingRun | str | None],
        full: Mapping[str, TrackingRun | str | None],
        other: Mapping[str, TrackingRun | str | None],
        *,
        interrupted: bool,
    ) -> StudyResult:
        runs, whole, beside = (
            [outcome for outcome in each.values() if isinstance(outcome, TrackingRun)]
            for each in (outcomes, full, other)
        )
        if self.warning:
            for run in runs:
                run.warn()
        failed = {name: outcome for name, outcome in outcomes.items() if isinstance(outcome, str)}
        data = None
        if runs:
            data = tracking_dataset(
                runs, options=self.options, parameters=self.parameters, error=self.error, findings=self.findings
            )
        if data is not None and self.full is not None and whole:
            sizes = [size_of(task.system, task.start) for task in (self.task, self.full)]
            data = compared_with_full(data, tracking_dataset(whole, options=self.options), *sizes)
        if data is not None and self.reduction is not None:
            sizes = [size_of(task.system, task.start) for task in (self.task, self.reduction.full)]
            energies = {run.mode.name: _largest_energy(run) for run in runs}
            data = with_estimate(data, self.reduction.deviation, energies, self.reduction.energy, *sizes)
        if data is not None and self.beside is not None and beside:
            geometries = self.task.mechanism.geometry.value, self.beside.mechanism.geometry.value
            found = tracking_dataset(beside, options=self._options_beside, error=self.error)
            data = with_beside(data, found, geometries, self.elsewhere)
        if data is not None and self.metrics:
            keep_metrics(data, {run.mode.name: metric_figures(run, self.metrics) for run in runs})
        return StudyResult(data, failed, interrupted)

    @property
    def _options_beside(self) -> IntegrationOptions:
        return IntegrationOptions(tolerance=None if self.options is None else self.options.tolerance)


def _largest_energy(run: TrackingRun) -> float:
    """Return the largest strain energy of a run's beams [J]."""
    return float(np.max(run.solution.q**2 @ stiffness_diagonal(run.task.system), initial=0.0)) / 2.0


@checked_arguments()
def run_study(
    task: TrackingTask,
    modes: Sequence[str | ActuationMode],
    *,
    workers: int | None = None,
    on_progress: OnProgress | None = None,
    **details: Any,
) -> StudyResult:
    """Simulate every mode: a shortcut for `TrackingStudy(task, modes, **details).run()`.

    Parameters
    ----------
    task, modes, **details
        Fields of `TrackingStudy`: options, parameters, method, error, warning, findings, controllers.
    workers : int, optional
        Number of threads; by default the number of processors. The results do not depend on it.
    on_progress : callable, optional
        See `Study.run`.
    """
    study = TrackingStudy(task, modes, **details)
    return study.run(workers=Workers(number=workers), on_progress=on_progress)
