"""Labelled dataset of static equilibria: steps with coordinates, forces, stiffness, buckling, deformed shapes."""

import json
from collections.abc import Iterable
from typing import Any

import numpy as np
import xarray as xr

from paraflex.arguments import checked_arguments
from paraflex.equilibria import Statics
from paraflex.findings import Finding
from paraflex.validity import beyond_range, implausible_numbers
from .drawing import system_drawing
from .findings import keep_findings, validity_summary, validity_variables, verdict_of
from .kinds import check_kind
from .labelled import label, link_coordinates, with_totals
from .links import system_links
from .metrics import kept_metrics
from .numbers import by_label, finite_or_none, name_units, single, stacked
from .run_traces import StaticsTraces
from .statics_steps import NAMED_UNITS
from .storage import origin

# Number of frequencies kept for each step.
_FREQUENCIES = 8
# Fraction of a buckling shape by which coordinates are displaced for the difference quotient of drawn points.
_SMALL = 1e-4
# Variables of moving mechanisms, which are dropped.
_OF_MOTION = (
    "angular_velocity", "angular_acceleration", "chord_velocity", "point_velocity", "point_acceleration", "motor_speed",
    "joint_speed", "drive_speed", "kinetic_energy", "work", "drive_power", "drive_energy", "input_power",
)  # fmt: skip
UNITS = {
    "step": ("number of an equilibrium along its branch, from the start", "1"),
    "fraction": ("load factor: fraction of the given loads and travels", "1"),
    "limit_point": ("whether the branch turns back here", "1"),
    "stable": ("whether no small motion grows, held and moved coordinates fixed", "1"),
    "place": ("value of a named coordinate", ""),
    "travel": ("change of a named coordinate since the start", ""),
    "effort": ("force or torque at a named coordinate: given, or what holds or moves it", ""),
    "role": ("role of a named coordinate: loaded, held, moved or free", "1"),
    "stiffness": ("force for a unit displacement of a named coordinate", ""),
    "compliance": ("displacement by a unit force at a named coordinate", ""),
    "natural_frequency": ("undamped natural frequency about the equilibrium, held", "Hz"),
    "free_frequency": ("undamped natural frequency about the equilibrium, free", "Hz"),
    "buckling_factor": ("load factor at which the mechanism buckles", "1"),
    "buckling_note": ("why a step has no factor of buckling; empty where it has one, or nothing buckles", "1"),
    "buckling_shape": ("displacement of drawn points as it buckles, the largest is 1", "1"),
    "stress_step": ("step at which a beam's stress is largest", "1"),
}
_COMMENTS = {
    "effort": "on the mechanism along the coordinate: of a joint on its second body",
    "stiffness": "others are held and moved as they are, the coordinate itself set free; infinite where it cannot move",
    "natural_frequency": "zero for a motion that grows; held and moved coordinates are fixed",
    "free_frequency": "zero for a motion that grows; moved coordinates are released, under the force that moved them",
    "buckling_factor": "value at the limit point to which stable steps lead, else a linear estimate from the stiffness "
    "and its change along the branch; NaN where none is, see buckling_note",
}


