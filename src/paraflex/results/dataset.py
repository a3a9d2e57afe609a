"""The labelled dataset of a tracking study: every mode's run with dimensions, units and provenance."""

from __future__ import annotations

import json
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from paraflex.errors import InputError, OutputError
from paraflex.integrators import IntegrationOptions
from paraflex.mechanism import PointRef
from paraflex.results.metrics import peak_torque, residual_vibration, rms_torque, tracking_error
from paraflex.results.motion import point_motion, tip_deflection
from paraflex.simulate import TrackingRun

SCHEMA = 1
_UNITS = {
    "time": ("time", "s"),
    "end_effector": ("end-effector position", "m"),
    "end_effector_velocity": ("end-effector velocity", "m/s"),
    "end_effector_acceleration": ("end-effector acceleration", "m/s^2"),
    "torque": ("motor torque", "N m"),
    "angle": ("link angle", "rad"),
    "angular_velocity": ("link angular velocity", "rad/s"),
    "angular_acceleration": ("link angular acceleration", "rad/s^2"),
    "tip_axial": ("axial tip displacement", "m"),
    "tip_transverse": ("transverse tip displacement", "m"),
    "tip_slope": ("tip slope", "rad"),
    "point_position": ("position of a named point", "m"),
    "joint_force": ("force of the joint on its second body, ground frame", "N"),
    "kinetic_energy": ("kinetic energy", "J"),
    "strain_energy": ("strain energy", "J"),
    "work": ("work of motors and prescribed motion", "J"),
    "actuation_condition": ("condition number of the actuation matrix", "1"),
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
}
_FIGURES = (
    "status",
    "message",
    "steps",
    "rejected",
    "newton_iterations",
    "factorisations",
    "wall_time",
    "constraint_position_max",
    "constraint_velocity_max",
    "energy_balance_max",
)


def tracking_dataset(
    runs: Sequence[TrackingRun], *, options: IntegrationOptions | None = None, parameters: dict | None = None
) -> xr.Dataset:
    """One dataset of the runs of several modes of a task.

    Parameters
    ----------
    runs : sequence of TrackingRun
        Of one task; runs that did not finish hold NaN after their last sample and say so in `status`.
    options : IntegrationOptions, optional
        Kept as provenance.
    parameters : dict, optional
        Kept as provenance: the model as read, and what was asked for.

    Returns
    -------
    xarray.Dataset
        Dimensions mode, time, axis, body, motor, joint, point; units in the attributes of every variable.
    """
    if not runs:
        raise InputError("no run to keep", field="runs", remedy="simulate at least one mode")
    task = runs[0].task
    system, motion = task.system, task.motion
    points = [PointRef(body.name, point) for body in task.mechanism.bodies for point in body.points]
    frames = [_frame(run, points) for run in runs]
    data: dict[str, tuple] = {
        name: (("mode", "time", *frames[0][name][0]), np.stack([frame[name][1] for frame in frames]))
        for name in frames[0]
    }
    desired = motion.desired
    rigid_angles = [motion.system.body(task.carriers[body.name]).angle for body in system.bodies]
    twins = {
        "end_effector": ("axis", desired.position),
        "end_effector_velocity": ("axis", desired.velocity),
        "end_effector_acceleration": ("axis", desired.acceleration),
        "angle": ("body", motion.q[:, rigid_angles]),
        "angular_velocity": ("body", motion.v[:, rigid_angles]),
        "angular_acceleration": ("body", motion.a[:, rigid_angles]),
    }
    for name, (dim, values) in twins.items():
        data[f"{name}_desired"] = (("mode", "time", dim), np.broadcast_to(values, (len(runs), *values.shape)).copy())
    for name in _FIGURES:
        data[name] = (("mode",), np.array([getattr(run.solution, name) for run in runs]))
    out = xr.Dataset(
        data,
        coords={
            "mode": [run.mode.name for run in runs],
            "time": motion.t,
            "axis": ["x", "y"],
            "body": [body.name for body in system.bodies],
            "motor": [motor.name for motor in task.mechanism.motors],
            "joint": [joint.name for joint in task.mechanism.joints],
            "point": [str(point) for point in points],
        },
    )
    out["tracking_rms"] = tracking_error(out)
    out["peak_torque"] = peak_torque(out)
    out["rms_torque"] = rms_torque(out)
    out["residual_vibration"] = residual_vibration(out, task.path.duration)
    for name in out.variables:
        label, unit = _UNITS.get(str(name).removesuffix("_desired"), (None, None))
        if label is not None:
            twin = "desired " if str(name).endswith("_desired") else ""
            out[name].attrs = {"long_name": twin + label, "units": unit}
    out.attrs = _provenance(task.mechanism.name, task.path.duration, options or IntegrationOptions(), parameters or {})
    return out


