"""The paper's study: one path, several actuation modes, one dataset."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar, Protocol

import xarray as xr

from paraflex.arguments import CheckedFields, checked_arguments, refused
from paraflex.campaign import THREADS, OnProgress, Progress, Result, WholeStudy, Workers
from paraflex.control import ControllerDescription, simulate_controlled
from paraflex.errors import ControllerError, InputError, IntegrationError, NumericalError
from paraflex.findings import Finding
from paraflex.folders import RUN
from paraflex.integrators import IntegrationOptions
from paraflex.interrupts import Calls
from paraflex.mechanism import ActuationMode
from paraflex.reduction import size_of
from paraflex.results import summary, tracking_dataset
from paraflex.results.following import ErrorSpan
from paraflex.results.reduced_runs import beside_full
from paraflex.tracking import TrackingRun, TrackingTask, simulate


class Simulator(Protocol):
    """Function that runs one mode of a task in place of `simulate`, such as `simulate_ked`."""

    def __call__(
        self, task: TrackingTask, mode: str | ActuationMode, *, on_progress: Callable[[float], None] | None = None
    ) -> TrackingRun:
        """The run; an IntegrationError carries what was computed."""
        ...


@dataclass(frozen=True)
class StudyResult(Result):
    """Results of the modes of a study.

    Attributes
    ----------
    dataset : xarray.Dataset or None
        Of every mode that ran, whole or in part; None where none did.
    failed : dict
        Modes that could not start, each with its reason.
    interrupted : bool
        Whether the user stopped it.
    """

    kept_as = RUN
    data_file = "results.nc"
    values_file = "summary.json"
    dataset: xr.Dataset | None
    failed: dict[str, str]
    interrupted: bool

    @property
    def data(self) -> xr.Dataset | None:
        """Data of every mode that ran, whole or in part; None if none did."""
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
        """Results of all modes in plain values; reasons of failures if none ran."""
        return {"failed": self.failed} if self.data is None else summary(self.data, self.failed)


@dataclass(frozen=True)
class TrackingStudy(WholeStudy[StudyResult], CheckedFields):
    """One path in several actuation modes.

    A mode that fails is reported and the others go on. Progress is that of each mode in seconds of its motion. Workers
    are threads.

    Attributes
    ----------
    task : TrackingTask
    modes : sequence of str or ActuationMode
    options : IntegrationOptions or None
        The defaults where None.
    parameters : dict or None
        Kept as provenance.
    method : Simulator or None
        `simulate` with the options where None.
    error : ErrorSpan or str
        Which tracking error ranks the modes: that of the "motion", or of the "whole" run, dwell included.
    warning : bool
        Whether runs beyond what their model can describe issue a `ValidityWarning` each, those of implausible results
        a `ResultWarning`.
    findings : iterable of Finding
        Reasons to doubt the model, found before; kept with the results.
    full : TrackingTask, optional
        The task with all flexible coordinates, where bodies of the other are reduced: each mode is run with it too, and
        how far off the reduced run is stands in the results.
    controllers : sequence of ControllerDescription
        They act in every mode beside its planned torques.

    Raises
    ------
    InputError
        From `run`: a mode that is none of the mechanism's, or workers that are no threads, before anything runs.
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

    def _ready(self, workers: Workers | None) -> Callable[[OnProgress | None], StudyResult]:
        if self.method is not None and not callable(self.method):
            remedy = "name it in options=IntegrationOptions(method=...); a function runs modes in a way of its own"
            raise refused(self.method, "method", "a function", remedy)
        if self.method is not None and self.controllers:
            raise InputError("a function runs modes in a way of its own, without controllers", field="controllers",
                             remedy="leave one of the two out")  # fmt: skip
        workers = workers or Workers()
        if workers.engine != THREADS:
            raise InputError("modes run in threads", field="workers", value=workers.engine, remedy="leave it out")
        chosen = list(dict.fromkeys(self.task.mode(mode) for mode in self.modes))
        return partial(self._run, chosen, workers)

    def _run(self, chosen: Sequence[ActuationMode], workers: Workers, on_progress: OnProgress | None) -> StudyResult:
        stop = threading.Event()
        # The kernels release the GIL, so threads are enough; each run is the same whichever thread it is in.
        with ThreadPoolExecutor(workers.number or os.cpu_count()) as pool:
            futures: dict[str, Future[TrackingRun | str | None]] = {}
            whole: dict[str, Future[TrackingRun | str | None]] = {}
            calls = Calls()
            try:
                for mode in chosen:
                    futures[mode.name] = calls.hand(pool.submit, self._mode, self.task, mode, stop, on_progress)
                if self.full is not None:
                    for mode in chosen:
                        whole[mode.name] = calls.hand(pool.submit, self._mode, self.full, mode, stop, None)
                left = {*futures.values(), *whole.values()}
                while left:
                    left -= calls.done()
            except KeyboardInterrupt:
                # Ctrl-C reaches the main thread only; runs stop at their next progress report and keep their samples.
                stop.set()
        outcomes, full = ({name: future.result() for name, future in each.items()} for each in (futures, whole))
        return self._result(outcomes, full, interrupted=stop.is_set())

    def _mode(
        self, task: TrackingTask, mode: ActuationMode, stop: threading.Event, on_progress: OnProgress | None
    ) -> TrackingRun | str | None:
        """A mode's run of a task, or the reason why there is none."""
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
            return simulate(task, mode, options=self.options, on_progress=report, warning=False)
        except (IntegrationError, ControllerError) as error:
            return error.partial
        except NumericalError as error:
            return str(error)

    def _result(
        self,
        outcomes: Mapping[str, TrackingRun | str | None],
        full: Mapping[str, TrackingRun | str | None],
        *,
        interrupted: bool,
    ) -> StudyResult:
        runs, whole = (
            [outcome for outcome in each.values() if isinstance(outcome, TrackingRun)] for each in (outcomes, full)
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
            data = beside_full(data, tracking_dataset(whole, options=self.options), *sizes)
        return StudyResult(data, failed, interrupted)


@checked_arguments()
def run_study(
    task: TrackingTask,
    modes: Sequence[str | ActuationMode],
    *,
    workers: int | None = None,
    on_progress: OnProgress | None = None,
    **details: Any,
) -> StudyResult:
    """Simulate every mode: `TrackingStudy(task, modes, **details).run()` in one call.

    Parameters
    ----------
    task, modes, **details
        Fields of `TrackingStudy`: options, parameters, method, error, warning, findings, controllers.
    workers : int, optional
        Threads; as many as there are processors by default. The results do not depend on it.
    on_progress : callable, optional
        See `Study.run`.
    """
    study = TrackingStudy(task, modes, **details)
    return study.run(workers=Workers(number=workers), on_progress=on_progress)
