"""Figures of static equilibria: force and stiffness against travel, deformed shapes in steps, buckling shapes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from paraflex.errors import InputError
from paraflex.plots.drawing import Sketch, bare, draw_scale_bar
from paraflex.plots.given import drawn
from paraflex.plots.labels import display_unit, symbol
from paraflex.plots.layout import MM, TWO_COLUMNS, is_narrow, lay_out, page_width, panels
from paraflex.plots.scales import mark_powers
from paraflex.plots.scene import Limits, common_limits, scene
from paraflex.plots.style import ZERO, look_of
from paraflex.plots.themes import Theme, theme
from paraflex.results.kinds import check_kind
from paraflex.results.statics_data import as_samples, branch_parts, seen_buckling
from paraflex.results.statics_rows import given_coordinates, is_wide

Array = NDArray[np.float64]

# Number of natural frequencies drawn against travel.
_FREQUENCIES = 4
# Largest displacement of a buckling shape, as a share of the mechanism's size.
_SWING = 0.12
_TITLE = 5.0


@drawn
def force_travel(data: xr.Dataset) -> Figure:
    """Plot force against travel of every coordinate that is loaded or moved.

    Curves are dotted where the equilibrium is unstable; rings mark limit points.
    """
    given = _given(data)
    figure, axes = panels(1, len(given)) if not is_narrow() else panels(len(given), 1)
    for panel, k in zip(axes.flat, given, strict=True):
        one = data.isel(named=k)
        unit = display_unit(str(one["unit"].item()), one["travel"].values)
        _branch(panel, data, unit.factor * one["travel"].values, one["effort"].values, "", look_of(0))
        panel.set_xlabel(f"travel of {symbol(str(one['named'].item()))} [{unit.name}]")
        word = "force" if one["effort_unit"].item() == "N" else "torque"
        panel.set_ylabel(f"{word} [{one['effort_unit'].item()}]")
        panel.axhline(0.0, **ZERO)
    return lay_out(figure, axes, panel_height=62.0)


@drawn
def stiffness_travel(data: xr.Dataset) -> Figure:
    """Plot the stiffness of the requested coordinates and the lowest natural frequencies against the given travel."""
    _given(data)
    travel = data["given_travel"]
    unit = display_unit(travel.attrs["units"], travel.values)
    x = unit.factor * travel.values
    label = f"travel of {symbol(travel.attrs['coordinate'])} [{unit.name}]"
    shown = [k for k in range(data.sizes["named"]) if np.isfinite(data["stiffness"].values[:, k]).any()]
    kinds = [each for each in ("m", "rad") if any(data["unit"].values[k] == each for k in shown)]
    rows = len(kinds) + bool(data.sizes["frequency_number"])
    figure, axes = panels(1, rows) if not is_narrow() else panels(rows, 1)
    for panel, kind in zip(axes.flat, kinds, strict=False):
        own = [k for k in shown if data["unit"].values[k] == kind]
        factor, name = (1e-3, "N/mm") if kind == "m" else (1.0, "N m/rad")
        values = factor * data["stiffness"].values[:, own]
        for number, k in enumerate(own):
            _branch(panel, data, x, values[:, number], symbol(str(data["named"].values[k])), look_of(number))
        panel.set_ylabel(f"stiffness [{name}]")
        if is_wide(values):
            panel.set_yscale("log")
            mark_powers(panel)
        panel.set_xlabel(label)
    if data.sizes["frequency_number"]:
        panel = axes.flat[-1]
        for number in range(min(_FREQUENCIES, data.sizes["frequency_number"])):
            values = data["natural_frequency"].values[:, number]
            _branch(panel, data, x, values, "", look_of(number))
        panel.set_ylabel("natural frequencies [Hz]")
        panel.set_ylim(bottom=0.0)
        panel.set_xlabel(label)
    return lay_out(figure, axes, panel_height=62.0)


@drawn
def deformed_shapes(data: xr.Dataset, theme_name: str = "light") -> Figure:
    """Draw the mechanism at the last step, and its links at all earlier steps pale; deflections are not magnified."""
    _given(data)
    look = theme(theme_name)
    figure, limits = _pictures([(data, "")], look)
    draw_scale_bar(figure, limits, look, (0.98, 0.02), 8.0)
    return figure


@drawn
def buckling_shapes(data: xr.Dataset, theme_name: str = "light") -> Figure:
    """Draw the buckling shapes of the last stable equilibrium, scaled to one size; the equilibrium itself is pale.

    If no equilibrium with a buckling shape is stable, the first of them is taken.
    """
    check_kind(data, "statics")
    seen = seen_buckling(data)
    if seen is None:
        raise InputError("nothing buckles under what is given", field="data", remedy="load it, or ask for --buckling 1")
    step, numbers = seen
    pictures = []
    for number in numbers:
        pair = data.isel(step=[step, step])
        shape = pair["shape"].values.astype(float)
        size = float(np.max(np.ptp(shape[0], axis=0)))
        moved = shape.copy()
        moved[1] += _SWING * size * data["buckling_shape"].values[step, number]
        factor = float(data["buckling_factor"].values[step, number])
        pictures.append((_with_shape(pair, moved), f"buckling at {factor:.4g} of what is given"))
    return _pictures(pictures, theme(theme_name))[0]


def _with_shape(pair: xr.Dataset, shape: Array) -> xr.Dataset:
    """Return a pair of equilibria with other shapes; each joint moves with the drawn point nearest to it."""
    out = pair.assign(shape=(pair["shape"].dims, shape))
    joints = pair["joint_position"].values.astype(float).copy()
    before = pair["shape"].values.astype(float)[0]
    for j in range(joints.shape[1]):
        near = int(np.argmin(np.linalg.norm(before - joints[0, j], axis=1)))
        joints[1, j] += shape[1, near] - before[near]
    return out.assign(joint_position=(pair["joint_position"].dims, joints))


def _pictures(runs: list[tuple[xr.Dataset, str]], look: Theme) -> tuple[Figure, Limits]:
    """Draw the last step of each dataset, with the links of earlier steps pale, side by side."""
    width = page_width(TWO_COLUMNS)
    columns = 1 if is_narrow() else min(len(runs), 3)
    samples = [as_samples(data) for data, _ in runs]
    scenes = [scene(data, data["time"].values) for data in samples]
    limits, aspect = common_limits(scenes).filling(0.35, 0.6 if columns == 1 else 1.6)
    wide = width / columns
    rows = -(-len(runs) // columns)
    high = wide * aspect + _TITLE
    figure = Figure(figsize=(width * MM, rows * high * MM), facecolor=look.ground)
    for k, (shown, (_, title)) in enumerate(zip(scenes, runs, strict=True)):
        left, bottom = (k % columns) / columns, 1.0 - (k // columns + 1) / rows
        panel = bare(figure.add_axes((left, bottom, 1.0 / columns, wide * aspect / high / rows)), limits)
        # Links at earlier steps.
        for places in shown.bodies.values():
            for step in places[:-1]:
                panel.plot(*step.T, color=look.faint, linewidth=0.7, zorder=1.0, clip_on=False)
        plain = replace(shown, trail=None, followed=None, loads=(), load_keys={})
        Sketch(panel, plain, limits, look, width=0.7).show(shown.time.size - 1)
        panel.set_title(title, fontsize=8.0, color=look.ink, pad=1.0)
    return figure, limits


def _given(data: xr.Dataset) -> list[int]:
    """Return the indices of the coordinates that are moved or loaded; raise InputError if there are none."""
    check_kind(data, "statics")
    found = given_coordinates(data)
    if not found:
        raise InputError("nothing is loaded or moved in these equilibria", field="data",
                         remedy="give --load or --move")  # fmt: skip
    return found


def _branch(panel: Axes, data: xr.Dataset, x: Array, y: Array, label: str, look: dict[str, Any]) -> None:
    """Draw a curve over the branch, dotted where it is unstable, with rings at limit points."""
    parts = branch_parts(data)
    panel.plot(np.where(parts.stable, x, np.nan), y, label=label or None, color=look["color"],
               linestyle=look["linestyle"] if label and parts.unstable.any() else "-")  # fmt: skip
    if parts.unstable.any():
        panel.plot(np.where(parts.unstable, x, np.nan), y, color=look["color"], linestyle=":")
    panel.plot(x[parts.limit], y[parts.limit], linestyle="", marker="o", markersize=4.0, markerfacecolor="white",
               markeredgecolor=look["color"])  # fmt: skip
