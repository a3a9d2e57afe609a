"""Tables of driven motions: ranges, dead points and time ratios of joints, transmission angles, coupler curves."""

import json
import math
from collections.abc import Container, Iterable, Iterator, Mapping
from typing import Any

import numpy as np
import xarray as xr

from paraflex.arrays import Array
from paraflex.formatting import display_unit, number, quantity, text_symbol
from paraflex.results.kinematics import KINEMATICS
from .selection import apart, names_of
from .tables import Table, table_of

# Largest number of points that are listed.
_MOST_POINTS = 30
# Positions within this part of the largest range are equal.
_SAME = 1e-9
Found = Mapping[str, Any]


def kinematics_of(data: xr.Dataset) -> dict[str, Any]:
    """Return the properties of a driven motion from its dataset; empty for other runs."""
    return json.loads(data.attrs.get(KINEMATICS, "{}"))


def coupler_points(attrs: Mapping[Any, Any]) -> list[str]:
    """Return the points of the first seven coupler curves, from the attributes of a dataset; none without a drive."""
    return list(json.loads(attrs.get(KINEMATICS, "{}")).get("trails", ()))[:7]


def special_points(data: xr.Dataset, kind: str, points: Container[str]) -> Array:
    """Return the positions (k, 2) of the cusps or crunodes of points' paths; none for runs without a drive [m]."""
    trails = kinematics_of(data).get("trails", {})
    found = [each["position"] for point in trails if point in points for each in trails[point][f"{kind}s"]]
    return np.array(found).reshape(-1, 2)


def kinematics_tables(data: xr.Dataset) -> Iterator[Table]:
    """Yield the tables of a driven motion; none for other runs."""
    found = kinematics_of(data)
    if found:
        for title, unit in (("Angles of joints", "rad"), ("Travels of joints", "m")):
            yield _joints(data, found, title, unit)
        yield _dead_points(found)
        yield _transmissions(found)
        yield _points(data)
        yield _special(found)
        yield _assemblies(found)


def kinematics_tiles(data: xr.Dataset) -> list[tuple[str, str, str]]:
    """Return the main numbers of a driven motion: range of the drive, smallest transmission angle, time ratio."""
    found, tiles = kinematics_of(data), []
    key, (at_drive, unit) = _place(found)
    if drive := found["drive"]:
        shown = display_unit(unit, max(abs(drive["start"]), abs(drive["end"])))
        ends = [number(drive[end], factor=shown.factor) for end in ("start", "end")]
        speed = f"at {quantity(drive['speed'], unit + '/s')}"
        how = f"a whole turn, {speed}" if drive["full_turn"] else speed
        tiles.append((f"{drive['joint']} moves", f"{' to '.join(ends)} {shown.name}", how))
    if angles := found["transmission_angles"]:
        least = min(angles, key=lambda one: one["smallest"]["value"])
        at = quantity(least["smallest"][key], unit, padded=False)
        tiles.append(("smallest transmission angle", quantity(least["smallest"]["value"], "rad"),
                      f"joint {text_symbol(least['joint'])} {at_drive} = {at}"))  # fmt: skip
    if ratios := found["time_ratios"]:
        joint = max(ratios, key=lambda name: ratios[name])
        tiles.append(("largest time ratio", number(ratios[joint]), f"joint {text_symbol(joint)}"))
    return tiles


def cycle_note(found: Found) -> str:
    """Return a sentence on a motion that repeats before its end, whose properties are those of one cycle, or ""."""
    drive, cycle = found["drive"], found.get("cycle")
    if cycle is None or abs(drive["end"] - drive["start"]) < 2.0 * math.pi * (cycle + 0.5):
        return ""
    turns = "each turn" if cycle == 1 else f"{cycle} turns"
    return (
        f"The motion repeats after {turns} of {drive['joint']}: dead points, transmission angles and special points "
        "are listed once."
    )


def _place(found: Found) -> tuple[str, tuple[str, str]]:
    """Return entry, and heading and unit of positions in tables: of the drive, or times without constant speed."""
    drive = found["drive"]
    return ("time", ("at t", "s")) if drive is None else ("drive", (f"at {drive['joint']}", drive["unit"]))


