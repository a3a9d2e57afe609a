"""Figure of the desired path of the end-effector in the workspace (Fig. 11)."""

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from paraflex.arrays import Array
from paraflex.figures.shapes import along
from .given import drawn
from .layout import ONE_COLUMN, finish_plane, panels
from .mechanism import draw_mechanism
from .style import BLACK, BLUE

_START: dict[str, Any] = {
    "color": BLACK, "linestyle": "none", "marker": "s", "markersize": 4.5, "zorder": 4.0, "label": "start",
}  # fmt: skip


@drawn
def desired_path(data: xr.Dataset) -> Figure:
    """Plot the desired path of the end-effector, and the mechanism in its start pose (Fig. 11)."""
    path = 1e3 * data["end_effector_desired"].isel(mode=0).transpose("time", "axis").values
    figure, grid = panels(1, 1, width=ONE_COLUMN)
    axes: Axes = grid[0, 0]
    axes.set_aspect("equal")
    axes.set_xlabel("$x$ [mm]")
    axes.set_ylabel("$y$ [mm]")
    axes.plot(*path.T, color=BLUE, linewidth=1.3, zorder=2.6, label="desired path")
    _draw_direction(axes, path)
    axes.plot(*path[0], **_START)
    draw_mechanism(axes, data, path)
    return finish_plane(figure, axes)


def _draw_direction(axes: Axes, path: Array) -> None:
    """Draw arrow heads along a path at one, three, five and seven eighths of its length."""
    if not np.ptp(path, axis=0).any():
        return
    for share in (0.125, 0.375, 0.625, 0.875):
        tail, head = along(path, (share - 0.01, share + 0.01))
        axes.annotate(
            "",
            xytext=tail,
            xy=head,
            arrowprops={"arrowstyle": "-|>", "color": BLUE, "mutation_scale": 9.0, "shrinkA": 0.0, "shrinkB": 0.0},
            zorder=2.7,
        )
