"""What a run is judged by."""

from __future__ import annotations

import numpy as np
import xarray as xr


def tracking_error(data: xr.Dataset) -> xr.DataArray:
    """Root mean square distance of the end-effector from its desired place over the samples (Eq. 64) [m]."""
    squares = ((data["end_effector"] - data["end_effector_desired"]) ** 2).sum("axis", skipna=False)
    return (squares.mean("time", skipna=False) ** 0.5).assign_attrs(long_name="tracking error", units="m")


def peak_torque(data: xr.Dataset) -> xr.DataArray:
    """Largest magnitude of each motor's torque [N m]."""
    return abs(data["torque"]).max("time").assign_attrs(long_name="peak torque", units="N m")


def rms_torque(data: xr.Dataset) -> xr.DataArray:
    """Root mean square of each motor's torque over the run [N m]."""
    return ((data["torque"] ** 2).mean("time") ** 0.5).assign_attrs(long_name="RMS torque", units="N m")


def residual_vibration(data: xr.Dataset, motion_end: float) -> xr.DataArray:
    """Root mean square distance of the end-effector from its own mean after the motion's end [m].

    NaN where the run has no samples after it.
    """
    after = data["end_effector"].where(data["time"] > motion_end, drop=True)
    if after.sizes["time"] == 0:
        values = xr.full_like(data["mode"], np.nan, dtype=float)
    else:
        squares = ((after - after.mean("time", skipna=False)) ** 2).sum("axis", skipna=False)
        values = squares.mean("time", skipna=False) ** 0.5
    return values.assign_attrs(long_name="residual vibration", units="m")
