"""One mechanism, path and mode at every fidelity and in other engines: do they agree, and is each converged?"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import partial

import xarray as xr

from paraflex.arguments import CheckedFields, checked_arguments, given_as
from paraflex.display import Shown
from paraflex.elastodynamics import simulate_ked
from paraflex.engines import ENGINES, check_dwell, check_engine
from paraflex.engines.exudyn import ExudynOptions, simulate_exudyn
from paraflex.engines.mujoco import MuJoCoOptions, simulate_mujoco
from paraflex.errors import InputError, IntegrationError, NumericalError, as_enum, suggestion
from paraflex.integrators import DEFAULT_METHOD, IntegrationOptions
from paraflex.integrators.methods import find_method
from paraflex.mechanism import (
    ActuationMode,
    Geometry,
    Mechanism,
    check_segmentable,
    given_shapes,
    proportional_segments,
)
from paraflex.results import tracking_dataset
from paraflex.results.following import ErrorSpan
from paraflex.results.record import Record, record
from paraflex.simulate import TrackingTask, simulate

FIDELITIES = ("rigid", "ked", "linear", "second-order", "segments")


class Refinement(Enum):
    """Runs of one model: as asked for, and finer ones whose distance from that shows how converged it is."""

    NONE = "base"
    STEP = "finer step"
    MESH = "finer mesh"


@dataclass(frozen=True)
class VerificationOptions(CheckedFields):
    """How fine the runs are; the finer ones take a quarter of the tolerance, half the step, or twice the mesh.

    Attributes
    ----------
    tolerance : float
        Of paraflex's own runs with error control [m].
    ked_step, exudyn_step, mujoco_step : float
        Of those with fixed steps [s].
    method : str
        Of paraflex's own runs with error control: see `paraflex.METHODS`.
    segments : int
        On the longest flexible beam; others get as many as their length takes.
    """

    _own = ("method",)
    tolerance: float = 5e-6
    ked_step: float = 1e-4
    exudyn_step: float = 5e-5
    mujoco_step: float = 1.0 / 30000.0
    segments: int = 8
    method: str = DEFAULT_METHOD

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "method", find_method(self.method).name)


@dataclass(frozen=True)
class ModelRuns:
    """What became of one model in one mode.

    Attributes
    ----------
    records : mapping of Refinement to Record
        Runs that were begun; one that failed says so in its figures.
    failure : str
        Why one of them failed; empty where none did.
    """

    records: Mapping[Refinement, Record]
    failure: str = ""

    def finished(self, level: Refinement | str) -> Record | None:
        """A run that got to its end."""
        run = self.records.get(as_enum(Refinement, level, "level"))
        return run if run is not None and run.figures["status"] == "complete" else None

    @property
    def base(self) -> Record | None:
        """The run to compare, if it got to its end."""
        return self.finished(Refinement.NONE)


@given_as("a verification", "what verify returns")
@dataclass(frozen=True)
class Verification(Shown):
    """Runs of all models in all modes.

    Attributes
    ----------
    task : TrackingTask
    models : tuple of str
    runs : mapping of str to mapping of str to ModelRuns
        By mode and model.
    interrupted : bool
        Whether the user stopped it; models that were not begun are missing.
    """

    task: TrackingTask
    models: tuple[str, ...]
    runs: Mapping[str, Mapping[str, ModelRuns]]
    interrupted: bool = False

    @property
    def complete(self) -> bool:
        """Whether every run got to its end."""
        return not self.interrupted and not any(
            runs.failure for by_model in self.runs.values() for runs in by_model.values()
        )

    def dataset(self, *, parameters: dict | None = None, error: ErrorSpan | str = ErrorSpan.MOTION) -> xr.Dataset:
        """The base runs as one dataset, with a dimension `model` besides those of a tracking study.

        Modes that every model began; where there is none, models that every mode begun has.
        """
        begun = {
            mode: {name: runs.records[Refinement.NONE] for name, runs in by_model.items() if runs.records}
            for mode, by_model in self.runs.items()
        }
        begun = {mode: records for mode, records in begun.items() if records}
        kept = {mode: records for mode, records in begun.items() if len(records) == len(self.models)} or begun
        names = [name for name in self.models if kept and all(name in records for records in kept.values())]
        if not names:
            raise InputError("no run to keep", field="models", remedy="see why the runs failed")
        parts = [
            tracking_dataset([records[name] for records in kept.values()], parameters=parameters, error=error)
            for name in names
        ]
        methods = [part.attrs.pop("method") for part in parts]
        data = xr.concat(parts, xr.Variable("model", names), combine_attrs="drop_conflicts", join="exact")
        data.attrs["reference"] = reference_model(names)
        return data.assign(method=("model", methods))


@checked_arguments()
def reference_model(models: Sequence[str]) -> str:
    """What the others are compared with: second-order geometry, or else the first that has flexible links."""
    for name in ("second-order", "exudyn", "segments", "mujoco", "linear", "ked"):
        if name in models:
            return name
    return models[0]


@checked_arguments()
def verify(
    task: TrackingTask,
    modes: Sequence[str | ActuationMode],
    *,
    models: Sequence[str] = FIDELITIES,
    options: VerificationOptions | None = None,
    on_progress: Callable[[str, int, int], None] | None = None,
) -> Verification:
    """Run every model in every mode, each with a finer step and a finer mesh; one that fails does not stop the others.

    Runs come one after the other, so that their wall times can be compared.

    Parameters
    ----------
    task : TrackingTask
        Of a mechanism with flexible beams; its own geometry does not matter.
    modes : sequence of str or ActuationMode
    models : sequence of str
        From FIDELITIES and engines.ENGINES.
    options : VerificationOptions, optional
    on_progress : callable, optional
        Called with what begins, its number and how many runs there are.

    Raises
    ------
    InputError
        An unknown model or mode, an engine that is not installed, or one that cannot express the mechanism: before
        anything runs.
    """
    options = options or VerificationOptions()
    models = list(dict.fromkeys(models))
    for name in models:
        check_model(name, task.mechanism)
        if name in ENGINES:
            check_dwell(name, task)
    chosen = list(dict.fromkeys(task.mode(mode) for mode in modes))
    plan = [
        (mode, name, level)
        for mode in chosen
        for name in models
        for level in Refinement
        if _has_meaning(name, level, task.mechanism)
    ]
    runs: dict[str, dict[str, ModelRuns]] = {mode.name: {} for mode in chosen}
    for number, (mode, name, level) in enumerate(plan):
        so_far = runs[mode.name].get(name, ModelRuns({}))
        if so_far.failure:
            continue
        try:
            if on_progress is not None:
                on_progress(f"{mode.name}: {name}, {level.value}", number, len(plan))
            extended = _extended(so_far, level, partial(run_model, task, mode, name, level, options))
        except KeyboardInterrupt:
            return Verification(task, tuple(models), runs, True)
        # A run that was stopped returns what it has; it is none to compare.
        if any(run.figures["status"] == "interrupted" for run in extended.records.values()):
            return Verification(task, tuple(models), runs, True)
        runs[mode.name][name] = extended
    return Verification(task, tuple(models), runs)


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
    """One run of one model.

    Raises
    ------
    NumericalError
        See the model's own function.
    """
    finer, denser = level is Refinement.STEP, 2 if level is Refinement.MESH else 1
    half = 0.5 if finer else 1.0
    tolerance = IntegrationOptions(tolerance=options.tolerance * (0.25 if finer else 1.0), method=options.method)
    beams = task.mechanism.refined(denser)
    if name == "rigid":
        return record(simulate(task.remodelled(beams.rigid()), mode, options=tolerance, warning=False))
    if name == "ked":
        return record(simulate_ked(task.remodelled(beams), mode, step=half * options.ked_step))
    if name in ("linear", "second-order"):
        return record(
            simulate(task.remodelled(beams.with_geometry(Geometry(name))), mode, options=tolerance, warning=False)
        )
    if name == "exudyn":
        return simulate_exudyn(task, mode, ExudynOptions(step=half * options.exudyn_step, refinement=denser))
    segments = task.in_segments(proportional_segments(task.mechanism, denser * options.segments))
    if name == "segments":
        return record(simulate(segments, mode, options=tolerance, warning=False))
    return simulate_mujoco(segments, mode, MuJoCoOptions(step=half * options.mujoco_step))


@checked_arguments()
def check_model(name: str, mechanism: Mechanism) -> None:
    """Check that a mechanism can be run in a model.

    Raises
    ------
    InputError
        No such model, an engine that is not installed, or one that cannot express the mechanism.
    """
    if name not in FIDELITIES + ENGINES:
        raise InputError("unknown model", field="model", value=name, remedy=suggestion(name, FIDELITIES + ENGINES))
    if name == "segments":
        check_segmentable(mechanism)
    if name in ENGINES:
        check_engine(name, mechanism)


def _has_meaning(name: str, level: Refinement, mechanism: Mechanism) -> bool:
    """Rigid bodies and given shapes have no mesh; MuJoCo's is that of our own segments, run by our own kernels."""
    return level is not Refinement.MESH or not (name in ("rigid", "mujoco") or given_shapes(mechanism.bodies))
