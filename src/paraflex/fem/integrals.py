"""Inertia shape integrals and stiffness of a body, the constants of its equations of motion (Eqs. 13-28)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from paraflex.arrays import Array
from paraflex.fem.element import axial_shape, transverse_shape
from paraflex.fem.mesh import BeamMesh
from paraflex.fem.reference import ReferenceCondition, reference_basis

# N^T N is of degree 10 in x, exact with six Gauss points.
GAUSS_POINTS = 6
_GAUSS = np.polynomial.legendre.leggauss(GAUSS_POINTS)


@dataclass(frozen=True)
class SpanProperties:
    """Section and material of a span of a beam.

    Attributes
    ----------
    mass_per_length : float
        rho A [kg/m].
    axial_stiffness : float
        E A [N].
    bending_stiffness : float
        E I [N m^2].
    """

    mass_per_length: float
    axial_stiffness: float
    bending_stiffness: float


@dataclass(frozen=True)
class Lump:
    """A lumped mass [kg] and moment of inertia [kg m^2] at a node of a beam."""

    node: int
    mass: float
    inertia: float


@dataclass(frozen=True)
class ShapeIntegrals:
    """Constants of a body in its body frame; nf flexible coordinates u, none for a rigid body.

    Attributes
    ----------
    m : float
        Mass [kg].
    S1 : (2,) array
        int s0 dm, first moment of the undeformed body [kg m].
    S2 : (2, nf) array
        int N dm.
    I0 : float
        int s0.s0 dm about the body frame's origin [kg m^2].
    I1 : (nf,) array
        int s0^T N dm.
    I2 : (nf, nf) array
        int N^T N dm.
    G1 : (nf,) array
        int s0^T E^T N dm.
    G2 : (nf, nf) array
        int N^T E^T N dm, skew.
    J : float
        Sum of the lumped moments of inertia [kg m^2].
    Jf : (nf,) array
        sum J N2'.
    Jff : (nf, nf) array
        sum J N2'^T N2'.
    K : (nf, nf) array
        Elastic stiffness.
    D : (own, nf) array
        The body's own coordinates, a beam's nodal ones (Eq. 7), per flexible coordinate; no rows for a rigid body.
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
        """Mass matrix of the flexible coordinates, I2 + Jff, constant."""
        return self.I2 + self.Jff

    def in_basis(self, basis: Array) -> ShapeIntegrals:
        """The same body in other flexible coordinates, u_old = basis @ u_new."""
        return replace(
            self,
            S2=self.S2 @ basis,
            I1=self.I1 @ basis,
            I2=basis.T @ self.I2 @ basis,
            G1=self.G1 @ basis,
            G2=basis.T @ self.G2 @ basis,
            Jf=self.Jf @ basis,
            Jff=basis.T @ self.Jff @ basis,
            K=basis.T @ self.K @ basis,
            D=self.D @ basis,
        )

    def without_flexibility(self) -> ShapeIntegrals:
        """The same body, rigid: all flexible coordinates held at zero (Remark 3)."""
        return self.in_basis(np.zeros((self.nf, 0)))


def rigid_integrals(mass: float, centre: Sequence[float], inertia: float) -> ShapeIntegrals:
    """Integrals of a rigid body.

    Parameters
    ----------
    mass : float
        [kg]
    centre : (x, y)
        Centre of mass in the body frame [m].
    inertia : float
        About the centre of mass [kg m^2].
    """
    c = np.array(centre) * 1.0
    none, nothing = np.zeros(0), np.zeros((0, 0))
    return ShapeIntegrals(
        m=mass,
        S1=mass * c,
        S2=np.zeros((2, 0)),
        I0=inertia + mass * (c @ c).item(),
        I1=none,
        I2=nothing,
        G1=none,
        G2=nothing,
        J=0.0,
        Jf=none,
        Jff=nothing,
        K=nothing,
        D=nothing,
    )


