"""Discrete state-space models whose matrices are given in a file."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from paraflex.arrays import Array
from paraflex.control.laws.controllers import Plant
from paraflex.control.laws.discrete import DiscreteModel, matrices_of
from paraflex.control.laws.law import Law, given
from paraflex.control.laws.linear_law import LinearLaw
from paraflex.errors import InputError
from paraflex.mechanism import Mechanism

Rows = Sequence[Sequence[float]]


@dataclass(frozen=True)
class StateSpaceLaw(Law, kind="state-space", title="state space"):
    """Discrete state-space model from readings to torques: x_k+1 = A x_k + B y_k with torques C x_k + D y_k.

    Attributes
    ----------
    D, A, B, C : (outputs, inputs), (n, n), (n, inputs) and (outputs, n) rows
        Feed-through, state, input and output matrix, from readings less their references to torques; A, B and C are
        empty for a model without states.

    Raises
    ------
    InputError
        Rows that are not matrices, or matrices of other sizes.
    """

    _own = ("A", "B", "C", "D")

    D: Rows = given("rows of the matrix from readings to torques")
    A: Rows = given("rows of the matrix of states; none without states", default=())
    B: Rows = given("rows of the matrix from readings to states", default=())
    C: Rows = given("rows of the matrix from states to torques", default=())

    def __post_init__(self) -> None:
        super().__post_init__()
        D = _matrix(self.D, "D")
        n = len(self.A)
        for name, shape in (("A", (n, n)), ("B", (n, D.shape[1])), ("C", (D.shape[0], n))):
            found = _matrix(getattr(self, name), name)
            if found.size != shape[0] * shape[1] or (found.size and found.shape != shape):
                raise InputError(
                    f"has {_size(found.shape)}, not {_size(shape)}", field=name,
                    remedy="give A of n rows of n numbers, B with one row per state, C and D with one per motor",
                )  # fmt: skip
        for name in self._own:
            rows = tuple(tuple(map(float, row)) for row in getattr(self, name))
            object.__setattr__(self, name, rows if any(rows) else ())

    def check(self, mechanism: Mechanism, inputs: Sequence[str], outputs: Sequence[str]) -> None:
        """Check the numbers of sensors and motors: see `Law.check`."""
        self._model().check_size(inputs, outputs, 1.0)

    def start(self, plant: Plant) -> LinearLaw:
        """Return the law in a run: see `Law.start`."""
        return self._model().start(plant)

    def _model(self) -> DiscreteModel:
        return DiscreteModel(*matrices_of(self), None, (), ())


def _matrix(rows: Any, name: str) -> Array:
    try:
        found = np.array([*rows], dtype=float)
    except (TypeError, ValueError):
        found = np.full(1, np.nan)
    if not np.all(np.isfinite(found)) or (found.size and found.ndim != 2) or (name == "D" and not found.size):
        raise InputError("is not a matrix of numbers", field=name, value=rows,
                         remedy="give a list of rows, all of one length")  # fmt: skip
    return found


def _size(shape: Sequence[int]) -> str:
    return " x ".join(map(str, shape))
