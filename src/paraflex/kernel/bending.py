"""Bodies of second-order geometry, by sums over mass points; dense iteration matrices, also those of coupled damping.

A mass point has the position s = x0 + N u - 1/2 e_x f in the body frame, with f = sum_j W_j (N2'_j u)^2 over the Gauss
points j between it and the first end. Its forces on (r, phi, u) are m p'', m (R E s).p'' and m (ds/du)^T R^T p'', with
p'' as for any point. The mass matrix is the sum of m J^T J, which is positive definite however large the deflection.
"""

from math import cos, sin, sqrt

from .compiling import inlined, kernel, routine
from .packed import ANGLE, AXIS, BASE, DAMPING, FULL, MPF, OMEGA2, S2X, S2Y
from .sums import part_product
from .vectors import LANES, add_product, add_scaled, load, padded, store, summed, zeros


@inlined
def place_sums(system, i, q, v, a, points):
    """Compute Nx u, Ny u and the slopes of all mass points of body i, and the same for u' and u''.

    Into points.shortening go the terms of the shortening at Gauss points, and of its derivatives.
    """
    body = system.bodies[i]
    pitch = body.pitch
    kind_sums(system, body, 0, pitch, body.along, body.across, q, v, a, points)
    kind_sums(system, body, pitch, 3 * pitch, body.across, body.across_end, q, v, a, points)
    for block in range(0, pitch, LANES):
        slope = 2 * pitch + block
        s0, s1 = load(points.q, slope), load(points.v, slope)
        minus = add_scaled(zeros(), s0, -1.0)
        store(points.shortening, block, add_product(zeros(), add_scaled(zeros(), minus, 0.5), s0))
        store(points.shortening, pitch + block, add_product(zeros(), minus, s1))
        squares = add_product(zeros(), add_scaled(zeros(), s1, -1.0), s1)
        store(points.shortening, slope, add_product(squares, minus, load(points.a, slope)))
    for start in range(0, 3 * pitch, pitch):
        note_bases(system, body, start, points)


@inlined
def note_bases(system, body, start, points):
    """Write the sum over the elements before each element beside its terms in points.shortening, from `start` on."""
    base = 0.0
    for element in range(0, body.pitch, body.step):
        at = start + element
        own = load(system.spans, body.spans + LANES * element + LANES * FULL)
        own = add_product(zeros(), own, load(points.shortening, at))
        points.shortening[at + BASE] = base
        base += summed(own)


@inlined
def kind_sums(system, body, start, end, first, last, q, v, a, points):
    """Compute the sums from start to end of `place_sums`, to which only coordinates of one kind contribute.

    Their numbers are system.kinds from first to last.
    """
    e, stride = body.offset + 3, 3 * body.pitch
    for block in range(start, end, LANES):
        of_q, of_v, of_a, at = zeros(), zeros(), zeros(), body.places + block
        for k in range(first, last):
            j = system.kinds[k]
            column = load(system.places, at + j * stride)
            of_q = add_scaled(of_q, column, q[e + j])
            of_v = add_scaled(of_v, column, v[e + j])
            of_a = add_scaled(of_a, column, a[e + j])
        store(points.q, block, of_q)
        store(points.v, block, of_v)
        store(points.a, block, of_a)


