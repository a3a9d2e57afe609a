"""Eigenpairs of stiffness and mass matrices, accurate also for soft modes, and their complex-step derivatives."""

import numpy as np
import scipy.linalg

from paraflex.arrays import Numbers
from paraflex.errors import InputError

# Two eigenvalues with a smaller relative difference are repeated; their modes have no derivatives if a parameter
# couples them. A smaller relative coupling is rounding.
_ONE, _COUPLED = 1e-9, 1e-9
# A pair whose coupling exceeds this fraction of its difference is not corrected.
_COUPLED_BY = 0.1


def eigenpairs(K: Numbers, M: Numbers) -> tuple[Numbers, Numbers]:
    """Solve K x = lambda M x for the eigenvalues, ascending, and the eigenvectors V with V^T M V = 1.

    Complex-step matrices K + i h dK and M + i h dM give values and vectors plus i h times their derivatives.

    Parameters
    ----------
    K, M : (n, n) arrays
        Stiffness and mass matrix, both symmetric, M positive definite.

    Raises
    ------
    numpy.linalg.LinAlgError
        M is not positive definite.
    InputError
        Derivatives are requested of modes with a repeated frequency that separates as the parameter changes.
    """
    stiffness, mass = np.ascontiguousarray(np.real(K)), np.ascontiguousarray(np.real(M))
    values, vectors = scipy.linalg.eigh(stiffness, mass)
    values, vectors = _refined(stiffness, mass, values, vectors)
    if not (np.iscomplexobj(K) or np.iscomplexobj(M)):
        return values, vectors
    d_values, d_vectors = eigen_derivatives(values, vectors, np.imag(K), np.imag(M))
    return values + 1j * d_values, vectors + 1j * d_vectors


def eigen_derivatives(values: Numbers, vectors: Numbers, dK: Numbers, dM: Numbers) -> tuple[Numbers, Numbers]:
    """Compute the derivatives of eigenvalues and mass-normalised eigenvectors from those of the matrices.

    dlambda_j = v_j^T (dK - lambda_j dM) v_j and dv_j = sum_i v_i C_ij, where C_ij (lambda_j - lambda_i) is
    v_i^T (dK - lambda_j dM) v_j and C_jj = -1/2 v_j^T dM v_j.

    Parameters
    ----------
    values, vectors : (n,) and (n, n) arrays
        Eigenvalues and eigenvectors as `eigenpairs` returns them.
    dK, dM : (n, n) arrays
        Derivatives of the stiffness and the mass matrix.

    Raises
    ------
    InputError
        A repeated frequency separates as the parameter changes.
    """
    moved_mass = vectors.T @ dM @ vectors
    coupling = vectors.T @ dK @ vectors - moved_mass * values
    gaps = values - values[:, None]
    size = np.maximum(np.abs(values), np.abs(values[:, None]))
    one = np.abs(gaps) <= _ONE * size
    np.fill_diagonal(one, False)
    reference = np.max(np.abs(np.diag(coupling)), initial=0.0)
    if np.any(one & (np.abs(coupling) > _COUPLED * reference)):
        raise InputError(
            "two modes of one frequency separate as the parameter changes, and have no derivative",
            field="modes",
            remedy="choose a slightly different value",
        )
    np.fill_diagonal(one, True)
    mixing = np.where(one, -0.5 * moved_mass, coupling / np.where(one, 1.0, gaps))
    return np.diag(coupling).copy(), vectors @ mixing


def is_definite(matrix: Numbers, least: float) -> bool:
    """Return whether a symmetric matrix, scaled to a unit diagonal, has eigenvalues above a least one only."""
    diagonal = np.diag(matrix)
    if not (np.all(np.isfinite(matrix)) and np.all(diagonal > 0.0)):
        return False
    sizes = np.sqrt(diagonal)
    return bool(np.linalg.eigvalsh(matrix / np.outer(sizes, sizes))[0] > least)


def _refined(K: Numbers, M: Numbers, values: Numbers, vectors: Numbers) -> tuple[Numbers, Numbers]:
    """Refine all eigenpairs by one step of Ogita and Aishima (2018), so that errors are relative to each eigenvalue.

    The modal stiffness of a beam spans many powers of ten, and the error of a dense solver is relative to the largest.
    """
    off = np.eye(values.size) - vectors.T @ M @ vectors
    in_modes = vectors.T @ K @ vectors
    values = np.diag(in_modes) / (1.0 - np.diag(off))
    coupling, gaps = in_modes + off * values, values - values[:, None]
    apart = np.abs(coupling) < _COUPLED_BY * np.abs(gaps)
    mixing = np.where(apart, coupling / np.where(apart, gaps, 1.0), 0.5 * off)
    np.fill_diagonal(mixing, 0.5 * np.diag(off))
    vectors = vectors + vectors @ mixing
    values = np.einsum("ij,ij->j", vectors, K @ vectors) / np.einsum("ij,ij->j", vectors, M @ vectors)
    order = np.argsort(values, kind="stable")
    return values[order], vectors[:, order]
