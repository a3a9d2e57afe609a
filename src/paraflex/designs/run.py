"""Runs of one design along one path in every mode: the function that all engines of a campaign call."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import xarray as xr

from paraflex.campaign import Row
from paraflex.compilation import compile_kernels_for
from paraflex.control import ControllerDescription, simulate_controlled
from paraflex.dynamics import build_system
from paraflex.equilibria import Statics, statics
from paraflex.errors import InputError, NumericalError
from paraflex.files import Model
from paraflex.integrators import IntegrationOptions
from paraflex.mechanism import Geometry, Mechanism
from paraflex.motion import MotionRun, state_at
from paraflex.reduced_bodies import reduced_task
from paraflex.results import motion_dataset, statics_dataset, tracking_dataset
from paraflex.results.metrics import METRICS, MetricMembers
from paraflex.tracking import TrackingTask, simulate
from .measure import Runs, coarseness, measure
from .own_motion import own_run
from .setting import Setting, digest, versions

if TYPE_CHECKING:
    import pyarrow as pa

STATUS_COMPLETE, STATUS_FAILED, STATUS_INVALID = "complete", "failed", "invalid"
STATUSES = (STATUS_COMPLETE, STATUS_FAILED, STATUS_INVALID)
_ID_DIGITS = 16


# Function that is called with the time reached in a run [s]; a KeyboardInterrupt from it abandons the run.
Watch = Callable[[float], None]
# Function that runs a prepared design in an actuation mode, which is ignored without a path.
Planned = Callable[[str, Watch | None], Runs]


def along_path(
    task: TrackingTask, controllers: Sequence[ControllerDescription], options: IntegrationOptions
) -> Planned:
    """Return the function that runs a planned motion, with controllers in addition to its torques if there are any."""
    if controllers:
        return lambda mode, watch: simulate_controlled(task, mode, controllers, options=options, on_progress=watch)
    return lambda mode, watch: simulate(task, mode, options=options, on_progress=watch, warning=False)


class Task(NamedTuple):
    """Design along a path: number of the task, number and values of the design, name of the path ("" without one)."""

    number: int
    design: int
    values: tuple[float, ...]
    path: str


@dataclass(frozen=True)
class Outcome:
    """Result of a task.

    Attributes
    ----------
    task : Task
        Task that was done.
    rows : list of dict
        Rows of the table, one for each mode, by column.
    trajectories : mapping of str to Dataset
        Datasets of whole runs by run id, if they are kept.
    """

    task: Task
    rows: list[Row]
    trajectories: Mapping[str, xr.Dataset] = field(default_factory=dict)


# `run_task`, or a function in its place: of the setting, a task and, in threads, a `Watch`.
RunTask = Callable[..., Outcome]


class Abandoned(Exception):
    """A run that was stopped on request and whose results are discarded."""


def run_task(setting: Setting, task: Task, watch: Watch | None = None) -> Outcome:
    """Plan a design's motion along a path and simulate it in every mode.

    The rows depend only on setting and task. An error of the design is reported in its rows and not raised.

    Parameters
    ----------
    setting : Setting
        Common settings of all runs.
    task : Task
        Design and path.
    watch : callable, optional
        Function called with the time reached in a run [s]; a KeyboardInterrupt from it abandons the task.

    Raises
    ------
    InputError
        This process has other versions of the packages that results depend on.
    Abandoned
        The task was abandoned by `watch`.
    """
    for name, version in setting.versions.items():
        if versions()[name] != version:
            raise InputError(
                f"a worker has {name} {versions()[name]}, the sweep was begun with {version}", field="--cluster",
                remedy="give workers the same installation: results must not depend on the worker",
            )  # fmt: skip
    rows, kept = [_blank(setting, task, mode) for mode in setting.modes], {}
    try:
        planned, options = ready(setting, task)
    except Exception as error:
        for row in rows:
            row |= error_row(error)
        return Outcome(task, rows)
    for row in rows:
        measured, run = measured_mode(planned, row["mode"], setting.metrics, watch)
        row |= measured
        if run is not None and setting.trajectories:
            # Datasets of repeated runs must be equal, so the wall time is left out.
            data = dataset_of(run, options).drop_vars("wall_time", errors="ignore")
            kept[row["id"]] = data.assign_attrs({name: row[name] for name in ("run", "id", "design")})
    return Outcome(task, rows, kept)


def ready(setting: Setting, task: Task) -> tuple[Planned, IntegrationOptions]:
    """Prepare a design: return the function that runs it or computes its equilibria, and the integration options.

    Raises
    ------
    InputError, NumericalError
        The values are invalid, the path is out of reach, or the loops do not close.
    """
    model, options = setting.design(task.values)
    if setting.has_path:
        return along_path(_planned(setting, model, task, options), model.acting(), options), options
    _compile(model.mechanism)
    if setting.statics:
        # By default the start is the model's own, else the assembly of its study.
        own = None if model.start is not None else model.study.assembly
        # Buckling factors take half of the time.
        buckling = None if setting.trajectories or "buckling_factor" in setting.metrics else 0
        solve = partial(statics, model, assembly=setting.assembly or own, buckling=buckling, warning=False)
        return lambda _mode, _watch: solve(), options
    study = setting.own_study(model)
    start = state_at(build_system(model.mechanism), model.start, study.assembly, balanced=setting.balanced)
    run = partial(own_run, model.mechanism, study, model.acting(), start=start, options=options)
    return lambda _, watch: run(on_progress=watch), options


def plan_task(setting: Setting, task: Task) -> tuple[TrackingTask, IntegrationOptions]:
    """Return the planned motion of a design along its path without controllers, and the integration options.

    Raises
    ------
    InputError, NumericalError
        The values are invalid, or the path is out of reach.
    """
    model, options = setting.design(task.values)
    return _planned(setting, model, task, options), options


def _planned(setting: Setting, model: Model, task: Task, options: IntegrationOptions) -> TrackingTask:
    _compile(model.mechanism)
    planned = model.plan(
        task.path, duration=setting.duration, samples=setting.samples, assembly=setting.assembly, warning=False
    )
    if model.study.reduced:
        # The reduced coordinates are selected for each design from its plan alone, without a run of the full model.
        tolerance = options.tolerance_for(planned.system)
        planned, _ = reduced_task(planned, model.study.reduced, tolerance, setting.modes)
    return planned


def table_schema(setting: Setting, members: MetricMembers) -> pa.Schema:
    """Return the schema of the table of rows: run, parameters, status, metrics, with units in the fields' metadata."""
    import pyarrow as pa

    whole, real, text = pa.int64(), pa.float64(), pa.string()
    columns = [("run", whole), ("id", text), ("design", whole), ("path", text), ("mode", text)]
    fields, units = [pa.field(*column) for column in columns], setting.units(members)
    for name, each in zip(setting.names, setting.whole, strict=True):
        about = {"unit": units[name]} if units[name] else None
        fields.append(pa.field(name, whole if each else real, metadata=about))
    fields += [pa.field("status", text), pa.field("reason", text)]
    fields.append(pa.field("time_reached", real, metadata={"unit": "s"}))
    for metric in map(METRICS.__getitem__, setting.metrics):
        for column in metric.columns(members):
            about = {"unit": units[column], "meaning": metric.meaning}
            fields.append(pa.field(column, whole if metric.whole else real, metadata=about))
    return pa.schema(fields)


