"""Exact derivative of the residuals of `kernel.stage.equations` along a direction, term by term, by hand.

Along (dq, dv, da, dlambda) the residual F of the equations of motion changes by F_q dq + F_v dv + M da + J^T dlambda,
and the rows Phi'' + 2 alpha Phi' + beta^2 Phi by G_q dq + G_v dv + J da. Everything is a product rule over what the
residuals are made of: points of bodies, forces at them, axes, lines. `d` in a name means: the change of what follows.
"""

from __future__ import annotations

from math import cos, cosh, sin, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from paraflex.kernel.arrays import fill
from paraflex.kernel.axes import axis_frame, component, track_piece
from paraflex.kernel.compiling import inlined, kernel, routine
from paraflex.kernel.constraints import joint_rates
from paraflex.kernel.joints import apply_torque, line_end, marker_angle, marker_motion, marker_shape, marker_shortening
from paraflex.kernel.packed import (
    ANGLE,
    AXIS,
    CONSTRAINT,
    DAMPING,
    FRICTION,
    GJ,
    I1,
    NX,
    NY,
    OMEGA2,
    S2X,
    S2Y,
    SLOPE,
    SPRING,
    PackedSystem,
)

# Rows of Tangent.points: slopes at Gauss points, their two derivatives and the axial force there, and changes of these.
W0, W1, W2, AXIAL, DW0, DW1, DW2, DAXIAL = range(8)


class Tangent(NamedTuple):
    """A direction and what changes along it."""

    q: NDArray[np.float64]  # (n,) the direction
    v: NDArray[np.float64]
    a: NDArray[np.float64]
    lam: NDArray[np.float64]  # (m,)
    f: NDArray[np.float64]  # (n,) change of the residual of the equations of motion
    rows: NDArray[np.float64]  # (m,) and of the rows
    friction: NDArray[np.float64]  # (m,) slope of the rows of friction against the rate, at the last `note_slopes`
    points: NDArray[np.float64] | None  # (8, max mass points of a body) scratch of second-order geometry


def make_tangent(p: PackedSystem) -> Tangent:
    """Allocate a direction, zero, and room for the changes along it."""
    n, m = int(sum(3 + body["nf"] for body in p.bodies)), p.rows.size
    width = int((p.bodies["mass_end"] - p.bodies["mass"]).max(initial=0))
    points = None if p.bending is None else np.zeros((8, width))
    q, v, a, f = (np.zeros(n) for _ in range(4))
    return Tangent(q, v, a, np.zeros(m), f, np.zeros(m), np.zeros(m), points)


