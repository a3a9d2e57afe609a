"""Common parts of datasets of runs: variables of the links, labels, units, sign conventions, provenance."""

from collections.abc import Iterable
from importlib.metadata import version
from typing import Any

import numpy as np
import xarray as xr

from paraflex.arrays import NDArray
from paraflex.dynamics import System
from paraflex.integrators import IntegrationOptions
from paraflex.mechanism import Mechanism
from paraflex.units import RATES
from .beam_stresses import largest_stresses
from .drawing import drawing_coordinates
from .findings import VALIDITY_UNITS
from .links import Links
from .metrics import METRICS
from .numbers import name_units
from .sensors import READING, SENSOR
from .storage import origin
from .stress import COMMENTS as STRESS_COMMENTS, MOMENT, UNITS as STRESS_UNITS, Variables, section_coordinates

UNITS = (
    {
        "time": ("time", "s"),
        "end_effector": ("end-effector position", "m"),
        "end_effector_velocity": ("end-effector velocity", "m/s"),
        "end_effector_acceleration": ("end-effector acceleration", "m/s^2"),
        "torque": ("motor torque", "N m"),
        "internal_torque": ("part of the motor torques that does not act on the rigid motion", "N m"),
        "motor_speed": ("rate of a motor's joint", "rad/s"),
        "motor_power": ("power of a motor", "W"),
        "motor_energy": ("integral of the magnitude of a motor's power, from the samples", "J"),
        "joint_coordinate": ("angle or travel of a joint", "rad, m"),
        "joint_speed": ("rate of a joint's angle or travel", "rad/s, m/s"),
        "drive_torque": ("torque of a prescribed motion", "N m"),
        "drive_speed": ("rate of a prescribed motion's joint", "rad/s"),
        "drive_power": ("power of a prescribed motion", "W"),
        "drive_energy": ("integral of the magnitude of a prescribed motion's power, from the samples", "J"),
        "input_power": ("power of all motors and prescribed motions together", "W"),
        "frame_force": ("force of the mechanism on the ground: shaking force", "N"),
        "frame_moment": ("moment of the mechanism on the ground about its origin: shaking moment", "N m"),
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
        "stress_max_error": ("how far the largest stress of a beam may be off by errors of integration", "Pa"),
        "joint_force_error": ("how far the force of a joint may be off by errors of integration", "N"),
        "joint_moment_error": ("how far the moment of a joint may be off by errors of integration", "N m"),
        "drive_torque_error": ("how far the torque of a prescribed motion may be off by errors of integration", "N m"),
        "joint_force": ("force of a joint's first body on its second, ground frame", "N"),
        "joint_moment": ("moment of a joint's first body on its second", "N m"),
        "multiplier": (
            "multiplier of a constraint row; torque or force of a spring, damper, friction or gear",
            "N, N m",
        ),
        "kinetic_energy": ("kinetic energy", "J"),
        "strain_energy": ("strain energy of links and springs", "J"),
        "work": ("work of motors, prescribed motion, weight and loads, less what dampers and friction take", "J"),
        "actuation_condition": ("condition number of the actuation matrix", "1"),
        "shape": ("drawn points of the bodies, deformed", "m"),
        "shape_base": ("drawn points of the bodies, stiff: what magnified deflections are drawn from", "m"),
        "joint_position": ("position of a joint, on its second body", "m"),
        "joint_base": ("position of a joint, on its second body in shape_base", "m"),
        "joint_direction": ("direction of the axis of a joint that slides", "rad"),
        "joint_direction_base": ("direction of the axis of a joint that slides, of bodies in shape_base", "rad"),
        "spring_position": ("ends of a spring between points", "m"),
        "station_body": ("body of a drawn point", "1"),
        "station_place": ("place of a drawn point in the undeformed body, in its frame", "m"),
        "point_station": ("drawn point that a named point is", "1"),
        "joint_kind": ("kind of joint", "1"),
        "joint_grounded": ("whether the joint is on the ground", "1"),
        "joint_driven": ("whether a motor or a prescribed motion is at the joint", "1"),
        "joint_rail": ("drawn point that a sliding joint's axis goes through; -1 on the ground and along a beam", "1"),
        "spring_station": ("drawn points that a spring is at; -1 on the ground", "1"),
        "load_station": ("drawn point that a load acts at", "1"),
        "load_force": ("force of a load, ground frame", "N"),
        "load_torque": ("torque of a load", "N m"),
        "gear_joint": ("joints that a gear or another relation relates, counted from 0", "1"),
        "gear_radius": ("pitch radii of wheels that mesh outside, or of a pinion and its rack, then infinite", "m"),
        "status": ("how the run ended", "1"),
        "message": ("reason why it is not complete", "1"),
        "factorisations": ("factorisations of the iteration matrix", "1"),
        "wall_time": ("wall time of the integration", "s"),
        "constraint_velocity_max": ("largest constraint violation in velocity", "m/s"),
        "brake_energy": ("energy that brakes took as they engaged after the motion", "J"),
        "event": ("event that stopped the run", "1"),
        "event_time": ("when it was stopped", "s"),
        **{metric.name: (metric.meaning, metric.unit) for metric in METRICS.values() if metric.of_solver},
        "coordinate_value": ("generalised coordinate; flexible ones are mass-normalised modes", "m, rad, m kg^(1/2)"),
        "coordinate_rate": ("rate of a generalised coordinate", "1/s of it"),
        "point_velocity": ("velocity of a named point", "m/s"),
        "point_acceleration": ("acceleration of a named point", "m/s^2"),
        READING: ("reading of a sensor", "1"),
        "applied_torque": ("given motor torque, over time where it changes", "N m"),
    }
    | VALIDITY_UNITS
    | STRESS_UNITS
)

