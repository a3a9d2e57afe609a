"""GMRES with the exact derivative, preconditioned as in a run, for stages whose corrections do not converge.

The iteration matrix of a run leaves out terms in velocities and, in linear geometry, those of axial forces. If these
outweigh the terms that are kept, as at an instability that grows within a step, corrections with that matrix grow. The
minimal residual method needs only products with the exact matrix, and converges as long as that is regular (Saad and
Schultz, 1986).
"""

from math import hypot, sqrt
from typing import Annotated, NamedTuple

from .arrays import Floats, allocated, fill
from .compiling import by_reference, inlined, kernel, routine
from .linear import solve_residuals
from .tangent import residual_tangent

# Largest number of basis vectors, and relative residual to which a system is solved.
MOST_VECTORS, ENOUGH = 60, 1e-12


@by_reference
class Krylov(NamedTuple):
    """Arrays for a basis, the least-squares problem in it, and the start of a stage."""

    basis: Annotated[Floats, "columns", "unknowns"]  # orthonormal, multipliers scaled
    hessenberg: Annotated[Floats, "vectors", "columns"]  # columns as rows, made triangular by rotations
    cosines: Annotated[Floats, "vectors"]  # cosines of the rotations
    sines: Annotated[Floats, "vectors"]
    rest: Annotated[Floats, "columns"]  # right-hand side, rotated; then the solution in the basis
    guess_a: Annotated[Floats, "n"]
    guess_lam: Annotated[Floats, "m"]


def make_krylov(n: int, m: int) -> Krylov:
    """Allocate arrays for systems of n accelerations and m multipliers."""
    most = min(MOST_VECTORS, n + m)
    return allocated(Krylov, {"vectors": most, "columns": most + 1, "unknowns": n + m, "n": n, "m": m})


@inlined
def inner(x, y):
    """Return the scalar product of two vectors."""
    total = 0.0
    for j in range(x.size):
        total += x[j] * y[j]
    return total


@routine
def matrix_times(system, g, b, weights, scale, q, v, a, lam, torques, unit, x, direction, work, out):
    """Multiply x by the preconditioned exact matrix of a stage, into out; multipliers in units of `unit`."""
    n = a.size
    for j in range(n):
        direction.q[j], direction.v[j], direction.a[j] = b * x[j], g * x[j], x[j]
    for r in range(lam.size):
        direction.lam[r] = unit * x[n + r]
    residual_tangent(system, weights, q, v, a, lam, torques, work.compliance, 0, system.bodies.size, direction)
    for j in range(n):
        work.f[j] = direction.f[j]
    for r in range(lam.size):
        work.rows[r] = direction.rows[r]
    solve_residuals(system, work, scale)
    # Solutions in a run are corrections, with the sign of minus the residual.
    for j in range(n):
        out[j] = -work.x[j]
    for r in range(lam.size):
        out[n + r] = -work.mu[r] / unit


@inlined
def rotate(space, k):
    """Make column k of the least-squares problem triangular; return the remaining right-hand side."""
    column = space.hessenberg[k]
    for i in range(k):
        c, s = space.cosines[i], space.sines[i]
        column[i], column[i + 1] = c * column[i] + s * column[i + 1], c * column[i + 1] - s * column[i]
    length = hypot(column[k], column[k + 1])
    c, s = (column[k] / length, column[k + 1] / length) if length > 0.0 else (1.0, 0.0)
    space.cosines[k], space.sines[k] = c, s
    column[k], column[k + 1] = length, 0.0
    space.rest[k], space.rest[k + 1] = c * space.rest[k], -s * space.rest[k]
    return abs(space.rest[k + 1])


@inlined
def orthogonalise(space, k):
    """Make vector k + 1 orthogonal to those before it, twice, and of unit length; return False if it is zero."""
    new, column = space.basis[k + 1], space.hessenberg[k]
    fill(column, 0.0)
    for _ in range(2):
        for i in range(k + 1):
            part = inner(new, space.basis[i])
            column[i] += part
            for j in range(new.size):
                new[j] -= part * space.basis[i, j]
    length = sqrt(inner(new, new))
    column[k + 1] = length
    if length > 0.0:
        for j in range(new.size):
            new[j] /= length
    return length > 0.0


@inlined
def combine(space, count, unit, work):
    """Compute the solution into work.x and work.mu: back substitution, and the sum of the basis vectors."""
    for i in range(count - 1, -1, -1):
        for k in range(i + 1, count):
            space.rest[i] -= space.hessenberg[k, i] * space.rest[k]
        space.rest[i] = space.rest[i] / space.hessenberg[i, i] if space.hessenberg[i, i] != 0.0 else 0.0
    fill(work.x, 0.0)
    fill(work.mu, 0.0)
    for k in range(count):
        for j in range(work.x.size):
            work.x[j] += space.rest[k] * space.basis[k, j]
        for r in range(work.mu.size):
            work.mu[r] += unit * space.rest[k] * space.basis[k, work.x.size + r]


@kernel
def exact_correction(system, g, b, weights, q, v, a, lam, torques, unit, direction, space, work):
    """Convert the correction of a run in work.x and work.mu to the correction with the exact matrix.

    Parameters
    ----------
    q, v, a, lam
        State of the stage, at which the iteration matrix has been factored and `note_slopes` called.
    unit : float
        Unit of multipliers, chosen so that they have the same weight as accelerations.
    """
    scale = 1.0 / (weights[0] + weights[1] * g + weights[2] * b)
    n, first = a.size, space.basis[0]
    for j in range(n):
        first[j] = work.x[j]
    for r in range(lam.size):
        first[n + r] = work.mu[r] / unit
    size = sqrt(inner(first, first))
    if not size > 0.0:
        return
    for j in range(first.size):
        first[j] /= size
    fill(space.rest, 0.0)
    space.rest[0] = size
    count = 0
    for k in range(space.cosines.size):
        matrix_times(
            system, g, b, weights, scale, q, v, a, lam, torques, unit, space.basis[k], direction, work,
            space.basis[k + 1],
        )  # fmt: skip
        more = orthogonalise(space, k)
        left = rotate(space, k)
        count = k + 1
        if left <= ENOUGH * size or not more:
            break
    combine(space, count, unit, work)
