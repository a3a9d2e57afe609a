"""Terms of one body: M q'' + h + D u' + K u, kinetic and strain energy (formulation of Eqs. 13-36 in closed form).

Flexible coordinates are mass-normalised modes of the body in its frame, so M_ff = 1 and K = diag(omega^2). Damping is
diagonal if the body's joints hold it as its frame does.
"""

from math import cos, sin

from .bending import second_order_energy, second_order_equations, second_order_shortening
from .compiling import inlined, kernel
from .joints import line_energy, spring_energy
from .loads import apply_lines, apply_loads
from .packed import DAMPING, OMEGA2, S2X, S2Y
from .sums import GJ_SUM, I1_SUM, S2X_SUM, S2Y_SUM, body_products, body_sums, clear_shares, hand_on
from .vectors import LANES, add_scaled, load, store, zeros


@inlined
def linear_terms(system, i, q, v, a, f, scratch):
    """Compute M q'' + h + D u' + K u of body i from its sums, except for the shares: see `begin_body`."""
    body = system.bodies[i]
    o, n, k = body.offset, body.nf, body.flex
    e = o + 3
    c, s = scratch.turn[0], scratch.turn[1]
    w, dw = v[o + 2], a[o + 2]
    # Gravity is equivalent to an upward acceleration of the frame.
    gx, gy = a[o] - system.gravity[0], a[o + 1] - system.gravity[1]
    ax, ay = c * gx + s * gy, c * gy - s * gx
    # First moments s; S2 u' and S2 u''.
    sx, sy = body.S1x + scratch.q[S2X_SUM], body.S1y + scratch.q[S2Y_SUM]
    vx, vy, fx, fy = scratch.v[S2X_SUM], scratch.v[S2Y_SUM], scratch.a[S2X_SUM], scratch.a[S2Y_SUM]
    body_products(system, i, q, v, scratch)
    uI2u, uI2v, mpf_a = 0.0, 0.0, scratch.a[GJ_SUM]
    for j in range(n):
        u, du, ddu, g_u, i_u = q[e + j], v[e + j], a[e + j], scratch.G2_q[j], scratch.I2_q[j]
        uI2u += u * i_u
        uI2v += du * i_u
        mpf_a -= g_u * ddu
        f[e + j] = (
            ddu
            - g_u * dw
            - w * w * i_u
            - 2.0 * w * scratch.G2_v[j]
            + system.modal[OMEGA2, k + j] * u
            + system.modal[DAMPING, k + j] * du
        )
    shares = scratch.shares
    shares[S2X_SUM], shares[S2Y_SUM], shares[I1_SUM], shares[GJ_SUM] = ax, ay, -w * w, dw
    bx = body.m * ax - sy * dw + fx - w * w * sx - 2.0 * w * vy
    by = body.m * ay + sx * dw + fy - w * w * sy + 2.0 * w * vx
    f[o] = c * bx - s * by
    f[o + 1] = s * bx + c * by
    f[o + 2] = sx * ay - sy * ax + (body.I0 + 2.0 * scratch.q[I1_SUM] + uI2u) * dw + mpf_a
    f[o + 2] += 2.0 * w * (scratch.v[I1_SUM] + uI2v)


@inlined
def begin_body(system, i, q, v, a, f, scratch, points):
    """Compute M q'' + h + D u' + K u of body i, less its weight, into f, except for the shares in scratch.

    Joints and motors add their shares, and `sums.hand_on` distributes them. `points` is scratch.points, None for linear
    geometry.
    """
    body_sums(system, i, q, v, a, scratch)
    clear_shares(system, i, scratch)
    if points is not None and system.bodies[i].slopes > 0:
        second_order_equations(system, i, scratch.turn[0], scratch.turn[1], q, v, a, f, points)
    else:
        linear_terms(system, i, q, v, a, f, scratch)
    add_coupled_damping(system, i, v, f, scratch)


@inlined
def add_coupled_damping(system, i, v, f, scratch):
    """Add the off-diagonal part of D u' of body i to f."""
    body = system.bodies[i]
    if body.damping < 0:
        return
    e = body.offset + 3
    for block in range(0, body.stride, LANES):
        total, at = zeros(), body.damping + block
        for j in range(body.nf):
            # The matrix is symmetric.
            total = add_scaled(total, load(system.damping, at), v[e + j])
            at += body.stride
        store(scratch.G2_v, block, total)
    for j in range(body.nf):
        f[e + j] += scratch.G2_v[j]


