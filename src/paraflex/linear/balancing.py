"""Balanced truncation (Moore 1981) of the stable part of a linear system; the other part is kept as it is."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy

from paraflex.arrays import Array
from paraflex.errors import InputError
from paraflex.linear.zeros import StateSpace

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
        Glover 1984).
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
    schur, basis, neutral = scipy.linalg.schur(system.A, sort=lambda real, _: real > -_STABLE * low)
    if neutral > count or neutral == len(schur):
        raise InputError(
            f"{neutral} of {len(schur)} states are not damped, and balanced truncation keeps them",
            field="states", value=count,
            remedy="give links damping ([damping], or damping = { ratios = [0.01] }), or choose craig-bampton",
        )  # fmt: skip
    # x = whole [z1; z2] uncouples the two parts.
    coupling = scipy.linalg.solve_sylvester(
        schur[:neutral, :neutral], -schur[neutral:, neutral:], -schur[:neutral, neutral:]
    )
    right = np.hstack([basis[:, :neutral], basis[:, neutral:] + basis[:, :neutral] @ coupling])
    left = np.vstack([basis[:, :neutral].T - coupling @ basis[:, neutral:].T, basis[:, neutral:].T])
    stable, inputs, outputs = schur[neutral:, neutral:], left[neutral:] @ system.B, system.C @ right[:, neutral:]
    reached = _root(scipy.linalg.solve_continuous_lyapunov(stable, -inputs @ inputs.T))
    seen = _root(scipy.linalg.solve_continuous_lyapunov(stable.T, -outputs.T @ outputs))
    U, hankel, V = scipy.linalg.svd(seen.T @ reached)
    kept = min(count - neutral, int(np.sum(hankel > 0.0)))
    root = np.sqrt(hankel[:kept])
    return Balanced(
        left=np.vstack([left[:neutral], (U[:, :kept] / root).T @ seen.T @ left[neutral:]]),
        right=np.hstack([right[:, :neutral], right[:, neutral:] @ reached @ (V[:kept].T / root)]),
        hankel=hankel,
        bound=2.0 * float(np.sum(hankel[kept:])),
    )


def _root(gramian: Array) -> Array:
    """A matrix L with L L^T the Gramian, which rounding may leave slightly indefinite."""
    values, vectors = scipy.linalg.eigh(0.5 * (gramian + gramian.T))
    return vectors * np.sqrt(np.maximum(values, 0.0))
