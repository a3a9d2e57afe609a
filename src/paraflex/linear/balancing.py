"""Balanced truncation (Moore 1981) of the stable part of a linear system; the remaining part is retained."""

import numpy as np
import scipy

from paraflex.arrays import Array, Indices
from paraflex.dynamics.state_space import StateSpace
from paraflex.errors import InputError

# Hankel singular values below this fraction of the largest are lost in the rounding of the Gramians.
_RESOLVED = float(np.sqrt(np.finfo(float).eps))
# Poles with a real part above minus this fraction of a low frequency are not stable.
_STABLE = 1e-6


def balanced(system: StateSpace, count: int, low: float) -> tuple[StateSpace, Array, float]:
    """Truncate the least controllable and observable states of the stable part.

    Parameters
    ----------
    system : StateSpace
        Linear system.
    count : int
        Number of states to retain, including those of the part that is not stable.
    low : float
        Typical low angular frequency [rad/s].

    Returns
    -------
    StateSpace
        Truncated system.
    (stable,) array
        Hankel singular values of the stable part, descending, in units of outputs over inputs.
    float
        Upper bound of the error's largest gain over all frequencies: twice the sum of the truncated values (Enns,
        Glover 1984), with values lost in rounding replaced by the limit of their resolution.

    Raises
    ------
    InputError
        The number is less than that of the states that are not stable, or the system has no stable part.
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
    # x = right [z1; z2] decouples the two parts.
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
    # Projections z = left x and x = right z.
    left = np.vstack([whole[free], left[:neutral], (U[:, :kept] / root).T @ seen.T @ left[neutral:]])
    right = np.hstack([whole[:, free], right[:, :neutral], right[:, neutral:] @ reached @ (V[:kept].T / root)])
    bound = 2.0 * float(np.sum(np.maximum(hankel[kept:], _RESOLVED * hankel.max(initial=0.0))))
    return StateSpace(left @ system.A @ right, left @ system.B, system.C @ right, system.D), hankel, bound


def _uncoupled(A: Array, low: float) -> tuple[Indices, Indices]:
    """Return the states of undamped motions that are not coupled to other states, and all other states.

    Rigid motions are thus retained without a transformation, whose rounding errors would be visible at low frequencies,
    where their gains are large.
    """
    label = scipy.sparse.csgraph.connected_components(scipy.sparse.csr_matrix(A), connection="weak")[1]
    groups = [np.flatnonzero(label == k) for k in range(label.max(initial=-1) + 1)]
    free = [group for group in groups
            if np.all(np.linalg.eigvals(A[np.ix_(group, group)]).real > -_STABLE * low)]  # fmt: skip
    found = np.sort(np.concatenate([np.zeros(0, dtype=int), *free]))
    return found, np.setdiff1d(np.arange(len(A)), found)


def _root(gramian: Array) -> Array:
    """Return a matrix L with L L^T the Gramian, which may be slightly indefinite by rounding."""
    values, vectors = scipy.linalg.eigh(0.5 * (gramian + gramian.T))
    return vectors * np.sqrt(np.maximum(values, 0.0))
