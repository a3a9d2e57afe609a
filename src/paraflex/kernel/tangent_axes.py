"""Changes of joints along a line and of their forces along a direction: see `kernel.tangent`."""

from math import cos, sin

from .axes import axis_frame, component, line_turn, track_deflection, track_piece, track_row
from .compiling import inlined, routine
from .joints import apply_torque, marker_angles, row_part
from .tangent_points import end_tangent, force_tangent


@inlined
def component_tangent(ex, ey, at, change, w, dw, turn, d_w, d_dw):
    """Return the changes of the results of `axes.component`.

    `at` is d with its derivatives, `change` their changes, and `turn` is the rotation of e. e changes by turn E e, so
    that e . x changes by turn e x x + e . dx, and e x x by e x dx - turn e . x.
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
def add_track_tangent(system, axis, x, d_x, force, d_force, direction):
    """Subtract the change of force W(x) along a track from direction.f."""
    owner, at, z = track_piece(system, axis, x)
    body = system.bodies[owner]
    for j in range(body.nf):
        value, slope, _, _ = track_row(system, at + j, body.nf, z)
        direction.f[body.offset + 3 + j] -= d_force * value + force * slope * d_x


@inlined
def frame_tangent(system, axis, at, q, v, a, direction):
    """Return the changes of the results of `axes.axis_frame`, the first of which is `at`."""
    pax, pay, vax, vay, aax, aay, d_rax, d_ray = end_tangent(system, axis.a, q, v, a, direction)
    pbx, pby, vbx, vby, abx, aby, d_rbx, d_rby = end_tangent(system, axis.b, q, v, a, direction)
    change = (pbx - pax, pby - pay, vbx - vax, vby - vay, abx - aax, aby - aay)
    turn, d_w, d_dw = 0.0, 0.0, 0.0
    if axis.a >= 0:
        turn, d_w, d_dw = marker_angles(system, system.markers[axis.a], direction.q, direction.v, direction.a)
    if axis.between:
        # As n . d is zero, the second derivative is stationary in w and does not depend on dw.
        turn, d_w, d_dw = line_turn(at[0], at[1], change[0], change[1]), 0.0, 0.0
    return change, turn, d_w, d_dw, d_rax, d_ray, d_rbx, d_rby


@routine
def axis_tangent(system, k, q, v, a, direction):
    """Return the changes for axis k: of value, rate and acceleration; e, its change; lever, its change; x, its change.

    R s of both ends and its changes follow, four numbers each. On a track, as in `axes.axis_motion`, e and lever are
    those of the normal to the deflected beam.
    """
    axis = system.axes[k]
    at, theta, w, dw, rax, ray, rbx, rby = axis_frame(system, axis, q, v, a)
    change, turn, d_w, d_dw, d_rax, d_ray, d_rbx, d_rby = frame_tangent(system, axis, at, q, v, a, direction)
    ex, ey = cos(theta), sin(theta)
    d_ex, d_ey = -turn * ey, turn * ex
    _, _, _, lever = component(ex, ey, at, w, dw)
    value_, rate_, acceleration_, d_lever = component_tangent(ex, ey, at, change, w, dw, turn, d_w, d_dw)
    x, d_x = 0.0, 0.0
    if axis.track >= 0:
        x, dx, ddx, across = component(ey, -ex, at, w, dw)
        d_x, d_dx, d_ddx, d_across = component_tangent(ey, -ex, at, change, w, dw, turn, d_w, d_dw)
        _, slope, bend, third = track_deflection(system, axis, x, q)
        _, slope_v, bend_v, _ = track_deflection(system, axis, x, v)
        _, slope_a, _, _ = track_deflection(system, axis, x, a)
        W_dq, slope_dq, bend_dq, _ = track_deflection(system, axis, x, direction.q)
        W_dv, slope_dv, _, _ = track_deflection(system, axis, x, direction.v)
        W_da, _, _, _ = track_deflection(system, axis, x, direction.a)
        d_slope, d_bend = bend * d_x + slope_dq, third * d_x + bend_dq
        value_ -= slope * d_x + W_dq
        rate_ -= d_slope * dx + slope * d_dx + slope_v * d_x + W_dv
        acceleration_ -= d_slope * ddx + slope * d_ddx + d_bend * dx * dx + 2.0 * bend * dx * d_dx
        acceleration_ -= 2.0 * ((bend_v * d_x + slope_dv) * dx + slope_v * d_dx) + slope_a * d_x + W_da
        d_ex, d_ey = d_ex - d_slope * ey - slope * d_ey, d_ey + d_slope * ex + slope * d_ex
        ex, ey = ex - slope * ey, ey + slope * ex
        d_lever -= d_slope * across + slope * d_across
        lever -= slope * across
    ends, d_ends = (rax, ray, rbx, rby), (d_rax, d_ray, d_rbx, d_rby)
    return value_, rate_, acceleration_, ex, ey, d_ex, d_ey, lever, d_lever, x, d_x, ends, d_ends


@routine
def axes_tangent(system, weights, q, v, a, lam, torques, direction):
    """Add the changes of the rows of all axes to direction.rows, and those of their forces to direction.f.

    The forces include those of motors.
    """
    for k in range(system.axes.size):
        axis = system.axes[k]
        value, rate, acceleration, ex, ey, d_ex, d_ey, lever, d_lever, x, d_x, ends, d_ends = axis_tangent(
            system, k, q, v, a, direction
        )
        d_force = 0.0
        if axis.row < 0:
            force = -torques[axis.signal]
        else:
            force, d_force = axis.weight * lam[axis.row], axis.weight * direction.lam[axis.row]
            part = row_part(system.rows[axis.row].kind, weights, (value, rate, acceleration))
            direction.rows[axis.row] += axis.weight * part
        fx, fy = force * ex, force * ey
        d_fx, d_fy = d_force * ex + force * d_ex, d_force * ey + force * d_ey
        if axis.b >= 0:
            force_tangent(system, system.markers[axis.b], q, (fx, fy), (d_fx, d_fy), ends[2:], d_ends[2:], direction)
        if axis.a >= 0:
            marker = system.markers[axis.a]
            force_tangent(system, marker, q, (-fx, -fy), (-d_fx, -d_fy), ends[:2], d_ends[:2], direction)
            apply_torque(system, marker, d_force * lever + force * d_lever, direction.f)
            if axis.track >= 0:
                add_track_tangent(system, axis, x, d_x, force, d_force, direction)