@kernel
def body_terms(system, i, q, v, a, f, scratch):
    """Compute M q'' + h + D u' + K u of body i, less its weight, into f; the translational part in the ground frame."""
    begin_body(system, i, q, v, a, f, scratch, scratch.points)
    hand_on(system, i, scratch, f)


@kernel
def motion_forces(system, q, v, a, torques, f, scratch):
    """Compute M q'' + h + K u of the whole system at every sample of a motion, less weight and loads, into f.

    q, v, a, f : (instants, n) arrays; torques : (instants, acting) array with the values of time-dependent loads.
    """
    for k in range(q.shape[0]):
        for i in range(system.bodies.size):
            body_terms(system, i, q[k], v[k], a[k], f[k], scratch)
        apply_loads(system, q[k], v[k], torques[k], scratch.registers, f[k])
        apply_lines(system, q[k], v[k], torques[k], scratch.registers, f[k])


@kernel
def weight_work(system, q, scratch):
    """Return the work of gravity relative to all mass at the origin of the ground frame: g . sum m p."""
    return add_weights(system, q, scratch.points)


@inlined
def add_weights(system, q, points):
    """Return the work of the weight of all bodies, as in `weight_work`; `points` as for `begin_body`."""
    total = 0.0
    if system.gravity[0] == 0.0 and system.gravity[1] == 0.0:
        return total
    for i in range(system.bodies.size):
        body = system.bodies[i]
        o, k = body.offset, body.flex
        sx, sy = body.S1x, body.S1y
        for j in range(body.nf):
            sx += system.modal[S2X, k + j] * q[o + 3 + j]
            sy += system.modal[S2Y, k + j] * q[o + 3 + j]
        if points is not None and body.slopes > 0:
            sx -= second_order_shortening(system, i, q, points)
        c, s = cos(q[o + 2]), sin(q[o + 2])
        total += system.gravity[0] * (body.m * q[o] + c * sx - s * sy)
        total += system.gravity[1] * (body.m * q[o + 1] + s * sx + c * sy)
    return total


@kernel
def body_energy(system, i, q, v, scratch):
    """Return kinetic and strain energy of body i."""
    body = system.bodies[i]
    o, n, k = body.offset, body.nf, body.flex
    e = o + 3
    body_sums(system, i, q, v, v, scratch)
    body_products(system, i, q, v, scratch)
    c, s = scratch.turn[0], scratch.turn[1]
    w = v[o + 2]
    rx, ry = c * v[o] + s * v[o + 1], c * v[o + 1] - s * v[o]
    sx, sy = body.S1x + scratch.q[S2X_SUM], body.S1y + scratch.q[S2Y_SUM]
    vx, vy = scratch.v[S2X_SUM], scratch.v[S2Y_SUM]
    inertia, coupling, flexible, strain = body.I0 + 2.0 * scratch.q[I1_SUM], scratch.v[GJ_SUM], 0.0, 0.0
    for j in range(n):
        u, du = q[e + j], v[e + j]
        inertia += scratch.I2_q[j] * u
        coupling -= scratch.G2_q[j] * du
        flexible += du * du
        strain += system.modal[OMEGA2, k + j] * u * u
    kinetic = 0.5 * (body.m * (rx * rx + ry * ry) + inertia * w * w + flexible)
    kinetic += rx * (vx - sy * w) + ry * (vy + sx * w) + w * coupling
    return kinetic, 0.5 * strain


@kernel
def system_energy(system, q, v, scratch):
    """Return kinetic and strain energy of the system."""
    return add_energies(system, q, v, scratch, scratch.points)


@inlined
def add_energies(system, q, v, scratch, points):
    """Return kinetic and strain energy of all bodies; `points` as for `begin_body`."""
    kinetic, strain = 0.0, 0.0
    for i in range(system.bodies.size):
        if points is not None and system.bodies[i].slopes > 0:
            t, u = second_order_energy(system, i, q, v, points)
        else:
            t, u = body_energy(system, i, q, v, scratch)
        kinetic += t
        strain += u
    return kinetic, strain


@kernel
def stored_energy(system, q, v, lam, scratch):
    """Return the kinetic energy, the strain energy including springs, and the work of gravity: see `weight_work`."""
    kinetic, strain = system_energy(system, q, v, scratch)
    strain += spring_energy(system, lam) + line_energy(system, q, v)[0]
    return kinetic, strain, weight_work(system, q, scratch)
