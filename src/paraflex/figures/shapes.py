"""Drawn shapes of bodies: the stations that lines join."""

from __future__ import annotations

import numpy as np

from paraflex.arrays import Array


def figure_of(places: Array) -> Array:
    """Return the stations (..., s, 2) of a body that are joined by lines; a closed figure ends where it closes."""
    first = places.reshape(-1, *places.shape[-2:])[0]
    back = np.flatnonzero(np.all(first[1:] == first[0], axis=1))
    return places[..., : back[0] + 2, :] if back.size and back[0] > 1 else places
