"""Base class of linear models with named variables: selection by name, export to SciPy, python-control and xarray."""

from __future__ import annotations

import importlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy
from numpy.typing import ArrayLike

from paraflex.arguments import numbers_in
from paraflex.arrays import Complex, Indices
from paraflex.errors import InputError
from paraflex.linear.coordinates import Variable, named_axes
from paraflex.mechanism.quantities import finite

if TYPE_CHECKING:
    import xarray as xr


class NamedModel:
    """Linear model with named states, inputs and outputs: export to SciPy, python-control and xarray."""

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
        try:
            control = importlib.import_module("control")
        except ImportError:
            raise InputError(
                "python-control is not installed", field="to_control",
                remedy='install it: pip install "paraflex[control]"',
            ) from None  # fmt: skip
        plain = {key: [plain_name(one.name) for one in getattr(self, key)] for key in ("states", "inputs", "outputs")}
        return control.ss(*self.state_space, name=plain_name(self._attributes["mechanism"]), **plain)

    def to_xarray(self: Any) -> xr.Dataset:
        """Return A, B, C and D as a dataset labelled by the names of states, inputs and outputs, with units."""
        import xarray as xr

        dimensions = {
            "A": ("state", "state_of"), "B": ("state", "input"), "C": ("output", "state_of"), "D": ("output", "input"),
        }  # fmt: skip
        data = {key: (dimensions[key], values) for key, values in self.state_space._asdict().items()}
        return xr.Dataset(data, coords=named_axes(self.states, self.inputs, self.outputs), attrs=self._attributes)


def places_in_s(frequencies: ArrayLike, field: str = "frequencies") -> Complex:
    """Return s = i omega of finite angular frequencies [rad/s]; complex numbers are values of s already."""
    given = np.atleast_1d(numbers_in(frequencies, field, "biufc"))
    finite(given.ravel().tolist(), field)
    return np.asarray(given if np.iscomplexobj(given) else 1j * given, dtype=complex)


@contextmanager
def not_at_poles(s: complex) -> Iterator[None]:
    """Convert the error of a singular matrix at a value of s into an `InputError`.

    Raises
    ------
    InputError
        The response is infinite at s, because s is a pole.
    """
    try:
        yield
    except np.linalg.LinAlgError:
        raise InputError(
            "is a pole of the model, where its response is infinite", field="frequencies",
            value=float(s.imag) if s.real == 0.0 else complex(s), remedy="leave it out, or take one beside it",
        ) from None  # fmt: skip


def plain_name(name: str) -> str:
    """Replace all characters of a name except letters, digits and underscores by underscores."""
    return "".join(letter if letter.isalnum() or letter == "_" else "_" for letter in name)


def numbers_of(names: Sequence[str] | None, have: Sequence[Variable], what: str) -> Indices:
    """Return the indices of variables by name, by default of all.

    Raises
    ------
    InputError
        A name is unknown.
    """
    known = [one.name for one in have]
    if names is None:
        return np.arange(len(known))
    for name in names:
        if name not in known:
            raise InputError(
                f"is not one of the {what}s", field=f"{what}s", value=name, remedy="choose from " + ", ".join(known)
            )
    return np.array([known.index(name) for name in names], dtype=int)
