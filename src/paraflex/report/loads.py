"""Loads and stresses of a run on its page: tables of the largest, charts over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from paraflex.plots.labels import text_symbol
from paraflex.plots.selection import names_of
from paraflex.report.curves import followed
from paraflex.report.page import Chart, Panel
from paraflex.report.text import NO_VALUE, number, table
from paraflex.results.loads import load_figures

_MEGA = 1e-6
# Tables with more rows than that show the beam with the largest stress of each mode.
_MOST_ROWS = 40


def load_tables(data: xr.Dataset, selected: str = "") -> list[tuple[str, str]]:
    """Titles and tables: stresses of beams, efforts of motors and drives, joints and ground; none of earlier results.

    Parameters
    ----------
    data : xarray.Dataset
    selected : str
        The mode whose motors and joints are shown; without modes empty.
    """
    modes = names_of(data, "mode") if "mode" in data.dims else [""]
    figures = {mode: load_figures(data.sel(mode=mode) if mode else data) for mode in modes}
    own = figures[selected]
    of_mode = f", mode {selected}" if len(modes) > 1 else ""
    out = []
    if stresses := _stresses(figures):
        out.append(("Stresses of beams", stresses))
    if efforts := {**own.get("motors", {}), **own.get("drives", {})}:
        out.append((f"Motors and prescribed motions{of_mode}", _efforts(efforts)))
    if own.get("joints"):
        out.append((f"Joints and ground{of_mode}", _joints(own, _travels(data))))
    return out


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
        rows, note = list(worst.values()), f"{note} Of each mode the beam with the largest stress."
    if not rows:
        return ""
    if any(one["stress_max"] is None for _, _, one in rows):
        note += " A section without outer_fibre has no bending stress."
    elif any(one["axial_stress_max"] is None for _, _, one in rows):
        note += " Coordinates of a beam without axial stress do not stretch: its stress is of bending alone."
    several = len(figures) > 1
    heads = [("mode" if several else "beam", ""), *([("beam", "")] if several else []),
             ("stress", "[MPa]"), ("safety", "factor"), ("at", "[m]"), ("time", "[s]"), ("bending", "[MPa]"),
             ("axial", "[MPa]")]  # fmt: skip
    cells = [
        (mode if several else text_symbol(body), [
            *([text_symbol(body)] if several else []),
            number(one["stress_max"], _MEGA), _factor(one), number(one["place"]), number(one["time"]),
            number(one["bending_stress_max"], _MEGA), number(one["axial_stress_max"], _MEGA),
        ])
        for mode, body, one in rows
    ]  # fmt: skip
    return table(heads, cells, caption="Largest stresses of the beams", note=note)


def _factor(one: Mapping[str, float | None]) -> str:
    factor = one["safety_factor"]
    return NO_VALUE if factor is None else f"{number(factor)}\nover strength" if factor < 1.0 else number(factor)


def _efforts(efforts: Mapping[str, Mapping[str, Any]]) -> str:
    """Units stand in the head where all rows have the same, else in the rows."""
    kinds = {(one["torque_unit"], one["speed_unit"]) for one in efforts.values()}
    same = len(kinds) == 1 and None not in min(kinds)
    units = [f"[{unit}]" for unit in kinds.pop()] if same else ["", ""]
    heads = [("motor", ""), ("torque" if units[0] == "[N m]" else "force" if same else "torque, force", units[0]),
             ("speed", units[1]), ("power", "[W]"), ("energy", "[J]")]  # fmt: skip
    rows = [
        (text_symbol(name), [
            *(number(one[f"{key}_max"]) + ("" if same else f"\n{one[f'{key}_unit'] or more}")
              for key, more in (("torque", "N m or N"), ("speed", "rad/s or m/s"))),
            number(one["power_max"]), number(one["energy"]),
        ])
        for name, one in efforts.items()
    ]  # fmt: skip
    note = "Largest magnitudes; energy: integral of the power's magnitude."
    return table(heads, rows, caption="Largest efforts of motors and prescribed motions", note=note)


def _travels(data: xr.Dataset) -> bool | None:
    """Whether joints slide: all or none of them; None if some do, and where results do not say."""
    if "joint_direction" not in data:
        return None
    known = np.isfinite(data["joint_direction"].transpose("joint", ...).values)
    slides = known.reshape(len(known), -1).any(axis=1)
    return bool(slides.all()) if slides.all() == slides.any() else None


def _joints(figures: Mapping[str, Any], travels: bool | None) -> str:
    unit = {True: "m", False: "rad", None: "rad, m"}[travels]
    speed = ", ".join(f"{one}/s" for one in unit.split(", "))
    heads = [("joint", ""), ("from", f"[{unit}]"), ("to", f"[{unit}]"), ("speed", f"[{speed}]"), ("force", "[N]"),
             ("moment", "[N m]")]  # fmt: skip
    rows = [
        (text_symbol(name), [number(one[key]) for key in ("least", "most", "speed_max", "force_max", "moment_max")])
        for name, one in figures["joints"].items()
    ]
    if frame := figures.get("frame"):
        blank = [NO_VALUE] * 3
        rows.append(("on the ground", [*blank, number(frame["force_max"]), number(frame["moment_max"])]))
    note = "Angle or travel; largest magnitudes. On the ground: the sum of all joints, about the origin."
    return table(heads, rows, caption="Motion and loads of joints", note=note)


def load_panel(data: xr.Dataset, runs: Sequence[str]) -> list[Panel]:
    """Charts over time of runs (run, time, ...): stresses, joints, drives, ground; none of earlier results."""
    charts = []
    if "stress" in data and np.isfinite(data["stress"].values).any():
        bent = data.isel(body=np.flatnonzero(np.isfinite(data["stress"].values).any(axis=(0, 1))))
        stress = (_MEGA * bent["stress"]).assign_attrs(units="MPa")
        note = "Largest magnitude along a beam, bending and axial."
        charts.append(
            followed(Chart("stresses", "Stresses of beams", "stress", choosing="beam", note=note), stress, runs)
        )
    for name, title, label in (
        ("joint_coordinate", "Joint angles and travels", "angle, travel"),
        ("joint_speed", "Joint speeds", "speed"),
    ):
        if name in data and data.sizes["joint"]:
            charts.append(followed(Chart(name.replace("_", "-"), title, label, choosing="joint"), data[name], runs))
    for name, title, label in (
        ("drive_torque", "Efforts of prescribed motions", "effort"),
        ("drive_power", "Powers of prescribed motions", "power"),
    ):
        if name in data:
            charts.append(followed(Chart(name.replace("_", "-"), title, label, choosing="motion"), data[name], runs))
    if "motor_speed" in data and data.sizes["motor"]:
        charts.append(followed(Chart("speeds", "Motor speeds", "speed", choosing="motor"), data["motor_speed"], runs))
    if "motor_power" in data and data.sizes["motor"]:
        charts.append(followed(Chart("powers", "Motor powers", "power", choosing="motor"), data["motor_power"], runs))
    if "frame_force" in data:
        note = "Of all joints and springs that are on the ground: the shaking force."
        chart = Chart("frame", "Force on the ground", "force", choosing="direction", note=note)
        charts.append(followed(chart, data["frame_force"], runs))
    return [Panel("Loads", charts)] if charts else []
