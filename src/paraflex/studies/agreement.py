"""What runs of several models say of each other, as plain numbers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paraflex.arguments import checked_arguments
from paraflex.errors import as_enum
from paraflex.findings import Finding, Verdict
from paraflex.results.dataset import part_of
from paraflex.results.following import HEADLINE, ErrorSpan, Part
from paraflex.results.formulas import rms
from paraflex.results.metrics import METRICS
from paraflex.results.record import Record
from paraflex.results.traces import Traces
from paraflex.simulate import TrackingTask
from paraflex.studies.verification import ModelRuns, Refinement, Verification, reference_model
from paraflex.validity import doubtful_numbers


@checked_arguments()
def agreement(verification: Verification, error: ErrorSpan | str = ErrorSpan.MOTION) -> dict[str, Any]:
    """The agreement of all models as plain numbers: what `verify.json` holds. None for what a run did not reach.

    Parameters
    ----------
    verification : Verification
    error : ErrorSpan or str
        What tracking errors are of: the "motion", or the "whole" run, dwell included. Distances between models are of
        the whole run.
    """
    task, span = verification.task, as_enum(ErrorSpan, error, "error")
    reference = reference_model(verification.models)
    part = part_of(task.path, float(task.motion.t[-1]))
    return {
        "mechanism": task.mechanism.name,
        "duration": float(task.motion.t[-1]),
        "samples": int(task.motion.t.size),
        "verdict": Verdict(_findings(task, part)).to_dict(),
        "part": None if part is None else part.figures(),
        "reference": reference,
        "error": span.value,
        "links": [body.name for body in task.mechanism.bodies],
        "complete": verification.complete,
        "interrupted": verification.interrupted,
        "modes": {mode: _of_mode(task, span, by_model, reference) for mode, by_model in verification.runs.items()},
    }


def _findings(task: TrackingTask, part: Part | None) -> list[Finding]:
    return [*doubtful_numbers(task.mechanism), *([] if part is None else [part.finding()])]


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
        for key, one, other in (
            ("angle", base.chord, reference.chord),
            ("angular_velocity", base.chord_rate, reference.chord_rate),
        ):
            apart = np.abs(one - other)
            out[f"{key}_difference_rms"] = {link: float(rms(apart[:, i])) for i, link in enumerate(links)}
            out[f"{key}_difference_max"] = {link: float(apart[:, i].max()) for i, link in enumerate(links)}
    return out


def _change(runs: ModelRuns, level: Refinement) -> float | None:
    base, finer = runs.base, runs.finished(level)
    return None if base is None or finer is None else _distance(base, finer)


def _tracking_error(task: TrackingTask, span: ErrorSpan, run: Record | None) -> float | None:
    """Root mean square distance from the desired path during the motion, or over all samples (Eq. 64) [m]."""
    if run is None:
        return None
    position, motion = run.end_effector.position, task.motion
    distance = _gaps(position, motion.desired.position)
    traces = Traces(motion.t, task.path.duration, position, distance, run.torque)
    return float(METRICS[HEADLINE[span]].value(traces))


def _distance(a: Record, b: Record) -> float:
    """Largest distance between the end-effectors of two whole runs [m]."""
    return float(_gaps(a.end_effector.position, b.end_effector.position).max())


def _gaps(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.linalg.norm(a - b, axis=1)
