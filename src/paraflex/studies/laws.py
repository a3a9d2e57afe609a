"""Comparison of control laws in several actuation modes: every law is run in every mode."""

import copy
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

from paraflex.arguments import CheckedFields, checked_arguments, refused
from paraflex.campaign import THREADS, LostWorker, OnProgress, Progress, Result, Row, WholeStudy, Workers, outcomes
from paraflex.control.laws.described import NONE, ControllerDescription
from paraflex.control.loop.chain import SampledController
from paraflex.designs.measure import metrics_of
from paraflex.designs.run import along_path, measured_mode
from paraflex.errors import InputError
from paraflex.files import Model, load
from paraflex.integrators import IntegrationOptions
from paraflex.mechanism import ActuationMode
from paraflex.reduced_bodies import reduced_task
from paraflex.results.following import HEADLINE, ErrorSpan
from paraflex.results.labelled import provenance
from paraflex.results.metrics import METRICS, MetricMembers
from paraflex.tracking import TrackingTask
from .law_comparison import OPEN_LOOP, LawComparison, law_dataset

# Separator of the names of controllers that act together.
_AND = "+"
# Default metrics: RMS and largest tracking error of the span come first, then these.
_LARGEST = {ErrorSpan.MOTION: "tracking_max_motion", ErrorSpan.WHOLE: "tracking_max"}
_DEFAULT_METRICS = (
    "residual_vibration", "settling_time", "overshoot", "peak_torque_max", "internal_torque_max", "motor_energy",
    "saturated_share",
)  # fmt: skip
Cell = tuple[str, str]


@dataclass(frozen=True)
class LawStudy(WholeStudy[LawComparison], CheckedFields):
    """Comparison of control laws along one path or several, each in several actuation modes.

    If a law cannot run in a mode, its cell contains the reason. Progress counts runs. Workers are threads.

    Attributes
    ----------
    tasks : mapping of str to TrackingTask
        Planned motions by the name of the path, all of one mechanism. With several paths, each law has one row per
        path.
    laws : mapping of str to sequence of ControllerDescription or SampledController
        Controllers of each law, which act together in addition to the planned torques; an empty sequence is the open
        loop.
    modes : sequence of str or ActuationMode
        Actuation modes.
    options : IntegrationOptions or None
        Integration options; None for the defaults.
    metrics : sequence of str
        Names of `METRICS`; by default tracking errors, vibration, settling time, overshoot, torques, energy and
        saturation.
    error : ErrorSpan or str
        Time span of the default tracking errors: the "motion" or the "whole" run.
    parameters : dict or None
        Parameters stored as provenance.

    Raises
    ------
    InputError
        Unknown mode, or workers that are not threads; raised by `run` before anything runs.
    """

    _own = ("laws",)
    gives: ClassVar[type[Result]] = LawComparison
    tasks: Mapping[str, TrackingTask]
    laws: Mapping[str, Sequence[Any]]
    modes: Sequence[str | ActuationMode]
    options: IntegrationOptions | None = None
    metrics: Sequence[str] = ()
    error: ErrorSpan = ErrorSpan.MOTION
    parameters: dict[str, Any] | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("tasks", "laws", "modes"):
            if not getattr(self, name):
                raise InputError("nothing to compare", field=name, remedy="give one at least")
        for law, together in self.laws.items():
            kinds = (ControllerDescription, SampledController)
            if not isinstance(together, list | tuple) or not all(isinstance(one, kinds) for one in together):
                remedy = "give those of a model, or pf.SampledController(law, name=...)"
                raise refused(together, f"laws.{law}", "a list of controllers", remedy)
        names = self.metrics or (HEADLINE[self.error], _LARGEST[self.error], *_DEFAULT_METRICS)
        object.__setattr__(self, "metrics", metrics_of(names, self.error, self._task.mechanism))

    @property
    def _task(self) -> TrackingTask:
        return next(iter(self.tasks.values()))

    @property
    def rows(self) -> dict[str, tuple[str, str]]:
        """Law and path of every row by the row's name: that of the law, followed by the path if there are several."""
        return {
            law if len(self.tasks) == 1 else f"{law}, {path}": (law, path) for law in self.laws for path in self.tasks
        }

    def _prepare(self, workers: Workers | None) -> Callable[[OnProgress | None], LawComparison]:
        workers = workers or Workers()
        if workers.engine != THREADS:
            raise InputError("laws run in threads", field="workers", value=workers.engine, remedy="leave it out")
        modes = list(dict.fromkeys(self._task.mode(mode).name for mode in self.modes))
        return partial(self._run, modes, workers)

    def _run(self, modes: Sequence[str], workers: Workers, on_progress: OnProgress | None) -> LawComparison:
        cells = [(row, mode) for row in self.rows for mode in modes]
        found: dict[Cell, Row] = {}
        began = time.perf_counter()

        def report() -> None:
            if on_progress is not None:
                on_progress(Progress(len(found), len(cells), len(found), time.perf_counter() - began))

        # Results of interrupted runs are discarded, because they do not characterise a law.
        with suppress(KeyboardInterrupt):
            report()
            with workers.open() as engine:
                for cell, row in outcomes(engine, self._cell, cells):
                    assert not isinstance(row, LostWorker)  # only processes can be lost
                    found[cell] = row
                    report()
        return LawComparison(self._dataset(modes, found), interrupted=len(found) < len(cells))

    def _cell(self, cell: Cell, watch: Any) -> Row:
        name, mode = cell
        law, path = self.rows[name]
        # Controllers have internal states, and several modes are run at once.
        controllers = copy.deepcopy(tuple(self.laws[law]))
        planned = along_path(self.tasks[path], controllers, self.options or IntegrationOptions())
        return measured_mode(planned, mode, self.metrics, watch)[0]

    def _dataset(self, modes: Sequence[str], found: Mapping[Cell, Row]) -> Any:
        mechanism, options = self._task.mechanism, self.options or IntegrationOptions()
        laws = {name: ([one.name for one in self.laws[law]], path) for name, (law, path) in self.rows.items()}
        members = MetricMembers(mechanism)
        columns = [column for name in self.metrics for column in METRICS[name].columns(members)]
        about = provenance(self._task.system, options.method.title, options, self.parameters) | {
            "error": self.error.value
        }
        return law_dataset(laws, modes, found, columns, members, about)