# Conventions of variables: body, frame and sign.
_COMMENTS = {
    "motor_power": "torque or force times the rate of the joint: positive drives the mechanism, negative brakes it",
    "joint_force": (
        "at the joint's point of the second body, in the ground frame: of the constraints and of motors, springs, "
        "dampers, friction, gears and prescribed motion along the joint, without loads and laws of springs; the "
        "opposite acts on the first body; NaN where redundant constraints leave it undetermined"
    ),
    "joint_moment": (
        "about the joint's point of the second body, positive anticlockwise: of the constraints and of motors, "
        "springs, dampers, friction, gears and prescribed motion that turn the joint, without loads and laws of "
        "springs; the opposite acts on the first body; NaN where redundant constraints leave it undetermined"
    ),
    "multiplier": (
        "on the left of the equations of motion: its negative acts on the joint's second body, in the ground frame, "
        "anticlockwise, or along the joint's axis or normal, of a gear at its second joint; of least norm where "
        "constraints depend on one another"
    ),
    "torque": "on the joint's second body: positive turns it anticlockwise or moves it along the axis",
    "internal_torque": "it only strains links against one another",
    "applied_torque": "as `torque` of a run along a path",
    "angle": "of the body frame's x axis against the ground's, anticlockwise",
    "tip_transverse": "across the tangent at the first end of the link, positive to its left: anticlockwise",
    "tip_slope": "anticlockwise",
    "joint_coordinate": "of the joint's second body against its first: anticlockwise, or along the joint's axis",
    "drive_torque": "as `torque`: on the joint's second body",
    "drive_power": "torque or force times the rate of the joint: positive drives the mechanism, negative brakes it",
    READING: "each in the corresponding unit of units_each; NaN where it has no meaning in the model",
    "frame_force": "of all joints and springs between points that are on the ground",
} | STRESS_COMMENTS


# Variables that are forces if all motors slide.
_TORQUES = ("torque", "internal_torque", "peak_torque", "rms_torque", "applied_torque")


def error_variables(links: Links) -> Variables:
    """Return bounds of the integration errors of stresses and loads in a run; empty if they are unknown."""
    if links.load_errors is None:
        return {}
    force, moment, drive = links.load_errors
    out: Variables = {"joint_force_error": (("joint",), force), "joint_moment_error": (("joint",), moment)}
    if links.stress_errors is not None:
        out["stress_max_error"] = (("body",), links.stress_errors)
    return out | ({"drive_torque_error": (("drive",), drive)} if drive.size else {})


