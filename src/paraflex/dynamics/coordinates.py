"""Coordinates and material points of a body: the only module that maps slices of q to bodies."""

from collections.abc import Hashable, MutableMapping
from dataclasses import dataclass, field, replace
from functools import cache, cached_property

import numpy as np

from paraflex.arrays import Array, Brief, Indices, Numbers
from paraflex.errors import InputError
from paraflex.fem import BeamMesh, MassPoints, ModalBasis, ShapeIntegrals, mass_points, modal_basis, node_weights
from paraflex.fem.eigen import is_definite
from paraflex.mechanism import Body, FlexibleBeam, Geometry, Mechanism, PointRef, RigidBody
from .shapes import BodyShape, PointShape, beam_lumps, body_shape

GROUND_INDEX = -1
# Eigenvalues of a body's mass matrix, scaled to a unit diagonal, below this are rounding.
_SINGULAR = 1e-14


@dataclass(frozen=True)
class BodyCoordinates(Brief):
    """Indices of a body's coordinates in q, and the data to interpret them.

    Attributes
    ----------
    name : str
        Name of the body.
    offset : int
        Index of r in q; phi follows at offset + 2, flexible coordinates from offset + 3.
    integrals : ShapeIntegrals
        Shape integrals in modal coordinates: u of the formulation is `modes.vectors @ q[flexible]`.
    modes : ModalBasis
        Modes of the body.
    shape : BodyShape
        Integrals and points in the body's own coordinates, which `integrals.D` gives from modal ones.
    points : MassPoints or None
        Mass points in modal coordinates, of a flexible beam with second-order geometry.
    damping : (nf, nf) array
        Damping matrix [1/s]: see `dynamics.damping`.
    """

    name: str
    offset: int
    integrals: ShapeIntegrals
    modes: ModalBasis
    shape: BodyShape
    points: MassPoints | None = None
    damping: Array = field(default_factory=lambda: np.zeros((0, 0)))

    @property
    def mesh(self) -> BeamMesh | None:
        """Mesh of a flexible beam; None for any other body."""
        return self.shape.mesh

    @property
    def mass_matrix(self) -> Numbers:
        """Mass matrix (3 + nf, 3 + nf) of the undeformed body in its frame; modes have unit mass."""
        mass = self.integrals.mass_matrix
        mass[3:, 3:] = np.eye(self.nf)
        return mass

    @property
    def stiffness(self) -> Numbers:
        """Elastic stiffness (3 + nf,) of each coordinate: omega^2 for modal ones, zero for rigid ones."""
        return np.concatenate([np.zeros(3), self.modes.omega**2])

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
        """Slice of r in q."""
        return slice(self.offset, self.offset + 2)

    @property
    def flexible(self) -> slice:
        """Slice of the modal coordinates in q."""
        return slice(self.offset + 3, self.offset + 3 + self.nf)

    @property
    def all(self) -> slice:
        """Slice of all coordinates of the body in q."""
        return slice(self.offset, self.offset + 3 + self.nf)

    def slopes(self, q: Array) -> Array:
        """Return the slopes along the body, those of a beam at its nodes [rad]; empty for a rigid body."""
        return self.shape.slopes @ (self.integrals.D @ q[self.flexible])


@dataclass(frozen=True)
class Marker:
    """A material point: its position in the undeformed body and its shape rows in modal coordinates.

    Attributes
    ----------
    body : int
        Index of the body.
    x0 : (2,) array
        Body-frame position [m].
    N : (2, nf) array
        Displacement per modal coordinate.
    slope : (nf,) array
        Rotation of the beam there per modal coordinate.
    bending : (nf, nf) array or None
        Matrix B of the shortening by bending, u^T B u / 2, which is subtracted from x; None where it is zero.
    """

    body: int
    x0: Array
    N: Array
    slope: Array
    bending: Array | None = None

    @property
    def on_frame(self) -> "Marker":
        """Marker at the same position, fixed to the body frame, without the deformation."""
        return replace(self, N=np.zeros_like(self.N), slope=np.zeros_like(self.slope), bending=None)

    def relative_to(self, other: "Marker") -> "Marker":
        """Return the marker whose `place` is relative to another point of the body, which bending does not shorten."""
        return replace(self, x0=self.x0 - other.x0, N=self.N - other.N, slope=self.slope - other.slope)

    def place(self, u: Array) -> Array:
        """Return the position in the body frame (..., 2), x0 + N u - (u^T B u / 2, 0), for coordinates u (..., nf)."""
        s = self.x0 + u @ self.N.T
        if self.bending is not None:
            s[..., 0] -= 0.5 * (u * (u @ self.bending)).sum(-1)
        return s


