"""Assumed modes: a straight bar whose deformation is a combination of user-defined shape functions (Ritz method).

The transverse displacement is sum t_k(x/L) u_k and the axial displacement sum a_k(x/L) u_k, with the transverse
coordinates first. The functions define the body frame: sines attach it to the chord, polynomials that start with x^2
to the tangent at the first end.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, pi
from typing import NamedTuple, cast

import numpy as np
import scipy

from paraflex.arrays import Array, Numbers
from paraflex.errors import InputError
from .integrals import ShapeIntegrals, SpanProperties, bar_integrals

# Additional Gauss points, so that products of sines are integrated to rounding.
_EXTRA_GAUSS_POINTS = 16
# Normalised functions with a singular value below this fraction of the largest are linearly dependent.
_DEPENDENT = 1e-10
# A combination of functions with less than this fraction of the largest strain, at equal mass, is a rigid motion.
_RIGID = 1e-7


@dataclass(frozen=True)
class Sine:
    """Sine shape function sin(n pi z), z = x/L, with n the number of half waves along the bar."""

    half_waves: int

    def evaluate(self, z: Array, derivative: int = 0) -> Array:
        """Evaluate the function, or one of its derivatives with respect to z, at z (k,)."""
        k = self.half_waves * pi
        wave = (np.sin, np.cos)[derivative % 2](k * z)
        return (-1) ** (derivative // 2) * k**derivative * wave


@dataclass(frozen=True)
class Polynomial:
    """Polynomial in z = x/L with coefficients in ascending order: (0, 0, 1) is z^2."""

    coefficients: tuple[float, ...]

    def evaluate(self, z: Array, derivative: int = 0) -> Array:
        """Evaluate the function, or one of its derivatives with respect to z, at z (k,)."""
        derived = np.polynomial.polynomial.polyder(np.array(self.coefficients) * 1.0, derivative)
        return cast(Array, np.polynomial.polynomial.polyval(z, derived))


ShapeFunction = Sine | Polynomial


class PlacedLump(NamedTuple):
    """Lumped mass [kg] and moment of inertia [kg m^2] at a position x along a bar [m]."""

    x: float
    mass: float
    inertia: float


@dataclass(frozen=True)
class AssumedShapes:
    """Transverse and axial shape functions of a bar of a given length [m]."""

    length: float
    transverse: tuple[ShapeFunction, ...]
    axial: tuple[ShapeFunction, ...] = ()

    @property
    def count(self) -> int:
        """Number of shape functions, which is the number of coordinates."""
        return len(self.transverse) + len(self.axial)

    def transverse_rows(self, x: Array, derivative: int = 0) -> Array:
        """Evaluate the transverse displacement per coordinate (k, transverse) at x (k,) [m], or its x-derivative."""
        return _columns(self.transverse, x / self.length, derivative) / self.length**derivative

    def axial_rows(self, x: Array, derivative: int = 0) -> Array:
        """Evaluate the axial displacement per coordinate (k, axial) at x (k,) [m], or its x-derivative."""
        return _columns(self.axial, x / self.length, derivative) / self.length**derivative

    def shape_at(self, x: float) -> tuple[Array, Array]:
        """Return the shape matrix N (2, count) and the slope row N2' (count,) of the point at x [m]."""
        place, n = np.array([x]) * 1.0, len(self.transverse)
        kind = np.result_type(place, self.length)
        N, slope = np.zeros((2, self.count), kind), np.zeros(self.count, kind)
        N[0, n:], N[1, :n] = self.axial_rows(place)[0], self.transverse_rows(place)[0]
        slope[:n] = self.transverse_rows(place, derivative=1)[0]
        return N, slope

    def quadrature(self) -> tuple[Array, Array]:
        """Return Gauss points and weights [m], exact for products of polynomials, to rounding for those of sines."""
        functions = (*self.transverse, *self.axial)
        degree = max((len(f.coefficients) for f in functions if isinstance(f, Polynomial)), default=1)
        waves = max((f.half_waves for f in functions if isinstance(f, Sine)), default=0)
        z, w = np.polynomial.legendre.leggauss(
            degree + 1 + (ceil(pi / 2 * waves) + _EXTRA_GAUSS_POINTS if waves else 0)
        )
        return 0.5 * self.length * (z + 1.0), 0.5 * self.length * w


