"""Reduced-order linear models, the results of `reduction`."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
import scipy

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array, ArrayLike, Complex
from paraflex.dynamics.state_space import StateSpace
from paraflex.errors import InputError
from .bases import kernel
from .coordinates import Variable, numbers_of
from .model import LinearModel
from .motions import motions
from .named import NamedModel
from .zeros import by_size, zeros


class ReductionMethod(Enum):
    """Method of model order reduction."""

    CRAIG_BAMPTON = "craig-bampton"
    RUBIN = "rubin"
    MODAL = "modal"
    BALANCED = "balanced"


@dataclass(frozen=True)
class ReducedModel(NamedModel):
    """Reduced-order linear model: x' = A x + B u, y = C x + D u.

    Attributes
    ----------
    full : LinearModel
        Full-order model.
    method : ReductionMethod
        Method of reduction.
    states : tuple of Variable
        Names and units of the states: coordinates of motors' joints, modal coordinates, and rates of these; or balanced
        states.
    state_space : StateSpace
        State-space matrices.
    basis : (f, k) array, optional
        Reduced basis, coordinates of the full model per coordinate of this one; None for balanced states.
    interface : int
        Number of interface coordinates: the first states, which are coordinates of motors' joints.
    hankel : array, optional
        Hankel singular values of balanced truncation, in units of outputs over inputs.
    bound : float, optional
        Upper bound of the error's largest gain over all frequencies, of balanced truncation.
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
        """Names and units of the inputs, those of the full model."""
        return self.full.inputs

    @property
    def outputs(self) -> tuple[Variable, ...]:
        """Names and units of the outputs, those of the full model."""
        return self.full.outputs

    @property
    def shapes(self) -> Array:
        """Reduced basis (f, k).

        Raises
        ------
        InputError
            The model has balanced states.
        """
        if self.basis is None:
            raise InputError(
                "has no coordinates whose rates are states too", field="method", value=self.method.value,
                remedy=f"choose {ReductionMethod.CRAIG_BAMPTON.value} or {ReductionMethod.MODAL.value}",
            )  # fmt: skip
        return self.basis

    @property
    def frequencies(self) -> Array:
        """Undamped natural frequencies with zero inputs [rad/s].

        Raises
        ------
        InputError
            The model has balanced states.
        """
        return self.held_frequencies([])

    @checked_arguments()
    def held_frequencies(self, motors: Sequence[str] | None = None) -> Array:
        """Compute the undamped natural frequencies with motors held, by default all that are inputs [rad/s].

        Raises
        ------
        InputError
            The mechanism does not have a motor, or the model has balanced states.
        """
        equations = self.full.frozen.within(self.shapes)
        rows = self.full.joint_rows(self.full.motor_joints(motors)) @ self.shapes
        free = kernel(rows, 1.0 / np.sqrt(np.diag(equations.mass)))
        return motions(equations.within(free), free).frequencies

    def poles(self) -> Complex:
        """Compute the poles, sorted by magnitude [rad/s]."""
        return by_size(np.asarray(scipy.linalg.eigvals(self.A), dtype=complex))

    def zeros(self, inputs: Sequence[str] | None = None, outputs: Sequence[str] | None = None) -> Complex:
        """Compute the transmission zeros between inputs and outputs, by default all: see `LinearModel.zeros`."""
        balance = scipy.linalg.matrix_balance(self.A, permute=False, separate=True)
        scaled, size = balance[0], np.asarray(balance[1][0])
        columns, rows = numbers_of(inputs, self.inputs, "input"), numbers_of(outputs, self.outputs, "output")
        B, C = self.B[:, columns] / size[:, None], self.C[rows] * size
        return zeros(StateSpace(scaled, B, C, self.D[np.ix_(rows, columns)]), 0.7 * self.full.low_frequency)

    def _response(self, s: complex) -> Complex:
        return self.C @ np.linalg.solve(s * np.eye(len(self.A)) - self.A, self.B) + self.D

    @checked_arguments()
    def error(self, frequencies: ArrayLike, outputs: Sequence[str] | None = None) -> Array:
        """Compute the largest gain of the error relative to that of the full model (k,), at each frequency.

        Parameters
        ----------
        frequencies : (k,) array
            Angular frequencies [rad/s], or complex s.
        outputs : sequence of str, optional
            Names of the outputs, which should have the same unit; all by default.
        """
        rows = numbers_of(outputs, self.outputs, "output")
        full = self.full.frequency_response(frequencies)[:, rows]
        few = self.frequency_response(frequencies)[:, rows]
        return np.linalg.norm(few - full, 2, axis=(1, 2)) / np.linalg.norm(full, 2, axis=(1, 2))

    @property
    def _attributes(self) -> dict[str, Any]:
        own = {"method": self.method.value, **({} if self.bound is None else {"bound": self.bound})}
        return self.full._attributes | own
