"""A body's coordinates and its material points: which slice of q is whose."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from paraflex.errors import InputError
from paraflex.fem import (
    BeamMesh,
    Lump,
    MassPoints,
    ModalBasis,
    ShapeIntegrals,
    SpanProperties,
    beam_integrals,
    mass_points,
    modal_basis,
    node_weights,
    rigid_integrals,
)
from paraflex.fem.element import SLOPE
from paraflex.mechanism import Body, Geometry, Mechanism, PointRef, RigidBody

GROUND_INDEX = -1


@dataclass(frozen=True)
class BodyCoordinates:
    """Where a body's coordinates stand and what they mean.

    Attributes
    ----------
    name : str
    offset : int
        Of r in q; phi follows at offset + 2, flexible coordinates from offset + 3.
    integrals : ShapeIntegrals
        In modal coordinates: u of the formulation is `modes.vectors @ q[flexible]`.
    modes : ModalBasis
    mesh : BeamMesh or None
        None for a rigid body.
    points : MassPoints or None
        In modal coordinates, of a flexible beam of second-order geometry.
    damping : (nf,) array
        Of the modes [1/s].
    """

    name: str
    offset: int
    integrals: ShapeIntegrals
    modes: ModalBasis
    mesh: BeamMesh | None
    points: MassPoints | None = None
    damping: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))

    @property
    def nf(self) -> int:
        """Number of flexible coordinates."""
        return self.integrals.nf

    @property
    def angle(self) -> int:
        """Index of phi in q."""
        return self.offset + 2

    @property
    def position(self) -> slice:
        """Of r in q."""
        return slice(self.offset, self.offset + 2)

    @property
    def flexible(self) -> slice:
        """Of the modal coordinates in q."""
        return slice(self.offset + 3, self.offset + 3 + self.nf)

    @property
    def all(self) -> slice:
        """Of every coordinate of the body in q."""
        return slice(self.offset, self.offset + 3 + self.nf)

    def slopes(self, q: NDArray[np.float64]) -> NDArray[np.float64]:
        """Slopes of the beam at its nodes [rad]; none for a rigid body."""
        if self.mesh is None:
            return np.zeros(0)
        return self.integrals.D[self.mesh.rows_of(SLOPE)] @ q[self.flexible]


@dataclass(frozen=True)
class Marker:
    """A material point: its place in the undeformed body and its shape rows in modal coordinates.

    Attributes
    ----------
    body : int
        Index of the body.
    x0 : (2,) array
        Body-frame position [m].
    N : (2, nf) array
        Displacement per modal coordinate.
    slope : (nf,) array
        Turn of the beam there per modal coordinate.
    bending : (nf, nf) array or None
        Of the quadratic form that moves the point by -1/2 of it along x; None where it is zero.
    """

    body: int
    x0: NDArray[np.float64]
    N: NDArray[np.float64]
    slope: NDArray[np.float64]
    bending: NDArray[np.float64] | None = None

    def place(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Place in the body frame (2,) for flexible coordinates u (nf,)."""
        s = self.x0 + self.N @ u
        if self.bending is not None:
            s[0] -= 0.5 * (u @ self.bending @ u)
        return s


def body_coordinates(body: Body, offset: int, geometry: Geometry) -> BodyCoordinates:
    """Coordinates of a body that start at an offset in q.

    Raises
    ------
    InputError
        A mass matrix that is not positive definite.
    """
    if isinstance(body, RigidBody):
        integrals = rigid_integrals(body.mass, body.centre_of_mass, body.inertia)
        return BodyCoordinates(body.name, offset, integrals, modal_basis(integrals), None)
    mesh = body.mesh
    span = SpanProperties(
        mass_per_length=body.material.density * body.section.area,
        axial_stiffness=body.material.youngs_modulus * body.section.area,
        bending_stiffness=body.material.youngs_modulus * body.section.second_moment,
    )
    spans = [span] * (int(mesh.spans[-1]) + 1)
    lumps = [Lump(mesh.points[lump.point], lump.mass, lump.inertia) for lump in body.lumps]
    try:
        integrals = beam_integrals(mesh, spans, lumps, body.reference)
        if not body.flexible:
            integrals = integrals.without_flexibility()
        modes = modal_basis(integrals)
    except np.linalg.LinAlgError as error:
        raise InputError(
            "its mass matrix is not positive definite",
            field=f"body.{body.name}",
            remedy="check section, material and lumped masses for values many orders of magnitude apart",
        ) from error
    if body.modes is not None:
        modes = modes.lowest(body.modes)
    integrals = integrals.in_basis(modes.vectors)
    points = None
    if geometry is Geometry.SECOND_ORDER and integrals.nf:
        points = mass_points(mesh, spans, lumps, integrals.D)
    damping = np.zeros(integrals.nf) if body.damping is None else body.damping.coefficients(modes.omega)
    return BodyCoordinates(body.name, offset, integrals, modes, mesh, points, damping)


def make_marker(
    mechanism: Mechanism, bodies: tuple[BodyCoordinates, ...], index: dict[str, int], ref: PointRef
) -> Marker:
    """The material point of that name; of the ground, a place without a body."""
    if ref.on_ground:
        return Marker(GROUND_INDEX, np.array(mechanism.ground[ref.point], dtype=float), np.zeros((2, 0)), np.zeros(0))
    i = index[ref.body]
    body = mechanism.bodies[i]
    if isinstance(body, RigidBody):
        return Marker(i, np.array(body.points[ref.point], dtype=float), np.zeros((2, 0)), np.zeros(0))
    mesh = bodies[i].mesh
    assert mesh is not None
    return node_marker(i, bodies[i], mesh.points[ref.point])


def node_marker(index: int, body: BodyCoordinates, node: int) -> Marker:
    """The material point at a node of a beam, counted from its first end."""
    mesh, points = body.mesh, body.points
    assert mesh is not None
    x = float(mesh.nodes[node])
    N, slope = mesh.shape_at(x)
    bending = points.bending(node_weights(mesh, node)) if points is not None and node > 0 else None
    return Marker(index, np.array([x, 0.0]), N @ body.integrals.D, slope @ body.integrals.D, bending)


def transverse_pieces(body: BodyCoordinates) -> NDArray[np.float64]:
    """Transverse displacement of a beam's centre line per modal coordinate: (elements, 6, nf).

    Coefficients of ascending powers of the distance from the element's first node.
    """
    mesh = body.mesh
    assert mesh is not None
    z = np.linspace(0.0, 1.0, 6)
    pieces = []
    for a, b in pairwise(mesh.nodes):
        # Six values settle a quintic; at a node the shape is the same from either side.
        rows = np.array([mesh.shape_at(a + x * (b - a))[0][1] for x in z])
        powers = np.linalg.solve(np.vander(z, increasing=True), rows)
        pieces.append(powers / ((b - a) ** np.arange(6))[:, None] @ body.integrals.D)
    return np.array(pieces)
