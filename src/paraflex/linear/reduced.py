"""Linear models of few states, as `reduction` makes them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array
from paraflex.errors import InputError
from paraflex.linear.bases import kernel
from paraflex.linear.coordinates import Variable
from paraflex.linear.model import LinearModel
from paraflex.linear.motions import motions
from paraflex.linear.named import NamedModel, not_at_poles, numbers_of, places_in_s
from paraflex.linear.zeros import StateSpace, by_size, zeros

Complex = NDArray[np.complex128]


class ReductionMethod(Enum):
    """How states are left out."""

    CRAIG_BAMPTON = "craig-bampton"
    RUBIN = "rubin"
    MODAL = "modal"
    BALANCED = "balanced"


@dataclass(frozen=True)
class ReducedModel(NamedModel):
    """A linear model of few states: x' = A x + B u, y = C x + D u.

    Attributes
    ----------
    full : LinearModel
        That it stands for.
    method : ReductionMethod
    states : tuple of Variable
        Coordinates of the motors' joints, amplitudes of modes, and rates of these; or amplitudes of balanced states.
    state_space : StateSpace
    basis : (f, k) array, optional
        Coordinates of the full model with those of this one; none of balanced states.
    interface : int
        So many of the first states are coordinates of motors' joints.
    hankel : array, optional
        Hankel singular values of balanced truncation, in units of outputs over inputs.
    bound : float, optional
        Of balanced truncation: the largest gain of the error over all frequencies is not above.
    """

    full: LinearModel
    method: ReductionMethod
    states: tuple[Variable, ...]
    state_space: StateSpace
    basis: Array | None = None
    interface: int = 0
    hankel: Array | None = None
    bound: float | None = None

    def __repr__(self) -> str:
        states = f"{len(self.states)} of {len(self.full.states)} states"
        return f"ReducedModel({self.full.title}: {states}, {self.method.value})"

    @property
    def inputs(self) -> tuple[Variable, ...]:
        """Names and units, as of the full model."""
        return self.full.inputs

    @property
    def outputs(self) -> tuple[Variable, ...]:
        """Names and units, as of the full model."""
        return self.full.outputs

    @property
    def A(self) -> Array:
        """State matrix (states, states)."""
        return self.state_space.A

    @property
    def B(self) -> Array:
        """Input matrix (states, inputs)."""
        return self.state_space.B

    @property
    def C(self) -> Array:
        """Output matrix (outputs, states)."""
        return self.state_space.C

    @property
    def D(self) -> Array:
        """Feed-through (outputs, inputs)."""
        return self.state_space.D

    @property
    def shapes(self) -> Array:
        """The basis (f, k).

        Raises
        ------
        InputError
            A model of balanced states.
        """
        if self.basis is None:
            raise InputError(
                "has no coordinates whose rates are states too", field="method", value=self.method.value,
                remedy=f"choose {ReductionMethod.CRAIG_BAMPTON.value} or {ReductionMethod.MODAL.value}",
            )  # fmt: skip
        return self.basis

    @property
    def frequencies(self) -> Array:
        """Undamped natural frequencies, inputs zero [rad/s].

        Raises
        ------
        InputError
            A model of balanced states.
        """
        return self._frequencies([])

    @checked_arguments()
    def held_frequencies(self, motors: Sequence[str] | None = None) -> Array:
        """Undamped natural frequencies with motors held, by default all that are inputs [rad/s].

        Raises
        ------
        InputError
            A motor that the mechanism does not have, or a model of balanced states.
        """
        return self._frequencies(self.full.motor_joints(motors))

    def _frequencies(self, joints: Sequence[str]) -> Array:
        equations = self.full.frozen.within(self.shapes)
        rows = self.full.joint_rows(joints) @ self.shapes
        free = kernel(rows, 1.0 / np.sqrt(np.diag(equations.mass)))
        return motions(equations.within(free), free).frequencies

    def poles(self) -> Complex:
        """Poles, by magnitude [rad/s]."""
        return by_size(np.asarray(scipy.linalg.eigvals(self.A), dtype=complex))

    def zeros(self, inputs: Sequence[str] | None = None, outputs: Sequence[str] | None = None) -> Complex:
        """Transmission zeros between some inputs and some outputs, by default all: see `LinearModel.zeros`."""
        balance = scipy.linalg.matrix_balance(self.A, permute=False, separate=True)
        scaled, size = balance[0], np.asarray(balance[1][0])
        columns, rows = numbers_of(inputs, self.inputs, "input"), numbers_of(outputs, self.outputs, "output")
        B, C = self.B[:, columns] / size[:, None], self.C[rows] * size
        return zeros(StateSpace(scaled, B, C, self.D[np.ix_(rows, columns)]), 0.7 * self.full.low_frequency)

    @checked_arguments()
    def frequency_response(self, frequencies: ArrayLike) -> Complex:
        """Response C (s - A)^-1 B + D (k, outputs, inputs): see `LinearModel.frequency_response`."""
        return np.array([self._response(complex(s)) for s in places_in_s(frequencies)])

    def _response(self, s: complex) -> Complex:
        with not_at_poles(s):
            return self.C @ np.linalg.solve(s * np.eye(len(self.A)) - self.A, self.B) + self.D

    @checked_arguments()
    def error(self, frequencies: ArrayLike, outputs: Sequence[str] | None = None) -> Array:
        """Largest gain of the error over the largest gain of the full model (k,), at each frequency.

        Parameters
        ----------
        frequencies : (k,) array
            Angular frequencies [rad/s], or complex s.
        outputs : sequence of str, optional
            Of one unit; all by default.
        """
        rows = numbers_of(outputs, self.outputs, "output")
        full = self.full.frequency_response(frequencies)[:, rows]
        few = self.frequency_response(frequencies)[:, rows]
        return np.linalg.norm(few - full, 2, axis=(1, 2)) / np.linalg.norm(full, 2, axis=(1, 2))

    @property
    def _attributes(self) -> dict[str, Any]:
        own = {"method": self.method.value, **({} if self.bound is None else {"bound": self.bound})}
        return self.full._attributes | own
