"""Terms of joints and motors: constraints with two derivatives, constraint forces, motor torques.

A marker has the position p = r + R s with s = x0 + N u, and the acceleration
p'' = r'' + R (phi'' E s - phi'^2 s + 2 phi' E N u' + N u''), so the velocity-dependent part of the constraint on
accelerations needs no separate formula. A marker's angle is phi + N2' u. In second-order geometry s, N u' and N u'' are
reduced by f/2, f'/2 and f''/2 along x.
"""

from math import cos, sin, sqrt, tanh

from .compiling import inlined, kernel, routine
from .packed import ANGLE, AXIS, CONSTRAINT, DAMPING, FRICTION, NX, NY, SLOPE, SPRING
from .signals import evaluate_signal
from .sums import body_sums, clear_shares, hand_on
from .vectors import LANES, add_scaled, load, store, zeros


@inlined
def marker_shape(system, marker, vector):
    """Return the body-frame displacement N z of a marker for the flexible part of a system vector z (q, v or a)."""
    body = system.bodies[marker.body]
    e, k = body.offset + 3, marker.shape
    x, y = 0.0, 0.0
    for j in range(body.nf):
        x += system.shape[NX, k + j] * vector[e + j]
        y += system.shape[NY, k + j] * vector[e + j]
    return x, y


@inlined
def marker_shortening(system, bending, marker, q, v, a):
    """Return halves of f, f' and f'' of a marker, its displacement by bending towards the beam's first end.

    `bending` is system.bending, None for linear geometry.
    """
    f0, f1, f2 = 0.0, 0.0, 0.0
    if bending is None or marker.bending < 0:
        return f0, f1, f2
    body = system.bodies[marker.body]
    e, n = body.offset + 3, body.nf
    for j in range(n):
        row = marker.bending + j * body.stride
        bq, bv = 0.0, 0.0
        for l in range(n):
            bq += bending[row + l] * q[e + l]
            bv += bending[row + l] * v[e + l]
        f0 += 0.5 * q[e + j] * bq
        f1 += v[e + j] * bq
        f2 += a[e + j] * bq + v[e + j] * bv
    return f0, f1, f2


@inlined
def marker_angle(system, marker, vector):
    """Return the angle phi + N2' u of a marker, or its rate or acceleration, depending on the system vector."""
    body = system.bodies[marker.body]
    e, k = body.offset + 3, marker.shape
    angle = vector[body.offset + 2]
    for j in range(body.nf):
        angle += system.shape[SLOPE, k + j] * vector[e + j]
    return angle


@inlined
def marker_angles(system, marker, q, v, a):
    """Return the angle of a marker, its rate and its acceleration."""
    return marker_angle(system, marker, q), marker_angle(system, marker, v), marker_angle(system, marker, a)


@inlined
def marker_shapes(system, marker, q, v, a):
    """Return N u of a marker with its two derivatives, and f/2 with its two derivatives."""
    shapes = marker_shape(system, marker, q), marker_shape(system, marker, v), marker_shape(system, marker, a)
    return shapes, marker_shortening(system, system.bending, marker, q, v, a)


@inlined
def marker_motion(system, marker, q, v, a):
    """Return position, velocity and acceleration of a marker, and its R s, in the ground frame: (p, p', p'', R s)."""
    angle = q[system.bodies[marker.body].offset + 2]
    shapes, shortening = marker_shapes(system, marker, q, v, a)
    return point_motion(system, marker, cos(angle), sin(angle), shapes, shortening, q, v, a)


@inlined
def point_motion(system, marker, c, s, shapes, shortening, q, v, a):
    """Return the result of `marker_motion` from N u, f/2 and their rates, and cosine and sine of the body's angle."""
    o = system.bodies[marker.body].offset
    (sx, sy), _, (vx, vy), (ax, ay) = relative_motion(marker, v[o + 2], a[o + 2], shapes, shortening)
    rx, ry = c * sx - s * sy, s * sx + c * sy
    return (
        q[o] + rx,
        q[o + 1] + ry,
        v[o] + c * vx - s * vy,
        v[o + 1] + s * vx + c * vy,
        a[o] + c * ax - s * ay,
        a[o + 1] + s * ax + c * ay,
        rx,
        ry,
    )


