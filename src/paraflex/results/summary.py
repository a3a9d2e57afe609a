"""A study's figures as plain numbers: what `summary.json` holds."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import xarray as xr

from paraflex.results.validity import validity_summary

_COUNTS = ("steps", "rejected", "newton_iterations", "factorisations")
_FIGURES = (
    "tracking_rms",
    "residual_vibration",
    "wall_time",
    "constraint_position_max",
    "constraint_velocity_max",
    "energy_balance_max",
)


def summary(data: xr.Dataset, failed: dict[str, str] | None = None) -> dict[str, Any]:
    """Figures of every mode, parameters and version.

    Parameters
    ----------
    data : xarray.Dataset
        From `tracking_dataset`.
    failed : dict, optional
        Modes that could not be run at all, each with its reason.

    Returns
    -------
    dict
        `modes.<mode>` with tracking_rms, peak_torque and rms_torque per motor, end_effector_final and the solver's
        figures, and validity (None of rigid bodies); `parameters`; `version`. A figure that was not reached is None.
    """
    modes: dict[str, Any] = {}
    for name in data["mode"].values:
        run = data.sel(mode=name)
        figures: dict[str, Any] = {"status": str(run["status"].item())}
        if figures["status"] != "complete":
            figures["message"] = str(run["message"].item())
        if figures["status"] == "stopped":
            figures |= {"event": str(run["event"].item()), "event_time": run["event_time"].item()}
        figures |= {key: finite_or_none(run[key].item()) for key in _FIGURES}
        figures |= {key: int(run[key].item()) for key in _COUNTS}
        for key in ("peak_torque", "rms_torque"):
            figures[key] = {str(m): finite_or_none(run[key].sel(motor=m).item()) for m in run["motor"].values}
        figures["end_effector_final"] = [finite_or_none(x) for x in run["end_effector"].isel(time=-1).values]
        figures["actuation_condition_max"] = finite_or_none(np.max(run["actuation_condition"].values))
        figures["validity"] = validity_summary(run)
        modes[str(name)] = figures
    for name, reason in (failed or {}).items():
        modes[name] = {"status": "failed", "message": reason}
    return {
        "mechanism": data.attrs["mechanism"],
        "modes": modes,
        "parameters": json.loads(data.attrs["parameters"]),
        "version": data.attrs["paraflex_version"],
    }


def finite_or_none(value: float) -> float | None:
    """A number as JSON can hold it."""
    return float(value) if math.isfinite(value) else None
