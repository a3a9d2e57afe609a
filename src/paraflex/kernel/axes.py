"""Joints along a line: a point of one body measured along an axis that another body carries.

Let d = p_b - p_a, e the unit vector at the angle theta (that of marker a plus a constant), and n = E e. The value of
the axis is e . d, its rate e . d' + theta' n . d, and its second derivative e . d'' + 2 theta' n . d' + theta'' n . d -
theta'^2 e . d. A slot keeps the value along the normal at zero; motors, springs and prescribed motions of a prismatic
joint act on its travel. A sliding joint keeps the value along the normal equal to the deflection W(x) u of the beam
below the point, a *track*. A distance joint prescribes the value |d| of an axis *between* its points: e = d/|d|, theta'
= e x d'/|d|, n . d = 0.
"""

from math import atan2, cos, sin

from .compiling import inlined, kernel, routine
from .joints import apply_force, apply_torque, end_motion, marker_angles, row_part
from .packed import CONSTRAINT


@inlined
def line_turn(dx, dy, ux, uy):
    """Return the angular velocity of a line d with the rate of change u; zero for a line of zero length."""
    square = dx * dx + dy * dy
    return (dx * uy - dy * ux) / square if square > 0.0 else 0.0


@inlined
def axis_frame(system, axis, q, v, a):
    """Return the geometry of an axis: d and the angle theta with two derivatives each, and R s of both ends."""
    pax, pay, vax, vay, aax, aay, rax, ray = end_motion(system, axis.a, axis.ax, axis.ay, q, v, a)
    pbx, pby, vbx, vby, abx, aby, rbx, rby = end_motion(system, axis.b, axis.bx, axis.by, q, v, a)
    theta, w, dw = axis.angle, 0.0, 0.0
    if axis.a >= 0:
        angle, w, dw = marker_angles(system, system.markers[axis.a], q, v, a)
        theta += angle
    d = (pbx - pax, pby - pay, vbx - vax, vby - vay, abx - aax, aby - aay)
    if axis.between:
        # The second derivative of the value does not depend on that of theta, as n . d is zero.
        theta, w, dw = atan2(d[1], d[0]), line_turn(d[0], d[1], d[2], d[3]), 0.0
    return d, theta, w, dw, rax, ray, rbx, rby


@inlined
def component(ex, ey, d, w, dw):
    """Return value, rate and second derivative of e . d, and n . d, for a vector e with the angular velocity w."""
    dx, dy, ux, uy, bx, by = d
    value, lever = ex * dx + ey * dy, ex * dy - ey * dx
    rate = ex * ux + ey * uy + w * lever
    acceleration = ex * bx + ey * by + 2.0 * w * (ex * uy - ey * ux) + dw * lever - w * w * value
    return value, rate, acceleration, lever


@routine
def axis_motion(system, k, q, v, a):
    """Return value, rate and acceleration of axis k, e, n . d, R s of both ends, and the place on its track.

    On a track the value is that along the normal less the deflection W(x) u at the point's place: to first order e
    becomes e + (W' u) E e, and the flexible coordinates have the coefficients -W.
    """
    axis = system.axes[k]
    d, theta, w, dw, rax, ray, rbx, rby = axis_frame(system, axis, q, v, a)
    ex, ey = cos(theta), sin(theta)
    value, rate, acceleration, lever = component(ex, ey, d, w, dw)
    x = 0.0
    if axis.track >= 0:
        # e is normal to the beam's axis, (ey, -ex) points along it.
        x, dx, ddx, across = component(ey, -ex, d, w, dw)
        W_u, slope, bend, _ = track_deflection(system, axis, x, q)
        W_v, slope_v, _, _ = track_deflection(system, axis, x, v)
        W_a, _, _, _ = track_deflection(system, axis, x, a)
        value -= W_u
        rate -= slope * dx + W_v
        acceleration -= slope * ddx + bend * dx * dx + 2.0 * slope_v * dx + W_a
        ex, ey = ex - slope * ey, ey + slope * ex
        lever -= slope * across
    return value, rate, acceleration, ex, ey, lever, rax, ray, rbx, rby, x


@inlined
def track_piece(system, axis, x):
    """Return the body of an axis's track, the first coefficient of the piece at x, and the distance from its start.

    The end pieces are extrapolated beyond the ends.
    """
    track, owner, piece = system.tracks[axis.track], system.markers[axis.a].body, 0
    while piece < track.pieces - 1 and x > system.track_breaks[track.first + piece + 1]:
        piece += 1
    first = track.coefficients + piece * 6 * system.bodies[owner].nf
    return owner, first, x - system.track_breaks[track.first + piece]


