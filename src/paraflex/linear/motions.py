"""Free motions of linear models: undamped modes and poles, optionally with motors held."""

from typing import NamedTuple

import numpy as np
import scipy

from paraflex.arrays import Array, Complex, Indices, brief
from paraflex.dynamics.linearise import undamped_modes

# Modal damping below this fraction of the largest is rounding.
_ROUNDING = 1e-13


class Motions(NamedTuple):
    """Free motions at an operating point, with zero inputs.

    Attributes
    ----------
    frequencies : (k,) array
        Frequencies of the undamped modes, ascending [rad/s]; zero for free and unstable motions.
    shapes : (n, k) array
        Undamped mode shapes of unit modal mass, in all coordinates of the system.
    poles : (2k,) array
        Poles, sorted by magnitude [rad/s].
    pole_shapes : (n, 2k) array
        Shape of each pole, in all coordinates of the system.
    """

    frequencies: Array
    shapes: Array
    poles: Complex
    pole_shapes: Complex
    __repr__ = brief


class SecondOrder(NamedTuple):
    """Equations mass y'' + damping y' + stiffness y = 0 with (f, f) matrices, and a typical low frequency squared.

    If `vibrating`, the stiffness is symmetric, and undamped poles are exact square roots.
    """

    mass: Array
    damping: Array
    stiffness: Array
    typical: float
    vibrating: bool

    def within(self, basis: Array) -> "SecondOrder":
        """Project the equations on a subspace with coordinates z, y = basis z, with a basis (f, k)."""
        mass, damping, stiffness = (basis.T @ part @ basis for part in self[:3])
        return SecondOrder(mass, damping, stiffness, self.typical, self.vibrating)


def driven_equations(mass: Array, damping: Array, stiffness: Array, driven: Indices) -> tuple[Array, Array, Array]:
    """Return the equations (f, f) of a system whose driven coordinates move independently of the others.

    With y = psi y_d + x and the static shapes psi of the driven coordinates, x obeys M x'' + D x' + K x = -D psi y_d'
    for y_d'' = 0. There is no other coupling, so mass and stiffness remain symmetric.
    """
    f = mass.shape[0]
    others = np.setdiff1d(np.arange(f), driven)
    within = np.ix_(others, others)
    static = np.eye(f)[:, driven]
    static[others] = -scipy.linalg.lstsq(stiffness[within], stiffness[np.ix_(others, driven)])[0]
    apart = np.eye(f)
    apart[np.ix_(others, driven)] -= static[others]
    few = np.zeros((3, f, f))
    few[(0, *np.ix_(driven, driven))] = static.T @ mass @ static
    for part, given in zip(few, (mass, damping, stiffness), strict=True):
        part[within] = given[within]
    few[(1, *np.ix_(others, driven))] = (damping @ static)[others]
    found = [apart.T @ part @ apart for part in few]
    return found[0], found[1], found[2]


def modal_damping(damping: Array, shapes: Array) -> Array:
    """Return the modal damping matrix (k, k) of mode shapes (f, k), with entries of rounding size set to zero."""
    found = shapes.T @ damping @ shapes
    return np.where(np.abs(found) > _ROUNDING * np.max(np.abs(found), initial=0.0), found, 0.0)


def motions(equations: SecondOrder, directions: Array) -> Motions:
    """Compute the free motions of second-order equations.

    Parameters
    ----------
    equations : SecondOrder
        Equations of k coordinates.
    directions : (n, k) array
        Derivatives of all coordinates of the system with respect to those of the equations.
    """
    squares, shapes = undamped_modes(
        equations.mass, 0.5 * (equations.stiffness + equations.stiffness.T), equations.typical
    )
    drawn, k = directions @ shapes, squares.size
    damping = modal_damping(equations.damping, shapes)
    stiffness = np.diag(squares) if equations.vibrating else shapes.T @ equations.stiffness @ shapes
    if equations.vibrating and not np.any(damping):
        root = np.sqrt(-squares.astype(complex))
        poles, vectors = np.concatenate([root, -root]), np.hstack([np.eye(k), np.eye(k)]).astype(complex)
    else:
        # Undamped free motions have double poles at zero, which an eigenvalue solver would separate.
        free = (squares == 0.0) & ~np.any(damping, axis=1) & equations.vibrating
        omega = np.sqrt(np.maximum(squares, 0.0) + equations.typical)
        poles, vectors = _first_order(omega, stiffness, damping, np.flatnonzero(~free))
        poles = np.concatenate([np.zeros(2 * int(free.sum()), dtype=complex), poles])
        vectors = np.hstack([np.eye(k)[:, free], np.eye(k)[:, free], vectors])
    order = np.argsort(np.abs(poles), kind="stable")
    return Motions(
        np.sqrt(np.maximum(squares, 0.0)), drawn, poles[order], np.asarray(drawn @ vectors[:, order], dtype=complex)
    )


def _first_order(omega: Array, stiffness: Array, damping: Array, kept: Indices) -> tuple[Complex, Complex]:
    """Compute the poles (2 kept,) of eta'' + damping eta' + stiffness eta = 0 and their shapes eta (k, 2 kept).

    The states are omega eta and eta', which are of equal scale.
    """
    m, within = kept.size, np.ix_(kept, kept)
    scaled = np.hstack([-stiffness[within] / omega[kept], -damping[within]])
    poles, vectors = scipy.linalg.eig(np.vstack([np.diag(omega[kept]) @ np.eye(m, 2 * m, m), scaled]))
    out = np.zeros((omega.size, 2 * m), dtype=complex)
    out[kept] = vectors[:m] / omega[kept, None]
    return np.asarray(poles, dtype=complex), out
