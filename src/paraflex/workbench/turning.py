"""Full turn of a crank, or motion along a path, as plain data for the page: frames, curves, features."""

from collections.abc import Iterator
from dataclasses import asdict, replace
from typing import Any

import numpy as np
import xarray as xr

from paraflex.arrays import Array
from paraflex.driven import DrivenMotion, kinematics, torques
from paraflex.driven.features import transmission_angles
from paraflex.driven.ranges import freedoms_at
from paraflex.dynamics import build_system
from paraflex.dynamics.joint_coordinates import joint_value
from paraflex.errors import AssemblyError, InputError, ParaflexError, UnreachablePathError
from paraflex.figures.kinematics import coupler_points, cycle_note, kinematics_of, kinematics_tables, kinematics_tiles
from paraflex.figures.run_motion import moving_points
from paraflex.figures.selection import names_of
from paraflex.files import Model
from paraflex.mechanism import standing
from paraflex.mechanism.masses import check_masses, with_any_masses
from paraflex.reports.film import animation, frames_of
from paraflex.results import motion_dataset
from .messages import finite

# Largest number of frames, and of points whose motion is shown.
_FRAMES, _POINTS = 181, 7
_RATES = {"position": "m", "velocity": "m/s", "acceleration": "m/s^2"}


def turning(model: Model, *, assembly: str | None = None, **wishes: Any) -> dict[str, Any]:
    """Return the motion that `paraflex kinematics` computes, or `paraflex torques` if all bodies have masses.

    By default the joint of the only prescribed motion or motor makes a full turn, or moves over its whole range, if it
    drives the only degree of freedom. A drive that leaves degrees of freedom open has the other joints of prescribed
    motions and motors held as they are in the assembly.

    Parameters
    ----------
    model : Model
        Model as read from its file.
    assembly : str, optional
        Assembly; by default that of the study, or the first.
    **wishes
        Arguments of `driven.kinematics`: drive, held, path, start, end, speed, duration, samples.

    Returns
    -------
    dict
        Numbers in SI units and radians, None where there is none: the abscissa of all curves (`over`), `time`, `film`
        as a report has it, `curves`, `trails`, the features as `paraflex kinematics` prints them (`tiles`, `tables`,
        `note`), `findings`, and why there are no forces (`loads_problem`).

    Raises
    ------
    InputError
        Errors of `paraflex kinematics`: no joint drives the mechanism, it has no motion, the loops do not close.
    """
    motion, problem = _computed(model, assembly or model.study.assembly, wishes)
    data = motion_dataset(motion)
    found = kinematics_of(data)
    shown = _points(data)
    return {
        "over": _over(data, found),
        "time": finite(data["time"].values),
        "film": _film(data),
        "curves": [*_points_curves(data, shown), *_bodies_curves(data), *_joint_curves(data, found),
                   *_transmission_curves(motion), *_effort_curves(data)],
        "trails": [_trail(data, found, name) for name in shown],
        "tiles": [list(tile) for tile in kinematics_tiles(data)],
        "tables": [_table(table) for table in kinematics_tables(data) if table],
        "note": cycle_note(found),
        "findings": [asdict(one) for one in motion.findings],
        "loads_problem": problem,
    }  # fmt: skip


def _computed(model: Model, assembly: str | None, wishes: dict[str, Any]) -> tuple[DrivenMotion, str]:
    """Return the motion, with torques if they can be computed, and the reason if they cannot."""
    try:
        wishes = _wished(model, assembly, wishes)
        try:
            check_masses(model.mechanism)
            return torques(model, assembly=assembly, **wishes), ""
        except ParaflexError as error:
            return kinematics(model, assembly=assembly, **wishes), str(error)
    except UnreachablePathError as error:
        path = wishes.get("path") or (not wishes.get("drive") and model.paths)
        field = f"path.{wishes.get('path') or model.path_name()}" if path else "drive"
        raise InputError(error.problem, field=field, remedy=error.remedy) from error
    except AssemblyError as error:
        field = f"assembly.{model.mechanism.assembly(assembly).name}"
        raise InputError(error.problem, field=field, remedy=error.remedy) from error


def _wished(model: Model, assembly: str | None, wishes: dict[str, Any]) -> dict[str, Any]:
    """Return the arguments of `driven.kinematics` with the drive that is turned, and the joints that are held."""
    if any(wishes.get(name) is not None for name in ("path", "held", "duration")):
        return wishes
    mechanism = replace(with_any_masses(model.mechanism).rigid(), prescribed=())
    freedoms, pose = freedoms_at(mechanism, standing(mechanism, assembly).assembly(assembly))
    joints = dict.fromkeys(one.joint for one in model.mechanism.prescribed or model.mechanism.motors)
    drive = wishes.get("drive")
    if drive is None:
        return {**wishes, "drive": next(iter(joints))} if len(joints) == freedoms == 1 else wishes
    others = [one.joint for one in (*model.mechanism.prescribed, *model.mechanism.motors) if one.joint != drive]
    held = dict.fromkeys(others)
    if len(held) != freedoms - 1 or not held:
        return wishes
    system = build_system(mechanism)
    return {**wishes, "held": {name: joint_value(system, name, pose) for name in held}}


