"""Figures of static equilibria: deformed shapes in steps, buckling shapes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from paraflex.arrays import Array
from paraflex.errors import InputError
from paraflex.figures.equilibria import given_coordinates
from paraflex.formatting import number
from paraflex.plots.drawing import Sketch, bare, draw_scale_bar
from paraflex.plots.given import drawn
from paraflex.plots.layout import MM, TWO_COLUMNS, is_narrow, page_width
from paraflex.plots.scene import Limits, common_limits, scene
from paraflex.plots.themes import Theme, theme
from paraflex.results.kinds import check_kind
from paraflex.results.statics_steps import as_samples, seen_buckling

# Largest displacement of a buckling shape, as a share of the mechanism's size.
_SWING = 0.12
_TITLE = 5.0


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
        raise InputError("nothing buckles under these loads", field="data", remedy="load it, or ask for --buckling 1")
    step, numbers = seen
    pictures = []
    for which in numbers:
        pair = data.isel(step=[step, step])
        shape = pair["shape"].values.astype(float)
        size = float(np.max(np.ptp(shape[0], axis=0)))
        moved = shape.copy()
        moved[1] += _SWING * size * data["buckling_shape"].values[step, which]
        factor = float(data["buckling_factor"].values[step, which])
        pictures.append((_with_shape(pair, moved), f"buckling at load factor {number(factor)}"))
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