@inlined
def track_row(system, at, stride, z):
    """Return one entry of W and its three derivatives: a quintic polynomial in z, with coefficients `stride` apart."""
    value, slope, bend, third = 0.0, 0.0, 0.0, 0.0
    for power in range(5, -1, -1):
        third = third * z + 3.0 * bend
        bend = bend * z + 2.0 * slope
        slope = slope * z + value
        value = value * z + system.track_coefficients[at + power * stride]
    return value, slope, bend, third


@routine
def track_deflection(system, axis, x, vector):
    """Return W(x) of a track and its three derivatives, times the flexible part of a system vector."""
    owner, at, z = track_piece(system, axis, x)
    body = system.bodies[owner]
    total, slope, bend, third = 0.0, 0.0, 0.0, 0.0
    for j in range(body.nf):
        w0, w1, w2, w3 = track_row(system, at + j, body.nf, z)
        u = vector[body.offset + 3 + j]
        total += w0 * u
        slope += w1 * u
        bend += w2 * u
        third += w3 * u
    return total, slope, bend, third


@routine
def add_track(system, k, x, scale, row, at):
    """Add scale W(x) of axis k to row[at:]."""
    owner, start, z = track_piece(system, system.axes[k], x)
    nf = system.bodies[owner].nf
    for j in range(nf):
        row[at + j] += scale * track_row(system, start + j, nf, z)[0]


@routine
def apply_axis(system, k, q, force, ex, ey, lever, rax, ray, rbx, rby, x, f):
    """Add to f the generalised force J^T force of axis k."""
    axis = system.axes[k]
    if axis.b >= 0:
        apply_force(system, system.markers[axis.b], q, force * ex, force * ey, rbx, rby, f)
    if axis.a >= 0:
        marker = system.markers[axis.a]
        apply_force(system, marker, q, -force * ex, -force * ey, rax, ray, f)
        apply_torque(system, marker, force * lever, f)
        if axis.track >= 0:
            add_track(system, k, x, -force, f, system.bodies[marker.body].offset + 3)


@kernel
def apply_axes(system, q, v, a, lam, weights, torques, f, rows):
    """Add the rows of all axes to rows and their forces to f, and subtract the forces of motors along axes from f."""
    for k in range(system.axes.size):
        axis = system.axes[k]
        value, rate, acceleration, ex, ey, lever, rax, ray, rbx, rby, x = axis_motion(system, k, q, v, a)
        if axis.row < 0:
            force = -torques[axis.signal]
        else:
            force = axis.weight * lam[axis.row]
            rows[axis.row] += axis.weight * row_part(system.rows[axis.row].kind, weights, (value, rate, acceleration))
        apply_axis(system, k, q, force, ex, ey, lever, rax, ray, rbx, rby, x, f)


@routine
def axis_values(system, q, v, phi, dphi):
    """Add value and rate of the axes that are constraints to phi and dphi."""
    for k in range(system.axes.size):
        row, weight = system.axes[k].row, system.axes[k].weight
        if row >= 0 and system.rows[row].kind == CONSTRAINT:
            value, rate, _, _, _, _, _, _, _, _, _ = axis_motion(system, k, q, v, v)
            phi[row] += weight * value
            dphi[row] += weight * rate


@routine
def fill_axis_rows(system, q, jacobian):
    """Add the rows of the axes that are constraints to a dense Jacobian."""
    for k in range(system.axes.size):
        row, weight = system.axes[k].row, system.axes[k].weight
        if row >= 0 and system.rows[row].kind == CONSTRAINT:
            _, _, _, ex, ey, lever, rax, ray, rbx, rby, x = axis_motion(system, k, q, q, q)
            apply_axis(system, k, q, weight, ex, ey, lever, rax, ray, rbx, rby, x, jacobian[row])


@routine
def turn_axes(system, q, axes):
    """Compute direction and lever of every axis at q, for the iteration matrix, and the places of sliding points."""
    for k in range(system.axes.size):
        _, _, _, ex, ey, lever, _, _, _, _, x = axis_motion(system, k, q, q, q)
        axes[k, 0], axes[k, 1], axes[k, 2], axes[k, 3] = ex, ey, lever, x


@routine
def axis_power(system, q, v, torques):
    """Return the power of the motors along axes."""
    power = 0.0
    for k in range(system.axes.size):
        if system.axes[k].row < 0:
            _, rate, _, _, _, _, _, _, _, _, _ = axis_motion(system, k, q, v, v)
            power += torques[system.axes[k].signal] * rate
    return power
