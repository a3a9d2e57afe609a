"""Base class of linear models with named variables: responses, export to SciPy, python-control and xarray."""

from __future__ import annotations

import importlib
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from paraflex.arguments import checked_arguments, numbers_in
from paraflex.arrays import Array, ArrayLike, Complex
from paraflex.errors import InputError, optional_package
from paraflex.mechanism.quantities import finite

if TYPE_CHECKING:
    import xarray as xr


class NamedModel:
    """Linear model with named states, inputs and outputs: responses, export to SciPy, python-control and xarray."""

    @property
    def A(self: Any) -> Array:
        """State matrix (states, states)."""
        return self.state_space.A

    @property
    def B(self: Any) -> Array:
        """Input matrix (states, inputs)."""
        return self.state_space.B

    @property
    def C(self: Any) -> Array:
        """Output matrix (outputs, states)."""
        return self.state_space.C

    @property
    def D(self: Any) -> Array:
        """Feed-through matrix (outputs, inputs), of accelerations, strains and forces."""
        return self.state_space.D

    @checked_arguments()
    def frequency_response(self: Any, frequencies: ArrayLike) -> Complex:
        """Compute the frequency response C (s - A)^-1 B + D (k, outputs, inputs).

        For a full-order model with more than 200 degrees of freedom it is computed from sparse equations at each
        frequency, without A.

        Parameters
        ----------
        frequencies : (k,) array
            Angular frequencies omega of s = i omega [rad/s]; complex numbers are values of s.

        Raises
        ------
        InputError
            A value of s is a pole, where the response is infinite.
        """
        points, response = places_in_s(frequencies), self._response
        out = np.empty((points.size, len(self.outputs), len(self.inputs)), dtype=complex)
        for k, s in enumerate(points.tolist()):
            try:
                out[k] = response(s)
            except np.linalg.LinAlgError:
                raise InputError(
                    "is a pole of the model, where its response is infinite", field="frequencies",
                    value=s.imag if s.real == 0.0 else s, remedy="leave it out, or take one beside it",
                ) from None  # fmt: skip
        return out

    def to_scipy(self: Any) -> scipy.signal.StateSpace:
        """Return the model as a `scipy.signal.StateSpace`."""
        return scipy.signal.StateSpace(*self.state_space)

    def to_control(self: Any) -> Any:
        """Return the model as a state-space system of python-control, with dots and spaces in names as underscores.

        Raises
        ------
        InputError
            python-control is not installed.
        """
        remedy = 'install it: pip install "paraflex[control]"'
        with optional_package("python-control is not installed", field="to_control", remedy=remedy):
            control = importlib.import_module("control")
        plain = {key: [plain_name(one.name) for one in getattr(self, key)] for key in ("states", "inputs", "outputs")}
        return control.ss(*self.state_space, name=plain_name(self._attributes["mechanism"]), **plain)

    def to_xarray(self: Any) -> xr.Dataset:
        """Return A, B, C and D as a dataset labelled by the names of states, inputs and outputs, with units."""
        return labelled(self, matrices_of(self), self._attributes)


def matrices_of(model: Any, names: str = "ABCD", first: Sequence[str] = ()) -> dict[str, Any]:
    """Return matrices of a model by name, each with its dimensions, of which `first` precede those of the matrix."""
    axes = {"A": ("state", "state_of"), "B": ("state", "input"), "C": ("output", "state_of"), "D": ("output", "input")}
    return {name: ((*first, *axes[name]), getattr(model, name)) for name in names}


def labelled(model: Any, data: Mapping[str, Any], attrs: Mapping[str, Any], **axes: Any) -> xr.Dataset:
    """Return arrays of a model as a dataset labelled by the names of states, inputs and outputs, with units."""
    import xarray as xr

    named = {"state": model.states, "state_of": model.states, "input": model.inputs, "output": model.outputs}
    names = {key: [one.name for one in values] for key, values in named.items()}
    units = {f"{key}_unit": (key, [one.unit for one in values]) for key, values in named.items()}
    return xr.Dataset(data, coords=names | units | axes, attrs=attrs)


def places_in_s(frequencies: ArrayLike, field: str = "frequencies") -> Complex:
    """Return s = i omega of finite angular frequencies [rad/s]; complex numbers are values of s already."""
    given = np.atleast_1d(numbers_in(frequencies, field, "biufc"))
    finite(given.ravel().tolist(), field)
    return np.asarray(given if np.iscomplexobj(given) else 1j * given, dtype=complex)


def plain_name(name: str) -> str:
    """Replace all characters of a name except letters, digits and underscores by underscores."""
    return "".join(letter if letter.isalnum() or letter == "_" else "_" for letter in name)
