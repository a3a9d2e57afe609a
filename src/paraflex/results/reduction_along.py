"""Errors along a path of reduced models whose basis is that of one pose, or interpolated between several poses."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from paraflex.arrays import Array, Complex
from paraflex.errors import InputError
from paraflex.linear.along import PosesAlong
from paraflex.linear.model import LinearModel
from paraflex.linear.reduced import ReducedModel, ReductionMethod
from paraflex.linear.reduction import reduce
from paraflex.linear.states_needed import DAMPING
from paraflex.results.linear_data import HOLDINGS, motors_of
from paraflex.results.numbers import finite_or_none

OWN, ONE = "of each pose", "of one pose"
# Static shapes: those of each pose ("renewed"), or those of the other poses ("carried"), like the vibration modes.
STATIC = ("renewed", "carried")
# Numbers of poses between which bases are interpolated: each halves the distances, until errors are below the limit.
_COUNTS = (2, 3, 5, 9, 17, 33)
# Largest difference of the coordinates of equal poses, in their units.
_SAME = 1e-6
# Number of frequencies of responses, lowest one relative to the highest, and number of compared natural frequencies.
_FREQUENCIES, _LOWEST, _COMPARED = 60, 1e-2, 2
UNITS_ALONG = {
    "along_error": ("largest error of the responses up to the highest frequency, over the full model's gain", "1"),
    "along_frequency_error": ("largest relative error of the two lowest natural frequencies above zero", "1"),
}


class _Errors(NamedTuple):
    """Errors of reduced models along a path: responses (mode, place) and frequencies (mode, place, holding)."""

    response: Array
    frequency: Array


def along_variables(
    along: Sequence[PosesAlong], states: int | None, method: ReductionMethod, until: float, error: float
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return variables and coordinates of a dataset: errors along a path of reduced models with bases of several poses.

    Parameters
    ----------
    along : sequence of PosesAlong
        Linear models along the path, one sequence for each mode, in the same poses.
    states : int, optional
        Number of states of the reduced models: see `reduce`.
    method : ReductionMethod
        Reduction method.
    until : float
        Highest frequency [Hz].
    error : float
        Limit of the largest error, until which bases are interpolated between more poses.

    Raises
    ------
    InputError
        The modes have different poses.
    """
    places = along[0].places
    if any(not np.array_equal(one.places, places) for one in along):
        raise InputError("have other poses", field="along", remedy="give those of one motion")
    paths = [_Path(one, states, method, until) for one in along]
    own = _errors(paths, lambda path, _: path.own, True)
    nothing = _Errors(*(np.full_like(part, np.nan) for part in own))
    found, remaining = {OWN: [own, own]}, set(STATIC)
    # The path is closed if the last pose equals the first.
    first, last = (along[0].models[k].minimal for k in (0, -1))
    closed = bool(np.max(np.abs(last.point.q - first.point.q) / first.system.units) < _SAME)
    for name, take in _bases(places, closed=closed):
        found[name] = [
            _errors(paths, take, static == STATIC[0]) if static in remaining else nothing for static in STATIC
        ]
        enough = [static for static, each in zip(STATIC, found[name], strict=True) if np.max(each.response) <= error]
        remaining -= set(enough)
        if not remaining:
            break
    # From (basis, static, mode, place, ...) to (mode, static, basis, place, ...).
    response = np.array([[one.response for one in both] for both in found.values()]).swapaxes(0, 2)
    frequency = np.array([[one.frequency for one in both] for both in found.values()]).swapaxes(0, 2)
    variables = {
        "along_error": (("mode", "static", "basis", "place"), response),
        "along_frequency_error": (("mode", "static", "basis", "place", "holding"), frequency),
    }
    return variables, {"static": list(STATIC), "basis": list(found), "place": places}


def _bases(places: Array, *, closed: bool) -> Iterator[tuple[str, Take]]:
    """Yield names of bases, and functions that return the reduced models of a path with them.

    The functions take the path and whether static shapes are renewed.
    """
    yield ONE, lambda path, renewed: [reduce(model, basis=path.one, renewed=renewed) for model in path.along.models]
    for count in (each for each in _COUNTS[closed:] if 2 * each <= places.size + 1):
        chosen = np.round(np.linspace(0, places.size - 1, count)).astype(int)
        parts = np.interp(places, places[chosen], np.arange(count)).tolist()

        def between(
            path: _Path, renewed: bool, chosen: NDArray[np.int64] = chosen, parts: list[float] = parts
        ) -> list[ReducedModel]:
            some = [path.own[k] for k in chosen]
            return [reduce(model, basis=some, part=part, renewed=renewed)
                    for model, part in zip(path.along.models, parts, strict=True)]  # fmt: skip

        yield f"between {count} poses", between


class _Path:
    """Full models of a mode along a path, the models reduced in their own bases, and the one whose basis is carried."""

    def __init__(self, along: PosesAlong, states: int | None, method: ReductionMethod, until: float) -> None:
        self.along: PosesAlong = along
        self.own: list[ReducedModel] = [reduce(model, states, method=method) for model in along.models]
        elsewhere = along.elsewhere
        self.one: ReducedModel = self.own[0] if elsewhere is None else reduce(elsewhere, states, method=method)
        self.full: list[_Measured] = [_Measured(model, until) for model in along.models]


