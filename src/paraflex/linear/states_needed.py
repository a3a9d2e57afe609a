"""Number of states that a reduced model needs up to a frequency, by actuation mode, method and output."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array, Numbers
from paraflex.errors import InputError, as_enum
from .model import LinearModel
from .reduced import ReductionMethod
from .reduction import reduce

if TYPE_CHECKING:
    import xarray as xr

# Additional damping ratio of all vibrations in the comparison: errors of undamped responses are never small.
DAMPING = 0.01
# Number of frequencies, and the lowest relative to the highest.
_FREQUENCIES, _LOWEST = 200, 1e-2


@checked_arguments()
def states_needed(
    models: Sequence[LinearModel],
    until: float,
    *,
    error: float = 0.01,
    methods: Sequence[ReductionMethod | str] = (ReductionMethod.CRAIG_BAMPTON, ReductionMethod.MODAL),
    most: int = 80,
) -> xr.Dataset:
    """Compute the least number of states with which the error of a reduced model stays below a bound, by output.

    Parameters
    ----------
    models : sequence of LinearModel
        Linear models of a mechanism in different actuation modes.
    until : float
        Highest frequency [rad/s].
    error : float
        Bound of the error relative to the full model's gain to the output (norm over all inputs), at each frequency;
        0.01 by default.
    methods : sequence of str
        Methods of `reduce`; "craig-bampton" and "modal" by default.
    most : int
        Largest number of states, 80 by default; the result is NaN where more are needed.

    Returns
    -------
    xarray.Dataset
        Numbers `states` over mode, reduction and output.

    Raises
    ------
    InputError
        There are no models, methods or outputs, or the frequency or the error is not positive.
    """
    import xarray as xr

    for name, value in (("until", until), ("error", error)):
        if not 0.0 < value < np.inf:
            raise InputError("is not positive", field=name, value=value, remedy="give a positive one")
    if not models:
        raise InputError("names none", field="models", remedy="give linear models, as linearise makes them")
    if not models[0].outputs:
        raise InputError("has no outputs whose responses could be compared", field="outputs", value=models[0].mechanism,
                         remedy="give it motors, an end-effector or sensors")  # fmt: skip
    chosen = [as_enum(ReductionMethod, method, "methods") for method in methods]
    if not chosen:
        raise InputError("names none", field="methods", remedy="name one, or leave it out")
    s = np.geomspace(_LOWEST * until, until, _FREQUENCIES) * (1j + DAMPING)
    found = np.array([[_needed(model, method, s, error, most) for method in chosen] for model in models])
    names = {
        "mode": [model.mode for model in models], "reduction": [method.value for method in chosen],
        "output": [one.name for one in models[0].outputs],
    }  # fmt: skip
    attrs = {"mechanism": models[0].mechanism, "until": until, "error": error, "damping_ratio": DAMPING}
    return xr.Dataset({"states": (tuple(names), found)}, coords=names, attrs=attrs)


def _needed(model: LinearModel, method: ReductionMethod, s: Numbers, error: float, most: int) -> Array:
    """Return the numbers of states needed (outputs,)."""
    full = model.frequency_response(s)
    size = np.linalg.norm(full, axis=2)
    needed = np.full(len(model.outputs), np.nan)
    for states in range(2, min(most, len(model.states)) + 1, 2):
        try:
            few = reduce(model, states, method=method).frequency_response(s)
        except InputError as refused:
            # The number is less than that of the interface coordinates, which are always retained.
            if refused.field != "states":
                raise
            continue
        within = np.all(np.linalg.norm(few - full, axis=2) <= error * size, axis=0)
        # The bound must hold for all larger numbers of states as well.
        needed = np.where(within, np.where(np.isnan(needed), states, needed), np.nan)
    return needed
