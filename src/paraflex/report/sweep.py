"""Report of a study of many designs: its parameters, its results, and the best designs in motion."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from paraflex.figures.catalogue import page_panels
from paraflex.figures.runs import thinned
from paraflex.plots.designs import DesignTable
from paraflex.report.choice import Picked, drawn_rows
from paraflex.report.curves import (
    ERRORS,
    STRAIN,
    TIPS,
    bending,
    compared,
    errors,
    followed,
    plane_path,
    torque_chart,
)
from paraflex.report.designs import columns, metric_name, reasons, shown_unit
from paraflex.report.film import animation
from paraflex.report.page import Page, Panel
from paraflex.report.search import IDENTIFICATION, search_tables, search_tiles
from paraflex.report.survey import LOWER, Step, drawn_designs, survey
from paraflex.report.text import NO_VALUE, count, number, table

_NO_RUN = "None of the best designs was simulated again, so there is no animation."
# Largest number of columns in the table of best designs; the study's table has all.
_MOST_COLUMNS = 12
_SHOWN_VARIABLES = (
    "end_effector", "end_effector_desired", "torque", "tip_transverse", "strain_energy", "shape", "shape_base",
    "joint_position", "joint_base", "joint_direction", "joint_direction_base", "spring_position", "point_station",
    "spring_station", "joint_rail", "gear_radius", "load_station", "load_force", "load_torque", "stress",
    "joint_coordinate", "joint_speed", "drive_torque", "drive_power", "angle",
)  # fmt: skip
_SHOWN_FIGURES = ("beam_stresses", "joint_motions", "drive_efforts")
_STATIONS = ("point_station", "spring_station", "joint_rail", "load_station")
_DIFFERING = (*_STATIONS, "gear_radius")
_COORDINATES = (
    "time", "axis", "body", "motor", "joint", "end", "point", "spring", "station_body", "joint_kind", "joint_grounded",
    "joint_driven", "gear", "gear_joint", "drive", "load",
)  # fmt: skip


class VariedParameter(NamedTuple):
    """Varied parameter: fields of the mechanism's file, unit, smallest and largest value, distribution."""

    fields: tuple[str, ...]
    unit: str
    low: float
    high: float
    spread: str


