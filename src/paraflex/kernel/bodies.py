"""Terms of one body: M q'' + h + K u, kinetic and strain energy (formulation of Eqs. 13-36 in closed form).

Flexible coordinates are mass-normalised modes, so M_ff = 1, K = diag(omega^2) and damping is
diagonal.
"""

from __future__ import annotations

from math import cos, sin

from paraflex.kernel.bending import bent_energy, bent_equations, bent_shortening
from paraflex.kernel.compiling import inlined, kernel
from paraflex.kernel.joints import apply_lines, apply_loads
from paraflex.kernel.packed import DAMPING, GJ, I1, OMEGA2, S2X, S2Y


@inlined
def body_equations(p, i, q, v, a, f):
    """M q'' + h + D u' + K u of body i, less its weight, into f; the translational part in the ground frame."""
    body = p.bodies[i]
    o, n, k = body.offset, body.nf, body.flex
    e = o + 3
    c, s = cos(q[o + 2]), sin(q[o + 2])
    w, dw = v[o + 2], a[o + 2]
    # Gravity acts as a frame that is accelerated upwards.
    gx, gy = a[o] - p.gravity[0], a[o + 1] - p.gravity[1]
    ax, ay = c * gx + s * gy, c * gy - s * gx
    # First moments s, S2 u' and S2 u''.
    sx, sy, vx, vy, fx, fy = body.S1x, body.S1y, 0.0, 0.0, 0.0, 0.0
    i1u, i1v = 0.0, 0.0
    for j in range(n):
        u, du, ddu = q[e + j], v[e + j], a[e + j]
        S2x, S2y, i1 = p.modal[S2X, k + j], p.modal[S2Y, k + j], p.modal[I1, k + j]
        sx += S2x * u
        sy += S2y * u
        vx += S2x * du
        vy += S2y * du
        fx += S2x * ddu
        fy += S2y * ddu
        i1u += i1 * u
        i1v += i1 * du
    uI2u, uI2v, mpf_a = 0.0, 0.0, 0.0
    for j in range(n):
        g_u, g_v, i_u = 0.0, 0.0, 0.0
        row = body.square + j * n
        for l in range(n):
            g_u += p.G2[row + l] * q[e + l]
            g_v += p.G2[row + l] * v[e + l]
            i_u += p.I2[row + l] * q[e + l]
        uI2u += q[e + j] * i_u
        uI2v += v[e + j] * i_u
        mpf = p.modal[GJ, k + j] - g_u
        mpf_a += mpf * a[e + j]
        f[e + j] = (
            p.modal[S2X, k + j] * ax
            + p.modal[S2Y, k + j] * ay
            + mpf * dw
            + a[e + j]
            - w * w * (p.modal[I1, k + j] + i_u)
            - 2.0 * w * g_v
            + p.modal[OMEGA2, k + j] * q[e + j]
            + p.modal[DAMPING, k + j] * v[e + j]
        )
    bx = body.m * ax - sy * dw + fx - w * w * sx - 2.0 * w * vy
    by = body.m * ay + sx * dw + fy - w * w * sy + 2.0 * w * vx
    f[o] = c * bx - s * by
    f[o + 1] = s * bx + c * by
    f[o + 2] = sx * ay - sy * ax + (body.I0 + 2.0 * i1u + uI2u) * dw + mpf_a + 2.0 * w * (i1v + uI2v)


@inlined
def body_terms(p, i, q, v, a, f, points):
    """M q'' + h + D u' + K u of body i, less its weight, into f.

    `points` is scratch of second-order geometry (Workspace.points), or None.
    """
    if points is None:
        body_equations(p, i, q, v, a, f)
    elif p.bodies[i].slopes > 0:
        bent_equations(p, i, q, v, a, f, points)
    else:
        body_equations(p, i, q, v, a, f)


@kernel
def motion_forces(p, q, v, a, f, points):
    """M q'' + h + K u of the whole system at every instant of a motion, less weight and loads: all (instants, n)."""
    for k in range(q.shape[0]):
        for i in range(p.bodies.size):
            body_terms(p, i, q[k], v[k], a[k], f[k], points)
        apply_loads(p, q[k], f[k])
        apply_lines(p, q[k], v[k], f[k])


@kernel
def weight_work(p, q, points):
    """What gravity has done since all mass lay at the origin of the ground frame: g . sum m p."""
    total = 0.0
    if p.gravity[0] == 0.0 and p.gravity[1] == 0.0:
        return total
    for i in range(p.bodies.size):
        body = p.bodies[i]
        o, k = body.offset, body.flex
        sx, sy = body.S1x, body.S1y
        for j in range(body.nf):
            sx += p.modal[S2X, k + j] * q[o + 3 + j]
            sy += p.modal[S2Y, k + j] * q[o + 3 + j]
        if points is not None:
            if body.slopes > 0:
                sx -= bent_shortening(p, i, q, points)
        c, s = cos(q[o + 2]), sin(q[o + 2])
        total += p.gravity[0] * (body.m * q[o] + c * sx - s * sy)
        total += p.gravity[1] * (body.m * q[o + 1] + s * sx + c * sy)
    return total


@inlined
def body_energy(p, i, q, v):
    """Kinetic and strain energy of body i."""
    body = p.bodies[i]
    o, n, k = body.offset, body.nf, body.flex
    e = o + 3
    c, s = cos(q[o + 2]), sin(q[o + 2])
    w = v[o + 2]
    rx, ry = c * v[o] + s * v[o + 1], c * v[o + 1] - s * v[o]
    sx, sy, vx, vy = body.S1x, body.S1y, 0.0, 0.0
    inertia, coupling, flexible, strain = body.I0, 0.0, 0.0, 0.0
    for j in range(n):
        u, du = q[e + j], v[e + j]
        sx += p.modal[S2X, k + j] * u
        sy += p.modal[S2Y, k + j] * u
        vx += p.modal[S2X, k + j] * du
        vy += p.modal[S2Y, k + j] * du
        g_u, i_u = 0.0, 0.0
        row = body.square + j * n
        for l in range(n):
            g_u += p.G2[row + l] * q[e + l]
            i_u += p.I2[row + l] * q[e + l]
        inertia += (2.0 * p.modal[I1, k + j] + i_u) * u
        coupling += (p.modal[GJ, k + j] - g_u) * du
        flexible += du * du
        strain += p.modal[OMEGA2, k + j] * u * u
    kinetic = 0.5 * (body.m * (rx * rx + ry * ry) + inertia * w * w + flexible)
    kinetic += rx * (vx - sy * w) + ry * (vy + sx * w) + w * coupling
    return kinetic, 0.5 * strain


@kernel
def system_energy(p, q, v, points):
    """Kinetic and strain energy of the system; `points` as for `body_terms`."""
    kinetic, strain = 0.0, 0.0
    for i in range(p.bodies.size):
        if points is None:
            t, u = body_energy(p, i, q, v)
        elif p.bodies[i].slopes > 0:
            t, u = bent_energy(p, i, q, v, points)
        else:
            t, u = body_energy(p, i, q, v)
        kinetic += t
        strain += u
    return kinetic, strain
