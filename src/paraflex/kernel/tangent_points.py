"""Changes of points of bodies and of forces at them along a direction: see `kernel.tangent`."""

from __future__ import annotations

from math import cos, sin

from paraflex.kernel.compiling import inlined, routine
from paraflex.kernel.joints import marker_shape, marker_shortening
from paraflex.kernel.packed import NX, NY


@inlined
def shortening_tangent(system, bending, marker, q, v, a, direction):
    """Changes of the results of `joints.marker_shortening`."""
    f0, f1, f2 = 0.0, 0.0, 0.0
    if bending is None:
        return f0, f1, f2
    body = system.bodies[marker.body]
    e, n = body.offset + 3, body.nf
    if marker.bending >= 0:
        for j in range(n):
            row = marker.bending + j * body.stride
            bq, b_dq, b_dv = 0.0, 0.0, 0.0
            for l in range(n):
                bq += bending[row + l] * q[e + l]
                b_dq += bending[row + l] * direction.q[e + l]
                b_dv += bending[row + l] * direction.v[e + l]
            f0 += q[e + j] * b_dq
            f1 += direction.v[e + j] * bq + v[e + j] * b_dq
            f2 += direction.a[e + j] * bq + a[e + j] * b_dq + 2.0 * v[e + j] * b_dv
    return f0, f1, f2


@routine
def marker_tangent(system, marker, q, v, a, direction):
    """Changes of the results of `joints.marker_motion`: a marker's position, velocity, acceleration and R s."""
    o = system.bodies[marker.body].offset
    c, s = cos(q[o + 2]), sin(q[o + 2])
    w, dw, turn = v[o + 2], a[o + 2], direction.q[o + 2]
    d_w, d_dw = direction.v[o + 2], direction.a[o + 2]
    sx, sy = marker_shape(system, marker, q)
    ux, uy = marker_shape(system, marker, v)
    bx, by = marker_shape(system, marker, a)
    f0, f1, f2 = marker_shortening(system, system.bending, marker, q, v, a)
    sx += marker.x - f0
    sy += marker.y
    ux -= f1
    bx -= f2
    d_sx, d_sy = marker_shape(system, marker, direction.q)
    d_ux, d_uy = marker_shape(system, marker, direction.v)
    d_bx, d_by = marker_shape(system, marker, direction.a)
    g0, g1, g2 = shortening_tangent(system, system.bending, marker, q, v, a, direction)
    d_sx -= g0
    d_ux -= g1
    d_bx -= g2
    vx, vy = ux - w * sy, uy + w * sx
    d_vx, d_vy = d_ux - d_w * sy - w * d_sy, d_uy + d_w * sx + w * d_sx
    ax = bx - dw * sy - w * w * sx - 2.0 * w * uy
    ay = by + dw * sx - w * w * sy + 2.0 * w * ux
    d_ax = d_bx - d_dw * sy - dw * d_sy - w * w * d_sx - 2.0 * (w * d_w * sx + d_w * uy + w * d_uy)
    d_ay = d_by + d_dw * sx + dw * d_sx - w * w * d_sy - 2.0 * (w * d_w * sy - d_w * ux - w * d_ux)
    rx, ry = c * d_sx - s * d_sy - turn * (s * sx + c * sy), s * d_sx + c * d_sy + turn * (c * sx - s * sy)
    return (
        direction.q[o] + rx,
        direction.q[o + 1] + ry,
        direction.v[o] + c * d_vx - s * d_vy - turn * (s * vx + c * vy),
        direction.v[o + 1] + s * d_vx + c * d_vy + turn * (c * vx - s * vy),
        direction.a[o] + c * d_ax - s * d_ay - turn * (s * ax + c * ay),
        direction.a[o + 1] + s * d_ax + c * d_ay + turn * (c * ax - s * ay),
        rx,
        ry,
    )


@routine
def force_tangent(system, marker, q, force, d_force, lever, d_lever, direction):
    """Add to direction.f the change of the generalised force of a force (x, y) at a marker, whose R s is the lever."""
    body = system.bodies[marker.body]
    o, e, k, n = body.offset, body.offset + 3, marker.shape, body.nf
    c, s, turn = cos(q[o + 2]), sin(q[o + 2]), direction.q[o + 2]
    fx, fy = force
    d_fx, d_fy = d_force
    direction.f[o] += d_fx
    direction.f[o + 1] += d_fy
    direction.f[o + 2] += d_lever[0] * fy + lever[0] * d_fy - d_lever[1] * fx - lever[1] * d_fx
    bx, by = c * fx + s * fy, c * fy - s * fx
    d_bx, d_by = c * d_fx + s * d_fy + turn * by, c * d_fy - s * d_fx - turn * bx
    for j in range(n):
        direction.f[e + j] += system.shape[NX, k + j] * d_bx + system.shape[NY, k + j] * d_by
    shorten_tangent(system, system.bending, marker, q, bx, d_bx, direction)


@inlined
def shorten_tangent(system, bending, marker, q, force, d_force, direction):
    """Subtract from direction.f the change of a force along the beam times the derivative of a marker's f/2."""
    if bending is None:
        return
    if marker.bending < 0:
        return
    body = system.bodies[marker.body]
    e, n = body.offset + 3, body.nf
    for j in range(n):
        row = marker.bending + j * body.stride
        for l in range(n):
            direction.f[e + j] -= bending[row + l] * (d_force * q[e + l] + force * direction.q[e + l])


@inlined
def end_tangent(system, marker, q, v, a, direction):
    """Changes of the results of `marker_motion` for one end of an axis or a line: zero on the ground."""
    if marker < 0:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    return marker_tangent(system, system.markers[marker], q, v, a, direction)