@inlined
def second_order_equations(system, i, c, s, q, v, a, f, points):
    """Compute M q'' + h + K u of body i, less its weight, into f; c and s rotate its frame.

    Axial inertia forces at Gauss points are left in points.axial.
    """
    body = system.bodies[i]
    o, n, pitch = body.offset, body.nf, body.pitch
    e = o + 3
    w, dw = v[o + 2], a[o + 2]
    gx, gy = a[o] - system.gravity[0], a[o + 1] - system.gravity[1]
    ax, ay = c * gx + s * gy, c * gy - s * gx
    place_sums(system, i, q, v, a, points)
    fx, fy, lever_y, lever_x, turning = zeros(), zeros(), zeros(), zeros(), zeros()
    for block in range(0, pitch, LANES):
        y, slope = pitch + block, 2 * pitch + block
        mass, inertia = masses(system, i, block)
        sx, vx, bx = shortened(system, i, block, points)
        sy, vy, by = load(points.q, y), load(points.v, y), load(points.a, y)
        relative = add_scaled(add_scaled(add_scaled(bx, sy, -dw), sx, -w * w), vy, -2.0 * w)
        mx = add_product(add_scaled(zeros(), mass, ax), mass, relative)
        relative = add_scaled(add_scaled(add_scaled(by, sx, dw), sy, -w * w), vx, 2.0 * w)
        my = add_product(add_scaled(zeros(), mass, ay), mass, relative)
        turn = add_product(add_scaled(zeros(), inertia, dw), inertia, load(points.a, slope))
        store(points.shares, block, mx)
        store(points.shares, y, my)
        store(points.shares, slope, turn)
        fx, fy, turning = add_scaled(fx, mx, 1.0), add_scaled(fy, my, 1.0), add_scaled(turning, turn, 1.0)
        lever_x, lever_y = add_product(lever_x, sx, my), add_product(lever_y, sy, mx)
    later = 0.0
    for element in range(pitch - body.step, -1, -body.step):
        axial, after = zeros(), later
        for block in range(element, element + body.step, LANES):
            for k in range(LANES):
                weights = load(system.weights, body.spans + LANES * (block + k))
                axial = add_scaled(axial, weights, points.shares[block + k])
            later += summed(load(points.shares, block))
            store(points.axial, block, zeros())
        axial = add_scaled(axial, load(system.spans, body.spans + LANES * (element + FULL)), after)
        store(points.axial, element, axial)
        minus, slope = add_scaled(zeros(), axial, -1.0), 2 * pitch + element
        store(points.shares, slope, add_product(load(points.shares, slope), minus, load(points.q, slope)))
    for j in range(n):
        f[e + j] = system.modal[OMEGA2, body.flex + j] * q[e + j] + system.modal[DAMPING, body.flex + j] * v[e + j]
    for k in range(body.along, body.across_end):
        j = system.kinds[k]
        start, end = (0, pitch) if k < body.across else (pitch, 3 * pitch)
        f[e + j] += part_product(system.places, body.places + 3 * pitch * j, start, end, points.shares)
    f[o] = c * summed(fx) - s * summed(fy)
    f[o + 1] = s * summed(fx) + c * summed(fy)
    f[o + 2] = summed(lever_x) - summed(lever_y) + summed(turning)


@inlined
def masses(system, i, block):
    """Return masses and moments of inertia of eight mass points."""
    at, pitch = system.bodies[i].inertias + block, system.bodies[i].pitch
    return load(system.inertias, at + pitch), load(system.inertias, at + 2 * pitch)


@inlined
def shortened(system, i, block, points):
    """Return s_x of eight mass points, shortened by bending, and two derivatives in the body frame, from their sums."""
    body = system.bodies[i]
    pitch = body.pitch
    sx = add_scaled(load(system.inertias, body.inertias + block), load(points.q, block), 1.0)
    vx, bx, first = load(points.v, block), load(points.a, block), block - block % body.step
    for j in range(BASE + 1):
        weight = load(system.spans, body.spans + LANES * (block + j))
        sx = add_scaled(sx, weight, points.shortening[first + j])
        vx = add_scaled(vx, weight, points.shortening[pitch + first + j])
        bx = add_scaled(bx, weight, points.shortening[2 * pitch + first + j])
    return sx, vx, bx


@inlined
def add_shortening(system, body, block, points, total):
    """Add to eight mass points the first of the sums of `shortened` alone."""
    first = block - block % body.step
    for j in range(BASE + 1):
        total = add_scaled(total, load(system.spans, body.spans + LANES * (block + j)), points.shortening[first + j])
    return total


@routine
def second_order_shortening(system, i, q, points):
    """Return the sum of m f/2 over the mass points of body i: the shift of its first moment by bending."""
    body = system.bodies[i]
    total = zeros()
    place_sums(system, i, q, q, q, points)
    for block in range(0, body.pitch, LANES):
        shift = add_shortening(system, body, block, points, zeros())
        total = add_product(total, shift, load(system.inertias, body.inertias + body.pitch + block))
    return -summed(total)


