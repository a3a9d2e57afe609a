"""Report of a study of many designs: its parameters, its results, and the best designs in motion."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from paraflex.arrays import NDArray
from paraflex.figures import search
from paraflex.figures.catalogue import page_panels
from paraflex.figures.charts import Panel
from paraflex.figures.designs import DesignTable, column_label, failure_table
from paraflex.figures.entry import prepared
from paraflex.figures.run_motion import strain_chart
from paraflex.figures.runs import thinned
from paraflex.figures.search import IDENTIFICATION
from paraflex.figures.tables import Column, Table, in_row_units
from paraflex.formatting import NO_VALUE, count, quantity
from .choice import Picked, drawn_rows
from .designs import LOWER, Designs, survey
from .film import animation
from .page import Page
from .text import sections, table_html

_NO_RUN = "None of the best designs was simulated again, so there is no animation."
# Largest number of columns in the table of best designs; the study's table has all.
_MOST_COLUMNS = 12
_SHOWN_VARIABLES = (
    "end_effector", "end_effector_desired", "torque", "tip_transverse", "strain_energy", "shape", "shape_base",
    "joint_position", "joint_base", "joint_direction", "joint_direction_base", "spring_position", "point_station",
    "spring_station", "joint_rail", "gear_radius", "load_station", "load_force", "load_torque", "stress",
    "joint_coordinate", "joint_speed", "drive_torque", "drive_power", "angle",
)  # fmt: skip
# Charts of the runs in motion, along a path and without one.
_ALONG_PATH = ("tracking_distance", "end_effector_path", "motor_torques", "link_deflections")
_SHOWN_FIGURES = ("beam_stresses", "joint_motions", "drive_efforts")
_STATIONS = ("point_station", "spring_station", "joint_rail", "load_station")
_DIFFERING = (*_STATIONS, "gear_radius")
_COORDINATES = (
    "time", "axis", "body", "motor", "joint", "end", "point", "spring", "station_body", "joint_kind", "joint_grounded",
    "joint_driven", "gear", "gear_joint", "drive", "load",
)  # fmt: skip


class VariedParameter(NamedTuple):
    """Varied parameter: fields of the mechanism's file, smallest and largest value, distribution."""

    fields: tuple[str, ...]
    low: float
    high: float
    spread: str


@dataclass(frozen=True)
class StudyAccount:
    """Content of a study's report in addition to its rows.

    Attributes
    ----------
    kind : str
        Kind of study: "sweep", "optimisation", "identification" or "indices".
    name, mechanism : str
        Names of the study and of the mechanism.
    total : int or None
        Number of runs of the whole study; None if it is not known.
    parameters : mapping of str to VariedParameter
        Varied parameters by name.
    facts : sequence of (str, str)
        Names and values of the settings of the study.
    runs : mapping of int to Dataset
        Repeated runs, by row.
    failed : mapping of int to str
        Reasons why other rows could not be repeated.
    found : mapping of str to object
        Result of a search or of Sobol indices as plain numbers; empty for a sweep.
    notes : sequence of str
        Notices at the top of the page.
    """

    kind: str
    name: str
    mechanism: str
    total: int | None
    parameters: Mapping[str, VariedParameter]
    facts: Sequence[tuple[str, str]] = ()
    runs: Mapping[int, xr.Dataset] = field(default_factory=dict)
    failed: Mapping[int, str] = field(default_factory=dict)
    found: Mapping[str, Any] = field(default_factory=dict)
    notes: Sequence[str] = ()

    @property
    def seeks_least(self) -> bool:
        """Whether smaller metrics are better, as in all studies but an identification, which has targets."""
        return self.kind != IDENTIFICATION