def body_coordinates(
    body: Body,
    geometry: Geometry,
    like: ModalBasis | None = None,
    others: MutableMapping[Hashable, BodyCoordinates] | None = None,
) -> BodyCoordinates:
    """Return the coordinates of a body with all its modes, undamped, with offset 0.

    Parameters
    ----------
    body : Body
        Body as described.
    geometry : Geometry
        Geometry of the mechanism, linear or of second order.
    like : ModalBasis, optional
        Modes of a slightly different body, which these modes follow in order and sign: see `ModalBasis.like`.
    others : mapping, optional
        Coordinates of bodies computed before, to which these are added: equal beams share integrals and modes.

    Raises
    ------
    InputError
        The mass matrix is not positive definite.
    """
    try:
        shape = body_shape(body)
        # Integrals of equal beams are one object.
        kind = id(shape.integrals), id(like), isinstance(body, RigidBody) or body.flexible
        if others is not None and kind in others:
            return replace(others[kind], name=body.name, shape=shape)
        integrals = shape.integrals
        if not isinstance(body, RigidBody) and not body.flexible:
            integrals = integrals.without_flexibility()
        modes = modal_basis(integrals)
        if like is not None:
            if like.vectors.shape[0] != len(modes.vectors):
                raise InputError(
                    f"its mesh has {len(modes.vectors)} flexible coordinates instead of {len(like.vectors)}",
                    field=f"body.{body.name}", remedy="change its length and the point at its end together",
                )  # fmt: skip
            modes = modes.like(like, integrals.Mff)
        integrals = integrals.in_basis(modes.vectors)
        # The inertia about the centre of mass may be rounding against that about the origin.
        if not is_definite(np.real(integrals.mass_matrix), _SINGULAR):
            raise np.linalg.LinAlgError("not positive definite")
    except np.linalg.LinAlgError as error:
        raise InputError(
            "its mass matrix is not positive definite, or only by rounding", field=f"body.{body.name}",
            remedy="check inertia, centre of mass, section, material and lumped masses for values many orders of "
            "magnitude apart",
        ) from error  # fmt: skip
    points = None
    if geometry is Geometry.SECOND_ORDER and integrals.nf and isinstance(body, FlexibleBeam):
        points = mass_points(body.mesh, body.spans, beam_lumps(body), integrals.D)
    found = BodyCoordinates(body.name, 0, integrals, modes, shape, points, np.zeros((integrals.nf, integrals.nf)))
    if others is not None:
        others[kind] = found
    return found


@dataclass(frozen=True)
class PlacedBodies(Brief):
    """A mechanism, and the coordinates of its bodies.

    Attributes
    ----------
    mechanism : Mechanism
        Mechanism in the frames of its parts, with actuators included.
    bodies : tuple of BodyCoordinates
        Coordinates of each body.
    """

    mechanism: Mechanism
    bodies: tuple[BodyCoordinates, ...]

    @cached_property
    def index(self) -> dict[str, int]:
        """Index of each body by name."""
        return {body.name: i for i, body in enumerate(self.bodies)}

    def marker(self, ref: PointRef) -> Marker:
        """Return the material point of a name; for the ground, a fixed position without a body."""
        if ref.on_ground:
            place = np.array(self.mechanism.ground[ref.point]) * 1.0
            return Marker(GROUND_INDEX, place, np.zeros((2, 0)), np.zeros(0))
        i = self.index[ref.body]
        body = self.bodies[i]
        if body.mesh is None:
            return _point_marker(i, body, body.shape.points[ref.point])
        return node_marker(i, body, body.mesh.points[ref.point])


def end_markers(index: int, body: BodyCoordinates) -> tuple[Marker, ...]:
    """Return the first and last end of a beam or bar, first and last point of a modal body; none for a rigid body."""
    if body.mesh is None:
        return tuple(_point_marker(index, body, point) for point in body.shape.ends)
    return node_marker(index, body, 0), node_marker(index, body, body.mesh.n_elements)


def _point_marker(index: int, body: BodyCoordinates, point: PointShape) -> Marker:
    return Marker(index, point.x0, point.N @ body.integrals.D, point.slope @ body.integrals.D)


def node_marker(index: int, body: BodyCoordinates, node: int) -> Marker:
    """Return the material point at a node of a beam; nodes count from its first end."""
    mesh, points = body.mesh, body.points
    assert mesh is not None
    x = mesh.nodes[node]
    N, slope = mesh.shape_at_node(node)
    bending = points.bending(node_weights(mesh, node)) if points is not None and node > 0 else None
    return Marker(index, np.array([x, 0.0]), N @ body.integrals.D, slope @ body.integrals.D, bending)


def transverse_pieces(body: BodyCoordinates) -> Array:
    """Return the transverse displacement of a beam's centre line per modal coordinate: (elements, 6, nf).

    Entries are coefficients of ascending powers of the distance from the element's first node.
    """
    mesh = body.mesh
    assert mesh is not None
    return mesh.transverse_powers() @ body.integrals.D


def element_at(nodes: Array, place: Array) -> Indices:
    """Return the index of the element at positions of any shape along a beam; the end elements beyond its ends."""
    return np.searchsorted(np.real(nodes[1:-1]), np.real(place), side="right")


def transverse_rows(nodes: Array, pieces: Array, place: Array, derivative: int) -> Array:
    """Return the transverse displacement per modal coordinate, or a derivative: (..., nf) at positions (...)."""
    element = element_at(nodes, place)
    return piece_rows(pieces, element, place - nodes[element], derivative)


def piece_rows(pieces: Array, element: Indices, z: Array, derivative: int = 0) -> Array:
    """Evaluate polynomials of elements (see `transverse_pieces`) or a derivative at distances z from first nodes."""
    coefficients = _derivative(pieces.shape[1], derivative)
    powers = [sum(c * z**p for p, c in enumerate(column) if c) + 0.0 * z for column in coefficients.T]
    return np.einsum("...p,...pj->...j", np.stack(powers, axis=-1), pieces[element])


@cache
def _derivative(terms: int, order: int) -> Array:
    """Return the matrix of the derivative of polynomials with so many terms, of ascending powers."""
    return np.array(np.polynomial.polynomial.polyder(np.eye(terms), order), dtype=float)