@inlined
def second_order_energy(system, i, q, v, points):
    """Return kinetic and strain energy of body i."""
    body = system.bodies[i]
    o, n, pitch = body.offset, body.nf, body.pitch
    e = o + 3
    c, s = cos(q[o + 2]), sin(q[o + 2])
    w = v[o + 2]
    rx, ry = c * v[o] + s * v[o + 1], c * v[o + 1] - s * v[o]
    place_sums(system, i, q, v, v, points)
    # Twice the energy: of the origin's motion, of motion relative to it, and of their product.
    total, together_x, together_y, square = zeros(), zeros(), zeros(), zeros()
    for block in range(0, pitch, LANES):
        y, slope = pitch + block, 2 * pitch + block
        mass, inertia = masses(system, i, block)
        sx, vx, _ = shortened(system, i, block, points)
        vx, vy = add_scaled(vx, load(points.q, y), -w), add_scaled(load(points.v, y), sx, w)
        square = add_product(add_product(zeros(), vx, vx), vy, vy)
        total = add_product(total, mass, square)
        together_x, together_y = add_product(together_x, mass, vx), add_product(together_y, mass, vy)
        turn = load(points.v, slope)
        total = add_product(total, inertia, add_product(add_scaled(zeros(), turn, 2.0 * w), turn, turn))
        total = add_scaled(add_scaled(total, inertia, w * w), mass, rx * rx + ry * ry)
    kinetic = summed(total) + 2.0 * (rx * summed(together_x) + ry * summed(together_y))
    strain = 0.0
    for l in range(n):
        strain += system.modal[OMEGA2, body.flex + l] * q[e + l] * q[e + l]
    return 0.5 * kinetic, 0.5 * strain


@routine
def second_order_mass(system, i, q, work, points):
    """Compute the full mass matrix of body i in its frame into work.mass: the sum of m J^T J, J = [1, E s, ds/du].

    `points` is work.scratch.points.
    """
    body = system.bodies[i]
    n, width, at, pitch = body.nf, 3 + body.nf, body.dense, body.pitch
    stride = padded(width)
    place_sums(system, i, q, q, q, points)
    m, first_x, first_y, second = zeros(), zeros(), zeros(), zeros()
    for block in range(0, pitch, LANES):
        mass, inertia = masses(system, i, block)
        sx, _, _ = shortened(system, i, block, points)
        sy = load(points.q, pitch + block)
        store(points.shares, block, sx)
        m = add_scaled(m, mass, 1.0)
        first_x, first_y = add_product(first_x, mass, sx), add_product(first_y, mass, sy)
        second = add_product(second, mass, add_product(add_product(zeros(), sx, sx), sy, sy))
        second = add_scaled(second, inertia, 1.0)
    for j in range(width * stride):
        work.mass[at + j] = 0.0
    work.mass[at] = work.mass[at + stride + 1] = summed(m)
    work.mass[at + 2 * stride], work.mass[at + 2 * stride + 1] = -summed(first_y), summed(first_x)
    work.mass[at + 2 * stride + 2] = summed(second)
    for l in range(n):
        second_order_mass_row(system, i, l, work.mass, points)
    for r in range(width):
        for d in range(r):
            work.mass[at + d * stride + r] = work.mass[at + r * stride + d]


@inlined
def second_order_mass_row(system, i, l, mass, points):
    """Compute the row of flexible coordinate l up to its diagonal.

    On entry points.shares holds s_x of the points, and points.q holds s_y.
    """
    body = system.bodies[i]
    pitch = body.pitch
    row, place = body.dense + (3 + l) * padded(3 + body.nf), body.places + 3 * pitch * l
    mx, my, lever = zeros(), zeros(), zeros()
    for block in range(0, pitch, LANES):
        minus = add_scaled(zeros(), load(points.q, 2 * pitch + block), -1.0)
        store(points.shortening, block, add_product(zeros(), minus, load(system.places, place + 2 * pitch + block)))
    note_bases(system, body, 0, points)
    for block in range(0, pitch, LANES):
        x, y = load(system.places, place + block), load(system.places, place + pitch + block)
        x = add_shortening(system, body, block, points, x)
        m, inertia = masses(system, i, block)
        store(points.rows, 2 * pitch * l + block, x)
        m_x, m_y = add_product(zeros(), m, x), add_product(zeros(), m, y)
        store(points.rows, 2 * pitch * l + pitch + block, m_x)
        mx, my = add_scaled(mx, m_x, 1.0), add_scaled(my, m_y, 1.0)
        lever = add_product(lever, load(points.shares, block), m_y)
        against = add_product(zeros(), load(points.q, pitch + block), m_x)
        lever = add_scaled(lever, against, -1.0)
        lever = add_product(lever, inertia, load(system.places, place + 2 * pitch + block))
    mass[row], mass[row + 1], mass[row + 2] = summed(mx), summed(my), summed(lever)
    for d in range(l + 1):
        total, other = zeros(), body.places + 3 * pitch * d
        for block in range(0, pitch, LANES):
            m, inertia = masses(system, i, block)
            total = add_product(
                total, load(points.rows, 2 * pitch * l + pitch + block), load(points.rows, 2 * pitch * d + block)
            )
            m_y = add_product(zeros(), m, load(system.places, place + pitch + block))
            total = add_product(total, m_y, load(system.places, other + pitch + block))
            turn = add_product(zeros(), inertia, load(system.places, place + 2 * pitch + block))
            total = add_product(total, turn, load(system.places, other + 2 * pitch + block))
        mass[row + 3 + d] = summed(total)


