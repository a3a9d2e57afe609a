"""Transmission zeros of linear systems with poles over many decades.

Zeros are the s at which [A - s, B; C, D] loses rank (Emami-Naeini and Van Dooren 1982). Low zeros are required, while
axial vibrations of links are a thousand times as fast. They are computed as the largest eigenvalues
theta = 1 / (s - sigma) of a pencil inverted at a shift sigma; zeros at infinity have theta = 0.

The rank of a response may be less than the number of inputs or outputs at every s, as for two motors at geared joints,
or for a motor and a sensor on parts that move independently. Such systems, and those that are not square, are replaced
twice by systems of random combinations of as many inputs and outputs as the rank. A zero of both at which the matrix of
all inputs and outputs loses rank is a zero of the system.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import scipy

from paraflex.arrays import Array, Complex, Numbers
from paraflex.dynamics.state_space import StateSpace
from paraflex.limits import solvable
from .independent import sizes, unit_rows

# Relative difference of zeros of two squared systems that are regarded as equal.
_SAME = 1e-6
# Singular values below this are zero, in a matrix with entries of size one: rounding errors are about 1e-14.
_RANK = 1e-11
# The normal rank is the largest at these multiples of the shift, which are unlikely to be zeros.
_ANYWHERE = (1.0, 2.718281828, 31.41592654)
# An eigenvalue theta below this fraction of the largest belongs to a zero at infinity.
_INFINITE = 1e-12
# Zeros at infinity of a general system are perturbed: zeros above this fraction of the fastest pole are omitted.
_FURTHEST = 0.1


class Vibrating(NamedTuple):
    """Modal equations of unit mass: eta'' + damping eta' + diag(squares) eta = B u, y = C eta or its derivatives."""

    squares: Array
    damping: Array
    B: Array
    C: Array


@solvable("zeros")
def vibrating_zeros(modes: Vibrating, shift: float) -> Complex:
    """Compute the transmission zeros of a mechanism at a pose at rest.

    With bases P and N of the null spaces of B^T and C, zeros are the s at which P^T (s^2 + s damping + diag(squares)) N
    is singular. Scaling by squares + shift^2 makes low zeros as accurate as their distance from the others allows.

    Parameters
    ----------
    modes : Vibrating
        Modal equations.
    shift : float
        Shift of the size of low frequencies, positive [rad/s].
    """

    def matrix(s: complex) -> Complex:
        mass, damping, stiffness = _between(modes, max(abs(s), shift))
        return s * s * mass + s * damping + stiffness

    def squared(left: Array, right: Array) -> Complex:
        mass, damping, stiffness = _between(modes._replace(B=modes.B @ right, C=left @ modes.C), shift)
        if not np.any(modes.damping):
            squares = _shifted(-_pencil(stiffness + shift**2 * mass, mass), shift**2)
            root = np.sqrt(squares)
            return by_size(np.concatenate([root, -root]))
        whole = stiffness + shift * damping + shift**2 * mass
        n = len(whole)
        slopes = scipy.linalg.solve(whole, np.hstack([2.0 * shift * mass + damping, mass])) if n else np.zeros((0, 0))
        companion = np.vstack([-slopes, np.eye(n, 2 * n)])
        return by_size(_shifted(scipy.linalg.eigvals(companion), shift))

    # The null spaces remove as many rows and columns as the ranks of B and C.
    more = sum(matrix(shift).shape) - modes.squares.size
    return _common(squared, matrix, (modes.C.shape[0], modes.B.shape[1]), more, shift)


def _between(modes: Vibrating, low: float) -> tuple[Array, Array, Array]:
    """Return P^T N, P^T damping N and P^T diag(squares) N, scaled by squares + low^2."""
    scale = 1.0 / np.sqrt(np.maximum(modes.squares, 0.0) + low**2)
    left, right = (scipy.linalg.null_space(unit_rows(rows * scale), rcond=_RANK) for rows in (modes.B.T, modes.C))
    parts = (np.eye(scale.size), modes.damping, np.diag(modes.squares))
    mass, damping, stiffness = (left.T @ ((part * scale) * scale[:, None]) @ right for part in parts)
    return mass, damping, stiffness


