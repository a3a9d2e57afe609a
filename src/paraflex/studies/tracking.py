"""The paper's study: one path, several actuation modes, one dataset."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import xarray as xr

from paraflex.errors import ActuationError, IntegrationError
from paraflex.integrators import IntegrationOptions
from paraflex.mechanism import ActuationMode
from paraflex.results import tracking_dataset
from paraflex.simulate import TrackingRun, TrackingTask, simulate


@dataclass(frozen=True)
class StudyResult:
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
        """Whether every mode ran to its end."""
        return not self.failed and self.data is not None and bool((self.data["status"] == "complete").all())


def run_study(
    task: TrackingTask,
    modes: Sequence[str | ActuationMode],
    *,
    options: IntegrationOptions | None = None,
    parameters: dict | None = None,
    on_progress: Callable[[str, float], None] | None = None,
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
        Told the mode's name and the time reached [s].

    Returns
    -------
    StudyResult

    Raises
    ------
    InputError
        A mode that is none of the mechanism's, before anything runs.
    """
    chosen = list(dict.fromkeys(task.mode(mode) for mode in modes))
    runs: list[TrackingRun] = []
    failed: dict[str, str] = {}
    interrupted = False
    for mode in chosen:

        def report(time: float, name: str = mode.name) -> None:
            if on_progress is not None:
                on_progress(name, time)

        try:
            runs.append(simulate(task, mode, options=options, on_progress=report))
        except ActuationError as error:
            failed[mode.name] = str(error)
        except IntegrationError as error:
            runs.append(error.partial)
        except KeyboardInterrupt:
            interrupted = True
        if interrupted or (runs and runs[-1].solution.status == "interrupted"):
            interrupted = True
            break
    data = tracking_dataset(runs, options=options, parameters=parameters) if runs else None
    return StudyResult(data, failed, interrupted)
