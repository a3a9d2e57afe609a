"""Changes of points of bodies and of forces at them along a direction: see `kernel.tangent`."""

from math import cos, sin

from .compiling import inlined, routine
from .joints import marker_shape, marker_shapes, relative_motion
from .packed import NX, NY


@inlined
def shortening_tangent(system, bending, marker, q, v, a, direction):
    """Return the changes of the results of `joints.marker_shortening`."""
    f0, f1, f2 = 0.0, 0.0, 0.0
    if bending is None or marker.bending < 0:
        return f0, f1, f2
    body = system.bodies[marker.body]
    e, n = body.offset + 3, body.nf
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


@inlined
def turned_axes(system, i, q, direction):
    """Return cosine and sine of a body's angle, and the change of the angle."""
    angle = system.bodies[i].offset + 2
    return cos(q[angle]), sin(q[angle]), direction.q[angle]


@inlined
def rotated_tangent(axes, x, y, d_x, d_y):
    """Return the change of R (x, y) for a body-frame vector that changes by (d_x, d_y), with `turned_axes`."""
    c, s, turn = axes
    return c * d_x - s * d_y - turn * (s * x + c * y), s * d_x + c * d_y + turn * (c * x - s * y)


@routine
def marker_tangent(system, marker, q, v, a, direction):
    """Return the changes of the results of `joints.marker_motion`: position, velocity, acceleration and R s."""
    o, axes = system.bodies[marker.body].offset, turned_axes(system, marker.body, q, direction)
    w, dw, d_w, d_dw = v[o + 2], a[o + 2], direction.v[o + 2], direction.a[o + 2]
    shapes, shortening = marker_shapes(system, marker, q, v, a)
    (sx, sy), (ux, uy), (vx, vy), (ax, ay) = relative_motion(marker, w, dw, shapes, shortening)
    d_sx, d_sy = marker_shape(system, marker, direction.q)
    d_ux, d_uy = marker_shape(system, marker, direction.v)
    d_bx, d_by = marker_shape(system, marker, direction.a)
    g0, g1, g2 = shortening_tangent(system, system.bending, marker, q, v, a, direction)
    d_sx -= g0
    d_ux -= g1
    d_bx -= g2
    d_vx, d_vy = d_ux - d_w * sy - w * d_sy, d_uy + d_w * sx + w * d_sx
    d_ax = d_bx - d_dw * sy - dw * d_sy - w * w * d_sx - 2.0 * (w * d_w * sx + d_w * uy + w * d_uy)
    d_ay = d_by + d_dw * sx + dw * d_sx - w * w * d_sy - 2.0 * (w * d_w * sy - d_w * ux - w * d_ux)
    rx, ry = rotated_tangent(axes, sx, sy, d_sx, d_sy)
    vx, vy = rotated_tangent(axes, vx, vy, d_vx, d_vy)
    ax, ay = rotated_tangent(axes, ax, ay, d_ax, d_ay)
    x, y = direction.q[o] + rx, direction.q[o + 1] + ry
    return x, y, direction.v[o] + vx, direction.v[o + 1] + vy, direction.a[o] + ax, direction.a[o + 1] + ay, rx, ry


@routine
def force_tangent(system, marker, q, force, d_force, lever, d_lever, direction):
    """Add the change of the generalised force of a force (x, y) at a marker to direction.f; the lever is its R s."""
    body = system.bodies[marker.body]
    o, e, k, n = body.offset, body.offset + 3, marker.shape, body.nf
    c, s, turn = turned_axes(system, marker.body, q, direction)
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
    if bending is None or marker.bending < 0:
        return
    body = system.bodies[marker.body]
    e, n = body.offset + 3, body.nf
    for j in range(n):
        row = marker.bending + j * body.stride
        for l in range(n):
            direction.f[e + j] -= bending[row + l] * (d_force * q[e + l] + force * direction.q[e + l])


@inlined
def end_tangent(system, marker, q, v, a, direction):
    """Return the changes of the results of `marker_motion` for one end of an axis or a line, zero on the ground."""
    if marker < 0:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    return marker_tangent(system, system.markers[marker], q, v, a, direction)
