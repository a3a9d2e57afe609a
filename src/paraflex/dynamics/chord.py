"""Deflections of a body from its chord, which do not depend on the body frame."""

from __future__ import annotations

import numpy as np

from paraflex.arrays import Array


def across_chord(stations: Array, rest: Array) -> Array:
    """Distances of stations of a deformed body from their places across its chord [m], (k, s); positive to the left.

    The chord is the line from the first station to the last. A station of a beam has its place on that line; one of a
    body of another form has it where it stands beside the chord of the undeformed body. A rigid motion changes nothing.

    Parameters
    ----------
    stations : (k, s, 2) array
        In any frame [m]; real or with a complex step.
    rest : (s, 2) array
        Of the undeformed body [m].

    Returns
    -------
    (k, s) array
        NaN where first and last station of the undeformed body are one.
    """
    return _across(stations) - _across(rest[None])


def _across(stations: Array) -> Array:
    """Coordinates of stations normal to the line from the first to the last."""
    arms = stations - stations[:, :1]
    x, y = arms[:, -1:, 0], arms[:, -1:, 1]
    # No norm and no magnitude: a complex step goes through roots and products.
    length = np.sqrt(x**2 + y**2)
    length = np.where(length == 0.0, np.nan, length)
    return (x * arms[:, :, 1] - y * arms[:, :, 0]) / length
