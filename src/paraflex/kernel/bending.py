"""Bodies of second-order geometry: sums over mass points, and dense iteration matrices.

A mass point stands at s = x0 + N u - 1/2 e_x f, f = sum_j W_j (N2'_j u)^2 over the Gauss points j that it reaches, and
its forces on (r, phi, u) are m p'', m (R E s).p'', m (ds/du)^T R^T p'' with the p'' of any point. The mass matrix is
the sum of m J^T J: positive definite however large the deflection.
"""

from __future__ import annotations

from math import cos, sin, sqrt

from paraflex.kernel.compiling import inlined, kernel, routine
from paraflex.kernel.packed import ANGLE, AXIS, DAMPING, NX, NY, OMEGA2, SLOPE
from paraflex.kernel.vectors import LANES, add_product, add_scaled, load, store, summed, zeros

# Rows of Workspace.points: slopes at the Gauss points, their two derivatives, and the axial force carried there.
W0, W1, W2, AXIAL = range(4)


@routine
def bent_equations(p, i, q, v, a, f, points):
    """M q'' + h + K u of body i, less its weight, into f; axial inertia forces at Gauss points into `points`."""
    body = p.bodies[i]
    o, n = body.offset, body.nf
    e = o + 3
    c, s = cos(q[o + 2]), sin(q[o + 2])
    w, dw = v[o + 2], a[o + 2]
    gx, gy = a[o] - p.gravity[0], a[o + 1] - p.gravity[1]
    ax, ay = c * gx + s * gy, c * gy - s * gx
    for j in range(body.slopes):
        h = p.masses[body.mass + j].shape
        s0, s1, s2 = 0.0, 0.0, 0.0
        for l in range(n):
            slope = p.mass_shape[SLOPE, h + l]
            s0 += slope * q[e + l]
            s1 += slope * v[e + l]
            s2 += slope * a[e + l]
        points[W0, j], points[W1, j], points[W2, j], points[AXIAL, j] = s0, s1, s2, 0.0
    for l in range(n):
        f[e + l] = p.modal[OMEGA2, body.flex + l] * q[e + l] + p.modal[DAMPING, body.flex + l] * v[e + l]
    fx, fy, torque = 0.0, 0.0, 0.0
    for k in range(body.mass, body.mass_end):
        point = p.masses[k]
        h = point.shape
        sx, sy, vx, vy, bx, by, turn = point.x, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for l in range(n):
            Nx, Ny = p.mass_shape[NX, h + l], p.mass_shape[NY, h + l]
            sx += Nx * q[e + l]
            sy += Ny * q[e + l]
            vx += Nx * v[e + l]
            vy += Ny * v[e + l]
            bx += Nx * a[e + l]
            by += Ny * a[e + l]
        for j in range(point.reach):
            weight = p.mass_weights[point.weights + j]
            s0, s1 = points[W0, j], points[W1, j]
            sx -= 0.5 * weight * s0 * s0
            vx -= weight * s0 * s1
            bx -= weight * (s1 * s1 + s0 * points[W2, j])
        mx = point.mass * (ax + bx - dw * sy - w * w * sx - 2.0 * w * vy)
        my = point.mass * (ay + by + dw * sx - w * w * sy + 2.0 * w * vx)
        if point.inertia > 0.0:
            turn = dw
            for l in range(n):
                turn += p.mass_shape[SLOPE, h + l] * a[e + l]
            turn *= point.inertia
            for l in range(n):
                f[e + l] += p.mass_shape[SLOPE, h + l] * turn
        for l in range(n):
            f[e + l] += p.mass_shape[NX, h + l] * mx + p.mass_shape[NY, h + l] * my
        for j in range(point.reach):
            points[AXIAL, j] += p.mass_weights[point.weights + j] * mx
        fx += mx
        fy += my
        torque += sx * my - sy * mx + turn
    for j in range(body.slopes):
        h = p.masses[body.mass + j].shape
        force = points[W0, j] * points[AXIAL, j]
        for l in range(n):
            f[e + l] -= p.mass_shape[SLOPE, h + l] * force
    f[o] = c * fx - s * fy
    f[o + 1] = s * fx + c * fy
    f[o + 2] = torque


