"""Motion of named points and deflections from chords, from coordinates over time (k, n)."""

from typing import NamedTuple

import numpy as np

from paraflex.arrays import Array, brief
from paraflex.mechanism import PointRef
from .coordinates import GROUND_INDEX, Marker
from .system import System


class PointMotion(NamedTuple):
    """Position [m], velocity [m/s] and acceleration [m/s^2] in the ground frame, each (k, 2)."""

    position: Array
    velocity: Array
    acceleration: Array
    __repr__ = brief


def point_motion(system: System, ref: PointRef, q: Array, v: Array, a: Array) -> PointMotion:
    """Return the motion of a named point for coordinates (k, n) and their derivatives."""
    return marker_motion(system, system.marker(ref), q, v, a)


def marker_position(system: System, marker: Marker, q: Array) -> Array:
    """Return the position (..., 2) of a material point in the ground frame for coordinates (..., n)."""
    if marker.body == GROUND_INDEX:
        return np.broadcast_to(marker.x0, (*q.shape[:-1], 2))
    body, at = system.bodies[marker.body], q.T
    x, y = marker.place(q[..., body.flexible]).T
    c, s = np.cos(at[body.angle]), np.sin(at[body.angle])
    return np.array([at[body.offset] + (c * x - s * y), at[body.offset + 1] + (s * x + c * y)]).T


def marker_place(system: System, marker: Marker, q: Array) -> tuple[Array, Array]:
    """Return the position (k, 2) of a point in the ground frame, and its derivative (k, 2, n): [1, R E s, R ds/du]."""
    rows = np.zeros((q.shape[0], 2, q.shape[1]), dtype=np.result_type(q, marker.x0, marker.N))
    position = marker_position(system, marker, q)
    if marker.body == GROUND_INDEX:
        return position, rows
    body = system.bodies[marker.body]
    c, s = np.cos(q[:, body.angle]), np.sin(q[:, body.angle])
    R = np.stack([np.stack([c, -s], axis=1), np.stack([s, c], axis=1)], axis=1)
    shape = np.broadcast_to(marker.N, (q.shape[0], *marker.N.shape)).astype(rows.dtype)
    if marker.bending is not None:
        shape[:, 0] -= q[:, body.flexible] @ marker.bending
    arm = position - q[:, body.position]
    rows[:, 0, body.offset] = rows[:, 1, body.offset + 1] = 1.0
    rows[:, 0, body.angle], rows[:, 1, body.angle] = -arm[:, 1], arm[:, 0]
    rows[:, :, body.flexible] = R @ shape
    return position, rows


def quarter_turn(x: Array) -> Array:
    """Return E x for vectors (k, 2), a rotation by a quarter turn."""
    return np.column_stack([-x[:, 1], x[:, 0]])


def cross(a: Array, b: Array) -> Array:
    """Return the cross products (...) of vectors (..., 2)."""
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def marker_motion(system: System, marker: Marker, q: Array, v: Array, a: Array) -> PointMotion:
    """Return the motion of a material point of a body for coordinates (k, n) and their derivatives.

    p = r + R s, p' = r' + R (phi' E s + N u'), p'' = r'' + R (phi'' E s - phi'^2 s + 2 phi' E N u' + N u'').
    """
    body = system.bodies[marker.body]
    phi, w, dw = q[:, body.angle], v[:, body.angle, None], a[:, body.angle, None]
    c, s = np.cos(phi)[:, None], np.sin(phi)[:, None]

    def turned(x: Array) -> Array:
        return np.hstack([c * x[:, :1] - s * x[:, 1:], s * x[:, :1] + c * x[:, 1:]])

    u, du, ddu = q[:, body.flexible], v[:, body.flexible], a[:, body.flexible]
    local, rate, second = marker.place(u), du @ marker.N.T, ddu @ marker.N.T
    if marker.bending is not None:
        bu, bdu = u @ marker.bending, du @ marker.bending
        rate[:, 0] -= np.sum(du * bu, axis=1)
        second[:, 0] -= np.sum(ddu * bu + du * bdu, axis=1)
    return PointMotion(
        q[:, body.position] + turned(local),
        v[:, body.position] + turned(w * quarter_turn(local) + rate),
        a[:, body.position] + turned(dw * quarter_turn(local) - w**2 * local + 2.0 * w * quarter_turn(rate) + second),
    )


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
    return cross(arms[:, -1:], arms) / np.where(length == 0.0, np.nan, length)
