"""Forces in the joints."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from paraflex.plots.given import drawn
from paraflex.plots.labels import axis_label, peak, symbol
from paraflex.plots.layout import label_outer_time, lay_out, panels
from paraflex.plots.runs import draw_curves, one_run, shade_rest

# Lines that can still be told apart in one panel.
_MOST = 7


@drawn
def joint_forces(data: xr.Dataset, mode: str | None = None) -> Figure:
    """Magnitude of the force in every joint in time; of more than seven, in those with the largest.

    Parameters
    ----------
    data : xarray.Dataset
        From `results.tracking_dataset` or `motion_dataset`.
    mode : str, optional
        Actuation mode; by default that with most active motors.

    Raises
    ------
    InputError
        No such mode.
    """
    run = one_run(data, mode)
    forces = np.linalg.norm(run["joint_force"].transpose("time", "joint", "axis").values, axis=2)
    largest = np.argsort([-peak(force) for force in forces.T], kind="stable")[:_MOST]
    figure, axes = panels(1, 1)
    names = [str(name) for name in run["joint"].values]
    draw_curves(axes[0, 0], run, {symbol(names[k]): forces[:, k] for k in sorted(largest)})
    axes[0, 0].set_ylabel(axis_label("force"))
    shade_rest(axes[0, 0], data)
    label_outer_time(axes)
    return lay_out(figure, axes, panel_height=56.0)
