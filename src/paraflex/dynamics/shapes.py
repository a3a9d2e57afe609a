"""Shape integrals and material points of a body of any kind, in its own coordinates."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from paraflex.arrays import Array, Brief
from paraflex.fem import BeamMesh, Lump, ShapeIntegrals, beam_integrals, rigid_integrals
from paraflex.mechanism import AssumedModesBeam, Body, FlexibleBeam, ModalBody, RigidBody


class PointShape(NamedTuple):
    """A material point: undeformed position (2,), shape rows (2, own), slope row (own,) in own coordinates."""

    x0: Array
    N: Array
    slope: Array


@dataclass(frozen=True)
class BodyShape(Brief):
    """A body in its own coordinates, which the matrix D of its integrals defines.

    Attributes
    ----------
    integrals : ShapeIntegrals
        Shape integrals of the body.
    mesh : BeamMesh or None
        Mesh of a flexible beam, whose named points are nodes.
    points : mapping of str to PointShape
        Named points of any other body.
    ends : tuple of PointShape
        First and last end of a body that has ends but no mesh, else empty.
    slopes : (k, own) array
        Slope rows at positions along the body that show how far it bends.
    line : tuple of PointShape
        Positions along the centre line of a bar of assumed modes, else empty.
    """

    integrals: ShapeIntegrals
    mesh: BeamMesh | None = None
    points: Mapping[str, PointShape] = field(default_factory=dict)
    ends: tuple[PointShape, ...] = ()
    slopes: Array = field(default_factory=lambda: np.zeros((0, 0)))
    line: tuple[PointShape, ...] = ()


def body_shape(body: Body) -> BodyShape:
    """Return the integrals and points of a body.

    Raises
    ------
    numpy.linalg.LinAlgError
        The mass matrix is not positive definite.
    """
    if isinstance(body, RigidBody):
        points = {
            name: PointShape(np.array(place) * 1.0, np.zeros((2, 0)), np.zeros(0))
            for name, place in body.points.items()
        }
        return BodyShape(rigid_integrals(body.mass, body.centre_of_mass, body.inertia), points=points)
    if isinstance(body, AssumedModesBeam):
        return _assumed(body)
    if isinstance(body, ModalBody):
        points = {name: PointShape(*body.point(name)) for name in body.points}
        listed = tuple(points.values())
        slopes = np.array([point.slope for point in listed]).reshape(-1, body.n_flexible)
        ends = (listed[0], listed[-1]) if listed and np.any(listed[0].x0 != listed[-1].x0) else ()
        return BodyShape(body.integrals, points=points, ends=ends, slopes=slopes)
    mesh = body.mesh
    slopes = np.eye(mesh.n_nodal)[[mesh.slope_column(node) for node in range(mesh.nodes.size)]]
    return BodyShape(beam_integrals(mesh, body.spans, beam_lumps(body), body.reference), mesh, slopes=slopes)


def beam_lumps(beam: FlexibleBeam) -> list[Lump]:
    """Return the lumps of a beam at its nodes."""
    points = beam.mesh.points
    return [Lump(points[lump.point], lump.mass, lump.inertia) for lump in beam.lumps]


def _assumed(bar: AssumedModesBeam) -> BodyShape:
    shapes = bar.shapes

    def at(x: float) -> PointShape:
        return PointShape(np.array([x, 0.0]), *shapes.shape_at(x))

    ends = at(0.0), at(bar.length)
    inner = [at(x) for x in shapes.quadrature()[0].tolist()]
    points = {name: at(x) for name, x in bar.points.items()}
    line = (ends[0], *inner, ends[1])
    slopes = np.array([point.slope for point in line])
    return BodyShape(bar.integrals, points=points, ends=ends, slopes=slopes, line=line)
