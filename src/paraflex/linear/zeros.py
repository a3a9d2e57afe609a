"""Transmission zeros of linear systems whose poles lie decades apart.

Zeros are the s at which [A - s, B; C, D] loses rank (Emami-Naeini and Van Dooren 1982). Low ones are wanted, beside
axial vibrations of links that are a thousand times as fast: they are found as the largest eigenvalues
theta = 1 / (s - sigma) of a pencil inverted at a shift sigma; zeros at infinity are those where theta is zero.

Systems that are not square are made so by random combinations of inputs or outputs, twice: what is a zero of both is
one of the system.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from paraflex.arrays import Array

Complex = NDArray[np.complex128]
# Zeros of two squared systems that agree this well are one.
_SAME = 1e-6
# An eigenvalue theta below this part of the largest is that of a zero at infinity.
_INFINITE = 1e-12
# Of a general system such zeros are blurred: those further out than this part of the fastest pole are left out.
_FURTHEST = 0.1


class StateSpace(NamedTuple):
    """x' = A x + B u, y = C x + D u, states scaled such that entries of A are of the size of angular frequencies."""

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
    if inputs > outputs:
        return _common(lambda mix: vibrating_zeros(modes._replace(B=modes.B @ mix), shift), (inputs, outputs), shift)
    if inputs < outputs:
        return _common(lambda mix: vibrating_zeros(modes._replace(C=mix @ modes.C), shift), (inputs, outputs), shift)
    scale = 1.0 / np.sqrt(np.maximum(modes.squares, 0.0) + shift**2)
    left, right = (scipy.linalg.null_space(unit_rows(rows * scale)) for rows in (modes.B.T, modes.C))

    def between(matrix: Array) -> Array:
        return left.T @ ((matrix * scale) * scale[:, None]) @ right

    mass, stiffness = between(np.eye(scale.size)), between(np.diag(modes.squares))
    if not np.any(modes.damping):
        squares = _shifted(-_pencil(stiffness + shift**2 * mass, mass), shift**2)
        root = np.sqrt(squares)
        return _sorted(np.concatenate([root, -root]))
    damping = between(modes.damping)
    whole = stiffness + shift * damping + shift**2 * mass
    n = len(whole)
    slopes = scipy.linalg.solve(whole, np.hstack([2.0 * shift * mass + damping, mass])) if n else np.zeros((0, 0))
    companion = np.vstack([-slopes, np.eye(n, 2 * n)])
    return _sorted(_shifted(scipy.linalg.eigvals(companion), shift))


def zeros(system: StateSpace, shift: float) -> Complex:
    """Transmission zeros of any linear system, up to a tenth of its fastest pole.

    Parameters
    ----------
    system : StateSpace
    shift : float
        No zero, positive, of the size of low frequencies [rad/s].
    """
    outputs, inputs = system.D.shape
    B, D = system.B, system.D
    if inputs > outputs:
        return _common(lambda mix: zeros(system._replace(B=B @ mix, D=D @ mix), shift), (inputs, outputs), shift)
    if inputs < outputs:
        return _common(lambda mix: zeros(system._replace(C=mix @ system.C, D=mix @ D), shift), (inputs, outputs), shift)
    n, columns = len(system.A), _sizes(B, 0)
    rows = _sizes(np.hstack([system.C, D]), 1)
    pencil = np.block([[system.A - shift * np.eye(n), B / columns], [system.C / rows, D / rows / columns]])
    found = _shifted(_pencil(pencil, np.eye(*pencil.shape) * (np.arange(len(pencil)) < n)), shift)
    return _sorted(found[np.abs(found) < _FURTHEST * np.linalg.norm(system.A, 2)])


def _common(squared: Callable[[Array], Complex], shape: tuple[int, int], shift: float) -> Complex:
    """What the zeros of a system squared by two random matrices have in common."""
    random = np.random.default_rng(0)
    first, second = (squared(random.standard_normal(shape)) for _ in range(2))
    if not (first.size and second.size):
        return np.zeros(0, dtype=complex)
    apart = np.min(np.abs(first[:, None] - second), axis=1)
    return first[apart <= _SAME * np.maximum(np.abs(first), shift)]


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


def unit_rows(rows: Array) -> Array:
    """Rows of size one, those of zeros as they are."""
    return rows / _sizes(rows, 1)


def _sizes(matrix: Array, axis: int) -> Array:
    size = np.linalg.norm(matrix, axis=axis, keepdims=True)
    return np.where(size > 0.0, size, 1.0)


def _sorted(values: Complex) -> Complex:
    """By magnitude."""
    return values[np.argsort(np.abs(values), kind="stable")]
