"""Labelled dataset of a tracking study: the runs of all modes with dimensions, units and provenance."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
import xarray as xr

from paraflex.arguments import checked_arguments
from paraflex.control.laws.joints import internal_torques
from paraflex.errors import InputError, as_enum
from paraflex.findings import Finding
from paraflex.integrators import IntegrationOptions
from paraflex.paths import Path, length_fraction
from paraflex.tracking import TrackingRun
from paraflex.validity import beyond_range, implausible_numbers
from .acting import load_variables
from .controllers import INTERNAL, with_controllers
from .findings import MODE, keep_findings, validity_variables
from .following import KEPT_METRICS, ErrorSpan, PathPart, metric_variables, too_short
from .kinds import BRAKE_ENERGY, RUN_FIGURES
from .labelled import Variables, error_variables, label, link_coordinates, padded, provenance, with_totals
from .record import Record, record


@checked_arguments()
def tracking_dataset(
    runs: Sequence[TrackingRun | Record],
    *,
    options: IntegrationOptions | None = None,
    parameters: dict[str, Any] | None = None,
    error: ErrorSpan | str = ErrorSpan.MOTION,
    findings: Iterable[Finding] = (),
) -> xr.Dataset:
    """Return one dataset of the runs of several modes of a task.

    Parameters
    ----------
    runs : sequence of TrackingRun or Record
        Runs of one task. Runs that did not finish have NaN after their last sample, which `status` reports, and
        `event` and `event_time` if an event stopped them. Finite segments are reported as the links they divide.
    options : IntegrationOptions, optional
        Integration options, stored as provenance; by default those of the first run.
    parameters : dict, optional
        Model as read and requested options, stored as provenance.
    error : ErrorSpan or str
        Tracking error that represents a run in tables and figures: during the "motion" alone, or over the "whole" run,
        dwell included (Eq. 64). The dataset holds both.
    findings : iterable of Finding
        Findings on the model from checks before the run, stored with those on its numbers and on the runs.

    Returns
    -------
    xarray.Dataset
        Dimensions mode, time, axis, body, motor, joint, row, point, station, spring, end, section, drive, load,
        sensor; for each controller NAME also sample_NAME, input_NAME and output_NAME (see `results.controllers`).
        The attributes of every variable give units and signs. `shape` and the other variables of drawings are float32.

    Raises
    ------
    InputError
        There is no run.
    """
    if not runs:
        raise InputError("no run to keep", field="runs", remedy="simulate at least one mode")
    records = [run if isinstance(run, Record) else record(run) for run in runs]
    task = records[0].task
    motion, mechanism = task.motion, task.mechanism
    frames = [_frame(one) for one in records]
    data: dict[str, tuple] = {
        name: (("mode", "time", *dims), np.stack([padded(frame[name][1], motion.t.size) for frame in frames]))
        for name, (dims, _) in frames[0].items()
    }
    errors = [error_variables(one.links) for one in records]
    if all(errors):
        data |= {
            name: (("mode", *dims), np.stack([one[name][1] for one in errors])) for name, (dims, _) in errors[0].items()
        }
    data |= load_variables(mechanism, motion.t)
    if any(one.controllers for one in records):
        internal = [padded(internal_torques(one.task, one.mode, one.torque), motion.t.size) for one in records]
        data[INTERNAL] = (("mode", "time", "motor"), np.stack(internal))
    desired = motion.desired
    angles = [motion.system.body(body.name).angle for body in mechanism.bodies]
    twins = {
        "end_effector": ("axis", desired.position),
        "end_effector_velocity": ("axis", desired.velocity),
        "end_effector_acceleration": ("axis", desired.acceleration),
        "angle": ("body", motion.q[:, angles]),
        "angular_velocity": ("body", motion.v[:, angles]),
        "angular_acceleration": ("body", motion.a[:, angles]),
    }
    for name, (dim, values) in twins.items():
        data[f"{name}_desired"] = (("mode", "time", dim), np.broadcast_to(values, (len(runs), *values.shape)).copy())
    for name in RUN_FIGURES:
        data[name] = (("mode",), np.array([one.figures[name] for one in records]))
    data[BRAKE_ENERGY] = (("mode",), np.array([one.figures.get(BRAKE_ENERGY, 0.0) for one in records]))
    for name, values in validity_variables([one.validity for one in records]).items():
        data[name] = (("mode",), values)
    coordinates = {
        "mode": [one.mode for one in records],
        "time": motion.t,
        **link_coordinates(task.system, records[0].links),
    }
    out = with_totals(xr.Dataset(data, coords=coordinates))
    out = out.assign(metric_variables(out, KEPT_METRICS, task.path.duration))
    label(out, mechanism)
    out.attrs = provenance(task.system, records[0].method, options or records[0].options, parameters) | {
        "motion_end": task.path.duration,
        "after": task.after.value,
        "path_length_run": length_fraction(task.path, float(motion.t[-1])),
        "error": as_enum(ErrorSpan, error, "error").value,
    }
    out = with_controllers(out, [one.controllers for one in records], [motor.name for motor in mechanism.motors])
    keep_findings(out, [*findings, *_findings(records)])
    return out


def _findings(records: Sequence[Record]) -> Iterator[Finding]:
    """Yield findings on the numbers of the mechanism, and on each run."""
    task = records[0].task
    yield from implausible_numbers(task.mechanism)
    part = part_of(task.path, float(task.motion.t[-1]))
    if part is not None:
        yield part.finding()
    for one in sorted(records, key=lambda one: -one.validity.ratio if one.validity else 0.0):
        yield from beyond_range(one.validity, f"{MODE}{one.mode}")
    for one in records:
        yield from one.findings


def _frame(one: Record) -> Variables:
    """Return the variables of a run: dimensions besides mode and time, and values at the samples reached."""
    return {
        "end_effector": (("axis",), one.end_effector.position),
        "end_effector_velocity": (("axis",), one.end_effector.velocity),
        "end_effector_acceleration": (("axis",), one.end_effector.acceleration),
        "torque": (("motor",), one.torque),
        "actuation_condition": ((), one.condition),
        **one.links.variables,
    }


def part_of(path: Path, end: float) -> PathPart | None:
    """Return the part of a path covered by runs that end at a time [s]; None if they reach the end of the path."""
    return PathPart(end, path.duration, length_fraction(path, end)) if too_short(end, path.duration) else None