def beam_integrals(
    mesh: BeamMesh,
    spans: Sequence[SpanProperties],
    lumps: Sequence[Lump] = (),
    condition: ReferenceCondition = ReferenceCondition.CANTILEVER,
) -> ShapeIntegrals:
    """Integrals of a straight beam with lumps, by quadrature that is exact for the element.

    Parameters
    ----------
    mesh : BeamMesh
    spans : sequence of SpanProperties
        One a span of the mesh.
    lumps : sequence of Lump
        A lumped mass enters exactly as a point of the continuum does.
    condition : ReferenceCondition
        How the floating frame is fixed to the beam.

    Returns
    -------
    ShapeIntegrals
        In the independent coordinates of the reference condition.
    """
    # Mechanisms have many links alike, and the rigid mechanism of a plan has those of the flexible one.
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
    points, stiffness = _quadrature(mesh, spans)
    points += [(mesh.nodes[lump.node], mesh.shape_at_node(lump.node)[0], lump.mass) for lump in lumps]
    turning = [(np.eye(mesh.n_nodal)[mesh.slope_column(lump.node)], lump.inertia) for lump in lumps]
    nodal = bar_integrals(points, turning, stiffness, np.eye(mesh.n_nodal))
    return nodal.in_basis(reference_basis(mesh, condition, nodal.Mff, stiffness))


def bar_integrals(
    points: Iterable[tuple[float, Array, float]],
    turning: Iterable[tuple[Array, float]],
    stiffness: Array,
    basis: Array,
) -> ShapeIntegrals:
    """Integrals of a straight bar as sums over its mass points.

    Parameters
    ----------
    points : iterable of (x, N, dm)
        Place along the bar [m], displacement (2, n) per coordinate, mass [kg].
    turning : iterable of (slope, J)
        Slope row (n,) at each lumped moment of inertia [kg m^2].
    stiffness : (n, n) array
    basis : (own, n) array
        The body's own coordinates per coordinate: D.
    """
    n, points, turning = stiffness.shape[0], list(points), list(turning)
    masses, inertias = np.array([(x, dm) for x, _, dm in points]), np.array([J for _, J in turning])
    kind = np.result_type(stiffness, masses, inertias, basis)
    m, I0, S1 = 0.0, 0.0, np.zeros(2, kind)
    S2, I1, I2 = np.zeros((2, n), kind), np.zeros(n, kind), np.zeros((n, n), kind)
    G1, G2 = np.zeros(n, kind), np.zeros((n, n), kind)
    for x, N, dm in points:
        m += dm
        S1[0] += dm * x
        S2 += dm * N
        I0 += dm * x * x
        # s0 = [x, 0] and E^T = [[0, 1], [-1, 0]].
        I1 += dm * x * N[0]
        I2 += dm * (N.T @ N)
        G1 += dm * x * N[1]
        across = np.outer(N[0], N[1])
        G2 += dm * (across - across.T)

    J, Jf, Jff = 0.0, np.zeros(n, kind), np.zeros((n, n), kind)
    for slope, inertia in turning:
        J += inertia
        Jf += inertia * slope
        Jff += inertia * np.outer(slope, slope)
    return ShapeIntegrals(
        m=m, S1=S1, S2=S2, I0=I0, I1=I1, I2=I2, G1=G1, G2=G2, J=J, Jf=Jf, Jff=Jff, K=stiffness, D=basis
    )


def _quadrature(mesh: BeamMesh, spans: Sequence[SpanProperties]):
    """Mass points (x, N, dm) along the beam and the nodal stiffness matrix (Eq. 28)."""
    z, w = _GAUSS
    points = []
    kind = np.result_type(mesh.nodes, *(np.array([span.axial_stiffness, span.bending_stiffness]) for span in spans))
    stiffness = np.zeros((mesh.n_nodal, mesh.n_nodal), kind)
    for e in range(mesh.n_elements):
        span = spans[mesh.spans[e]]
        length = mesh.nodes[e + 1] - mesh.nodes[e]
        x, weight = 0.5 * length * (z + 1.0), 0.5 * length * w
        axial = mesh.scatter(e, axial_shape(x, length))
        transverse = mesh.scatter(e, transverse_shape(x, length))
        strain = mesh.scatter(e, axial_shape(x, length, derivative=1))
        curvature = mesh.scatter(e, transverse_shape(x, length, derivative=2))
        stiffness += span.axial_stiffness * (strain.T * weight) @ strain
        stiffness += span.bending_stiffness * (curvature.T * weight) @ curvature
        for k in range(x.size):
            N = np.vstack([axial[k], transverse[k]])
            points.append((mesh.nodes[e] + x[k], N, weight[k] * span.mass_per_length))
    return points, stiffness
