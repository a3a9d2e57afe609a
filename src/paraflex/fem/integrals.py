"""Inertia shape integrals and stiffness of a body: the constants of its equations of motion (Eqs. 13-28)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from paraflex.arrays import Array, Brief
from .mesh import BeamMesh
from .reference import ReferenceCondition, reference_basis

# N^T N is of degree 10 in x, exact with six Gauss points.
GAUSS_POINTS = 6
GAUSS_PLACES, GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(GAUSS_POINTS)
# The same as fractions of an element.
GAUSS_FRACTIONS: tuple[float, ...] = tuple((0.5 * (GAUSS_PLACES + 1.0)).tolist())


@dataclass(frozen=True)
class SpanProperties:
    """Mass and stiffness of a span of a beam.

    Attributes
    ----------
    mass_per_length : float
        Mass per length rho A [kg/m].
    axial_stiffness : float
        Axial stiffness E A [N].
    bending_stiffness : float
        Bending stiffness E I [N m^2].
    """

    mass_per_length: float
    axial_stiffness: float
    bending_stiffness: float


@dataclass(frozen=True)
class Lump:
    """Lumped mass [kg] and moment of inertia [kg m^2] at a node of a beam."""

    node: int
    mass: float
    inertia: float


@dataclass(frozen=True)
class ShapeIntegrals(Brief):
    """Inertia shape integrals and stiffness of a body in its body frame, with nf flexible coordinates u (rigid: 0).

    Attributes
    ----------
    m : float
        Mass [kg].
    S1 : (2,) array
        First moment of the undeformed body, int s0 dm [kg m].
    S2 : (2, nf) array
        First moment per flexible coordinate, int N dm.
    I0 : float
        Moment of inertia about the origin of the body frame, int s0.s0 dm [kg m^2].
    I1 : (nf,) array
        Inertia integral int s0^T N dm.
    I2 : (nf, nf) array
        Inertia integral int N^T N dm.
    G1 : (nf,) array
        Inertia integral int s0^T E^T N dm.
    G2 : (nf, nf) array
        Inertia integral int N^T E^T N dm, skew-symmetric.
    J : float
        Sum of the lumped moments of inertia [kg m^2].
    Jf : (nf,) array
        Sum over lumps, sum J N2'.
    Jff : (nf, nf) array
        Sum over lumps, sum J N2'^T N2'.
    K : (nf, nf) array
        Elastic stiffness.
    D : (own, nf) array
        Body's own coordinates (of a beam the nodal ones, Eq. 7) per flexible coordinate; no rows for a rigid body.
    """

    m: float
    S1: Array
    S2: Array
    I0: float
    I1: Array
    I2: Array
    G1: Array
    G2: Array
    J: float
    Jf: Array
    Jff: Array
    K: Array
    D: Array

    @property
    def nf(self) -> int:
        """Number of flexible coordinates."""
        return self.K.shape[0]

    @property
    def Mff(self) -> Array:
        """Constant mass matrix of the flexible coordinates, I2 + Jff."""
        return self.I2 + self.Jff

    @property
    def mass_matrix(self) -> Array:
        """Mass matrix of the undeformed body in its frame, for (r, phi, u): (3 + nf, 3 + nf)."""
        x, y = self.S1
        rigid = np.array([[self.m, 0.0, -y], [0.0, self.m, x], [-y, x, self.I0 + self.J]])
        coupling = np.vstack([self.S2, self.G1 + self.Jf])
        return np.block([[rigid, coupling], [coupling.T, self.Mff]])

    def in_basis(self, basis: Array) -> "ShapeIntegrals":
        """Transform the body to other flexible coordinates, u_old = basis @ u_new."""
        rows = {name: getattr(self, name) @ basis for name in ("S2", "I1", "G1", "Jf", "D")}
        matrices = {name: basis.T @ getattr(self, name) @ basis for name in ("I2", "G2", "Jff", "K")}
        return replace(self, **rows, **matrices)

    def without_flexibility(self) -> "ShapeIntegrals":
        """Return the same body as a rigid one, all flexible coordinates held at zero (Remark 3)."""
        return self.in_basis(np.zeros((self.nf, 0)))


def rigid_integrals(mass: float, centre: Sequence[float], inertia: float) -> ShapeIntegrals:
    """Return the shape integrals of a rigid body.

    Parameters
    ----------
    mass : float
        Mass [kg].
    centre : (x, y)
        Centre of mass in the body frame [m].
    inertia : float
        Moment of inertia about the centre of mass [kg m^2].
    """
    c = np.array(centre) * 1.0
    rows = dict.fromkeys(("I1", "G1", "Jf"), np.zeros(0))
    matrices = dict.fromkeys(("I2", "G2", "Jff", "K", "D"), np.zeros((0, 0)))
    I0 = inertia + mass * (c @ c).item()
    return ShapeIntegrals(m=mass, S1=mass * c, S2=np.zeros((2, 0)), I0=I0, J=0.0, **rows, **matrices)


def beam_integrals(
    mesh: BeamMesh,
    spans: Sequence[SpanProperties],
    lumps: Sequence[Lump] = (),
    condition: ReferenceCondition = ReferenceCondition.CANTILEVER,
) -> ShapeIntegrals:
    """Compute the shape integrals of a straight beam with lumps, by quadrature that is exact for the element.

    Parameters
    ----------
    mesh : BeamMesh
        Mesh of the beam.
    spans : sequence of SpanProperties
        Mass and stiffness of each span of the mesh.
    lumps : sequence of Lump
        Lumped masses and moments of inertia, by default none. A lumped mass enters like a point of the continuum.
    condition : ReferenceCondition
        Reference condition, which attaches the floating frame to the beam; by default the cantilever condition.

    Returns
    -------
    ShapeIntegrals
        Constants in the independent coordinates of the reference condition.
    """
    # Mechanisms have many equal links, and the rigid mechanism of a plan has those of the flexible one: cached.
    return _beam_integrals(
        tuple(mesh.nodes.tolist()), tuple(mesh.spans.tolist()), mesh.separate, tuple(spans), tuple(lumps), condition
    )


@lru_cache(maxsize=256)
def _beam_integrals(
    nodes: tuple[float, ...],
    spans_of: tuple[int, ...],
    separate: tuple[int, ...],
    spans: tuple[SpanProperties, ...],
    lumps: tuple[Lump, ...],
    condition: ReferenceCondition,
) -> ShapeIntegrals:
    mesh = BeamMesh(np.array(nodes), np.array(spans_of), {}, separate)
    x, N, masses, stiffness = _quadrature(mesh, spans)
    at = [lump.node for lump in lumps]
    x, masses = np.append(x, mesh.nodes[at]), np.append(masses, [lump.mass for lump in lumps])
    N = np.concatenate([N, *(mesh.shape_at_node(node)[0][None] for node in at)])
    slopes = np.eye(mesh.n_nodal)[[mesh.slope_column(node) for node in at]]
    inertias = np.array([lump.inertia for lump in lumps])
    nodal = bar_integrals(x, N, masses, slopes, inertias, stiffness, np.eye(mesh.n_nodal))
    return nodal.in_basis(reference_basis(mesh, condition, nodal.Mff, stiffness))


def bar_integrals(
    x: Array, N: Array, masses: Array, slopes: Array, inertias: Array, stiffness: Array, basis: Array
) -> ShapeIntegrals:
    """Compute the shape integrals of a straight bar as sums over its mass points.

    Parameters
    ----------
    x, N, masses : (k,), (k, 2, n) and (k,) arrays
        Position along the bar [m], displacement per coordinate and mass [kg] of each mass point.
    slopes, inertias : (j, n) and (j,) arrays
        Slope row and lumped moment of inertia [kg m^2] of each lump.
    stiffness : (n, n) array
        Elastic stiffness K.
    basis : (own, n) array
        Body's own coordinates per coordinate, D.
    """
    along, across, first = N[:, 0], N[:, 1], masses * x
    coupled = (masses * along.T) @ across
    # s0 = [x, 0] and E^T = [[0, 1], [-1, 0]].
    return ShapeIntegrals(
        m=masses.sum(), S1=np.array([first.sum(), 0.0]), S2=np.array([masses @ along, masses @ across]),
        I0=(first * x).sum(), I1=first @ along, I2=(masses * along.T) @ along + (masses * across.T) @ across,
        G1=first @ across, G2=coupled - coupled.T, J=inertias.sum(), Jf=inertias @ slopes,
        Jff=(inertias * slopes.T) @ slopes, K=stiffness, D=basis,
    )  # fmt: skip


def _quadrature(mesh: BeamMesh, spans: Sequence[SpanProperties]) -> tuple[Array, Array, Array, Array]:
    """Return position, shape matrix and mass of the mass points of a beam, and the nodal stiffness matrix (Eq. 28)."""
    lengths = np.diff(mesh.nodes)[:, None]
    weights = 0.5 * lengths * GAUSS_WEIGHTS
    of_elements = [spans[span] for span in mesh.spans]
    density, stretch, bend = (
        np.array([[getattr(span, name)] for span in of_elements])
        for name in ("mass_per_length", "axial_stiffness", "bending_stiffness")
    )
    strain, curvature = (
        rows.reshape(-1, mesh.n_nodal)
        for rows in (mesh.axial_at(GAUSS_FRACTIONS, 1), mesh.transverse_at(GAUSS_FRACTIONS, 2))
    )
    stiffness = (strain.T * (stretch * weights).ravel()) @ strain
    stiffness = stiffness + (curvature.T * (bend * weights).ravel()) @ curvature
    N = np.stack([mesh.axial_at(GAUSS_FRACTIONS), mesh.transverse_at(GAUSS_FRACTIONS)], axis=2)
    x = mesh.nodes[:-1, None] + lengths * np.array(GAUSS_FRACTIONS)
    return x.ravel(), N.reshape(-1, 2, mesh.n_nodal), (density * weights).ravel(), stiffness
