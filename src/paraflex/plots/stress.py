"""Figures of loads: stresses of beams, motions of joints, efforts of motors and drives, loads on the ground."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from paraflex.errors import InputError
from paraflex.figures.selection import names_of, one_run
from paraflex.formatting import peak
from paraflex.plots.given import drawn
from paraflex.plots.labels import axis_label, effort_label, symbol
from paraflex.plots.layout import lay_out, panels
from paraflex.plots.runs import MOST_LINES, draw_curves, finish_over_time, largest_columns, largest_over_time, shown_of
from paraflex.plots.style import ZERO, look_of
from paraflex.results.loads import sliding_joints
from paraflex.results.stress import CONTACT, stresses_of
from paraflex.units import STRESS


@drawn
def beam_stresses(data: xr.Dataset, mode: str | None = None) -> Figure:
    """Plot the largest magnitude of stress along every beam over time, bending and axial; at most the seven largest."""
    run = one_run(data, mode)
    stresses = STRESS.factor * run["stress"].transpose("time", "body").values
    _check_stresses(stresses, "beam_stresses")
    return largest_over_time(data, run, stresses, "body", axis_label("stress"))


@drawn
def stress_envelope(data: xr.Dataset, mode: str | None = None) -> Figure:
    """Plot the largest magnitude of stress over the run along every beam; at most the seven largest beams.

    Dotted lines are the axial part. Two values at one position are those on both sides of a node; crosses are the
    largest values under joints that slide along the beam.
    """
    run = one_run(data, mode)
    found = stresses_of(run)
    _check_stresses(found.whole, "stress_envelope")
    whole, axial = (STRESS.factor * np.fmax.reduce(each, axis=0) for each in (found.whole, np.abs(found.axial)))
    place, owners = run["section_place"].values, found.owners
    peaks = {body: peak(whole[owners == body]) for body in names_of(run, "body")}
    shown = [body for body in sorted(peaks, key=lambda name: -peaks[name])[:MOST_LINES] if peaks[body] > 0.0]
    figure, axes = panels(1, 1)
    for k, body in enumerate(name for name in peaks if name in shown):
        own, look = owners == body, look_of(k)
        axes[0, 0].plot(place[own], whole[own], label=symbol(body), **look)
        axes[0, 0].plot(place[own], axial[own], color=look["color"], linestyle=":", linewidth=0.8)
        for x, stress in _peaks_under_contacts(run, body):
            axes[0, 0].plot(x, STRESS.factor * stress, color=look["color"], linestyle="", marker="x", markersize=4.0)
    axes[0, 0].set_xlabel(axis_label("place"))
    axes[0, 0].set_ylabel(axis_label("stress"))
    axes[0, 0].set_ylim(bottom=0.0)
    return lay_out(figure, axes, panel_height=56.0)


def _peaks_under_contacts(run: xr.Dataset, body: str) -> Iterator[tuple[float, float]]:
    """Yield position [m] and magnitude [Pa] of the largest stress under each joint that slides along a body."""
    if "contact_moment" not in run:
        return
    found = stresses_of(run, CONTACT)
    for c in np.flatnonzero((found.owners == body) & np.isfinite(found.whole).any(axis=0)):
        k = int(np.nanargmax(found.whole[:, c]))
        yield float(found.place[k, c]), float(found.whole[k, c])


def _check_stresses(stresses: NDArray[np.float64], figure: str) -> None:
    if not peak(stresses):
        raise InputError(
            "the stresses of these beams are not known", field="figure", value=figure,
            remedy="give their sections outer_fibre, or sides, and run the model again",
        )  # fmt: skip


@drawn
def joint_motions(data: xr.Dataset, mode: str | None = None) -> Figure:
    """Plot angle and rate of every rotating joint, travel and speed of every sliding joint; at most seven of each."""
    run = one_run(data, mode)
    slides = sliding_joints(run)
    moves = run["joint_kind"].values != "weld"
    kinds = ((~slides & moves, ("angle", "angular_velocity")), (slides, ("travel", "speed")))
    shown = [(own, labels) for own, labels in kinds if own.any()]
    figure, axes = panels(max(len(shown), 1), 2)
    for row, (own, labels) in zip(axes, shown, strict=False):
        joints = run.isel(joint=np.flatnonzero(own))
        speeds = joints["joint_speed"].transpose("time", "joint").values
        largest = largest_columns(speeds)
        for panel, name, label in zip(row, ("joint_coordinate", "joint_speed"), labels, strict=True):
            values = joints[name].transpose("time", "joint").values
            names = names_of(joints, "joint")
            draw_curves(panel, run, {symbol(names[k]): values[:, k] for k in largest})
            panel.set_ylabel(axis_label(label))
            panel.set_title(shown_of(len(largest), len(names), "fastest joints"))
    return finish_over_time(figure, axes, data, panel_height=44.0)


@drawn
def drive_efforts(data: xr.Dataset, mode: str | None = None) -> Figure:
    """Plot torque or force, speed and power of motors and prescribed motions over time, at most seven of each."""
    run = one_run(data, mode)
    efforts: dict[str, dict[str, NDArray[np.float64]]] = {"torque": {}, "speed": {}, "power": {}}
    units = set()
    for dim, torque in (("motor", "torque" if "torque" in run else "applied_torque"), ("drive", "drive_torque")):
        if dim in run.dims and torque in run:
            units.add(str(run[torque].attrs.get("units", "N m")))
            for name in names_of(run, dim)[:MOST_LINES]:
                one = run.sel({dim: name})
                force = np.broadcast_to(one[torque].values, one[f"{dim}_speed"].shape)
                label = symbol(name)
                efforts["torque"][label], efforts["speed"][label] = force, one[f"{dim}_speed"].values
                efforts["power"][label] = one[f"{dim}_power"].values
    figure, axes = panels(3, 1)
    rates = {"N m": axis_label("speed", unit="rad/s"), "N": axis_label("speed")}
    rate = rates.get("".join(units), "speed [rad/s, m/s]")
    labels = (effort_label(", ".join(sorted(units, reverse=True))), rate, axis_label("power"))
    for panel, curves, label in zip(axes[:, 0], efforts.values(), labels, strict=True):
        _about_zero(panel, run, curves, label)
    return finish_over_time(figure, axes, data, panel_height=34.0)


@drawn
def frame_loads(data: xr.Dataset, mode: str | None = None) -> Figure:
    """Plot force and moment of the mechanism on the ground: shaking force, and shaking moment about the origin."""
    run = one_run(data, mode)
    force = run["frame_force"].transpose("time", "axis").values
    figure, axes = panels(2, 1)
    _about_zero(axes[0, 0], run, {"$F_x$": force[:, 0], "$F_y$": force[:, 1]}, axis_label("force"))
    moment = {"$M$ about the origin": run["frame_moment"].values}
    # The moment continues the sequence of looks.
    _about_zero(axes[1, 0], run, moment, axis_label("moment"), first=2)
    return finish_over_time(figure, axes, data, panel_height=40.0)


def _about_zero(
    panel: Axes, run: xr.Dataset, curves: dict[str, NDArray[np.float64]], label: str, first: int = 0
) -> None:
    draw_curves(panel, run, curves, first=first)
    panel.axhline(0.0, **ZERO)
    panel.set_ylabel(label)
