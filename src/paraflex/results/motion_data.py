"""The labelled dataset of a run without a path: coordinates, points, joint forces, energies."""

from __future__ import annotations

import json
from collections.abc import Iterable
from importlib.metadata import version
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from paraflex.arguments import checked_arguments
from paraflex.dynamics.points import point_motion, tip_deflection
from paraflex.findings import Finding
from paraflex.integrators import METHODS, IntegrationOptions
from paraflex.mechanism import PointRef
from paraflex.motion import MotionRun
from paraflex.results.dataset import UNITS, describe, end_effector_point
from paraflex.results.doubts import keep_findings, verdict_of
from paraflex.results.drawing import drawing_coordinates, drawing_variables, system_drawing
from paraflex.results.joint_loads import joint_loads
from paraflex.results.kinds import check_kind
from paraflex.results.outlines import chord_deflections
from paraflex.results.record import FIGURES
from paraflex.results.storage import SCHEMA
from paraflex.results.summary import finite_or_none
from paraflex.results.validity import validity_summary, validity_variables
from paraflex.validity import doubtful_numbers

_OWN_UNITS = {
    "coordinate_value": ("generalised coordinate; flexible ones are mass-normalised modes", "m, rad, m kg^(1/2)"),
    "coordinate_rate": ("rate of a generalised coordinate", "1/s of it"),
    "point_velocity": ("velocity of a named point", "m/s"),
    "applied_torque": ("constant motor torque", "N m"),
}


@checked_arguments()
def motion_dataset(
    run: MotionRun,
    *,
    options: IntegrationOptions | None = None,
    parameters: dict | None = None,
    findings: Iterable[Finding] = (),
) -> xr.Dataset:
    """A run without a path, labelled.

    Parameters
    ----------
    run : MotionRun
        One that did not finish holds NaN after its last sample and says so in `status`; of one that an event stopped
        the time ends with the event.
    options : IntegrationOptions, optional
        Kept as provenance.
    parameters : dict, optional
        Kept as provenance: the model as read, and what was asked for.
    findings : iterable of Finding
        Reasons to doubt the model, found before it ran; kept with those of its numbers and of the run.

    Returns
    -------
    xarray.Dataset
        Dimensions time, coordinate, body, point, joint, row, axis, motor, station, spring, end; units and signs in
        the attributes of every variable.
    """
    system, solution, mechanism = run.system, run.solution, run.system.mechanism
    q, v, a = solution.q, solution.v, solution.a
    points = [PointRef(body.name, point) for body in mechanism.bodies for point in body.points]
    joints = [joint.name for joint in mechanism.joints]
    motions = [point_motion(system, point, q, v, a) for point in points]
    angles = [body.angle for body in system.bodies]
    tips = np.stack([tip_deflection(system, body.name, q) for body in system.bodies], axis=1)
    torques = np.tile(np.array(list(run.torques.values())), (len(q), 1))
    loads = joint_loads(system, joints, q, solution.multipliers, torques)
    values: dict[str, tuple[tuple[str, ...], NDArray[np.float64]]] = {
        "coordinate_value": (("coordinate",), q),
        "coordinate_rate": (("coordinate",), v),
        "angle": (("body",), q[:, angles]),
        "angular_velocity": (("body",), v[:, angles]),
        "angular_acceleration": (("body",), a[:, angles]),
        "tip_axial": (("body",), tips[:, :, 0]),
        "tip_transverse": (("body",), tips[:, :, 1]),
        "tip_slope": (("body",), tips[:, :, 2]),
        "point_position": (("point", "axis"), _stacked([motion.position for motion in motions], len(q))),
        "point_velocity": (("point", "axis"), _stacked([motion.velocity for motion in motions], len(q))),
        "joint_force": (("joint", "axis"), loads.force),
        "joint_moment": (("joint",), loads.moment),
        "multiplier": (("row",), solution.multipliers),
        "kinetic_energy": ((), solution.kinetic_energy),
        "strain_energy": ((), solution.strain_energy),
        "work": ((), solution.work),
    }
    data: dict[str, Any] = {name: (("time", *dims), _full(array, run)) for name, (dims, array) in values.items()}
    drawn = system_drawing(system, q)
    data["deflection"] = (("time", "body"), _full(chord_deflections(mechanism, drawn.shape), run))
    for name, (dims, array) in drawing_variables(drawn).items():
        data[name] = (("time", *dims), _full(array, run).astype(np.float32))
    data |= {name: getattr(solution, name) for name in FIGURES}
    data |= {name: each.item() for name, each in validity_variables([run.validity]).items()}
    data["applied_torque"] = (("motor",), np.array(list(run.torques.values())))
    out = xr.Dataset(
        data,
        coords={
            "time": run.times,
            "coordinate": _coordinate_names(run),
            "body": [body.name for body in system.bodies],
            "point": [str(point) for point in points],
            "joint": joints,
            "row": list(system.rows),
            "axis": ["x", "y"],
            "motor": list(run.torques),
            **drawing_coordinates(mechanism),
        },
    )
    units = UNITS | _OWN_UNITS
    for name in out.variables:
        if name in units:
            describe(out, str(name), *units[str(name)])
    options = options or IntegrationOptions()
    out.attrs = {
        "mechanism": mechanism.name,
        "kind": "motion",
        **end_effector_point(mechanism),
        "tolerance": options.tolerance,
        "method": METHODS[solution.method].title,
        **options.told(),
        "singular_positions": json.dumps(solution.singular_positions),
        "parameters": json.dumps(parameters or {}, sort_keys=True),
        "paraflex_version": version("paraflex"),
        "schema": SCHEMA,
    }
    beyond = [] if run.validity is None or run.validity.holds else [run.validity.finding()]
    keep_findings(out, [*findings, *doubtful_numbers(mechanism), *beyond, *run.doubts])
    return out