@inlined
def body_tangent(p, i, q, v, a, d):
    """Change of M q'' + h + D u' + K u of body i, less its weight, into d.f: see `bodies.body_equations`."""
    body = p.bodies[i]
    o, n, k = body.offset, body.nf, body.flex
    e = o + 3
    c, s = cos(q[o + 2]), sin(q[o + 2])
    w, dw, turn = v[o + 2], a[o + 2], d.q[o + 2]
    d_w, d_dw = d.v[o + 2], d.a[o + 2]
    gx, gy = a[o] - p.gravity[0], a[o + 1] - p.gravity[1]
    ax, ay = c * gx + s * gy, c * gy - s * gx
    d_ax = c * d.a[o] + s * d.a[o + 1] + turn * ay
    d_ay = c * d.a[o + 1] - s * d.a[o] - turn * ax
    sx, sy, vx, vy, fx, fy, i1u, i1v = body.S1x, body.S1y, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    d_sx, d_sy, d_vx, d_vy, d_fx, d_fy, d_i1u, d_i1v = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(n):
        S2x, S2y, i1 = p.modal[S2X, k + j], p.modal[S2Y, k + j], p.modal[I1, k + j]
        sx += S2x * q[e + j]
        sy += S2y * q[e + j]
        vx += S2x * v[e + j]
        vy += S2y * v[e + j]
        fx += S2x * a[e + j]
        fy += S2y * a[e + j]
        i1u += i1 * q[e + j]
        i1v += i1 * v[e + j]
        d_sx += S2x * d.q[e + j]
        d_sy += S2y * d.q[e + j]
        d_vx += S2x * d.v[e + j]
        d_vy += S2y * d.v[e + j]
        d_fx += S2x * d.a[e + j]
        d_fy += S2y * d.a[e + j]
        d_i1u += i1 * d.q[e + j]
        d_i1v += i1 * d.v[e + j]
    uI2u, d_uI2u, d_uI2v, uI2v, d_mpf_a = 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(n):
        g_v, i_u, g_u, d_gu, d_gv, d_iu = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        row = body.square + j * n
        for l in range(n):
            G, I = p.G2[row + l], p.I2[row + l]
            g_u += G * q[e + l]
            g_v += G * v[e + l]
            i_u += I * q[e + l]
            d_gu += G * d.q[e + l]
            d_gv += G * d.v[e + l]
            d_iu += I * d.q[e + l]
        uI2u += q[e + j] * i_u
        uI2v += v[e + j] * i_u
        d_uI2u += 2.0 * d.q[e + j] * i_u
        d_uI2v += d.v[e + j] * i_u + v[e + j] * d_iu
        mpf = p.modal[GJ, k + j] - g_u
        d_mpf_a += mpf * d.a[e + j] - d_gu * a[e + j]
        d.f[e + j] = (
            p.modal[S2X, k + j] * d_ax
            + p.modal[S2Y, k + j] * d_ay
            + mpf * d_dw
            - d_gu * dw
            + d.a[e + j]
            - w * w * d_iu
            - 2.0 * w * d_w * (p.modal[I1, k + j] + i_u)
            - 2.0 * (w * d_gv + d_w * g_v)
            + p.modal[OMEGA2, k + j] * d.q[e + j]
            + p.modal[DAMPING, k + j] * d.v[e + j]
        )
    bx = body.m * ax - sy * dw + fx - w * w * sx - 2.0 * w * vy
    by = body.m * ay + sx * dw + fy - w * w * sy + 2.0 * w * vx
    d_bx = body.m * d_ax - d_sy * dw - sy * d_dw + d_fx - w * w * d_sx - 2.0 * (w * d_w * sx + d_w * vy + w * d_vy)
    d_by = body.m * d_ay + d_sx * dw + sx * d_dw + d_fy - w * w * d_sy - 2.0 * (w * d_w * sy - d_w * vx - w * d_vx)
    d.f[o] = c * d_bx - s * d_by - turn * (s * bx + c * by)
    d.f[o + 1] = s * d_bx + c * d_by + turn * (c * bx - s * by)
    d.f[o + 2] = d_sx * ay + sx * d_ay - d_sy * ax - sy * d_ax + d_mpf_a
    d.f[o + 2] += (2.0 * d_i1u + d_uI2u) * dw + (body.I0 + 2.0 * i1u + uI2u) * d_dw
    d.f[o + 2] += 2.0 * (d_w * (i1v + uI2v) + w * (d_i1v + d_uI2v))


@routine
def bent_slopes(p, i, q, v, a, d, points):
    """Slopes at the Gauss points of body i, their derivatives, and the changes of these, into points."""
    body = p.bodies[i]
    e = body.offset + 3
    for j in range(body.slopes):
        h = p.masses[body.mass + j].shape
        for row in range(8):
            points[row, j] = 0.0
        for l in range(body.nf):
            slope = p.mass_shape[SLOPE, h + l]
            points[W0, j] += slope * q[e + l]
            points[W1, j] += slope * v[e + l]
            points[W2, j] += slope * a[e + l]
            points[DW0, j] += slope * d.q[e + l]
            points[DW1, j] += slope * d.v[e + l]
            points[DW2, j] += slope * d.a[e + l]


