"""Eigenmodes of a body in its reference frame: the flexible coordinates of the kernels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from paraflex.arrays import Array
from paraflex.fem.eigen import eigenpairs
from paraflex.fem.integrals import ShapeIntegrals


@dataclass(frozen=True)
class ModalBasis:
    """Mass-normalised eigenmodes of (K, Mff).

    Attributes
    ----------
    omega : (nf,) array
        Angular frequencies, ascending [rad/s].
    vectors : (nodal, nf) array
        Columns V with V^T Mff V = 1 and V^T K V = diag(omega^2); square where all modes are kept.
    """

    omega: Array
    vectors: Array

    def like(self, other: ModalBasis, Mff: Array) -> ModalBasis:
        """Those of these modes that are nearest to the modes of a slightly different body, in their order and signs.

        Frequencies may cross as a body changes, and eigenvectors have no sign; matched by overlap they change smoothly.

        Parameters
        ----------
        other : ModalBasis
            Of as many coordinates; it may have fewer modes.
        Mff : (nodal, nodal) array
            Of this body, in the metric of which modes overlap.
        """
        overlap = (other.vectors.T @ Mff @ self.vectors).real
        rows, columns = scipy.optimize.linear_sum_assignment(-np.abs(overlap))
        return ModalBasis(self.omega[columns], self.vectors[:, columns] * np.sign(overlap[rows, columns]))


def modal_basis(body: ShapeIntegrals) -> ModalBasis:
    """Diagonalise a body's flexible coordinates; with all modes kept the model is the same."""
    if body.nf == 0:
        return ModalBasis(omega=np.zeros(0), vectors=np.zeros((0, 0)))
    squares, vectors = eigenpairs(body.K, body.Mff)
    # A mode's sign is arbitrary; the largest entry made positive keeps results the same on every machine.
    largest = vectors[np.argmax(np.abs(vectors), axis=0), np.arange(vectors.shape[1])]
    return ModalBasis(omega=np.sqrt(np.maximum(squares, 0.0)), vectors=vectors * np.sign(np.real(largest)))


def natural_frequencies(body: ShapeIntegrals) -> Array:
    """Angular frequencies of a body with its frame held [rad/s], ascending."""
    return modal_basis(body).omega