@dataclass(frozen=True)
class StudyAccount:
    """Content of a study's report in addition to its rows.

    Attributes
    ----------
    kind : str
        Kind of study: "sweep", "optimisation" or "identification".
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
        Content of a search's `result.json`; empty for a sweep.
    history : sequence of Step
        Evaluated designs of a search, in order.
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
    history: Sequence[Step] = ()
    notes: Sequence[str] = ()

    @property
    def units(self) -> dict[str, str]:
        """Units of the parameters."""
        return {name: one.unit for name, one in self.parameters.items()}

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
    logarithmic = [name for name, one in account.parameters.items() if one.spread == "log"]
    drawn = columns(designs, rows, account.units, logarithmic)
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
        summary=search_tables(account.found, account.units, designs.units),
        survey=survey(designs, rows, drawn, account.history, seeks_least=account.seeks_least) if rows.size else [],
        designs=drawn_designs(designs, rows, drawn, {row: k for k, row in enumerate(shown)}) if rows.size else None,
        tables=[_best_table(designs, picked, list(shown), account)] if picked else [],
        more=[("What was varied", _parameter_table(account)), *_trouble(designs)],
        panels=[] if few is None else _panels(few, labels, account),
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
        return [*search_tiles(account.found, account.units, designs.units), *tiles]
    for name in designs.judged[:3]:
        values = designs.metrics[name]
        known = np.flatnonzero(designs.complete & np.isfinite(values))
        if known.size:
            row = int(known[np.argmin(values[known])])
            unit, factor = shown_unit(designs.units.get(name, ""), values[known])
            value = f"{number(values[row], factor)} {unit}".rstrip()
            tiles.append((metric_name(name), value, f"least, of {designs.label(row)}"))
    return tiles


def _best_table(
    designs: DesignTable, picked: Sequence[Picked], shown: Sequence[int], account: StudyAccount
) -> tuple[str, str]:
    """Return title and table of the best designs: parameters, metrics, and the metrics in which they are best."""
    title, why_head, note = (
        ("Best designs", "best in", LOWER) if account.seeks_least else ("Designs shown", "which", "")
    )
    named = [*((name, True) for name in designs.varied), *((name, False) for name in designs.judged)]
    heads, cells, keys = [("design", "")], {}, {}
    names = {row: designs.label(row) for row, _ in picked}
    for row, why in picked:
        cells[row], keys[row] = ["; ".join(why)], [int(designs.design[row]), None]
    heads.append((why_head, ""))
    for name, parameter in named[:_MOST_COLUMNS]:
        values = (designs.parameters if parameter else designs.metrics)[name]
        unit, factor = shown_unit((account.units if parameter else designs.units).get(name, ""), values)
        heads.append((name.replace("_", " ") if parameter else metric_name(name), f"[{unit}]" if unit else ""))
        for row, _ in picked:
            cells[row].append(number(values[row], factor))
            keys[row].append(float(values[row]))
    selects = {names[row]: k for k, row in enumerate(shown)}
    if shown:
        note = f"{note} A selected row is shown in motion below and ringed in the charts.".lstrip()
    return title, table(
        heads, [(names[row], cells[row]) for row, _ in picked], caption=title, note=note, runs=selects,
        keys={names[row]: keys[row] for row, _ in picked},
    )  # fmt: skip


def _parameter_table(account: StudyAccount) -> str:
    rows = []
    for name, one in account.parameters.items():
        unit, factor = shown_unit(one.unit, np.array([one.low, one.high]))
        spread = {"log": "in their logarithm", "values": "as listed", "linear": "evenly"}.get(one.spread, one.spread)
        rows.append((name, ["\n".join([one.fields[0], ", ".join(one.fields[1:])]) if one.fields else NO_VALUE,
                            number(one.low, factor), number(one.high, factor), unit or NO_VALUE, spread]))  # fmt: skip
    heads = [("parameter", ""), ("field", ""), ("from", ""), ("to", ""), ("unit", ""), ("spread", "")]
    return table(heads, rows, caption="What was varied")


def _trouble(designs: DesignTable) -> list[tuple[str, str]]:
    """Return the table of reasons why runs are not complete, with similar ones grouped."""
    found = reasons(designs)
    if not found:
        return []
    rows = [(status or NO_VALUE, [count(number), reason]) for status, reason, number in found]
    heads = [("status", ""), ("runs", ""), ("reason", "one of those alike")]
    return [("Runs that are not complete", f'<div class="long">{table(heads, rows, caption="Reasons")}</div>')]


def _unfinished(designs: DesignTable, account: StudyAccount) -> list[str]:
    done = designs.run.size
    if account.total is None or done >= account.total:
        return []
    return [f"The study is not finished: these are {count(done)} of {count(account.total)} runs."]


def _panels(data: xr.Dataset, runs: list[str], account: StudyAccount) -> list[Panel]:
    """Return the charts over time of the runs shown in motion."""
    data = data.transpose("mode", "time", ...)
    title = f"The {'best ' if account.seeks_least else ''}designs in motion"
    if "end_effector_desired" not in data:
        loads = [chart for panel in page_panels("motion", data, _SHOWN_FIGURES) for chart in panel.charts]
        return [Panel(title, [*loads, compared(STRAIN, data["strain_energy"], runs)])]
    charts = [
        compared(ERRORS, errors(data), runs),
        plane_path(data, runs, common=False),
        followed(torque_chart(data), data["torque"], runs, selecting="design"),
    ]
    if bending(data).size:
        charts.append(followed(TIPS, bending(data), runs, selecting="design"))
    charts.append(compared(STRAIN, data["strain_energy"], runs))
    return [Panel(title, charts)]