@routine
def bent_tangent(p, i, q, v, a, d, points):
    """Change of M q'' + h + D u' + K u of body i, less its weight, into d.f: see `bending.bent_equations`."""
    body = p.bodies[i]
    o, n = body.offset, body.nf
    e = o + 3
    c, s = cos(q[o + 2]), sin(q[o + 2])
    w, dw, d_phi = v[o + 2], a[o + 2], d.q[o + 2]
    d_w, d_dw = d.v[o + 2], d.a[o + 2]
    gx, gy = a[o] - p.gravity[0], a[o + 1] - p.gravity[1]
    ax, ay = c * gx + s * gy, c * gy - s * gx
    d_ax = c * d.a[o] + s * d.a[o + 1] + d_phi * ay
    d_ay = c * d.a[o + 1] - s * d.a[o] - d_phi * ax
    bent_slopes(p, i, q, v, a, d, points)
    for l in range(n):
        d.f[e + l] = p.modal[OMEGA2, body.flex + l] * d.q[e + l] + p.modal[DAMPING, body.flex + l] * d.v[e + l]
    fx, fy, d_fx, d_fy, d_torque = 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(body.mass, body.mass_end):
        point = p.masses[k]
        h = point.shape
        sx, sy, vx, vy, bx, by = point.x, 0.0, 0.0, 0.0, 0.0, 0.0
        d_sx, d_sy, d_vx, d_vy, d_bx, d_by = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for l in range(n):
            Nx, Ny = p.mass_shape[NX, h + l], p.mass_shape[NY, h + l]
            sx += Nx * q[e + l]
            sy += Ny * q[e + l]
            vx += Nx * v[e + l]
            vy += Ny * v[e + l]
            bx += Nx * a[e + l]
            by += Ny * a[e + l]
            d_sx += Nx * d.q[e + l]
            d_sy += Ny * d.q[e + l]
            d_vx += Nx * d.v[e + l]
            d_vy += Ny * d.v[e + l]
            d_bx += Nx * d.a[e + l]
            d_by += Ny * d.a[e + l]
        for j in range(point.reach):
            weight = p.mass_weights[point.weights + j]
            s0, s1, s2 = points[W0, j], points[W1, j], points[W2, j]
            d0, d1, d2 = points[DW0, j], points[DW1, j], points[DW2, j]
            sx -= 0.5 * weight * s0 * s0
            vx -= weight * s0 * s1
            bx -= weight * (s1 * s1 + s0 * s2)
            d_sx -= weight * s0 * d0
            d_vx -= weight * (d0 * s1 + s0 * d1)
            d_bx -= weight * (2.0 * s1 * d1 + d0 * s2 + s0 * d2)
        mx = point.mass * (ax + bx - dw * sy - w * w * sx - 2.0 * w * vy)
        my = point.mass * (ay + by + dw * sx - w * w * sy + 2.0 * w * vx)
        d_mx = d_ax + d_bx - d_dw * sy - dw * d_sy - w * w * d_sx - 2.0 * (w * d_w * sx + d_w * vy + w * d_vy)
        d_my = d_ay + d_by + d_dw * sx + dw * d_sx - w * w * d_sy - 2.0 * (w * d_w * sy - d_w * vx - w * d_vx)
        d_mx, d_my = point.mass * d_mx, point.mass * d_my
        turn = 0.0
        if point.inertia > 0.0:
            turn = d_dw
            for l in range(n):
                turn += p.mass_shape[SLOPE, h + l] * d.a[e + l]
            turn *= point.inertia
            for l in range(n):
                d.f[e + l] += p.mass_shape[SLOPE, h + l] * turn
        for l in range(n):
            d.f[e + l] += p.mass_shape[NX, h + l] * d_mx + p.mass_shape[NY, h + l] * d_my
        for j in range(point.reach):
            weight = p.mass_weights[point.weights + j]
            points[AXIAL, j] += weight * mx
            points[DAXIAL, j] += weight * d_mx
        fx += mx
        fy += my
        d_fx += d_mx
        d_fy += d_my
        d_torque += d_sx * my + sx * d_my - d_sy * mx - sy * d_mx + turn
    for j in range(body.slopes):
        h = p.masses[body.mass + j].shape
        force = points[DW0, j] * points[AXIAL, j] + points[W0, j] * points[DAXIAL, j]
        for l in range(n):
            d.f[e + l] -= p.mass_shape[SLOPE, h + l] * force
    d.f[o] = c * d_fx - s * d_fy - d_phi * (s * fx + c * fy)
    d.f[o + 1] = s * d_fx + c * d_fy + d_phi * (c * fx - s * fy)
    d.f[o + 2] = d_torque


