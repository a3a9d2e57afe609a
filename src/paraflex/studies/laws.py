"""Control laws in several actuation modes: every law is run in every mode."""

from __future__ import annotations

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
from paraflex.control.chain import SampledController
from paraflex.control.described import NONE, ControllerDescription
from paraflex.designs.measure import members_of, metrics_of
from paraflex.designs.run import measured_mode, under_control
from paraflex.errors import InputError
from paraflex.files import Model, load
from paraflex.integrators import IntegrationOptions
from paraflex.mechanism import ActuationMode
from paraflex.reduction import reduced_mechanism
from paraflex.results.following import HEADLINE, ErrorSpan
from paraflex.results.labelled import provenance
from paraflex.results.metrics import METRICS
from paraflex.studies.law_comparison import OPEN_LOOP, LawComparison, law_dataset
from paraflex.tracking import TrackingTask

# Between the names of controllers that act together.
_AND = "+"
# Root mean square and largest error come first: those of the motion, or of the whole run.
_LARGEST = {ErrorSpan.MOTION: "tracking_max_motion", ErrorSpan.WHOLE: "tracking_max"}
_JUDGED = (
    "residual_vibration", "settling_time", "overshoot", "peak_torque_max", "internal_torque_max", "motor_energy",
    "saturated_share",
)  # fmt: skip
Cell = tuple[str, str]