@inlined
def relative_motion(marker, w, dw, shapes, shortening):
    """Return the motion of a marker relative to its body's origin, in the body frame.

    The result has s, the rate of s in the body frame, velocity and acceleration.
    """
    (sx, sy), (ux, uy), (bx, by) = shapes
    f0, f1, f2 = shortening
    sx += marker.x - f0
    sy += marker.y
    ux -= f1
    bx -= f2
    ax = bx - dw * sy - w * w * sx - 2.0 * w * uy
    ay = by + dw * sx - w * w * sy + 2.0 * w * ux
    return (sx, sy), (ux, uy), (ux - w * sy, uy + w * sx), (ax, ay)


@inlined
def apply_force(system, marker, q, fx, fy, rx, ry, f):
    """Add to f the generalised force of a ground-frame force at a marker: J^T F, J = [1, R E s, R N]."""
    body = system.bodies[marker.body]
    o, e, k = body.offset, body.offset + 3, marker.shape
    c, s = cos(q[o + 2]), sin(q[o + 2])
    f[o] += fx
    f[o + 1] += fy
    f[o + 2] += rx * fy - ry * fx
    bx, by = c * fx + s * fy, c * fy - s * fx
    for j in range(body.nf):
        f[e + j] += system.shape[NX, k + j] * bx + system.shape[NY, k + j] * by
    shorten(system, system.bending, marker, q, -bx, f, e)


@inlined
def shorten(system, bending, marker, q, scale, x, at):
    """Add scale times the derivative of a marker's f/2 to x[at:]; `bending` as for `marker_shortening`."""
    if bending is None or marker.bending < 0:
        return
    body = system.bodies[marker.body]
    e, n = body.offset + 3, body.nf
    for j in range(n):
        row = marker.bending + j * body.stride
        total = 0.0
        for l in range(n):
            total += bending[row + l] * q[e + l]
        x[at + j] += scale * total


@inlined
def apply_torque(system, marker, torque, f):
    """Add to f the generalised force of a torque at a marker, which acts on phi and on the slope there."""
    body = system.bodies[marker.body]
    e, k = body.offset + 3, marker.shape
    f[body.offset + 2] += torque
    for j in range(body.nf):
        f[e + j] += system.shape[SLOPE, k + j] * torque


@kernel
def start_rows(system, signals, t, weights, rows):
    """Initialise the constraint rows with the contributions of ground points and prescribed values."""
    weight_a, weight_v, weight_q = weights
    for r in range(system.rows.size):
        row = system.rows[r]
        rows[r] = weight_q * row.ground
        if row.signal >= 0:
            value, rate, acceleration = evaluate_signal(signals, row.signal, t)
            rows[r] -= weight_a * acceleration + weight_v * rate + weight_q * value


@routine
def start_compliant_rows(system, lam, rows):
    """Initialise the rows of springs, dampers and friction.

    Rows of springs and dampers begin with minus the rest value and minus compliance times the force, rows of friction
    with zero.
    """
    for r in range(system.rows.size):
        if system.rows[r].kind == FRICTION:
            rows[r] = 0.0
        elif system.rows[r].kind != CONSTRAINT:
            rows[r] = system.rows[r].ground - system.rows[r].compliance * lam[r]


@routine
def finish_friction(system, lam, compliance, rows):
    """Convert the joint rates in rows of friction into residuals.

    The residual compliance (limit tanh(rate / speed) - lambda) has slope 1 with respect to the rate at the rate for
    which `compliance` was computed.
    """
    for r in range(system.rows.size):
        row = system.rows[r]
        if row.kind == FRICTION:
            rows[r] = compliance[r] * (row.limit * tanh(rows[r] / (row.compliance * row.limit)) - lam[r])