@solvable("zeros")
def zeros(system: StateSpace, shift: float) -> Complex:
    """Compute the transmission zeros of a linear system, up to a tenth of its fastest pole.

    Parameters
    ----------
    system : StateSpace
        Model with states scaled such that the entries of A are of the size of angular frequencies.
    shift : float
        Shift of the size of low frequencies, positive and not a zero [rad/s].
    """
    A, B, C, D = system
    n, fastest = len(A), np.linalg.norm(A, 2)

    def matrix(s: complex, B: Array = B, C: Array = C, D: Array = D) -> Numbers:
        columns, rows = sizes(B, 0), sizes(np.hstack([C, D]), 1)
        return np.block([[A - s * np.eye(n), B / columns], [C / rows, D / rows / columns]])

    def even(s: complex) -> Numbers:
        size = np.pad(1.0 / np.sqrt(sizes(A - s * np.eye(n), 1).ravel()), (0, sum(D.shape)), constant_values=1.0)
        whole = matrix(s)
        return whole * size[: whole.shape[1]] * size[: len(whole), None]

    def squared(left: Array, right: Array) -> Complex:
        pencil = np.asarray(matrix(shift, B @ right, left @ C, left @ D @ right), dtype=float)
        found = _shifted(_pencil(pencil, np.eye(*pencil.shape) * (np.arange(len(pencil)) < n)), shift)
        return by_size(found[np.abs(found) < _FURTHEST * fastest])

    return _common(squared, even, D.shape, n, shift)


def _common(
    squared: Callable[..., Complex], matrix: Callable[..., Numbers], shape: tuple[int, int], more: int, shift: float
) -> Complex:
    """Compute the zeros of a system of shape (outputs, inputs) from those of combinations of its outputs and inputs.

    Parameters
    ----------
    squared : callable
        Zeros of the square system of combinations, given by a left matrix for outputs and a right one for inputs.
    matrix : callable
        System matrix at s, which loses rank at zeros.
    shape : (int, int)
        Numbers of outputs and inputs.
    more : int
        Rank of the system matrix minus that of the response, at an s that is not a zero.
    shift : float
        Shift of the size of low frequencies [rad/s].
    """
    full = max(_rank(matrix(part * shift)) for part in _ANYWHERE)
    rank, (outputs, inputs) = full - more, shape
    if not rank:
        return np.zeros(0, dtype=complex)
    if rank == outputs == inputs:
        return squared(np.eye(rank), np.eye(rank))
    random = np.random.default_rng(0)

    def mixed() -> Complex:
        left = np.eye(rank) if rank == outputs else random.standard_normal((rank, outputs))
        return squared(left, np.eye(rank) if rank == inputs else random.standard_normal((inputs, rank)))

    first, second = mixed(), mixed()
    if not (first.size and second.size):
        return np.zeros(0, dtype=complex)
    apart = np.min(np.abs(first[:, None] - second), axis=1)
    likely = first[apart <= _SAME * np.maximum(np.abs(first), shift)]
    return np.array([s for s in likely if _rank(matrix(complex(s))) < full], dtype=complex)


def _rank(matrix: Numbers) -> int:
    """Return the numerical rank of a matrix with entries of size one."""
    return int(np.count_nonzero(scipy.linalg.svdvals(matrix) > _RANK)) if matrix.size else 0


def _pencil(whole: Array, mass: Array) -> Complex:
    """Compute the eigenvalues theta of mass x = theta whole x."""
    if not whole.size:
        return np.zeros(0, dtype=complex)
    size = sizes(whole, 1)
    return np.asarray(scipy.linalg.eigvals(scipy.linalg.solve(whole / size, mass / size)), dtype=complex)


def _shifted(theta: Complex, shift: float) -> Complex:
    """Return the finite values shift + 1 / theta."""
    kept = theta[np.abs(theta) > _INFINITE * np.max(np.abs(theta), initial=0.0)]
    return shift + 1.0 / kept


def by_size(values: Complex) -> Complex:
    """Sort complex numbers by magnitude, with a stable order."""
    return values[np.argsort(np.abs(values), kind="stable")]
