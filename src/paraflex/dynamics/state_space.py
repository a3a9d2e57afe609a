"""Matrices of linear systems with states, inputs and outputs."""

from typing import Any, NamedTuple

import numpy as np
import scipy

from paraflex.arrays import Complex, Numbers, brief


class StateSpace(NamedTuple):
    """Matrices of the state-space model x' = A x + B u, y = C x + D u."""

    A: Numbers
    B: Numbers
    C: Numbers
    D: Numbers
    __repr__ = brief

    @classmethod
    def of(cls, *given: Any) -> "StateSpace":
        """Return a model from array-like matrices; an empty A means a model without states."""
        A, B, C, D = (np.atleast_2d(np.asarray(each, dtype=float)) for each in given)
        if not A.size:
            A, B, C = np.zeros((0, 0)), np.zeros((0, D.shape[1])), np.zeros((D.shape[0], 0))
        return cls(A, B, C, D)

    def triangular(self) -> "StateSpace":
        """Return the model in complex states in which A is upper triangular."""
        upper, basis = scipy.linalg.schur(self.A, output="complex")
        return StateSpace(upper, basis.conj().T @ self.B, self.C @ basis, self.D)

    def at(self, s: complex) -> Complex:
        """Return the response C (s - A)^-1 B + D (outputs, inputs) of a model with an upper triangular A."""
        return self.C @ scipy.linalg.solve_triangular(s * np.eye(len(self.A)) - self.A, self.B) + self.D