@routine
def spring_energy(system, lam):
    """Return the energy of the springs, computed from their torques."""
    energy = 0.0
    for r in range(system.rows.size):
        if system.rows[r].kind == SPRING:
            energy += 0.5 * system.rows[r].compliance * lam[r] * lam[r]
    return energy


@routine
def modal_damping_power(system, v):
    """Return the power dissipated by the damping of the flexible coordinates."""
    power = 0.0
    for i in range(system.bodies.size):
        body = system.bodies[i]
        for j in range(body.nf):
            rate = v[body.offset + 3 + j]
            power += system.modal[DAMPING, body.flex + j] * rate * rate
            if body.damping >= 0:
                for l in range(body.nf):
                    power += system.damping[body.damping + j * body.stride + l] * v[body.offset + 3 + l] * rate
    return power


@inlined
def end_motion(system, marker, x, y, q, v, a):
    """Return the motion of one end of an axis or a line, as `marker_motion` does.

    The end is a marker or a fixed point (x, y) on the ground.
    """
    if marker < 0:
        return x, y, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    return marker_motion(system, system.markers[marker], q, v, a)


@routine
def line_state(system, k, q, v):
    """Return elongation, its rate, and the unit vector from a to b of line spring k; a zero vector at zero length."""
    line = system.lines[k]
    ax, ay, vax, vay, _, _, _, _ = end_motion(system, line.a, line.ax, line.ay, q, v, v)
    bx, by, vbx, vby, _, _, _, _ = end_motion(system, line.b, line.bx, line.by, q, v, v)
    dx, dy = bx - ax, by - ay
    length = sqrt(dx * dx + dy * dy)
    if length == 0.0:
        return -line.length, 0.0, 0.0, 0.0
    ex, ey = dx / length, dy / length
    return length - line.length, ex * (vbx - vax) + ey * (vby - vay), ex, ey


@routine
def line_energy(system, q, v):
    """Return the energy of the springs between points, and the power of their dampers."""
    energy, power = 0.0, 0.0
    for k in range(system.lines.size):
        stretch, rate, _, _ = line_state(system, k, q, v)
        energy += 0.5 * system.lines[k].stiffness * stretch * stretch
        power += system.lines[k].damping * rate * rate
    return energy, power


@inlined
def row_part(kind, weights, values):
    """Return the contribution of a value and its two derivatives to a row of a given kind; linear in these."""
    if kind == CONSTRAINT:
        return weights[0] * values[2] + weights[1] * values[1] + weights[2] * values[0]
    return values[0] if kind == SPRING else values[1]


@inlined
def angle_by_sums(system, marker, q, v, a, scratch):
    """Return angle of a marker, its rate and its acceleration, from the sums of its body."""
    turn, z = system.bodies[marker.body].offset + 2, marker.column + SLOPE
    return q[turn] + scratch.q[z], v[turn] + scratch.v[z], a[turn] + scratch.a[z]


@inlined
def motion_by_sums(system, marker, q, v, a, scratch):
    """Return the result of `marker_motion` from the sums of the marker's body."""
    x = marker.column
    y = x + 1
    shapes = (scratch.q[x], scratch.q[y]), (scratch.v[x], scratch.v[y]), (scratch.a[x], scratch.a[y])
    shortening = shortening_by_products(system, system.bending, marker, q, v, a, scratch.points)
    return point_motion(system, marker, scratch.turn[0], scratch.turn[1], shapes, shortening, q, v, a)


