"""Errors along a path of reduced models whose basis is that of one pose, or interpolated between several poses."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from paraflex.arrays import Array, Complex, Indices, NDArray
from paraflex.errors import InputError
from paraflex.linear import LinearModel, PosesAlong, ReducedModel, reduce
from paraflex.linear.reduced import ReductionMethod
from paraflex.linear.states_needed import DAMPING
from .linear_data import motors_of
from .reduction_summary import ONE, OWN, STATIC

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


def _bases(places: Array, *, closed: bool) -> "Iterator[tuple[str, Take]]":
    """Yield names of bases, and functions that return the reduced models of a path with them.

    The functions take the path and whether static shapes are renewed.
    """

    def of_one(path: _Path, renewed: bool) -> list[ReducedModel]:
        # The basis of a pose need not be carried to that pose.
        return [path.one if model is path.one.full else reduce(model, basis=path.one, renewed=renewed)
                for model in path.along.models]  # fmt: skip

    yield ONE, of_one
    for count in (each for each in _COUNTS[closed:] if 2 * each <= places.size + 1):
        chosen = np.round(np.linspace(0, places.size - 1, count)).astype(int)
        parts = np.interp(places, places[chosen], np.arange(count)).tolist()

        def between(
            path: _Path, renewed: bool, chosen: Indices = chosen, parts: list[float] = parts
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