def _frame(run: TrackingRun, points: list[PointRef]) -> dict[str, tuple[tuple[str, ...], NDArray[np.float64]]]:
    """A run's variables over all sample times: extra dimensions and values, NaN where it did not get to."""
    task, solution = run.task, run.solution
    system = task.system
    total = task.motion.t.size

    def full(values: NDArray[np.float64]) -> NDArray[np.float64]:
        out = np.full((total, *values.shape[1:]), np.nan)
        out[: values.shape[0]] = values
        return out

    q, v, a = solution.q, solution.v, solution.a
    effector = task.mechanism.end_effector
    assert effector is not None
    tip = point_motion(system, effector.point, q, v, a)
    angles = [body.angle for body in system.bodies]
    tips = np.stack([tip_deflection(system, body.name, q) for body in system.bodies], axis=1)
    places = np.stack([point_motion(system, point, q, v, a).position for point in points], axis=1)
    rows = np.array(
        [[system.rows.index(f"{joint.name} {axis}") for axis in ("x", "y")] for joint in task.mechanism.joints]
    )
    return {
        "end_effector": (("axis",), full(tip.position)),
        "end_effector_velocity": (("axis",), full(tip.velocity)),
        "end_effector_acceleration": (("axis",), full(tip.acceleration)),
        "torque": (("motor",), run.torques.evaluate(task.motion.t)),
        "angle": (("body",), full(q[:, angles])),
        "angular_velocity": (("body",), full(v[:, angles])),
        "angular_acceleration": (("body",), full(a[:, angles])),
        "tip_axial": (("body",), full(tips[:, :, 0])),
        "tip_transverse": (("body",), full(tips[:, :, 1])),
        "tip_slope": (("body",), full(tips[:, :, 2])),
        "point_position": (("point", "axis"), full(places)),
        # Phi = p_b - p_a, and Phi_q^T lambda stands on the left of the equations: -lambda acts on b.
        "joint_force": (("joint", "axis"), full(-solution.multipliers[:, rows])),
        "kinetic_energy": ((), full(solution.kinetic_energy)),
        "strain_energy": ((), full(solution.strain_energy)),
        "work": ((), full(solution.work)),
        "actuation_condition": ((), run.condition),
    }


def _provenance(name: str, motion_end: float, options: IntegrationOptions, parameters: dict) -> dict:
    return {
        "mechanism": name,
        "motion_end": motion_end,
        "tolerance": options.tolerance,
        "baumgarte_alpha": options.alpha,
        "baumgarte_beta": options.beta,
        "method": "TR-BDF2",
        "parameters": json.dumps(parameters, sort_keys=True),
        "paraflex_version": version("paraflex"),
        "numba_version": version("numba"),
        "numpy_version": version("numpy"),
        "schema": SCHEMA,
    }


def save_results(data: xr.Dataset, path: str | Path) -> None:
    """Write a dataset as netCDF; the file appears whole or not at all.

    Raises
    ------
    OutputError
        The folder cannot be written.
    """
    path = Path(path)
    unfinished = path.with_name(path.name + ".part")
    try:
        data.to_netcdf(unfinished, engine="netcdf4")
        unfinished.replace(path)
    except OSError as error:
        unfinished.unlink(missing_ok=True)
        raise OutputError(
            f"cannot be written ({error.strerror or error})", field=str(path), remedy="choose another folder"
        ) from error


def load_results(path: str | Path) -> xr.Dataset:
    """Read a dataset that `save_results` wrote.

    Raises
    ------
    InputError
        No such file, not a netCDF file, or not one of ours.
    """
    try:
        data = xr.load_dataset(path, engine="netcdf4")
    except (OSError, ValueError) as error:
        raise InputError(
            "not a readable results file", field=str(path), remedy="name a results.nc that paraflex wrote"
        ) from error
    if data.attrs.get("schema") != SCHEMA:
        raise InputError(
            "not a results file of this version", field=str(path), remedy="run the study again with this version"
        )
    return data
