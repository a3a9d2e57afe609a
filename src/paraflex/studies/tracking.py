"""The paper's study: one path, several actuation modes, one dataset."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass
from typing import Protocol

import xarray as xr

from paraflex.arguments import checked_arguments, refused
from paraflex.display import Shown
from paraflex.errors import IntegrationError, NumericalError
from paraflex.findings import Finding
from paraflex.integrators import IntegrationOptions
from paraflex.mechanism import ActuationMode
from paraflex.results import tracking_dataset
from paraflex.results.following import ErrorSpan
from paraflex.simulate import TrackingRun, TrackingTask, simulate


class Simulator(Protocol):
    """How one mode of a task is run where it is not by `simulate` with error control: `simulate_ked`, say."""

    def __call__(
        self, task: TrackingTask, mode: str | ActuationMode, *, on_progress: Callable[[float], None] | None = None
    ) -> TrackingRun:
        """The run; an IntegrationError carries what was computed."""
        ...


@dataclass(frozen=True)
class StudyResult(Shown):
    """What became of the modes of a study.

    Attributes
    ----------
    data : xarray.Dataset or None
        Of every mode that ran, whole or in part; None where none did.
    failed : dict
        Modes that could not start, each with its reason.
    interrupted : bool
        Whether the user stopped it.
    """

    data: xr.Dataset | None
    failed: dict[str, str]
    interrupted: bool

    @property
    def complete(self) -> bool:
        """Whether every mode ran to its end, or to an event that was to stop it."""
        return (
            not self.failed and self.data is not None and bool(self.data["status"].isin(["complete", "stopped"]).all())
        )


@checked_arguments()
def run_study(
    task: TrackingTask,
    modes: Sequence[str | ActuationMode],
    *,
    options: IntegrationOptions | None = None,
    parameters: dict | None = None,
    on_progress: Callable[[str, float], None] | None = None,
    workers: int | None = None,
    method: Simulator | None = None,
    error: ErrorSpan | str = ErrorSpan.MOTION,
    warning: bool = True,
    findings: Iterable[Finding] = (),
) -> StudyResult:
    """Simulate every mode; one that fails is reported and the others go on.

    Parameters
    ----------
    task : TrackingTask
    modes : sequence of str or ActuationMode
    options : IntegrationOptions, optional
    parameters : dict, optional
        Kept as provenance.
    on_progress : callable, optional
        Called with the mode's name and the time reached [s]; called from several threads.
    workers : int, optional
        Threads; as many as there are processors by default. The results do not depend on it.
    method : Simulator, optional
        `simulate` with the options by default.
    error : ErrorSpan or str
        Which tracking error ranks the modes: that of the "motion", or of the "whole" run, dwell included.
    warning : bool
        Whether runs beyond what their model can describe issue a `ValidityWarning` each, those of implausible results
        a `ResultWarning`.
    findings : iterable of Finding
        Reasons to doubt the model, found before; kept with the results.

    Returns
    -------
    StudyResult

    Raises
    ------
    InputError
        A mode that is none of the mechanism's, before anything runs.
    """
    if method is not None and not callable(method):
        remedy = "name it in options=IntegrationOptions(method=...); a function runs modes in a way of its own"
        raise refused(method, "method", "a function", remedy)
    chosen = list(dict.fromkeys(task.mode(mode) for mode in modes))
    stop = threading.Event()

    def run(mode: ActuationMode) -> TrackingRun | str | None:
        def report(time: float) -> None:
            if stop.is_set():
                raise KeyboardInterrupt
            if on_progress is not None:
                on_progress(mode.name, time)

        if stop.is_set():
            return None
        try:
            if method is not None:
                return method(task, mode, on_progress=report)
            return simulate(task, mode, options=options, on_progress=report, warning=False)
        except IntegrationError as error:
            return error.partial
        except NumericalError as error:
            return str(error)

    # The kernels release the GIL, so threads are enough; each run is the same whichever thread it is in.
    with ThreadPoolExecutor(workers or os.cpu_count()) as pool:
        futures = [pool.submit(run, mode) for mode in chosen]
        try:
            wait(futures)
        except KeyboardInterrupt:
            # Ctrl-C reaches the main thread only; the runs hear of it at their next report and keep what they have.
            stop.set()
    outcomes = {mode.name: future.result() for mode, future in zip(chosen, futures, strict=True)}
    runs = [outcome for outcome in outcomes.values() if isinstance(outcome, TrackingRun)]
    if warning:
        for run_of_mode in runs:
            run_of_mode.warn()
    failed = {name: outcome for name, outcome in outcomes.items() if isinstance(outcome, str)}
    data = None
    if runs:
        data = tracking_dataset(runs, options=options, parameters=parameters, error=error, findings=findings)
    return StudyResult(data, failed, stop.is_set())
