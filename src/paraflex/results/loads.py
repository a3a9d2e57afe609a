"""Largest loads of a run as plain numbers: stresses, joint motion and forces, efforts of motors and drives."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from paraflex.arrays import Mask
from paraflex.findings import RESOLVED
from paraflex.formatting import display_unit, error_text, number, quantity, speed_text
from paraflex.units import EFFORTS, RATES
from .numbers import finite_or_none, largest, units_of_each

Figures = dict[str, float | str | None]
# Variables of beams, and the keys that differ from their names.
OF_BEAMS = ("stress_max", "stress_place", "stress_time", "bending_stress_max", "axial_stress_max", "safety_factor")
# Variables of joints; those of vectors may have an error.
_OF_JOINTS = ("joint_coordinate", "joint_speed", "joint_force", "joint_moment")
_NAMES = {"stress_place": "place", "stress_time": "time", "stress_max_error": "stress_error"}


def load_figures(run: xr.Dataset) -> dict[str, Any]:
    """Return the largest magnitudes of loads of one run.

    Values that a model does not give are None, and groups that the results do not hold are missing. A run that failed
    has no loads, as its largest ones may be artefacts of the failure.

    Returns
    -------
    dict
        `beams.<body>` with stress_max, place, time, bending_stress_max, axial_stress_max [Pa, m, s] and safety_factor;
        `joints.<joint>` with least, most, their unit (rad or m), speed_max, force_max [N] and moment_max [N m];
        `motors.<motor>` and `drives.<prescribed motion>` with torque_max, torque_unit, speed_unit (None if results of
        earlier versions mix torques and forces), speed_max, power_max [W] and energy [J]; `frame` with force_max and
        moment_max of the mechanism on the ground. For beams, joints and drives, stress_error, force_error, moment_error
        and torque_error are bounds of the integration errors, if known. Times of the largest values are torque_time,
        force_time, ... [s].
    """
    out: dict[str, Any] = {}
    if "status" in run and run["status"].item() == "failed":
        return out
    if "stress_max" in run:
        bent = set(map(str, run["section_body"].values))
        kept = (*OF_BEAMS, *(["stress_max_error"] if "stress_max_error" in run else []))
        out["beams"] = {
            body: {_NAMES.get(name, name): finite_or_none(run[name].values[b]) for name in kept}
            for b, body in enumerate(map(str, run["body"].values))
            if body in bent or np.isfinite(run["stress_max"].values[b])
        }
    if "joint_coordinate" in run:
        # Selecting one joint of all variables would take most of the time.
        few = run[[name for name in run.data_vars if str(name).removesuffix("_error") in _OF_JOINTS]]
        out["joints"] = {
            str(joint): _joint(few.sel(joint=joint), slides=slides)
            for joint, slides in zip(run["joint"].values, sliding_joints(run), strict=True)
        }
    for group, dim, torque in (
        ("motors", "motor", "torque" if "torque" in run else "applied_torque"), ("drives", "drive", "drive_torque"),
    ):  # fmt: skip
        if torque in run and f"{dim}_energy" in run:
            out[group] = {
                str(name): {
                    "torque_unit": unit,
                    "speed_unit": None if unit is None else RATES[unit],
                    **_most("torque", run, torque, {dim: name}),
                    **_most("speed", run, f"{dim}_speed", {dim: name}),
                    **_most("power", run, f"{dim}_power", {dim: name}),
                    "energy": finite_or_none(run[f"{dim}_energy"].sel({dim: name}).item()),
                }
                for name, unit in zip(run[dim].values, _units(run[torque], run.sizes[dim]), strict=True)
            }
    if "frame_force" in run:
        out["frame"] = _most("force", run, "frame_force") | _most("moment", run, "frame_moment")
    return out


def sliding_joints(data: xr.Dataset) -> Mask:
    """Return which joints (joints,) have a travel [m] instead of an angle [rad]."""
    known = np.isfinite(data["joint_direction"].transpose(..., "joint").values)
    return np.asarray(known.reshape(-1, known.shape[-1]).any(axis=0))


def _most(name: str, run: xr.Dataset, variable: str, place: Mapping[str, str] | None = None) -> Figures:
    """Return the largest magnitude of numbers or vectors, its time (None for a constant), and its error if known."""
    values = run[variable].sel(place)
    sizes = values.reduce(np.linalg.norm, "axis") if "axis" in values.dims else abs(values)
    most = largest(sizes.values)
    when = None
    if most is not None and "time" in sizes.dims:
        when = float(sizes["time"].values[np.nanargmax(np.where(np.isfinite(sizes.values), sizes.values, np.nan))])
    known = f"{variable}_error" in run
    error = {f"{name}_error": finite_or_none(run[f"{variable}_error"].sel(place).item())} if known else {}
    return {f"{name}_max": most, f"{name}_time": when, **error}


def resolved_error(figures: Mapping[str, Any], load: str) -> float | None:
    """Return the error of a largest load if it exceeds one per cent of the load, else None."""
    most, error = figures[f"{load}_max"], figures.get(f"{load}_error")
    return error if most and error is not None and error > RESOLVED * most else None


def load_text(figures: Mapping[str, Any], load: str, unit: str, digits: int = 4) -> str:
    """Return a largest load with its unit, and with its error if that is `resolved_error`: "47.06 ± 9 MPa"."""
    most, shown = figures[f"{load}_max"], display_unit(unit, figures[f"{load}_max"])
    off = error_text(resolved_error(figures, load), shown.factor)
    return f"{number(most, digits, factor=shown.factor)}{off} {shown.name}".rstrip()


def _units(efforts: xr.DataArray, number: int) -> list[str | None]:
    """Return the unit of each torque or force; None if it is not known which of the two it is."""
    return [unit if unit in RATES else None for unit in units_of_each(efforts, number)]


def _joint(one: xr.Dataset, *, slides: bool) -> Figures:
    values = one["joint_coordinate"].values
    known = values[np.isfinite(values)]
    return {
        "least": float(known.min()) if known.size else None,
        "most": float(known.max()) if known.size else None,
        "unit": "m" if slides else "rad",
        **_most("speed", one, "joint_speed"),
        **_most("force", one, "joint_force"),
        **_most("moment", one, "joint_moment"),
    }


Ranked = list[tuple[float, str, str, Mapping[str, Any]]]


def ranked(loads: Mapping[str, Mapping[str, Any]], group: str, key: str) -> Ranked:
    """Return value, run, member and loads of the member for all runs, the largest value first, without None.

    Parameters
    ----------
    loads : mapping of str to mapping
        Results of `load_figures` by the name of the run, which may be empty.
    group, key : str
        Group and key, such as "beams" and "stress_max", or "joints" and "force_max".
    """
    known = [
        (one[key], run, member, one)
        for run, figures in loads.items()
        for member, one in figures.get(group, {}).items()
        if one[key] is not None
    ]
    return sorted(known, key=lambda each: -each[0])


def joint_line(loads: Mapping[str, Mapping[str, Any]]) -> str:
    """Return a sentence on the largest joint force of all runs, empty if there is none."""
    known = ranked(loads, "joints", "force_max")
    if not known or not known[0][0]:
        return ""
    _, name, joint, one = known[0]
    return f"{_whose(name)}largest joint force {load_text(one, 'force', 'N')} in {joint}{_at(one['force_time'])}"


def stress_line(loads: Mapping[str, Mapping[str, Any]]) -> str:
    """Return a sentence on the largest stress of all runs, with place, time and safety factor; empty if none is known.

    Parameters
    ----------
    loads : mapping of str to mapping
        Results of `load_figures` by the name of the run, which may be empty.
    """
    known = ranked(loads, "beams", "stress_max")
    if not known:
        return ""
    _, name, body, one = known[0]
    text = (
        f"{_whose(name)}largest stress {load_text(one, 'stress', 'Pa')} in {body} at "
        f"{quantity(one['place'], 'm', padded=False)}, t = {number(one['time'])} s"
    )
    factors = [(beam["safety_factor"], where) for _, _, where, beam in known if beam["safety_factor"] is not None]
    if not factors:
        return text
    least, where = min(factors)
    return f"{text}; safety factor {number(least, 3)}" + (f" ({where})" if where != body else "")


def effort_lines(figures: Mapping[str, Any], mode: str = "") -> list[str]:
    """Return a sentence for each prescribed motion of a run, with its largest torque, speed and power."""
    return [
        f"{_whose(mode)}prescribed.{name}: {EFFORTS.get(one['torque_unit'], 'torque or force')} up to "
        f"{load_text(one, 'torque', one['torque_unit'] or '')}{_at(one['torque_time'])}; "
        f"speed up to {speed_text(one['speed_max'], one['speed_unit'] or '')}; "
        f"power up to {quantity(one['power_max'], 'W', digits=4, padded=False)}{_at(one['power_time'])}"
        for name, one in figures.get("drives", {}).items()
        if None not in (one["torque_max"], one["speed_max"], one["power_max"])
    ]


def _whose(mode: str) -> str:
    return f"mode {mode}: " if mode else ""


def _at(time: float | None) -> str:
    return "" if time is None else f" at t = {number(time)} s"