@routine
def note_axial_forces(system, i, q, v, a, lam, work, points, geometric):
    """Compute the geometric stiffness of body i, from its inertia forces and its joints' axial forces.

    The result is written to work.geometric. `points` and `geometric` are those of work.
    """
    body = system.bodies[i]
    n, at, pitch = body.nf, body.square, body.pitch
    c, s = cos(q[body.offset + 2]), sin(q[body.offset + 2])
    # Only the axial forces at the Gauss points are used.
    second_order_equations(system, i, c, s, q, v, a, work.f, points)
    for l in range(n):
        slopes = body.places + 3 * pitch * l + 2 * pitch
        for d in range(n):
            total, other = zeros(), body.places + 3 * pitch * d + 2 * pitch
            for block in range(0, pitch, LANES):
                bent = add_product(zeros(), load(system.places, slopes + block), load(system.places, other + block))
                total = add_product(total, load(points.axial, block), bent)
            geometric[at + l * n + d] = -summed(total)
    for k in range(body.port, body.port_end):
        port = system.ports[k]
        bending = system.markers[port.marker].bending
        if port.kind == ANGLE or bending < 0:
            continue
        if port.kind == AXIS:
            force = port.weight * lam[port.row] * (c * work.axes[port.axis, 0] + s * work.axes[port.axis, 1])
        else:
            force = port.weight * (c * lam[port.row] + s * lam[port.row + 1])
        for l in range(n):
            for d in range(n):
                geometric[at + l * n + d] -= force * system.bending[bending + l * body.stride + d]


@kernel
def note_all_axial_forces(system, q, v, a, lam, work, geometric):
    """Compute the geometric stiffness of every body for the next factor into work.geometric.

    `geometric` is work.geometric, None for linear geometry.
    """
    if geometric is None:
        return
    for i in range(system.bodies.size):
        if system.bodies[i].slopes > 0:
            note_axial_forces(system, i, q, v, a, lam, work, work.scratch.points, geometric)


@routine
def subtract_geometric(system, i, geometric, scale, u, x):
    """Subtract scale K_g u of body i from x; `geometric` as for `note_all_axial_forces`."""
    body = system.bodies[i]
    if geometric is not None and body.slopes > 0:
        e, n = body.offset + 3, body.nf
        for j in range(n):
            total, row = 0.0, body.square + j * n
            for l in range(n):
                total += geometric[row + l] * u[e + l]
            x[e + j] -= scale * total


@routine
def linear_mass(system, i, work):
    """Compute the mass matrix of body i of linear geometry into work.mass, from the data of `factor.factor_body`."""
    body = system.bodies[i]
    n, k, width, at = body.nf, body.flex, 3 + body.nf, body.dense
    stride = padded(width)
    sx, sy, inertia = work.frame[i, 2], work.frame[i, 3], work.frame[i, 4]
    for j in range(width * stride):
        work.mass[at + j] = 0.0
    work.mass[at] = work.mass[at + stride + 1] = body.m
    work.mass[at + 2], work.mass[at + stride + 2], work.mass[at + 2 * stride + 2] = -sy, sx, inertia
    for j in range(n):
        work.mass[at + 3 + j], work.mass[at + stride + 3 + j] = system.modal[S2X, k + j], system.modal[S2Y, k + j]
        work.mass[at + 2 * stride + 3 + j] = work.flex[MPF, k + j]
        work.mass[at + (3 + j) * (stride + 1)] = 1.0
    for r in range(3):
        for d in range(r + 1, width):
            work.mass[at + d * stride + r] = work.mass[at + r * stride + d]


