"""Charts of quantities of runs over time: parts of the mechanism in one run, or one part in all runs."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import xarray as xr

from paraflex.arrays import Array
from paraflex.errors import InputError
from paraflex.formatting import peak, text_symbol
from .charts import DOTTED, Axis, Chart, Curve, Look, Span, look
from .selection import moving, names_of, samples_of

MOST_SAMPLES = 2000
# Share of its median above which a curve that begins at zero is drawn on a logarithmic axis.
_RISEN = 0.01
# The largest deviation from a path is shown as at most this share of the path's extent.
_SHOWN_DEVIATION = 0.15


def run_names(data: xr.Dataset) -> list[str]:
    """Return the names of runs in legends: "mode +-+-", or another noun; empty for a run without modes."""
    noun = data["mode"].attrs.get("noun", "mode")
    return [f"{noun} {name}".lstrip() if name else "" for name in names_of(data, "mode")]


def stopped_runs(data: xr.Dataset) -> list[bool]:
    """Return whether each run (mode, time, ...) ended before the last sample."""
    return [0 < samples_of(each) < data.sizes["time"] for each in moving(data).transpose("mode", "time", ...).values]


def after_motion(data: xr.Dataset) -> list[Span]:
    """Return the time after the desired motion; empty if the runs end with it."""
    time = data["time"].values
    end = float(data.attrs.get("motion_end", time[-1]))
    return [Span(end, float(time[-1]), "after the desired motion")] if end < time[-1] else []


def followed(chart: Chart, data: xr.Dataset, values: xr.DataArray, desired: xr.DataArray | None = None) -> Chart:
    """Return a chart of curves over time: all parts in the selected run or, by choice, one part in all runs.

    Parameters
    ----------
    chart : Chart
        Chart without curves, choices and unit; its `choosing` is the noun for a part.
    data : xarray.Dataset
        Runs, see `selection.as_runs`.
    values : (runs, samples, parts) DataArray
        Values with their SI unit as attribute; the last dimension names the parts.
    desired : (samples, parts) DataArray, optional
        Desired values.
    """
    parts, runs, stopped = names_of(values, str(values.dims[-1])), run_names(data), stopped_runs(data)
    shown, wanted = values.values, None if desired is None else desired.values
    several = len(parts) > 1
    curves = []
    for p, part in enumerate(map(text_symbol, parts)):
        own = look(p) if wanted is None else Look(look(p).colour)
        first = 0 if several else None
        for r in range(len(runs)):
            curves.append(Curve(part, shown[r, :, p], look=own, run=r, shown=(r,), choice=first, stopped=stopped[r]))
        if wanted is not None:
            curves.append(Curve("desired", wanted[:, p], look=Look(own.colour, DOTTED), choice=first, desired=True,
                                quiet=True))  # fmt: skip
    for p, part in enumerate(map(text_symbol, parts if several else ())):
        for r, run in enumerate(runs):
            curves.append(Curve(run or part, shown[r, :, p], look=look(r), run=r, choice=1 + p, stopped=stopped[r]))
        if wanted is not None:
            curves.append(Curve("desired", wanted[:, p], look=Look(dash=DOTTED), choice=1 + p, desired=True))
    choices = [f"all {chart.choosing}s", *map(text_symbol, parts)] if several else []
    curves = [curve for curve in curves if np.isfinite(curve.y).any()]
    return replace(
        chart, y=_in_unit(chart, values), curves=curves, choices=choices, overview=several, spans=after_motion(data)
    )  # fmt: skip


def compared(chart: Chart, data: xr.Dataset, values: xr.DataArray) -> Chart:
    """Return a chart of a quantity (runs, samples) over time in all runs, from a chart without curves and unit.

    On a logarithmic axis the initial rise from zero is left out.
    """
    shown = [risen(one) if chart.axis(None).log else one for one in values.values]
    stopped = stopped_runs(data)
    curves = [Curve(run, shown[r], look=look(r), run=r, stopped=stopped[r]) for r, run in enumerate(run_names(data))]
    return replace(chart, y=_in_unit(chart, values), curves=curves, spans=after_motion(data))


def of_names(chart: Chart, data: xr.Dataset, curves: Sequence[tuple[str, Array]], *, first: int = 0) -> Chart:
    """Return a chart of named quantities over time in the selected run.

    Parameters
    ----------
    chart : Chart
        Chart without curves.
    data : xarray.Dataset
        Runs, see `selection.as_runs`.
    curves : sequence of (str, (runs, samples) array)
        Names and values in the SI unit of the chart; curves without finite values are left out.
    first : int
        Number of the first look.
    """
    stopped = stopped_runs(data)
    found = [
        Curve(name, values[r], look=look(first + k), run=r, shown=(r,), stopped=stopped[r])
        for k, (name, values) in enumerate(curves) for r in range(len(values)) if np.isfinite(values[r]).any()
    ]  # fmt: skip
    return replace(chart, curves=found, spans=after_motion(data))


def _in_unit(chart: Chart, values: xr.DataArray) -> Axis:
    return replace(chart.axis(None), unit=str(values.attrs.get("units", chart.axis(None).unit)).replace("^2", "²"))


def ranges(values: Array, axis: int = 0) -> Array:
    """Return the ranges of the finite values along an axis; 0 where there are none."""
    known = np.isfinite(values)
    least, most = (limit(values, axis=axis, where=known, initial=initial)
                   for limit, initial in ((np.min, np.inf), (np.max, -np.inf)))  # fmt: skip
    return np.maximum(most - least, 0.0)


def risen(values: Array) -> Array:
    """Return a positive curve with NaN during its initial rise from zero, which would span many decades."""
    known = values[np.isfinite(values)]
    if not known.size:
        return values
    enough = np.nan_to_num(values) >= _RISEN * float(np.median(known))
    return np.where(np.arange(values.size) >= np.argmax(enough), values, np.nan)


def check_magnification(value: float | None) -> None:
    """Raise InputError unless a magnification is a positive number, or None."""
    if value is not None and not (math.isfinite(value) and value > 0.0):
        raise InputError("not a magnification", field="magnification", value=value, remedy="give a positive number")


def round_magnification(deviation: Array, extent: float) -> float:
    """Return the largest of 1, 2, 5, 10, ... that keeps a deviation (k, 2) small relative to the extent of the path.

    It is 1 if the deviation is negligible.
    """
    largest = peak(np.linalg.norm(deviation, axis=1))
    if not largest > 1e-9 * extent:
        return 1.0
    room = _SHOWN_DEVIATION * extent / largest
    if room < 1.0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(room))
    return power * max(digit for digit in (1.0, 2.0, 5.0) if digit * power <= room)


def thinned(data: xr.Dataset) -> xr.Dataset:
    """Return every n-th sample of runs and of their controllers if there are more than a chart can show."""
    long = {dim: size for dim, size in data.sizes.items() if str(dim) == "time" or str(dim).startswith("sample_")}
    return data.isel({dim: slice(None, None, -(-size // MOST_SAMPLES) or 1) for dim, size in long.items()})