class _Measured:
    """Frequency responses and natural frequencies of a full model, the reference for reduced models."""

    def __init__(self, model: LinearModel, until: float) -> None:
        self.s: NDArray[np.complexfloating[Any, Any]] = (
            2.0 * np.pi * np.geomspace(_LOWEST * until, until, _FREQUENCIES) * (1j + DAMPING)
        )
        self.response: Complex = model.frequency_response(self.s)
        self.motors: list[str] = motors_of(model)
        self.frequencies: list[Array] = [model.frequencies, model.held_frequencies(self.motors)]

    def errors(self, few: ReducedModel) -> tuple[float, list[float]]:
        """Return the largest errors of the response, and of the frequencies with motors free and held."""
        error = np.max(output_errors(self.response, few.frequency_response(self.s)), initial=0.0)
        both = (few.frequencies, few.held_frequencies(self.motors))
        return float(error), [_relative(*pair) for pair in zip(both, self.frequencies, strict=True)]


Take = Callable[[_Path, bool], list[ReducedModel]]


def _errors(paths: Sequence[_Path], take: Take, renewed: bool) -> _Errors:
    """Return the errors of the reduced models that `take` returns for each path."""
    pairs = [[full.errors(few) for full, few in zip(path.full, take(path, renewed), strict=True)] for path in paths]
    return _Errors(np.array([[one[0] for one in row] for row in pairs]),
                   np.array([[one[1] for one in row] for row in pairs]))  # fmt: skip


def output_errors(full: Complex, few: Complex) -> Array:
    """Return the relative error (k, outputs) of responses (k, outputs, inputs).

    It is the norm of the error over the inputs, divided by that of the full model; zero where the latter is zero.
    """
    size = np.linalg.norm(full, axis=2)
    return np.linalg.norm(few - full, axis=2) / np.where(size > 0.0, size, np.inf)


def _relative(few: Array, full: Array) -> float:
    """Return the largest relative error of the lowest frequencies above zero, NaN if the reduced model has too few."""
    free = int(np.sum(full == 0.0))
    chosen = slice(free, free + _COMPARED)
    if few[chosen].size < full[chosen].size or not full[chosen].size:
        return np.nan
    return float(np.max(np.abs(few[chosen] / full[chosen] - 1.0)))


def along_summary(data: xr.Dataset, mode: str) -> dict[str, Any]:
    """Return the errors along a path of reduced models of a mode as plain numbers, by static shapes and basis."""
    error = float(data.attrs["accuracy"])

    def of(run: xr.Dataset) -> dict[str, Any]:
        frequency = run["along_frequency_error"].max("place")
        return {
            "largest_error": float(run["along_error"].max()),
            **{f"frequency_error_{name}": finite_or_none(float(frequency.sel(holding=name))) for name in HOLDINGS},
            "within": within(run["along_error"].values, data["place"].values, error),
        }

    bases = {static: {str(name): data.sel(mode=mode, static=static, basis=name) for name in data["basis"].values}
             for static in STATIC}  # fmt: skip
    return {static: {name: of(run) for name, run in runs.items() if run["along_error"].notnull().all()}
            for static, runs in bases.items()}  # fmt: skip


class AlongRow(NamedTuple):
    """Errors along a path of the reduced models of a mode with bases of some poses.

    `within` is the longest interval of the path in which the errors of the responses are below the limit.
    """

    mode: str
    static_shapes: str
    vibrations: str
    response: float
    free: float | None
    held: float | None
    within: str


def along_rows(data: xr.Dataset) -> Iterator[AlongRow]:
    """Yield the rows of a table of all bases; none if no path was requested."""
    places = data["place"].values if "along_error" in data else np.zeros(0)
    for mode in map(str, data["mode"].values) if places.size else ():
        for static, runs in along_summary(data, mode).items():
            for name, found in runs.items():
                if name == OWN and static != STATIC[0]:
                    continue
                shapes = OWN if static == STATIC[0] else name
                free, held = (found[f"frequency_error_{holding}"] for holding in HOLDINGS)
                interval = _interval(found["within"], places)
                yield AlongRow(mode, shapes, name, found["largest_error"], free, held, interval)


def _interval(at: tuple[float, float] | None, places: Array) -> str:
    if at is None:
        return "nowhere"
    return "all" if at == (places[0], places[-1]) else f"{at[0]:.2g}-{at[1]:.2g}"


def along_heads(data: xr.Dataset) -> tuple[str, str]:
    """Return the title of the table of `along_rows`, and the head of its last column."""
    attrs, unit = data.attrs, data.attrs["place_unit"]
    title = (
        f"Bases of other poses, {attrs['along_method']}: errors at {data.sizes['place']} poses along "
        f"{float(data['place'][-1]):.3g} {unit} up to {float(attrs['until']):g} Hz"
    )
    return title, f"{100.0 * float(attrs['accuracy']):.3g} % at [{unit}]"


def basis_name(static: str, name: str) -> str:
    """Return the legend of a line in a figure: which shapes are those of which poses."""
    kept = "" if name == OWN else "vibrations " if static == STATIC[0] else "all shapes "
    return f"{kept}{name}"


def within(errors: Array, places: Array, error: float) -> tuple[float, float] | None:
    """Return the ends of the longest interval of places where errors (k,) do not exceed a limit; None without one."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], errors <= error, [False]]).astype(int)))
    if not edges.size:
        return None
    firsts, lasts = edges[::2], edges[1::2] - 1
    longest = int(np.argmax(places[lasts] - places[firsts]))
    return float(places[firsts[longest]]), float(places[lasts[longest]])
