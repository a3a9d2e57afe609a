"""A run without a path at a glance: angles, speeds and energies in time."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from paraflex.plots.given import drawn
from paraflex.plots.labels import axis_label, symbol
from paraflex.plots.layout import label_outer_time, lay_out, panels
from paraflex.plots.style import COLOURS, DASHES, keep_flat, look_of

# Lines that can still be told apart in one panel.
_MOST = 7


@drawn
def motion_overview(data: xr.Dataset) -> Figure:
    """Angle and angular velocity of the first bodies, and the energies.

    Parameters
    ----------
    data : xarray.Dataset
        From `results.motion_dataset`.
    """
    figure, axes = panels(3, 1)
    time = data["time"].values
    for panel, variable in (
        (axes[0, 0], "angle"),
        (axes[1, 0], "angular_velocity"),
    ):
        values = data[variable].values
        for k, body in enumerate(data["body"].values[:_MOST]):
            panel.plot(time, values[:, k], label=symbol(str(body)), **look_of(k))
        keep_flat(panel, float(np.nanmax(np.abs(values), initial=0.0)) or 1.0)
        panel.set_ylabel(axis_label(variable))
    for k, (variable, name) in enumerate(
        (("kinetic_energy", "kinetic energy"), ("strain_energy", "strain energy"), ("work", "work done on it"))
    ):
        look = {"color": COLOURS[-1 - k], "linestyle": DASHES[k]}
        axes[2, 0].plot(time, data[variable].values, label=name, **look)
    axes[2, 0].set_ylabel(axis_label("energy"))
    for panel in axes.flat:
        panel.set_xlim(time[0], time[-1])
    label_outer_time(axes)
    return lay_out(figure, axes, panel_height=40.0)
