"""The labelled dataset of a tracking study: every mode's run with dimensions, units and provenance."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from importlib.metadata import version

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from paraflex.arguments import checked_arguments
from paraflex.errors import InputError, as_enum
from paraflex.findings import Finding
from paraflex.integrators import IntegrationOptions
from paraflex.kinematics import Path, length_fraction
from paraflex.mechanism import Mechanism
from paraflex.results.doubts import MODE, keep_findings
from paraflex.results.drawing import drawing_coordinates, drawing_variables
from paraflex.results.metrics import ErrorSpan, Part, peak_torque, rms_torque, too_short, tracking_variables
from paraflex.results.outlines import chord_deflections
from paraflex.results.record import BRAKE_ENERGY, FIGURES, Record, record
from paraflex.results.storage import SCHEMA
from paraflex.results.validity import UNITS as VALIDITY_UNITS
from paraflex.results.validity import validity_variables
from paraflex.simulate import TrackingRun
from paraflex.validity import doubtful_numbers

UNITS = {
    "time": ("time", "s"),
    "end_effector": ("end-effector position", "m"),
    "end_effector_velocity": ("end-effector velocity", "m/s"),
    "end_effector_acceleration": ("end-effector acceleration", "m/s^2"),
    "torque": ("motor torque", "N m"),
    "angle": ("link angle", "rad"),
    "angular_velocity": ("link angular velocity", "rad/s"),
    "angular_acceleration": ("link angular acceleration", "rad/s^2"),
    "chord_angle": ("angle from a link's first end to its last", "rad"),
    "chord_velocity": ("rate of the angle from a link's first end to its last", "rad/s"),
    "deflection": ("largest deflection along a link from its chord", "m"),
    "tip_axial": ("axial tip displacement", "m"),
    "tip_transverse": ("transverse tip displacement", "m"),
    "tip_slope": ("tip slope", "rad"),
    "point_position": ("position of a named point", "m"),
    "joint_force": ("force of a joint's first body on its second, ground frame", "N"),
    "joint_moment": ("moment of a joint's first body on its second", "N m"),
    "multiplier": ("multiplier of a constraint row; torque or force of a spring, damper or friction", "N, N m"),
    "kinetic_energy": ("kinetic energy", "J"),
    "strain_energy": ("strain energy of links and springs", "J"),
    "work": ("work of motors, prescribed motion, weight and loads, less what dampers and friction take", "J"),
    "actuation_condition": ("condition number of the actuation matrix", "1"),
    "shape": ("drawn points of the bodies, deformed", "m"),
    "shape_base": ("drawn points of the bodies, stiff between the joints that hold them", "m"),
    "joint_position": ("position of a joint, on its second body", "m"),
    "joint_direction": ("direction of the axis of a joint that slides", "rad"),
    "spring_position": ("ends of a spring between points", "m"),
    "station_body": ("body of a drawn point", "1"),
    "station_place": ("place of a drawn point in the undeformed body, in its frame", "m"),
    "point_station": ("drawn point that a named point is", "1"),
    "joint_kind": ("kind of joint", "1"),
    "joint_grounded": ("whether the joint is on the ground", "1"),
    "spring_station": ("drawn points that a spring is at; -1 on the ground", "1"),
    "status": ("how the run ended", "1"),
    "message": ("why it is not complete", "1"),
    "steps": ("accepted steps", "1"),
    "rejected": ("rejected steps", "1"),
    "newton_iterations": ("Newton iterations", "1"),
    "factorisations": ("factorisations of the iteration matrix", "1"),
    "wall_time": ("wall time of the integration", "s"),
    "constraint_position_max": ("largest constraint violation in position", "m"),
    "constraint_velocity_max": ("largest constraint violation in velocity", "m/s"),
    "energy_balance_max": ("largest imbalance of energy and work", "J"),
    "brake_energy": ("energy that brakes took as they engaged after the motion", "J"),
    "event": ("event that stopped the run", "1"),
    "event_time": ("when it was stopped", "s"),
} | VALIDITY_UNITS

# What units do not say: on which body, in which frame, positive which way.
_COMMENTS = {
    "joint_force": (
        "at the joint's point of the second body, in the ground frame: of the constraints and of motors, springs, "
        "dampers, friction and prescribed motion along the joint; the opposite acts on the first body"
    ),
    "joint_moment": (
        "about the joint's point of the second body, positive anticlockwise: of the constraints and of motors, "
        "springs, dampers, friction and prescribed motion that turn the joint; the opposite acts on the first body"
    ),
    "multiplier": (
        "stands on the left of the equations of motion: minus it acts on the joint's second body, in the ground frame, "
        "anticlockwise, or along the joint's axis or normal; of least norm where constraints depend on one another"
    ),
    "torque": "on the joint's second body: positive turns it anticlockwise or moves it along the axis",
    "applied_torque": "as `torque` of a run along a path",
    "angle": "of the body frame's x axis against the ground's, anticlockwise",
    "tip_transverse": "across the tangent at the first end of the link, positive to its left: anticlockwise",
    "tip_slope": "anticlockwise",
}


def describe(data: xr.Dataset, name: str, label: str, unit: str) -> None:
    """Meaning, unit and conventions of a variable into its attributes."""
    data[name].attrs = {"long_name": label, "units": unit}
    if name in _COMMENTS:
        data[name].attrs["comment"] = _COMMENTS[name]


@checked_arguments()
def tracking_dataset(
    runs: Sequence[TrackingRun | Record],
    *,
    options: IntegrationOptions | None = None,
    parameters: dict | None = None,
    error: ErrorSpan | str = ErrorSpan.MOTION,
    findings: Iterable[Finding] = (),
) -> xr.Dataset:
    """One dataset of the runs of several modes of a task.

    Parameters
    ----------
    runs : sequence of TrackingRun or Record
        Of one task; runs that did not finish hold NaN after their last sample and say so in `status`, and in `event`
        and `event_time` where that stopped them. Runs of finite segments are reported as the links they were cut from.
    options : IntegrationOptions, optional
        Kept as provenance.
    parameters : dict, optional
        Kept as provenance: the model as read, and what was asked for.
    error : ErrorSpan or str
        Which tracking error stands for a run in tables and figures: that "motion" alone, or that of the "whole" run,
        dwell included (Eq. 64). Both are in the dataset.
    findings : iterable of Finding
        Reasons to doubt the model, found before it ran; kept with those of its numbers and of the runs.

    Returns
    -------
    xarray.Dataset
        Dimensions mode, time, axis, body, motor, joint, row, point, station, spring, end; units and signs in the
        attributes of every variable. `shape` and what else drawings are made from is float32.
    """
    if not runs:
        raise InputError("no run to keep", field="runs", remedy="simulate at least one mode")
    records = [run if isinstance(run, Record) else record(run) for run in runs]
    task = records[0].task
    motion, mechanism = task.motion, task.mechanism
    points = [f"{body.name}.{point}" for body in mechanism.bodies for point in body.points]
    frames = [_frame(one) for one in records]
    data: dict[str, tuple] = {
        name: (("mode", "time", *frames[0][name][0]), np.stack([frame[name][1] for frame in frames]))
        for name in frames[0]
    }
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
    for name in FIGURES:
        data[name] = (("mode",), np.array([one.figures[name] for one in records]))
    data[BRAKE_ENERGY] = (("mode",), np.array([one.figures.get(BRAKE_ENERGY, 0.0) for one in records]))
    for name, values in validity_variables([one.validity for one in records]).items():
        data[name] = (("mode",), values)
    out = xr.Dataset(
        data,
        coords={
            "mode": [one.mode for one in records],
            "time": motion.t,
            "axis": ["x", "y"],
            "body": [body.name for body in mechanism.bodies],
            "motor": [motor.name for motor in mechanism.motors],
            "joint": [joint.name for joint in mechanism.joints],
            "row": list(task.system.rows),
            "point": points,
            **drawing_coordinates(mechanism),
        },
    )
    out = out.assign(tracking_variables(out, task.path.duration))
    out["peak_torque"] = peak_torque(out)
    out["rms_torque"] = rms_torque(out)
    for name in out.variables:
        label, unit = UNITS.get(str(name).removesuffix("_desired"), (None, None))
        if label is not None and unit is not None:
            twin = "desired " if str(name).endswith("_desired") else ""
            describe(out, str(name), twin + label, unit)
    units = ", ".join(sorted(set(mechanism.motor_units()), reverse=True)) or "N m"
    for name in ("torque", "peak_torque", "rms_torque"):
        out[name].attrs["units"] = units
        if units == "N":
            out[name].attrs["long_name"] = out[name].attrs["long_name"].replace("torque", "force")
    out.attrs = _provenance(records[0], options or IntegrationOptions(), parameters or {})
    out.attrs["error"] = as_enum(ErrorSpan, error, "error").value
    keep_findings(out, [*findings, *_findings(records)])
    return out


def _findings(records: Sequence[Record]) -> Iterator[Finding]:
    """What is doubtful about the numbers of the mechanism, and about each run."""
    task = records[0].task
    yield from doubtful_numbers(task.mechanism)
    part = part_of(task.path, float(task.motion.t[-1]))
    if part is not None:
        yield part.finding()
    beyond = [(one.validity, one.mode) for one in records if one.validity is not None and not one.validity.holds]
    for validity, mode in sorted(beyond, key=lambda pair: -pair[0].ratio):
        yield validity.finding(f"{MODE}{mode}")
    for one in records:
        yield from one.doubts


def _frame(one: Record) -> dict[str, tuple[tuple[str, ...], NDArray[np.floating]]]:
    """A run's variables over all sample times: extra dimensions and values, NaN where it did not get to."""
    total = one.task.motion.t.size

    def full(values: NDArray[np.float64]) -> NDArray[np.float64]:
        out = np.full((total, *values.shape[1:]), np.nan)
        out[: values.shape[0]] = values
        return out

    return {
        "end_effector": (("axis",), full(one.end_effector.position)),
        "end_effector_velocity": (("axis",), full(one.end_effector.velocity)),
        "end_effector_acceleration": (("axis",), full(one.end_effector.acceleration)),
        "torque": (("motor",), full(one.torque)),
        "angle": (("body",), full(one.angle)),
        "angular_velocity": (("body",), full(one.rate)),
        "angular_acceleration": (("body",), full(one.acceleration)),
        "chord_angle": (("body",), full(one.chord)),
        "chord_velocity": (("body",), full(one.chord_rate)),
        "tip_axial": (("body",), full(one.tip[:, :, 0])),
        "tip_transverse": (("body",), full(one.tip[:, :, 1])),
        "tip_slope": (("body",), full(one.tip[:, :, 2])),
        "deflection": (("body",), full(chord_deflections(one.task.mechanism, one.drawing.shape))),
        "point_position": (("point", "axis"), full(one.points)),
        "joint_force": (("joint", "axis"), full(one.joint_force)),
        "joint_moment": (("joint",), full(one.joint_moment)),
        "multiplier": (("row",), full(one.multiplier)),
        "kinetic_energy": ((), full(one.kinetic_energy)),
        "strain_energy": ((), full(one.strain_energy)),
        "work": ((), full(one.work)),
        "actuation_condition": ((), one.condition),
        **{name: (dims, full(x).astype(np.float32)) for name, (dims, x) in drawing_variables(one.drawing).items()},
    }


