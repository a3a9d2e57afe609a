"""Eigenmodes of a body in its reference frame, which are the flexible coordinates of the kernels."""

from dataclasses import dataclass

import numpy as np
import scipy

from paraflex.arrays import Array, Brief
from .eigen import eigenpairs
from .integrals import ShapeIntegrals

# Entries of a mode above this part of the largest count as largest.
_LARGEST = 1.0 - 1e-6


@dataclass(frozen=True)
class ModalBasis(Brief):
    """Mass-normalised eigenmodes of (K, Mff).

    Attributes
    ----------
    omega : (nf,) array
        Angular eigenfrequencies, ascending [rad/s].
    vectors : (nodal, nf) array
        Mode shapes V in columns, V^T Mff V = 1 and V^T K V = diag(omega^2); square if all modes are kept.
    """

    omega: Array
    vectors: Array

    def like(self, other: "ModalBasis", Mff: Array) -> "ModalBasis":
        """Match the modes to those of a slightly different body, and return them in its order and with its signs.

        Frequencies may cross as a body changes, and the sign of an eigenvector is arbitrary. Modes that are matched by
        their overlap change smoothly.

        Parameters
        ----------
        other : ModalBasis
            Modes of the other body, in as many coordinates; there may be fewer of them.
        Mff : (nodal, nodal) array
            Mass matrix of this body, in which the overlap of modes is measured.
        """
        overlap = (other.vectors.T @ Mff @ self.vectors).real
        rows, columns = scipy.optimize.linear_sum_assignment(-np.abs(overlap))
        return ModalBasis(self.omega[columns], self.vectors[:, columns] * np.sign(overlap[rows, columns]))


def modal_basis(body: ShapeIntegrals) -> ModalBasis:
    """Compute the mass-normalised eigenmodes of a body; in terms of all of them the model is the same."""
    if body.nf == 0:
        return ModalBasis(omega=np.zeros(0), vectors=np.zeros((0, 0)))
    squares, vectors = eigenpairs(body.K, body.Mff)
    # A mode's sign is arbitrary; with the largest entry positive, results are the same on every machine. In a symmetric
    # body several entries are largest, up to rounding: the first counts.
    sizes = np.abs(vectors)
    first = np.argmax(sizes > _LARGEST * np.max(sizes, axis=0), axis=0)
    largest = vectors[first, np.arange(vectors.shape[1])]
    return ModalBasis(omega=np.sqrt(np.maximum(squares, 0.0)), vectors=vectors * np.sign(np.real(largest)))


def natural_frequencies(body: ShapeIntegrals) -> Array:
    """Compute the angular eigenfrequencies of a body whose frame is held [rad/s], ascending."""
    return modal_basis(body).omega