@routine
def bent_shortening(p, i, q, points):
    """Sum of m f/2 over the mass points of body i: by how much bending shifts its first moment along it."""
    body = p.bodies[i]
    for j in range(body.slopes):
        h = p.masses[body.mass + j].shape
        points[W0, j] = 0.0
        for l in range(body.nf):
            points[W0, j] += p.mass_shape[SLOPE, h + l] * q[body.offset + 3 + l]
    total = 0.0
    for k in range(body.mass, body.mass_end):
        point = p.masses[k]
        for j in range(point.reach):
            total += 0.5 * point.mass * p.mass_weights[point.weights + j] * points[W0, j] * points[W0, j]
    return total


@routine
def bent_energy(p, i, q, v, points):
    """Kinetic and strain energy of body i."""
    body = p.bodies[i]
    o, n = body.offset, body.nf
    e = o + 3
    c, s = cos(q[o + 2]), sin(q[o + 2])
    w = v[o + 2]
    rx, ry = c * v[o] + s * v[o + 1], c * v[o + 1] - s * v[o]
    for j in range(body.slopes):
        h = p.masses[body.mass + j].shape
        s0, s1 = 0.0, 0.0
        for l in range(n):
            s0 += p.mass_shape[SLOPE, h + l] * q[e + l]
            s1 += p.mass_shape[SLOPE, h + l] * v[e + l]
        points[W0, j], points[W1, j] = s0, s1
    kinetic, strain = 0.0, 0.0
    for k in range(body.mass, body.mass_end):
        point = p.masses[k]
        h = point.shape
        sx, sy, vx, vy, turn = point.x, 0.0, rx, ry, w
        for l in range(n):
            Nx, Ny = p.mass_shape[NX, h + l], p.mass_shape[NY, h + l]
            sx += Nx * q[e + l]
            sy += Ny * q[e + l]
            vx += Nx * v[e + l]
            vy += Ny * v[e + l]
            turn += p.mass_shape[SLOPE, h + l] * v[e + l]
        for j in range(point.reach):
            weight = p.mass_weights[point.weights + j]
            sx -= 0.5 * weight * points[W0, j] * points[W0, j]
            vx -= weight * points[W0, j] * points[W1, j]
        vx -= w * sy
        vy += w * sx
        kinetic += point.mass * (vx * vx + vy * vy) + point.inertia * turn * turn
    for l in range(n):
        strain += p.modal[OMEGA2, body.flex + l] * q[e + l] * q[e + l]
    return 0.5 * kinetic, 0.5 * strain


@routine
def bent_mass(p, i, q, ws):
    """Mass matrix of body i in its own frame into ws.mass, all of it: the sum of m J^T J, J = [1, E s, ds/du]."""
    body = p.bodies[i]
    e, n, width, at = body.offset + 3, body.nf, 3 + body.nf, body.dense
    for j in range(body.slopes):
        h = p.masses[body.mass + j].shape
        s0 = 0.0
        for l in range(n):
            s0 += p.mass_shape[SLOPE, h + l] * q[e + l]
        ws.scratch.points[W0, j] = s0
    for j in range(width * width):
        ws.mass[at + j] = 0.0
    # Row x of a point's J; row y is (0, 1, sx, Ny).
    row = ws.scratch.rigid
    for k in range(body.mass, body.mass_end):
        point = p.masses[k]
        h = point.shape
        sx, sy = point.x, 0.0
        for l in range(n):
            Nx = p.mass_shape[NX, h + l]
            row[3 + l] = Nx
            sx += Nx * q[e + l]
            sy += p.mass_shape[NY, h + l] * q[e + l]
        for j in range(point.reach):
            force = p.mass_weights[point.weights + j] * ws.scratch.points[W0, j]
            sx -= 0.5 * force * ws.scratch.points[W0, j]
            g = p.masses[body.mass + j].shape
            for l in range(n):
                row[3 + l] -= force * p.mass_shape[SLOPE, g + l]
        m, J = point.mass, point.inertia
        ws.mass[at] += m
        ws.mass[at + width + 1] += m
        ws.mass[at + 2 * width] -= m * sy
        ws.mass[at + 2 * width + 1] += m * sx
        ws.mass[at + 2 * width + 2] += m * (sx * sx + sy * sy) + J
        for l in range(n):
            Nx, Ny, slope = row[3 + l], p.mass_shape[NY, h + l], p.mass_shape[SLOPE, h + l]
            r = at + (3 + l) * width
            ws.mass[r] += m * Nx
            ws.mass[r + 1] += m * Ny
            ws.mass[r + 2] += m * (sx * Ny - sy * Nx) + J * slope
            for d in range(l + 1):
                ws.mass[r + 3 + d] += (
                    m * (Nx * row[3 + d] + Ny * p.mass_shape[NY, h + d]) + J * slope * p.mass_shape[SLOPE, h + d]
                )
    for r in range(width):
        for d in range(r):
            ws.mass[at + d * width + r] = ws.mass[at + r * width + d]


