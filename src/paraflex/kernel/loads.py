"""Forces and torques at points: constant, in time or by laws over the motion; their power and their changes."""

from .compiling import inlined, kernel, routine
from .joints import apply_force, apply_torque, marker_angle, marker_motion
from .laws import law_change, law_value
from .tangent_points import force_tangent, marker_tangent


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
    return fx, fy, part_at(system, load.torque, load.torque_signal, q, v, torques, registers)


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
        for k in range(system.loads.size):
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
        force_tangent(system, marker, q, (-fx, -fy), (-d_fx, -d_fy), (rx, ry), (d_rx, d_ry), direction)
        apply_torque(system, marker, -d_torque, direction.f)
