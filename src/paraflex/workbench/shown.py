"""Results of runs for the page: the motion, stresses for its colours, charts, and the main numbers."""

from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from paraflex.arrays import Array
from paraflex.figures.selection import default_mode, names_of
from paraflex.findings import DONE_STATUSES
from paraflex.reports.film import animation, frames_of
from paraflex.reports.kind_page import kind_page
from paraflex.reports.packing import deflated
from paraflex.reports.page import Page, page_data
from paraflex.results.beam_stresses import stresses_of
from paraflex.results.findings import finding_lines, verdict_of
from paraflex.results.following import below_tolerance_line, headline
from paraflex.results.numbers import finite_or_none, largest
from .computing import Computed

# Largest number of frames; byte of the largest stress, and that of an unknown one.
FRAMES, _STEPS, _UNKNOWN = 181, 254, 255


def shown(found: Computed, *, charts: bool = True) -> dict[str, Any]:
    """Return runs as plain values for the page.

    Parameters
    ----------
    found : Computed
        Runs of a model.
    charts : bool
        Whether the page has charts, which take a quarter of the time.

    Returns
    -------
    dict
        `modes`, their names ("" for a run without modes); `page`, the data of a report's page
        (`reports.page.page_data`), with charts, and the film in at most 181 frames; `stress` of the film's stations;
        `numbers` and `errors` of each mode; `findings`, one line each, and `verdict`, their level.

    Raises
    ------
    NumericalError
        No mode has begun.
    """
    data = found.begun().result.data
    assert data is not None
    dims = [dim for dim in ("mode",) if dim in data.dims]
    data = data.transpose(*dims, "time", ...)
    few = data.isel(time=frames_of(data.sizes["time"], FRAMES))
    modes = names_of(data, "mode") if dims else [""]
    selected = modes.index(default_mode(data)) if dims else 0
    page = kind_page(data) if charts else Page("", "", time=few["time"].values)
    page = replace(page, runs=modes, selected=selected, film=animation(few, dims))
    verdict = verdict_of(data)
    numbers = [_numbers(data.sel(mode=mode) if dims else data, mode) for mode in modes]
    too_small = below_tolerance_line({one["mode"]: one["error_rms"] for one in numbers}, found.tolerance or 0.0)
    return {
        "modes": modes,
        "page": page_data(page),
        "stress": station_stresses(few),
        "numbers": numbers,
        "errors": [error_of(error) | {"mode": mode} for mode, error in found.errors.items()],
        "findings": [*finding_lines(verdict), *([too_small] if too_small else [])],
        "verdict": verdict.level.value,
    }


def station_stresses(data: xr.Dataset) -> dict[str, Any] | None:
    """Return the largest stress in the section at each station of flexible bodies; None if no stress is known.

    Returns
    -------
    dict
        `shape` (runs, frames, stations); `most`, the largest stress [Pa]; `data`, one byte each, of which 254 stands
        for `most`, and 255 for a station without a stress, compressed as the numbers of a page are.
    """
    if "section_moment" not in data:
        return None
    stresses = stresses_of(data)
    whole = stresses.whole.reshape(-1, *stresses.whole.shape[-2:])
    place = stresses.place.reshape(-1, stresses.place.shape[-1])[0]
    bodies, x = data["station_body"].values, data["station_place"].values[:, 0]
    found = np.full((*whole.shape[:2], x.size), np.nan)
    for body in dict.fromkeys(stresses.owners):
        own, stations = np.flatnonzero(stresses.owners == body), np.flatnonzero(bodies == body)
        found[:, :, stations] = whole[:, :, own] @ _interpolation(place[own], x[stations]).T
    most = largest(found)
    if most is None:
        return None
    known, steps = np.isfinite(found), np.full(found.shape, _UNKNOWN, dtype=np.uint8)
    steps[known] = np.rint(_STEPS * found[known] / (most or 1.0))
    return {"shape": list(found.shape), "most": most, "data": deflated(steps.tobytes())}


def _interpolation(places: Array, at: Array) -> Array:
    """Return the matrix (k, sections) that interpolates values at ascending places linearly; ends are extended."""
    return np.stack([np.interp(at, places, unit) for unit in np.eye(places.size)], axis=1)


def _numbers(run: xr.Dataset, mode: str) -> dict[str, Any]:
    """Return the main numbers of a run; those that it does not have are None."""
    status = str(run["status"].item())
    out: dict[str, Any] = {"mode": mode, "status": status, "message": str(run["message"].item())}
    follows = "end_effector_desired" in run
    out["error_rms"] = finite_or_none(headline(run)[0].item()) if follows else None
    largest_error = "tracking_max_motion" if run.attrs.get("error") == "motion" else "tracking_max"
    out["error_max"] = finite_or_none(run[largest_error].item()) if follows else None
    torque = run["torque" if "torque" in run else "applied_torque"]
    out["peak_torque"] = {motor: largest(torque.sel(motor=motor).values) for motor in names_of(run, "motor")}
    out |= dict.fromkeys(("stress_max", "stress_body", "stress_place", "stress_time", "safety_factor"))
    if "stress_max" in run and status in (*DONE_STATUSES, "interrupted"):
        out |= _stress(run)
    return out


def _stress(run: xr.Dataset) -> dict[str, Any]:
    """Return the largest stress of a run, where and when it is, and the least safety factor."""
    stress, factors = run["stress_max"].values, run["safety_factor"].values
    if not np.isfinite(stress).any():
        return {}
    b = int(np.nanargmax(stress))
    place, when = (finite_or_none(run[name].values[b]) for name in ("stress_place", "stress_time"))
    least = float(np.nanmin(factors)) if np.isfinite(factors).any() else None
    return {
        "stress_max": float(stress[b]), "stress_body": str(run["body"].values[b]), "stress_place": place,
        "stress_time": when, "safety_factor": least,
    }  # fmt: skip


def error_of(error: Exception) -> dict[str, Any]:
    """Return an error for the page: its line, its type, and the field, the remedy and the time that it names."""
    moment = getattr(error, "moment", None)
    return {
        "text": str(error) or type(error).__name__,
        "kind": type(error).__name__,
        "field": getattr(error, "field", ""),
        "remedy": getattr(error, "remedy", ""),
        "time": None if moment is None else finite_or_none(moment.time),
    }
