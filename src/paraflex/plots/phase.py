"""Phase diagrams of the end-effector's motion (Fig. 17)."""

from __future__ import annotations

import xarray as xr
from matplotlib.figure import Figure

from paraflex.plots.labels import peak
from paraflex.plots.layout import lay_out, panels
from paraflex.plots.runs import START, draw_actual, draw_desired, select_run
from paraflex.plots.style import journal_style, keep_flat


@journal_style()
def phase_diagrams(data: xr.Dataset, mode: str) -> Figure:
    """Velocity over displacement and acceleration over velocity in x and y, desired and actual (Fig. 17).

    Parameters
    ----------
    data : xarray.Dataset
        From `paraflex.results`.
    mode : str
        Actuation mode.

    Raises
    ------
    InputError
        No such mode.
    """
    quantities = (
        ("end_effector", "${}$ [mm]", 1e3),
        ("end_effector_velocity", r"$\dot {}$ [m/s]", 1.0),
        ("end_effector_acceleration", r"$\ddot {}$ [m/s²]", 1.0),
    )
    run = select_run(data, mode)
    directions = [str(axis) for axis in data["axis"].values]
    figure, axes = panels(2, len(directions))
    for row, (across, up) in zip(axes, (quantities[:2], quantities[1:]), strict=True):
        for panel, axis in zip(row, directions, strict=True):
            x, y = (factor * run[name].sel(axis=axis) for name, _, factor in (across, up))
            x_desired, y_desired = (factor * run[f"{name}_desired"].sel(axis=axis) for name, _, factor in (across, up))
            draw_actual(panel, run, x.values, y.values)
            draw_desired(panel, x_desired.values, y_desired.values)
            # All there is to see of a direction at rest; small, as it lies on the curves.
            panel.plot(x_desired[0], y_desired[0], **START)[0].set_markersize(2.5)
            panel.margins(0.06)
            keep_flat(panel, peak(across[2] * run[f"{across[0]}_desired"]), "x")
            keep_flat(panel, peak(up[2] * run[f"{up[0]}_desired"]))
            panel.set_xlabel(across[1].replace("{}", axis))
            panel.set_ylabel(up[1].replace("{}", axis))
    for row, title in zip(axes, ("displacement and velocity", "velocity and acceleration"), strict=True):
        for panel, axis in zip(row, directions, strict=True):
            panel.set_title(f"{title} in ${axis}$")
    return lay_out(figure, axes, panel_height=50.0)