def assumed_integrals(shapes: AssumedShapes, span: SpanProperties, lumps: Sequence[PlacedLump] = ()) -> ShapeIntegrals:
    """Compute the shape integrals of a bar of assumed modes with lumps.

    The flexible coordinates are combinations of the shape functions with a unit mass matrix, because powers of x are
    nearly dependent and their own mass matrix is ill-conditioned. D maps them to the functions' own coordinates.

    Parameters
    ----------
    shapes : AssumedShapes
        Shape functions of the bar.
    span : SpanProperties
        Mass and stiffness of the bar.
    lumps : sequence of PlacedLump
        Lumped masses and moments of inertia, by default none. A lumped mass enters like a point of the continuum.

    Returns
    -------
    ShapeIntegrals
        Constants of the bar in the mass-orthonormal coordinates.

    Raises
    ------
    InputError
        There are no functions, or they are linearly dependent or contain a rigid motion of the bar.
    """
    if not shapes.count:
        raise InputError("has no shape functions", field="transverse", remedy="give some, or make it a rigid body")
    x, w = shapes.quadrature()
    places = np.array([lump.x for lump in lumps])
    inertias = np.array([lump.inertia for lump in lumps])
    everywhere = np.concatenate([x, places])
    masses = np.concatenate([w * span.mass_per_length, [lump.mass for lump in lumps]])
    across, along = shapes.transverse_rows(everywhere), shapes.axial_rows(everywhere)
    turns = shapes.transverse_rows(places, derivative=1)
    # Square roots of stiffness and mass matrices.
    bending = np.sqrt(span.bending_stiffness * w)[:, None] * shapes.transverse_rows(x, derivative=2)
    stretch = np.sqrt(span.axial_stiffness * w)[:, None] * shapes.axial_rows(x, derivative=1)
    root = np.sqrt(masses)[:, None]
    bent = _basis(np.concatenate([root * across, np.sqrt(inertias)[:, None] * turns]), bending, "transverse")
    stretched = _basis(root * along, stretch, "axial")
    n = len(shapes.transverse)
    kind = np.result_type(bent, stretched, across, along)
    N, slopes = np.zeros((everywhere.size, 2, shapes.count), kind), np.zeros((places.size, shapes.count), kind)
    N[:, 0, n:], N[:, 1, :n], slopes[:, :n] = along @ stretched, across @ bent, turns @ bent
    roots = np.asarray(scipy.linalg.block_diag(bending @ bent, stretch @ stretched))
    D = np.asarray(scipy.linalg.block_diag(bent, stretched))
    return bar_integrals(everywhere, N, masses, slopes, inertias, roots.T @ roots, D)


def _columns(functions: Sequence[ShapeFunction], z: Array, derivative: int) -> Array:
    return np.array([f.evaluate(z, derivative) for f in functions]).reshape(len(functions), z.size).T


def _basis(moving: Array, strains: Array, field: str) -> Array:
    """Return the combinations (n, n) of n functions with unit mass matrix, from square roots of mass and stiffness."""
    sizes = np.linalg.norm(moving.real, axis=0)
    if not sizes.size:
        return np.zeros((0, 0))
    singular = np.linalg.svd(moving.real / np.where(sizes > 0.0, sizes, 1.0), compute_uv=False)
    if singular.size < sizes.size or singular[-1] <= _DEPENDENT * singular[0]:
        raise InputError(
            "its shape functions are linearly dependent, or nearly so",
            field=field,
            remedy="leave out linear combinations of others (powers of x nearly are from the 15th on)",
        )
    basis = np.linalg.inv(_triangle(moving / sizes)) / sizes[:, None]
    strained = np.linalg.svd((strains @ basis).real, compute_uv=False)
    if strained[-1] <= _RIGID * strained[0]:
        raise InputError(
            "its shape functions contain a rigid motion of the bar",
            field=field,
            remedy="leave out functions that move it as a whole: its body frame does that",
        )
    return basis


def _triangle(matrix: Numbers) -> Numbers:
    """Return the factor R of A = Q R, R^T R = A^T A; for a complex step A + i h dA, R + i h dR."""
    R = np.asarray(np.linalg.qr(np.real(matrix), mode="r"))
    if not np.iscomplexobj(matrix):
        return R
    change = np.linalg.solve(R.T, np.linalg.solve(R.T, np.imag(matrix.T @ matrix)).T)
    return R + 1j * (np.triu(change) - 0.5 * np.diag(np.diag(change))) @ R
