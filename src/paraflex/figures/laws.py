"""Chart and table of a comparison of control laws in several actuation modes."""

from collections.abc import Iterator

import numpy as np
import xarray as xr

from paraflex.results.metrics import METRICS, VALIDITY, metric_label
from paraflex.units import PERCENT
from .charts import Axis, Chart, Curve, Mark, is_wide, look
from .entry import figure
from .selection import names_of
from .tables import Column, Table

# Metrics shown first; others fill the remaining panels.
_FIRST = ("tracking_rms_motion", "tracking_rms", "residual_vibration", "peak_torque_max")
_PANELS = 3
_MARKS: tuple[Mark, ...] = ("dot", "square", "triangle", "diamond")
# Share of a law's line over which its modes are spread.
_BAND = 0.6
# Internal torques below this share of the peak torque are rounding errors.
_ROUNDING = 1e-8


@figure("error, vibration and largest torque of control laws in all modes", written_as="law_comparison",
        missing=("no law ran in any mode", "see the reasons in laws.json"), columns=_PANELS, curves=40)  # fmt: skip
def law_comparison(data: xr.Dataset) -> Iterator[Chart]:
    """Yield charts of the tracking error, residual vibration and largest torque of every control law, by mode.

    A cross at the edge marks a run that did not reach its end, a ring a run beyond the validity of the model.
    """
    laws, modes = names_of(data, "law"), names_of(data, "mode")
    beyond = np.zeros((len(modes), len(laws)), dtype=bool)
    if VALIDITY in data:
        beyond = data[VALIDITY].transpose("mode", "law").values > 1.0
    for name in _metrics(data):
        values = data[name].transpose("mode", "law").values
        # Marks of failures are at zero, or on a logarithmic axis left of all values.
        edge = 0.8 * float(np.min(values[values > 0.0])) if is_wide(values) else 0.0
        curves = []
        for k, mode in enumerate(modes):
            # The marks of the modes are spread within the line of a law.
            places = np.arange(len(laws)) + (0.0 if len(modes) == 1 else _BAND * (k / (len(modes) - 1) - 0.5))
            own, missing = look(k)._replace(dash=0), np.isnan(values[k])
            curves.append(Curve(f"mode {mode}", places, np.where(beyond[k], np.nan, values[k]), own,
                                mark=_MARKS[k % len(_MARKS)]))  # fmt: skip
            curves.append(Curve("", places, np.where(beyond[k], values[k], np.nan), own, mark="ring"))
            if missing.any():
                curves.append(Curve("", places[missing], np.full(int(missing.sum()), edge), own, mark="cross"))
        if (data["status"].values != "complete").any():
            curves.append(Curve("not run to the end", [], [], mark="cross"))
        if beyond.any():
            curves.append(Curve("beyond what the model can describe", [], [], mark="ring"))
        yield Chart(name, metric_label(name), Axis("", names=laws), curves,
                    Axis("", data[name].attrs["units"], log=True, low=None if is_wide(values) else 0.0))  # fmt: skip


def _metrics(data: xr.Dataset) -> list[str]:
    """Return at most three metrics with finite values, those of `_FIRST` first."""
    there = [name for name in metrics_of(data) if name != VALIDITY]
    order = [name for name in _FIRST if name in there] + [name for name in there if name not in _FIRST]
    return [name for name in order if np.isfinite(data[name].values).any()][:_PANELS]


def metrics_of(data: xr.Dataset) -> tuple[str, ...]:
    """Return the names of the metrics of a comparison."""
    return tuple(str(name) for name in data.data_vars if str(name).partition(".")[0] in METRICS)


def law_table(data: xr.Dataset) -> Table:
    """Return the table of all metrics, with a row for each law in each mode."""
    laws, modes = names_of(data, "law"), names_of(data, "mode")
    status = data["status"].transpose("mode", "law").values.ravel()
    columns = [
        Column("mode", [mode if k == 0 else "" for mode in modes for k in range(len(laws))]),
        Column("law", laws * len(modes)),
        *([] if (status == "complete").all() else [Column("status", list(map(str, status)))]),
    ]
    for name in metrics_of(data):
        values = data[name]
        if (name, "peak_torque_max" in data) == ("internal_torque_max", True):
            values = values.where(~(values < _ROUNDING * data["peak_torque_max"]), 0.0)
        if name != VALIDITY:
            share = PERCENT if name.endswith("_share") else None
            # An incomplete run has no value.
            cells = np.where(status == "complete", values.transpose("mode", "law").values.ravel(), np.nan)
            columns.append(Column(metric_label(name), list(cells), values.attrs["units"], digits=3, shown=share))
    return Table(f"{data.attrs['mechanism']}: control laws", columns)
