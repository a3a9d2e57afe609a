"""Charts common to several reports: families of curves by run and by part of the mechanism."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from paraflex.figures.selection import names_of
from paraflex.formatting import display_unit, text_symbol
from paraflex.plots.workspace import round_magnification
from paraflex.report.page import Chart, Curve, Look

# Numbers of colours and of dashes of the page; the latter include the solid line.
N_COLOURS, N_DASHES = 8, 5
DOTTED = 2
# Share of its median above which a curve that begins at zero is drawn on a logarithmic axis.
_RISEN = 0.01
# Charts without their curves. Displacements of ends differ from deflections, which are measured from a link's chord.
ERRORS = Chart(
    "errors", "Tracking error", "distance", log=True, note="Distance of the end-effector from its desired place."
)
STRAIN = Chart("strain", "Strain energy", "strain energy")
TIPS = Chart(
    "deflections", "Displacements of the links' ends across them", "transverse displacement",
    choosing="link", note="Distance of a link's last end from the tangent at its first end.",
)  # fmt: skip


def look(k: int) -> Look:
    """Return colour and dash of the k-th curve; up to 40 curves differ, and up to eight of them in colour."""
    return Look(k % N_COLOURS, (k % N_COLOURS + k // N_COLOURS) % N_DASHES)


def labelled(label: str, unit: str) -> str:
    """Return the label of an axis, with its unit if it has one."""
    return label if unit in ("1", "") else f"{label} [{unit}]"


def largest(values: NDArray[np.float64]) -> float:
    """Return the largest finite magnitude; NaN if there is none."""
    magnitudes = np.abs(values[np.isfinite(values)])
    return float(magnitudes.max()) if magnitudes.size else float("nan")


def errors(data: xr.Dataset) -> xr.DataArray:
    """Return the distance of the end-effector from its desired position [m], over the dimensions of runs and time."""
    gaps = (data["end_effector"] - data["end_effector_desired"]).transpose(..., "axis")
    return gaps.reduce(np.linalg.norm, "axis").assign_attrs(units="m")


def torque_unit(data: xr.Dataset) -> str:
    """Return the unit of motor efforts: "N m", or "N" for linear motors."""
    return str(data["torque"].attrs.get("units", "N m"))


def torque_chart(data: xr.Dataset) -> Chart:
    """Return the chart of motor torques, without its curves."""
    quantity = "force" if torque_unit(data) == "N" else "torque"
    return Chart("torques", f"Motor {quantity}s", quantity, choosing="motor")


def bending(data: xr.Dataset, name: str = "tip_transverse") -> xr.DataArray:
    """Return the displacements of the ends of links that bend."""
    bent = [largest(data["tip_transverse"].sel(body=body).values) > 0.0 for body in data["body"].values]
    return data[name].isel(body=np.flatnonzero(bent))


def followed(
    chart: Chart,
    values: xr.DataArray,
    runs: Sequence[str],
    *,
    desired: xr.DataArray | None = None,
    selecting: str = "mode",
) -> Chart:
    """Return a chart of curves over time: all parts in the selected run or, by choice, one part in all runs.

    Parameters
    ----------
    chart : Chart
        Chart without curves and unit.
    values : (runs, samples, parts) DataArray
        Values in the unit given by their attributes; the last dimension names the parts.
    runs : sequence of str
        Names of the runs.
    desired : (samples, parts) DataArray, optional
        Desired values, drawn dotted.
    selecting : str
        Noun for a run on the page.
    """
    parts = names_of(values, str(values.dims[-1]))
    unit = display_unit(values.attrs["units"], values.values)
    shown = unit.factor * values.values
    wanted = None if desired is None else unit.factor * desired.values
    choices = [f"all {_plural(chart.choosing)}" if len(parts) > 1 else text_symbol(parts[0])] if parts else []
    curves = []
    for r in range(len(runs)):
        for p, part in enumerate(parts):
            own = look(p) if wanted is None else Look(look(p).colour)
            curves.append(Curve(text_symbol(part), shown[r, :, p], run=r, shown=(r,), choice=0, look=own))
    if wanted is not None:
        for p in range(len(parts)):
            curves.append(Curve("desired", wanted[:, p], choice=0, look=Look(look(p).colour, DOTTED), quiet=True))
    for p, part in enumerate(parts if len(runs) > 1 else ()):
        choice = len(choices)
        curves += [Curve(run, shown[r, :, p], run=r, choice=choice, look=look(r)) for r, run in enumerate(runs)]
        if wanted is not None:
            curves.append(Curve("desired", wanted[:, p], choice=choice, look=Look(dash=DOTTED)))
        choices.append(f"{text_symbol(part)}, all {_plural(selecting)}")
    choices = choices if len(choices) > 1 else ()
    return replace(chart, y=labelled(chart.y, unit.name), curves=curves, choices=choices)


def compared(chart: Chart, values: xr.DataArray, runs: Sequence[str]) -> Chart:
    """Return a chart of a quantity (runs, samples) over time in all runs, from a chart without curves and unit."""
    unit = display_unit(values.attrs["units"], values.values)
    shown = [unit.factor * (risen(one) if chart.log else one) for one in values.values]
    curves = [Curve(run, shown[r], run=r, look=look(r)) for r, run in enumerate(runs)]
    return replace(chart, y=labelled(chart.y, unit.name), curves=curves)


def risen(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a positive curve with NaN during its initial rise from zero, which would span many decades."""
    known = values[np.isfinite(values)]
    enough = np.nan_to_num(values) >= _RISEN * (float(np.median(known)) if known.size else 0.0)
    return np.where(np.arange(values.size) >= np.argmax(enough), values, np.nan)


def plane_path(data: xr.Dataset, runs: Sequence[str], *, common: bool = True) -> Chart:
    """Return a chart of the end-effector's paths, with magnified deviations, and the desired path.

    The desired path is common to all runs, or there is one per run.
    """
    actual, desired = (1e3 * data[name].values for name in ("end_effector", "end_effector_desired"))
    curves = []
    for r in range(len(runs)):
        places, way, shown = actual[r], desired[0 if common else r], None if common else (r,)
        if r == 0 or shown:
            curves.append(Curve("desired", way[:, 1], way[:, 0], Look(dash=1), shown=shown))
        curves.append(Curve("actual", places[:, 1], places[:, 0], Look(0), run=r, shown=(r,)))
        times = round_magnification(places - way, float(np.ptp(way, axis=0).max()))
        if times > 1.0:
            far = way + times * (places - way)
            name = f"deviation × {times:g}"
            curves.append(Curve(name, far[:, 1], far[:, 0], Look(1, DOTTED), run=r, shown=(r,)))
    return Chart("path", "End-effector path", "y [mm]", curves, x="x [mm]", equal=True, over_time=False)


def _plural(what: str) -> str:
    return "bodies" if what == "body" else f"{what}s"
