"""Forces and torques at points and between them: constant, in time or by laws over the motion; power and changes."""

from math import sqrt

from .compiling import inlined, kernel, routine
from .joints import apply_force, apply_torque, end_motion, line_state, marker_angle, marker_motion
from .laws import law_change, law_value
from .tangent_points import end_tangent, force_tangent, marker_tangent


@inlined
def part_at(system, number, signal, q, v, torques, registers):
    """Return a component of a load, a number unless it has a signal or a law."""
    if signal >= 0:
        return torques[signal]
    return number if signal == -1 else law_value(system, -2 - signal, q, v, torques, registers)


@routine
def load_at(system, load, q, v, torques, registers):
    """Return force and torque of a load: (fx, fy, torque)."""
    fx = part_at(system, load.fx, load.x_signal, q, v, torques, registers)
    fy = part_at(system, load.fy, load.y_signal, q, v, torques, registers)
    torque = part_at(system, load.torque, load.torque_signal, q, v, torques, registers)
    return load.sign * fx, load.sign * fy, load.sign * torque


@routine
def apply_loads(system, q, v, torques, registers, f):
    """Subtract the generalised forces of loads from f; `torques` has the time-dependent components."""
    for k in range(system.loads.size):
        load = system.loads[k]
        marker = system.markers[load.marker]
        fx, fy, torque = load_at(system, load, q, v, torques, registers)
        _, _, _, _, _, _, rx, ry = marker_motion(system, marker, q, q, q)
        apply_force(system, marker, q, -fx, -fy, rx, ry, f)
        apply_torque(system, marker, -torque, f)


@routine
def load_power(system, q, v, torques, registers):
    """Return the power of the loads."""
    power = 0.0
    for k in range(system.loads.size):
        load = system.loads[k]
        marker = system.markers[load.marker]
        fx, fy, torque = load_at(system, load, q, v, torques, registers)
        _, _, vx, vy, _, _, _, _ = marker_motion(system, marker, q, v, v)
        power += fx * vx + fy * vy + torque * marker_angle(system, marker, v)
    return power


@kernel
def loads_along(system, q, v, torques, registers, out):
    """Compute forces and torques of all loads into out (instants, loads, 3) along a motion (instants, n)."""
    for i in range(q.shape[0]):
        for k in range(out.shape[1]):
            out[i, k, 0], out[i, k, 1], out[i, k, 2] = load_at(
                system, system.loads[k], q[i], v[i], torques[i], registers
            )


@inlined
def part_tangent(system, number, signal, q, v, torques, direction):
    """Return a component of a load and its change."""
    if signal >= 0:
        return torques[signal], 0.0
    if signal == -1:
        return number, 0.0
    return law_change(system, -2 - signal, q, v, torques, direction)


@routine
def loads_tangent(system, q, v, torques, direction):
    """Subtract the change of the generalised forces of loads from direction.f."""
    for k in range(system.loads.size):
        load = system.loads[k]
        marker = system.markers[load.marker]
        _, _, _, _, _, _, rx, ry = marker_motion(system, marker, q, q, q)
        _, _, _, _, _, _, d_rx, d_ry = marker_tangent(system, marker, q, q, q, direction)
        fx, d_fx = part_tangent(system, load.fx, load.x_signal, q, v, torques, direction)
        fy, d_fy = part_tangent(system, load.fy, load.y_signal, q, v, torques, direction)
        _, d_torque = part_tangent(system, load.torque, load.torque_signal, q, v, torques, direction)
        force, change = (-load.sign * fx, -load.sign * fy), (-load.sign * d_fx, -load.sign * d_fy)
        force_tangent(system, marker, q, force, change, (rx, ry), (d_rx, d_ry), direction)
        apply_torque(system, marker, -load.sign * d_torque, direction.f)


@routine
def apply_lines(system, q, v, torques, registers, f):
    """Subtract the generalised forces of springs and dampers between points from f."""
    for k in range(system.lines.size):
        line = system.lines[k]
        stretch, rate, ex, ey = line_state(system, k, q, v)
        pull = line.stiffness * stretch + line.damping * rate
        if line.law >= 0:
            pull += law_value(system, line.law, q, v, torques, registers)
        if line.a >= 0:
            marker = system.markers[line.a]
            _, _, _, _, _, _, rx, ry = marker_motion(system, marker, q, v, v)
            apply_force(system, marker, q, -pull * ex, -pull * ey, rx, ry, f)
        if line.b >= 0:
            marker = system.markers[line.b]
            _, _, _, _, _, _, rx, ry = marker_motion(system, marker, q, v, v)
            apply_force(system, marker, q, pull * ex, pull * ey, rx, ry, f)


@kernel
def lines_along(system, q, v, registers, out):
    """Compute the forces of characteristics of springs into out (instants, springs) along a motion (instants, n)."""
    for i in range(q.shape[0]):
        for k in range(system.lines.size):
            if system.lines[k].law >= 0:
                out[i, k] = law_value(system, system.lines[k].law, q[i], v[i], registers, registers)


@routine
def line_power(system, q, v, torques, registers):
    """Return the power of the characteristics of springs between points."""
    power = 0.0
    for k in range(system.lines.size):
        line = system.lines[k]
        if line.law >= 0:
            power -= law_value(system, line.law, q, v, torques, registers) * line_state(system, k, q, v)[1]
    return power


@routine
def lines_tangent(system, q, v, torques, direction):
    """Subtract the change of the generalised forces of springs and dampers between points from direction.f."""
    for k in range(system.lines.size):
        line = system.lines[k]
        ax, ay, vax, vay, _, _, rax, ray = end_motion(system, line.a, line.ax, line.ay, q, v, v)
        bx, by, vbx, vby, _, _, rbx, rby = end_motion(system, line.b, line.bx, line.by, q, v, v)
        dx, dy = bx - ax, by - ay
        length = sqrt(dx * dx + dy * dy)
        # A line of zero length has no direction, and no force in `line_state`.
        if length == 0.0:
            continue
        d_ax, d_ay, d_vax, d_vay, _, _, d_rax, d_ray = end_tangent(system, line.a, q, v, v, direction)
        d_bx, d_by, d_vbx, d_vby, _, _, d_rbx, d_rby = end_tangent(system, line.b, q, v, v, direction)
        ex, ey, ux, uy = dx / length, dy / length, vbx - vax, vby - vay
        d_dx, d_dy = d_bx - d_ax, d_by - d_ay
        d_length = ex * d_dx + ey * d_dy
        d_ex, d_ey = (d_dx - ex * d_length) / length, (d_dy - ey * d_length) / length
        pull = line.stiffness * (length - line.length) + line.damping * (ex * ux + ey * uy)
        d_rate = d_ex * ux + d_ey * uy + ex * (d_vbx - d_vax) + ey * (d_vby - d_vay)
        d_pull = line.stiffness * d_length + line.damping * d_rate
        if line.law >= 0:
            tension, d_tension = law_change(system, line.law, q, v, torques, direction)
            pull, d_pull = pull + tension, d_pull + d_tension
        fx, fy = pull * ex, pull * ey
        d_fx, d_fy = d_pull * ex + pull * d_ex, d_pull * ey + pull * d_ey
        if line.a >= 0:
            force_tangent(
                system, system.markers[line.a], q, (-fx, -fy), (-d_fx, -d_fy), (rax, ray), (d_rax, d_ray), direction
            )
        if line.b >= 0:
            force_tangent(
                system, system.markers[line.b], q, (fx, fy), (d_fx, d_fy), (rbx, rby), (d_rbx, d_rby), direction
            )