def error_row(error: Exception) -> Row:
    """Return status, reason and time reached of a run that an error ended."""
    if isinstance(error, InputError):
        return {"status": STATUS_INVALID, "reason": str(error)}
    if isinstance(error, NumericalError):
        reached = None if error.moment is None else float(error.moment.time)
        return {"status": STATUS_FAILED, "reason": str(error), "time_reached": reached}
    return {"status": STATUS_FAILED, "reason": f"{type(error).__name__}: {error}"}


def lost(setting: Setting, task: Task, reason: str) -> Outcome:
    """Return the rows of a task whose workers were lost."""
    rows = [_blank(setting, task, mode) | {"status": STATUS_FAILED, "reason": reason} for mode in setting.modes]
    return Outcome(task, rows)


def run_id(setting: Setting, task: Task, mode: str) -> str:
    """Return the id of a run, a digest of all inputs that it depends on, which is the same in every study."""
    numbers = sorted((str(place), number) for place, number in setting.numbers(task.values))
    return digest([setting.identity, numbers, task.path, mode])[:_ID_DIGITS]


def is_row_of(setting: Setting, row: Row) -> bool:
    """Check whether a row belongs to a setting: its id is that of its values, path and mode."""
    try:
        task = Task(0, 0, tuple(row[name] for name in setting.names), row["path"])
        return row["id"] == run_id(setting, task, row["mode"])
    except (KeyError, TypeError, ValueError):
        return False


def _blank(setting: Setting, task: Task, mode: str) -> Row:
    first = task.number * len(setting.modes)
    return {
        "run": first + setting.modes.index(mode),
        "id": run_id(setting, task, mode),
        "design": task.design,
        "path": task.path,
        "mode": mode,
        **dict(zip(setting.names, task.values, strict=True)),
        "status": STATUS_FAILED,
        "reason": "",
        "time_reached": None,
    }


def run_mode(planned: Planned, mode: str, watch: Watch | None = None) -> Runs:
    """Run a prepared design in an actuation mode, or compute its equilibria.

    Raises
    ------
    Abandoned
        The run was abandoned by `watch`; see `run_task`.
    """
    run = planned(mode, watch)
    if run.solution.status == "interrupted":
        raise Abandoned
    return run


def measured_mode(
    planned: Planned, mode: str, metrics: Sequence[str], watch: Watch | None = None
) -> tuple[Row, Runs | None]:
    """Run a mode, and return its metrics and status by column, and the run.

    If an error ended the run, return the status and reason of the failure, and None.

    Raises
    ------
    Abandoned
        The run was abandoned by `watch`; see `run_task`.
    """
    try:
        run = run_mode(planned, mode, watch)
        row = measure(run, metrics) | {
            "status": STATUS_COMPLETE,
            "reason": coarseness(run, metrics),
            "time_reached": None if isinstance(run, Statics) else float(run.solution.t[-1]),
        }
    except Abandoned:
        raise
    # An unexpected error of one design is recorded in its row and does not end the sweep.
    except Exception as error:
        return error_row(error), None
    return row, run


def dataset_of(run: Runs, options: IntegrationOptions) -> xr.Dataset:
    """Return the dataset of a run with all its samples."""
    if isinstance(run, Statics):
        return statics_dataset(run)
    if isinstance(run, MotionRun):
        return motion_dataset(run, options=options)
    return tracking_dataset([run], options=options)


def _compile(mechanism: Mechanism) -> None:
    """Compile the kernels if the parent process has not done so, once per process and geometry."""
    with _compiling:
        if mechanism.geometry not in _compiled:
            compile_kernels_for(mechanism, lambda _: None)
            _compiled.add(mechanism.geometry)


_compiled: set[Geometry] = set()
_compiling = threading.Lock()
