"""Joints along a line: a point of one body measured along an axis that another carries.

With d = p_b - p_a and the unit vector e at the angle theta of marker a (and a constant), the value is e . d, and with
n = E e: rate e . d' + theta' n . d, second derivative e . d'' + 2 theta' n . d' + theta'' n . d - theta'^2 e . d. A
slot holds the value of the normal at zero; motors, springs and prescribed motions of a prismatic joint take its travel.
"""

from __future__ import annotations

from math import cos, sin

from paraflex.kernel.compiling import inlined, kernel, routine
from paraflex.kernel.joints import apply_force, apply_torque, marker_angle, marker_motion
from paraflex.kernel.packed import CONSTRAINT, SPRING


@inlined
def axis_end(p, marker, x, y, q, v, a):
    """Position, velocity and acceleration of one end of an axis, and R s there: zero on the ground."""
    if marker < 0:
        return x, y, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    return marker_motion(p, p.markers[marker], q, v, a)


@routine
def axis_motion(p, k, q, v, a):
    """Of axis k: value, rate and acceleration, e, n . d, and R s of both ends."""
    axis = p.axes[k]
    pax, pay, vax, vay, aax, aay, rax, ray = axis_end(p, axis.a, axis.ax, axis.ay, q, v, a)
    pbx, pby, vbx, vby, abx, aby, rbx, rby = axis_end(p, axis.b, axis.bx, axis.by, q, v, a)
    theta, w, dw = axis.angle, 0.0, 0.0
    if axis.a >= 0:
        marker = p.markers[axis.a]
        theta += marker_angle(p, marker, q)
        w, dw = marker_angle(p, marker, v), marker_angle(p, marker, a)
    ex, ey = cos(theta), sin(theta)
    dx, dy, ux, uy, bx, by = pbx - pax, pby - pay, vbx - vax, vby - vay, abx - aax, aby - aay
    value, lever = ex * dx + ey * dy, ex * dy - ey * dx
    rate = ex * ux + ey * uy + w * lever
    acceleration = ex * bx + ey * by + 2.0 * w * (ex * uy - ey * ux) + dw * lever - w * w * value
    return value, rate, acceleration, ex, ey, lever, rax, ray, rbx, rby


@routine
def apply_axis(p, k, q, force, ex, ey, lever, rax, ray, rbx, rby, f):
    """Add to f the generalised force J^T force of axis k."""
    axis = p.axes[k]
    if axis.b >= 0:
        apply_force(p, p.markers[axis.b], q, force * ex, force * ey, rbx, rby, f)
    if axis.a >= 0:
        marker = p.markers[axis.a]
        apply_force(p, marker, q, -force * ex, -force * ey, rax, ray, f)
        apply_torque(p, marker, force * lever, f)


@kernel
def apply_axes(p, q, v, a, lam, weight_v, weight_q, torques, f, rows):
    """Add the rows of all axes and their forces to rows and f, and subtract the forces of motors along them from f."""
    for k in range(p.axes.size):
        axis = p.axes[k]
        value, rate, acceleration, ex, ey, lever, rax, ray, rbx, rby = axis_motion(p, k, q, v, a)
        if axis.row < 0:
            force = -torques[axis.signal]
        else:
            force = lam[axis.row]
            kind = p.rows[axis.row].kind
            if kind == CONSTRAINT:
                rows[axis.row] += acceleration + weight_v * rate + weight_q * value
            else:
                rows[axis.row] += value if kind == SPRING else rate
        apply_axis(p, k, q, force, ex, ey, lever, rax, ray, rbx, rby, f)


@routine
def axis_values(p, q, v, phi, dphi):
    """Add value and rate of the axes that are constraints to phi and dphi."""
    for k in range(p.axes.size):
        row = p.axes[k].row
        if row >= 0:
            if p.rows[row].kind == CONSTRAINT:
                value, rate, _, _, _, _, _, _, _, _ = axis_motion(p, k, q, v, v)
                phi[row] += value
                dphi[row] += rate


@routine
def fill_axis_rows(p, q, jacobian):
    """Rows of the axes that are constraints into a dense Jacobian."""
    for k in range(p.axes.size):
        row = p.axes[k].row
        if row >= 0:
            if p.rows[row].kind == CONSTRAINT:
                _, _, _, ex, ey, lever, rax, ray, rbx, rby = axis_motion(p, k, q, q, q)
                apply_axis(p, k, q, 1.0, ex, ey, lever, rax, ray, rbx, rby, jacobian[row])


@routine
def turn_axes(p, q, axes):
    """Direction and lever of every axis at q, for the iteration matrix."""
    for k in range(p.axes.size):
        _, _, _, ex, ey, lever, _, _, _, _ = axis_motion(p, k, q, q, q)
        axes[k, 0], axes[k, 1], axes[k, 2] = ex, ey, lever


@routine
def axis_power(p, q, v, torques):
    """Power of the motors along axes."""
    power = 0.0
    for k in range(p.axes.size):
        if p.axes[k].row < 0:
            _, rate, _, _, _, _, _, _, _, _ = axis_motion(p, k, q, v, v)
            power += torques[p.axes[k].signal] * rate
    return power