@inlined
def body_terms_tangent(p, i, q, v, a, d, points):
    """Change of the terms of body i into d.f; `points` is d.points, None for linear geometry."""
    if points is None:
        body_tangent(p, i, q, v, a, d)
    elif p.bodies[i].slopes > 0:
        bent_tangent(p, i, q, v, a, d, points)
    else:
        body_tangent(p, i, q, v, a, d)


@inlined
def shortening_tangent(p, bending, marker, q, v, a, d):
    """Changes of what `joints.marker_shortening` returns."""
    f0, f1, f2 = 0.0, 0.0, 0.0
    if bending is None:
        return f0, f1, f2
    body = p.bodies[marker.body]
    e, n = body.offset + 3, body.nf
    if marker.bending >= 0:
        for j in range(n):
            row = marker.bending + j * n
            bq, b_dq, b_dv = 0.0, 0.0, 0.0
            for l in range(n):
                bq += bending[row + l] * q[e + l]
                b_dq += bending[row + l] * d.q[e + l]
                b_dv += bending[row + l] * d.v[e + l]
            f0 += q[e + j] * b_dq
            f1 += d.v[e + j] * bq + v[e + j] * b_dq
            f2 += d.a[e + j] * bq + a[e + j] * b_dq + 2.0 * v[e + j] * b_dv
    return f0, f1, f2


@routine
def marker_tangent(p, marker, q, v, a, d):
    """Changes of what `joints.marker_motion` returns: of a marker's position, velocity, acceleration and R s."""
    o = p.bodies[marker.body].offset
    c, s = cos(q[o + 2]), sin(q[o + 2])
    w, dw, turn = v[o + 2], a[o + 2], d.q[o + 2]
    d_w, d_dw = d.v[o + 2], d.a[o + 2]
    sx, sy = marker_shape(p, marker, q)
    ux, uy = marker_shape(p, marker, v)
    bx, by = marker_shape(p, marker, a)
    f0, f1, f2 = marker_shortening(p, p.bending, marker, q, v, a)
    sx += marker.x - f0
    sy += marker.y
    ux -= f1
    bx -= f2
    d_sx, d_sy = marker_shape(p, marker, d.q)
    d_ux, d_uy = marker_shape(p, marker, d.v)
    d_bx, d_by = marker_shape(p, marker, d.a)
    g0, g1, g2 = shortening_tangent(p, p.bending, marker, q, v, a, d)
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
        d.q[o] + rx,
        d.q[o + 1] + ry,
        d.v[o] + c * d_vx - s * d_vy - turn * (s * vx + c * vy),
        d.v[o + 1] + s * d_vx + c * d_vy + turn * (c * vx - s * vy),
        d.a[o] + c * d_ax - s * d_ay - turn * (s * ax + c * ay),
        d.a[o + 1] + s * d_ax + c * d_ay + turn * (c * ax - s * ay),
        rx,
        ry,
    )


@routine
def force_tangent(p, marker, q, force, d_force, lever, d_lever, d):
    """Add to d.f the change of the generalised force of a force (x, y) at a marker, whose R s is the lever."""
    body = p.bodies[marker.body]
    o, e, k, n = body.offset, body.offset + 3, marker.shape, body.nf
    c, s, turn = cos(q[o + 2]), sin(q[o + 2]), d.q[o + 2]
    fx, fy = force
    d_fx, d_fy = d_force
    d.f[o] += d_fx
    d.f[o + 1] += d_fy
    d.f[o + 2] += d_lever[0] * fy + lever[0] * d_fy - d_lever[1] * fx - lever[1] * d_fx
    bx, by = c * fx + s * fy, c * fy - s * fx
    d_bx, d_by = c * d_fx + s * d_fy + turn * by, c * d_fy - s * d_fx - turn * bx
    for j in range(n):
        d.f[e + j] += p.shape[NX, k + j] * d_bx + p.shape[NY, k + j] * d_by
    shorten_tangent(p, p.bending, marker, q, bx, d_bx, d)


