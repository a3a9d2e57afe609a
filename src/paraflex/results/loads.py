"""The largest loads of a run as plain numbers: stresses, motion of joints, efforts of motors and drives."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from paraflex.results.numbers import finite_or_none, largest

Figures = dict[str, float | None]
# Of the rate of a joint that a torque or a force drives.
_RATES = {"N m": "rad/s", "N": "m/s"}


def load_figures(run: xr.Dataset) -> dict[str, Any]:
    """Largest magnitudes of one run; None for what a model does not give, and no group that results do not hold.

    Returns
    -------
    dict
        `beams.<body>` with stress_max, place, time, bending_stress_max, axial_stress_max [Pa, m, s] and safety_factor;
        `joints.<joint>` with least, most [rad, m], speed_max, force_max [N] and moment_max [N m]; `motors.<motor>` and
        `drives.<prescribed motion>` with torque_max, its unit and that of speed_max (None of both kinds in results of
        earlier versions), speed_max, power_max [W] and energy [J]; `frame` with force_max and moment_max of the
        mechanism on the ground.
    """
    out: dict[str, Any] = {}
    if "stress_max" in run:
        bent = set(map(str, run["section_body"].values))
        out["beams"] = {
            body: {key: finite_or_none(run[name].values[b]) for key, name in _OF_BEAMS.items()}
            for b, body in enumerate(map(str, run["body"].values))
            if body in bent or np.isfinite(run["stress_max"].values[b])
        }
    if "joint_coordinate" in run:
        out["joints"] = {str(joint): _joint(run.sel(joint=joint)) for joint in run["joint"].values}
    for group, dim, torque in (
        ("motors", "motor", "torque" if "torque" in run else "applied_torque"), ("drives", "drive", "drive_torque"),
    ):  # fmt: skip
        if torque in run and f"{dim}_energy" in run:
            out[group] = {
                str(name): {
                    "torque_unit": unit,
                    "speed_unit": None if unit is None else _RATES[unit],
                    "torque_max": largest(run[torque].sel({dim: name}).values),
                    "speed_max": largest(run[f"{dim}_speed"].sel({dim: name}).values),
                    "power_max": largest(run[f"{dim}_power"].sel({dim: name}).values),
                    "energy": finite_or_none(run[f"{dim}_energy"].sel({dim: name}).item()),
                }
                for name, unit in zip(run[dim].values, _units(run[torque], run.sizes[dim]), strict=True)
            }
    if "frame_force" in run:
        size = np.linalg.norm(run["frame_force"].transpose(..., "axis").values, axis=-1)
        out["frame"] = {"force_max": largest(size), "moment_max": largest(run["frame_moment"].values)}
    return out


def _units(efforts: xr.DataArray, number: int) -> list[str | None]:
    """Unit of each torque or force; None where it is not known which of the two it is."""
    unit = str(efforts.attrs.get("units", ""))
    if unit in _RATES:
        return [unit] * number
    each = str(efforts.attrs.get("units_each", "")).split(", ")
    return list(each) if len(each) == number and set(each) <= set(_RATES) else [None] * number


_OF_BEAMS = {
    "stress_max": "stress_max",
    "place": "stress_place",
    "time": "stress_time",
    "bending_stress_max": "bending_stress_max",
    "axial_stress_max": "axial_stress_max",
    "safety_factor": "safety_factor",
}


def _joint(one: xr.Dataset) -> Figures:
    values = one["joint_coordinate"].values
    known = values[np.isfinite(values)]
    return {
        "least": float(known.min()) if known.size else None,
        "most": float(known.max()) if known.size else None,
        "speed_max": largest(one["joint_speed"].values),
        "force_max": largest(np.linalg.norm(one["joint_force"].transpose(..., "axis").values, axis=-1)),
        "moment_max": largest(one["joint_moment"].values),
    }


def stress_line(loads: Mapping[str, Mapping[str, Any]]) -> str:
    """A sentence on the largest stress of all runs, with place, time and safety factor; empty where none is known.

    Parameters
    ----------
    loads : mapping of str to mapping
        `load_figures` by name of the run, which may be empty.
    """
    known = [
        (one["stress_max"], name, body, one)
        for name, figures in loads.items()
        for body, one in figures.get("beams", {}).items()
        if one["stress_max"] is not None
    ]
    if not known:
        return ""
    most, name, body, one = max(known, key=lambda each: each[0])
    whose = f"mode {name}: " if name else ""
    text = f"{whose}largest stress {1e-6 * most:.4g} MPa in {body} at {one['place']:.3g} m, t = {one['time']:.4g} s"
    factors = [(beam["safety_factor"], where) for _, _, where, beam in known if beam["safety_factor"] is not None]
    if not factors:
        return text
    least, where = min(factors)
    return f"{text}; safety factor {least:.3g}" + (f" ({where})" if where != body else "")


def effort_lines(figures: Mapping[str, Any], mode: str = "") -> list[str]:
    """A sentence for each prescribed motion of a run: its largest torque, speed and power."""
    whose = f"mode {mode}: " if mode else ""
    return [
        f"{whose}drive {name}: {_EFFORTS[one['torque_unit']]} up to "
        f"{_with_unit(one['torque_max'], one['torque_unit'])}, "
        f"speed up to {_with_unit(one['speed_max'], one['speed_unit'])}, power up to {one['power_max']:.4g} W"
        for name, one in figures.get("drives", {}).items()
        if None not in (one["torque_max"], one["speed_max"], one["power_max"])
    ]


_EFFORTS = {"N m": "torque", "N": "force", None: "torque or force"}


def _with_unit(value: float, unit: str | None) -> str:
    return f"{value:.4g} {unit or ''}".rstrip()
