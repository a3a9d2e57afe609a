"""Results of a verification: runs of several models of one mechanism, and the distances between them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr

from paraflex.arguments import checked_arguments, named_in_errors
from paraflex.arrays import Array, Brief
from paraflex.campaign import Result
from paraflex.display import Played
from paraflex.errors import as_enum
from paraflex.findings import Verdict
from paraflex.folders import VERIFICATION
from paraflex.results.dataset import part_of, tracking_dataset
from paraflex.results.following import HEADLINE, ErrorSpan
from paraflex.results.formulas import rms
from paraflex.results.metrics import METRICS
from paraflex.results.record import Record
from paraflex.results.traces import Traces
from paraflex.tracking import TrackingTask
from paraflex.validity import implausible_numbers


class Refinement(Enum):
    """Refinement levels of a model's runs: the distance of the finer runs from the base run shows its convergence."""

    NONE = "base"
    STEP = "finer step"
    MESH = "finer mesh"


@dataclass(frozen=True)
class ModelRuns(Brief):
    """Results of one model in one mode.

    Attributes
    ----------
    records : mapping of Refinement to Record
        Runs that were started; the `figures` of a failed run contain its status.
    failure : str
        Reason of the first failure; empty if no run failed.
    """

    records: Mapping[Refinement, Record]
    failure: str = ""

    def finished(self, level: Refinement | str) -> Record | None:
        """Return the run at a refinement level if it reached its end, else None."""
        run = self.records.get(as_enum(Refinement, level, "level"))
        return run if run is not None and run.figures["status"] == "complete" else None

    @property
    def base(self) -> Record | None:
        """Base run, which is compared with other models; None if it did not reach its end."""
        return self.finished(Refinement.NONE)


