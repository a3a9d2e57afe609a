"""Changes of the terms of one body along a direction, for both geometries: see `kernel.tangent`."""

from .compiling import inlined, routine
from .packed import DAMPING, FULL, GAUSS, GJ, I1, OMEGA2, S2X, S2Y
from .tangent_points import rotated_tangent, turned_axes
from .vectors import LANES

# Rows of Tangent.points: slopes at the Gauss points, their two derivatives, the axial force there; and changes of
# these.
W0, W1, W2, AXIAL_FORCE, DW0, DW1, DW2, DAXIAL_FORCE = range(8)


@inlined
def plane_sums(shapes, x, y, stride, n, e, u, d_u):
    """Sum n coordinates from e on, of u and of d_u, weighted by shapes from x and from y on, `stride` apart.

    Returns
    -------
    (x, y), (d_x, d_y) : floats
        Sums of u and of d_u.
    """
    along, across, d_along, d_across = 0.0, 0.0, 0.0, 0.0
    for j in range(n):
        Nx, Ny = shapes[x + j * stride], shapes[y + j * stride]
        along += Nx * u[e + j]
        across += Ny * u[e + j]
        d_along += Nx * d_u[e + j]
        d_across += Ny * d_u[e + j]
    return (along, across), (d_along, d_across)


@inlined
def frame_tangent(system, i, q, a, direction):
    """Return the axes of body i, its acceleration less gravity in the body frame, and the change of that acceleration.

    The axes are those of `turned_axes`.
    """
    o = system.bodies[i].offset
    c, s, turn = turned_axes(system, i, q, direction)
    gx, gy = a[o] - system.gravity[0], a[o + 1] - system.gravity[1]
    ax, ay = c * gx + s * gy, c * gy - s * gx
    d_ax = c * direction.a[o] + s * direction.a[o + 1] + turn * ay
    d_ay = c * direction.a[o + 1] - s * direction.a[o] - turn * ax
    return (c, s, turn), ax, ay, d_ax, d_ay


