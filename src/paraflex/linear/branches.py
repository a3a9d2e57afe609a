"""Branches of poles along a motion, tracked by the similarity of their shapes."""

from collections.abc import Sequence

import numpy as np
import scipy

from paraflex.arrays import Array, Complex
from .model import LinearModel

# Number of candidate poles relative to that of branches: other poles may move between those of the branches.
_CANDIDATES = 3
# Modal assurance criterion and distance, relative to the largest pole, of two poles that are regarded as one.
_SAME, _NEAR = 0.999, 1e-6


def pole_branches(models: Sequence[LinearModel], held: Sequence[str] = (), count: int = 8) -> Complex:
    """Track the lowest poles in the closed upper half plane along a motion: (moments, branches) [rad/s].

    A branch continues with the pole of the next moment whose shape has the largest modal assurance criterion with its
    own, in the metric of the mass (Allemang 2003, https://www.sandv.com/downloads/0308alle.pdf). Branches may cross.
    Values are NaN from the moment on at which there are fewer poles than branches.

    Parameters
    ----------
    models : sequence of LinearModel
        Linear models of a mechanism at successive moments of a motion.
    held : sequence of str
        Names of the motors held; none by default.
    count : int
        Largest number of branches, 8 by default.
    """
    found: list[tuple[Complex, Complex]] = []
    for model in models:
        moving = model.motions(held)
        # Lowest poles with a non-negative imaginary part.
        kept = np.flatnonzero(moving.poles.imag >= 0.0)[: _CANDIDATES * count]
        found.append((moving.poles[kept], moving.pole_shapes[:, kept]))
    poles, shapes = found[0]
    # Without the second of two equal poles with the same shape: poles of free motions are double.
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


def _alike(model: LinearModel, first: Complex, second: Complex) -> Array:
    """Compute the modal assurance criterion (first, second) of shapes (n, k)."""
    mass = model.minimal.tangents.whole.mass
    product = np.abs(first.conj().T @ (mass @ second)) ** 2
    sizes = [np.sum(each.conj() * (mass @ each), axis=0).real for each in (first, second)]
    return product / np.outer(*sizes)
