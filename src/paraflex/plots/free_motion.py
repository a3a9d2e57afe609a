"""Figures of runs without a path and of named points: angles, speeds, energies, coordinates, paths and motions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from paraflex.figures.selection import names_of, one_run, point_number
from paraflex.formatting import ROUNDING, peak
from paraflex.plots.energy import ENERGIES
from paraflex.plots.given import drawn
from paraflex.plots.labels import axis_label, plain, symbol
from paraflex.plots.layout import panels
from paraflex.plots.runs import MOST_LINES, draw_curves, finish_over_time
from paraflex.plots.style import COLOURS, DASHES, keep_flat, look_of
from paraflex.plots.workspace import finish_workspace, workspace_panel

# A point that moves less than this fraction of the largest motion is at rest.
_STILL_SHARE = 1e-3
# Quantity of a coordinate and factor to the unit of its label, by the last part of its name.
_KINDS = {"x": ("position", 1e3), "y": ("position", 1e3), "phi": ("angle", 1.0), "eta": ("flexible", 1e3)}


@drawn
def motion_overview(data: xr.Dataset) -> Figure:
    """Plot the angles and angular velocities of the first seven bodies, and the energies."""
    figure, axes = panels(3, 1)
    time = data["time"].values
    for panel, variable in ((axes[0, 0], "angle"), (axes[1, 0], "angular_velocity")):
        values = data[variable].values
        for k, body in enumerate(data["body"].values[:MOST_LINES]):
            panel.plot(time, values[:, k], label=symbol(str(body)), **look_of(k))
        keep_flat(panel, float(np.nanmax(np.abs(values), initial=0.0)) or 1.0)
        panel.set_ylabel(axis_label(variable))
    for k, (variable, name) in enumerate(ENERGIES.items()):
        look = {"color": COLOURS[-1 - k], "linestyle": DASHES[k]}
        axes[2, 0].plot(time, data[variable].values, label=name, **look)
    axes[2, 0].set_ylabel(axis_label("energy"))
    return finish_over_time(figure, axes, data, panel_height=40.0)


@drawn
def coordinates(data: xr.Dataset) -> Figure:
    """Plot the generalised coordinates over time: positions and angles of body frames, and flexible coordinates.

    Each kind that changes has a panel with the seven coordinates that change most.
    """
    names = names_of(data, "coordinate")
    values = data["coordinate_value"].transpose("time", "coordinate").values
    travel = np.nan_to_num(np.nanmax(values, axis=0) - np.nanmin(values, axis=0))
    kinds = [name.rpartition(".")[2].rstrip("0123456789") for name in names]
    groups = {kind: [k for k, one in enumerate(kinds) if one == kind and travel[k] > ROUNDING] for kind in _KINDS}
    groups = {kind: members for kind, members in groups.items() if members} or {"phi": list(range(len(names)))[:1]}
    bodies = names_of(data, "body")
    figure, axes = panels(len(groups), 1)
    for panel, (kind, members) in zip(axes[:, 0], groups.items(), strict=True):
        quantity, factor = _KINDS[kind]
        most = sorted(members, key=lambda k: -travel[k])[:MOST_LINES]
        for place, k in enumerate(sorted(most)):
            body, _, mode = names[k].rpartition(".")
            # A body has the same look in all panels of its frame's coordinates.
            label, look = symbol(body), bodies.index(body)
            if kind == "eta":
                label, look = rf"{label}: $\eta_{{{mode.removeprefix('eta')}}}$", place
            draw_curves(panel, data, {label: factor * values[:, k]}, first=look)
        keep_flat(panel, peak(factor * values[:, members]) or 1.0)
        panel.set_ylabel(axis_label(quantity, direction=kind, short=kind == "eta"))
    return finish_over_time(figure, axes, data, panel_height=34.0)


@drawn
def point_paths(data: xr.Dataset, points: Sequence[str] = ()) -> Figure:
    """Plot the paths of named points in the plane.

    Parameters
    ----------
    points : sequence of str
        Points "body.point" to plot; by default the end-effector and the points that travel most, up to seven.
    """
    places = 1e3 * data["point_position"].transpose("time", "point", "axis").values
    names = names_of(data, "point")
    shown = [point_number(data, point, "points") for point in points] or moving_points(data)
    figure, panel = workspace_panel()
    for look, k in enumerate(shown):
        panel.plot(*places[:, k].T, label=plain(names[k]), **look_of(look))
        panel.plot(*places[0, k], marker="s", markersize=3.0, linestyle="none", color=look_of(look)["color"])
    if not shown:
        panel.plot(*places[0].T, "o", markersize=3.0, label="points, which do not move")
    return finish_workspace(figure, panel)


@drawn
def point_motions(data: xr.Dataset, mode: str | None = None, points: Sequence[str] = ()) -> Figure:
    """Plot the distance from the start, the speed and the magnitude of acceleration of named points over time.

    Parameters
    ----------
    data : xarray.Dataset
        Results of a run.
    mode : str, optional
        Actuation mode of a run along a path.
    points : sequence of str
        Points "body.point" to plot; by default the end-effector and the points that travel most, up to seven.
    """
    run, names = one_run(data, mode), names_of(data, "point")
    shown = [point_number(run, point, "points") for point in points] or moving_points(run)
    place, velocity, acceleration = (
        run[name].transpose("time", "point", "axis").values[:, shown]
        for name in ("point_position", "point_velocity", "point_acceleration")
    )
    figure, axes = panels(3, 1)
    curves = ((1e3 * (place - place[:1]), "distance"), (velocity, "speed"), (acceleration, "magnitude"))
    for panel, (values, quantity) in zip(axes[:, 0], curves, strict=True):
        sizes = np.linalg.norm(values, axis=2)
        draw_curves(panel, run, {plain(names[k]): sizes[:, j] for j, k in enumerate(shown)})
        keep_flat(panel, peak(sizes) or 1.0)
        panel.set_ylabel(axis_label(quantity))
    return finish_over_time(figure, axes, data, panel_height=34.0)


def moving_points(run: xr.Dataset) -> list[int]:
    """Return the indices of the named points that move, the end-effector first; at most seven, those that travel most.

    Only one of coincident points is returned.
    """
    places = run["point_position"].transpose("time", "point", "axis").values
    names = names_of(run, "point")
    travel = np.nan_to_num(np.nanmax(places, axis=0) - np.nanmin(places, axis=0)).max(axis=1)
    # Coincident points share a line, named after the end-effector if it is one of them. Names of generated points
    # contain "._".
    followed = run.attrs.get("end_effector_point")
    shown: list[int] = []
    for k in sorted(range(len(names)), key=lambda k: (names[k] != followed, -travel[k])):
        apart = all(peak(places[:, k] - places[:, other]) > _STILL_SHARE * travel.max() for other in shown)
        if travel[k] > _STILL_SHARE * travel.max() and apart and "._" not in names[k]:
            shown.append(int(k))
    first = [k for k in shown if names[k] == followed]
    return first + sorted(k for k in shown[:MOST_LINES] if k not in first)
