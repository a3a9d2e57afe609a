"""Balanced truncation (Moore 1981) of the stable part of a linear system; the other part is kept as it is."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from paraflex.arrays import Array
from paraflex.errors import InputError
from paraflex.linear.zeros import StateSpace

# Rounding of the Gramians hides Hankel singular values below this part of the largest.
_RESOLVED = float(np.sqrt(np.finfo(float).eps))
# Poles whose real part is above this part of a low frequency, negative, are not stable.
_STABLE = 1e-6


class Balanced(NamedTuple):
    """States x = right z and z = left x of fewer coordinates.

    Attributes
    ----------
    left, right : (r, n) and (n, r) arrays
    hankel : (stable,) array
        Hankel singular values of the stable part, descending, in units of outputs over inputs.
    bound : float
        The largest gain of the error over all frequencies is not above: twice the sum of the values left out (Enns,
        Glover 1984), those that rounding hides as large as it hides.
    """

    left: Array
    right: Array
    hankel: Array
    bound: float


def balanced(system: StateSpace, count: int, low: float) -> Balanced:
    """Keep the states of the stable part that inputs move and outputs see most.

    Parameters
    ----------
    system : StateSpace
    count : int
        Of all states kept, those of the part that is not stable among them.
    low : float
        A low angular frequency [rad/s].

    Raises
    ------
    InputError
        Fewer states than those that are not stable.
    """
    free, others = _uncoupled(system.A, low)
    whole = np.eye(len(system.A))
    within, across = whole[others], whole[:, others]
    schur, basis, neutral = scipy.linalg.schur(
        system.A[np.ix_(others, others)], sort=lambda real, _: real > -_STABLE * low
    )
    first = free.size + neutral
    if first > count or first == len(whole):
        raise InputError(
            f"{first} of {len(whole)} states are not damped, and balanced truncation keeps them",
            field="states", value=count,
            remedy="give links damping ([damping], or damping = { ratios = [0.01] }), or choose craig-bampton",
        )  # fmt: skip
    # x = right [z1; z2] uncouples the two parts.
    coupling = scipy.linalg.solve_sylvester(
        schur[:neutral, :neutral], -schur[neutral:, neutral:], -schur[:neutral, neutral:]
    )
    right = across @ np.hstack([basis[:, :neutral], basis[:, neutral:] + basis[:, :neutral] @ coupling])
    left = np.vstack([basis[:, :neutral].T - coupling @ basis[:, neutral:].T, basis[:, neutral:].T]) @ within
    stable, inputs, outputs = schur[neutral:, neutral:], left[neutral:] @ system.B, system.C @ right[:, neutral:]
    reached = _root(scipy.linalg.solve_continuous_lyapunov(stable, -inputs @ inputs.T))
    seen = _root(scipy.linalg.solve_continuous_lyapunov(stable.T, -outputs.T @ outputs))
    U, hankel, V = scipy.linalg.svd(seen.T @ reached)
    kept = min(count - first, int(np.sum(hankel > 0.0)))
    root = np.sqrt(hankel[:kept])
    return Balanced(
        left=np.vstack([whole[free], left[:neutral], (U[:, :kept] / root).T @ seen.T @ left[neutral:]]),
        right=np.hstack([whole[:, free], right[:, :neutral], right[:, neutral:] @ reached @ (V[:kept].T / root)]),
        hankel=hankel,
        bound=2.0 * float(np.sum(np.maximum(hankel[kept:], _RESOLVED * hankel.max(initial=0.0)))),
    )


def _uncoupled(A: Array, low: float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """States of motions that are not damped and that no other state moves or is moved by; and all others.

    So rigid motions stay what they are: rounding of the transformations that follow would tell at low frequencies,
    where their gains are large.
    """
    label = scipy.sparse.csgraph.connected_components(scipy.sparse.csr_matrix(A), connection="weak")[1]
    groups = [np.flatnonzero(label == k) for k in range(label.max(initial=-1) + 1)]
    free = [group for group in groups
            if np.all(np.linalg.eigvals(A[np.ix_(group, group)]).real > -_STABLE * low)]  # fmt: skip
    found = np.sort(np.concatenate([np.zeros(0, dtype=int), *free]))
    return found, np.setdiff1d(np.arange(len(A)), found)


def _root(gramian: Array) -> Array:
    """A matrix L with L L^T the Gramian, which rounding may leave slightly indefinite."""
    values, vectors = scipy.linalg.eigh(0.5 * (gramian + gramian.T))
    return vectors * np.sqrt(np.maximum(values, 0.0))
