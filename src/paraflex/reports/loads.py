"""Tables and tiles of loads and controllers in the report of a run."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import xarray as xr

from paraflex.figures.controllers import controller_table
from paraflex.figures.loads import effort_table, joint_tables, stress_table
from paraflex.figures.selection import names_of
from paraflex.formatting import number, quantity, speed_text, text_symbol
from paraflex.results.controllers import controller_figures
from paraflex.results.loads import load_figures, load_text, ranked, unbounded_joints
from paraflex.units import EFFORTS
from .text import by_run, sections, table_html

# Largest number of prescribed motions with a tile.
_MOST_TILES = 2
# Number of rows in all modes above which tables of motors or joints show only one mode.
_MOST_ROWS_OF_MODES = 200


def loads_of_runs(data: xr.Dataset) -> dict[str, dict[str, Any]]:
    """Return the results of `load_figures` by mode, "" for results without modes."""
    if "mode" not in data.dims:
        return {"": load_figures(data)}
    return {mode: load_figures(data.sel(mode=mode)) for mode in names_of(data, "mode")}


def load_tables(data: xr.Dataset, loads: Mapping[str, Mapping[str, Any]], selected: str = "") -> list[tuple[str, str]]:
    """Return titles and tables of controllers, stresses of beams, efforts of motors and drives, joints and ground.

    Results of earlier versions have none. Tables of motors and joints follow the mode selected on the page; a printed
    page has those of all modes.

    Parameters
    ----------
    data : xarray.Dataset
        Results of a run.
    loads : mapping of str to mapping
        Loads by mode; see `loads_of_runs`.
    selected : str
        Mode whose motors and joints are shown if those of all modes are too many; empty (default) without modes.
    """
    modes = list(loads)
    runs = {mode: data.sel(mode=mode) if mode else data for mode in modes}
    heads = ["mode"] if len(modes) > 1 else []
    out = sections([
        controller_table({(mode,): controller_figures(run) for mode, run in runs.items()}, heads),
        stress_table({(mode,): one for mode, one in loads.items()}, heads),
    ])  # fmt: skip
    for title, groups, html in (
        ("Motors and prescribed motions", ("motors", "drives"), lambda mode: table_html(effort_table(loads[mode]))),
        ("Joints and ground", ("joints",),
         lambda mode: "".join(table_html(one) for one in joint_tables(loads[mode]) if one)),
    ):  # fmt: skip
        if count := sum(len(one.get(group, ())) for one in loads.values() for group in groups):
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
        _, run, body, one = stresses[0]
        factor = "" if one["safety_factor"] is None else f", safety factor {number(one['safety_factor'], 3)}"
        where = f"{_of(run, body)} at {quantity(one['place'], 'm', padded=False)}, t = {number(one['time'])} s{factor}"
        tiles.append(("largest stress", load_text(one, "stress", "Pa", 3), where))
    for _, run, name, one in ranked(figures, "drives", "torque_max")[:_MOST_TILES]:
        unit = one["torque_unit"] or ""
        kind = EFFORTS.get(unit, "effort")
        of = f"{_of(run, name)}, t = {number(one['torque_time'])} s"
        if one["power_max"] is not None and one["speed_max"] is not None:
            power = quantity(one["power_max"], "W", padded=False)
            of += f"; up to {speed_text(one['speed_max'], one['speed_unit'] or '', 3)}, {power}"
        tiles.append((f"largest drive {kind}", load_text(one, "torque", unit, 3), of))
    forces = ranked(figures, "joints", "force_max")
    if unbounded := unbounded_joints(figures):
        tiles.append(("largest joint force", "unbounded", text_symbol(unbounded)))
    elif forces and forces[0][0]:
        _, run, joint, one = forces[0]
        where = f"{_of(run, joint)}, t = {number(one['force_time'])} s"
        tiles.append(("largest joint force", load_text(one, "force", "N", 3), where))
    return tiles


def _of(run: str, member: str) -> str:
    return f"{f'mode {run}: ' if run else ''}{text_symbol(member)}"
