"""Transmission zeros of linear systems whose poles lie decades apart.

Zeros are the s at which [A - s, B; C, D] loses rank (Emami-Naeini and Van Dooren 1982). Low ones are wanted, beside
axial vibrations of links that are a thousand times as fast: they are found as the largest eigenvalues
theta = 1 / (s - sigma) of a pencil inverted at a shift sigma; zeros at infinity are those where theta is zero.

Systems that are not square are made so by random combinations of inputs or outputs, twice: what is a zero of both, and
where the matrix that is not square loses rank, is one of the system.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from paraflex.arrays import Array, Numbers
from paraflex.linear.independent import unit_rows

Complex = NDArray[np.complex128]
# Zeros of two squared systems that agree this well are one.
_SAME = 1e-6
# At a zero the least singular value of the matrix, entries of size one, is smaller: rounding leaves 1e-14 of it.
_RANK = 1e-11
# An eigenvalue theta below this part of the largest is that of a zero at infinity.
_INFINITE = 1e-12
# Of a general system such zeros are blurred: those further out than this part of the fastest pole are left out.
_FURTHEST = 0.1


class StateSpace(NamedTuple):
    """x' = A x + B u, y = C x + D u."""

    A: Array
    B: Array
    C: Array
    D: Array


class Vibrating(NamedTuple):
    """Modes of unit mass: eta'' + damping eta' + diag(squares) eta = B u, y = C eta, or a derivative of C eta."""

    squares: Array
    damping: Array
    B: Array
    C: Array


def vibrating_zeros(modes: Vibrating, shift: float) -> Complex:
    """Zeros of a mechanism about a pose at rest.

    With P and N the null spaces of B^T and C, those s at which P^T (s^2 + s damping + diag(squares)) N is singular;
    scaled by squares + shift^2, which makes low zeros as exact as their distance from the others allows.

    Parameters
    ----------
    modes : Vibrating
    shift : float
        Positive, of the size of low frequencies [rad/s].
    """
    inputs, outputs = modes.B.shape[1], modes.C.shape[0]
    if inputs != outputs:

        def squared(mix: Array) -> Complex:
            few = modes._replace(B=modes.B @ mix) if inputs > outputs else modes._replace(C=mix @ modes.C)
            return vibrating_zeros(few, shift)

        def matrix(s: complex) -> Complex:
            mass, damping, stiffness = _between(modes, max(abs(s), shift))
            return s * s * mass + s * damping + stiffness

        return _common(squared, matrix, (inputs, outputs), shift)
    mass, damping, stiffness = _between(modes, shift)
    if not np.any(modes.damping):
        squares = _shifted(-_pencil(stiffness + shift**2 * mass, mass), shift**2)
        root = np.sqrt(squares)
        return _sorted(np.concatenate([root, -root]))
    whole = stiffness + shift * damping + shift**2 * mass
    n = len(whole)
    slopes = scipy.linalg.solve(whole, np.hstack([2.0 * shift * mass + damping, mass])) if n else np.zeros((0, 0))
    companion = np.vstack([-slopes, np.eye(n, 2 * n)])
    return _sorted(_shifted(scipy.linalg.eigvals(companion), shift))


def _between(modes: Vibrating, low: float) -> tuple[Array, Array, Array]:
    """P^T N, P^T damping N and P^T diag(squares) N, scaled by squares + low^2."""
    scale = 1.0 / np.sqrt(np.maximum(modes.squares, 0.0) + low**2)
    left, right = (scipy.linalg.null_space(unit_rows(rows * scale)) for rows in (modes.B.T, modes.C))
    parts = (np.eye(scale.size), modes.damping, np.diag(modes.squares))
    mass, damping, stiffness = (left.T @ ((part * scale) * scale[:, None]) @ right for part in parts)
    return mass, damping, stiffness


def zeros(system: StateSpace, shift: float) -> Complex:
    """Transmission zeros of any linear system, up to a tenth of its fastest pole.

    Parameters
    ----------
    system : StateSpace
        With states such that entries of A are of the size of angular frequencies.
    shift : float
        No zero, positive, of the size of low frequencies [rad/s].
    """
    outputs, inputs = system.D.shape
    A, B, C, D = system
    n, columns = len(A), _sizes(B, 0)
    rows = _sizes(np.hstack([C, D]), 1)

    def matrix(s: complex) -> Numbers:
        return np.block([[A - s * np.eye(n), B / columns], [C / rows, D / rows / columns]])

    if inputs != outputs:

        def squared(mix: Array) -> Complex:
            few = StateSpace(A, B @ mix, C, D @ mix) if inputs > outputs else StateSpace(A, B, mix @ C, mix @ D)
            return zeros(few, shift)

        def even(s: complex) -> Numbers:
            size = np.pad(1.0 / np.sqrt(_sizes(A - s * np.eye(n), 1).ravel()), (0, inputs + outputs), constant_values=1)
            whole = matrix(s)
            return whole * size[: n + inputs] * size[: n + outputs, None]

        return _common(squared, even, (inputs, outputs), shift)
    pencil = np.asarray(matrix(shift), dtype=float)
    found = _shifted(_pencil(pencil, np.eye(*pencil.shape) * (np.arange(len(pencil)) < n)), shift)
    return _sorted(found[np.abs(found) < _FURTHEST * np.linalg.norm(system.A, 2)])


def _common(
    squared: Callable[[Array], Complex], matrix: Callable[[complex], Numbers], shape: tuple[int, int], shift: float
) -> Complex:
    """Common zeros of a system squared by two random matrices at which the matrix that is not square loses rank."""
    random = np.random.default_rng(0)
    first, second = (squared(random.standard_normal(shape)) for _ in range(2))
    if not (first.size and second.size):
        return np.zeros(0, dtype=complex)
    apart = np.min(np.abs(first[:, None] - second), axis=1)
    likely = first[apart <= _SAME * np.maximum(np.abs(first), shift)]
    return np.array([s for s in likely if _least(matrix(complex(s))) < _RANK], dtype=complex)


def _least(matrix: Numbers) -> float:
    """The least singular value; infinite without any."""
    return float(np.min(scipy.linalg.svdvals(matrix), initial=np.inf)) if matrix.size else np.inf


def _pencil(whole: Array, mass: Array) -> Complex:
    """Eigenvalues theta of mass x = theta whole x."""
    if not whole.size:
        return np.zeros(0, dtype=complex)
    size = _sizes(whole, 1)
    return np.asarray(scipy.linalg.eigvals(scipy.linalg.solve(whole / size, mass / size)), dtype=complex)


def _shifted(theta: Complex, shift: float) -> Complex:
    """What lies 1 / theta from a shift, but not at infinity."""
    kept = theta[np.abs(theta) > _INFINITE * np.max(np.abs(theta), initial=0.0)]
    return shift + 1.0 / kept


def _sizes(matrix: Numbers, axis: int) -> Array:
    size = np.linalg.norm(matrix, axis=axis, keepdims=True)
    return np.where(size > 0.0, size, 1.0)


def _sorted(values: Complex) -> Complex:
    """By magnitude."""
    return values[np.argsort(np.abs(values), kind="stable")]