@checked_arguments()
def motion_summary(data: xr.Dataset) -> dict[str, Any]:
    """The run's figures as plain numbers; `final` is its last sample, None for one that reached none."""
    check_kind(data, "motion")
    reached = np.flatnonzero(np.isfinite(data["angle"].values).all(axis=1))
    last = data.isel(time=reached[-1] if reached.size else 0)
    figures: dict[str, Any] = {name: data[name].item() for name in FIGURES}
    figures = {key: finite_or_none(x) if isinstance(x, float) else x for key, x in figures.items()}
    return {
        "mechanism": data.attrs["mechanism"],
        **figures,
        "verdict": verdict_of(data).to_dict(),
        "validity": validity_summary(data),
        "singular_positions": json.loads(data.attrs["singular_positions"]),
        "final": {
            "time": float(last["time"]) if reached.size else None,
            "angle": _numbers(last["angle"], "body"),
            "point_position": {
                str(point): [finite_or_none(x) for x in last["point_position"].sel(point=point).values]
                for point in data["point"].values
            },
        },
        "parameters": json.loads(data.attrs["parameters"]),
        "version": data.attrs["paraflex_version"],
    }


def _coordinate_names(run: MotionRun) -> list[str]:
    return [
        f"{body.name}.{part}"
        for body in run.system.bodies
        for part in ("x", "y", "phi", *(f"eta{k + 1}" for k in range(body.nf)))
    ]


def _stacked(parts: list[NDArray[np.float64]], samples: int) -> NDArray[np.float64]:
    return np.stack(parts, axis=1) if parts else np.zeros((samples, 0, 2))


def _full(array: NDArray[np.float64], run: MotionRun) -> NDArray[np.float64]:
    out = np.full((run.times.size, *array.shape[1:]), np.nan)
    out[: array.shape[0]] = array
    return out


def _numbers(values: xr.DataArray, dim: str) -> dict[str, float | None]:
    return {str(name): finite_or_none(values.sel({dim: name}).item()) for name in values[dim].values}