def sweep_page(designs: DesignTable, picked: Sequence[Picked], account: StudyAccount) -> Page:
    """Return the report of a study of many designs.

    Parameters
    ----------
    designs : DesignTable
        Table of all runs, from `plots.designs.read_designs`.
    picked : sequence of Picked
        Rows of the table of best designs, from `choice.best_runs`.
    account : StudyAccount
        Further content of the report.
    """
    shown, others = _of_one_kind({row: account.runs[row] for row, _ in picked if row in account.runs})
    labels = [designs.label(row) for row in shown]
    data = side_by_side(list(shown.values()), labels) if shown else None
    rows = drawn_rows(designs, [one.row for one in picked])
    drawn = Designs(designs, rows, {row: k for k, row in enumerate(shown)})
    indices = [search.index_table(account.found)] if "indices" in account.found else []
    first = [chart for panel in page_panels(account.kind, account.found) for chart in panel.charts]
    few = None if data is None else thinned(data)
    missing = dict(account.failed) | dict.fromkeys(
        others, "it has other bodies, joints, motors or springs than the first"
    )
    not_shown = [f"{designs.label(row)} is not shown in motion: {reason}" for row, reason in missing.items()]
    return Page(
        title=account.name,
        kind=account.kind,
        subtitle=_subtitle(designs, account),
        facts=account.facts,
        figures=_tiles(designs, account),
        summary=sections(search.tables(account.found, designs.units)),
        survey=survey(drawn, first, seeks_least=account.seeks_least) if rows.size else [],
        designs=drawn if rows.size else None,
        tables=sections([_best_table(designs, picked, list(shown), account)]),
        more=[*sections([*indices, _parameter_table(designs, account)]), *_trouble(designs)],
        panels=[] if few is None else _panels(few, account),
        time=[] if few is None else few["time"].values,
        runs=labels,
        selecting="design",
        film=None if data is None else animation(data),
        no_film=_NO_RUN,
        notes=[*account.notes, *_unfinished(designs, account), *not_shown],
    )


def side_by_side(runs: Sequence[xr.Dataset], labels: Sequence[str]) -> xr.Dataset:
    """Combine runs of one mechanism with different parameters into a dataset over the longest time, padded with NaN."""
    longest = max((one["time"].values for one in runs), key=lambda time: time[-1])
    parts = []
    for one in _with_as_many_stations(runs):
        kept = one[[name for name in _SHOWN_VARIABLES if name in one]].isel(mode=0, missing_dims="ignore")
        kept = kept.drop_vars([name for name in kept.coords if name not in _COORDINATES])
        same = np.array_equal(one["time"].values, longest)
        parts.append(kept if same else kept.interp(time=longest))
    first = parts[0]
    # Coordinates are taken from the first run; common ones are equal.
    data = xr.concat(parts, dim="mode", coords="minimal", compat="override", join="override", combine_attrs="override")
    # The labels are whole names of runs.
    return data.assign_coords(mode=("mode", list(labels), {"noun": ""})).assign_attrs(runs[0].attrs | first.attrs)


def _of_one_kind(runs: Mapping[int, xr.Dataset]) -> tuple[dict[int, xr.Dataset], list[int]]:
    """Return the runs with the bodies, joints, motors and springs of the first, and the rows of the others."""
    kinds = {row: _kind(one) for row, one in runs.items()}
    first = next(iter(kinds.values()), None)
    return {row: one for row, one in runs.items() if kinds[row] == first}, [r for r in runs if kinds[r] != first]


def _kind(run: xr.Dataset) -> tuple:
    """Return the structure that runs must share to be drawn together; numbers of stations may differ."""
    names = [tuple(map(str, run[dim].values)) for dim in ("body", "joint", "motor")]
    springs = run["spring_position"].shape[1:] if "spring_position" in run else ()
    return (*names, tuple(dict.fromkeys(map(str, _station_bodies(run)))), springs)


def _with_as_many_stations(runs: Sequence[xr.Dataset]) -> list[xr.Dataset]:
    """Return runs in which every body has the largest number of stations; stations are repeated, none is moved.

    A parameter that moves a point along a beam changes the number of stations between its points.
    """
    # Station numbers differ from run to run, and so do the radii of wheels.
    runs = [run.reset_coords([name for name in _DIFFERING if name in run.coords]) for run in runs]
    names = [_station_bodies(run) for run in runs]
    if all(np.array_equal(each, names[0]) for each in names):
        return runs
    most = {name: max(int(np.sum(each == name)) for each in names) for name in dict.fromkeys(names[0])}
    return [_taken(run, _spread(each, most)) for run, each in zip(runs, names, strict=True)]


def _taken(run: xr.Dataset, stations: NDArray[np.intp]) -> xr.Dataset:
    """Return a run with the given stations, ascending; indices of points, springs, rails and loads are updated."""
    moved = {name: run[name].copy(data=np.where(run[name] < 0, -1, np.searchsorted(stations, run[name])))
             for name in _STATIONS if name in run}  # fmt: skip
    return run.isel(station=stations).assign(moved)


def _spread(names: NDArray[np.str_], most: Mapping[str, int]) -> NDArray[np.intp]:
    """Return station indices, each at least once, such that every body has a given number of them."""
    own = {name: np.flatnonzero(names == name) for name in most}
    return np.concatenate([
        places[np.rint(np.linspace(0, places.size - 1, most[name])).astype(np.intp)] for name, places in own.items()
    ])  # fmt: skip


