"""Report of the folder of a study: its rows, and its best runs, which are repeated for the animation."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from paraflex.campaign import LostWorker, Workers, outcomes, tables_of
from paraflex.compilation import compile_kernels_for
from paraflex.designs.measure import beyond_limits, coarse_runs
from paraflex.designs.reopen import StudyFolder, open_study, rerun
from paraflex.designs.schema import DEFAULT_NAME
from paraflex.errors import InputError, ParaflexError
from paraflex.figures.designs import DesignTable, read_designs
from paraflex.figures.search import IDENTIFICATION
from paraflex.files import model_from
from paraflex.folders import check_listed
from paraflex.formatting import quantity
from paraflex.reports import Page
from paraflex.reports.choice import MOST_RUNS, Picked, best_runs
from paraflex.reports.sweep import StudyAccount, VariedParameter, sweep_page
from paraflex.results.findings import finding_lines
from paraflex.results.metrics import VALIDITY
from paraflex.writing import read_json

# Relative difference between a repeated metric and its row above which the report warns; machines round differently.
_ROW_DIFFERENCE = 1e-6


def study_page(folder: str | Path, on_progress: Callable[[str], None] | None = None) -> Page:
    """Build the report of the study in a folder, finished or not.

    The best runs are repeated, in threads, except in studies of statics.

    Parameters
    ----------
    folder : str or Path
        Folder written by `sweep`, `optimise` or `identify`.
    on_progress : callable, optional
        Function called with a short description of the current activity.

    Raises
    ------
    InputError
        Folder that holds no study of paraflex, or a study without rows.
    """
    study = open_study(folder)
    files = tables_of(study.folder)
    designs = read_designs(files) if files else None
    if designs is None or not designs.run.size:
        raise InputError("no run is done yet", field=str(folder), remedy="run the study first")
    logarithmic = frozenset(name for name, (_, _, spread) in study.ranges.items() if spread == "log")
    # Tables of earlier releases do not have the units of parameters.
    designs = replace(designs, logarithmic=logarithmic, units={**designs.units, **study.setting.parameter_units})
    found = _found(study.folder)
    picked = best_runs(designs)
    if "history" in found:
        picked = _searched(designs, found, picked)
    again = [] if study.setting.statics else picked
    if on_progress is not None and again:
        on_progress(f"simulating {len(again)} of the best designs again, to be seen in motion")
    runs, failed, differ = _again(study, designs, again)
    kind = str(found.get("kind", "sweep"))
    account = StudyAccount(
        kind=kind,
        name=kind if study.name == DEFAULT_NAME else study.name,
        mechanism=study.setting.source,
        total=study.runs,
        parameters=_parameters(study, designs),
        facts=_facts(study, found),
        runs=runs,
        failed=failed,
        found=found,
        notes=_notes(study, designs, differ),
    )
    return sweep_page(designs, picked, account)


def _again(
    study: StudyFolder, designs: DesignTable, picked: Sequence[Picked]
) -> tuple[dict[int, xr.Dataset], dict[int, str], list[int]]:
    """Repeat the picked runs; return their datasets, the reasons of failures, and the rows with different results."""
    if not picked:
        return {}, {}, []
    compile_kernels_for(model_from(dict(study.setting.data), study.setting.source).mechanism)

    def again(row: int, watch: Callable[[float], None]) -> tuple[xr.Dataset, bool] | str:
        values, path, mode = designs.values(row), str(designs.path[row]), str(designs.mode[row])
        try:
            data, metrics = rerun(study.setting, values, path, mode, watch)
        except ParaflexError as error:
            return " ".join(str(error).split())
        rows = {name: designs.metrics[name][row] for name in metrics if name in designs.metrics}
        return data, all(np.isclose(metrics[name], rows[name], rtol=_ROW_DIFFERENCE, equal_nan=True) for name in rows)

    with Workers().open() as engine:
        found = dict(outcomes(engine, again, [one.row for one in picked]))
    runs, failed, differ = {}, {}, []
    for row in (one.row for one in picked):
        outcome = found[row]
        assert not isinstance(outcome, LostWorker)  # only processes can be lost
        if isinstance(outcome, str):
            failed[row] = outcome
            continue
        runs[row], same = outcome
        differ += [] if same else [row]
    return runs, failed, differ


def _parameters(study: StudyFolder, designs: DesignTable) -> dict[str, VariedParameter]:
    out = {}
    for name, places in zip(study.setting.names, study.setting.places, strict=True):
        values = designs.parameters[name]
        low, high, spread = study.ranges.get(name, (float(values.min()), float(values.max()), study.sampling))
        out[name] = VariedParameter(tuple(".".join(map(str, place)) for place in places), low, high, spread)
    return out


def _facts(study: StudyFolder, found: Mapping[str, Any]) -> list[tuple[str, str]]:
    setting = study.setting
    integration = setting.integration
    facts = [("sampling", study.sampling)]
    if "history" in found:
        facts = [("search", str(found.get("method", "least squares")))]
        facts += [("ended", str(found["stopped"]))] if found.get("stopped") else []
    if setting.duration is not None:
        facts.append(("duration", quantity(setting.duration, "s", digits=4, padded=False)))
    for name, unit in (("method", ""), ("tolerance", "m"), ("step", "s"), ("constraints", "")):
        if (value := integration.get(name)) is not None:
            text = quantity(value, unit, digits=4, padded=False) if isinstance(value, float) else str(value)
            facts.append((name, text))
    return facts + [(name, study.versions[name]) for name in ("paraflex", "numba", "numpy") if name in study.versions]


def _notes(study: StudyFolder, designs: DesignTable, differ: Sequence[int]) -> list[str]:
    notes = []
    if not designs.complete.any():
        notes.append("No run is complete: there is nothing to draw. The reasons are given below.")
    notes += finding_lines(study.setting.verdict())
    beyond = int(np.sum(designs.metrics.get(VALIDITY, np.zeros(0)) > 1.0))
    if beyond:
        notes.append(f"{beyond_limits(beyond)}.")
    coarse = designs.reason[designs.complete & (designs.reason != "")]
    if coarse.size:
        notes.append(f"{coarse_runs(coarse.size)}; the first of them: {coarse[0]}.")
    if differ:
        why = "" if study.same_versions else " The versions of the packages are not those of the study."
        names = ", ".join(designs.label(row) for row in differ)
        notes.append(f"Simulated again, these runs differ from the table: {names}.{why}")
    return notes


def _found(folder: Path) -> Mapping[str, Any]:
    """Return the result of a search or of Sobol indices from its file; an empty mapping for a sweep."""
    for file in (folder / "result.json", folder / "indices.json"):
        if file.is_file():
            found = read_json(file)
            check_listed(file, "run the same command again")
            return found
    return {}


def _searched(designs: DesignTable, found: Mapping[str, Any], picked: Sequence[Picked]) -> list[Picked]:
    """Return the runs of a search to show: those of its best design and its start.

    For an optimisation, the best runs by single metrics are added.
    """
    out: dict[int, list[str]] = {}
    identified = found.get("kind") == IDENTIFICATION
    for key, why in (("values", "found" if identified else "objective"), ("start", "the start")):
        design = found.get(key) or {}
        if set(design) != set(designs.parameters) or not design:
            continue
        alike = designs.complete.copy()
        for name, value in design.items():
            alike &= designs.parameters[name] == value
        for row in np.flatnonzero(alike)[:3]:
            out.setdefault(int(row), []).append(why)
    for row, why in () if identified else picked:
        if row in out:
            out[row] += why
        elif len(out) < MOST_RUNS:
            out[row] = list(why)
    return [Picked(row, tuple(why)) for row, why in out.items()]
