"""Comparison of actuation modes: tracking errors, motor efforts, and condition number of the actuation matrix."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from paraflex.figures.selection import names_of, select_run
from paraflex.formatting import display_unit
from paraflex.plots.given import drawn
from paraflex.plots.labels import axis_label, effort_label, plain
from paraflex.plots.layout import lay_out, panels
from paraflex.plots.runs import draw_curves, finish_over_time
from paraflex.plots.scales import LIST_LINE, list_lines, mark_powers
from paraflex.plots.style import BLUE, GREEN, VERMILLION
from paraflex.results.following import headline, ranked_by_motion


@drawn
def actuation_condition(data: xr.Dataset) -> Figure:
    """Plot the condition number of the actuation matrix along the path in every mode.

    It is large near a Type II singularity.
    """
    # The condition number belongs to the planned motion, which continues after a run has stopped.
    whole = data.assign(end_effector=data["end_effector_desired"])
    return _of_all_modes(whole, data["actuation_condition"].transpose("mode", "time").values, "condition")


@drawn
def tracking_distance(data: xr.Dataset) -> Figure:
    """Plot the distance of the end-effector from its desired position over time, all modes in one panel."""
    away = (data["end_effector"] - data["end_effector_desired"]).transpose("mode", "time", "axis").values
    distance = 1e3 * np.linalg.norm(away, axis=2)
    # Rounding errors would extend the logarithmic axis.
    return _of_all_modes(data, np.where(distance > 1e-5, distance, np.nan), "distance")


def _of_all_modes(data: xr.Dataset, values: NDArray[np.float64], quantity: str) -> Figure:
    """Plot a quantity (modes, samples) of all modes in one panel, on a logarithmic axis."""
    figure, axes = panels(1, 1)
    for k, name in enumerate(names_of(data, "mode")):
        draw_curves(axes[0, 0], select_run(data, name), {f"mode {plain(name)}": values[k]}, first=k)
    axes[0, 0].set_ylabel(axis_label(quantity))
    if np.isfinite(values).any():
        mark_powers(axes[0, 0])
    return finish_over_time(figure, axes, data, panel_height=56.0)


@drawn
def mode_comparison(data: xr.Dataset) -> Figure:
    """Plot the RMS tracking error, the residual vibration and the largest torque of every mode.

    The tracking error is that of the motion or of the whole run, as the results define it.
    """
    rms, of_motion = headline(data)[0], ranked_by_motion(data)
    peaks = data["peak_torque"].max("motor").values
    label = effort_label(data["torque"].attrs.get("units", "N m"))
    figure, axes = panels(1, 3)
    names = [plain(name) for name in names_of(data, "mode")]
    for panel, values, title, colour in (
        (axes[0, 0], rms.values, f"RMS error {'of the motion' if of_motion else 'of the whole run'}", BLUE),
        (axes[0, 1], data["residual_vibration"].values, "residual vibration", GREEN),
    ):
        unit = display_unit("m", values)
        # Modes differ by orders of magnitude; bars would show only the largest.
        panel.plot(unit.factor * values, np.arange(len(names)), "o", color=colour, markersize=4.0)
        _list_modes(panel, names)
        panel.set_title(title)
        panel.set_xlabel(axis_label("distance", unit=unit.name))
        panel.margins(x=0.08)
        if (values > 0.0).any():
            mark_powers(panel, "x")
    _bars(axes[0, 2], names, peaks, VERMILLION)
    axes[0, 2].set_title(f"largest {label.partition(' [')[0]}")
    axes[0, 2].set_xlabel(label)
    return lay_out(figure, axes, panel_height=LIST_LINE * len(names) + 2.0)


def _bars(panel: Axes, names: list[str], values: Any, colour: str, **look: Any) -> None:
    lines = np.arange(len(names))
    panel.barh(lines, values, height=0.6, color=colour, linewidth=0.0, **look)
    _list_modes(panel, names)
    panel.margins(x=0.05)


def _list_modes(panel: Axes, names: list[str]) -> None:
    list_lines(panel, names)
    panel.grid(axis="x", color="0.9", linewidth=0.4)
