"""Charts of the readings of sensors."""

from collections.abc import Iterator

import numpy as np
import xarray as xr

from paraflex.results.sensors import READING, SENSOR, sensor_units
from paraflex.units import DisplayUnit
from .charts import Axis, Chart
from .entry import figure
from .runs import followed

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
_STRAIN = DisplayUnit("µm/m", 1e6)


@figure(
    "reading of every sensor, a panel for each unit", heading="Sensors", takes="mode", variables=(READING,),
    columns=2, height=40.0,
    missing=("no readings of sensors in these results", "add [sensor.NAME] tables to the model, and run it again"),
)  # fmt: skip
def sensors(data: xr.Dataset) -> Iterator[Chart]:
    """Yield a chart of the readings of sensors over time for each unit, without sensors that have no readings."""
    units = sensor_units(data)
    values = data[READING].transpose("mode", "time", SENSOR)
    known = [s for s in range(len(units)) if np.isfinite(values.values[:, :, s]).any()]
    for k, unit in enumerate(dict.fromkeys(units[s] for s in known)):
        own = [s for s in known if units[s] == unit]
        quantity = _QUANTITIES.get(unit, "reading")
        axis = Axis(quantity, shown=_STRAIN if unit == "1" else None)
        chart = Chart(f"sensors-{k}", f"Sensors: {quantity}", axis, choosing="sensor")
        yield followed(chart, data, values.isel({SENSOR: own}).assign_attrs(units=unit))
