"""Figures that compare models of one mechanism: links, end-effector, distances (Figs. 22, 23 and beyond)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from paraflex.figures.run_motion import most_deflected
from paraflex.figures.selection import names_of, select_model, select_run
from paraflex.formatting import display_unit, peak
from paraflex.plots.given import drawn
from paraflex.plots.labels import QUANTITIES, axis_label, plain, symbol
from paraflex.plots.layout import is_narrow, panels
from paraflex.plots.runs import draw_actual, draw_curves, finish_over_time
from paraflex.plots.scales import mark_powers
from paraflex.plots.style import PAIR, keep_flat, look_of
from paraflex.plots.workspace import deviated_paths

_MODEL_NAMES = {
    "ked": "KED",
    "linear": "linear geometry",
    "second-order": "second-order geometry",
    "segments": "finite segments",
    "exudyn": "Exudyn",
    "mujoco": "MuJoCo",
}
# Distances below this are rounding; they would stretch a logarithmic axis [m].
_SMALLEST_DISTANCE = 1e-8
# Largest number of links that fit on a page in one column.
_MOST_NARROW = 6


def printed(model: str) -> str:
    """Return the label of a model in legends."""
    return _MODEL_NAMES.get(model, model)


@drawn
def compared_links(data: xr.Dataset, mode: str, models: Sequence[str]) -> Figure:
    """Plot the angle and angular velocity of every link in two models (Fig. 22).

    A link's angle is that of the line from its first end to its last, which every model has. A figure of one column
    shows the first six links only.
    """
    runs = [select_run(select_model(data, model), mode) for model in models]
    columns = (("chord_angle", "angle"), ("chord_velocity", "angular_velocity"))
    bodies, time = data["body"].values[: _MOST_NARROW if is_narrow() else None], data["time"].values
    figure, axes = panels(len(bodies), len(columns))
    for column, (variable, quantity) in zip(axes.T, columns, strict=True):
        scale = max(float(np.ptp(run[variable].values, axis=0).max()) for run in runs)
        for panel, body in zip(column, bodies, strict=True):
            for run, model, look in zip(runs, models, PAIR, strict=True):
                draw_actual(panel, run, time, run[variable].sel(body=body).values, label=printed(model), **look)
            keep_flat(panel, scale)
            panel.set_title(f"{symbol(str(body))}: {QUANTITIES[quantity].name}")
            panel.set_ylabel(axis_label(quantity, short=True))
    return finish_over_time(figure, axes, data, panel_height=21.5)


@drawn
def compared_deflections(data: xr.Dataset, mode: str) -> Figure:
    """Plot the transverse tip displacement of links in every model that has it, one panel per link.

    The two links whose tips move most in the reference are shown; twins of a symmetric mechanism are counted once.
    """
    runs = {name: select_run(select_model(data, name), mode) for name in names_of(data, "model")}
    bodies = most_deflected(runs[str(data.attrs["reference"])])
    everything = [run["tip_transverse"].sel(body=body).values for run in runs.values() for body in bodies]
    unit = display_unit("m", np.concatenate(everything))
    figure, axes = panels(len(bodies), 1)
    for panel, body in zip(axes[:, 0], bodies, strict=True):
        for k, (name, run) in enumerate(runs.items()):
            draw_curves(panel, run, {printed(name): unit.factor * run["tip_transverse"].sel(body=body).values}, first=k)
        panel.set_title(f"{symbol(body)}: transverse displacement")
        panel.set_ylabel(axis_label("displacement", unit=unit.name))
    return finish_over_time(figure, axes, data, panel_height=44.0)


@drawn
def compared_paths(data: xr.Dataset, mode: str, models: Sequence[str], magnification: float | None = None) -> Figure:
    """Plot the paths of the end-effector in two models, with magnified deviations from the desired path (Fig. 23).

    Parameters
    ----------
    magnification : float, optional
        Magnification of the deviations; by default a value at which they are visible.
    """
    runs = [select_run(select_model(data, model), mode) for model in models]
    return deviated_paths(dict(zip(map(printed, models), runs, strict=True)), magnification, PAIR)


@drawn
def model_distances(data: xr.Dataset) -> Figure:
    """Plot the distance of the end-effector from its desired position and from the reference model, for every model."""
    reference = str(data.attrs["reference"])
    modes = names_of(data, "mode")
    time = data["time"].values
    figure, axes = panels(2, len(modes))
    for column, mode in zip(axes.T, modes, strict=True):
        datum = select_run(select_model(data, reference), mode)["end_effector"].values
        for k, name in enumerate(names_of(data, "model")):
            run = select_run(select_model(data, name), mode)
            place = run["end_effector"].values
            look = look_of(k)
            for panel, other in zip(column, (run["end_effector_desired"].values, datum), strict=True):
                distance = np.linalg.norm(place - other, axis=1)
                shown = np.where(distance > _SMALLEST_DISTANCE, distance, np.nan)
                draw_actual(panel, run, time, 1e3 * shown, label=printed(name), **look)
        for panel, title in zip(column, ("from the desired place", f"from {printed(reference)}"), strict=True):
            panel.set_title(f"{plain(mode)}: distance {title}")
            if any(peak(np.asarray(line.get_ydata(), dtype=float)) > 0.0 for line in panel.lines):
                mark_powers(panel)
    for panel in axes[:, 0]:
        panel.set_ylabel(axis_label("distance"))
    return finish_over_time(figure, axes, data, panel_height=48.0)
