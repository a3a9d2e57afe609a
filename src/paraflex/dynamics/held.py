"""Vibrations and static shapes of a body under conditions: rows on its undeformed coordinates (r, phi, u)."""

from typing import Any

import numpy as np
import scipy.linalg

from paraflex.arrays import Array, Numbers
from paraflex.fem.eigen import eigenpairs
from .coordinates import BodyCoordinates, Marker

# Conditions with an independent part smaller than this fraction are redundant.
_DEPENDENT = 1e-9


def place_rows(marker: Marker) -> Numbers:
    """Return the derivative of a marker's position in the undeformed body by (r, phi, u), (2, 3 + nf)."""
    x, y = marker.x0
    return np.hstack([np.array([[1.0, 0.0, -y], [0.0, 1.0, x]]), marker.N])


def slope_rows(marker: Marker) -> Numbers:
    """Return the derivative of the rotation of a marker's material by (r, phi, u), (1, 3 + nf)."""
    return np.concatenate([[0.0, 0.0, 1.0], marker.slope])[None]


def held_modes(body: BodyCoordinates, held: Numbers) -> tuple[Numbers, Numbers]:
    """Return frequencies (k,) and flexible parts (nf, k) of mass-normalised elastic modes of a body under conditions.

    `held` has one row per condition on its coordinates (r, phi, u); all conditions are zero together.
    """
    mass, stiffness = body.mass_matrix, np.diag(body.stiffness)
    sizes = 1.0 / np.sqrt(np.real(np.diag(mass)))
    basis = sizes[:, None] * null_space(held * sizes)
    values, vectors = eigenpairs(basis.T @ stiffness @ basis, basis.T @ mass @ basis)
    rigid = 3 - (int(np.linalg.matrix_rank(_unit(held * sizes)[:, :3], tol=_DEPENDENT)) if held.size else 0)
    return np.sqrt(values[rigid:]), (basis @ vectors[:, rigid:])[3:]


def null_space(rows: Numbers) -> Numbers:
    """Return columns (n, n - rank) that span the null space of rows (k, n) of similar scale."""
    if not rows.size:
        return np.eye(rows.shape[1])
    size = np.linalg.norm(np.real(rows), axis=1)
    rows = rows[size > 0.0] / size[size > 0.0, None]
    factors: Any = scipy.linalg.qr(np.real(rows).T, mode="r", pivoting=True)
    upper, order = factors
    rank = int(np.sum(np.abs(np.diag(upper)) > _DEPENDENT))
    rows = rows[order[:rank]]
    free = scipy.linalg.null_space(np.real(rows), rcond=_DEPENDENT)
    # The imaginary part of a complex step follows the conditions.
    return free - rows.T @ np.linalg.solve(rows @ rows.T, rows @ free)


def static_shapes(body: BodyCoordinates, held: Numbers) -> Numbers:
    """Return the flexible parts (nf, k) of the static shapes of a body under self-balanced forces at its conditions.

    They are all deflections that the conditions can impose; k is their number less that of the rigid motions they hold.
    """
    balanced = null_space(held[:, :3].T)
    return held[:, 3:].T @ balanced / (body.modes.omega**2)[:, None]


def _unit(rows: Numbers) -> Array:
    """Return the rows normalised to length one, without the imaginary part of a complex step."""
    return np.real(rows) / np.linalg.norm(np.real(rows), axis=1)[:, None]