@routine
def note_axial_forces(p, i, q, v, a, lam, ws):
    """Geometric stiffness of body i into ws.geometric: of its inertia forces and of its joints' forces along it."""
    body = p.bodies[i]
    n, at = body.nf, body.square
    # Only the axial forces at the Gauss points are wanted.
    bent_equations(p, i, q, v, a, ws.f, ws.scratch.points)
    for j in range(n * n):
        ws.geometric[at + j] = 0.0
    for j in range(body.slopes):
        h = p.masses[body.mass + j].shape
        force = ws.scratch.points[AXIAL, j]
        for l in range(n):
            for d in range(n):
                ws.geometric[at + l * n + d] -= force * p.mass_shape[SLOPE, h + l] * p.mass_shape[SLOPE, h + d]
    c, s = cos(q[body.offset + 2]), sin(q[body.offset + 2])
    for k in range(body.port, body.port_end):
        port = p.ports[k]
        bending = p.markers[port.marker].bending
        if port.kind == ANGLE or bending < 0:
            continue
        if port.kind == AXIS:
            force = port.sign * lam[port.row] * (c * ws.axes[port.axis, 0] + s * ws.axes[port.axis, 1])
        else:
            force = port.sign * (c * lam[port.row] + s * lam[port.row + 1])
        for j in range(n * n):
            ws.geometric[at + j] -= force * p.bending[bending + j]


@kernel
def note_all_axial_forces(p, q, v, a, lam, ws, geometric):
    """Geometric stiffness of every body for the next factor; `geometric` is ws.geometric, None for linear geometry."""
    if geometric is None:
        return
    for i in range(p.bodies.size):
        if p.bodies[i].slopes > 0:
            note_axial_forces(p, i, q, v, a, lam, ws)


@routine
def subtract_geometric(p, i, geometric, scale, u, x):
    """Subtract scale K_g u of body i from x; `geometric` as for `note_all_axial_forces`."""
    if geometric is None:
        return
    body = p.bodies[i]
    if body.slopes > 0:
        e, n = body.offset + 3, body.nf
        for j in range(n):
            for l in range(n):
                x[e + j] -= scale * geometric[body.square + j * n + l] * u[e + l]


@routine
def factor_bent(p, i, b, q, ws, dense):
    """Mass matrix of body i and Cholesky factor of M + g D + b (K + K_g), g^2 = b; without K_g if that is not definite.

    Diagonals of the factor hold reciprocals. Returns whether the body is of second-order geometry; `dense` is
    ws.dense, None where no body is.
    """
    if dense is None:
        return False
    body = p.bodies[i]
    if body.slopes == 0:
        return False
    n, width, at = body.nf, 3 + body.nf, body.dense
    g = sqrt(b)
    bent_mass(p, i, q, ws)
    for attempt in range(2):
        for j in range(width * width):
            ws.dense[at + j] = ws.mass[at + j]
        for l in range(n):
            r = at + (3 + l) * width + 3
            ws.dense[r + l] += b * p.modal[OMEGA2, body.flex + l] + g * p.modal[DAMPING, body.flex + l]
            if attempt == 0:
                for d in range(l + 1):
                    ws.dense[r + d] += b * ws.geometric[body.square + l * n + d]
        definite = True
        for r in range(width):
            for d in range(r + 1):
                total = ws.dense[at + r * width + d]
                for k in range(d):
                    total -= ws.dense[at + r * width + k] * ws.dense[at + d * width + k]
                if d < r:
                    ws.dense[at + r * width + d] = total * ws.dense[at + d * width + d]
                elif total > 0.0:
                    ws.dense[at + r * width + r] = 1.0 / sqrt(total)
                else:
                    definite = False
                    ws.dense[at + r * width + r] = 0.0
        if definite:
            break
    return True


