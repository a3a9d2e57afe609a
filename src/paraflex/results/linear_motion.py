"""Undamped modes of linear models, converted to motions that can be drawn."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import xarray as xr

from paraflex.arrays import Array
from .linear_data import DRAWN
from .linear_summary import HOLDINGS, common_poles

# Variables of a drawn run and of its undeformed base, by their names in `Drawing`.
_VARIABLES = {
    "shape": ("shape", "shape_base"), "joints": ("joint_position", "joint_base"),
    "directions": ("joint_direction", "joint_direction_base"), "springs": ("spring_position", ""),
}  # fmt: skip
# First words of the coordinate labels that drawings need.
_LABELS = ("station", "point", "joint", "spring", "gear", "axis")
# Largest displacement of a point, as a fraction of the mechanism's size.
SWING = 0.08


class DrawnMode(NamedTuple):
    """Undamped mode to be drawn: actuation mode, motors "free" or "held", number and natural frequency [Hz].

    With free motors, the actuation mode is empty if all actuation modes have the same poles.
    """

    mode: str
    holding: str
    number: int
    frequency: float


def drawn_modes(data: xr.Dataset, *, rigid: bool = True) -> Iterator[DrawnMode]:
    """Yield the undamped modes of which a dataset of linear models holds the mode shapes.

    Parameters
    ----------
    data : xarray.Dataset
        Dataset made by `linear_dataset`.
    rigid : bool
        Whether to include rigid-body modes, whose natural frequency is zero.
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
    """Return an undamped mode as a dataset of a run, whose times are phases (k,) [rad].

    Displacements are proportional to the sine of the phase. They are linear, so links that rotate far appear longer.

    Parameters
    ----------
    data : xarray.Dataset
        Dataset made by `linear_dataset`.
    one : DrawnMode
        Undamped mode.
    phases : (k,) array
        Phases of the vibration [rad].
    share : float
        Largest displacement of a point, as a fraction of the mechanism's size.
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
