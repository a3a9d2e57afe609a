"""Labelled datasets of reduced linear models: states needed, gains and errors compared to full models; along paths."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array, Complex, Indices, NDArray
from paraflex.errors import InputError
from paraflex.linear import LinearModel, PosesAlong, ReducedModel, reduce, states_needed
from paraflex.linear.reduced import ReductionMethod
from paraflex.linear.reduction import CARRIED
from paraflex.linear.states_needed import DAMPING
from .linear_data import motors_of
from .linear_summary import HOLDINGS
from .reduction_summary import FULL, ONE, OWN, STATIC
from .storage import origin

# Numbers of poses between which bases are interpolated: each halves the distances, until errors are below the limit.
_COUNTS = (2, 3, 5, 9, 17, 33)
# Largest difference of the coordinates of equal poses, in their units.
_SAME = 1e-6
# Number of frequencies of responses, lowest one relative to the highest, and number of compared natural frequencies.
_ALONG_FREQUENCIES, _ALONG_LOWEST, _ALONG_COMPARED = 60, 1e-2, 2
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
            2.0 * np.pi * np.geomspace(_ALONG_LOWEST * until, until, _ALONG_FREQUENCIES) * (1j + DAMPING)
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
    chosen = slice(free, free + _ALONG_COMPARED)
    if few[chosen].size < full[chosen].size or not full[chosen].size:
        return np.nan
    return float(np.max(np.abs(few[chosen] / full[chosen] - 1.0)))


# Number of frequencies of responses, and lowest and highest one relative to `until`.
_FREQUENCIES, _LOWEST, _BEYOND = 400, 1e-2, 2.5
# Number of natural frequencies, with motors free and held, that are compared.
_COMPARED = 6
# Largest number of states for which the lowest frequency with motors held is computed.
_MOST = 48
UNITS = {
    "states": ("fewest states within the error up to the highest frequency; NaN where more than 80 are needed", "1"),
    "natural_frequency": ("undamped natural frequency above zero", "Hz"),
    "held_frequency": ("lowest natural frequency above zero with motors held, by number of states", "Hz"),
    "gain": ("largest gain of all inputs to an output", "unit of the output, by that of the inputs"),
    "error": ("largest gain of the error to an output, over that of the full model", "1"),
    "largest_error": ("largest error up to the highest frequency", "1"),
    "bound": ("bound of the gain of the error of all inputs and outputs together", "of the gains"),
    "frequency": ("frequency of the response", "Hz"),
}


@checked_arguments()
def reduction_dataset(
    models: Sequence[LinearModel],
    states: int | None = None,
    *,
    methods: Sequence[ReductionMethod | str] = (ReductionMethod.CRAIG_BAMPTON, ReductionMethod.MODAL),
    until: float = 40.0,
    error: float = 0.01,
    along: Sequence[PosesAlong] = (),
    parameters: dict[str, Any] | None = None,
) -> xr.Dataset:
    """Return the labelled dataset of reduced linear models of one mechanism, compared with the full ones.

    Parameters
    ----------
    models : sequence of LinearModel
        Linear models of different actuation modes, with the same outputs.
    states : int, optional
        Number of states of the reduced models: see `reduce`.
    methods : sequence of str
        Reduction methods: see `reduce`.
    until : float
        Highest frequency [Hz].
    error : float
        Relative error for which the number of states needed is determined.
    along : sequence of PosesAlong
        Linear models along a path, of the same modes, to determine how far the basis of one pose is accurate; none by
        default.
    parameters : dict, optional
        Requested options, stored as provenance.

    Returns
    -------
    xarray.Dataset
        Dimensions mode, reduction, variant ("full", then each reduction), output, holding (motors free or held), order,
        frequency, kept (states); with `along` also static, basis and place.

    Raises
    ------
    InputError
        The models have different outputs, or no method has a basis for other poses; see also `reduce` and
        `states_needed`.
    """
    needed = states_needed(models, 2.0 * np.pi * until, error=error, methods=methods)
    names = [str(name) for name in needed["reduction"].values]
    few = [[reduce(model, states, method=method) for method in names] for model in models]
    outputs = [one.name for one in models[0].outputs]
    if any([one.name for one in model.outputs] != outputs for model in models):
        raise InputError("have other outputs", field="models", remedy="give models of one mechanism")
    frequency = np.geomspace(_LOWEST * until, _BEYOND * until, _FREQUENCIES)
    gains, errors = _responses(models, few, frequency)
    reached, counts = frequency <= until, np.arange(2, min(_MOST, len(models[0].states)) + 1, 2)
    data: dict[str, Any] = {
        "states": needed["states"],
        "natural_frequency": (("mode", "variant", "holding", "order"), _frequencies(models, few)),
        "held_frequency": (("mode", "reduction", "kept"), _held(models, names, counts)),
        "gain": (("mode", "variant", "output", "frequency"), gains),
        "error": (("mode", "reduction", "output", "frequency"), errors),
        "largest_error": (("mode", "reduction", "output"), errors[..., reached].max(axis=-1)),
        "bound": (("mode", "reduction"), np.array([[np.nan if one.bound is None else one.bound for one in row]
                                                   for row in few])),
    }  # fmt: skip
    coordinates = {
        "mode": [model.mode for model in models], "reduction": names, "variant": [FULL, *names], "output": outputs,
        "output_unit": ("output", [one.unit for one in models[0].outputs]), "holding": list(HOLDINGS),
        "order": np.arange(1, _COMPARED + 1), "frequency": frequency, "kept": counts,
    }  # fmt: skip
    units = dict.fromkeys(one.unit for model in models for one in model.inputs)
    attrs = {
        "kind": "reduction", "mechanism": models[0].mechanism, "about": models[0].about,
        "kept_states": len(few[0][0].states), "full_states": len(models[0].states), "until": until, "accuracy": error,
        "damping_ratio": DAMPING, "input_unit": ", ".join(units), **origin(parameters),
    }  # fmt: skip
    if along:
        method = _carrying(names)
        more = along_variables(along, states, method, until, error)
        data |= more[0]
        coordinates |= more[1]
        attrs |= {"along_method": method.value, "place_unit": along[0].unit}
    out = xr.Dataset(data, coords=coordinates, attrs=attrs)
    for name, (meaning, unit) in (UNITS | (UNITS_ALONG if along else {})).items():
        out[name].attrs = {"long_name": meaning, "units": unit}
    return out


def _carrying(names: Sequence[str]) -> ReductionMethod:
    """Return the first method whose bases can be used in other poses."""
    for method in map(ReductionMethod, names):
        if method in CARRIED:
            return method
    raise InputError("have no basis that other poses could take over", field="methods", value=", ".join(names),
                     remedy="add craig-bampton or rubin")  # fmt: skip


def _responses(
    models: Sequence[LinearModel], few: Sequence[Sequence[ReducedModel]], frequency: Array
) -> tuple[Array, Array]:
    """Return gains (mode, model, output, frequency) and errors (mode, reduction, output, frequency).

    Both are evaluated with the small damping ratio `DAMPING`.
    """
    s = 2.0 * np.pi * frequency * (1j + DAMPING)
    gains, errors = [], []
    for model, reduced in zip(models, few, strict=True):
        full = model.frequency_response(s)
        found = [one.frequency_response(s) for one in reduced]
        gains.append([np.linalg.norm(each, axis=2).T for each in (full, *found)])
        errors.append([output_errors(full, each).T for each in found])
    return np.array(gains), np.array(errors)


def _frequencies(models: Sequence[LinearModel], few: Sequence[Sequence[ReducedModel]]) -> Array:
    """Return the lowest frequencies above zero (mode, model, holding, order) [Hz], NaN for balanced models."""
    out = np.full((len(models), 1 + len(few[0]), len(HOLDINGS), _COMPARED), np.nan)
    for m, (model, reduced) in enumerate(zip(models, few, strict=True)):
        motors = motors_of(model)
        for k, one in enumerate((model, *reduced)):
            if isinstance(one, ReducedModel) and one.basis is None:
                continue
            for h, found in enumerate((one.frequencies, one.held_frequencies(motors))):
                above = found[found > 0.0][:_COMPARED]
                out[m, k, h, : above.size] = above / (2.0 * np.pi)
    return out


def _held(models: Sequence[LinearModel], names: Sequence[str], counts: Indices) -> Array:
    """Return the lowest frequency above zero with motors held (mode, reduction, count) [Hz], NaN without one."""

    def lowest(model: LinearModel, states: int, name: str) -> float:
        if name == ReductionMethod.BALANCED.value:
            return np.nan
        try:
            found = reduce(model, states, method=name).held_frequencies(motors_of(model))
        except InputError:
            # There are fewer states than the coordinates of motors need.
            return np.nan
        above = found[found > 0.0] / (2.0 * np.pi)
        return above[0] if above.size else np.nan

    return np.array([[[lowest(model, int(count), name) for count in counts] for name in names] for model in models])