@inlined
def shorten_tangent(p, bending, marker, q, force, d_force, d):
    """Subtract from d.f the change of a force along the beam times the derivative of a marker's f/2."""
    if bending is None:
        return
    if marker.bending < 0:
        return
    body = p.bodies[marker.body]
    e, n = body.offset + 3, body.nf
    for j in range(n):
        row = marker.bending + j * n
        for l in range(n):
            d.f[e + j] -= bending[row + l] * (d_force * q[e + l] + force * d.q[e + l])


@inlined
def angle_tangent(p, marker, kind, weights, d):
    """Change of a row that holds a marker's angle."""
    if kind == CONSTRAINT:
        return (
            weights[0] * marker_angle(p, marker, d.a)
            + weights[1] * marker_angle(p, marker, d.v)
            + weights[2] * marker_angle(p, marker, d.q)
        )
    return marker_angle(p, marker, d.q if kind == SPRING else d.v)


@inlined
def joints_tangent(p, i, weights, q, v, a, lam, d):
    """Add the change of body i's part of the rows to d.rows, and that of Phi_q^T lambda to d.f."""
    body = p.bodies[i]
    for k in range(body.port, body.port_end):
        port = p.ports[k]
        marker = p.markers[port.marker]
        r, sign = port.row, port.sign
        if port.kind == ANGLE:
            d.rows[r] += sign * angle_tangent(p, marker, p.rows[r].kind, weights, d)
            apply_torque(p, marker, sign * d.lam[r], d.f)
        elif port.kind != AXIS:
            _, _, _, _, _, _, rx, ry = marker_motion(p, marker, q, v, a)
            px, py, vx, vy, ax, ay, d_rx, d_ry = marker_tangent(p, marker, q, v, a, d)
            d.rows[r] += sign * (weights[0] * ax + weights[1] * vx + weights[2] * px)
            d.rows[r + 1] += sign * (weights[0] * ay + weights[1] * vy + weights[2] * py)
            force = (sign * lam[r], sign * lam[r + 1])
            change = (sign * d.lam[r], sign * d.lam[r + 1])
            force_tangent(p, marker, q, force, change, (rx, ry), (d_rx, d_ry), d)


@inlined
def end_tangent(p, marker, q, v, a, d):
    """Changes of what `marker_motion` returns for one end of an axis or a line: zero on the ground."""
    if marker < 0:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    return marker_tangent(p, p.markers[marker], q, v, a, d)


@inlined
def component_tangent(ex, ey, at, change, w, dw, turn, d_w, d_dw):
    """Changes of what `axes.component` returns: `at` is d with its derivatives, `change` that of it, e turns by turn.

    e changes by turn E e, so that e . x changes by turn e x x + e . dx, and e x x by e x dx - turn e . x.
    """
    dx, dy, ux, uy, bx, by = at
    d_dx, d_dy, d_ux, d_uy, d_bx, d_by = change
    value, lever = ex * dx + ey * dy, ex * dy - ey * dx
    speed, cross = ex * ux + ey * uy, ex * uy - ey * ux
    d_value = turn * lever + ex * d_dx + ey * d_dy
    d_lever = ex * d_dy - ey * d_dx - turn * value
    d_speed = turn * cross + ex * d_ux + ey * d_uy
    d_cross = ex * d_uy - ey * d_ux - turn * speed
    d_rate = d_speed + d_w * lever + w * d_lever
    d_acceleration = turn * (ex * by - ey * bx) + ex * d_bx + ey * d_by
    d_acceleration += 2.0 * (d_w * cross + w * d_cross) + d_dw * lever + dw * d_lever
    d_acceleration -= 2.0 * w * d_w * value + w * w * d_value
    return d_value, d_rate, d_acceleration, d_lever


