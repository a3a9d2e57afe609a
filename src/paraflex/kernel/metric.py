"""The mass matrix at the factor's deformation: what it makes of a vector, and the norm it gives, in metres."""

from __future__ import annotations

from math import sqrt

from paraflex.kernel.bending import bent_mass_square, bent_mass_times
from paraflex.kernel.compiling import inlined, kernel
from paraflex.kernel.packed import MPF, S2X, S2Y


@inlined
def mass_times(p, i, ws, mass, x):
    """M x of body i in place, with the mass matrix of the factor; x in the body frame.

    `mass` is ws.mass, None for linear geometry.
    """
    body = p.bodies[i]
    if mass is not None:
        if body.slopes > 0:
            bent_mass_times(p, i, mass, ws.scratch.rigid, x)
            return
    o, n, k = body.offset, body.nf, body.flex
    e = o + 3
    sx, sy, inertia = ws.frame[i, 2], ws.frame[i, 3], ws.frame[i, 4]
    x0, x1, x2 = x[o], x[o + 1], x[o + 2]
    y0 = body.m * x0 - sy * x2
    y1 = body.m * x1 + sx * x2
    y2 = sx * x1 - sy * x0 + inertia * x2
    for j in range(n):
        z = x[e + j]
        S2x, S2y, mpf = p.modal[S2X, k + j], p.modal[S2Y, k + j], ws.flex[MPF, k + j]
        y0 += S2x * z
        y1 += S2y * z
        y2 += mpf * z
        x[e + j] = z + S2x * x0 + S2y * x1 + mpf * x2
    x[o], x[o + 1], x[o + 2] = y0, y1, y2


@inlined
def mass_square(p, i, ws, mass, x):
    """x^T M x of body i for a ground-frame vector; `mass` as for `mass_times`."""
    body = p.bodies[i]
    o, k = body.offset, body.flex
    c, s = ws.frame[i, 0], ws.frame[i, 1]
    x0, x1, x2 = c * x[o] + s * x[o + 1], c * x[o + 1] - s * x[o], x[o + 2]
    if mass is not None:
        if body.slopes > 0:
            return bent_mass_square(p, i, mass, x, x0, x1)
    sx, sy, inertia = ws.frame[i, 2], ws.frame[i, 3], ws.frame[i, 4]
    fx, fy, fp, ff = 0.0, 0.0, 0.0, 0.0
    for j in range(body.nf):
        z = x[o + 3 + j]
        fx += p.modal[S2X, k + j] * z
        fy += p.modal[S2Y, k + j] * z
        fp += ws.flex[MPF, k + j] * z
        ff += z * z
    square = body.m * (x0 * x0 + x1 * x1) + inertia * x2 * x2 + ff
    return square + 2.0 * (x0 * (fx - sy * x2) + x1 * (fy + sx * x2) + x2 * fp)


@kernel
def mass_norm(p, ws, x):
    """sqrt(x^T M x / m_total) of a ground-frame vector: metres for a displacement, whatever the coordinates."""
    total = 0.0
    for i in range(p.bodies.size):
        total += mass_square(p, i, ws, ws.mass, x)
    return sqrt(max(total, 0.0) / p.total_mass)
