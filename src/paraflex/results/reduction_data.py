"""Labelled dataset of reduced linear models: states needed, frequencies, gains and errors relative to full models."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array, Indices
from paraflex.errors import InputError
from paraflex.linear import LinearModel, PosesAlong, ReducedModel, reduce, states_needed
from paraflex.linear.reduced import ReductionMethod
from paraflex.linear.reduction import CARRIED
from paraflex.linear.states_needed import DAMPING
from .linear_data import motors_of
from .linear_summary import HOLDINGS
from .reduction_along import UNITS_ALONG, along_variables, output_errors
from .reduction_summary import FULL
from .storage import origin

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