def end_effector_point(mechanism: Mechanism) -> dict[str, str]:
    """Which point is followed, for drawings."""
    return {} if mechanism.end_effector is None else {"end_effector_point": str(mechanism.end_effector.point)}


def part_of(path: Path, end: float) -> Part | None:
    """What runs that end then [s] do of a path that they are too short for; None where they are not."""
    return Part(end, path.duration, length_fraction(path, end)) if too_short(end, path.duration) else None


def _provenance(one: Record, options: IntegrationOptions, parameters: dict) -> dict:
    # Other models and engines integrate in ways of their own.
    ours = options.told() if one.method == options.description.title else {}
    return {
        "mechanism": one.task.mechanism.name,
        **end_effector_point(one.task.mechanism),
        "motion_end": one.task.path.duration,
        "after": one.task.after.value,
        "path_length_run": length_fraction(one.task.path, float(one.task.motion.t[-1])),
        "tolerance": options.tolerance,
        "baumgarte_alpha": options.alpha,
        "baumgarte_beta": options.beta,
        "method": one.method,
        **ours,
        "parameters": json.dumps(parameters, sort_keys=True),
        "paraflex_version": version("paraflex"),
        "numba_version": version("numba"),
        "numpy_version": version("numpy"),
        "schema": SCHEMA,
    }
