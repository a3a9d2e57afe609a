"""Loads and stresses in the report of a run: tables of the largest values, and charts over time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from paraflex.figures.selection import names_of
from paraflex.formatting import text_symbol
from paraflex.report.curves import followed
from paraflex.report.page import Chart, Panel
from paraflex.report.text import NO_VALUE, by_run, number, table
from paraflex.results.loads import error_text, load_figures, ranked, sliding_joints
from paraflex.results.sensors import sensor_groups
from paraflex.units import STRESS, speed_text

# Largest number of prescribed motions with a tile.
_MOST_TILES = 2
# Number of rows above which the table of stresses shows only the beam with the largest stress of each mode.
_MOST_ROWS = 40
# Number of rows in all modes above which tables of motors or joints show only one mode.
_MOST_ROWS_OF_MODES = 200


def load_tables(data: xr.Dataset, selected: str = "") -> list[tuple[str, str]]:
    """Return titles and tables of stresses of beams, efforts of motors and drives, loads of joints and ground.

    Results of earlier versions have none. Tables of motors and joints follow the mode selected on the page; a printed
    page has those of all modes.

    Parameters
    ----------
    data : xarray.Dataset
        Results of a run.
    selected : str
        Mode whose motors and joints are shown if those of all modes are too many; empty (default) without modes.
    """
    modes = names_of(data, "mode") if "mode" in data.dims else [""]
    figures = {mode: load_figures(data.sel(mode=mode) if mode else data) for mode in modes}
    out = []
    if stresses := _stresses(figures):
        out.append(("Stresses of beams", stresses))
    efforts = {mode: {**one.get("motors", {}), **one.get("drives", {})} for mode, one in figures.items()}
    joints = {mode: one.get("joints", {}) for mode, one in figures.items()}
    for title, rows, html in (
        ("Motors and prescribed motions", efforts, lambda mode: _efforts(efforts[mode])),
        ("Joints and ground", joints, lambda mode: _joints(figures[mode])),
    ):
        if count := sum(map(len, rows.values())):
            out.append((title, _of_modes(modes, selected, count, html)))
    return out


def _of_modes(modes: Sequence[str], selected: str, rows: int, html: Callable[[str], str]) -> str:
    """Return the tables of all modes, or that of the selected one if there are too many rows."""
    if len(modes) == 1:
        return html(modes[0])
    if rows <= _MOST_ROWS_OF_MODES:
        return by_run([(f"mode {mode}", html(mode)) for mode in modes])
    note = f"Mode {selected} only. All {len(modes)} modes have {rows} rows: they are in summary.json."
    return f'{html(selected)}<p class="note">{note}</p>'


def load_tiles(figures: Mapping[str, Mapping[str, Any]]) -> list[tuple[str, str, str]]:
    """Return the tiles of the main loads: largest stress, efforts of prescribed motions, largest joint force."""
    tiles = []
    if stresses := ranked(figures, "beams", "stress_max"):
        most, run, body, one = stresses[0]
        factor = "" if one["safety_factor"] is None else f", safety factor {number(one['safety_factor'])}"
        where = f"{_whose(run)}{text_symbol(body)} at {number(one['place'])} m, t = {one['time']:.4g} s{factor}"
        tiles.append(
            ("largest stress", f"{_stress(most)}{error_text(one, 'stress', STRESS.factor)} {STRESS.name}", where)
        )
    for most, run, name, one in ranked(figures, "drives", "torque_max")[:_MOST_TILES]:
        unit = one["torque_unit"] or ""
        kind = {"N m": "torque", "N": "force"}.get(unit, "effort")
        of = f"{_whose(run)}{text_symbol(name)}, t = {one['torque_time']:.4g} s"
        if one["power_max"] is not None and one["speed_max"] is not None:
            speed = speed_text(one["speed_max"], one["speed_unit"] or "", ".3g")
            of += f"; up to {speed}, {number(one['power_max'])} W"
        tiles.append((f"largest drive {kind}", f"{number(most)}{error_text(one, 'torque')} {unit}".rstrip(), of))
    forces = ranked(figures, "joints", "force_max")
    if forces and forces[0][0]:
        most, run, joint, one = forces[0]
        where = f"{_whose(run)}{text_symbol(joint)}, t = {one['force_time']:.4g} s"
        tiles.append(("largest joint force", f"{number(most)}{error_text(one, 'force')} N", where))
    return tiles


def _whose(run: str) -> str:
    return f"mode {run}: " if run else ""


def _stresses(figures: Mapping[str, Mapping[str, Any]]) -> str:
    rows = [(mode, body, one) for mode, each in figures.items() for body, one in each.get("beams", {}).items()]
    note = (
        "Stress: bending and axial together, with place and time of the largest. Bending, in the outermost fibre, and "
        "axial are each largest at places and times of their own, and do not add up to it."
    )
    if len(rows) > _MOST_ROWS:
        worst: dict[str, tuple[str, str, Any]] = {}
        for row in rows:
            if row[0] not in worst or (row[2]["stress_max"] or 0.0) > (worst[row[0]][2]["stress_max"] or 0.0):
                worst[row[0]] = row
        rows, note = list(worst.values()), f"{note} For each mode, the beam with the largest stress."
    if not rows:
        return ""
    if any(one["stress_max"] is None for _, _, one in rows):
        note += " A section without outer_fibre has no bending stress."
    elif any(one["axial_stress_max"] is None for _, _, one in rows):
        note += " Coordinates of a beam without axial stress do not stretch: its stress is of bending alone."
    several = len(figures) > 1
    strengths = any(one["safety_factor"] is not None for _, _, one in rows)
    unit = f"[{STRESS.name}]"
    heads = [("mode" if several else "beam", ""), *([("beam", "")] if several else []),
             ("stress", unit), *([("safety", "factor")] if strengths else []), ("at", "[m]"), ("time", "[s]"),
             ("bending", unit), ("axial", unit)]  # fmt: skip
    cells = [
        (mode if several else text_symbol(body), [
            *([text_symbol(body)] if several else []),
            _stress(one["stress_max"]), *([_factor(one)] if strengths else []), number(one["place"]),
            number(one["time"]), _stress(one["bending_stress_max"]), _stress(one["axial_stress_max"]),
        ])
        for mode, body, one in rows
    ]  # fmt: skip
    return table(heads, cells, caption="Largest stresses of the beams", note=note)


def _stress(value: float | None) -> str:
    return number(value, STRESS.factor)


def _factor(one: Mapping[str, float | None]) -> str:
    factor = one["safety_factor"]
    return NO_VALUE if factor is None else f"{number(factor)}\nover strength" if factor < 1.0 else number(factor)


def _efforts(efforts: Mapping[str, Mapping[str, Any]]) -> str:
    """Return the table of efforts; units are in the head if they are common to all rows, else in the rows."""
    kinds = {(one["torque_unit"], one["speed_unit"]) for one in efforts.values()}
    same = len(kinds) == 1 and None not in min(kinds)
    units = [f"[{unit}]" for unit in kinds.pop()] if same else ["", ""]
    heads = [("motor or drive", ""),
             ("torque" if units[0] == "[N m]" else "force" if same else "torque, force", units[0]), ("at", "[s]"),
             ("speed", units[1]), ("at", "[s]"), ("power", "[W]"), ("at", "[s]"), ("energy", "[J]")]  # fmt: skip
    rows = [
        (text_symbol(name), [
            *(cell for key, more in (("torque", "N m or N"), ("speed", "rad/s or m/s"))
              for cell in (number(one[f"{key}_max"]) + ("" if same else f"\n{one[f'{key}_unit'] or more}"),
                           number(one[f"{key}_time"]))),
            number(one["power_max"]), number(one["power_time"]), number(one["energy"]),
        ])
        for name, one in efforts.items()
    ]  # fmt: skip
    note = "Largest magnitudes and their times; energy: integral of the power's magnitude."
    return table(heads, rows, caption="Largest efforts of motors and prescribed motions", note=note)


def _joints(figures: Mapping[str, Any]) -> str:
    """Return the tables of rotating joints, of sliding joints, and of the loads on the ground.

    Angles and travels have separate tables because their units differ.
    """
    joints = figures.get("joints", {})
    wide = {key: max((one[key] or 0.0 for one in joints.values()), default=0.0) for key in ("force_max", "moment_max")}
    out = ""
    for unit, what in (("rad", "Joints that turn"), ("m", "Joints that slide")):
        own = {name: one for name, one in joints.items() if one["unit"] == unit}
        if own:
            out += _joints_of(own, unit, what, wide)
    if frame := figures.get("frame"):
        heads = [("", ""), ("force", "[N]"), ("at", "[s]"), ("moment", "[N m]"), ("at", "[s]")]
        cells = [number(frame[key]) for key in ("force_max", "force_time", "moment_max", "moment_time")]
        note = "The sum of all joints, about the origin."
        out += table(heads, [("on the ground", cells)], caption="Loads on the ground", note=note)
    return out


def _joints_of(joints: Mapping[str, Mapping[str, Any]], unit: str, what: str, wide: Mapping[str, float]) -> str:
    coordinate = "angle" if unit == "rad" else "travel"
    heads = [("joint", ""), ("from", f"[{unit}]"), ("to", f"[{unit}]"), ("speed", f"[{unit}/s]"), ("at", "[s]"),
             ("force", "[N]"), ("at", "[s]"), ("moment", "[N m]"), ("at", "[s]")]  # fmt: skip
    rows = []
    for name, one in joints.items():
        cells = [number(one[key]) for key in ("least", "most", "speed_max", "speed_time")]
        for key in ("force", "moment"):
            value = number(one[f"{key}_max"], beside=wide[f"{key}_max"]) + error_text(one, key)
            cells += [value, NO_VALUE if value in ("0", NO_VALUE) else number(one[f"{key}_time"])]
        rows.append((text_symbol(name), cells))
    note = f"From and to: {coordinate}; largest magnitudes and their times."
    if any(error_text(one, key) for one in joints.values() for key in ("force", "moment")):
        note += " After ±: how far a load may be off by errors of integration, where that is more than 1 %."
    return table(heads, rows, caption=what, note=f"{what}. {note}")


def load_panel(data: xr.Dataset, runs: Sequence[str], selecting: str = "mode") -> list[Panel]:
    """Return charts over time of runs (run, time, ...): stresses, joints, drives, motors, ground and sensors.

    Results of earlier versions have none. `selecting` is the noun for a run on the page.
    """
    charts: list[Chart] = []

    def add(chart: Chart, values: xr.DataArray) -> None:
        charts.append(followed(chart, values, runs, selecting=selecting))

    if "stress" in data and np.isfinite(data["stress"].values).any():
        bent = data.isel(body=np.flatnonzero(np.isfinite(data["stress"].values).any(axis=(0, 1))))
        stress = (STRESS.factor * bent["stress"]).assign_attrs(units=STRESS.name)
        note = "Largest magnitude along a beam, bending and axial."
        add(Chart("stresses", "Stresses of beams", "stress", choosing="beam", note=note), stress)
    if "joint_coordinate" in data:
        for chart, values in _joint_charts(data):
            add(chart, values)
    for name, title, label in (
        ("drive_torque", "Efforts of prescribed motions", "effort"),
        ("drive_power", "Powers of prescribed motions", "power"),
    ):
        if name in data:
            add(Chart(name.replace("_", "-"), title, label, choosing="motion"), data[name])
    if "motor_speed" in data and data.sizes["motor"]:
        add(Chart("speeds", "Motor speeds", "speed", choosing="motor"), data["motor_speed"])
    if "motor_power" in data and data.sizes["motor"]:
        add(Chart("powers", "Motor powers", "power", choosing="motor"), data["motor_power"])
    if "frame_force" in data:
        note = "Sum over all joints and springs on the ground: the shaking force."
        add(Chart("frame", "Force on the ground", "force", choosing="direction", note=note), data["frame_force"])
    loads = [Panel("Loads", charts)] if charts else []
    return [*loads, *_sensor_panel(data, runs)]


def _sensor_panel(data: xr.Dataset, runs: Sequence[str]) -> list[Panel]:
    """Return charts of sensor readings, grouped by unit; empty for results without sensors."""
    charts = [
        followed(Chart(f"sensors-{k}", f"Sensors: {group.quantity}", group.quantity, choosing="sensor"),
                 group.readings, runs)
        for k, group in enumerate(sensor_groups(data))
    ]  # fmt: skip
    return [Panel("Sensors", charts)] if charts else []


def _joint_charts(data: xr.Dataset) -> Iterator[tuple[Chart, xr.DataArray]]:
    """Yield charts with their values: angles and rates of rotating joints, travels and speeds of sliding joints."""
    slides = sliding_joints(data)
    for own, kind, variable, title, unit in (
        (~slides, "angle", "joint_coordinate", "Joint angles", "rad"),
        (slides, "travel", "joint_coordinate", "Joint travels", "m"),
        (~slides, "rate", "joint_speed", "Angular velocities of joints", "rad/s"),
        (slides, "speed", "joint_speed", "Sliding speeds of joints", "m/s"),
    ):
        if own.any():
            values = data[variable].isel(joint=np.flatnonzero(own)).assign_attrs(units=unit)
            label = "angular velocity" if kind == "rate" else kind
            yield Chart(f"joint-{kind}", title, label, choosing="joint"), values