def with_totals(data: xr.Dataset) -> xr.Dataset:
    """Return a dataset with derived variables added: powers, energies, the largest stresses."""
    for torque, name in (("torque", "motor"), ("applied_torque", "motor"), ("drive_torque", "drive")):
        if torque in data:
            power = data[torque] * data[f"{name}_speed"]
            data[f"{name}_power"] = power.transpose(..., "time", name)
            # The energy of powers that are not known is not zero.
            data[f"{name}_energy"] = abs(power).fillna(0.0).integrate("time").where(power.notnull().any("time"))
            if data.sizes[name]:
                data["input_power"] = power.sum(name, skipna=False) + data.get("input_power", 0.0)
    return data.assign(largest_stresses(data)) if MOMENT in data else data


def padded(values: NDArray[Any], total: int) -> NDArray[Any]:
    """Return values padded with NaN to all samples of the study, for a run that did not reach them."""
    out = np.full((total, *values.shape[1:]), np.nan, dtype=values.dtype)
    out[: values.shape[0]] = values
    return out


def link_coordinates(system: System, links: Links) -> dict[str, Any]:
    """Return the coordinate labels of the dimensions of the link variables."""
    mechanism = system.described
    drives, sensors = ([one.name for one in members] for members in (mechanism.prescribed, mechanism.sensors))
    return {
        "axis": ["x", "y"],
        "body": [body.name for body in mechanism.bodies],
        "motor": [motor.name for motor in mechanism.motors],
        "row": list(system.described_rows),
        **drawing_coordinates(mechanism),
        **({SENSOR: sensors} if READING in links.variables else {}),
        **({"drive": drives} if "drive_torque" in links.variables else {}),
        **({} if links.sections is None else section_coordinates(links.sections)),
    }


def label(data: xr.Dataset, mechanism: Mechanism) -> None:
    """Write meaning, unit and conventions into the attributes of every variable, "_desired" ones included."""
    for name in map(str, data.variables):
        plain = name.removesuffix("_desired")
        if plain in UNITS:
            meaning, unit = UNITS[plain]
            data[name].attrs = {"long_name": meaning if name == plain else f"desired {meaning}", "units": unit}
        if plain in _COMMENTS:
            data[name].attrs["comment"] = _COMMENTS[plain]
    drives = ["N" if mechanism.slides(one.joint) else "N m" for one in mechanism.prescribed]
    _name_efforts(data, mechanism.motor_units(), "motor_speed", _TORQUES)
    if READING in data:
        readings = list(mechanism.sensor_units())
        name_units(data[READING], list(dict.fromkeys(readings)), readings)
    _name_efforts(data, drives, "drive_speed", ("drive_torque", "drive_torque_error"))
    for name, of_angle, of_travel in (("joint_coordinate", "rad", "m"), ("joint_speed", "rad/s", "m/s")):
        if name in data:
            kinds = sorted({joint.slides for joint in mechanism.joints})
            data[name].attrs["units"] = ", ".join(of_travel if slides else of_angle for slides in kinds)


def _name_efforts(data: xr.Dataset, units: Iterable[str], speed: str, names: Iterable[str]) -> None:
    """Write units of torques or forces and of their joints' speeds; `units_each` if there are both kinds, in order."""
    each = list(units)
    units = sorted(set(each), reverse=True) or ["N m"]
    if speed in data:
        data[speed].attrs["units"] = ", ".join(RATES[unit] for unit in units)
    for name in (each for each in names if each in data):
        name_units(data[name], units, each)
        if units == ["N"]:
            data[name].attrs["long_name"] = data[name].attrs["long_name"].replace("torque", "force")


def provenance(
    system: System, method: str, options: IntegrationOptions | None, parameters: dict[str, Any] | None
) -> dict[str, Any]:
    """Return the provenance of results: mechanism, method, options of own methods, the model as read, versions."""
    mechanism, options = system.described, options or IntegrationOptions()
    # Other models and engines have their own integrators, which these options do not describe.
    ours = options.to_dict() if method == options.method.title else {}
    effector = mechanism.end_effector
    return {
        "mechanism": mechanism.name,
        **({} if effector is None else {"end_effector_point": str(effector.point)}),
        "tolerance": options.tolerance_for(system),
        "baumgarte_alpha": options.alpha,
        "baumgarte_beta": options.beta,
        "method": method,
        **ours,
        **origin(parameters),
        "numba_version": version("numba"),
        "numpy_version": version("numpy"),
    }
