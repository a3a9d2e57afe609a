"""Abscissae of curves in place of time: angles and travels of joints, coordinates of points."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import xarray as xr

from paraflex.arrays import Array, brief
from paraflex.errors import InputError, listed, suggestion
from paraflex.formatting import peak, text_symbol
from paraflex.results.loads import sliding_joints
from .charts import TIME, Axis, Chart, Curve
from .run_motion import moving_points
from .runs import ranges
from .selection import names_of

# Share of the largest motion of its unit, and of the magnitude of the values, below which a quantity is at rest.
_STILL, _ROUNDED = 1e-6, 1e-9
# Largest number of joints that a page offers.
_MOST_JOINTS = 12


class Abscissa(NamedTuple):
    """Joint "crank" or coordinate of a point "stage.T.x" over which curves are drawn.

    `values` (runs, samples) are in the SI unit of the axis, in the runs of curves. `moves` is whether they change by
    more than errors of integration in any run.
    """

    name: str
    axis: Axis
    values: Array
    moves: bool

    __repr__ = brief


def abscissae(data: xr.Dataset) -> list[Abscissa]:
    """Return all quantities of runs (see `selection.as_runs`) over which curves can be drawn."""
    named, parts, points, places = list[tuple[str, Axis]](), list[Array](), list[str](), None
    if "joint_coordinate" in data and "joint_kind" in data:
        for name, slides in zip(names_of(data, "joint"), sliding_joints(data), strict=True):
            word, unit = ("travel", "m") if slides else ("angle", "rad")
            named.append((name, Axis(f"{word} of {text_symbol(name)}", unit)))
        parts.append(_of_runs(data["joint_coordinate"], "joint"))
    if "point_position" in data:
        points, places = names_of(data, "point"), data["point_position"]
    elif "end_effector_point" in data.attrs:
        points, places = [str(data.attrs["end_effector_point"])], data["end_effector"].expand_dims("point")
    if places is not None:
        named += [(f"{one}.{way}", Axis(f"{way} of {one}", "m")) for one in points for way in names_of(data, "axis")]
        parts.append(_of_runs(places, "point", "axis"))
    if not named:
        return []
    values, units = np.concatenate(parts), np.array([axis.unit for _, axis in named])
    travel = ranges(values, axis=2).max(axis=1)
    least = {
        unit: max(_STILL * travel[units == unit].max(), _ROUNDED * max(peak(values[units == unit]), unit == "rad"))
        for unit in dict.fromkeys(units)
    }
    return [Abscissa(name, axis, each, bool(most > least[axis.unit]))
            for (name, axis), each, most in zip(named, values, travel, strict=True)]  # fmt: skip


def _of_runs(array: xr.DataArray, *dims: str) -> Array:
    """Return values (members, runs, samples); runs of a verification are those of all models, mode by mode."""
    values = array.transpose(*dims, "mode", ..., "time").values
    return values.reshape(int(np.prod([array.sizes[dim] for dim in dims])), -1, values.shape[-1])


def offered(data: xr.Dataset) -> list[Abscissa]:
    """Return the abscissae that a page offers: joints that move, and coordinates of the points that travel most."""
    found, joints = [one for one in abscissae(data) if one.moves], names_of(data, "joint") if "joint" in data else []
    points = names_of(data, "point") if "point_position" in data else []
    ends = tuple(f"{points[k]}." for k in moving_points(data)) if points else ""
    turning = [one for one in found if one.name in joints][:_MOST_JOINTS]
    return turning + [one for one in found if one.name not in joints and one.name.startswith(ends)]


def find_abscissa(data: xr.Dataset, name: str, field: str = "over") -> Abscissa:
    """Return the abscissa with a name; raise InputError if the results do not have it or it does not move."""
    found = {one.name: one for one in abscissae(data)}
    moving = [TIME.name, *(one.name for one in found.values() if one.moves)]
    if name not in found:
        problem = "no joint or coordinate of a point with this name in these results"
        remedy = f'write "{name}.x" or "{name}.y"' if f"{name}.x" in found else suggestion(name, moving)
        if (owner := name.rpartition(".")[0]) in found:
            remedy = f'write "{owner}", the coordinate of the joint'
        raise InputError(problem, field=field, value=name, remedy=remedy)
    if not found[name].moves:
        raise InputError("does not move in these results", field=field, value=name, remedy=f"one of {listed(moving)}")
    return found[name]


def drawn_over(charts: Iterable[Chart], data: xr.Dataset, name: str) -> list[Chart]:
    """Return charts over another abscissa than time, see `find_abscissa`; those that are not over time are unchanged.

    Desired values are drawn over the abscissa of a run at the same time. Raise InputError if no chart is over time.
    """
    charts = list(charts)
    if not any(chart.over_time for chart in charts):
        raise InputError("this figure has no curves over time", field="over", value=name, remedy="leave it out")
    found, time = find_abscissa(data, name), data["time"].values
    return [replace(chart, x=found.axis, spans=(), curves=list(_curves(chart, found.values, time)))
            if chart.over_time else chart for chart in charts]  # fmt: skip


def _curves(chart: Chart, values: Array, time: Array) -> Iterator[Curve]:
    for curve in chart.curves:
        for run in range(len(values)) if curve.run is None else [curve.run]:
            # Controllers have sample times of their own.
            x = values[run] if curve.x is None else np.interp(np.asarray(curve.x, dtype=float), time, values[run])
            shown = (run,) if curve.run is None and len(values) > 1 else None
            yield replace(curve, x=x, run=run, shown=curve.shown or shown)
