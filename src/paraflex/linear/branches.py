"""Poles along a motion as branches: each pole with the one whose motion it resembles most a moment later."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from paraflex.linear.model import LinearModel

Complex = NDArray[np.complex128]
# Poles that a branch may go on with, as a multiple of the branches: others come between them on the way.
_CANDIDATES = 3
# Assurance criterion and distance, as a part of the largest pole, of two poles that are one.
_SAME, _NEAR = 0.999, 1e-6


def pole_branches(models: Sequence[LinearModel], held: Sequence[str] = (), count: int = 8) -> Complex:
    """Poles (moments, branches) in the upper half plane or on the real axis, the lowest at the first moment.

    A branch goes on with the pole of the next moment whose motion has the largest modal assurance criterion with its
    own, in the metric of the mass (Allemang 2003, https://www.sandv.com/downloads/0308alle.pdf): branches may cross.

    Parameters
    ----------
    models : sequence of LinearModel
        Of one mechanism at moments of a motion.
    held : sequence of str
        Motors that are held.
    count : int
        Most branches.
    """
    found: list[tuple[Complex, Complex]] = []
    for model in models:
        moving = model.motions(held)
        # The lowest poles that are not below the real axis.
        kept = np.flatnonzero(moving.poles.imag >= 0.0)[: _CANDIDATES * count]
        found.append((moving.poles[kept], moving.pole_shapes[:, kept]))
    poles, shapes = found[0]
    # Without the second of those that coincide in one motion: free ones are double.
    same = _alike(models[0], shapes, shapes) > _SAME
    same &= np.abs(poles[:, None] - poles) <= _NEAR * np.abs(poles).max()
    chosen = np.flatnonzero(~np.any(np.tril(same, -1), axis=1))[:count]
    out = np.full((len(models), chosen.size), np.nan + 0j)
    out[0] = poles[chosen]
    for k in range(1, len(models)):
        before, (poles, shapes_now) = shapes[:, chosen], found[k]
        rows, columns = scipy.optimize.linear_sum_assignment(-_alike(models[k], before, shapes_now))
        if rows.size < chosen.size:
            break
        chosen, shapes = columns, shapes_now
        out[k] = poles[chosen]
    return out


def _alike(model: LinearModel, first: Complex, second: Complex) -> NDArray[np.float64]:
    """Modal assurance criterion (first, second) of shapes (n, k)."""
    mass = model.minimal.tangents.whole.mass
    product = np.abs(first.conj().T @ (mass @ second)) ** 2
    sizes = [np.sum(each.conj() * (mass @ each), axis=0).real for each in (first, second)]
    return product / np.outer(*sizes)