@routine
def factor_dense_body(system, i, b, q, work, dense):
    """Compute the mass matrix of body i and the Cholesky factor of M + g D + b (K + K_g), g^2 = b.

    K_g is left out if the sum with it is not positive definite. Diagonals of the factor hold reciprocals. Returns
    whether the body's matrix is dense; `dense` is work.dense, None if no body has a dense matrix.
    """
    body = system.bodies[i]
    if dense is None or body.full == 0:
        return False
    n, width, at = body.nf, 3 + body.nf, body.dense
    stride, g = padded(width), sqrt(b)
    if body.slopes > 0:
        second_order_mass(system, i, q, work, work.scratch.points)
    else:
        linear_mass(system, i, work)
    for attempt in range(2):
        for j in range(width * stride):
            work.dense[at + j] = work.mass[at + j]
        for l in range(n):
            r = at + (3 + l) * stride + 3
            work.dense[r + l] += b * system.modal[OMEGA2, body.flex + l] + g * system.modal[DAMPING, body.flex + l]
            if body.damping >= 0:
                for d in range(l + 1):
                    work.dense[r + d] += g * system.damping[body.damping + l * body.stride + d]
            if attempt == 0 and body.slopes > 0:
                for d in range(l + 1):
                    work.dense[r + d] += b * work.geometric[body.square + l * n + d]
        definite = True
        for r in range(width):
            for d in range(r + 1):
                total = work.dense[at + r * stride + d]
                for k in range(d):
                    total -= work.dense[at + r * stride + k] * work.dense[at + d * stride + k]
                if d < r:
                    work.dense[at + r * stride + d] = total * work.dense[at + d * stride + d]
                elif total > 0.0:
                    work.dense[at + r * stride + r] = 1.0 / sqrt(total)
                else:
                    definite = False
                    work.dense[at + r * stride + r] = 0.0
        if definite:
            break
    return True


@routine
def solve_dense(system, i, dense, source, target, at, pitch):
    """Multiply eight columns of a matrix, from `at` on and with rows `pitch` apart, by (M + b (K + K_g))^-1."""
    width, first = 3 + system.bodies[i].nf, system.bodies[i].dense
    stride = padded(width)
    for r in range(width):
        total = load(source, at + r * pitch)
        for k in range(r):
            total = add_scaled(total, load(target, at + k * pitch), -dense[first + r * stride + k])
        store(target, at + r * pitch, add_scaled(zeros(), total, dense[first + r * stride + r]))
    for r in range(width - 1, -1, -1):
        total = load(target, at + r * pitch)
        for k in range(r + 1, width):
            total = add_scaled(total, load(target, at + k * pitch), -dense[first + k * stride + r])
        store(target, at + r * pitch, add_scaled(zeros(), total, dense[first + r * stride + r]))


@routine
def respond_dense(system, i, work, dense, inverse):
    """Compute the response of body i to its constraint rows, and the inverse of its iteration matrix.

    They are written to work.response and work.inverse. `dense` and `inverse` are those of `work`, None if no body has a
    dense matrix.
    """
    if inverse is None:
        return
    body = system.bodies[i]
    for block in range(0, body.lanes, LANES):
        solve_dense(system, i, dense, work.jac, work.response, body.jac + block, body.lanes)
    width = 3 + body.nf
    pitch = padded(width)
    for r in range(width):
        for l in range(pitch):
            inverse[body.dense + r * pitch + l] = 1.0 if r == l else 0.0
    for block in range(0, pitch, LANES):
        solve_dense(system, i, dense, inverse, inverse, body.dense + block, pitch)


@inlined
def dense_times(system, i, matrix, y, x):
    """Multiply x of body i by its symmetric matrix in place, in the body frame; y is scratch.

    `matrix` is work.mass or work.inverse, None if no body has a dense matrix.
    """
    if matrix is None:
        return
    width, o = 3 + system.bodies[i].nf, system.bodies[i].offset
    pitch = padded(width)
    for block in range(0, pitch, LANES):
        store(y, block, column_product(matrix, system.bodies[i].dense + block, pitch, width, x, o))
    for r in range(width):
        x[o + r] = y[r]


@inlined
def column_product(matrix, at, pitch, rows, x, o):
    """Return the sum of eight columns of a matrix with rows `pitch` apart, times x from o on."""
    total = zeros()
    for k in range(rows):
        total = add_scaled(total, load(matrix, at), x[o + k])
        at += pitch
    return total


@inlined
def dense_square(system, i, mass, y, x, x0, x1):
    """Return x^T M x of body i, where x0 and x1 are the translational part in its frame; y is scratch."""
    width, o = 3 + system.bodies[i].nf, system.bodies[i].offset
    pitch, total = padded(width), zeros()
    y[0], y[1] = x0, x1
    for k in range(2, pitch):
        y[k] = x[o + k] if k < width else 0.0
    for block in range(0, pitch, LANES):
        column = column_product(mass, system.bodies[i].dense + block, pitch, width, y, 0)
        total = add_product(total, column, load(y, block))
    return summed(total)
