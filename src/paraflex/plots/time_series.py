"""Figures of one mode over time: tip deflections, motions of links and of the end-effector (Figs. 13, 14, 16)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from paraflex.errors import InputError
from paraflex.figures.selection import (
    most_deflected,
    moving_directions,
    of_point,
    one_run,
    point_label,
    run_label,
    select_run,
)
from paraflex.formatting import display_unit, peak
from paraflex.plots.given import drawn
from paraflex.plots.labels import QUANTITIES, axis_label, symbol
from paraflex.plots.layout import is_narrow, panels
from paraflex.plots.runs import END_EFFECTOR, draw_actual, draw_desired, finish_over_time, largest_over_time
from paraflex.plots.style import keep_flat

# Largest number of links whose motions fit on a page in one column.
_MOST_NARROW = 4


@drawn
def tip_deflections(data: xr.Dataset, mode: str, bodies: Sequence[str] | None = None) -> Figure:
    """Plot axial and transverse displacement and slope of the links' last ends over time (Fig. 13).

    They are measured from the tangent at each link's first end.

    Parameters
    ----------
    bodies : sequence of str, optional
        Bodies, one row each; by default the two with the largest transverse tip displacements, twins of a symmetric
        mechanism counted once.
    """
    run = select_run(data, mode)
    # A link that does not bend has no panels unless it is requested, or no link bends.
    chosen = [name for name in most_deflected(run) if _bends(run, name)] or most_deflected(run)[:1]
    chosen = chosen if bodies is None else list(bodies)
    for name in chosen:
        if name not in run["body"].values:
            known = ", ".join(map(str, run["body"].values))
            raise InputError("no such body in these results", field="bodies", value=name, remedy=f"one of {known}")
    columns = (
        ("tip_axial", "axial displacement", "displacement", "m"),
        ("tip_transverse", "transverse displacement", "displacement", "m"),
        ("tip_slope", "slope", "slope", "rad"),
    )
    figure, axes = panels(len(chosen), len(columns))
    for column, (variable, title, quantity, si_unit) in zip(axes.T, columns, strict=True):
        curves = [run[variable].sel(body=name).values for name in chosen]
        unit = display_unit(si_unit, curves)
        for panel, curve, name in zip(column, curves, chosen, strict=True):
            draw_actual(panel, run, data["time"].values, unit.factor * curve, label=run_label(run))
            keep_flat(panel, unit.factor * peak(curves))
            panel.set_title(f"{symbol(name)}: {title}")
            panel.set_ylabel(axis_label(quantity, unit=unit.name))
    return finish_over_time(figure, axes, data, panel_height=34.0)


def _bends(run: xr.Dataset, name: str) -> bool:
    return any(peak(run[variable].sel(body=name)) > 0.0 for variable in ("tip_axial", "tip_transverse", "tip_slope"))


@drawn
def link_deflections(data: xr.Dataset, mode: str | None = None) -> Figure:
    """Plot transverse displacements of the links' last ends over time, at most the seven largest.

    They are measured from the tangent at each link's first end.
    """
    run = one_run(data, mode)
    across = run["tip_transverse"].transpose("time", "body").values
    if not peak(across):
        raise InputError(
            "no body of these results bends", field="figure", value="link_deflections",
            remedy="choose another figure, or run the mechanism with flexible links",
        )  # fmt: skip
    unit = display_unit("m", across)
    return largest_over_time(data, run, unit.factor * across, "body", axis_label("displacement", unit=unit.name))


@drawn
def joint_forces(data: xr.Dataset, mode: str | None = None) -> Figure:
    """Plot the magnitude of the force in every joint over time; of more than seven, the seven largest."""
    run = one_run(data, mode)
    forces = np.linalg.norm(run["joint_force"].transpose("time", "joint", "axis").values, axis=2)
    return largest_over_time(data, run, forces, "joint", axis_label("force"))


@drawn
def link_motions(data: xr.Dataset, mode: str) -> Figure:
    """Plot angle, angular velocity and angular acceleration of every link, desired and actual (Fig. 14).

    A figure of one column shows the first four links only.
    """
    columns = ("angle", "angular_velocity", "angular_acceleration")
    run, time = select_run(data, mode), data["time"].values
    bodies = data["body"].values[: _MOST_NARROW if is_narrow() else None]
    figure, axes = panels(len(bodies), len(columns))
    for column, variable in zip(axes.T, columns, strict=True):
        scale = float(np.ptp(run[f"{variable}_desired"].values, axis=0).max())
        for panel, body in zip(column, bodies, strict=True):
            draw_actual(panel, run, time, run[variable].sel(body=body).values, linewidth=0.6)
            draw_desired(panel, time, run[f"{variable}_desired"].sel(body=body).values)
            keep_flat(panel, scale)
            panel.set_title(f"{symbol(str(body))}: {QUANTITIES[variable].name}")
            panel.set_ylabel(axis_label(variable, short=True))
    return finish_over_time(figure, axes, data, panel_height=21.5)


@drawn
def end_effector_motion(data: xr.Dataset, mode: str, point: str | None = None) -> Figure:
    """Plot displacement, velocity and acceleration of the end-effector in x and y, desired and actual (Fig. 16).

    Parameters
    ----------
    point : str, optional
        Point "body.point" in place of the end-effector; it has no desired motion.
    """
    run, time = of_point(select_run(data, mode), point), data["time"].values
    directions = moving_directions(run)
    figure, axes = panels(len(END_EFFECTOR), len(directions))
    for row, (variable, quantity, factor) in zip(axes, END_EFFECTOR, strict=True):
        moved = factor * run[variable].transpose("time", "axis")
        desired = factor * run[f"{variable}_desired"] if f"{variable}_desired" in run else None
        scale = peak(np.ptp((moved.dropna("time") if desired is None else desired).values, axis=0))
        for panel, axis in zip(row, directions, strict=True):
            draw_actual(panel, run, time, moved.sel(axis=axis).values, label=point_label(run, point))
            if desired is not None:
                draw_desired(panel, time, desired.sel(axis=axis).values)
            keep_flat(panel, scale)
            panel.set_ylabel(axis_label(quantity, direction=axis, short=True))
    for panel, axis in zip(axes[0], directions, strict=True):
        panel.set_title(f"${axis}$ direction")
    return finish_over_time(figure, axes, data, panel_height=33.0)