def _over(data: xr.Dataset, found: dict[str, Any]) -> dict[str, Any]:
    """Return the abscissa of all curves: the coordinate of the drive, or the time."""
    joint = found["over"]
    if not joint:
        return {"joint": "", "unit": "s", "values": finite(data["time"].values)}
    values = data["joint_coordinate"].sel(joint=joint).values
    return {"joint": joint, "unit": found["joint_units"][joint], "values": finite(values)}


def _film(data: xr.Dataset) -> dict[str, Any] | None:
    """Return the motion with the symbols of joints, as the page plays runs."""
    film = animation(data.isel(time=frames_of(data.sizes["time"], _FRAMES)).transpose("time", ...), ())
    return None if film is None else film.to_dict()


def _points(data: xr.Dataset) -> list[str]:
    """Return the end-effector and the coupler points, or if there are none the points that move most."""
    names, effector = names_of(data, "point"), data.attrs.get("end_effector_point")
    found = [*([effector] if effector else []), *coupler_points(data.attrs)]
    return list(dict.fromkeys(found))[:_POINTS] or [names[k] for k in moving_points(data.expand_dims("mode"), _POINTS)]


def _curve(of: str, quantity: str, part: str, unit: str, values: Array) -> dict[str, Any]:
    return {"of": of, "quantity": quantity, "part": part, "unit": unit, "values": finite(values)}


def _points_curves(data: xr.Dataset, points: list[str]) -> Iterator[dict[str, Any]]:
    for name in points:
        for quantity, unit in _RATES.items():
            values = data[f"point_{quantity}"].sel(point=name).transpose("time", "axis").values
            for part, each in zip("xy", values.T, strict=True):
                yield _curve(name, quantity, part, unit, each)
            if quantity != "position":
                yield _curve(name, quantity, "size", unit, np.linalg.norm(values, axis=1))


def _bodies_curves(data: xr.Dataset) -> Iterator[dict[str, Any]]:
    kinds = {"angle": "rad", "angular_velocity": "rad/s", "angular_acceleration": "rad/s^2"}
    for body in names_of(data, "body"):
        for quantity, unit in kinds.items():
            yield _curve(body, quantity.replace("_", " "), "", unit, data[quantity].sel(body=body).values)


def _joint_curves(data: xr.Dataset, found: dict[str, Any]) -> Iterator[dict[str, Any]]:
    for joint in names_of(data, "joint"):
        unit, values = found["joint_units"][joint], data["joint_coordinate"].sel(joint=joint).values
        if np.any(np.isfinite(values)):
            yield _curve(joint, "joint", "", unit, values)
            yield _curve(joint, "joint speed", "", f"{unit}/s", data["joint_speed"].sel(joint=joint).values)


def _transmission_curves(motion: DrivenMotion) -> Iterator[dict[str, Any]]:
    for joint, coupler, values in transmission_angles(motion.exact, motion.solution.q):
        yield _curve(joint, "transmission angle", coupler, "rad", values)


def _effort_curves(data: xr.Dataset) -> Iterator[dict[str, Any]]:
    """Yield torques and forces of drives and motors, if bodies have masses."""
    for name, dim in (("drive_torque", "drive"), ("applied_torque", "motor")):
        for one in names_of(data, dim) if name in data else ():
            values = data[name].sel({dim: one}).values
            if np.any(np.nan_to_num(values)):
                unit = str(data[name].attrs.get("units", "N m"))
                yield _curve(str(one), "torque" if unit == "N m" else "force", dim, unit, values)


def _trail(data: xr.Dataset, found: dict[str, Any], name: str) -> dict[str, Any]:
    """Return the path of a point, with cusps and crunodes."""
    own = found["trails"].get(name, {"cusps": [], "crunodes": []})
    path = data["point_position"].sel(point=name).transpose("time", "axis").values
    return {"of": name, "path": finite(path), "cusps": own["cusps"], "crunodes": own["crunodes"]}


def _table(table: Any) -> dict[str, Any]:
    """Return a table as text, in the units in which `paraflex kinematics` prints it."""
    columns = [column.texts() for column in table.columns]
    heads = [list(head) for head in table.heads()]
    return {"title": table.title, "heads": heads, "rows": [list(row) for row in zip(*columns, strict=True)],
            "note": table.note}  # fmt: skip