@dataclass(frozen=True)
class LawStudy(WholeStudy[LawComparison], CheckedFields):
    """Control laws along one path or several, each in several actuation modes.

    A law that cannot run in a mode is marked there with its reason. Progress is that of runs. Workers are threads.

    Attributes
    ----------
    tasks : mapping of str to TrackingTask
        By the name of the path, all of one mechanism. Along several paths each law has a row for each.
    laws : mapping of str to sequence of ControllerDescription or SampledController
        Controllers that act together beside the planned torques; none of them is the open loop.
    modes : sequence of str or ActuationMode
    options : IntegrationOptions or None
        The defaults where None.
    metrics : sequence of str
        Names of `METRICS`; by default those that laws are judged by.
    error : ErrorSpan or str
        Whether errors are those of the "motion" or of the "whole" run, where no metrics are named.
    parameters : dict or None
        Kept as provenance.

    Raises
    ------
    InputError
        From `run`: a mode that is none of the mechanism's, or workers that are no threads, before anything runs.
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
        names = self.metrics or (HEADLINE[self.error], _LARGEST[self.error], *_JUDGED)
        object.__setattr__(self, "metrics", metrics_of(names, self.error, self._task.mechanism))

    @property
    def _task(self) -> TrackingTask:
        return next(iter(self.tasks.values()))

    @property
    def rows(self) -> dict[str, tuple[str, str]]:
        """The law and the path of every row, by its name: that of the law, with the path where there are several."""
        return {
            law if len(self.tasks) == 1 else f"{law}, {path}": (law, path) for law in self.laws for path in self.tasks
        }

    def _ready(self, workers: Workers | None) -> Callable[[OnProgress | None], LawComparison]:
        workers = workers or Workers()
        if workers.engine != THREADS:
            raise InputError("laws run in threads", field="workers", value=workers.engine, remedy="leave it out")
        modes = list(dict.fromkeys(self._task.mode(mode).name for mode in self.modes))
        return partial(self._run, modes, workers)

    def _run(self, modes: Sequence[str], workers: Workers, on_progress: OnProgress | None) -> LawComparison:
        cells = [(row, mode) for row in self.rows for mode in modes]
        found: dict[Cell, Row] = {}
        began = time.perf_counter()

        def tell() -> None:
            if on_progress is not None:
                on_progress(Progress(len(found), len(cells), len(found), time.perf_counter() - began))

        # Runs that are stopped halfway tell nothing of a law.
        with suppress(KeyboardInterrupt):
            tell()
            with workers.open() as engine:
                for cell, row in outcomes(engine, self._cell, cells):
                    assert not isinstance(row, LostWorker)  # threads are not lost
                    found[cell] = row
                    tell()
        return LawComparison(self._dataset(modes, found), interrupted=len(found) < len(cells))

    def _cell(self, cell: Cell, watch: Any) -> Row:
        name, mode = cell
        law, path = self.rows[name]
        # Controllers have states, and several modes are run at once.
        planned = under_control(self.tasks[path], copy.deepcopy(tuple(self.laws[law])))
        row, _ = measured_mode(planned, mode, self.options or IntegrationOptions(), self.metrics, watch)
        return row

    def _dataset(self, modes: Sequence[str], found: Mapping[Cell, Row]) -> Any:
        mechanism, options = self._task.mechanism, self.options or IntegrationOptions()
        laws = {name: ([one.name for one in self.laws[law]], path) for name, (law, path) in self.rows.items()}
        members = members_of(mechanism)
        columns = [column for name in self.metrics for column in METRICS[name].columns(members)]
        about = provenance(self._task.system, options.method.title, options, self.parameters) | {
            "error": self.error.value
        }
        return law_dataset(laws, modes, found, columns, members, about)


def laws_of(model: Model, names: Sequence[str] = ()) -> dict[str, tuple[ControllerDescription, ...]]:
    """Control laws of a model by name, the open loop first.

    Parameters
    ----------
    model : Model
    names : sequence of str
        Controllers, of which several that act together are joined, "joints+tip"; "none" for the open loop alone. By
        default every controller by itself, and those of the study together.

    Raises
    ------
    InputError
        An unknown controller, or periods of several that are no multiples of the shortest.
    """
    together = [_AND.join(model.study.controllers)] if len(model.study.controllers) > 1 else []
    wanted = [name for name in names or [*model.controllers, *together] if name != NONE]
    acting = {name: [name] if name in model.controllers else name.split(_AND) for name in wanted}
    for name, parts in acting.items():
        if NONE in parts or "" in parts:
            raise InputError("names no controllers", field="controllers", value=name,
                             remedy=f"join names with {_AND}, as joints{_AND}tip")  # fmt: skip
    return {OPEN_LOOP: ()} | {name: model.acting(parts) for name, parts in acting.items()}


def reduced_tasks(
    model: Model, tasks: Mapping[str, TrackingTask], modes: Sequence[str | ActuationMode]
) -> dict[str, TrackingTask]:
    """Plans with as few flexible coordinates as the model's study keeps; as they are where it keeps all."""
    if not model.study.reduced:
        return dict(tasks)
    # One mechanism for all, as results of several would differ by that too.
    mechanism = reduced_mechanism(next(iter(tasks.values())), model.study.reduced, modes=modes)
    return {name: task.remodelled(mechanism) for name, task in tasks.items()}


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
    """Run control laws in several actuation modes, and compare what they come to.

    Parameters
    ----------
    model : Model, str or Path
        A model, or the name or file of one.
    modes : sequence of str
        By default those of its study.
    laws : sequence of str, or mapping of str to sequence of controllers
        Names of its controllers, "a+b" for two that act together; by default all, each by itself. Or controllers by
        the name of the law: `ControllerDescription` or `SampledController`. The open loop comes first.
    paths : sequence of str
        By default that of its study, or the first. Along several, such as one and the same with a shaper, each law has
        a row for each.
    metrics : sequence of str
        Names of `METRICS`; by default tracking errors, vibration, settling, overshoot, torques, energy, saturation.
    duration, samples, assembly
        See `plan`.
    options : IntegrationOptions, optional
        By default as the model's study has it.
    workers : int, optional
        Threads; as many as there are processors by default. The results do not depend on it.
    on_progress : callable, optional
        See `Study.run`.

    Raises
    ------
    InputError
        An unknown mode, controller, path or metric. A law that cannot run in a mode is no error: its cell says why.
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
    study = LawStudy(
        reduced_tasks(model, tasks, found), chosen, found, options or model.study.integration(), metrics,
        ErrorSpan(model.study.error), {"model": dict(model.parameters)},
    )  # fmt: skip
    return study.run(workers=Workers(number=workers), on_progress=on_progress)
