"""Report of a run without a path."""

import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from paraflex.arguments import checked_arguments
from paraflex.figures.kinematics import kinematics_of, kinematics_tables, kinematics_tiles
from paraflex.figures.reduction import reduced_runs
from paraflex.figures.run_motion import deflections_of
from paraflex.figures.selection import as_runs, names_of, samples
from paraflex.figures.tracking import Runs, most_bent, solver_table
from paraflex.findings import DONE_STATUSES
from paraflex.formatting import number, peak, quantity, text_symbol, typeset
from paraflex.results.findings import finished, validity_line, validity_summary
from paraflex.results.kinds import check_kind
from .film import NO_SHAPES, animation
from .kind_page import kind_page
from .loads import load_tables, load_tiles, loads_of_runs
from .page import Page
from .provenance import common_facts
from .text import pairs, sections, table_pairs


@checked_arguments()
def motion_page(data: xr.Dataset) -> Page:
    """Return the report of a run, a dataset from `results.motion_dataset`."""
    check_kind(data, "motion")
    data = data.transpose("time", ...)
    page, status, loads = kind_page(data), str(data["status"].item()), loads_of_runs(data)
    found = kinematics_of(data)
    # Without masses there are no forces.
    forceless = found and loads[""]["frame"]["force_max"] is None
    return replace(
        page,
        over=found.get("over", ""),
        kind="kinematics" if found else "run",
        subtitle=_subtitle(data),
        facts=common_facts(data),
        figures=_figures(data, loads),
        more=[
            *sections(kinematics_tables(data)),
            *([] if forceless else load_tables(data, loads)),
            *sections(reduced_runs(data)),
            ("Closure of loops" if found else "Integration", _table(data, brief=bool(found))),
        ],
        runs=("",),
        film=animation(data, ()),
        no_film=NO_SHAPES,
        notes=[*([] if status == "complete" else [f"{status}: {data['message'].item()}"]), *page.notes],
        remarks=list(filter(None, [validity_line({"": validity_summary(data)})])) if finished(data).all() else [],
    )


def _subtitle(data: xr.Dataset) -> str:
    """Return a text on the drives and torques that move the mechanism."""
    drives = names_of(data, "drive") if "drive" in data.dims else []
    torques = {str(name): data["applied_torque"].sel(motor=name).values for name in data["motor"].values}
    given = [text_symbol(name) for name, values in torques.items() if np.any(np.nan_to_num(values))]
    along = kinematics_of(data).get("path")
    if along:
        return f"along path {along}" + (f"; torques of {', '.join(given)}" if given else "")
    parts = [*([f"driven by {', '.join(map(text_symbol, drives))}"] if drives else []),
             *([f"given torques of {', '.join(given)}"] if given else [])]  # fmt: skip
    return "; ".join(parts) or "left to its loads"


def _table(data: xr.Dataset, *, brief: bool) -> str:
    """Return status, work and accuracy of a run; those of a driven motion are the gaps of its loops, if `brief`."""
    facts = [("status", str(data["status"].item())), *table_pairs(solver_table(Runs({"": as_runs(data)})))]
    if brief:
        return pairs([("positions", str(samples(data))), *(one for one in facts if "violation" in one[0])])
    facts += [(f"torque of {text_symbol(str(name))}", _torque(data["applied_torque"].sel(motor=name)))
              for name in data["motor"].values]  # fmt: skip
    passed = json.loads(data.attrs.get("singular_positions", "[]"))
    if passed:
        facts.append(("singular positions passed", ", ".join(f"{number(t)} s" for t in passed[:6])))
    return pairs(facts)


def _torque(values: xr.DataArray) -> str:
    """Return a constant torque, or the smallest and the largest value of a varying one, as text."""
    if "time" not in values.dims:
        return typeset(f"{number(float(values))} N m")
    return typeset(f"{number(float(values.min()))} to {number(float(values.max()))} N m")


def _figures(data: xr.Dataset, loads: Mapping[str, Mapping[str, Any]]) -> list[tuple[str, str, str]]:
    if kinematics_of(data):
        return [*kinematics_tiles(data), *load_tiles(loads)]
    tiles = load_tiles(loads)
    if body := most_bent(data):
        tiles.append(("largest deflection", quantity(peak(deflections_of(data)), "m"), text_symbol(body)))
    status = str(data["status"].item())
    last = "" if status in DONE_STATUSES else "last sample "
    end = data["time"].values[max(samples(data) - 1, 0)]
    ended = ("status", status, f"{last}t = {number(end)} s, computed in {number(data['wall_time'].item(), 3)} s")
    # The failure of a run comes before its numbers.
    return [ended, *tiles] if last else [*tiles, ended]