@routine
def track_sums(p, axis, x, vector):
    """W, W', W'' and W''' of a track at x, times the flexible part of a system vector."""
    track = p.tracks[axis.track]
    body = p.bodies[p.markers[axis.a].body]
    n = body.nf
    piece, z = track_piece(p, track, x)
    at = track.coefficients + piece * 6 * n
    sums = (0.0, 0.0, 0.0, 0.0)
    for j in range(n):
        value, slope, bend, third = 0.0, 0.0, 0.0, 0.0
        for power in range(5, -1, -1):
            third = third * z + 3.0 * bend
            bend = bend * z + 2.0 * slope
            slope = slope * z + value
            value = value * z + p.track_coefficients[at + j + power * n]
        u = vector[body.offset + 3 + j]
        sums = (sums[0] + value * u, sums[1] + slope * u, sums[2] + bend * u, sums[3] + third * u)
    return sums


@routine
def add_track_tangent(p, axis, x, d_x, force, d_force, d):
    """Subtract from d.f the change of force W(x) along a track."""
    track = p.tracks[axis.track]
    body = p.bodies[p.markers[axis.a].body]
    n = body.nf
    piece, z = track_piece(p, track, x)
    at = track.coefficients + piece * 6 * n
    for j in range(n):
        value, slope = 0.0, 0.0
        for power in range(5, -1, -1):
            slope = slope * z + value
            value = value * z + p.track_coefficients[at + j + power * n]
        d.f[body.offset + 3 + j] -= d_force * value + force * slope * d_x


@routine
def axis_tangent(p, k, q, v, a, d):
    """Of axis k: changes of value, rate and acceleration; e, its change; the lever, its change; x, its change.

    On a track as in `axes.axis_motion`: e and lever are those of the normal to the deflected beam.
    """
    axis = p.axes[k]
    at, theta, w, dw, _, _, _, _ = axis_frame(p, axis, q, v, a)
    pax, pay, vax, vay, aax, aay, _, _ = end_tangent(p, axis.a, q, v, a, d)
    pbx, pby, vbx, vby, abx, aby, _, _ = end_tangent(p, axis.b, q, v, a, d)
    change = (pbx - pax, pby - pay, vbx - vax, vby - vay, abx - aax, aby - aay)
    turn, d_w, d_dw = 0.0, 0.0, 0.0
    if axis.a >= 0:
        marker = p.markers[axis.a]
        turn, d_w, d_dw = marker_angle(p, marker, d.q), marker_angle(p, marker, d.v), marker_angle(p, marker, d.a)
    ex, ey = cos(theta), sin(theta)
    d_ex, d_ey = -turn * ey, turn * ex
    _, _, _, lever = component(ex, ey, at, w, dw)
    value_, rate_, acceleration_, d_lever = component_tangent(ex, ey, at, change, w, dw, turn, d_w, d_dw)
    x, d_x = 0.0, 0.0
    if axis.track >= 0:
        x, dx, ddx, across = component(ey, -ex, at, w, dw)
        d_x, d_dx, d_ddx, d_across = component_tangent(ey, -ex, at, change, w, dw, turn, d_w, d_dw)
        _, slope, bend, third = track_sums(p, axis, x, q)
        _, slope_v, bend_v, _ = track_sums(p, axis, x, v)
        _, slope_a, _, _ = track_sums(p, axis, x, a)
        W_dq, slope_dq, bend_dq, _ = track_sums(p, axis, x, d.q)
        W_dv, slope_dv, _, _ = track_sums(p, axis, x, d.v)
        W_da, _, _, _ = track_sums(p, axis, x, d.a)
        d_slope, d_bend = bend * d_x + slope_dq, third * d_x + bend_dq
        value_ -= slope * d_x + W_dq
        rate_ -= d_slope * dx + slope * d_dx + slope_v * d_x + W_dv
        acceleration_ -= d_slope * ddx + slope * d_ddx + d_bend * dx * dx + 2.0 * bend * dx * d_dx
        acceleration_ -= 2.0 * ((bend_v * d_x + slope_dv) * dx + slope_v * d_dx) + slope_a * d_x + W_da
        d_ex, d_ey = d_ex - d_slope * ey - slope * d_ey, d_ey + d_slope * ex + slope * d_ex
        ex, ey = ex - slope * ey, ey + slope * ex
        d_lever -= d_slope * across + slope * d_across
        lever -= slope * across
    return value_, rate_, acceleration_, ex, ey, d_ex, d_ey, lever, d_lever, x, d_x


