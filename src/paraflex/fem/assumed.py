"""Assumed modes: a straight bar that deforms in shape functions of the user's own choice (Ritz).

Transverse displacement w = sum t_k(x/L) u_k, axial displacement sum a_k(x/L) u_k, the transverse coordinates first. The
functions fix the body frame: sines hold it to the chord, polynomials from x^2 on to the tangent at the first end.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, pi
from typing import NamedTuple, cast

import numpy as np
import scipy

from paraflex.arrays import Array, Numbers
from paraflex.errors import InputError
from paraflex.fem.integrals import ShapeIntegrals, SpanProperties, bar_integrals

# Gauss points beyond those that resolve its waves with which a product of sines is integrated to rounding.
_MARGIN = 16
# Functions whose smallest singular value is this fraction of the largest, each scaled to one, are made up of others.
_DEPENDENT = 1e-10
# A combination of functions this much less strained than the most strained one, at equal mass, moves rigidly.
_RIGID = 1e-7


@dataclass(frozen=True)
class Sine:
    """A sine with a number of half waves along the bar, sin(n pi z) with z = x/L."""

    half_waves: int

    def evaluate(self, z: Array, derivative: int = 0) -> Array:
        """Values at z (k,), or values of a derivative by z."""
        k = self.half_waves * pi
        wave = (np.sin, np.cos)[derivative % 2](k * z)
        return (-1) ** (derivative // 2) * k**derivative * wave


@dataclass(frozen=True)
class Polynomial:
    """A polynomial in z = x/L by its coefficients, ascending: (0, 0, 1) is z^2."""

    coefficients: tuple[float, ...]

    def evaluate(self, z: Array, derivative: int = 0) -> Array:
        """Values at z (k,), or values of a derivative by z."""
        derived = np.polynomial.polynomial.polyder(np.array(self.coefficients) * 1.0, derivative)
        return cast(Array, np.polynomial.polynomial.polyval(z, derived))


ShapeFunction = Sine | Polynomial


class PlacedLump(NamedTuple):
    """A lumped mass [kg] and moment of inertia [kg m^2] at a place along a bar [m]."""

    x: float
    mass: float
    inertia: float


@dataclass(frozen=True)
class AssumedShapes:
    """Shape functions of a bar of a given length [m]."""

    length: float
    transverse: tuple[ShapeFunction, ...]
    axial: tuple[ShapeFunction, ...] = ()

    @property
    def count(self) -> int:
        """Number of functions, and of coordinates."""
        return len(self.transverse) + len(self.axial)

    def transverse_rows(self, x: Array, derivative: int = 0) -> Array:
        """Transverse displacement (k, transverse) per coordinate at x (k,), or a derivative by x."""
        return _columns(self.transverse, x / self.length, derivative) / self.length**derivative

    def axial_rows(self, x: Array, derivative: int = 0) -> Array:
        """Axial displacement (k, axial) per coordinate at x (k,), or a derivative by x."""
        return _columns(self.axial, x / self.length, derivative) / self.length**derivative

    def shape_at(self, x: float) -> tuple[Array, Array]:
        """Shape matrix N (2, count) and slope row N2' (count,) of the point at x [m]."""
        place, n = np.array([x]) * 1.0, len(self.transverse)
        kind = np.result_type(place, self.length)
        N, slope = np.zeros((2, self.count), kind), np.zeros(self.count, kind)
        N[0, n:], N[1, :n] = self.axial_rows(place)[0], self.transverse_rows(place)[0]
        slope[:n] = self.transverse_rows(place, derivative=1)[0]
        return N, slope

    def quadrature(self) -> tuple[Array, Array]:
        """Gauss points [m] and weights [m]: exact for products of polynomials, to rounding for those of sines."""
        functions = (*self.transverse, *self.axial)
        degree = max((len(f.coefficients) for f in functions if isinstance(f, Polynomial)), default=1)
        waves = max((f.half_waves for f in functions if isinstance(f, Sine)), default=0)
        z, w = np.polynomial.legendre.leggauss(degree + 1 + (ceil(pi / 2 * waves) + _MARGIN if waves else 0))
        return 0.5 * self.length * (z + 1.0), 0.5 * self.length * w


def assumed_integrals(shapes: AssumedShapes, span: SpanProperties, lumps: Sequence[PlacedLump] = ()) -> ShapeIntegrals:
    """Integrals of a bar of assumed modes with lumps.

    Its flexible coordinates are combinations of the functions of unit modal mass: powers of x are so nearly dependent
    that their mass matrix is of little use. D leads back to the functions' own coordinates.

    Parameters
    ----------
    shapes : AssumedShapes
    span : SpanProperties
    lumps : sequence of PlacedLump
        A lumped mass enters exactly as a point of the continuum does.

    Returns
    -------
    ShapeIntegrals

    Raises
    ------
    InputError
        No functions, or functions that are linearly dependent or contain a rigid motion of the bar.
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
    return bar_integrals(
        zip(everywhere.tolist(), N, masses.tolist(), strict=True),
        zip(slopes, inertias.tolist(), strict=True),
        roots.T @ roots,
        np.asarray(scipy.linalg.block_diag(bent, stretched)),
    )


def _columns(functions: Sequence[ShapeFunction], z: Array, derivative: int) -> Array:
    return np.array([f.evaluate(z, derivative) for f in functions]).reshape(len(functions), z.size).T


def _basis(moving: Array, strains: Array, field: str) -> Array:
    """Combinations (n, n) of n functions with unit mass matrix, from square roots of mass and stiffness matrices."""
    sizes = np.linalg.norm(moving.real, axis=0)
    if not sizes.size:
        return np.zeros((0, 0))
    singular = np.linalg.svd(moving.real / np.where(sizes > 0.0, sizes, 1.0), compute_uv=False)
    if singular.size < sizes.size or singular[-1] <= _DEPENDENT * singular[0]:
        raise InputError(
            "its shape functions are linearly dependent, or nearly so",
            field=field,
            remedy="leave out those that others make up (powers of x nearly do from the 15th on)",
        )
    basis = np.linalg.inv(_triangle(moving / sizes)) / sizes[:, None]
    strained = np.linalg.svd((strains @ basis).real, compute_uv=False)
    if strained[-1] <= _RIGID * strained[0]:
        raise InputError(
            "its shape functions contain a rigid motion of the bar",
            field=field,
            remedy="leave out what moves it as a whole: its body frame does that",
        )
    return basis


def _triangle(matrix: Numbers) -> Numbers:
    """R of a matrix Q R, of a complex step with its derivative: R^T R = A^T A."""
    R = np.asarray(np.linalg.qr(np.real(matrix), mode="r"))
    if not np.iscomplexobj(matrix):
        return R
    change = np.linalg.solve(R.T, np.linalg.solve(R.T, np.imag(matrix.T @ matrix)).T)
    return R + 1j * (np.triu(change) - 0.5 * np.diag(np.diag(change))) @ R
