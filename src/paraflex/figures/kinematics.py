"""Tables of driven motions: ranges, dead points and time ratios of joints, transmission angles, coupler curves."""

import json
from collections.abc import Container, Iterator, Mapping
from typing import Any

import numpy as np
import xarray as xr

from paraflex.arrays import Array
from paraflex.formatting import display_unit, number, quantity, text_symbol
from paraflex.results.kinematics import KINEMATICS
from .selection import names_of
from .tables import Column, Table

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
    key, where, unit = _place(found)
    if drive := found["drive"]:
        shown = display_unit(unit, max(abs(drive["start"]), abs(drive["end"])))
        ends = [number(drive[end], factor=shown.factor) for end in ("start", "end")]
        turn = "a whole turn, " if drive["full_turn"] else ""
        tiles.append(
            (f"{where} moves", f"{' to '.join(ends)} {shown.name}", f"{turn}at {quantity(drive['speed'], unit + '/s')}")
        )
    if angles := found["transmission_angles"]:
        least = min(angles, key=lambda one: one["smallest"]["value"])
        at = quantity(least["smallest"][key], unit, padded=False)
        tiles.append(("smallest transmission angle", quantity(least["smallest"]["value"], "rad"),
                      f"joint {text_symbol(least['joint'])} at {where} = {at}"))  # fmt: skip
    if ratios := found["time_ratios"]:
        joint = max(ratios, key=lambda name: ratios[name])
        tiles.append(("largest time ratio", number(ratios[joint]), f"joint {text_symbol(joint)}"))
    return tiles


def _place(found: Found) -> tuple[str, str, str]:
    """Return entry, heading and unit of positions in tables: those of the drive, or times without constant speed."""
    drive = found["drive"]
    return ("time", "t", "s") if drive is None else ("drive", drive["joint"], drive["unit"])


def _joints(data: xr.Dataset, found: Found, title: str, unit: str) -> Table:
    """Return the table of the ranges of joints with coordinates in a unit that move, sharp where they reverse."""
    key, where, place_unit = _place(found)
    rows, coordinates = [], data["joint_coordinate"]
    # Smaller travels are rounding beside the ranges of points.
    size = 1.0 if unit == "rad" else float(np.max(np.ptp(data["point_position"].values, axis=0), initial=0.0))
    places = data["time"].values if found["drive"] is None else coordinates.sel(joint=where).values
    for joint in names_of(data, "joint"):
        values = coordinates.sel(joint=joint).values
        values = np.where(np.abs(values) < _SAME * np.ptp(values), 0.0, values)
        if found["joint_units"].get(joint) != unit or not np.ptp(values) > _SAME * size:
            continue
        ends = [(float(values[k]), float(places[k])) for k in (int(np.argmin(values)), int(np.argmax(values)))]
        ends += [(end["value"], end[key]) for end in found["dead_points"].get(joint, ())]
        ends = [(0.0 if abs(value) < _SAME * np.ptp(values) else value, at) for value, at in ends]
        rows.append((joint, *min(ends), *max(ends), found["time_ratios"].get(joint)))
    columns = list(zip(*rows, strict=True)) if rows else [()] * 6
    at, shown = f"at {where}", display_unit(unit, [*columns[1], *columns[3]])
    return Table(title, [
        Column("joint", columns[0]),
        Column("lowest", columns[1], unit, shown=shown), Column(at, columns[2], place_unit),
        Column("highest", columns[3], unit, shown=shown), Column(at, columns[4], place_unit),
        Column("time ratio", columns[5]),
    ]).filled()  # fmt: skip


def _dead_points(found: Found) -> Table:
    """Return the table of the dead points of joints that have more than two."""
    key, where, unit = _place(found)
    rows = [(joint, found["joint_units"][joint], each["value"], each[key])
            for joint, ends in found["dead_points"].items() if len(ends) > 2 for each in ends]  # fmt: skip
    return Table("Dead points", [
        Column("joint", [row[0] for row in rows]),
        Column("angle", [row[2] if row[1] == "rad" else None for row in rows], "rad"),
        Column("travel", [row[2] if row[1] == "m" else None for row in rows], "m"),
        Column(f"at {where}", [row[3] for row in rows], unit),
    ]).filled()  # fmt: skip