@routine
def axes_tangent(p, weights, q, v, a, lam, torques, d):
    """Add the changes of the rows of all axes and of their forces, those of motors among them, to d.rows and d.f."""
    for k in range(p.axes.size):
        axis = p.axes[k]
        value, rate, acceleration, ex, ey, d_ex, d_ey, lever, d_lever, x, d_x = axis_tangent(p, k, q, v, a, d)
        d_force = 0.0
        if axis.row < 0:
            force = -torques[axis.signal]
        else:
            force, d_force = lam[axis.row], d.lam[axis.row]
            kind = p.rows[axis.row].kind
            if kind == CONSTRAINT:
                d.rows[axis.row] += weights[0] * acceleration + weights[1] * rate + weights[2] * value
            else:
                d.rows[axis.row] += value if kind == SPRING else rate
        fx, fy = force * ex, force * ey
        d_fx, d_fy = d_force * ex + force * d_ex, d_force * ey + force * d_ey
        _, _, _, _, _, _, rax, ray = end_tangent(p, axis.a, q, v, a, d)
        _, _, _, _, _, _, rbx, rby = end_tangent(p, axis.b, q, v, a, d)
        _, _, _, _, sax, say, sbx, sby = axis_frame(p, axis, q, v, a)
        if axis.b >= 0:
            force_tangent(p, p.markers[axis.b], q, (fx, fy), (d_fx, d_fy), (sbx, sby), (rbx, rby), d)
        if axis.a >= 0:
            marker = p.markers[axis.a]
            force_tangent(p, marker, q, (-fx, -fy), (-d_fx, -d_fy), (sax, say), (rax, ray), d)
            apply_torque(p, marker, d_force * lever + force * d_lever, d.f)
            if axis.track >= 0:
                add_track_tangent(p, axis, x, d_x, force, d_force, d)


@routine
def loads_tangent(p, q, d):
    """Subtract the change of the generalised forces of constant loads from d.f."""
    for k in range(p.loads.size):
        load = p.loads[k]
        marker = p.markers[load.marker]
        _, _, _, _, _, _, rx, ry = marker_motion(p, marker, q, q, q)
        _, _, _, _, _, _, d_rx, d_ry = marker_tangent(p, marker, q, q, q, d)
        force_tangent(p, marker, q, (-load.fx, -load.fy), (0.0, 0.0), (rx, ry), (d_rx, d_ry), d)


