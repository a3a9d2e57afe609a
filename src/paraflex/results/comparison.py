"""Comparison of two runs: differences of their metrics, settings and motions."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import scipy
import xarray as xr

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array, Brief
from paraflex.errors import InputError
from paraflex.folders import RUN, kind_of_folder
from paraflex.formatting import number
from paraflex.mechanism.quantities import known
from .kinds import kind_of, wrong_kind
from .loads import load_figures, ranked
from .metrics import METRICS
from .storage import open_results

# Time-dependent variables that are compared, by the kind of results.
_ENERGIES = ("strain_energy", "kinetic_energy")
_MOTIONS: Mapping[str, tuple[str, ...]] = {
    "tracking": ("end_effector", "torque", "angle", "deflection", "stress", *_ENERGIES),
    "motion": (
        "point_position",
        "point_velocity",
        "angle",
        "deflection",
        "stress",
        "joint_force",
        "drive_torque",
        *_ENERGIES,
    ),
}
# Dimensions whose members are compared one by one; components along "axis" are combined to a Euclidean distance.
_PARTS = ("motor", "drive", "body", "point", "joint")
_VERSIONS = ("mechanism", "paraflex_version", "numba_version", "numpy_version")
# Variables that describe the integration, in addition to the metrics marked `of_solver`.
_OF_SOLVER = ("wall_time", "factorisations", "constraint_velocity_max")
# Fewest samples of a cubic spline.
_FEWEST = 4


@dataclass(frozen=True)
class NumberPair:
    """Scalar of a mode in both runs.

    Attributes
    ----------
    mode : str
        Actuation mode; empty for runs without a path.
    name : str
        Name of the variable, followed by that of the motor if any: "peak_torque.tau1".
    unit : str
        Unit of both values.
    first, second : float
        Values in the two runs; NaN if a run has none.
    of_solver : bool
        Whether the number describes the integration rather than the mechanism.
    """

    mode: str
    name: str
    unit: str
    first: float
    second: float
    of_solver: bool = False

    @property
    def difference(self) -> float:
        """Second value minus first value."""
        return self.second - self.first

    @property
    def relative(self) -> float:
        """Difference divided by the magnitude of the first value; NaN if that is zero."""
        return self.difference / abs(self.first) if self.first else float("nan")


@dataclass(frozen=True)
class MotionPair:
    """Time-dependent quantity in both runs.

    Attributes
    ----------
    mode, name, part : str
        Actuation mode, variable, and motor, body, point or joint; the part is empty for a variable without parts.
    unit : str
        Unit of the quantity.
    first, second : float
        Largest magnitudes in the two runs.
    difference : float
        Largest magnitude of the difference (for points the largest distance); NaN if the runs have no time in common.
    time : float
        Time of the largest difference [s].
    """

    mode: str
    name: str
    part: str
    unit: str
    first: float
    second: float
    difference: float
    time: float


@dataclass(frozen=True)
class RunComparison(Brief):
    """Differences between two runs, as returned by `compare`.

    Attributes
    ----------
    kind : str
        Kind of both results, "tracking" or "motion".
    names : (str, str)
        Names of the runs: their folders or files, else "A" and "B".
    numbers : tuple of NumberPair
        Scalars by mode: the largest loads ("stress_max.rod") first, then the others by their relative difference, the
        largest first, and those of the integration last.
    motions : tuple of MotionPair
        Time-dependent quantities.
    settings : mapping of str to (value, value)
        Parameters of the model and of the run that differ, and versions; None if a run has no such value.
    notes : tuple of str
        Members that only one run has, different endings, and different sample times.
    data : (Dataset, Dataset)
        Results of both runs.
    """

    kind: str
    names: tuple[str, str]
    numbers: tuple[NumberPair, ...]
    motions: tuple[MotionPair, ...]
    settings: Mapping[str, tuple[Any, Any]]
    notes: tuple[str, ...]
    data: tuple[xr.Dataset, xr.Dataset] = field(repr=False, compare=False)

    @property
    def modes(self) -> tuple[str, ...]:
        """Modes that both runs have; a single empty name for runs without a path."""
        return _common_modes(*self.data)

    def to_dict(self) -> dict[str, Any]:
        """Return the comparison as plain values for JSON, with None for NaN."""
        modes: dict[str, Any] = {mode: {"numbers": {}, "motions": {}} for mode in self.modes}
        for pair in self.numbers:
            values = (pair.first, pair.second, pair.difference, pair.relative)
            modes[pair.mode]["numbers"][pair.name] = _plain(_WORDS, values) | {"unit": pair.unit}
        for one in self.motions:
            name = f"{one.name}.{one.part}" if one.part else one.name
            values = (one.first, one.second, one.difference, one.time)
            modes[one.mode]["motions"][name] = _plain((*_WORDS[:3], "time"), values) | {"unit": one.unit}
        return {
            "kind": self.kind,
            "first": self.names[0],
            "second": self.names[1],
            "notes": list(self.notes),
            "settings": {name: list(pair) for name, pair in self.settings.items()},
            "modes": modes,
        }


_WORDS = ("first", "second", "difference", "relative")


@checked_arguments()
def compare(
    first: xr.Dataset | str | Path, second: xr.Dataset | str | Path, modes: Sequence[str] = ()
) -> RunComparison:
    """Compare two runs: their metrics, settings and motions.

    Runs of different mechanisms, modes or times are compared in the members that both have; `notes` names the others.

    Parameters
    ----------
    first, second : Dataset, str or Path
        Two runs along paths, or two without; or their folders or files.
    modes : sequence of str
        Modes to compare; by default all that both runs have.

    Raises
    ------
    InputError
        The results are of another kind or of two kinds, have no mode in common, or lack one of `modes`.
    """
    data, names = (_opened(first), _opened(second)), (_name(first, "A"), _name(second, "B"))
    kinds = [kind_of(each) for each in data]
    for kind, name in zip(kinds, names, strict=True):
        if kind not in _MOTIONS:
            raise wrong_kind(kind, _MOTIONS, name)
    if kinds[0] != kinds[1]:
        raise InputError(
            f'results of the kind "{kinds[1]}", and {names[0]} has those of the kind "{kinds[0]}"', field=names[1],
            remedy="compare two runs along a path, or two without",
        )  # fmt: skip
    if modes:
        data = (_with_modes(data[0], modes, names[0]), _with_modes(data[1], modes, names[1]))
    common = _common_modes(*data)
    if not common:
        theirs = "; ".join(f"{name} has {', '.join(_modes(each))}" for name, each in zip(names, data, strict=True))
        raise InputError(
            f"the runs have no mode in common: {theirs}",
            field=names[1],
            remedy="run one of them in a mode of the other",
        )
    notes = [*_differing_members(data, names), *_differing_ends(data, names)]
    runs = [(mode, _run(data[0], mode), _run(data[1], mode)) for mode in common]
    return RunComparison(
        kind=kinds[0],
        names=names,
        numbers=tuple(pair for each in runs for pair in _numbers(*each)),
        motions=tuple(pair for each in runs for pair in _motions(kinds[0], *each)),
        settings=_settings(*data),
        notes=tuple(notes),
        data=data,
    )


def on_times_of(first: xr.Dataset, second: xr.Dataset, name: str) -> tuple[Array, ...]:
    """Return the times that two runs have in common, and the values of a variable at these times in both.

    The times are samples of the first run. The second run is interpolated by cubic splines if its samples differ.
    """
    time, other = first["time"].values, second["time"].values
    here, there = (run[name].transpose("time", ...).values.astype(float) for run in (first, second))
    here_until, there_until = _reached(here), _reached(there)
    if np.array_equal(time, other):
        last = min(here_until, there_until)
        return time[:last], here[:last], there[:last]
    time, here = time[:here_until], here[:here_until]
    if there_until < _FEWEST:
        return time[:0], here[:0], here[:0]
    inside = (time >= other[0]) & (time <= other[there_until - 1])
    there = scipy.interpolate.CubicSpline(other[:there_until], there[:there_until])(time[inside])
    return time[inside], here[inside], there


def _reached(values: Array) -> int:
    """Return the number of samples before the first that is not finite."""
    finite = np.isfinite(values.reshape(values.shape[0], -1)).all(axis=1)
    return int(finite.size if finite.all() else np.argmin(finite))


def _opened(results: xr.Dataset | str | Path) -> xr.Dataset:
    if isinstance(results, xr.Dataset):
        return results
    kind = kind_of_folder(Path(results)) if Path(results).is_dir() else RUN
    if kind not in ("", RUN):
        raise InputError(
            f"holds a {kind}, not a run", field=str(results),
            remedy="name the folder or results.nc of a run, or a trajectory file of a study",
        )  # fmt: skip
    return open_results(results)


def _name(results: xr.Dataset | str | Path, otherwise: str) -> str:
    return otherwise if isinstance(results, xr.Dataset) else str(results)


def _modes(data: xr.Dataset) -> tuple[str, ...]:
    return tuple(map(str, data["mode"].values)) if "mode" in data.dims else ("",)


def _common_modes(first: xr.Dataset, second: xr.Dataset) -> tuple[str, ...]:
    others = _modes(second)
    return tuple(mode for mode in _modes(first) if mode in others)


def _with_modes(data: xr.Dataset, modes: Sequence[str], name: str) -> xr.Dataset:
    if "mode" not in data.dims:
        raise InputError("these results have no modes", field="modes", value=modes[0], remedy="leave it out")
    for mode in modes:
        known(mode, _modes(data), "modes", f"mode in {name}")
    return data.sel(mode=list(modes))


def _run(data: xr.Dataset, mode: str) -> xr.Dataset:
    return data.sel(mode=mode) if "mode" in data.dims else data


def _differing_members(data: tuple[xr.Dataset, xr.Dataset], names: tuple[str, str]) -> Iterator[str]:
    """Yield notes on modes, motors, drives, bodies, points and joints that only one of two runs has."""
    for dim, plural in (("mode", "modes"), *((part, f"{part}s" if part != "body" else "bodies") for part in _PARTS)):
        if not all(dim in each.coords for each in data):
            continue
        members = [list(map(str, each[dim].values)) for each in data]
        for mine, other, name in ((*members, names[0]), (*members[::-1], names[1])):
            only = [each for each in mine if each not in other]
            if only:
                yield f"{plural} in {name} only: {', '.join(only)}"


def _differing_ends(data: tuple[xr.Dataset, xr.Dataset], names: tuple[str, str]) -> Iterator[str]:
    """Yield notes on runs with different final statuses, and on different sample times."""
    for mode in _common_modes(*data):
        ends = [str(_run(each, mode)["status"].item()) for each in data]
        if ends[0] != ends[1]:
            yield f"{f'mode {mode}: ' if mode else ''}{names[0]} is {ends[0]}, {names[1]} {ends[1]}"
    first, second = (each["time"].values for each in data)
    if not np.array_equal(first, second):
        end = min(first[-1], second[-1])
        how = f"motions are compared until {number(end)} s, {names[1]} interpolated by cubic splines"
        yield f"samples at different times: {how}"


def _numbers(mode: str, first: xr.Dataset, second: xr.Dataset) -> list[NumberPair]:
    """Return the scalars of a mode that both runs have."""
    pairs, loads = [], _load_numbers(mode, first, second)
    for name in map(str, first.data_vars):
        values = first[name]
        if name not in second or values.dtype.kind not in "fiu" or not set(values.dims) <= {"motor"}:
            continue
        unit = str(values.attrs.get("units", "1"))
        solver = name in _OF_SOLVER or (name in METRICS and METRICS[name].of_solver)
        parts = [str(part) for part in values["motor"].values] if values.dims else [""]
        for part in parts:
            if part and part not in second["motor"].values:
                continue
            one, other = (float((run[name].sel(motor=part) if part else run[name]).item()) for run in (first, second))
            if np.isfinite([one, other]).any():
                pairs.append(NumberPair(mode, f"{name}.{part}" if part else name, unit, one, other, of_solver=solver))
    return loads + sorted(pairs, key=lambda pair: (pair.of_solver, -_weight(pair)))


def _load_numbers(mode: str, first: xr.Dataset, second: xr.Dataset) -> list[NumberPair]:
    """Return the largest loads of a mode that both runs have: per beam, per prescribed motion, and over all joints."""
    pairs, nothing = [], float("nan")
    both = [load_figures(run) for run in (first, second)]
    for group, numbers in _LOADS.items():
        one, other = (figures.get(group, {}) for figures in both)
        for member in (name for name in one if name in other):
            for key, (name, unit) in numbers.items():
                values = [each[member][key] for each in (one, other)]
                if values != [None, None]:
                    unit = one[member][unit] if unit.endswith("_unit") else unit
                    known = [nothing if value is None else value for value in values]
                    pairs.append(NumberPair(mode, f"{name}.{member}", unit or "1", known[0], known[1]))
    forces = [ranked({"": figures}, "joints", "force_max") for figures in both]
    if all(forces):
        pairs.append(NumberPair(mode, "joint_force_max", "N", forces[0][0][0], forces[1][0][0]))
    return pairs


# Entries of `load_figures` by group: name in a comparison, and the unit or the key of the unit.
_LOADS = {
    "beams": {"stress_max": ("stress_max", "Pa"), "place": ("stress_place", "m"),
              "safety_factor": ("safety_factor", "1")},
    "drives": {"torque_max": ("drive_torque_max", "torque_unit"), "speed_max": ("drive_speed_max", "speed_unit"),
               "power_max": ("drive_power_max", "W")},
}  # fmt: skip


def _weight(pair: NumberPair) -> float:
    """Return the sort key of a number: its relative difference; infinite if one run has none or the first is zero."""
    if pair.first == pair.second:
        return 0.0
    return abs(pair.relative) if np.isfinite(pair.relative) else float("inf")


def _motions(kind: str, mode: str, first: xr.Dataset, second: xr.Dataset) -> Iterator[MotionPair]:
    """Yield the time-dependent quantities of a mode that both runs have."""
    for name in _MOTIONS[kind]:
        if name not in first or name not in second:
            continue
        dim = next((part for part in _PARTS if part in first[name].dims), None)
        for part in [""] if dim is None else [str(each) for each in first[dim].values]:
            if dim is None or part in second[dim].values:
                pair = [run if dim is None else run.sel({dim: part}) for run in (first, second)]
                # All values are NaN for the stress of a rigid body.
                if any(np.isfinite(run[name].values).any() for run in pair):
                    yield _motion(mode, name, part, *pair)


def _motion(mode: str, name: str, part: str, first: xr.Dataset, second: xr.Dataset) -> MotionPair:
    """Compare a quantity of one part in both runs."""
    time, here, there = on_times_of(first, second, name)
    apart = _sizes(there - here)
    at = int(np.argmax(apart)) if apart.size else -1
    nothing = float("nan")
    return MotionPair(
        mode, name, part, str(first[name].attrs.get("units", "1")),
        first=_largest(first[name]),
        second=_largest(second[name]),
        difference=float(apart[at]) if at >= 0 else nothing,
        time=float(time[at]) if at >= 0 else nothing,
    )  # fmt: skip


def _largest(values: xr.DataArray) -> float:
    sizes = _sizes(values.transpose("time", ...).values)
    return float(np.nanmax(sizes)) if np.isfinite(sizes).any() else float("nan")


def _sizes(values: Array) -> Array:
    """Return the magnitudes (samples,) of numbers or of vectors (samples, 2)."""
    return np.abs(values) if values.ndim == 1 else np.linalg.norm(values, axis=-1)


def _settings(first: xr.Dataset, second: xr.Dataset) -> dict[str, tuple[Any, Any]]:
    """Return the parameters and versions that differ."""
    both = [_flat(json.loads(data.attrs.get("parameters", "{}"))) for data in (first, second)]
    for flat, data in zip(both, (first, second), strict=True):
        flat |= {name: data.attrs[name] for name in _VERSIONS if name in data.attrs}
    # Values given by --set are already in the model.
    names = dict.fromkeys(name for flat in both for name in flat if not name.startswith("run.set."))
    return {name: (both[0].get(name), both[1].get(name)) for name in names if both[0].get(name) != both[1].get(name)}


def _flat(tables: Mapping[str, Any], before: str = "") -> dict[str, Any]:
    """Flatten nested tables to values by dotted names, such as "run.tolerance"."""
    flat: dict[str, Any] = {}
    for name, value in tables.items():
        full = f"{before}{name}"
        flat |= _flat(value, f"{full}.") if isinstance(value, Mapping) else {full: value}
    return flat


def _plain(names: Sequence[str], values: Sequence[float]) -> dict[str, Any]:
    return {name: float(value) if np.isfinite(value) else None for name, value in zip(names, values, strict=True)}