def _transmissions(found: Found) -> Table:
    key, where, unit = _place(found)
    rows, at = found["transmission_angles"], f"at {where}"
    return Table("Transmission angles", [
        Column("joint", [one["joint"] for one in rows]), Column("coupler", [one["coupler"] for one in rows]),
        Column("smallest", [one["smallest"]["value"] for one in rows], "rad"),
        Column(at, [one["smallest"][key] for one in rows], unit),
        Column("largest", [one["largest"]["value"] for one in rows], "rad"),
        Column(at, [one["largest"][key] for one in rows], unit),
    ])  # fmt: skip


def _points(data: xr.Dataset) -> Table:
    """Return the table of the points that move, one of those that coincide: range, largest speed and acceleration."""
    rows, seen = [], []
    position = data["point_position"].transpose("time", "point", "axis").values
    least = _SAME * float(np.max(np.ptp(position, axis=0), initial=0.0))
    for k, point in enumerate(names_of(data, "point")):
        places = position[:, k]
        repeated = any(np.allclose(places, other, rtol=0.0, atol=least) for other in seen)
        if np.max(np.ptp(places, axis=0)) > least and not repeated and len(rows) < _MOST_POINTS:
            one = data.sel(point=point)
            most = [float(np.max(np.linalg.norm(one[f"point_{name}"].transpose("time", "axis").values, axis=1)))
                    for name in ("velocity", "acceleration")]  # fmt: skip
            ends = np.stack([places.min(axis=0), places.max(axis=0)], axis=1)
            ends[np.abs(ends) < least] = 0.0
            rows.append((point, *ends.ravel().tolist(), *most))
            seen.append(places)
    columns = list(zip(*rows, strict=True)) if rows else [()] * 7
    # An end of a range may be as close to zero as the samples happen to come.
    shown = display_unit("m", [end for ends in columns[1:5] for end in ends])
    return Table("Points", [
        Column("point", columns[0]),
        *(Column(name, columns[k], "m", shown=shown) for k, name in enumerate(("x from", "x to", "y from", "y to"), 1)),
        Column("top speed", columns[5], "m/s"), Column("top acceleration", columns[6], "m/s^2"),
    ], note="Ranges, and the largest speed and acceleration, at the samples.")  # fmt: skip


def _special(found: Found) -> Table:
    """Return the table of cusps and crunodes of coupler curves."""
    key, where, unit = _place(found)
    several = f"{key}s"
    rows = [
        (point, kind, *each["position"], each[key] if kind == "cusp" else each[several][0],
         None if kind == "cusp" else each[several][1])
        for point, trail in found["trails"].items() for kind in ("cusp", "crunode") for each in trail[f"{kind}s"]
    ]  # fmt: skip
    columns = list(zip(*rows, strict=True)) if rows else [()] * 6
    shown = display_unit("m", [*columns[2], *columns[3]])
    return Table("Special points of coupler curves", [
        Column("point", columns[0]), Column("kind", columns[1]),
        Column("x", columns[2], "m", shown=shown), Column("y", columns[3], "m", shown=shown),
        Column(f"at {where}", columns[4], unit), Column("and at", columns[5], unit),
    ]).filled()  # fmt: skip


def _assemblies(found: Found) -> Table:
    """Return the table of the assemblies that were searched for: angles of all bodies at the start."""
    rows = found.get("assemblies", [])
    bodies = list(rows[0]["angles"]) if rows else []
    return Table("Assemblies", [
        Column("assembly", list(range(1, len(rows) + 1))),
        *(Column(body, [one["angles"][body] for one in rows], "rad") for body in bodies),
        Column("found", [one["found"] for one in rows]),
    ], note="With the drive at its start, that of the motion first; found: random starts that led to it.")  # fmt: skip
