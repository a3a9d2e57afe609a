"""Reduced bases of symmetric second-order equations, mass y'' + stiffness y = f.

A basis consists of the static shapes of an interface and vibrations with the interface held (Craig and Bampton 1968),
of static shapes and the remainder of the lowest modes with a free interface (Rubin 1975, Craig and Chang 1977), or of
these modes alone.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy

from paraflex.arrays import Array
from paraflex.dynamics.linearise import undamped_modes
from .independent import DEPENDENT, successive, unit_rows


class Basis(NamedTuple):
    """Reduced basis, y = shapes z, with the flexibility of the truncated motions.

    Attributes
    ----------
    shapes : (f, k) array
        Basis vectors in columns.
    flexibility : (f, f) array
        Static response to forces of the motions with the interface held, or of the omitted modes.
    """

    shapes: Array
    flexibility: Array


def kernel(rows: Array, scale: Array) -> Array:
    """Return a basis (f, free) of the null space of rows (h, f), with typical sizes (f,) of the coordinates.

    The basis is given by independent coordinates, from which the others follow. If the rows are unit vectors, it has
    the unit vectors of the other coordinates.
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
    """Return the indices of the rows (h, f) that are independent of previous rows."""
    return successive(unit_rows(rows * scale), np.zeros((rows.shape[1], 0)))[0]


def craig_bampton(mass: Array, stiffness: Array, rows: Array, count: int, typical: float) -> Basis:
    """Return the static shapes of an interface, then the lowest vibrations with the interface held.

    Parameters
    ----------
    mass, stiffness : (f, f) arrays
        Symmetric mass and stiffness matrices.
    rows : (h, f) array
        Independent rows; the interface coordinates are rows y.
    count : int
        Number of vibrations.
    typical : float
        Square of a typical low frequency [rad^2/s^2].

    Returns
    -------
    Basis
        Craig-Bampton basis, whose first h coordinates are those of the interface.
    """
    part = _interface(mass, stiffness, rows, typical)
    return Basis(np.hstack([part.static, part.held[:, :count]]), part.flexibility)


def rubin(mass: Array, stiffness: Array, rows: Array, count: int, typical: float) -> Basis:
    """Return the static shapes of an interface, then shapes with it held that make the lowest free modes exact.

    The part of a mode that is not in the static shapes is the response, with the interface held, to the inertia forces
    of the mode. Arguments and coordinates are those of `craig_bampton`. The modes are those with a free interface and
    include rigid ones, whose inertia forces make responses at low frequencies exact to second order.
    """
    part = _interface(mass, stiffness, rows, typical)
    squares, modes = undamped_modes(mass, stiffness, typical)
    free, few = part.squares == 0.0, slice(min(count, squares.size))
    held = np.where(free, np.inf, part.squares)
    lowest = np.min(np.abs(held), initial=np.inf)
    # Components in vibrations with the interface held, of size one where they are not rounding.
    bent = (part.held.T @ mass @ modes[:, few]) / held[:, None] * np.maximum(np.abs(squares[few]), lowest)
    bent[:, np.linalg.norm(bent, axis=0) < DEPENDENT] = 0.0
    # Free motions with the interface held come first; other vibrations follow if the modes give too few shapes.
    candidates = np.hstack([np.diag(1.0 * free), bent, np.eye(free.size)])
    found = successive(unit_rows(candidates.T), np.zeros((free.size, 0)))[1][:, :count]
    turn = scipy.linalg.eigh(found.T @ (part.squares[:, None] * found))[1]
    return Basis(np.hstack([part.static, part.held @ found @ turn]), part.flexibility)


def carried(mass: Array, stiffness: Array, rows: Array, shapes: Array, typical: float, *, renewed: bool) -> Basis:
    """Adapt shapes (f, k) of another pose, so that their first coordinates are those of the interface at this pose.

    Other arguments are those of `craig_bampton`. The flexibility is that of this pose, and with `renewed` the static
    shapes are as well.
    """
    part = _interface(mass, stiffness, rows, typical)
    h = len(rows)
    own = shapes - part.static @ (rows @ shapes - np.eye(h, shapes.shape[1]))
    return Basis(np.hstack([part.static if renewed else own[:, :h], own[:, h:]]), part.flexibility)


def interpolated(shapes: Sequence[Array], mass: Array, fixed: int, part: float) -> Array:
    """Interpolate linearly between the shapes (f, k) of successive poses.

    Parameters
    ----------
    shapes : sequence of (f, k) arrays
        Shapes at successive poses.
    mass : (f, f) array
        Mass matrix, the metric in which shapes are compared.
    fixed : int
        Number of first columns with the same meaning at every pose. The other columns span vibrations, and are rotated
        to be nearest to those of the previous pose (orthogonal Procrustes problem, Schoenemann 1966), so that neither
        signs nor crossings of frequencies matter.
    part : float
        Position between the poses, from 0, the first, to len(shapes) - 1, the last.
    """
    aligned = [shapes[0]]
    for one in shapes[1:]:
        U, _, V = scipy.linalg.svd(one[:, fixed:].T @ mass @ aligned[-1][:, fixed:])
        aligned.append(np.hstack([one[:, :fixed], one[:, fixed:] @ (U @ V)]))
    first = min(int(part), len(shapes) - 2)
    return aligned[0] if first < 0 else aligned[first] + (part - first) * (aligned[first + 1] - aligned[first])


class _Interface(NamedTuple):
    """Static shapes (f, h) of an interface; squared frequencies, shapes (f, f - h) and flexibility with it held."""

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
    """Return the lowest modes and the flexibility of all others."""
    squares, shapes = undamped_modes(mass, stiffness, typical)
    return Basis(shapes[:, :count], _flexibility(squares[count:], shapes[:, count:]))


def _flexibility(squares: Array, shapes: Array) -> Array:
    """Return the static flexibility of modes (f, k) of unit mass, without free motions."""
    elastic = squares != 0.0
    return (shapes[:, elastic] / squares[elastic]) @ shapes[:, elastic].T
