"""Figures of the end-effector's path in the workspace (Figs. 11, 15)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from paraflex.errors import InputError
from paraflex.figures.runs import round_magnification
from paraflex.plots.given import drawn
from paraflex.plots.layout import ONE_COLUMN, equal_scales_height, is_narrow, lay_out, panels
from paraflex.plots.mechanism import draw_mechanism
from paraflex.plots.runs import START, draw_actual, draw_desired
from paraflex.plots.style import BLUE

# Margin around the drawing as a share of its size, and smallest and largest ratio of a panel's height to its width.
_MARGIN, _FLATTEST, _TALLEST = 0.06, 0.3, 1.3
_TALLEST_WIDE = 0.75  # Largest ratio for a figure of two columns.


@drawn
def desired_path(data: xr.Dataset) -> Figure:
    """Plot the desired path of the end-effector, and the mechanism in its start pose (Fig. 11)."""
    path = 1e3 * data["end_effector_desired"].isel(mode=0).transpose("time", "axis").values
    figure, axes = workspace_panel()
    axes.plot(*path.T, color=BLUE, linewidth=1.3, zorder=2.6, label="desired path")
    _draw_direction(axes, path)
    axes.plot(*path[0], **START)
    draw_mechanism(axes, data, path)
    return finish_workspace(figure, axes)


def deviated_paths(
    runs: Mapping[str, xr.Dataset], magnification: float | None, looks: Sequence[Mapping[str, Any]] = ({},)
) -> Figure:
    """Plot the paths of the end-effector in runs with a common desired path, by label, with one magnification."""
    first = next(iter(runs.values()))
    desired = 1e3 * first["end_effector_desired"].transpose("time", "axis").values
    deviations = [1e3 * run["end_effector"].transpose("time", "axis").values - desired for run in runs.values()]
    if magnification is None:
        magnification = round_magnification(np.concatenate(deviations), float(np.ptp(desired, axis=0).max()))
    elif not (math.isfinite(magnification) and magnification > 0.0):
        raise InputError(
            "not a magnification", field="magnification", value=magnification, remedy="give a positive number"
        )
    figure, axes = workspace_panel()
    for (label, run), deviation, look in zip(runs.items(), deviations, looks, strict=True):
        shown = desired + magnification * deviation
        suffix = "" if magnification == 1.0 else f", deviation × {magnification:g}"
        draw_actual(axes, run, *shown.T, label=label + suffix, **look)
    draw_desired(axes, *desired.T)
    axes.plot(*desired[0], **START)
    return finish_workspace(figure, axes)


def workspace_panel() -> tuple[Figure, Axes]:
    """Create a figure of the plane with one panel, with equal scales in mm."""
    figure, axes = panels(1, 1, width=ONE_COLUMN)
    panel: Axes = axes[0, 0]
    panel.set_aspect("equal")
    panel.set_xlabel("$x$ [mm]")
    panel.set_ylabel("$y$ [mm]")
    return figure, panel


def _draw_direction(axes: Axes, path: NDArray[np.float64]) -> None:
    """Draw arrow heads along a path at one, three, five and seven eighths of its length."""
    travelled = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    if travelled[-1] == 0.0:
        return
    for share in (0.125, 0.375, 0.625, 0.875):
        ends = [np.interp((share + d) * travelled[-1], travelled, path[:, k]) for d in (-0.01, 0.01) for k in (0, 1)]
        axes.annotate(
            "",
            xytext=(ends[0], ends[1]),
            xy=(ends[2], ends[3]),
            arrowprops={"arrowstyle": "-|>", "color": BLUE, "mutation_scale": 9.0, "shrinkA": 0.0, "shrinkB": 0.0},
            zorder=2.7,
        )


def finish_workspace(figure: Figure, axes: Axes) -> Figure:
    """Set the limits, with a margin and a minimum size for a path that is a line or a point, and lay out the figure."""
    box = axes.dataLim
    width, height = ((1.0 + 2.0 * _MARGIN) * extent for extent in (box.width, box.height))
    width = max(width, height / (_TALLEST if is_narrow(ONE_COLUMN) else _TALLEST_WIDE)) or 1.0
    height = max(height, _FLATTEST * width)
    middle_x, middle_y = box.x0 + 0.5 * box.width, box.y0 + 0.5 * box.height
    axes.set_xlim(middle_x - 0.5 * width, middle_x + 0.5 * width)
    axes.set_ylim(middle_y - 0.5 * height, middle_y + 0.5 * height)
    return lay_out(figure, np.array([[axes]]), panel_height=equal_scales_height(figure, axes))
