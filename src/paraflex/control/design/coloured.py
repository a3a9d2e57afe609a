"""Coloured disturbances: noise through filters, whose states are added to those of the plant."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import scipy

from paraflex.arrays import Array
from paraflex.control.loop.filters import transfer_function
from paraflex.dynamics.state_space import StateSpace
from paraflex.errors import InputError
from paraflex.mechanism.quantities import all_known, positive
from .sampled import NamedMatrices, SampledPlant, as_sampled, discretise, named_matrices

# Names of the noise inputs of the filters.
_NOISE = "{} noise".format


def disturbed_plant(model: Any, period: float, delay: float, coloured: Mapping[str, Any]) -> tuple[SampledPlant, Array]:
    """Return the sampled plant of a model whose inputs are disturbed by filtered noise.

    The noise is constant between samples; the filters are sampled exactly, as is the model.

    Parameters
    ----------
    model, period, delay
        See `as_sampled`.
    coloured : mapping of str to (float, Filter)
        Standard deviation of the disturbance [N m, N], and the filter that shapes the noise, by input.

    Returns
    -------
    SampledPlant
        Sampled plant; its own states are those of the model, then those of the filters.
    (n, filters) array
        Noise input matrix: contribution of noise of unit variance to the states from sample to sample.

    Raises
    ------
    InputError
        See `discretise`; an unknown input, a value that is not a pair, a deviation that is not positive, or a filter
        that is not stable.
    """
    if not coloured:
        plant = as_sampled(model, period, delay)
        return plant, np.zeros((len(plant.states), 0))
    named = named_matrices(model)
    all_known(coloured, named.inputs, "coloured", "name")
    filters = [_scaled(*deviation_and_filter(name, given), period) for name, given in coloured.items()]
    both = discretise(_filtered(named, list(coloured), filters), period, delay)
    noises = [both.inputs.index(_NOISE(name)) for name in coloured]
    plant = both.select(named.inputs)
    noise = np.zeros((len(plant.states), len(coloured)))
    noise[: plant.own] = both.G[: plant.own, noises]
    return plant, noise


def deviation_and_filter(name: str, given: Any) -> tuple[float, StateSpace]:
    """Return the standard deviation of a named disturbance, and the filter that shapes the noise.

    Raises
    ------
    InputError
        A value that is not a pair, a deviation that is not positive, or a filter that is not stable.
    """
    field = f"coloured.{name}"
    try:
        deviation, through = given
        deviation = float(deviation)
    except (TypeError, ValueError):
        raise InputError(
            "is not a pair", field=field, value=given,
            remedy="give (standard deviation, cut-off frequency in Hz), such as (0.5, 10.0)",
        ) from None  # fmt: skip
    positive(deviation, field, "N m or N")
    return deviation, StateSpace(*scipy.signal.tf2ss(*transfer_function(through, field)))


def _scaled(deviation: float, through: StateSpace, period: float) -> StateSpace:
    """Return the filter scaled to give this standard deviation for noise of unit variance held for a period."""
    A, B, C, D, _ = scipy.signal.cont2discrete(through, period)
    P = scipy.linalg.solve_discrete_lyapunov(A, B @ B.T)
    gain = deviation / float(np.sqrt(C @ P @ C.T + D**2).item())
    return StateSpace(through.A, through.B, gain * through.C, gain * through.D)


def _filtered(named: NamedMatrices, at: list[str], filters: list[StateSpace]) -> NamedMatrices:
    """Return the model with filters before some inputs: x' = A x + B (u + F w)."""
    A, B, C, D = named.matrices
    own, into, outputs, direct = (scipy.linalg.block_diag(*parts) for parts in zip(*filters, strict=True))
    places = [named.inputs.index(name) for name in at]
    B_d, D_d = B[:, places], D[:, places]
    states = [f"{name} disturbance {k + 1}" for name, one in zip(at, filters, strict=True) for k in range(len(one.A))]
    matrices = StateSpace(
        np.block([[A, B_d @ outputs], [np.zeros((len(own), len(A))), own]]),
        np.block([[B, B_d @ direct], [np.zeros((len(own), B.shape[1])), into]]),
        np.hstack([C, D_d @ outputs]), np.hstack([D, D_d @ direct]),
    )  # fmt: skip
    return NamedMatrices(matrices, (*named.states, *states), (*named.inputs, *map(_NOISE, at)), named.outputs)
