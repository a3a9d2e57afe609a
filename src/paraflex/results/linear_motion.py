"""Undamped modes of linear models as motions that can be drawn."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import xarray as xr

from paraflex.arrays import Array
from paraflex.results.linear_data import DRAWN, HOLDINGS
from paraflex.results.linear_summary import common_poles

# Variables of a drawn run, and of its base, by their names in `Drawing`.
_VARIABLES = {
    "shape": ("shape", "shape_base"), "joints": ("joint_position", "joint_base"),
    "directions": ("joint_direction", "joint_direction_base"), "springs": ("spring_position", ""),
}  # fmt: skip
# First words of labels of what is drawn.
_LABELS = ("station", "point", "joint", "spring", "gear", "axis")
# The largest displacement of a point, as a share of the mechanism's size.
SWING = 0.08


class DrawnMode(NamedTuple):
    """An undamped mode that is drawn: the actuation mode, whether its motors are held, its number and frequency [Hz].

    Of motors that turn freely, the actuation mode is empty where all have the same frequencies.
    """

    mode: str
    holding: str
    number: int
    frequency: float


def drawn_modes(data: xr.Dataset, *, rigid: bool = True) -> Iterator[DrawnMode]:
    """The undamped modes that a dataset of linear models has shapes of.

    Parameters
    ----------
    data : xarray.Dataset
        From `linear_dataset`.
    rigid : bool
        Whether motions without a frequency are among them.
    """
    modes, drawn = data["mode"].values.tolist(), data.sizes["drawn"]
    frequency = data["natural_frequency"].transpose("mode", "holding", "order").values[:, :, :drawn]
    common = common_poles(data) is not None
    for j, holding in enumerate(HOLDINGS):
        for i, mode in enumerate(modes[:1] if common and holding == "free" else modes):
            for k, value in enumerate(frequency[i, j]):
                if np.isfinite(value) and (rigid or value > 0.0):
                    yield DrawnMode("" if common and holding == "free" else mode, holding, k, float(value))


def modal_motion(data: xr.Dataset, one: DrawnMode, phases: Array, share: float = SWING) -> xr.Dataset:
    """A mode as a run: what is drawn at phases (k,) [rad], the whole swing at a quarter of a turn.

    The largest displacement of a point is a share of the mechanism's size. Displacements are linear, and so links are
    longer where they turn far.
    """
    mode = one.mode or str(data["mode"].values[0])
    own = data.sel(mode=mode, holding=one.holding).isel(drawn=one.number)
    size = float(np.max(np.ptp(own["pose_shape"].values, axis=0)))
    swing = share * size * np.sin(phases)
    variables = {}
    for name, dims in DRAWN.items():
        if f"pose_{name}" not in own:
            continue
        pose, change = own[f"pose_{name}"].values, own[f"modal_{name}"].values
        moved = pose + swing.reshape(-1, *[1] * pose.ndim) * change
        shape, base = _VARIABLES[name]
        variables[shape] = (("time", *dims), moved)
        if base:
            variables[base] = (("time", *dims), np.broadcast_to(pose, moved.shape))
    kept = {name: data[name] for name in data.coords if str(name).partition("_")[0] in _LABELS}
    return xr.Dataset(variables, coords={"time": phases, **kept}, attrs={"mechanism": data.attrs["mechanism"]})
