"""Second-order geometry of a beam: foreshortening, by which bending moves its points towards its first end.

The axial coordinates describe the stretch of the centre line, so the position of a point in the body frame is
s(x) = x0 + N u - 1/2 e_x f(x) with f(x) = int_0^x (N2' u)^2 dx. The beam is a set of mass points: the Gauss points
along it, at which the slopes are evaluated as well, then the lumps.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from paraflex.arrays import Array, Brief, Indices
from .integrals import GAUSS_FRACTIONS, GAUSS_PLACES, GAUSS_POINTS, GAUSS_WEIGHTS, Lump, SpanProperties
from .mesh import BeamMesh


@dataclass(frozen=True)
class MassPoints(Brief):
    """Representation of a beam by k mass points, the first g of which are its Gauss points.

    Attributes
    ----------
    x : (k,) array
        Positions along the undeformed beam [m].
    mass, inertia : (k,) arrays
        Masses [kg] and moments of inertia [kg m^2]; those of Gauss points are zero.
    N : (k, 2, nf) array
        Displacement per flexible coordinate.
    slope : (k, nf) array
        Slope rows N2'.
    weights : (k, g) array
        Quadrature weights: f at the points is weights @ (slope[:g] @ u)^2.
    element : (k,) array of int
        Element of each point: f at it consists of all elements before this one, and a part of this one.
    mixed : bool
        Whether coordinates may move points along the beam and across it; modes do either.
    """

    x: Array
    mass: Array
    inertia: Array
    N: Array
    slope: Array
    weights: Array
    element: Indices
    mixed: bool = False

    def in_basis(self, basis: Array) -> "MassPoints":
        """Transform the points to other flexible coordinates, u_old = basis @ u_new."""
        return replace(self, N=self.N @ basis, slope=self.slope @ basis, mixed=True)

    def bending(self, weights: Array) -> Array:
        """Return the matrix (nf, nf) of the quadratic form f at a point with the given weights (g,)."""
        slopes = self.slope[: weights.size]
        return slopes.T @ (weights[:, None] * slopes)


def mass_points(mesh: BeamMesh, spans: Sequence[SpanProperties], lumps: Sequence[Lump], basis: Array) -> MassPoints:
    """Return the mass points of a beam, by the same quadrature as its shape integrals.

    Parameters
    ----------
    mesh, spans, lumps
        Mesh, span properties and lumps of the beam: see `beam_integrals`.
    basis : (n_nodal, nf) array
        Nodal coordinates per flexible coordinate.
    """
    n, g, lengths, at = mesh.n_elements, GAUSS_POINTS, np.diff(mesh.nodes), [lump.node for lump in lumps]
    weights = np.zeros((n * g + len(at), n * g), dtype=lengths.dtype)
    for e, length in enumerate(lengths):
        own = slice(e * g, (e + 1) * g)
        weights[own, : e * g] = node_weights(mesh, e)[: e * g]
        weights[own, own] = 0.5 * length * _CUMULATIVE
    for k, node in enumerate(at):
        weights[n * g + k] = node_weights(mesh, node)
    density = np.array([[spans[span].mass_per_length] for span in mesh.spans])
    N = np.stack([mesh.axial_at(GAUSS_FRACTIONS), mesh.transverse_at(GAUSS_FRACTIONS)], axis=2)
    slopes = mesh.transverse_at(GAUSS_FRACTIONS, 1).reshape(n * g, -1)
    x = mesh.nodes[:-1, None] + lengths[:, None] * np.array(GAUSS_FRACTIONS)
    shapes = [mesh.shape_at_node(node) for node in at]
    return MassPoints(
        x=np.append(x, mesh.nodes[at]),
        mass=np.append(0.5 * lengths[:, None] * GAUSS_WEIGHTS * density, [lump.mass for lump in lumps]),
        inertia=np.append(np.zeros(n * g), [lump.inertia for lump in lumps]),
        N=np.concatenate([N.reshape(n * g, 2, -1), *(shape[None] for shape, _ in shapes)]) @ basis,
        slope=np.concatenate([slopes, *(slope[None] for _, slope in shapes)]) @ basis,
        weights=weights,
        element=np.append(np.repeat(np.arange(n), g), np.minimum(at, n - 1)).astype(int),
    )


def slope_square_integrals(mesh: BeamMesh, basis: Array, x: Array) -> Callable[[Array], Array]:
    """Return f(x) = int_0^x (N2' u)^2 dx [m], exact, as a function of coordinates (k, nf) with values (k, places).

    Parameters
    ----------
    mesh : BeamMesh
        Mesh of the beam.
    basis : (n_nodal, nf) array
        Nodal coordinates per flexible coordinate.
    x : (places,) array
        Positions along the beam, from 0 to its length [m].
    """
    # Slopes are polynomials within an element, so the intervals end at nodes.
    knots = np.union1d(mesh.nodes, x)
    halves = 0.5 * np.diff(knots)
    places = knots[:-1, None] + halves[:, None] * (GAUSS_PLACES + 1.0)
    slopes, ends = mesh.shapes_at(places.ravel())[1] @ basis, np.searchsorted(knots, x)

    def integrals(u: Array) -> Array:
        squares = (u @ slopes.T) ** 2
        pieces = (squares.reshape(len(u), halves.size, GAUSS_POINTS) @ GAUSS_WEIGHTS) * halves
        return np.concatenate([np.zeros((len(u), 1)), np.cumsum(pieces, axis=1)], axis=1)[:, ends]

    return integrals


def node_weights(mesh: BeamMesh, node: int) -> Array:
    """Return the weights (g,) of the Gauss points in f at a node: those of all elements before it, exact."""
    weights = np.zeros((mesh.n_elements, GAUSS_POINTS), dtype=mesh.nodes.dtype)
    weights[:node] = 0.5 * np.diff(mesh.nodes)[:node, None] * GAUSS_WEIGHTS
    return weights.ravel()


def _cumulative(z: Array) -> Array:
    """Return the integrals (g, g) from -1 to z_i of the Lagrange polynomials on the nodes z."""
    # Columns of the inverse Vandermonde matrix are the polynomials' coefficients in Legendre form.
    legendre = np.polynomial.legendre
    coefficients = np.linalg.inv(legendre.legvander(z, z.size - 1))
    integrals = legendre.legint(coefficients, lbnd=-1, axis=0)
    return np.asarray(legendre.legval(z, integrals).T, dtype=float)


_CUMULATIVE = _cumulative(GAUSS_PLACES)
