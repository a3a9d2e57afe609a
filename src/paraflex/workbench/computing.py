"""Runs of a model's text: its study along a path in several modes, or its own motion."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from paraflex.arrays import Brief
from paraflex.campaign import OnProgress, Progress
from paraflex.checks import check
from paraflex.checks.check import check_planned
from paraflex.control import simulate_controlled
from paraflex.designs.own_motion import own_duration, own_run
from paraflex.dynamics import System, standing_system
from paraflex.errors import InputError, NumericalError
from paraflex.files import Model, model_from
from paraflex.files.read import naming, parse_toml
from paraflex.files.rows import with_rows
from paraflex.integrators import IntegrationOptions
from paraflex.integrators.options import TolerancePer
from paraflex.mechanism import ActuationMode
from paraflex.mechanism.masses import check_masses
from paraflex.motion import MotionRun, state_at
from paraflex.reduced_bodies.mechanism import reduced_task
from paraflex.results import motion_dataset
from paraflex.studies.tracking import StudyResult, TrackingStudy
from paraflex.tracking import TrackingRun, TrackingTask, simulate

# Tolerance of coarse runs as a part of the mechanism's size, 25 times the default, and number of their samples.
_COARSE_TOLERANCE, _COARSE_SAMPLES = 1e-3, 121


@dataclass(frozen=True)
class Computed(Brief):
    """Runs of a model.

    Attributes
    ----------
    result : StudyResult
        Dataset of all runs, also of those that failed on the way, and reasons of modes that could not start.
    errors : mapping of str to NumericalError
        Error of each mode that failed, "" for a run without modes.
    tolerance : float or None
        Tolerance of the integration [m]; None for a fixed step.
    samples : int
        Number of samples.
    """

    result: StudyResult
    errors: Mapping[str, NumericalError] = field(default_factory=dict)
    tolerance: float | None = None
    samples: int = 0

    def begun(self) -> "Computed":
        """Return the runs if any mode has begun; raise the error of the first mode if there is none."""
        if self.result.data is None:
            raise next(iter(self.errors.values()), NumericalError("no mode could be run"))
        return self


def model_of(text: str, folder: Path | None = None, source: str = "model") -> Model:
    """Read a model from its text as `load` reads a file, without warnings; files it names are in the folder.

    Raises
    ------
    InputError
        Text that is not a model; `source` names it.
    """
    with naming(source):
        data = with_rows(parse_toml(text), folder or Path())
    return model_from(data, source, text)


def computed(
    model: Model,
    modes: Sequence[str] = (),
    path: str | None = None,
    *,
    coarse: bool = False,
    on_progress: OnProgress | None = None,
) -> Computed:
    """Run the study of a model as `paraflex run` does: along a path if it has one, else its own motion.

    Parameters
    ----------
    model : Model
        Model to run. A reduction of its study is used along a path only.
    modes, path : sequence of str, str
        Actuation modes and path; by default those of the study.
    coarse : bool
        Whether runs have few samples and, unless that of the study is coarser or its step fixed, a tolerance of 1/1000
        of the mechanism's size with the default method.
    on_progress : callable, optional
        Function called with the progress in simulated seconds; a KeyboardInterrupt that it raises stops the runs.

    Raises
    ------
    InputError, NumericalError
        A study that cannot be run, or whose plan fails.
    """
    check_masses(model.mechanism)
    if coarse:
        few = min(model.study.samples, _COARSE_SAMPLES)
        model = replace(model, study=replace(model.study, samples=few))
    if model.paths or path is not None:
        return _along(model, modes, path, coarse=coarse, on_progress=on_progress)
    if modes:
        remedy = "add a [path.NAME] table, or give torques in [study]"
        raise InputError("a model without a path has no actuation modes", field="modes", value=modes[0], remedy=remedy)
    return _own_motion(model, coarse=coarse, on_progress=on_progress)


def _along(
    model: Model, names: Sequence[str], path: str | None, *, coarse: bool, on_progress: OnProgress | None
) -> Computed:
    name, modes = model.path_name(path), list(model.modes(names))
    if not modes:
        remedy = "add a [motor.NAME], or [study] modes to the file"
        raise InputError("no actuation mode to run", field="modes", remedy=remedy)
    task = model.plan(name, warning=False)
    findings = () if coarse else check_planned(model, task, name, modes, None)
    options, reduction = _options(model, task.system, coarse=coarse), None
    if model.study.reduced:
        task, reduction = reduced_task(task, model.study.reduced, options.tolerance_for(task.system), modes)
    simulator = _Simulator(options, model.acting())
    parameters = _provenance(model, options, path=name, modes=[mode.name for mode in modes])
    study = TrackingStudy(
        task, modes, options, parameters, simulator, model.study.error, warning=False, findings=findings,
        reduction=reduction,
    )  # fmt: skip
    result = study.run(on_progress=on_progress)
    return Computed(result, simulator.errors, _tolerance(options, task.system), task.motion.t.size)


class _Simulator:
    """Simulator of a tracking study, which keeps the errors of its modes."""

    def __init__(self, options: IntegrationOptions, controllers: Sequence[Any]) -> None:
        self.errors: dict[str, NumericalError] = {}
        self._options, self._controllers = options, controllers

    def __call__(self, task: TrackingTask, mode: str | ActuationMode, *, on_progress: Any = None) -> TrackingRun:
        how: dict[str, Any] = {"options": self._options, "on_progress": on_progress}
        try:
            if self._controllers:
                return simulate_controlled(task, mode, self._controllers, **how)
            return simulate(task, mode, warning=False, **how)
        except NumericalError as error:
            self.errors[getattr(mode, "name", str(mode))] = error
            raise


def _own_motion(model: Model, *, coarse: bool, on_progress: OnProgress | None) -> Computed:
    study, end, began, errors = model.study, own_duration(model.study), time.perf_counter(), {}
    system = standing_system(model.mechanism, model.start, study.assembly)
    options = _options(model, system, coarse=coarse)
    start = study.assembly if model.start is None else state_at(system, model.start, study.assembly, balanced=False)

    def report(reached: float) -> None:
        if on_progress is not None:
            on_progress(Progress(reached, end, reached, time.perf_counter() - began))

    try:
        run = own_run(model.mechanism, study, model.acting(), start=start, options=options, on_progress=report)
    except NumericalError as error:
        if not isinstance(error.partial, MotionRun):
            raise
        run, errors[""] = error.partial, error
    findings = () if coarse else check(model)
    data = motion_dataset(run, options=options, parameters=_provenance(model, options), findings=findings)
    result = StudyResult(data, {}, interrupted=run.solution.status == "interrupted")
    return Computed(result, errors, _tolerance(options, system), study.samples)


def _options(model: Model, system: System, *, coarse: bool) -> IntegrationOptions:
    options, loose = model.study.integration(), _COARSE_TOLERANCE * system.size
    if not coarse or options.step is not None or options.tolerance_for(system) >= loose:
        return options
    return IntegrationOptions(tolerance=loose, tolerance_per=TolerancePer.CYCLE)


def _tolerance(options: IntegrationOptions, system: System) -> float | None:
    return None if options.step is not None else options.tolerance_for(system)


def _provenance(model: Model, options: IntegrationOptions, **run: Any) -> dict[str, Any]:
    """Return the parameters of the model and the settings of its study, from which a page knows the command."""
    study = model.study
    settings = {
        "mechanism": model.source, "set": {}, "error": study.error, "reduced": study.reduced,
        "controllers": list(study.controllers), "geometry": model.mechanism.geometry.value,
        "method": options.method.name, "tolerance": study.tolerance, "step": study.step,
    }  # fmt: skip
    return {"model": dict(model.parameters), "run": settings | run}
