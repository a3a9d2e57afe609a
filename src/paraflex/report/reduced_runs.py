"""Section of a report that compares runs with reduced flexible coordinates to the runs with all of them."""

from __future__ import annotations

import xarray as xr

from paraflex.figures.selection import names_of
from paraflex.formatting import display_unit
from paraflex.report.text import number, table
from paraflex.results.following import HEADLINE, ErrorSpan
from paraflex.results.reduced_runs import COUNTS, DISTANCE, FULL


def reduction_tables(data: xr.Dataset) -> list[tuple[str, str]]:
    """Return the table of errors and speed-ups of reduced runs; empty for runs with all flexible coordinates."""
    if DISTANCE not in data:
        return []
    along = "mode" in data.dims
    runs = data if along else data.expand_dims("mode")
    unit = display_unit("m", runs[DISTANCE].values)
    heads = [("mode" if along else "", "")]
    columns = []
    if along:
        name = HEADLINE[ErrorSpan(data.attrs["error"])]
        exact = runs[f"{FULL}{name}"].values
        shown = display_unit("m", exact)
        heads += [("error", f"full run [{shown.name}]"), ("off", f"[{unit.name}]")]
        columns += [shown.factor * exact, unit.factor * (runs[name].values - exact)]
    heads += [("distance", f"largest [{unit.name}]"), ("time", "of the full run")]
    columns += [unit.factor * runs[DISTANCE].values, runs["wall_time"].values / runs[f"{FULL}wall_time"].values]
    names = names_of(runs, "mode") if along else ["run"]
    rows = [(name, [number(float(cell)) for cell in cells]) for name, *cells in zip(names, *columns, strict=True)]
    kept, whole = ({name: data.attrs[prefix + name] for name in COUNTS} for prefix in ("", FULL))
    whose = "the end-effector" if along else "a named point"
    note = (
        f"{kept['flexible_coordinates']} of {whole['flexible_coordinates']} flexible coordinates, {kept['states']} of "
        f"{whole['states']} states. Distance: of {whose} from its place with all of them."
    )
    selects = {name: r for r, name in enumerate(names)} if along else None
    page = table(heads, rows, caption="Beside runs with all flexible coordinates", note=note, runs=selects)
    return [("Reduced bodies", page)]
