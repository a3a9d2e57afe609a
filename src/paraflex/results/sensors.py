"""Readings of sensors in datasets: units and largest values."""

import xarray as xr

from .numbers import largest, units_of_each

READING, SENSOR = "sensor_reading", "sensor"


def sensor_units(data: xr.Dataset) -> list[str]:
    """Return the SI unit of each sensor; empty for results without sensors."""
    return units_of_each(data[READING], data.sizes[SENSOR]) if READING in data else []


def sensor_figures(run: xr.Dataset) -> dict[str, dict[str, dict[str, float | str | None]]]:
    """Return `sensors` with the largest magnitude of each and its unit; empty for results without sensors."""
    units = sensor_units(run)
    figures = {
        str(name): {"largest": largest(run[READING].sel({SENSOR: name}).values), "unit": unit}
        for name, unit in zip(run[SENSOR].values if units else (), units, strict=True)
    }
    return {"sensors": figures} if figures else {}