@inlined
def shortening_by_products(system, bending, marker, q, v, a, points):
    """Return the result of `marker_shortening` and leave bending u in points.B_q.

    `bending` and `points` are None for linear geometry.
    """
    f0, f1, f2 = 0.0, 0.0, 0.0
    if bending is None or marker.bending < 0:
        return f0, f1, f2
    body = system.bodies[marker.body]
    e = body.offset + 3
    for block in range(0, body.stride, LANES):
        B_q, B_v, at = zeros(), zeros(), marker.bending + block
        for l in range(body.nf):
            # The matrix is symmetric.
            column = load(bending, at)
            B_q = add_scaled(B_q, column, q[e + l])
            B_v = add_scaled(B_v, column, v[e + l])
            at += body.stride
        store(points.B_q, block, B_q)
        store(points.B_v, block, B_v)
    for j in range(body.nf):
        f0 += 0.5 * q[e + j] * points.B_q[j]
        f1 += v[e + j] * points.B_q[j]
        f2 += a[e + j] * points.B_q[j] + v[e + j] * points.B_v[j]
    return f0, f1, f2


@inlined
def shorten_by_products(system, bending, marker, scale, f, points):
    """Add scale times the derivative of a marker's f/2 to f, directly after `shortening_by_products`."""
    if bending is None or marker.bending < 0:
        return
    body = system.bodies[marker.body]
    for j in range(body.nf):
        f[body.offset + 3 + j] += scale * points.B_q[j]


@inlined
def add_joints(system, i, q, v, a, lam, weights, scratch, f, rows):
    """Add body i's part of the weighted sum of Phi'', Phi' and Phi to rows, and Phi_q^T lambda to f and the shares."""
    body = system.bodies[i]
    o = body.offset
    c, s = scratch.turn[0], scratch.turn[1]
    for k in range(body.port, body.port_end):
        port = system.ports[k]
        marker = system.markers[port.marker]
        r, weight, x = port.row, port.weight, marker.column
        if port.kind == ANGLE:
            angles = angle_by_sums(system, marker, q, v, a, scratch)
            rows[r] += weight * row_part(system.rows[r].kind, weights, angles)
            share_torque(system, marker, weight * lam[r], scratch, f)
        elif port.kind != AXIS:
            px, py, vx, vy, ax, ay, rx, ry = motion_by_sums(system, marker, q, v, a, scratch)
            rows[r] += weight * (weights[0] * ax + weights[1] * vx + weights[2] * px)
            rows[r + 1] += weight * (weights[0] * ay + weights[1] * vy + weights[2] * py)
            fx, fy = weight * lam[r], weight * lam[r + 1]
            bx, by = c * fx + s * fy, c * fy - s * fx
            f[o] += fx
            f[o + 1] += fy
            f[o + 2] += rx * fy - ry * fx
            scratch.shares[x] += bx
            scratch.shares[x + 1] += by
            shorten_by_products(system, system.bending, marker, -bx, f, scratch.points)


@inlined
def share_torque(system, marker, torque, scratch, f):
    """Add a torque at a marker to f and the shares: see `apply_torque`."""
    f[system.bodies[marker.body].offset + 2] += torque
    scratch.shares[marker.column + SLOPE] += torque


@inlined
def add_motors(system, i, torques, scratch, f):
    """Subtract the generalised force of the motors on body i from f and the shares."""
    body = system.bodies[i]
    for k in range(body.motor, body.motor_end):
        side = system.motor_sides[k]
        share_torque(system, system.markers[side.marker], -side.sign * torques[side.signal], scratch, f)


@kernel
def body_joints(system, i, q, v, a, lam, weights, scratch, f, rows):
    """Add body i's part of the weighted sum of Phi'', Phi' and Phi to rows, and Phi_q^T lambda to f."""
    body_sums(system, i, q, v, a, scratch)
    clear_shares(system, i, scratch)
    add_joints(system, i, q, v, a, lam, weights, scratch, f, rows)
    hand_on(system, i, scratch, f)


@kernel
def body_motors(system, i, torques, scratch, f):
    """Subtract the generalised force of the motors on body i from f."""
    clear_shares(system, i, scratch)
    add_motors(system, i, torques, scratch, f)
    hand_on(system, i, scratch, f)
