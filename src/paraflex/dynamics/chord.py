"""Deflections of a body from its chord, independent of the choice of body frame."""

from __future__ import annotations

import numpy as np

from paraflex.arrays import Array


def across_chord(stations: Array, rest: Array) -> Array:
    """Return the displacements (k, s) of stations of a deformed body across its chord [m], positive to the left.

    The chord is the line from the first station to the last. Displacements count from the positions that the stations
    have relative to the chord of the undeformed body; for a beam these are on the chord. Rigid motion has no effect.

    Parameters
    ----------
    stations : (k, s, 2) array
        Positions of the stations in any frame [m]; real or with a complex step.
    rest : (s, 2) array
        Positions of the stations in the undeformed body [m].

    Returns
    -------
    (k, s) array
        Displacements [m]; NaN where the first and last stations of the undeformed body coincide.
    """
    return _across(stations) - _across(rest[None])


def _across(stations: Array) -> Array:
    """Return the coordinates of stations normal to the line from the first to the last."""
    arms = stations - stations[:, :1]
    x, y = arms[:, -1:, 0], arms[:, -1:, 1]
    # Roots and products only, no norm or modulus: these are analytic, as a complex step requires.
    length = np.sqrt(x**2 + y**2)
    length = np.where(length == 0.0, np.nan, length)
    return (x * arms[:, :, 1] - y * arms[:, :, 0]) / length
