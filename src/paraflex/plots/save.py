"""All figures of a study as files."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import xarray as xr
from matplotlib.figure import Figure

from paraflex.errors import OutputError
from paraflex.plots.agreement import compared_links, compared_paths, model_distances, prototype_pair
from paraflex.plots.elasticities import elasticities
from paraflex.plots.modes import motor_torques, tracking_errors
from paraflex.plots.optimisation import convergence, sobol_bars, targets_reached
from paraflex.plots.overview import motion_overview
from paraflex.plots.phase import phase_diagrams
from paraflex.plots.runs import default_mode
from paraflex.plots.style import journal_style
from paraflex.plots.time_series import end_effector_motion, link_motions, tip_deflections
from paraflex.plots.work_precision import work_precision
from paraflex.plots.workspace import desired_path, end_effector_path

# Files that do not depend on when they were written.
_METADATA = {"png": {}, "svg": {"Date": None}}


def save_figures(data: xr.Dataset, folder: str | Path, mode: str | None = None) -> list[Path]:
    """Write figures 11 to 18 as PNG (200 dpi) and SVG, named like `fig11_desired_path.png`.

    Parameters
    ----------
    data : xarray.Dataset
        From `paraflex.results`.
    folder : str or Path
        Made if it is not there; files of the same names are written over.
    mode : str, optional
        Of the figures that show one mode; by default the one with most active motors where modes are named by the
        signs of their motors, else the first.

    Returns
    -------
    list of Path
        The files written.

    Raises
    ------
    InputError
        No such mode.
    OutputError
        The folder cannot be written.
    """
    mode = default_mode(data) if mode is None else mode
    figures = {
        "fig11_desired_path": lambda: desired_path(data),
        "fig12_motor_torques": lambda: motor_torques(data),
        "fig13_tip_deflections": lambda: tip_deflections(data, mode),
        "fig14_link_motions": lambda: link_motions(data, mode),
        "fig15_end_effector_path": lambda: end_effector_path(data, mode),
        "fig16_end_effector_motion": lambda: end_effector_motion(data, mode),
        "fig17_phase_diagrams": lambda: phase_diagrams(data, mode),
        "fig18_tracking_errors": lambda: tracking_errors(data),
    }
    return _save(figures, Path(folder))


def save_agreement_figures(data: xr.Dataset, folder: str | Path) -> list[Path]:
    """Write figures 22 and 23 of every mode, and the distances of all models, as PNG and SVG.

    Parameters
    ----------
    data : xarray.Dataset
        From `studies.Verification.dataset`.
    folder : str or Path
        Made if it is not there; files of the same names are written over.

    Returns
    -------
    list of Path
        The files written.

    Raises
    ------
    OutputError
        The folder cannot be written.
    """
    pair = prototype_pair(data)
    figures: dict[str, Callable[[], Figure]] = {}
    if pair is not None:
        for mode in (str(name) for name in data["mode"].values):
            figures[f"fig22_links_{mode}"] = partial(compared_links, data, mode, pair)
            figures[f"fig23_paths_{mode}"] = partial(compared_paths, data, mode, pair)
    figures["model_distances"] = partial(model_distances, data)
    return _save(figures, Path(folder))


def save_overview(data: xr.Dataset, folder: str | Path) -> list[Path]:
    """Write the overview of a run without a path as PNG and SVG.

    Raises
    ------
    OutputError
        The folder cannot be written.
    """
    return _save({"motion_overview": partial(motion_overview, data)}, Path(folder))


def save_work_precision(figures: Mapping[str, Any], folder: str | Path) -> list[Path]:
    """Write the figure of a comparison of methods as PNG and SVG; none where no run got to its end.

    Raises
    ------
    OutputError
        The folder cannot be written.
    """
    if not any(run["status"] == "complete" for method in figures["methods"].values() for run in method["runs"]):
        return []
    return _save({"work_precision": partial(work_precision, figures)}, Path(folder))


def save_search_figures(figures: Mapping[str, Any], folder: str | Path) -> list[Path]:
    """Write the figures of an optimisation, an identification or of Sobol indices as PNG and SVG.

    Parameters
    ----------
    figures : mapping
        From the `figures` of its result, or read from `result.json` or `indices.json`. There are none of a search in
        which no design ran, nor of metrics that do not vary.
    folder : str or Path
        Made if it is not there; files of the same names are written over.

    Raises
    ------
    OutputError
        The folder cannot be written.
    """
    drawn: dict[str, Callable[[], Figure]] = {}
    if any(value is not None for _, value, _ in figures.get("history", ())):
        drawn["convergence"] = partial(convergence, figures)
    if any(target["value"] != 0.0 for target in figures.get("targets", ())):
        drawn["targets"] = partial(targets_reached, figures)
    if any(row["first"] is not None for row in figures.get("indices", ())):
        drawn["indices"] = partial(sobol_bars, figures)
    return _save(drawn, Path(folder)) if drawn else []


def save_elasticities(figures: Mapping[str, Any], folder: str | Path) -> list[Path]:
    """Write a figure of elasticities for each run of a sensitivity study, as PNG and SVG.

    Raises
    ------
    OutputError
        The folder cannot be written.
    """
    drawn = {
        f"elasticities_{run['path']}_{run['mode']}": partial(elasticities, figures, k)
        for k, run in enumerate(figures["runs"])
    }
    return _save(drawn, Path(folder))


def _save(figures: Mapping[str, Callable[[], Figure]], folder: Path) -> list[Path]:
    written: list[Path] = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, draw in figures.items():
            figure = draw()
            for suffix, metadata in _METADATA.items():
                path = folder / f"{name}.{suffix}"
                with journal_style():
                    figure.savefig(path, metadata=metadata)
                written.append(path)
    except OSError as error:
        raise OutputError(
            f"cannot be written ({error.strerror or error})", field=str(folder), remedy="choose another folder"
        ) from error
    return written
