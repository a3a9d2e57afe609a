"""Drawn shapes of bodies: the stations that lines join, and points along lines."""

import numpy as np

from paraflex.arrays import Array, ArrayLike


def figure_of(places: Array) -> Array:
    """Return the stations (..., s, 2) of a body that are joined by lines; a closed figure ends where it closes."""
    first = places.reshape(-1, *places.shape[-2:])[0]
    back = np.flatnonzero(np.all(first[1:] == first[0], axis=1))
    return places[..., : back[0] + 2, :] if back.size and back[0] > 1 else places


def travelled(line: Array) -> Array:
    """Return the distances (n,) along a line (n, 2) from its start to each of its points."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])


def along(line: Array, shares: ArrayLike) -> Array:
    """Return the points (..., 2) at shares (...) of the length of a line (n, 2)."""
    ways = travelled(line)
    return np.stack([np.interp(np.multiply(shares, ways[-1]), ways, line[:, k]) for k in range(2)], axis=-1)
