"""Reduced flexible coordinates of a body: its lowest modes, Craig-Bampton shapes, or given shapes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import scipy.linalg

from paraflex.arrays import Numbers
from paraflex.dynamics.constraints import Constraint
from paraflex.dynamics.coordinates import BodyCoordinates
from paraflex.dynamics.held import held_modes, static_shapes
from paraflex.dynamics.interface import interface_rows
from paraflex.errors import InputError
from paraflex.fem import ModalBasis, modal_basis
from paraflex.mechanism import Body, ComponentModes, FlexibleBeam, Mechanism, RigidBody

# A shape is dropped if its part independent of the others is below this fraction, by the root of its strain energy.
_DEPENDENT = 1e-10


def is_reduced(mechanism: Mechanism, body: Body) -> bool:
    """Return whether a body keeps fewer flexible coordinates than its elements or assumed functions have."""
    if isinstance(body, RigidBody) or not body.flexible:
        return False
    return body.modes is not None or body.name in mechanism.bases


def reduced_body(
    mechanism: Mechanism,
    bodies: Sequence[BodyCoordinates],
    constraints: Sequence[Constraint],
    name: str,
    like: ModalBasis | None = None,
) -> BodyCoordinates:
    """Return an undamped body in its reduced flexible coordinates.

    Parameters
    ----------
    mechanism : Mechanism
        Mechanism of the body, with its given bases.
    bodies : sequence of BodyCoordinates
        Bodies of the mechanism, each with all its coordinates, undamped.
    constraints : sequence of Constraint
        Constraints of the mechanism.
    name : str
        Name of the body.
    like : ModalBasis, optional
        Modes of the same body with other numbers, which the reduced modes follow: see `build_system`.

    Raises
    ------
    InputError
        Given shapes have another number of coordinates, or something slides along a body with Craig-Bampton shapes.
    """
    body = next(one for one in bodies if one.name == name)
    described = mechanism.body(name)
    assert not isinstance(described, RigidBody)
    if name in mechanism.bases:
        shapes = _vibrations(body, _given(body, np.array(mechanism.bases[name])))
    elif isinstance(described, FlexibleBeam) and described.reduction is ComponentModes.CRAIG_BAMPTON:
        rows = interface_rows(mechanism, bodies, constraints, name)
        held = held_modes(body, rows)[1][:, : described.modes]
        shapes = _vibrations(body, np.hstack([static_shapes(body, rows), held]))
    else:
        shapes = np.eye(body.nf) if like is not None else np.eye(body.nf)[:, : described.modes]
    if like is not None:
        own = body.shape.integrals.Mff
        nearest = ModalBasis(_frequencies(body, shapes), body.modes.vectors @ shapes).like(like, own)
        shapes = body.modes.vectors.T @ own @ nearest.vectors
    return replace(
        body,
        integrals=body.integrals.in_basis(shapes),
        modes=ModalBasis(_frequencies(body, shapes), body.modes.vectors @ shapes),
        points=None if body.points is None or not shapes.size else body.points.in_basis(shapes),
        damping=np.zeros((shapes.shape[1], shapes.shape[1])),
    )


def _given(body: BodyCoordinates, shapes: Numbers) -> Numbers:
    """Express given shapes (own, k), in the flexible coordinates of the body's reference condition, in its modes."""
    own = body.shape.integrals.Mff
    if shapes.ndim != 2 or len(shapes) != len(own):
        raise InputError(
            f"has shapes in {len(shapes)} coordinates, and the body {len(own)}", field=f"bases.{body.name}",
            remedy="reduce it again after a change of its mesh, points or reference",
        )  # fmt: skip
    return body.modes.vectors.T @ own @ shapes


def _vibrations(body: BodyCoordinates, shapes: Numbers) -> Numbers:
    """Return mass-normalised modes (nf, k) of a body restricted to the span of shapes (nf, any), in its full modes."""
    energies = body.modes.omega[:, None] * shapes
    sizes = np.linalg.norm(np.real(energies), axis=0)
    shapes = shapes[:, sizes > 0.0] / sizes[sizes > 0.0]
    if not shapes.size:
        return np.zeros((body.nf, 0))
    factors: Any = scipy.linalg.qr(body.modes.omega.real[:, None] * np.real(shapes), mode="r", pivoting=True)
    upper, order = factors
    shapes = shapes[:, np.sort(order[: int(np.sum(np.abs(np.diag(upper)) > _DEPENDENT))])]
    return shapes @ modal_basis(body.integrals.in_basis(shapes)).vectors


def _frequencies(body: BodyCoordinates, shapes: Numbers) -> Numbers:
    """Return the angular frequencies of modes (nf, k) of unit mass [rad/s]."""
    return np.sqrt(np.sum((body.modes.omega[:, None] * shapes) ** 2, axis=0))
