"""Bases of few coordinates for symmetric second-order equations, mass y'' + stiffness y = f.

Static shapes of an interface and vibrations with the interface held (Craig and Bampton 1968), static shapes and what
the lowest modes with a free interface are beside them (Rubin 1975, Craig and Chang 1977), or these modes alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy

from paraflex.arrays import Array
from paraflex.dynamics.linearise import undamped_modes
from paraflex.linear.independent import DEPENDENT, successive, unit_rows


class Basis(NamedTuple):
    """Coordinates y = shapes z, and the flexibility of the motions of which some are kept and the others left out.

    Attributes
    ----------
    shapes : (f, k) array
    flexibility : (f, f) array
        Static response to forces in motions with the interface held, or in modes that are left out.
    """

    shapes: Array
    flexibility: Array


def kernel(rows: Array, scale: Array) -> Array:
    """Basis (f, free) of what rows (h, f) do not see, in coordinates of given sizes (f,): the others follow from some.

    Rows that are coordinates themselves take out these, and leave the others as they are.
    """
    f = rows.shape[1]
    if not rows.size:
        return np.eye(f)
    factor, order = scipy.linalg.qr(unit_rows(rows * scale), mode="r", pivoting=True)
    size = np.abs(np.diag(factor))
    rank = int(np.sum(size > DEPENDENT * size.max(initial=0.0)))
    taken, free = np.asarray(order)[:rank], np.sort(np.asarray(order)[rank:])
    basis = np.zeros((f, free.size))
    basis[free, np.arange(free.size)] = 1.0
    basis[taken] = -np.linalg.lstsq((rows * scale)[:, taken], rows[:, free], rcond=None)[0] * scale[taken, None]
    return basis


def independent_rows(rows: Array, scale: Array) -> list[int]:
    """Numbers of rows (h, f) none of which follows from those before it."""
    return successive(unit_rows(rows * scale), np.zeros((rows.shape[1], 0)))[0]


def craig_bampton(mass: Array, stiffness: Array, rows: Array, count: int, typical: float) -> Basis:
    """Static shapes of an interface, then the lowest vibrations with it held.

    Parameters
    ----------
    mass, stiffness : (f, f) arrays
        Symmetric.
    rows : (h, f) array
        Independent; the coordinates of the interface are rows y.
    count : int
        Of vibrations.
    typical : float
        Square of a low frequency [rad^2/s^2].

    Returns
    -------
    Basis
        The first h coordinates are those of the interface.
    """
    part = _interface(mass, stiffness, rows, typical)
    return Basis(np.hstack([part.static, part.held[:, :count]]), part.flexibility)


def rubin(mass: Array, stiffness: Array, rows: Array, count: int, typical: float) -> Basis:
    """Static shapes of an interface, then shapes with it held with which the lowest modes of all are exact.

    With the interface held, inertia forces of a mode bend the mechanism as this mode does beside the static shapes.
    Arguments and coordinates are those of `craig_bampton`. Modes are those with the interface free, rigid ones among
    them: that these bend what accelerates makes responses at low frequencies exact to second order.
    """
    part = _interface(mass, stiffness, rows, typical)
    squares, modes = undamped_modes(mass, stiffness, typical)
    free, few = part.squares == 0.0, slice(min(count, squares.size))
    held = np.where(free, np.inf, part.squares)
    lowest = np.min(np.abs(held), initial=np.inf)
    # In vibrations with the interface held, of size one where it is not rounding.
    bent = (part.held.T @ mass @ modes[:, few]) / held[:, None] * np.maximum(np.abs(squares[few]), lowest)
    bent[:, np.linalg.norm(bent, axis=0) < DEPENDENT] = 0.0
    # Motions that are free with the interface held come first, other vibrations where modes bring too few shapes.
    wanted = np.hstack([np.diag(1.0 * free), bent, np.eye(free.size)])
    found = successive(unit_rows(wanted.T), np.zeros((free.size, 0)))[1][:, :count]
    turn = scipy.linalg.eigh(found.T @ (part.squares[:, None] * found))[1]
    return Basis(np.hstack([part.static, part.held @ found @ turn]), part.flexibility)


def carried(mass: Array, stiffness: Array, rows: Array, shapes: Array, typical: float, *, renewed: bool) -> Basis:
    """Shapes (f, k) of another pose, whose first coordinates become those of an interface in this one.

    Arguments are those of `craig_bampton`. The flexibility is that of this pose; so are static shapes, if renewed.
    """
    part = _interface(mass, stiffness, rows, typical)
    h = len(rows)
    own = shapes - part.static @ (rows @ shapes - np.eye(h, shapes.shape[1]))
    return Basis(np.hstack([part.static if renewed else own[:, :h], own[:, h:]]), part.flexibility)


def interpolated(shapes: Sequence[Array], mass: Array, fixed: int, part: float) -> Array:
    """Shapes (f, k) between those of several poses, on straight lines from each to the next.

    Parameters
    ----------
    shapes : sequence of (f, k) arrays
        Of poses one after the other.
    mass : (f, f) array
        Metric in which they are compared.
    fixed : int
        So many of their first columns stand for the same at every pose. The others span vibrations: they are turned
        among themselves until they are nearest to those before (orthogonal Procrustes problem, Schoenemann 1966), so
        that neither signs nor crossings of frequencies matter.
    part : float
        From 0, the first pose, to len(shapes) - 1, the last.
    """
    aligned = [shapes[0]]
    for one in shapes[1:]:
        U, _, V = scipy.linalg.svd(one[:, fixed:].T @ mass @ aligned[-1][:, fixed:])
        aligned.append(np.hstack([one[:, :fixed], one[:, fixed:] @ (U @ V)]))
    first = min(int(part), len(shapes) - 2)
    return aligned[0] if first < 0 else aligned[first] + (part - first) * (aligned[first + 1] - aligned[first])


class _Interface(NamedTuple):
    """Static shapes (f, h) of an interface, and vibrations (f, f - h) with it held: squares, shapes, flexibility."""

    static: Array
    squares: Array
    held: Array
    flexibility: Array


def _interface(mass: Array, stiffness: Array, rows: Array, typical: float) -> _Interface:
    scale = 1.0 / np.sqrt(np.diag(mass))
    free = kernel(rows, scale)
    squares, shapes = undamped_modes(free.T @ mass @ free, free.T @ stiffness @ free, typical)
    held = free @ shapes
    flexibility = _flexibility(squares, held)
    turned = scale[:, None] * np.linalg.pinv(rows * scale)
    return _Interface(turned - flexibility @ (stiffness @ turned), squares, held, flexibility)


def lowest_modes(mass: Array, stiffness: Array, count: int, typical: float) -> Basis:
    """The lowest modes, and the flexibility of all others."""
    squares, shapes = undamped_modes(mass, stiffness, typical)
    return Basis(shapes[:, :count], _flexibility(squares[count:], shapes[:, count:]))


def _flexibility(squares: Array, shapes: Array) -> Array:
    """Static response of modes (f, k) of unit mass to forces, without motions that are free."""
    elastic = squares != 0.0
    return (shapes[:, elastic] / squares[elastic]) @ shapes[:, elastic].T
