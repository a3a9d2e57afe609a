"""Readings of sensors in datasets: units, largest values, and groups of equal unit."""

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
    """Sensor readings of one unit.

    Attributes
    ----------
    quantity, unit : str
        Physical quantity and printed unit, such as "strain" and "µm/m".
    readings : xarray.DataArray
        Readings (..., time, sensor) in this unit, without sensors that have none.
    """

    quantity: str
    unit: str
    readings: xr.DataArray


def sensor_units(data: xr.Dataset) -> list[str]:
    """Return the SI unit of each sensor; empty for results without sensors."""
    return units_of_each(data[READING], data.sizes[SENSOR]) if READING in data else []


def sensor_groups(data: xr.Dataset) -> list[SensorGroup]:
    """Group readings by their units, without sensors that have no readings in the model."""
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
    """Return `sensors` with the largest magnitude of each and its unit; empty for results without sensors."""
    units = sensor_units(run)
    figures = {
        str(name): {"largest": largest(run[READING].sel({SENSOR: name}).values), "unit": unit}
        for name, unit in zip(run[SENSOR].values if units else (), units, strict=True)
    }
    return {"sensors": figures} if figures else {}
