"""Readings of sensors in datasets: their units, the largest, and those that are of one kind of quantity."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import xarray as xr

from paraflex.results.numbers import largest, units_of_each

READING, SENSOR = "sensor_reading", "sensor"
_QUANTITIES = {
    "rad": "angle",
    "m": "distance",
    "rad/s": "angular velocity",
    "m/s": "velocity",
    "m/s^2": "acceleration",
    "1": "strain",
    "N": "force",
    "N m": "moment",
}
_MICRO = 1e6


class SensorGroup(NamedTuple):
    """Readings of one unit.

    Attributes
    ----------
    quantity, unit : str
        "strain" and "µm/m".
    readings : xarray.DataArray
        (..., time, sensor), those that are known, in this unit.
    """

    quantity: str
    unit: str
    readings: xr.DataArray


def sensor_units(data: xr.Dataset) -> list[str]:
    """SI unit of each sensor of results; none of results without sensors."""
    return units_of_each(data[READING], data.sizes[SENSOR]) if READING in data else []


def sensor_groups(data: xr.Dataset) -> list[SensorGroup]:
    """Readings by their units, without sensors that a model has no readings of."""
    units, found = sensor_units(data), []
    for unit in dict.fromkeys(units):
        readings = data[READING].isel({SENSOR: [k for k, one in enumerate(units) if one == unit]})
        readings = readings.transpose(..., "time", SENSOR)
        known = np.isfinite(readings.values).any(axis=tuple(range(readings.ndim - 1)))
        if known.any():
            shown, factor = ("µm/m", _MICRO) if unit == "1" else (unit, 1.0)
            own = (factor * readings.isel({SENSOR: np.flatnonzero(known)})).assign_attrs(units=shown)
            found.append(SensorGroup(_QUANTITIES.get(unit, "reading"), shown, own))
    return found


def sensor_figures(run: xr.Dataset) -> dict[str, dict[str, dict[str, float | str | None]]]:
    """`sensors` with the largest magnitude of each and its unit; empty where results have none."""
    units = sensor_units(run)
    figures = {
        str(name): {"largest": largest(run[READING].sel({SENSOR: name}).values), "unit": unit}
        for name, unit in zip(run[SENSOR].values if units else (), units, strict=True)
    }
    return {"sensors": figures} if figures else {}