def _station_bodies(run: xr.Dataset) -> NDArray[np.str_]:
    return run["station_body"].values if "station_body" in run else np.zeros(0, dtype=str)


def _subtitle(designs: DesignTable, account: StudyAccount) -> str:
    number_of_designs = np.unique(designs.design).size
    modes = list(dict.fromkeys(designs.mode.tolist()))
    paths = list(dict.fromkeys(designs.path.tolist()))
    parts = [account.mechanism, f"{count(number_of_designs)} designs" if number_of_designs != 1 else "one design"]
    if any(modes):
        parts.append(f"modes {', '.join(modes)}" if len(modes) > 1 else f"mode {modes[0]}")
        parts.append(f"paths {', '.join(paths)}" if len(paths) > 1 else f"path “{paths[0]}”")
    return ", ".join(parts)


def _tiles(designs: DesignTable, account: StudyAccount) -> list[tuple[str, str, str]]:
    counts = Counter(designs.status.tolist())
    done = sum(counts.values())
    rest = [f"{count(number)} {status}" for status, number in sorted(counts.items()) if status != "complete"]
    of = f"of {count(account.total)} runs" if account.total is not None else f"of {count(done)} runs"
    tiles = [("complete", f"{count(counts.get('complete', 0))}", ", ".join([of, *rest]))]
    if account.found.get("values"):
        return [*search.tiles(account.found, designs.units), *tiles]
    for name in designs.judged[:3]:
        values = designs.metrics[name]
        known = np.flatnonzero(designs.complete & np.isfinite(values))
        if known.size:
            row = int(known[np.argmin(values[known])])
            value = quantity(values[row], designs.units.get(name, ""), designs.axis(name).shown, digits=4, padded=False)
            tiles.append((column_label(name), value, f"least, of {designs.label(row)}"))
    return tiles


def _best_table(designs: DesignTable, picked: Sequence[Picked], shown: Sequence[int], account: StudyAccount) -> Table:
    """Return the table of the best designs: parameters, metrics, and the metrics in which they are best."""
    title, why, note = ("Best designs", "best in", LOWER) if account.seeks_least else ("Designs shown", "which", "")
    rows = [row for row, _ in picked]
    labels = list(map(designs.label, rows))
    columns = [Column("design", labels), Column(why, ["; ".join(reasons) for _, reasons in picked])]
    for name in [*designs.varied, *designs.judged][:_MOST_COLUMNS]:
        axis, values = designs.axis(name), designs.column(name)
        columns.append(Column(axis.name, [float(values[row]) for row in rows], axis.unit, shown=axis.shown))
    if shown:
        note = f"{note} A selected row is shown in motion below and ringed in the charts.".lstrip()
    return Table(title, columns, note, {designs.label(row): k for k, row in enumerate(shown)}, sortable=True)


def _parameter_table(designs: DesignTable, account: StudyAccount) -> Table:
    given = account.parameters.values()
    words = {"log": "in their logarithm", "values": "as listed", "linear": "evenly"}
    fields = ["\n".join([one.fields[0], ", ".join(one.fields[1:])]) if one.fields else NO_VALUE for one in given]
    ends = [Column("from", [one.low for one in given]), Column("to", [one.high for one in given])]
    return Table("What was varied", [
        Column("parameter", list(account.parameters)), Column("field", fields),
        *in_row_units(ends, [designs.units.get(name, "") for name in account.parameters]),
        Column("spread", [words.get(one.spread, one.spread) for one in given]),
    ])  # fmt: skip


def _trouble(designs: DesignTable) -> list[tuple[str, str]]:
    table = failure_table(designs)
    return [(table.title, f'<div class="long">{table_html(table)}</div>')] if table else []


def _unfinished(designs: DesignTable, account: StudyAccount) -> list[str]:
    done = designs.run.size
    if account.total is None or done >= account.total:
        return []
    return [f"The study is not finished: these are {count(done)} of {count(account.total)} runs."]


def _panels(data: xr.Dataset, account: StudyAccount) -> list[Panel]:
    """Return the charts over time of the runs shown in motion."""
    title = f"The {'best ' if account.seeks_least else ''}designs in motion"
    kind, names = ("tracking", _ALONG_PATH) if "end_effector_desired" in data else ("motion", _SHOWN_FIGURES)
    charts = [chart for panel in page_panels(kind, data, names) for chart in panel.charts]
    return [Panel(title, [*charts, strain_chart(prepared(data))])]
