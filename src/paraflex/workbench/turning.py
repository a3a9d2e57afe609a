"""Full turn of a crank, or motion along a path, as plain data for the page: frames, curves, features."""

from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

import numpy as np
import xarray as xr

from paraflex.arrays import Array
from paraflex.driven import DrivenMotion, kinematics, torques
from paraflex.driven.features import transmission_angles
from paraflex.errors import AssemblyError, InputError, ParaflexError, UnreachablePathError
from paraflex.figures.kinematics import coupler_points, cycle_note, kinematics_of, kinematics_tables, kinematics_tiles
from paraflex.figures.run_motion import moving_points
from paraflex.figures.selection import names_of
from paraflex.figures.shapes import figure_of
from paraflex.files import Model
from paraflex.mechanism.masses import check_masses
from paraflex.plots.scene import is_plate
from paraflex.reports.film import animation, frames_of
from paraflex.results import motion_dataset
from paraflex.results.drawing import system_drawing
from paraflex.results.outlines import outlines

# Largest number of frames, of points whose motion is shown, and digits of positions behind the point [m].
_FRAMES, _POINTS, _DIGITS = 181, 7, 7
_RATES = {"position": "m", "velocity": "m/s", "acceleration": "m/s^2"}


def turning(model: Model, *, assembly: str | None = None, **wishes: Any) -> dict[str, Any]:
    """Return the motion that `paraflex kinematics` computes, or `paraflex torques` if all bodies have masses.

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
        Numbers in SI units and radians, None where there is none: what drives the mechanism (`drive`, `path`, `mode`,
        `freedoms`, `over`), `time`, `frames`, `film` as a report has it, `curves`, `trails`, and the features as
        `paraflex kinematics` has them (`features`, `tiles`, `tables`, `note`), `findings`, and why there are no forces
        (`loads_problem`).

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
        "drive": found["drive"],
        "path": found["path"],
        "mode": found["mode"],
        "freedoms": found["degrees_of_freedom"],
        "over": _over(data, found),
        "time": _plain(data["time"].values),
        "frames": _frames(motion),
        "film": _film(data),
        "curves": [*_points_curves(data, shown), *_bodies_curves(data), *_joint_curves(data, found),
                   *_transmission_curves(motion), *_effort_curves(data)],
        "trails": [_trail(data, found, name) for name in shown],
        "features": found,
        "tiles": [list(tile) for tile in kinematics_tiles(data)],
        "tables": [_table(table) for table in kinematics_tables(data) if table],
        "note": cycle_note(found),
        "findings": [asdict(one) for one in motion.findings],
        "loads_problem": problem,
    }  # fmt: skip


def _computed(model: Model, assembly: str | None, wishes: dict[str, Any]) -> tuple[DrivenMotion, str]:
    """Return the motion, with torques if they can be computed, and the reason if they cannot."""
    try:
        check_masses(model.mechanism)
        return torques(model, assembly=assembly, **wishes), ""
    except ParaflexError as error:
        reason = str(error)
    try:
        return kinematics(model, assembly=assembly, **wishes), reason
    except UnreachablePathError as error:
        path = wishes.get("path") or (not wishes.get("drive") and model.paths)
        field = f"path.{wishes.get('path') or model.path_name()}" if path else "drive"
        raise InputError(error.problem, field=field, remedy=error.remedy) from error
    except AssemblyError as error:
        field = f"assembly.{model.mechanism.assembly(assembly).name}"
        raise InputError(error.problem, field=field, remedy=error.remedy) from error


def _plain(values: Array) -> Any:
    """Return numbers as nested lists, None for those that are not finite."""
    values = np.asarray(values, dtype=float)
    if values.ndim > 1:
        return [_plain(row) for row in values]
    return [value if np.isfinite(value) else None for value in values.tolist()]


def _over(data: xr.Dataset, found: dict[str, Any]) -> dict[str, Any]:
    """Return the abscissa of all curves: the coordinate of the drive, or the time."""
    joint = found["over"]
    if not joint:
        return {"joint": "", "unit": "s", "values": _plain(data["time"].values)}
    values = data["joint_coordinate"].sel(joint=joint).values
    return {"joint": joint, "unit": found["joint_units"][joint], "values": _plain(values)}


def _film(data: xr.Dataset) -> dict[str, Any] | None:
    """Return the motion with the symbols of joints, as the page plays runs."""
    film = animation(data.isel(time=frames_of(data.sizes["time"], _FRAMES)).transpose("time", ...), ())
    return None if film is None else film.to_dict()


def _frames(motion: DrivenMotion) -> dict[str, Any]:
    """Return the lines of the bodies and places of the joints at some samples."""
    q, described = motion.solution.q, motion.system.described
    samples = np.unique(np.linspace(0, len(q) - 1, min(len(q), _FRAMES)).round().astype(int))
    drawn, first, bodies = system_drawing(motion.system, q[samples]), 0, []
    for one in outlines(described):
        own = figure_of(drawn.shape[:, first : first + len(one.places)].round(_DIGITS))
        # A rigid beam has two ends.
        own = own[:, [0, -1]] if not np.any(one.places[:, 1] - one.places[0, 1]) else own
        bodies.append([one.body, own.tolist(), bool(is_plate(own[0]))])
        first += len(one.places)
    angles = {body.name: q[samples, motion.system.body(body.name).angle].tolist() for body in described.bodies}
    return {
        "samples": samples.tolist(),
        "bodies": bodies,
        "joints": [[one.name, drawn.joints[:, k].round(_DIGITS).tolist()] for k, one in enumerate(described.joints)],
        "angles": angles,
    }


def _points(data: xr.Dataset) -> list[str]:
    """Return the end-effector and the coupler points, or if there are none the points that move most."""
    names, effector = names_of(data, "point"), data.attrs.get("end_effector_point")
    found = [*([effector] if effector else []), *coupler_points(data.attrs)]
    return list(dict.fromkeys(found))[:_POINTS] or [names[k] for k in moving_points(data.expand_dims("mode"), _POINTS)]


def _curve(of: str, quantity: str, part: str, unit: str, values: Array) -> dict[str, Any]:
    return {"of": of, "quantity": quantity, "part": part, "unit": unit, "values": _plain(values)}


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
    return {"of": name, "path": _plain(path), "cusps": own["cusps"], "crunodes": own["crunodes"]}


def _table(table: Any) -> dict[str, Any]:
    """Return a table as text, in the units in which `paraflex kinematics` prints it."""
    columns = [column.texts() for column in table.columns]
    heads = [list(head) for head in table.heads()]
    return {"title": table.title, "heads": heads, "rows": [list(row) for row in zip(*columns, strict=True)],
            "note": table.note}  # fmt: skip