@named_in_errors("a verification", "what verify returns")
@dataclass(frozen=True)
class Verification(Result, Played):
    """Runs of all models in all modes.

    Attributes
    ----------
    task : TrackingTask
        Task that every model was run on.
    models : tuple of str
        Names of the models.
    runs : mapping of str to mapping of str to ModelRuns
        Runs by mode, then by model.
    interrupted : bool
        Whether the user stopped the study; models that were not started are missing.
    parameters : mapping or None
        Parameters stored as provenance.
    error : ErrorSpan
        Time span of the tracking errors: the motion, or the whole run including the dwell. Distances between models
        always refer to the whole run.
    """

    kept_as = VERIFICATION
    data_file = "verify.nc"
    values_file = "verify.json"
    task: TrackingTask
    models: tuple[str, ...]
    runs: Mapping[str, Mapping[str, ModelRuns]]
    interrupted: bool = False
    parameters: dict[str, Any] | None = None
    error: ErrorSpan = ErrorSpan.MOTION

    @property
    def complete(self) -> bool:
        """Whether every run reached its end."""
        return not self.interrupted and not any(
            runs.failure for by_model in self.runs.values() for runs in by_model.values()
        )

    @cached_property
    def data(self) -> xr.Dataset | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Base runs as one dataset, with a dimension `model` in addition to those of a tracking study.

        The dataset holds the modes in which every model was started. If there is no such mode, it holds the models that
        were started in every mode with any run. It is None if neither exists.
        """
        begun = {
            mode: {name: runs.records[Refinement.NONE] for name, runs in by_model.items() if runs.records}
            for mode, by_model in self.runs.items()
        }
        begun = {mode: records for mode, records in begun.items() if records}
        kept = {mode: records for mode, records in begun.items() if len(records) == len(self.models)} or begun
        names = [name for name in self.models if kept and all(name in records for records in kept.values())]
        if not names:
            return None
        parts = [
            tracking_dataset([records[name] for records in kept.values()], parameters=self.parameters, error=self.error)
            for name in names
        ]
        # Models differ in their further variables, such as section forces and joint angles.
        common = set.intersection(*(set(part.variables) for part in parts))
        parts = [part.drop_vars(set(part.variables) - common) for part in parts]
        methods = [part.attrs.pop("method") for part in parts]
        data = xr.concat(parts, xr.Variable("model", names), combine_attrs="drop_conflicts", join="exact")
        data.attrs["reference"] = reference_model(names)
        return data.assign(method=("model", methods))

    def to_dict(self) -> dict[str, Any]:
        """Return errors and distances of the models as plain values; None where a run did not reach its end."""
        task, reference = self.task, reference_model(self.models)
        part = part_of(task.path, float(task.motion.t[-1]))
        findings = [*implausible_numbers(task.mechanism), *([] if part is None else [part.finding()])]
        out = {
            "mechanism": task.mechanism.name,
            "duration": float(task.motion.t[-1]),
            "samples": int(task.motion.t.size),
            "verdict": Verdict(findings).to_dict(),
            "part": None if part is None else part.to_dict(),
            "reference": reference,
            "error": self.error.value,
            "links": [body.name for body in task.mechanism.bodies],
            "complete": self.complete,
            "interrupted": self.interrupted,
            "modes": {mode: _of_mode(task, self.error, by_model, reference) for mode, by_model in self.runs.items()},
        }
        return out if self.parameters is None else out | {"parameters": self.parameters}


@checked_arguments()
def reference_model(models: Sequence[str]) -> str:
    """Return the reference model of a comparison: second-order geometry, or else the first model with flexible links.

    The order of preference is second-order, exudyn, segments, mujoco, linear, ked. If none of them is among the models,
    the first model is returned.
    """
    for name in ("second-order", "exudyn", "segments", "mujoco", "linear", "ked"):
        if name in models:
            return name
    return models[0]


def _of_mode(task: TrackingTask, span: ErrorSpan, by_model: Mapping[str, ModelRuns], reference: str) -> dict[str, Any]:
    of_reference = by_model[reference].base if reference in by_model else None
    whole = {name: runs.base for name, runs in by_model.items()}
    return {
        "models": {name: _of_model(task, span, runs, of_reference) for name, runs in by_model.items()},
        "distances": {
            a: {b: None if x is None or y is None else _distance(x, y) for b, y in whole.items()}
            for a, x in whole.items()
        },
    }


def _of_model(task: TrackingTask, span: ErrorSpan, runs: ModelRuns, reference: Record | None) -> dict[str, Any]:
    base = runs.base
    out: dict[str, Any] = {"status": "failed" if runs.failure else "complete", "message": runs.failure}
    if base is None:
        return out
    out |= {
        "method": base.method,
        "tracking_error": _tracking_error(task, span, base),
        "tracking_error_with_finer_step": _tracking_error(task, span, runs.finished(Refinement.STEP)),
        "tracking_error_with_finer_mesh": _tracking_error(task, span, runs.finished(Refinement.MESH)),
        "change_with_finer_step": _change(runs, Refinement.STEP),
        "change_with_finer_mesh": _change(runs, Refinement.MESH),
    }
    for name in ("wall_time", "steps", "energy_balance_max", "constraint_position_max", "constraint_velocity_max"):
        value = float(base.figures[name])
        out[name] = value if np.isfinite(value) else None
    if reference is not None:
        gaps = _gaps(base.end_effector.position, reference.end_effector.position)
        out["distance_max"], out["distance_rms"] = float(gaps.max()), float(rms(gaps))
        links = [body.name for body in task.mechanism.bodies]
        for key, name in (("angle", "chord_angle"), ("angular_velocity", "chord_velocity")):
            apart = np.abs(base.links[name] - reference.links[name])
            out[f"{key}_difference_rms"] = {link: float(rms(apart[:, i])) for i, link in enumerate(links)}
            out[f"{key}_difference_max"] = {link: float(apart[:, i].max()) for i, link in enumerate(links)}
    return out


def _change(runs: ModelRuns, level: Refinement) -> float | None:
    base, finer = runs.base, runs.finished(level)
    return None if base is None or finer is None else _distance(base, finer)


def _tracking_error(task: TrackingTask, span: ErrorSpan, run: Record | None) -> float | None:
    """Compute the RMS distance from the desired path during the motion, or over all samples (Eq. 64) [m]."""
    if run is None:
        return None
    position, motion = run.end_effector.position, task.motion
    distance = _gaps(position, motion.desired.position)
    traces = Traces(motion.t, task.path.duration, position, distance, run.torque)
    return float(METRICS[HEADLINE[span]].value(traces))


def _distance(a: Record, b: Record) -> float:
    """Compute the largest distance between the end-effectors of two whole runs [m]."""
    return float(_gaps(a.end_effector.position, b.end_effector.position).max())


def _gaps(a: Array, b: Array) -> Array:
    return np.linalg.norm(a - b, axis=1)
