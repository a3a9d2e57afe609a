"""Selection of the runs and points of a dataset that a figure shows."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from paraflex.arrays import Array
from paraflex.errors import InputError
from paraflex.formatting import is_signs, peak

if TYPE_CHECKING:
    import xarray as xr

    from paraflex.results.drawing import DrawnRun

# Ratio of speeds along the two axes below which the end-effector is at rest along one of them, up to rounding.
_STILL = 1e-9


def place_of(name: str, names: Sequence[str], what: str, field: str = "") -> int:
    """Return the index of a name, such as that of a mode or model; raise InputError if it is not among `names`."""
    if name not in names:
        remedy = "one of " + ", ".join(names)
        raise InputError(f"no such {what} in these results", field=field or what, value=name, remedy=remedy)
    return list(names).index(name)


def names_of(data: xr.Dataset | xr.DataArray | DrawnRun, dim: str) -> list[str]:
    """Return the names along a dimension, such as those of modes, models, bodies or motors."""
    return [str(name) for name in data[dim].values]


def selected(data: xr.Dataset, dim: str, *names: str) -> xr.Dataset:
    """Return the results of some names along a dimension, which is kept."""
    return data.isel({dim: [place_of(name, names_of(data, dim), dim) for name in names]})


def select_run(data: xr.Dataset, mode: str) -> xr.Dataset:
    """Return the run of one mode."""
    return selected(data, "mode", mode).isel(mode=0)


def prototype_pair(data: xr.Dataset) -> tuple[str, str] | None:
    """Return the best floating-frame model and the most independent other one, as compared in Figs. 22 and 23.

    None if there is no such pair.
    """
    names = names_of(data, "model")
    ours = next((name for name in ("second-order", "linear") if name in names), None)
    other = next((name for name in ("segments", "mujoco", "exudyn") if name in names), None)
    return None if ours is None or other is None else (ours, other)


def default_mode(data: xr.Dataset) -> str:
    """Return the mode with most active motors if modes are named by signs, else the first mode."""
    names = names_of(data, "mode")
    return max(names, key=lambda name: name.count("+")) if all(map(is_signs, names)) else names[0]


def one_run(data: xr.Dataset, mode: str | None = None) -> xr.Dataset:
    """Return the run of a mode, by default of `default_mode`; for results without modes the only run."""
    if "mode" not in data.dims:
        if mode is not None:
            raise InputError(
                "these results have no modes", field="mode", value=mode, remedy="leave it out: motors were not driven"
            )
        return data
    return select_run(data, default_mode(data) if mode is None else mode)


def point_number(data: xr.Dataset | DrawnRun, point: str, field: str = "point") -> int:
    """Return the index of a named point of results; the error message does not propose generated points."""
    names = names_of(data, "point")
    if point in names:
        return names.index(point)
    return place_of(point, [name for name in names if "._" not in name], "point", field)


def of_point(run: xr.Dataset, point: str | None) -> xr.Dataset:
    """Return a run with a named point in place of the end-effector.

    The desired motion is removed unless the point is the end-effector itself.

    Raises
    ------
    InputError
        There is no such point, or the results are of an earlier version, without motions of points.
    """
    if point is None or point == run.attrs.get("end_effector_point"):
        return run
    k = point_number(run, point)
    if "point_acceleration" not in run:
        raise InputError(
            "these results hold no motion of points: they are of an earlier version", field="results",
            remedy="run the study again",
        )  # fmt: skip
    parts = {"": "position", "_velocity": "velocity", "_acceleration": "acceleration"}
    moved = {f"end_effector{part}": run[f"point_{name}"].isel(point=k, drop=True) for part, name in parts.items()}
    return run.drop_vars([f"{name}_desired" for name in moved if f"{name}_desired" in run]).assign(moved)


def apart(places: Array, points: Iterable[int], least: float) -> list[int]:
    """Return the first of all points that coincide, at places (samples, points, 2), to a distance."""
    found: list[int] = []
    for k in points:
        if all(peak(places[:, k] - places[:, other]) > least for other in found):
            found.append(k)
    return found


def samples(run: xr.Dataset) -> int:
    """Return the number of samples that a run reached."""
    return samples_of(moving(run).values)


def moving(data: xr.Dataset) -> xr.DataArray:
    """Return what moves in all runs: the end-effector, or the bodies of a mechanism without one."""
    return data["end_effector"] if "end_effector" in data else data["angle"]


def samples_of(values: Array) -> int:
    """Return the number of samples before the first one of values (samples, parts) that is missing."""
    missing = ~np.isfinite(values).all(axis=-1)
    return int(np.argmax(missing)) if missing.any() else missing.size


def moving_directions(run: xr.Dataset) -> list[str]:
    """Return the axes along which the end-effector moves or should move, in any run; all axes if it is at rest."""
    names = names_of(run, "axis")
    parts = [np.nan_to_num(run[name].transpose(..., "axis").values).reshape(-1, len(names))
             for name in ("end_effector_velocity", "end_effector_velocity_desired") if name in run]  # fmt: skip
    speeds = np.max(np.abs(parts), axis=(0, 1))
    return [name for name, speed in zip(names, speeds, strict=True) if speed > _STILL * speeds.max()] or names


def as_runs(data: xr.Dataset, mode: str | None = None) -> xr.Dataset:
    """Return results with a leading dimension of modes: those of one mode if it is given, a run without modes as one.

    The mode of a run without modes is "".
    """
    if "mode" not in data.dims:
        return one_run(data, mode).expand_dims(mode=[""]).transpose("mode", "time", ...)
    if mode is not None:
        data = selected(data, "mode", mode)
    return data.transpose("mode", "time", ...)
