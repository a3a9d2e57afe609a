"""Newmark family for linear structures with time-dependent constraints, such as a mechanism pose by pose.

    M x'' + K x + C(t)^T mu = f(t),    C(t) x = 0

M and K are constant and block diagonal, with one small block per body; rows of C may depend on one another.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
import scipy

from paraflex.arrays import Array, Indices, NDArray
from paraflex.errors import IntegrationError, Moment
from .newmark import NewmarkNumbers

# Samples whose linear algebra is done at once: some megabytes for a dozen bodies.
_INSTANTS_AT_ONCE = 128
# Eigenvalues of the scaled Schur complement below this fraction of the largest belong to dependent rows.
_DEPENDENT = 1e-12


class Block(NamedTuple):
    """Body of the structure: its coordinates, mass and stiffness matrix."""

    columns: slice
    mass: Array
    stiffness: Array


class Response(NamedTuple):
    """Response of the structure at one time: displacements x, their derivatives (n,), constraint forces mu (rows,)."""

    x: Array
    dx: Array
    ddx: Array
    mu: Array


def march(
    numbers: NewmarkNumbers,
    blocks: Sequence[Block],
    outside: Callable[[slice], tuple[Array, Array]],
    times: Array,
) -> Iterator[Response]:
    """Integrate a structure from rest without displacement.

    Parameters
    ----------
    numbers : NewmarkNumbers
        Coefficients of the method.
    blocks : sequence of Block
        Bodies of the structure.
    outside : callable
        Function that returns the constraints C (k, rows, n) and forces f (k, n) for a slice of the times.
    times : (steps + 1,) array
        Times, evenly spaced by the step [s].

    Yields
    ------
    Response
        Response at every time, including the first.

    Raises
    ------
    IntegrationError
        The rank of the constraints changes.
    """
    h = float(times[1] - times[0])
    b = numbers.weight(h)
    alpha_m, alpha_f, beta, gamma = numbers.alpha_m, numbers.alpha_f, numbers.beta, numbers.gamma
    inverses = _inverses(blocks, b)
    soften = scipy.sparse.block_diag(
        [inverse @ block.stiffness for inverse, block in zip(inverses, blocks, strict=True)], "csr"
    )
    first = outside(slice(0, 1))
    start = _condense(blocks, _inverses(blocks, 0.0), *first)
    rank = int(_condense(blocks, inverses, *first).rank[0])
    mu = start.close[0] @ start.load[0]
    ddx = start.load[0] - start.react[0] @ mu
    x, dx, a = np.zeros_like(ddx), np.zeros_like(ddx), ddx
    yield Response(x, dx, ddx, mu)
    for chunk in range(1, times.size, _INSTANTS_AT_ONCE):
        here = _condense(blocks, inverses, *outside(slice(chunk, chunk + _INSTANTS_AT_ONCE)))
        for k in range(len(here.rank)):
            if here.rank[k] != rank:
                cause = f"{abs(rank - here.rank[k])} of the constraints depend on others at a singular position,"
                remedy = "keep the path clear of it, or compute without kineto-elastodynamics"
                raise IntegrationError(cause, Moment(float(times[chunk + k]), chunk + k), remedy=remedy)
            carried = (alpha_f * ddx - alpha_m * a) / (1.0 - alpha_m)
            predicted = x + h * dx + h**2 * ((0.5 - beta) * a + beta * carried)
            free = here.load[k] - soften @ predicted
            mu = here.close[k] @ (free + predicted / b)
            ddx = free - here.react[k] @ mu
            new = carried + (1.0 - alpha_f) / (1.0 - alpha_m) * ddx
            x = predicted + b * ddx
            dx = dx + h * ((1.0 - gamma) * a + gamma * new)
            a = new
            yield Response(x, dx, ddx, mu)


class _Condensed(NamedTuple):
    """Structure at several times, with the matrices of a step from the prediction x*, in x = x* + b x''.

        x'' = free - react mu,    mu = close (free + x*/b),    free = load - A^-1 K x*,    A = M + b K

    load (k, n) is A^-1 f; react (k, n, rows) is A^-1 C^T; close (k, rows, n) is (C A^-1 C^T)^+ C, with a pseudo-inverse
    that leaves out dependent rows; rank (k,) is the rank of C.
    """

    load: Array
    react: Array
    close: Array
    rank: Indices


def _inverses(blocks: Sequence[Block], weight: float) -> list[NDArray[np.floating]]:
    """Return A^-1 = (M + b K)^-1 of every block."""
    return [np.linalg.inv(block.mass + weight * block.stiffness) for block in blocks]


def _condense(blocks: Sequence[Block], inverses: Sequence[NDArray[np.floating]], C: Array, forces: Array) -> _Condensed:
    """Factor the Schur complements C A^-1 C^T."""
    k, m, n = C.shape
    load, react, schur, close = np.zeros((k, n)), np.zeros((k, n, m)), np.zeros((k, m, m)), np.zeros((k, m, n))
    # Compute body by body: no BLAS distributes such small products to several threads.
    touching = [np.flatnonzero(C[:, :, block.columns].any(axis=(0, 2))) for block in blocks]
    for block, inverse, rows in zip(blocks, inverses, touching, strict=True):
        own = C[:, rows, block.columns]
        reaction = own @ inverse
        load[:, block.columns] = forces[:, block.columns] @ inverse
        react[:, block.columns, rows] = reaction.swapaxes(1, 2)
        schur[:, rows[:, None], rows] += reaction @ own.swapaxes(1, 2)
    pseudo, rank = _pseudo_inverses(schur)
    for block, rows in zip(blocks, touching, strict=True):
        close[:, :, block.columns] = pseudo[:, :, rows] @ C[:, rows, block.columns]
    return _Condensed(load, react, close, rank)


def _pseudo_inverses(schur: Array) -> tuple[Array, Indices]:
    """Return inverses of symmetric matrices (k, m, m) without dependent rows, and the number of independent rows."""
    # Rows in metres and in radians are scaled to the same size before their rank is determined.
    size = 1.0 / np.sqrt(np.diagonal(schur, axis1=1, axis2=2))
    scaled = size[:, :, None] * schur * size[:, None, :]
    inverse, rank = _regular(scaled), np.full(len(schur), schur.shape[1])
    if inverse is None:
        values, vectors = np.linalg.eigh(scaled)
        kept = values > _DEPENDENT * values[:, -1:]
        weights = np.where(kept, 1.0 / np.where(kept, values, 1.0), 0.0)
        inverse, rank = (vectors * weights[:, None, :]) @ vectors.swapaxes(1, 2), np.sum(kept, axis=1)
    return size[:, :, None] * inverse * size[:, None, :], rank


def _regular(matrices: Array) -> NDArray[np.floating] | None:
    """Return the inverses of matrices, or None if one is nearly singular; several times cheaper than eigenvectors."""
    try:
        inverse = np.linalg.inv(matrices)
    except np.linalg.LinAlgError:
        return None
    norms = [np.abs(x).sum(axis=1).max() for x in (matrices, inverse)]
    return inverse if norms[0] * norms[1] * _DEPENDENT < 1.0 else None
