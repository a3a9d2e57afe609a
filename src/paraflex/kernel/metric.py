"""Product of a vector with the mass matrix at the deformation of the factor, and the norm by that matrix, in metres."""

from math import sqrt

from .bending import dense_square, dense_times
from .compiling import inlined, kernel
from .packed import MPF, S2X, S2Y


@inlined
def mass_times(system, i, work, mass, x):
    """Multiply x by M of body i in place, with the mass matrix of the factor; x in the body frame.

    `mass` is work.mass, None for linear geometry.
    """
    body = system.bodies[i]
    if mass is not None and body.slopes > 0:
        dense_times(system, i, mass, work.scratch.rigid, x)
        return
    o, n, k = body.offset, body.nf, body.flex
    e = o + 3
    sx, sy, inertia = work.frame[i, 2], work.frame[i, 3], work.frame[i, 4]
    x0, x1, x2 = x[o], x[o + 1], x[o + 2]
    y0 = body.m * x0 - sy * x2
    y1 = body.m * x1 + sx * x2
    y2 = sx * x1 - sy * x0 + inertia * x2
    for j in range(n):
        z = x[e + j]
        S2x, S2y, mpf = system.modal[S2X, k + j], system.modal[S2Y, k + j], work.flex[MPF, k + j]
        y0 += S2x * z
        y1 += S2y * z
        y2 += mpf * z
        x[e + j] = z + S2x * x0 + S2y * x1 + mpf * x2
    x[o], x[o + 1], x[o + 2] = y0, y1, y2


@inlined
def mass_square(system, i, work, mass, x):
    """Return x^T M x of body i for a ground-frame vector; `mass` as for `mass_times`."""
    body = system.bodies[i]
    o, k = body.offset, body.flex
    c, s = work.frame[i, 0], work.frame[i, 1]
    x0, x1, x2 = c * x[o] + s * x[o + 1], c * x[o + 1] - s * x[o], x[o + 2]
    if mass is not None and body.slopes > 0:
        return dense_square(system, i, mass, work.scratch.rigid, x, x0, x1)
    sx, sy, inertia = work.frame[i, 2], work.frame[i, 3], work.frame[i, 4]
    fx, fy, fp, ff = 0.0, 0.0, 0.0, 0.0
    for j in range(body.nf):
        z = x[o + 3 + j]
        fx += system.modal[S2X, k + j] * z
        fy += system.modal[S2Y, k + j] * z
        fp += work.flex[MPF, k + j] * z
        ff += z * z
    square = body.m * (x0 * x0 + x1 * x1) + inertia * x2 * x2 + ff
    return square + 2.0 * (x0 * (fx - sy * x2) + x1 * (fy + sx * x2) + x2 * fp)


@kernel
def mass_norm(system, work, x):
    """Return sqrt(x^T M x / m_total) of a ground-frame vector.

    The norm of a displacement is in metres and does not depend on the coordinates.
    """
    total = 0.0
    for i in range(system.bodies.size):
        total += mass_square(system, i, work, work.mass, x)
    return sqrt(max(total, 0.0) / system.total_mass)