@checked_arguments()
def statics_dataset(
    found: Statics, *, parameters: dict[str, Any] | None = None, findings: Iterable[Finding] = ()
) -> xr.Dataset:
    """Return the labelled dataset of static equilibria.

    Parameters
    ----------
    found : Statics
        Branch of equilibria.
    parameters : dict, optional
        Model as read and requested options, stored as provenance.
    findings : iterable of Finding
        Findings on the model, stored with those on its numbers and on the equilibria.

    Returns
    -------
    xarray.Dataset
        Dimensions step, named (coordinates by name), frequency_number, buckling_number, and those of a run: body,
        point, joint, row, axis, station, section and others. The attributes of every variable give units and signs;
        `unit` and `effort_unit` give the units of each named coordinate.
    """
    system, mechanism = found.system, found.system.described
    # The extended system has the rows that hold, move or load joints, so that joint loads include their efforts.
    torques = np.zeros((len(found.equilibria), len(mechanism.motors)))
    links = system_links(found.equations.extended, found.solution, torques, len(torques))
    data: dict[str, Any] = {name: (("time", *dims), each) for name, (dims, each) in links.variables.items()}
    data |= {name: each.item() for name, each in validity_variables([found.validity]).items()}
    data |= {"status": found.status, "message": found.message}
    steps = np.arange(len(found.equilibria))
    out = with_totals(xr.Dataset(data, coords={"time": steps, **link_coordinates(system, links)}))
    label(out, mechanism)
    out = out.drop_vars([name for name in _OF_MOTION if name in out]).rename(time="step")
    out = out.rename(stress_time="stress_step") if "stress_time" in out else out
    out = out.assign(_of_steps(found)).assign_coords(_names(found))
    for name in map(str, out.variables):
        if name in UNITS:
            meaning, unit = UNITS[name]
            out[name].attrs = {"long_name": meaning, "units": unit}
        if name in NAMED_UNITS:
            each = [NAMED_UNITS[name][one.unit == "rad"] for one in found.coordinates]
            name_units(out[name], [unit for unit in NAMED_UNITS[name] if unit in each] or NAMED_UNITS[name], each)
        if name in _COMMENTS:
            out[name].attrs["comment"] = _COMMENTS[name]
    out.attrs = {"kind": "statics", "mechanism": mechanism.name, **origin(parameters)}
    keep_findings(out, [*findings, *implausible_numbers(mechanism), *beyond_range(found.validity), *found.findings])
    return out


def _of_steps(found: Statics) -> dict[str, Any]:
    """Return the variables that only equilibria have."""
    traces, along = StaticsTraces(found), (("step", "named"),)
    stiffness, compliance = np.full((2, *traces.travel.shape), np.nan)
    measured = [found.coordinates.index(one) for one in found.directions]
    stiffness[:, measured], compliance[:, measured] = traces.stiffness, traces.compliance
    return {
        "fraction": ("step", found.fraction),
        "limit_point": ("step", found.limit),
        "stable": ("step", found.stable),
        "place": (*along, stacked([found.place(one.name) for one in found.coordinates], len(found.equilibria))),
        "travel": (*along, traces.travel),
        "effort": (*along, traces.effort),
        "stiffness": (*along, stiffness),
        "compliance": (*along, compliance),
        "natural_frequency": (("step", "frequency_number"), _hertz(found.frequencies, found)),
        "free_frequency": (("step", "frequency_number"), _hertz(found.free_frequencies, found)),
        "buckling_factor": (("step", "buckling_number"), found.buckling),
        "buckling_note": ("step", [one.buckling.reason for one in found.equilibria]),
        **_buckling_shapes(found),
        **_given_travel(found),
        **_motors(found),
    }


def _hertz(frequencies: np.ndarray, found: Statics) -> np.ndarray:
    """Return the lowest frequencies (k, f) [Hz]; f is the number with moved coordinates released, at most 8."""
    out = np.full((len(frequencies), min(found.free_frequencies.shape[1], _FREQUENCIES)), np.nan)
    out[:, : frequencies.shape[1]] = frequencies[:, : out.shape[1]] / (2.0 * np.pi)
    return out


def _given_travel(found: Statics) -> dict[str, Any]:
    """Return the travel of the first coordinate that is moved or loaded, the abscissa of figures."""
    given = found.equations.conditions
    for one in (*given.moved, *given.loads):
        attrs = {"long_name": f"travel of {one.name}", "units": one.unit, "coordinate": one.name}
        return {"given_travel": ("step", found.travel(one.name), attrs)}
    return {}