def _joints(data: xr.Dataset, found: Found, title: str, unit: str) -> Table:
    """Return the table of the ranges of joints with coordinates in a unit that move, sharp where they reverse."""
    key, at = _place(found)
    rows, coordinates, drive = [], data["joint_coordinate"], found["drive"]
    # Smaller travels are rounding beside the ranges of points.
    size = 1.0 if unit == "rad" else float(np.max(np.ptp(data["point_position"].values, axis=0), initial=0.0))
    places = data["time"].values if drive is None else coordinates.sel(joint=drive["joint"]).values
    for joint in names_of(data, "joint"):
        values = coordinates.sel(joint=joint).values
        if found["joint_units"].get(joint) != unit or not np.ptp(values) > _SAME * size:
            continue
        ends = [(float(values[k]), float(places[k])) for k in (int(np.argmin(values)), int(np.argmax(values)))]
        ends += [(end["value"], end[key]) for end in found["dead_points"].get(joint, ())]
        ends = [*zip(_rounded((value for value, _ in ends), np.ptp(values)),
                     _rounded((place for _, place in ends), np.ptp(places)), strict=True)]  # fmt: skip
        rows.append((joint, *min(ends), *max(ends), found["time_ratios"].get(joint)))
    heads = [("joint", ""), ("lowest", unit), at, ("highest", unit), at, ("time ratio", "")]
    return table_of(title, heads, rows, alike=("lowest", "highest"))


def _rounded(values: Iterable[float], size: float) -> list[float]:
    """Return values without rounding errors: zero for those that are very small beside a size."""
    return [0.0 if abs(value) < _SAME * size else value for value in values]


def _dead_points(found: Found) -> Table:
    """Return the table of the dead points of joints that have more than two."""
    key, at = _place(found)
    rows = [
        (joint, *(each["value"] if found["joint_units"][joint] == unit else None for unit in ("rad", "m")), each[key])
        for joint, ends in found["dead_points"].items() if len(ends) > 2 for each in ends
    ]  # fmt: skip
    return table_of("Dead points", [("joint", ""), ("angle", "rad"), ("travel", "m"), at], rows, cycle_note(found))


def _transmissions(found: Found) -> Table:
    key, at = _place(found)
    ends = [(end, name) for end in ("smallest", "largest") for name in ("value", key)]
    rows = [(one["joint"], one["coupler"], *(one[end][name] for end, name in ends))
            for one in found["transmission_angles"]]  # fmt: skip
    heads = [("joint", ""), ("coupler", ""), ("smallest", "rad"), at, ("largest", "rad"), at]
    return table_of("Transmission angles", heads, rows, cycle_note(found))


def _points(data: xr.Dataset) -> Table:
    """Return the table of the points that move, one of those that coincide: range, largest speed and acceleration."""
    rows, names, effector = [], names_of(data, "point"), data.attrs.get("end_effector_point")
    position = data["point_position"].transpose("time", "point", "axis").values
    size = float(np.max(np.ptp(position, axis=0), initial=0.0))
    least = _SAME * size
    moving = [k for k in range(len(names)) if np.max(np.ptp(position[:, k], axis=0)) > least]
    shown = apart(position, sorted(moving, key=lambda k: names[k] != effector), least)
    for k in sorted(shown)[:_MOST_POINTS]:
        places, one = position[:, k], data.isel(point=k)
        most = [float(np.max(np.linalg.norm(one[f"point_{name}"].transpose("time", "axis").values, axis=1)))
                for name in ("velocity", "acceleration")]  # fmt: skip
        ends = np.stack([places.min(axis=0), places.max(axis=0)], axis=1).ravel().tolist()
        rows.append((names[k], *_rounded(ends, size), *most))
    heads = [("point", ""), ("x from", "m"), ("x to", "m"), ("y from", "m"), ("y to", "m"), ("top speed", "m/s"),
             ("top acceleration", "m/s^2")]  # fmt: skip
    note = "Ranges, and the largest speed and acceleration, at the samples."
    # An end of a range may be as close to zero as the samples happen to come.
    return table_of("Points", heads, rows, note, alike=("x from", "x to", "y from", "y to"))


def _special(found: Found) -> Table:
    """Return the table of cusps and crunodes of coupler curves."""
    key, at = _place(found)
    places = [each["position"] for trail in found["trails"].values() for kind in trail.values() for each in kind]
    size = float(np.max(np.abs(places), initial=0.0))
    rows = [
        (point, kind, *_rounded(each["position"], size), *((each[key], None) if kind == "cusp" else each[f"{key}s"]))
        for point, trail in found["trails"].items() for kind in ("cusp", "crunode") for each in trail[f"{kind}s"]
    ]  # fmt: skip
    heads = [("point", ""), ("kind", ""), ("x", "m"), ("y", "m"), at, ("and at", at[1])]
    return table_of("Special points of coupler curves", heads, rows, cycle_note(found), alike=("x", "y"))


def _assemblies(found: Found) -> Table:
    """Return the table of the assemblies that were searched for: angles of all bodies at the start."""
    assemblies = found.get("assemblies", [])
    rows = [(k, *_rounded(one["angles"].values(), 2.0 * np.pi), one["found"])
            for k, one in enumerate(assemblies, start=1)]  # fmt: skip
    bodies = [(body, "rad") for one in assemblies[:1] for body in one["angles"]]
    note = "With the drive at its start, that of the motion first; found: random starts that led to it."
    return table_of("Assemblies", [("assembly", ""), *bodies, ("found", "")], rows, note)