@inlined
def body_tangent(system, i, q, v, a, direction):
    """Compute the change of M q'' + h + D u' + K u of body i, less its weight, into direction.f.

    The terms are those of `bodies.body_terms`.
    """
    body = system.bodies[i]
    o, n, k = body.offset, body.nf, body.flex
    e, x, y, width = o + 3, body.columns + S2X, body.columns + S2Y, body.width
    w, dw, d_w, d_dw = v[o + 2], a[o + 2], direction.v[o + 2], direction.a[o + 2]
    axes, ax, ay, d_ax, d_ay = frame_tangent(system, i, q, a, direction)
    (ux, uy), (d_sx, d_sy) = plane_sums(system.columns, x, y, width, n, e, q, direction.q)
    (vx, vy), (d_vx, d_vy) = plane_sums(system.columns, x, y, width, n, e, v, direction.v)
    (fx, fy), (d_fx, d_fy) = plane_sums(system.columns, x, y, width, n, e, a, direction.a)
    sx, sy = body.S1x + ux, body.S1y + uy
    i1u, i1v, d_i1u, d_i1v = 0.0, 0.0, 0.0, 0.0
    for j in range(n):
        i1 = system.modal[I1, k + j]
        i1u += i1 * q[e + j]
        i1v += i1 * v[e + j]
        d_i1u += i1 * direction.q[e + j]
        d_i1v += i1 * direction.v[e + j]
    uI2u, d_uI2u, d_uI2v, uI2v, d_mpf_a = 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(n):
        g_v, i_u, g_u, d_gu, d_gv, d_iu = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        row = body.square + j * n
        for l in range(n):
            G, I = system.G2[row + l], system.I2[row + l]
            g_u += G * q[e + l]
            g_v += G * v[e + l]
            i_u += I * q[e + l]
            d_gu += G * direction.q[e + l]
            d_gv += G * direction.v[e + l]
            d_iu += I * direction.q[e + l]
        uI2u += q[e + j] * i_u
        uI2v += v[e + j] * i_u
        d_uI2u += 2.0 * direction.q[e + j] * i_u
        d_uI2v += direction.v[e + j] * i_u + v[e + j] * d_iu
        mpf = system.modal[GJ, k + j] - g_u
        d_mpf_a += mpf * direction.a[e + j] - d_gu * a[e + j]
        direction.f[e + j] = (
            system.modal[S2X, k + j] * d_ax
            + system.modal[S2Y, k + j] * d_ay
            + mpf * d_dw
            - d_gu * dw
            + direction.a[e + j]
            - w * w * d_iu
            - 2.0 * w * d_w * (system.modal[I1, k + j] + i_u)
            - 2.0 * (w * d_gv + d_w * g_v)
            + system.modal[OMEGA2, k + j] * direction.q[e + j]
            + system.modal[DAMPING, k + j] * direction.v[e + j]
        )
    bx = body.m * ax - sy * dw + fx - w * w * sx - 2.0 * w * vy
    by = body.m * ay + sx * dw + fy - w * w * sy + 2.0 * w * vx
    d_bx = body.m * d_ax - d_sy * dw - sy * d_dw + d_fx - w * w * d_sx - 2.0 * (w * d_w * sx + d_w * vy + w * d_vy)
    d_by = body.m * d_ay + d_sx * dw + sx * d_dw + d_fy - w * w * d_sy - 2.0 * (w * d_w * sy - d_w * vx - w * d_vx)
    direction.f[o], direction.f[o + 1] = rotated_tangent(axes, bx, by, d_bx, d_by)
    direction.f[o + 2] = d_sx * ay + sx * d_ay - d_sy * ax - sy * d_ax + d_mpf_a
    direction.f[o + 2] += (2.0 * d_i1u + d_uI2u) * dw + (body.I0 + 2.0 * i1u + uI2u) * d_dw
    direction.f[o + 2] += 2.0 * (d_w * (i1v + uI2v) + w * (d_i1v + d_uI2v))


@inlined
def span_weight(system, body, k, j):
    """Return the weight of the Gauss point in lane j in the shortening of the mass point in lane k."""
    if k // body.step == j // body.step:
        return system.spans[body.spans + LANES * (k - k % LANES + j % body.step) + k % LANES]
    return system.spans[body.spans + LANES * (j - j % body.step + FULL) + j % body.step]


@routine
def second_order_slopes(system, i, q, v, a, direction, points):
    """Compute slopes at the Gauss points of body i, their derivatives, and the changes of these, into points."""
    body = system.bodies[i]
    e = body.offset + 3
    for j in range(body.pitch):
        for row in range(8):
            points[row, j] = 0.0
        for l in range(body.nf):
            slope = system.places[body.places + (3 * l + 2) * body.pitch + j]
            points[W0, j] += slope * q[e + l]
            points[W1, j] += slope * v[e + l]
            points[W2, j] += slope * a[e + l]
            points[DW0, j] += slope * direction.q[e + l]
            points[DW1, j] += slope * direction.v[e + l]
            points[DW2, j] += slope * direction.a[e + l]


