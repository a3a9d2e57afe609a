"""Constraints of the whole system: values, Jacobian, and rates and slopes of compliant rows."""

from math import cosh

from . import joints
from .arrays import fill
from .axes import apply_axes, axis_motion, axis_values, fill_axis_rows
from .compiling import inlined, kernel, routine, unoptimised
from .packed import ANGLE, AXIS, CONSTRAINT, DAMPER, FRICTION, INDEX_1
from .signals import evaluate_signal
from .sums import body_sums

# Sliding friction has nearly zero slope: to keep its compliance finite, the slope is at least this fraction of the
# steepest.
FLATTEST = 1e-9


@unoptimised
def constraint_values(system, signals, t, q, v, scratch, phi, dphi):
    """Compute Phi and Phi' at (t, q, v) into phi and dphi; zero in rows that are not constraints."""
    for r in range(system.rows.size):
        row = system.rows[r]
        phi[r], dphi[r] = row.ground if row.kind == CONSTRAINT else 0.0, 0.0
        if row.signal >= 0:
            value, rate, _ = evaluate_signal(signals, row.signal, t)
            phi[r] -= value
            dphi[r] -= rate
    for i in range(system.bodies.size):
        # Accelerations are not used here: v serves as an array of the right length.
        body_sums(system, i, q, v, v, scratch)
        for k in range(system.bodies[i].port, system.bodies[i].port_end):
            port = system.ports[k]
            r, weight = port.row, port.weight
            if system.rows[r].kind != CONSTRAINT or port.kind == AXIS:
                continue
            if port.kind == ANGLE:
                angle, rate, _ = joints.angle_by_sums(system, system.markers[port.marker], q, v, v, scratch)
                phi[r] += weight * angle
                dphi[r] += weight * rate
            else:
                px, py, vx, vy, _, _, _, _ = joints.motion_by_sums(
                    system, system.markers[port.marker], q, v, v, scratch
                )
                phi[r] += weight * px
                phi[r + 1] += weight * py
                dphi[r] += weight * vx
                dphi[r + 1] += weight * vy
    axis_values(system, q, v, phi, dphi)


@unoptimised
def fill_jacobian(system, q, jacobian):
    """Compute Phi_q into a dense (rows, n) array, zero in rows that are not constraints; not for the time loop."""
    for r in range(system.rows.size):
        fill(jacobian[r], 0.0)
    for k in range(system.ports.size):
        port = system.ports[k]
        marker = system.markers[port.marker]
        if system.rows[port.row].kind != CONSTRAINT:
            continue
        if port.kind == ANGLE:
            joints.apply_torque(system, marker, port.weight, jacobian[port.row])
        elif port.kind != AXIS:
            _, _, _, _, _, _, rx, ry = joints.marker_motion(system, marker, q, q, q)
            joints.apply_force(system, marker, q, port.weight, 0.0, rx, ry, jacobian[port.row])
            joints.apply_force(system, marker, q, 0.0, port.weight, rx, ry, jacobian[port.row + 1])
    fill_axis_rows(system, q, jacobian)


@kernel
def add_reactions(system, q, lam, torques, f, rows, scratch):
    """Add Phi_q^T lambda to f at every sample of a motion.

    q, lam, f : (instants, n), (instants, m) and (instants, n) arrays; torques : (acting,) zeros; rows : (m,) scratch.
    """
    for k in range(q.shape[0]):
        for i in range(system.bodies.size):
            joints.body_joints(system, i, q[k], q[k], q[k], lam[k], INDEX_1, scratch, f[k], rows)
        apply_axes(system, q[k], q[k], q[k], lam[k], INDEX_1, torques, f[k], rows)


@inlined
def damped(kind):
    """Return whether rows of a kind contain the rate of a joint."""
    return kind in (DAMPER, FRICTION)


@routine
def joint_rates(system, q, v, rates):
    """Compute the joint rates of dampers and friction into their entries of rates; return whether there are any."""
    some = False
    for r in range(system.rows.size):
        if damped(system.rows[r].kind):
            rates[r], some = 0.0, True
    if not some:
        return False
    for k in range(system.ports.size):
        port = system.ports[k]
        if port.kind == ANGLE and damped(system.rows[port.row].kind):
            rates[port.row] += port.weight * joints.marker_angle(system, system.markers[port.marker], v)
    for k in range(system.axes.size):
        row = system.axes[k].row
        if row >= 0 and damped(system.rows[row].kind):
            rates[row] += system.axes[k].weight * axis_motion(system, k, q, v, v)[1]
    return True


@routine
def dissipated_power(system, q, v, lam, rates):
    """Return the power of dampers and friction; `rates` is scratch (m,)."""
    power = 0.0
    if not joint_rates(system, q, v, rates):
        return power
    for r in range(system.rows.size):
        if damped(system.rows[r].kind):
            power += lam[r] * rates[r]
    return power


@kernel
def note_friction(system, q, v, rates, compliance):
    """Compute inverse slopes of friction at the rates in v, for the iteration matrix; return whether there is any.

    `rates` (m,) is scratch, `compliance` (m,) is written.
    """
    some = False
    if not joint_rates(system, q, v, rates):
        return some
    for r in range(system.rows.size):
        row = system.rows[r]
        if row.kind == FRICTION:
            # d tanh(x) / dx = 1 / cosh^2 x; beyond x = 20 it is below rounding.
            c = cosh(min(abs(rates[r]) / (row.compliance * row.limit), 20.0))
            compliance[r], some = row.compliance / max(1.0 / (c * c), FLATTEST), True
    return some
