"""Reduced flexible coordinates of a body: its lowest modes, Craig-Bampton shapes, or given shapes.

The interface of a body has the coordinates of its points that joints, motors, springs, loads and lumps act on.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import scipy.linalg

from paraflex.arrays import Numbers
from paraflex.errors import InputError
from paraflex.fem import ModalBasis, modal_basis
from paraflex.kernel.packed import ANGLE, POINT
from paraflex.mechanism import AppliedTorque, Body, ComponentModes, FlexibleBeam, Mechanism, PointRef, RigidBody
from .constraints import Constraint
from .coordinates import BodyCoordinates, Marker, PlacedBodies
from .held import held_modes, place_rows, slope_rows, static_shapes

# A shape is dropped if its part independent of the others is below this fraction, by the root of its strain energy.
_DEPENDENT = 1e-10
Rows = Callable[[Marker], Numbers]


def interface_rows(placed: PlacedBodies, constraints: Sequence[Constraint], name: str) -> Numbers:
    """Return rows on (r, phi, u) of a body: positions and rotations of its points that members act on, each once.

    Rows for joints, prescribed motions, gears, springs, dampers and friction follow from their constraints. Motors,
    loads and lumps add to these, and so does the position of the end-effector, which paths refer to.

    Parameters
    ----------
    placed : PlacedBodies
        Bodies of the mechanism.
    constraints : sequence of Constraint
        Constraints of the mechanism.
    name : str
        Name of the body.

    Raises
    ------
    InputError
        A member slides along the body, which therefore has no fixed interface.
    """
    acting = dict.fromkeys(one for one in _acting(placed.mechanism, constraints) if one[0].body == name)
    none = np.zeros((0, 3 + placed.bodies[placed.index[name]].nf))
    return np.concatenate([none, *(rows(placed.marker(ref)) for ref, rows in acting)])


def _acting(mechanism: Mechanism, constraints: Sequence[Constraint]) -> Iterator[tuple[PointRef, Rows]]:
    """Yield points and the rows of the loads there: forces act on positions, moments on rotations."""
    for term in (term for constraint in constraints for term in constraint.terms):
        if term.carrier in ("frame", "track"):
            beam = None if term.a.on_ground else mechanism.body(term.a.body)
            if isinstance(beam, FlexibleBeam) and beam.reduction is ComponentModes.CRAIG_BAMPTON:
                raise InputError(
                    "a joint slides along it, so that static shapes are not sufficient",
                    field=f"body.{beam.name}.reduction", value=beam.reduction.value,
                    remedy='leave it out, or write "modal"',
                )  # fmt: skip
        if term.kind != ANGLE:
            yield from ((term.a, place_rows), (term.b, place_rows))
        # A member that slides along an axis exerts its force off the point that carries the axis.
        if term.kind != POINT and term.carrier != "nothing":
            yield term.a, slope_rows
        if term.kind == ANGLE:
            yield term.b, slope_rows
    for motor in mechanism.motors:
        joint = mechanism.joint(motor.joint)
        for ref in (joint.a, joint.b):
            if joint.slides:
                yield ref, place_rows
            if not joint.slides or ref is joint.a:
                yield ref, slope_rows
    for load in mechanism.loads:
        yield from ((point, slope_rows if isinstance(load, AppliedTorque) else place_rows) for point in load.points)
    for spring in mechanism.linear_springs:
        yield from ((spring.a, place_rows), (spring.b, place_rows))
    for body in mechanism.bodies:
        for lump in body.lumps if isinstance(body, FlexibleBeam) else ():
            yield PointRef(body.name, lump.point), place_rows
            if lump.inertia > 0.0:
                yield PointRef(body.name, lump.point), slope_rows
    if mechanism.end_effector is not None:
        yield mechanism.end_effector.point, place_rows


def is_reduced(mechanism: Mechanism, body: Body) -> bool:
    """Return whether a body keeps fewer flexible coordinates than its elements or assumed functions have."""
    if isinstance(body, RigidBody) or not body.flexible:
        return False
    return body.modes is not None or body.name in mechanism.bases


def reduced_body(
    placed: PlacedBodies, constraints: Sequence[Constraint], name: str, like: ModalBasis | None = None
) -> BodyCoordinates:
    """Return an undamped body in its reduced flexible coordinates.

    Parameters
    ----------
    placed : PlacedBodies
        Mechanism with its given bases, and its bodies, each with all its coordinates, undamped.
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
    mechanism, body = placed.mechanism, placed.bodies[placed.index[name]]
    described = mechanism.body(name)
    assert not isinstance(described, RigidBody)
    if name in mechanism.bases:
        shapes = _vibrations(body, _given(body, np.array(mechanism.bases[name])))
    elif isinstance(described, FlexibleBeam) and described.reduction is ComponentModes.CRAIG_BAMPTON:
        rows = interface_rows(placed, constraints, name)
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