@routine
def second_order_tangent(system, i, q, v, a, direction, points):
    """Compute the change of M q'' + h + D u' + K u of body i, less its weight, into direction.f.

    The terms are those of `second_order_equations`.
    """
    body = system.bodies[i]
    o, n, pitch = body.offset, body.nf, body.pitch
    e, stride = o + 3, 3 * pitch
    w, dw, d_w, d_dw = v[o + 2], a[o + 2], direction.v[o + 2], direction.a[o + 2]
    axes, ax, ay, d_ax, d_ay = frame_tangent(system, i, q, a, direction)
    second_order_slopes(system, i, q, v, a, direction, points)
    for l in range(n):
        direction.f[e + l] = (
            system.modal[OMEGA2, body.flex + l] * direction.q[e + l]
            + system.modal[DAMPING, body.flex + l] * direction.v[e + l]
        )
    fx, fy, d_fx, d_fy, d_torque = 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(pitch):
        x, y, turns, at = body.places + k, body.places + pitch + k, body.places + 2 * pitch + k, body.inertias + k
        mass, inertia = system.inertias[at + pitch], system.inertias[at + 2 * pitch]
        (ux, sy), (d_sx, d_sy) = plane_sums(system.places, x, y, stride, n, e, q, direction.q)
        (vx, vy), (d_vx, d_vy) = plane_sums(system.places, x, y, stride, n, e, v, direction.v)
        (bx, by), (d_bx, d_by) = plane_sums(system.places, x, y, stride, n, e, a, direction.a)
        sx = system.inertias[at] + ux
        for j in range(k - k % body.step + GAUSS):
            if j % body.step >= GAUSS:
                continue
            weight = span_weight(system, body, k, j)
            s0, s1, s2 = points[W0, j], points[W1, j], points[W2, j]
            d0, d1, d2 = points[DW0, j], points[DW1, j], points[DW2, j]
            sx -= 0.5 * weight * s0 * s0
            vx -= weight * s0 * s1
            bx -= weight * (s1 * s1 + s0 * s2)
            d_sx -= weight * s0 * d0
            d_vx -= weight * (d0 * s1 + s0 * d1)
            d_bx -= weight * (2.0 * s1 * d1 + d0 * s2 + s0 * d2)
        mx = mass * (ax + bx - dw * sy - w * w * sx - 2.0 * w * vy)
        my = mass * (ay + by + dw * sx - w * w * sy + 2.0 * w * vx)
        d_mx = d_ax + d_bx - d_dw * sy - dw * d_sy - w * w * d_sx - 2.0 * (w * d_w * sx + d_w * vy + w * d_vy)
        d_my = d_ay + d_by + d_dw * sx + dw * d_sx - w * w * d_sy - 2.0 * (w * d_w * sy - d_w * vx - w * d_vx)
        d_mx, d_my = mass * d_mx, mass * d_my
        turn = 0.0
        if inertia > 0.0:
            turn = d_dw
            for l in range(n):
                turn += system.places[turns + l * stride] * direction.a[e + l]
            turn *= inertia
            for l in range(n):
                direction.f[e + l] += system.places[turns + l * stride] * turn
        for l in range(n):
            direction.f[e + l] += system.places[x + l * stride] * d_mx + system.places[y + l * stride] * d_my
        for j in range(k - k % body.step + GAUSS):
            if j % body.step >= GAUSS:
                continue
            weight = span_weight(system, body, k, j)
            points[AXIAL_FORCE, j] += weight * mx
            points[DAXIAL_FORCE, j] += weight * d_mx
        fx += mx
        fy += my
        d_fx += d_mx
        d_fy += d_my
        d_torque += d_sx * my + sx * d_my - d_sy * mx - sy * d_mx + turn
    for j in range(pitch):
        force = points[DW0, j] * points[AXIAL_FORCE, j] + points[W0, j] * points[DAXIAL_FORCE, j]
        for l in range(n):
            direction.f[e + l] -= system.places[body.places + (3 * l + 2) * pitch + j] * force
    direction.f[o], direction.f[o + 1] = rotated_tangent(axes, fx, fy, d_fx, d_fy)
    direction.f[o + 2] = d_torque


@inlined
def body_terms_tangent(system, i, q, v, a, direction, points):
    """Compute the change of the terms of body i into direction.f.

    `points` is direction.points, None for linear geometry.
    """
    if points is not None and system.bodies[i].slopes > 0:
        second_order_tangent(system, i, q, v, a, direction, points)
    else:
        body_tangent(system, i, q, v, a, direction)
    body = system.bodies[i]
    if body.damping >= 0:
        e = body.offset + 3
        for j in range(body.nf):
            for l in range(body.nf):
                direction.f[e + j] += system.damping[body.damping + j * body.stride + l] * direction.v[e + l]
