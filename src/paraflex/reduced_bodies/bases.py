"""Bases of bodies from deflections: the directions of largest strain energy (proper orthogonal decomposition).

Deflections u of a body, in modes of unit mass and frequencies omega, have the strain energy |omega u|^2 / 2. The
singular value decomposition of omega u over all deflections gives directions and their shares of the energy. The
directions with the largest shares are kept, over all bodies together.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from paraflex.arrays import Array
from paraflex.dynamics import System
from paraflex.dynamics.sparse import stiffness_diagonal
from paraflex.errors import InputError

# Directions with less than this fraction of the largest root of energy are rounding.
_ROUNDING = 1e-10


def bases_of(system: System, deflections: Sequence[Array], count: int) -> dict[str, tuple[tuple[float, ...], ...]]:
    """Return reduced flexible coordinates (own, kept) of every flexible body, in those of its reference condition.

    Parameters
    ----------
    system : System
        System with all flexible coordinates.
    deflections : sequence of (k, n) arrays
        Coordinates of the system; all arrays have equal weight by their strain energy.
    count : int
        Number of coordinates kept, over all bodies together.

    Raises
    ------
    InputError
        The count exceeds the number of flexible coordinates, or of independent directions in the deflections.
    """
    _check(system, count)
    together = normalised_by_energy(system, deflections)
    found = []
    for body in system.bodies:
        energies = body.modes.omega * together[:, body.flexible]
        directions, sizes, _ = np.linalg.svd(energies.T, full_matrices=False)
        shapes = body.modes.vectors @ (directions / body.modes.omega[:, None])
        found += [(size, body.name, shapes[:, k]) for k, size in enumerate(sizes.tolist())]
    # Equal directions keep the order of their bodies.
    kept = sorted(found, key=lambda one: -one[0])[:count]
    if not kept or kept[-1][0] <= _ROUNDING * kept[0][0]:
        available = sum(size > _ROUNDING * kept[0][0] for size, _, _ in found) if kept else 0
        raise InputError(
            f"are more than the {available} directions in which the motion bends the bodies", field="coordinates",
            value=count, remedy=f"keep at most {available}" if available else "it does not bend them at all",
        )  # fmt: skip
    return {
        body.name: _rows([shape for _, name, shape in kept if name == body.name], len(body.modes.vectors))
        for body in system.bodies
        if body.nf
    }


def _check(system: System, count: int) -> None:
    if not system.n_flexible:
        raise InputError("has rigid bodies only", field="mechanism", value=system.mechanism.name,
                         remedy="give it flexible ones")  # fmt: skip
    if not 1 <= count <= system.n_flexible:
        raise InputError(
            "no such number of flexible coordinates", field="coordinates", value=count,
            remedy=f"from 1 to {system.n_flexible}",
        )  # fmt: skip


def normalised_by_energy(system: System, parts: Sequence[Array]) -> Array:
    """Scale deflections (k, n) to one unit of strain energy in total, with equal shares of each part (any, n)."""
    stiffness = stiffness_diagonal(system)
    energies = [np.sum(part**2 @ stiffness) for part in parts]
    bent = [part / np.sqrt(energy) for part, energy in zip(parts, energies, strict=True) if energy > 0.0]
    return np.concatenate([np.zeros((0, system.n)), *bent]) / np.sqrt(max(1, len(bent)))


def _rows(shapes: list[Array], own: int) -> tuple[tuple[float, ...], ...]:
    return tuple(map(tuple, np.array(shapes).T.tolist())) if shapes else ((),) * own
