"""Figures of static equilibria: deformed shapes in steps, buckling shapes."""

from dataclasses import replace

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from paraflex.arrays import Array
from paraflex.errors import InputError
from paraflex.figures.equilibria import buckled, given_coordinates
from paraflex.formatting import number
from paraflex.results.kinds import check_kind
from paraflex.results.statics_steps import as_samples
from .drawing import draw_scale_bar, pictures
from .given import drawn
from .layout import is_narrow
from .scene import Scene, scene
from .themes import theme

# Width of links relative to that in a film.
_WIDTH = 0.7
# Smallest and largest height relative to the width of a panel that fills the page.
_ALONE = (0.35, 0.6)


@drawn
def deformed_shapes(data: xr.Dataset, theme_name: str = "light") -> Figure:
    """Draw the mechanism at the last step, and its links at all earlier steps pale; deflections are not magnified."""
    check_kind(data, "statics")
    if not given_coordinates(data):
        raise InputError("nothing is loaded or moved in these equilibria", field="data",
                         remedy="give --load or --move")  # fmt: skip
    look = theme(theme_name)
    figure, limits = pictures({"": [(_steps(data), "")]}, look, 1, _WIDTH, _ALONE)
    draw_scale_bar(figure, limits, look, (0.98, 0.02), 8.0)
    return figure


@drawn
def buckling_shapes(data: xr.Dataset, theme_name: str = "light") -> Figure:
    """Draw the buckling shapes of the last stable equilibrium, scaled to one size; the equilibrium itself is pale.

    If no equilibrium with a buckling shape is stable, the first of them is taken.
    """
    check_kind(data, "statics")
    found = [(_steps(_with_shape(data.isel(step=[step, step]), shapes)), f"buckling at load factor {number(factor)}")
             for step, factor, shapes in buckled(data)]  # fmt: skip
    if not found:
        raise InputError("nothing buckles under these loads", field="data", remedy="load it, or ask for --buckling 1")
    columns = 1 if is_narrow() else min(len(found), 3)
    return pictures({"": found}, theme(theme_name), columns, _WIDTH, _ALONE if columns == 1 else (0.35, 1.6))[0]


def _steps(data: xr.Dataset) -> Scene:
    """Return the scene of all steps, without loads and trail."""
    samples = as_samples(data)
    shown = scene(samples, samples["time"].values)
    return replace(shown, trails=(), followed=(), loads=(), load_keys={})


def _with_shape(pair: xr.Dataset, shape: Array) -> xr.Dataset:
    """Return a pair of equilibria with other shapes; each joint moves with the drawn point nearest to it."""
    out = pair.assign(shape=(pair["shape"].dims, shape))
    joints = pair["joint_position"].values.astype(float).copy()
    before = pair["shape"].values.astype(float)[0]
    for j in range(joints.shape[1]):
        near = int(np.argmin(np.linalg.norm(before - joints[0, j], axis=1)))
        joints[1, j] += shape[1, near] - before[near]
    return out.assign(joint_position=(pair["joint_position"].dims, joints))