@routine
def solve_bent(p, i, dense, source, target, at, pitch):
    """(M + b (K + K_g))^-1 times eight columns of a matrix with rows `pitch` apart, from `at` on."""
    width, first = 3 + p.bodies[i].nf, p.bodies[i].dense
    for r in range(width):
        total = load(source, at + r * pitch)
        for k in range(r):
            total = add_scaled(total, load(target, at + k * pitch), -dense[first + r * width + k])
        store(target, at + r * pitch, add_scaled(zeros(), total, dense[first + r * width + r]))
    for r in range(width - 1, -1, -1):
        total = load(target, at + r * pitch)
        for k in range(r + 1, width):
            total = add_scaled(total, load(target, at + k * pitch), -dense[first + k * width + r])
        store(target, at + r * pitch, add_scaled(zeros(), total, dense[first + r * width + r]))


@routine
def respond_bent(p, i, ws, dense, inverse):
    """Response of body i to its constraint rows into ws.response, and the inverse of its iteration matrix.

    `dense` and `inverse` are those of ws, None for linear geometry.
    """
    if inverse is None:
        return
    body = p.bodies[i]
    for block in range(0, body.lanes, LANES):
        solve_bent(p, i, dense, ws.jac, ws.response, body.jac + block, body.lanes)
    width = 3 + body.nf
    pitch = -(-width // LANES) * LANES
    for r in range(width):
        for l in range(pitch):
            inverse[body.inverse + r * pitch + l] = 1.0 if r == l else 0.0
    for block in range(0, pitch, LANES):
        solve_bent(p, i, dense, inverse, inverse, body.inverse + block, pitch)


@inlined
def inverse_times(p, i, inverse, y, x):
    """(M + b (K + K_g))^-1 x of body i in place, in its body frame; y is scratch.

    `inverse` is ws.inverse, None for linear geometry.
    """
    if inverse is None:
        return
    body = p.bodies[i]
    width, o = 3 + body.nf, body.offset
    pitch = -(-width // LANES) * LANES
    for j in range(pitch):
        y[j] = x[o + j] if j < width else 0.0
    at = body.inverse
    for r in range(width):
        total = zeros()
        for block in range(0, pitch, LANES):
            total = add_product(total, load(inverse, at + block), load(y, block))
        x[o + r] = summed(total)
        at += pitch


@routine
def bent_mass_times(p, i, mass, product, x):
    """M x of body i in place, in its body frame."""
    body = p.bodies[i]
    o, width = body.offset, 3 + body.nf
    for r in range(width):
        total = 0.0
        for k in range(width):
            total += mass[body.dense + r * width + k] * x[o + k]
        product[r] = total
    for r in range(width):
        x[o + r] = product[r]


@routine
def bent_mass_square(p, i, mass, x, x0, x1):
    """x^T M x of body i, with the translational part turned to its frame: x0, x1."""
    body = p.bodies[i]
    o, width, at = body.offset, 3 + body.nf, body.dense
    square = 0.0
    for r in range(width):
        xr = x0 if r == 0 else (x1 if r == 1 else x[o + r])
        total = mass[at + r * width] * x0 + mass[at + r * width + 1] * x1
        for k in range(2, width):
            total += mass[at + r * width + k] * x[o + k]
        square += xr * total
    return square
