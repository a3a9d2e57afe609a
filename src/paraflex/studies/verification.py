"""Verification study: one mechanism and path by several models and engines, each with finer steps and meshes."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar

from paraflex.arguments import CheckedFields, checked_arguments
from paraflex.campaign import OnProgress, Progress, Result, WholeStudy, Workers, no_workers
from paraflex.elastodynamics import simulate_ked
from paraflex.engines import ENGINES, check_dwell, check_engine
from paraflex.engines.exudyn import ExudynOptions, simulate_exudyn
from paraflex.engines.mujoco import MuJoCoOptions, simulate_mujoco
from paraflex.errors import InputError, IntegrationError, NumericalError, as_enum, suggestion
from paraflex.integrators import IntegrationOptions
from paraflex.integrators.methods import MethodField
from paraflex.mechanism import (
    ActuationMode,
    Geometry,
    Mechanism,
    check_segmentable,
    given_shapes,
    proportional_segments,
)
from paraflex.results.following import ErrorSpan
from paraflex.results.record import Record, record
from paraflex.tracking import TrackingTask, simulate
from .agreement import ModelRuns, Refinement, Verification

FIDELITIES = ("rigid", "ked", "linear", "second-order", "segments")


@dataclass(frozen=True)
class VerificationOptions(CheckedFields):
    """Resolution of the runs; finer runs use a quarter of the tolerance, half the step, or twice as many elements.

    Attributes
    ----------
    tolerance : float
        Tolerance of the runs of paraflex with error control [m].
    ked_step, exudyn_step, mujoco_step : float
        Step sizes of the runs with fixed steps [s].
    method : Method or str
        Integration method of the runs of paraflex with error control; see `IntegrationOptions`.
    segments : int
        Number of segments of the longest flexible beam; the others get a number in proportion to their length.
    """

    _own = ("method",)
    tolerance: float = 5e-6
    ked_step: float = 1e-4
    exudyn_step: float = 5e-5
    mujoco_step: float = 1.0 / 30000.0
    segments: int = 8
    method: MethodField = MethodField()  # noqa: RUF009 - a descriptor


@dataclass(frozen=True)
class VerificationStudy(WholeStudy[Verification], CheckedFields):
    """Verification study: every model in every mode, each also with a finer step and a finer mesh.

    A model that fails does not stop the others. The runs are sequential, so that their wall times are comparable;
    workers are not accepted.

    Attributes
    ----------
    task : TrackingTask
        Task of a mechanism with flexible beams; each model sets the geometry (linear or second order) itself.
    modes : sequence of str or ActuationMode
        Actuation modes.
    models : sequence of str
        Names of models, from FIDELITIES and engines.ENGINES.
    options : VerificationOptions or None
        Resolution of the runs; None for the defaults.
    parameters : dict or None
        Parameters stored as provenance.
    error : ErrorSpan or str
        Time span of the tracking errors: the "motion", or the "whole" run including the dwell.

    Raises
    ------
    InputError
        Unknown model or mode, engine that is not installed, or engine that cannot represent the mechanism or the dwell;
        raised by `run` before anything runs.
    """

    gives: ClassVar[type[Result]] = Verification
    task: TrackingTask
    modes: Sequence[str | ActuationMode]
    models: Sequence[str] = FIDELITIES
    options: VerificationOptions | None = None
    parameters: dict[str, Any] | None = None
    error: ErrorSpan | str = ErrorSpan.MOTION

    def _prepare(self, workers: Workers | None) -> Callable[[OnProgress | None], Verification]:
        no_workers(workers, "runs are made one after another")
        models = tuple(dict.fromkeys(self.models))
        for name in models:
            check_model(name, self.task.mechanism)
            if name in ENGINES:
                check_dwell(name, self.task)
        chosen = list(dict.fromkeys(self.task.mode(mode) for mode in self.modes))
        return partial(self._run, chosen, models, as_enum(ErrorSpan, self.error, "error"))

    def _run(
        self, modes: Sequence[ActuationMode], models: tuple[str, ...], error: ErrorSpan, on_progress: OnProgress | None
    ) -> Verification:
        task, options = self.task, self.options or VerificationOptions()
        runs: dict[str, dict[str, ModelRuns]] = {mode.name: {} for mode in modes}
        plan = [
            (mode, name, level)
            for mode in modes
            for name in models
            for level in Refinement
            if _has_meaning(name, level, task.mechanism)
        ]
        interrupted = False
        try:
            for number, (mode, name, level) in enumerate(plan):
                so_far = runs[mode.name].get(name, ModelRuns({}))
                if so_far.failure:
                    continue
                if on_progress is not None:
                    on_progress(Progress(number, len(plan), number, doing=f"{mode.name}: {name}, {level.value}"))
                extended = _extended(so_far, level, partial(run_model, task, mode, name, level, options))
                # An interrupted run returns its samples, but cannot be compared.
                if any(run.figures["status"] == "interrupted" for run in extended.records.values()):
                    raise KeyboardInterrupt
                runs[mode.name][name] = extended
        except KeyboardInterrupt:
            interrupted = True
        return Verification(task, models, runs, interrupted, self.parameters, error)


@checked_arguments()
def verify(
    task: TrackingTask,
    modes: Sequence[str | ActuationMode],
    *,
    models: Sequence[str] = FIDELITIES,
    options: VerificationOptions | None = None,
    on_progress: OnProgress | None = None,
) -> Verification:
    """Run every model in every mode: a shortcut for `VerificationStudy(task, modes, models, options).run()`.

    Parameters
    ----------
    task, modes, models, options
        See `VerificationStudy`.
    on_progress : callable, optional
        See `Study.run`.
    """
    return VerificationStudy(task, modes, models, options).run(on_progress=on_progress)


def _extended(runs: ModelRuns, level: Refinement, run: Callable[[], Record]) -> ModelRuns:
    try:
        return ModelRuns({**runs.records, level: run()})
    except IntegrationError as error:
        partial = error.partial if isinstance(error.partial, Record) else record(error.partial)
        return ModelRuns({**runs.records, level: partial}, f"{level.value}: {error}")
    except NumericalError as error:
        return ModelRuns(runs.records, f"{level.value}: {error}")


def run_model(
    task: TrackingTask, mode: ActuationMode, name: str, level: Refinement, options: VerificationOptions
) -> Record:
    """Run one model in one mode at one refinement level.

    Raises
    ------
    NumericalError
        Failure of the model's simulation function.
    """
    finer, denser = level is Refinement.STEP, 2 if level is Refinement.MESH else 1
    half = 0.5 if finer else 1.0
    tolerance = IntegrationOptions(tolerance=options.tolerance * (0.25 if finer else 1.0), method=options.method)
    beams = task.mechanism.refined(denser)
    if name == "ked":
        return record(simulate_ked(task.remodelled(beams), mode, step=half * options.ked_step))
    if name == "exudyn":
        return simulate_exudyn(task, mode, ExudynOptions(step=half * options.exudyn_step, refinement=denser))
    if name in ("segments", "mujoco"):
        variant = task.in_segments(proportional_segments(task.mechanism, denser * options.segments))
    else:
        variant = task.remodelled(beams.rigid() if name == "rigid" else beams.with_geometry(Geometry(name)))
    if name == "mujoco":
        return simulate_mujoco(variant, mode, MuJoCoOptions(step=half * options.mujoco_step))
    return record(simulate(variant, mode, options=tolerance, warning=False))


@checked_arguments()
def check_model(name: str, mechanism: Mechanism) -> None:
    """Check that a mechanism can be run with a model.

    Parameters
    ----------
    name : str
        Name of the model, from FIDELITIES and engines.ENGINES.
    mechanism : Mechanism
        Mechanism to run.

    Raises
    ------
    InputError
        Unknown model, engine that is not installed, or model that cannot represent the mechanism.
    """
    if name not in FIDELITIES + ENGINES:
        raise InputError("unknown model", field="model", value=name, remedy=suggestion(name, FIDELITIES + ENGINES))
    if name == "segments":
        check_segmentable(mechanism)
    if name in ENGINES:
        check_engine(name, mechanism)


def _has_meaning(name: str, level: Refinement, mechanism: Mechanism) -> bool:
    """Check whether a refinement level applies to a model.

    Rigid bodies and given shapes have no mesh; the mesh of MuJoCo's model is that of the segments.
    """
    return level is not Refinement.MESH or not (name in ("rigid", "mujoco") or given_shapes(mechanism.bodies))
