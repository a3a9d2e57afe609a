"""Largest loads of a run as plain numbers: stresses, joint motion and forces, efforts of motors and drives."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from paraflex.arrays import Array, Mask
from paraflex.findings import RESOLVED
from paraflex.formatting import display_unit, error_text, number, quantity, speed_text
from paraflex.units import EFFORTS, RATES
from .numbers import finite_or_none, largest, units_of_each

Figures = dict[str, float | str | None]
# Variables of beams, and the keys that differ from their names.
OF_BEAMS = ("stress_max", "stress_place", "stress_time", "bending_stress_max", "axial_stress_max", "safety_factor")
_NAMES = {"stress_place": "place", "stress_time": "time", "stress_max_error": "stress_error"}


def load_figures(run: xr.Dataset) -> dict[str, Any]:
    """Return the largest magnitudes of loads of one run.

    Values that a model does not give are None, and so are those of loads that grow without bound, for which
    `force_unbounded`, ... are True. Groups that the results do not hold are missing. A run that failed
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
        parts = [_most(name, run, f"joint_{name}", "joint") for name in ("speed", "force", "moment")]
        coordinates = run["joint_coordinate"].transpose("joint", ...).values
        out["joints"] = {
            str(joint): _travel(values, slides=slides) | speed | force | moment
            for joint, values, slides, speed, force, moment in zip(
                run["joint"].values, coordinates, sliding_joints(run), *parts, strict=True
            )
        }
    for group, dim, torque in (
        ("motors", "motor", "torque" if "torque" in run else "applied_torque"), ("drives", "drive", "drive_torque"),
    ):  # fmt: skip
        if torque in run and f"{dim}_energy" in run:
            named = (("torque", torque), ("speed", f"{dim}_speed"), ("power", f"{dim}_power"))
            parts = [_most(name, run, variable, dim) for name, variable in named]
            for effort, power in zip(parts[0], parts[2], strict=True):
                if "torque_unbounded" in effort:
                    power |= {"power_max": None, "power_time": None}
            out[group] = {
                str(name): {"torque_unit": unit, "speed_unit": None if unit is None else RATES[unit]}
                | most | speed | power | {"energy": finite_or_none(energy)}
                for name, unit, energy, most, speed, power in zip(
                    run[dim].values, _units(run[torque], run.sizes[dim]), run[f"{dim}_energy"].values, *parts,
                    strict=True,
                )
            }  # fmt: skip
    if "frame_force" in run:
        out["frame"] = _most("force", run, "frame_force")[0] | _most("moment", run, "frame_moment")[0]
    return out


def sliding_joints(data: xr.Dataset) -> Mask:
    """Return which joints (joints,) have a travel [m] instead of an angle [rad]."""
    known = np.isfinite(data["joint_direction"].transpose(..., "joint").values)
    return np.asarray(known.reshape(-1, known.shape[-1]).any(axis=0))


def _most(name: str, run: xr.Dataset, variable: str, dim: str = "") -> list[Figures]:
    """Return the largest magnitudes of the members of a dimension, or of the only one without it.

    Each is that of numbers or vectors, with its time (None for a constant), and its error if known.
    """
    values = run[variable].transpose(dim, ...) if dim else run[variable].expand_dims("member")
    sizes = np.linalg.norm(values, axis=values.get_axis_num("axis")) if "axis" in values.dims else np.abs(values.values)
    times = run["time"].values if "time" in values.dims else None
    errors = run[f"{variable}_error"].values.reshape(-1) if f"{variable}_error" in run else [None] * len(sizes)
    out = []
    for each, error in zip(sizes, errors, strict=True):
        most = largest(each)
        when = None
        if times is not None and most is not None:
            when = float(times[np.nanargmax(np.where(np.isfinite(each), each, np.nan))])
        more = {} if error is None else {f"{name}_error": finite_or_none(error)}
        if error is not None and np.isinf(error):
            most = when = None
            more[f"{name}_unbounded"] = True
        out.append({f"{name}_max": most, f"{name}_time": when, **more})
    return out


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


def _travel(values: Array, *, slides: bool) -> Figures:
    known = values[np.isfinite(values)]
    return {
        "least": float(known.min()) if known.size else None,
        "most": float(known.max()) if known.size else None,
        "unit": "m" if slides else "rad",
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


def unbounded_joints(loads: Mapping[str, Mapping[str, Any]]) -> str:
    """Return the joints of all runs whose forces grow without bound, as text."""
    names = [joint for one in loads.values() for joint, each in one.get("joints", {}).items()
             if each.get("force_unbounded")]  # fmt: skip
    return ", ".join(dict.fromkeys(names))


def joint_line(loads: Mapping[str, Mapping[str, Any]]) -> str:
    """Return a sentence on the largest joint force of all runs, empty if there is none."""
    if unbounded := unbounded_joints(loads):
        return f"largest joint force: unbounded in {unbounded}"
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