def _buckling_shapes(found: Statics) -> dict[str, Any]:
    """Return the buckling shapes as displacements of drawn points, the largest of which is one; empty without any."""
    shapes = np.array([one.buckling.shapes.T for one in found.equilibria])
    steps, count, n = shapes.shape
    moved = np.repeat(found.q, count, axis=0) + _SMALL * shapes.reshape(-1, n)
    known = np.isfinite(moved).all(axis=1)
    if not known.any() or not found.equations.conditions.loads:
        return {}
    drawn = system_drawing(found.system, found.q).shape
    out = np.full((steps * count, *drawn.shape[1:]), np.nan)
    out[known] = system_drawing(found.system, moved[known]).shape - np.repeat(drawn, count, axis=0)[known]
    out[known] /= np.linalg.norm(out[known], axis=2).max(axis=1)[:, None, None]
    values = single(out.reshape(steps, count, *drawn.shape[1:]))
    return {"buckling_shape": (("step", "buckling_number", "station", "axis"), values)}


def _motors(found: Statics) -> dict[str, Any]:
    """Return the torques of motors at held, moved and loaded joints; motors at one joint have equal torques."""
    mechanism, names = found.system.mechanism, {one.name for one in found.coordinates}
    if not mechanism.motors:
        return {}
    at = [motor.joint for motor in mechanism.motors]
    torque = np.zeros((len(found.equilibria), len(at)))
    for k, joint in enumerate(at):
        if joint in names:
            torque[:, k] = found.known_effort(joint) / at.count(joint)
    units = list(dict.fromkeys(mechanism.motor_units()))
    return {"torque": (("step", "motor"), torque, {"long_name": "motor torque or force", "units": ", ".join(units)})}


def _names(found: Statics) -> dict[str, Any]:
    given, coordinates = found.equations.conditions, found.coordinates
    roles = {one: role for role, ones in (("held", given.held), ("loaded", given.loads), ("moved", given.moved))
             for one in ones}  # fmt: skip
    return {
        "named": [one.name for one in coordinates],
        "role": ("named", [roles.get(one, "free") for one in coordinates]),
        "unit": ("named", [one.unit for one in coordinates]),
        "effort_unit": ("named", [one.effort_unit for one in coordinates]),
        "frequency_number": np.arange(1, min(found.free_frequencies.shape[1], _FREQUENCIES) + 1),
        "buckling_number": np.arange(1, found.buckling.shape[1] + 1),
    }


@checked_arguments()
def statics_summary(data: xr.Dataset) -> dict[str, Any]:
    """Return equilibria as plain numbers for JSON: named coordinates at the last step, stability, buckling, stresses.

    Raises
    ------
    InputError
        The dataset is of another kind.
    """
    check_kind(data, "statics")
    last = data.isel(step=-1)
    factors = data["buckling_factor"].values.ravel()
    return {
        "mechanism": data.attrs["mechanism"],
        "status": str(data["status"].item()),
        "message": str(data["message"].item()),
        "steps": int(data.sizes["step"]) - 1,
        "stable": bool(data["stable"].values[~data["limit_point"].values].all()),
        "limit_points": [float(x) for x in data["fraction"].values[data["limit_point"].values]],
        "buckling_factor": finite_or_none(float(factors[0])) if factors.size else None,
        "last": {
            str(name): {
                "unit": str(last["unit"].sel(named=name).item()),
                **{key: finite_or_none(float(last[key].sel(named=name))) for key in
                   ("place", "travel", "effort", "stiffness")},
            }
            for name in data["named"].values
        },
        **{name: [finite_or_none(float(x)) for x in last[name].values] for name in
           ("natural_frequency", "free_frequency")},
        **({"stress_max": by_label(data["stress_max"], "body")} if "stress_max" in data else {}),
        "verdict": verdict_of(data).to_dict(),
        "validity": validity_summary(data),
        **kept_metrics(data),
        "parameters": json.loads(data.attrs["parameters"]),
        "version": data.attrs["paraflex_version"],
    }  # fmt: skip
