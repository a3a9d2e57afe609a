"""Phase diagrams of the end-effector's motion (Fig. 17) and of the rotation of bodies."""

from __future__ import annotations

import xarray as xr
from matplotlib.figure import Figure

from paraflex.figures.selection import moving_directions, names_of, of_point, one_run, point_label, select_run
from paraflex.formatting import peak
from paraflex.plots.given import drawn
from paraflex.plots.labels import axis_label, symbol
from paraflex.plots.layout import is_narrow, lay_out, panel_grid, panels
from paraflex.plots.runs import END_EFFECTOR, START, draw_actual, draw_desired
from paraflex.plots.style import BLUE, keep_flat

# Largest number of bodies with a panel.
_MOST_PANELS = 8


@drawn
def phase_diagrams(data: xr.Dataset, mode: str, point: str | None = None) -> Figure:
    """Plot velocity over displacement and acceleration over velocity in x and y, desired and actual (Fig. 17).

    Parameters
    ----------
    point : str, optional
        Point "body.point" in place of the end-effector; it has no desired motion.
    """
    run = of_point(select_run(data, mode), point)
    planned = "end_effector_desired" in run
    directions = moving_directions(run)
    figure, axes = panels(2, len(directions))
    for row, (across, up) in zip(axes, (END_EFFECTOR[:2], END_EFFECTOR[1:]), strict=True):
        for panel, axis in zip(row, directions, strict=True):
            x, y = (factor * run[name].sel(axis=axis) for name, _, factor in (across, up))
            suffix = "_desired" if planned else ""
            x_desired, y_desired = (factor * run[name + suffix].sel(axis=axis) for name, _, factor in (across, up))
            draw_actual(panel, run, x.values, y.values, label=point_label(run, point))
            if planned:
                draw_desired(panel, x_desired.values, y_desired.values)
            # The start mark is all that is visible of a direction at rest; it is small because it lies on the curves.
            panel.plot(x_desired[0], y_desired[0], **START)[0].set_markersize(2.5)
            panel.margins(0.06)
            keep_flat(panel, peak(across[2] * run[across[0] + suffix]), "x")
            keep_flat(panel, peak(up[2] * run[up[0] + suffix]))
            panel.set_xlabel(axis_label(across[1], direction=axis, short=True))
            panel.set_ylabel(axis_label(up[1], direction=axis, short=True))
    for row, title in zip(axes, ("displacement and velocity", "velocity and acceleration"), strict=True):
        for panel, axis in zip(row, directions, strict=True):
            panel.set_title(f"{title} in ${axis}$")
    return lay_out(figure, axes, panel_height=50.0)


@drawn
def link_phases(data: xr.Dataset, mode: str | None = None) -> Figure:
    """Plot angular velocity over angle of every body, at most eight."""
    run = one_run(data, mode)
    bodies = names_of(run, "body")[:_MOST_PANELS]
    columns = 2 if is_narrow() or len(bodies) in (2, 3, 4) else min(len(bodies), 4)
    columns = min(columns, len(bodies))
    figure, axes = panel_grid(len(bodies), columns)
    angles, rates = (run[name].transpose("time", "body").values for name in ("angle", "angular_velocity"))
    for k, (panel, body) in enumerate(zip(axes.flat, bodies, strict=False)):
        panel.plot(angles[:, k], rates[:, k], color=BLUE, label="actual")
        if "angle_desired" in run:
            draw_desired(panel, run["angle_desired"].values[:, k], run["angular_velocity_desired"].values[:, k])
        panel.plot(angles[0, k], rates[0, k], **START)[0].set_markersize(2.5)
        panel.margins(0.06)
        keep_flat(panel, peak(angles), "x")
        keep_flat(panel, peak(rates))
        panel.set_title(symbol(body))
        panel.set_xlabel(axis_label("angle"))
    for row in axes:
        row[0].set_ylabel(axis_label("angular_velocity"))
    return lay_out(figure, axes, panel_height=34.0)