def laws_of(model: Model, names: Sequence[str] = ()) -> dict[str, tuple[ControllerDescription, ...]]:
    """Return the control laws of a model by name, the open loop first.

    Parameters
    ----------
    model : Model
        Model with its controllers.
    names : sequence of str
        Names of controllers; names of controllers that act together are joined, as in "joints+tip"; "none" for the open
        loop alone. By default every controller by itself, and all controllers of the study together if it has several.

    Raises
    ------
    InputError
        Unknown controller, sample periods that are not multiples of the shortest one, or two laws that each give the
        whole torque.
    """
    together = [_AND.join(model.study.controllers)] if len(model.study.controllers) > 1 else []
    chosen = [name for name in names or [*model.controllers, *together] if name != NONE]
    acting = {name: [name] if name in model.controllers else name.split(_AND) for name in chosen}
    for name, parts in acting.items():
        if NONE in parts or "" in parts:
            raise InputError("names no controllers", field="controllers", value=name,
                             remedy=f"join names with {_AND}, as joints{_AND}tip")  # fmt: skip
    return {OPEN_LOOP: ()} | {name: model.acting(parts) for name, parts in acting.items()}


def reduced_tasks(
    model: Model, tasks: Mapping[str, TrackingTask], modes: Sequence[str | ActuationMode], options: IntegrationOptions
) -> dict[str, TrackingTask]:
    """Return the tasks with reduced bodies if the model's study asks for a reduction, else the tasks unchanged."""
    if not model.study.reduced:
        return dict(tasks)
    # One reduced mechanism serves all paths, so that their results do not differ by the reduction.
    first = next(iter(tasks.values()))
    few, _ = reduced_task(first, model.study.reduced, options.tolerance_for(first.system), modes)
    return {name: task.remodelled(few.mechanism) for name, task in tasks.items()}


@checked_arguments(model="give a model, or the name or file of one")
def compare_laws(
    model: Model | str | Path,
    modes: Sequence[str] = (),
    laws: Sequence[str] | Mapping[str, Any] = (),
    *,
    paths: Sequence[str] = (),
    metrics: Sequence[str] = (),
    duration: float | None = None,
    samples: int | None = None,
    assembly: str | None = None,
    options: IntegrationOptions | None = None,
    workers: int | None = None,
    on_progress: OnProgress | None = None,
) -> LawComparison:
    """Run control laws in several actuation modes, and compare their metrics.

    Parameters
    ----------
    model : Model, str or Path
        Model, or its name or file.
    modes : sequence of str
        Names of the modes; by default those of the model's study.
    laws : sequence of str, or mapping of str to sequence of controllers
        Names of the model's controllers, "a+b" for two that act together; by default as in `laws_of`. Alternatively
        a mapping from the name of a law to its controllers: `ControllerDescription` or `SampledController`. The open
        loop is added as the first law.
    paths : sequence of str
        Names of the paths; by default that of the study, or the first. With several paths, such as one path with and
        without a shaper, each law has one row per path.
    metrics : sequence of str
        Names of `METRICS`; by default tracking errors, vibration, settling, overshoot, torques, energy, saturation.
    duration, samples, assembly
        See `plan`.
    options : IntegrationOptions, optional
        Integration options; by default those of the model's study.
    workers : int, optional
        Number of threads; by default the number of processors. The results do not depend on it.
    on_progress : callable, optional
        See `Study.run`.

    Raises
    ------
    InputError
        Unknown mode, controller, path or metric. A law that cannot run in a mode raises no error; its cell contains the
        reason.
    AssemblyError
        See `plan`.
    """
    model = model if isinstance(model, Model) else load(model)
    chosen = {OPEN_LOOP: ()} | dict(laws) if isinstance(laws, Mapping) else laws_of(model, laws)
    found = model.modes(modes)
    if not found:
        raise refused(None, "modes", "an actuation mode", "name one; the mechanism has none of its own")
    tasks = {
        model.path_name(name): model.plan(name, duration=duration, samples=samples, assembly=assembly, warning=False)
        for name in paths or (None,)
    }
    options = options or model.study.integration()
    study = LawStudy(
        reduced_tasks(model, tasks, found, options), chosen, found, options, metrics,
        ErrorSpan(model.study.error), {"model": dict(model.parameters)},
    )  # fmt: skip
    return study.run(workers=Workers(number=workers), on_progress=on_progress)