@routine
def lines_tangent(p, q, v, d):
    """Subtract the change of the generalised forces of springs and dampers between points from d.f."""
    for k in range(p.lines.size):
        line = p.lines[k]
        ax, ay, vax, vay, rax, ray = line_end(p, line.a, line.ax, line.ay, q, v)
        bx, by, vbx, vby, rbx, rby = line_end(p, line.b, line.bx, line.by, q, v)
        dx, dy = bx - ax, by - ay
        length = sqrt(dx * dx + dy * dy)
        # Without length there is no direction, and `line_state` has no force.
        if length == 0.0:
            continue
        d_ax, d_ay, d_vax, d_vay, _, _, d_rax, d_ray = end_tangent(p, line.a, q, v, v, d)
        d_bx, d_by, d_vbx, d_vby, _, _, d_rbx, d_rby = end_tangent(p, line.b, q, v, v, d)
        ex, ey, ux, uy = dx / length, dy / length, vbx - vax, vby - vay
        d_dx, d_dy = d_bx - d_ax, d_by - d_ay
        d_length = ex * d_dx + ey * d_dy
        d_ex, d_ey = (d_dx - ex * d_length) / length, (d_dy - ey * d_length) / length
        pull = line.stiffness * (length - line.length) + line.damping * (ex * ux + ey * uy)
        d_rate = d_ex * ux + d_ey * uy + ex * (d_vbx - d_vax) + ey * (d_vby - d_vay)
        d_pull = line.stiffness * d_length + line.damping * d_rate
        fx, fy = pull * ex, pull * ey
        d_fx, d_fy = d_pull * ex + pull * d_ex, d_pull * ey + pull * d_ey
        if line.a >= 0:
            force_tangent(p, p.markers[line.a], q, (-fx, -fy), (-d_fx, -d_fy), (rax, ray), (d_rax, d_ray), d)
        if line.b >= 0:
            force_tangent(p, p.markers[line.b], q, (fx, fy), (d_fx, d_fy), (rbx, rby), (d_rbx, d_rby), d)


@kernel
def note_slopes(p, q, v, rates, compliance, d):
    """Slopes of the rows of friction against the rate, into d.friction; `rates` is scratch (m,).

    `compliance` is what their residuals are multiplied by: see `joints.finish_friction`.
    """
    if not joint_rates(p, q, v, rates):
        return
    for r in range(p.rows.size):
        row = p.rows[r]
        if row.kind == FRICTION:
            c = cosh(min(abs(rates[r]) / (row.compliance * row.limit), 300.0))
            d.friction[r] = compliance[r] / (row.compliance * c * c)


@routine
def finish_rows(p, compliance, d):
    """Rows that are no constraints: their force takes part, and friction answers its rate with its slope."""
    for r in range(p.rows.size):
        kind = p.rows[r].kind
        if kind == FRICTION:
            d.rows[r] = d.friction[r] * d.rows[r] - compliance[r] * d.lam[r]
        elif kind != CONSTRAINT:
            d.rows[r] -= p.rows[r].compliance * d.lam[r]


@kernel
def residual_tangent(p, weights, q, v, a, lam, torques, compliance, first, last, d):
    """Change of the residuals along a direction, d.f and d.rows.

    Parameters
    ----------
    weights : tuple of 3 float
        Of Phi'', Phi' and Phi in the rows of constraints: (1, 2 alpha, beta^2) for those of `equations`.
    torques : (motors,) array
        As `equations` left them.
    compliance : (m,) array
        That of the workspace the residuals were found with.
    first, last : int
        Bodies from first to before last; the direction is zero in the coordinates of all others, and in d.lam unless
        these are all bodies.
    d : Tangent
        Its direction is read, d.f and d.rows are written; `note_slopes` has been called at (q, v).
    """
    fill(d.f, 0.0)
    fill(d.rows, 0.0)
    for i in range(first, last):
        body_terms_tangent(p, i, q, v, a, d, d.points)
        joints_tangent(p, i, weights, q, v, a, lam, d)
    axes_tangent(p, weights, q, v, a, lam, torques, d)
    finish_rows(p, compliance, d)
    loads_tangent(p, q, d)
    lines_tangent(p, q, v, d)


@kernel
def reaction_tangent(p, weights, q, v, a, lam, idle, first, last, d):
    """Change of Phi_q^T lambda, into d.f, and of the rows, into d.rows, without any other force.

    Along d.lam alone d.f is Phi_q^T d.lam. `idle` (motors,) is zero; else as for `residual_tangent`.
    """
    fill(d.f, 0.0)
    fill(d.rows, 0.0)
    for i in range(first, last):
        joints_tangent(p, i, weights, q, v, a, lam, d)
    axes_tangent(p, weights, q, v, a, lam, idle, d)
