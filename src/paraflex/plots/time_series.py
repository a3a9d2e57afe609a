"""One mode in time: tip deflections, motion of the links, motion of the end-effector (Figs. 13, 14, 16)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from paraflex.errors import InputError
from paraflex.plots.given import drawn
from paraflex.plots.labels import QUANTITIES, axis_label, display_unit, peak, symbol
from paraflex.plots.layout import is_narrow, label_outer_time, lay_out, panels
from paraflex.plots.runs import (
    END_EFFECTOR,
    draw_actual,
    draw_curves,
    draw_desired,
    one_run,
    run_label,
    select_run,
    shade_rest,
)
from paraflex.plots.style import keep_flat

# Bodies of a symmetric mechanism whose tips move by the same within this share are shown once.
_ALIKE = 0.9
# Lines that can still be told apart in one panel.
_MOST = 7
# Links whose motions a page holds in one column.
_MOST_NARROW = 4


@drawn
def tip_deflections(data: xr.Dataset, mode: str, bodies: Sequence[str] | None = None) -> Figure:
    """Axial and transverse displacement and slope of links' last ends from the tangents at their first ends (Fig. 13).

    Parameters
    ----------
    data : xarray.Dataset
        From `paraflex.results`.
    mode : str
        Actuation mode.
    bodies : sequence of str, optional
        A row each; by default the two whose tips move most across, twins of a symmetric mechanism counted once.

    Raises
    ------
    InputError
        No such mode or body.
    """
    run = select_run(data, mode)
    chosen = most_deflected(run) if bodies is None else list(bodies)
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
            shade_rest(panel, data)
            keep_flat(panel, unit.factor * peak(curves))
            panel.set_title(f"{symbol(name)}: {title}")
            panel.set_ylabel(axis_label(quantity, unit=unit.name))
    label_outer_time(axes)
    return lay_out(figure, axes, panel_height=34.0)


def most_deflected(run: xr.Dataset) -> list[str]:
    """Two bodies, in the order of the mechanism: those with largest transverse tip displacement that are not alike."""
    peaks = {str(name): peak(run["tip_transverse"].sel(body=name)) for name in run["body"].values}
    chosen: list[str] = []
    rest = dict(peaks)
    while rest and len(chosen) < 2:
        alike = [name for name in rest if rest[name] >= _ALIKE * max(rest.values())]
        chosen.append(alike[0])
        rest = {name: value for name, value in rest.items() if name not in alike}
    ranked = sorted((name for name in peaks if name not in chosen), key=lambda name: -peaks[name])
    chosen += ranked[: 2 - len(chosen)]
    return [name for name in peaks if name in chosen]


@drawn
def link_deflections(data: xr.Dataset, mode: str | None = None) -> Figure:
    """Transverse displacement of links' last ends from the tangents at their first; of more than seven, of the largest.

    Parameters
    ----------
    data : xarray.Dataset
        From `results.tracking_dataset` or `motion_dataset`.
    mode : str, optional
        Actuation mode; by default that with most active motors.

    Raises
    ------
    InputError
        No such mode, or no body that bends.
    """
    run = one_run(data, mode)
    across = run["tip_transverse"].transpose("time", "body").values
    sizes = np.array([peak(values) for values in across.T])
    if not sizes.any():
        raise InputError(
            "no body of these results bends", field="figure", value="link_deflections",
            remedy="choose another figure, or run the mechanism with flexible links",
        )  # fmt: skip
    largest = [k for k in np.argsort(-sizes, kind="stable")[:_MOST] if sizes[k] > 0.0]
    unit = display_unit("m", across)
    names = [str(name) for name in run["body"].values]
    figure, axes = panels(1, 1)
    draw_curves(axes[0, 0], run, {symbol(names[k]): unit.factor * across[:, k] for k in sorted(largest)})
    axes[0, 0].set_ylabel(axis_label("displacement", unit=unit.name))
    shade_rest(axes[0, 0], data)
    label_outer_time(axes)
    return lay_out(figure, axes, panel_height=56.0)


@drawn
def link_motions(data: xr.Dataset, mode: str) -> Figure:
    """Angle, angular velocity and angular acceleration of every link, desired and actual (Fig. 14).

    In one column those of the first four.

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
    columns = ("angle", "angular_velocity", "angular_acceleration")
    run, time = select_run(data, mode), data["time"].values
    bodies = data["body"].values[: _MOST_NARROW if is_narrow() else None]
    figure, axes = panels(len(bodies), len(columns))
    for column, variable in zip(axes.T, columns, strict=True):
        scale = float(np.ptp(run[f"{variable}_desired"].values, axis=0).max())
        for panel, body in zip(column, bodies, strict=True):
            draw_actual(panel, run, time, run[variable].sel(body=body).values, linewidth=0.6)
            draw_desired(panel, time, run[f"{variable}_desired"].sel(body=body).values)
            shade_rest(panel, data)
            keep_flat(panel, scale)
            panel.set_title(f"{symbol(str(body))}: {QUANTITIES[variable].name}")
            panel.set_ylabel(axis_label(variable, short=True))
    label_outer_time(axes)
    return lay_out(figure, axes, panel_height=21.5)


@drawn
def end_effector_motion(data: xr.Dataset, mode: str) -> Figure:
    """Displacement, velocity and acceleration of the end-effector in x and y, desired and actual (Fig. 16).

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
    run, time = select_run(data, mode), data["time"].values
    directions = [str(axis) for axis in data["axis"].values]
    figure, axes = panels(len(END_EFFECTOR), len(directions))
    for row, (variable, quantity, factor) in zip(axes, END_EFFECTOR, strict=True):
        desired = factor * run[f"{variable}_desired"]
        scale = float(np.ptp(desired.values, axis=0).max())
        for panel, axis in zip(row, directions, strict=True):
            draw_actual(panel, run, time, factor * run[variable].sel(axis=axis).values)
            draw_desired(panel, time, desired.sel(axis=axis).values)
            shade_rest(panel, data)
            keep_flat(panel, scale)
            panel.set_ylabel(axis_label(quantity, direction=axis, short=True))
    for panel, axis in zip(axes[0], directions, strict=True):
        panel.set_title(f"${axis}$ direction")
    label_outer_time(axes)
    return lay_out(figure, axes, panel_height=33.0)
