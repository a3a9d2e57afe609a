"""The linear system of one iteration: bodies eliminated first, then the multipliers.

A body's iteration matrix is an arrow: diag(1 + b omega^2) bordered by three rigid rows, so factoring it costs
O(nf). In the body's own frame only s, M_phiphi and M_phif depend on its coordinates, through its deformation: bodies
are factored in their frames, and turned to where they stand anew at every step, which costs a sixth of it and keeps
an old factor good. The Schur complement of the
multipliers, S = sum J M^-1 J^T, is symmetric positive definite where Phi_q has full rank; it is stored and factored
within its envelope, rows ordered once when the system is built.
"""

from __future__ import annotations

from math import cos, sin, sqrt

from paraflex.kernel.arrays import fill
from paraflex.kernel.axes import add_track, turn_axes
from paraflex.kernel.bending import bent_mass_square, bent_mass_times, factor_bent, inverse_times, respond_bent
from paraflex.kernel.compiling import inlined, kernel, routine
from paraflex.kernel.joints import marker_shape, marker_shortening, shorten
from paraflex.kernel.packed import (
    ANGLE,
    AXIS,
    CONSTRAINT,
    DAMPING,
    DINV,
    GJ,
    MPF,
    NX,
    NY,
    OMEGA2,
    POINT,
    S2X,
    S2Y,
    SLOPE,
    SPRING,
)
from paraflex.kernel.sums import I1_SUM, S2X_SUM, S2Y_SUM, body_products, body_sums
from paraflex.kernel.vectors import LANES, add_product, add_scaled, load, store, summed, zeros

# A pivot smaller than this fraction of its diagonal entry marks a constraint row that depends on those before it.
DEPENDENT_ROW = 1e-12
# Springs divide by b: where it is zero (accelerations at an instant), by this instead.
SMALLEST_B = 1e-18


@inlined
def factor_body(p, i, b, q, ws):
    """Factor M + g D + b K of body i at q, g^2 = b: the arrow with its 3 x 3 rigid block."""
    body = p.bodies[i]
    n, k = body.nf, body.flex
    fr, scratch = ws.frame[i], ws.scratch
    g = sqrt(b)
    body_sums(p, i, q, q, q, scratch)
    body_products(p, i, q, q, scratch)
    sx, sy = body.S1x + scratch.q[S2X_SUM], body.S1y + scratch.q[S2Y_SUM]
    inertia = body.I0 + 2.0 * scratch.q[I1_SUM]
    a00, a10, a11, a20, a21, a22 = body.m, 0.0, body.m, 0.0, 0.0, 0.0
    for j in range(n):
        inertia += scratch.I2_q[j] * q[body.offset + 3 + j]
        S2x, S2y = p.modal[S2X, k + j], p.modal[S2Y, k + j]
        mpf = p.modal[GJ, k + j] - scratch.G2_q[j]
        d = 1.0 / (1.0 + g * p.modal[DAMPING, k + j] + b * p.modal[OMEGA2, k + j])
        ws.flex[MPF, k + j] = mpf
        ws.flex[DINV, k + j] = d
        a00 -= S2x * S2x * d
        a10 -= S2y * S2x * d
        a11 -= S2y * S2y * d
        a20 -= mpf * S2x * d
        a21 -= mpf * S2y * d
        a22 -= mpf * mpf * d
    a20 -= sy
    a21 += sx
    a22 += inertia
    l00 = sqrt(a00)
    l10 = a10 / l00
    l11 = sqrt(a11 - l10 * l10)
    l20 = a20 / l00
    l21 = (a21 - l20 * l10) / l11
    l22 = sqrt(a22 - l20 * l20 - l21 * l21)
    fr[2], fr[3], fr[4] = sx, sy, inertia
    fr[5], fr[6], fr[7], fr[8], fr[9], fr[10] = 1.0 / l00, l10, 1.0 / l11, l20, l21, 1.0 / l22


@inlined
def solve_rigid(fr, r0, r1, r2):
    """Solve with the factored 3 x 3 rigid block of a body."""
    r0 = r0 * fr[5]
    r1 = (r1 - fr[6] * r0) * fr[7]
    r2 = (r2 - fr[8] * r0 - fr[9] * r1) * fr[10] * fr[10]
    r1 = (r1 - fr[9] * r2) * fr[7]
    return (r0 - fr[6] * r1 - fr[8] * r2) * fr[5], r1, r2


@routine
def respond(p, i, ws):
    """Response of body i to its constraint rows, (M + b K)^-1 J^T, and to its rigid coordinates, into ws.response."""
    body = p.bodies[i]
    n, k, lanes, fr = body.nf, body.flex, body.lanes, ws.frame[i]
    for block in range(0, lanes, LANES):
        at = body.jac + block
        r0, r1, r2 = load(ws.jac, at), load(ws.jac, at + lanes), load(ws.jac, at + 2 * lanes)
        for j in range(n):
            row, d = load(ws.jac, at + (3 + j) * lanes), ws.flex[DINV, k + j]
            r0 = add_scaled(r0, row, -d * p.modal[S2X, k + j])
            r1 = add_scaled(r1, row, -d * p.modal[S2Y, k + j])
            r2 = add_scaled(r2, row, -d * ws.flex[MPF, k + j])
        # As `solve_rigid`, eight at once.
        r0 = add_scaled(zeros(), r0, fr[5])
        r1 = add_scaled(zeros(), add_scaled(r1, r0, -fr[6]), fr[7])
        r2 = add_scaled(zeros(), add_scaled(add_scaled(r2, r0, -fr[8]), r1, -fr[9]), fr[10] * fr[10])
        r1 = add_scaled(zeros(), add_scaled(r1, r2, -fr[9]), fr[7])
        r0 = add_scaled(zeros(), add_scaled(add_scaled(r0, r1, -fr[6]), r2, -fr[8]), fr[5])
        store(ws.response, at, r0)
        store(ws.response, at + lanes, r1)
        store(ws.response, at + 2 * lanes, r2)
        for j in range(n):
            d = ws.flex[DINV, k + j]
            x = add_scaled(zeros(), load(ws.jac, at + (3 + j) * lanes), d)
            x = add_scaled(add_scaled(x, r0, -d * p.modal[S2X, k + j]), r1, -d * p.modal[S2Y, k + j])
            store(ws.response, at + (3 + j) * lanes, add_scaled(x, r2, -d * ws.flex[MPF, k + j]))
    rigid = body.jac + body.parts
    for r in range(3):
        for l in range(3):
            ws.response[rigid + r * lanes + l] = 1.0 if r == l else 0.0
    for j in range(n):
        d, at = ws.flex[DINV, k + j], rigid + (3 + j) * lanes
        ws.response[at] = -d * p.modal[S2X, k + j]
        ws.response[at + 1] = -d * p.modal[S2Y, k + j]
        ws.response[at + 2] = -d * ws.flex[MPF, k + j]


@inlined
def body_jacobian(p, i, q, ws):
    """The parts of body i's constraint rows in its own frame, [1, E s, N] and [0, 1, N2'], into the lanes of ws.jac.

    The lane after them holds M_phif.
    """
    body = p.bodies[i]
    n, lanes, scratch = body.nf, body.lanes, ws.scratch
    at = body.jac
    for j in range((3 + n) * lanes):
        ws.jac[at + j] = 0.0
    for k in range(body.port, body.port_end):
        port = p.ports[k]
        marker = p.markers[port.marker]
        x, h = at + port.local, marker.shape
        if port.kind == ANGLE:
            ws.jac[x + 2 * lanes] = 1.0
            for j in range(n):
                ws.jac[x + (3 + j) * lanes] = p.shape[SLOPE, h + j]
            continue
        ux, uy = marker_shape(p, marker, q)
        ux -= marker_shortening(p, p.bending, marker, q, q, q)[0]
        ws.jac[x], ws.jac[x + 2 * lanes] = 1.0, -(marker.y + uy)
        ws.jac[x + 1 + lanes], ws.jac[x + 1 + 2 * lanes] = 1.0, marker.x + ux
        fill(scratch.rigid, 0.0)
        shorten(p, p.bending, marker, q, -1.0, scratch.rigid, 0)
        for j in range(n):
            ws.jac[x + (3 + j) * lanes] = p.shape[NX, h + j] + scratch.rigid[j]
            ws.jac[x + 1 + (3 + j) * lanes] = p.shape[NY, h + j]
        if port.parts > 2:
            ws.jac[x + 2 + 2 * lanes] = 1.0
            for j in range(n):
                ws.jac[x + 2 + (3 + j) * lanes] = p.shape[SLOPE, h + j]
        if port.parts > 3:
            fill(scratch.rigid, 0.0)
            add_track(p, port.axis, ws.axes[port.axis, 3], 1.0, scratch.rigid, 0)
            for j in range(n):
                ws.jac[x + 3 + (3 + j) * lanes] = scratch.rigid[j]
    for j in range(n):
        ws.jac[at + body.parts + (3 + j) * lanes] = ws.flex[MPF, body.flex + j]


@inlined
def body_block(p, i, ws):
    """J M^-1 J^T of body i in its frame, into ws.blocks."""
    body = p.bodies[i]
    lanes = body.lanes
    for r in range(body.parts):
        for block in range(0, lanes, LANES):
            total = zeros()
            for x in range(body.jac, body.jac + (3 + body.nf) * lanes, lanes):
                total = add_scaled(total, load(ws.jac, x + block), ws.response[x + r])
            store(ws.blocks, body.block + r * lanes + block, total)


@inlined
def share(ws, port, r, part, c, s):
    """What one part of a port, in the body frame, gives to its constraint row r; c and s turn that frame."""
    if port.kind == ANGLE:
        return port.sign
    if port.kind == POINT:
        if r == part:
            return port.sign * c
        return port.sign * s if r == 1 else -port.sign * s
    ex, ey = ws.axes[port.axis, 0], ws.axes[port.axis, 1]
    if part == 0:
        return port.sign * (c * ex + s * ey)
    if part == 1:
        return port.sign * (c * ey - s * ex)
    return ws.axes[port.axis, 2] if part == 2 else -1.0


@inlined
def add_entry(p, ws, row, column, value):
    """Add to an entry of the Schur complement, by its lower half."""
    high, low = max(row, column), min(row, column)
    ws.schur[p.rows[high].start + low - p.rows[high].first] += value


@routine
def add_axis_pair(p, ws, body, port, other, same, c, s):
    """Add the entries between two ports of a body of which at least one is an axis."""
    for r in range(port.rows):
        for q in range(r + 1 if same else other.rows):
            value = 0.0
            for x in range(port.parts):
                for y in range(other.parts):
                    at = body.block + (port.local + x) * body.lanes + other.local + y
                    value += share(ws, port, r, x, c, s) * ws.blocks[at] * share(ws, other, q, y, c, s)
            add_entry(p, ws, port.row + r, other.row + q, value)


@inlined
def add_schur(p, i, ws):
    """Turn body i's J M^-1 J^T to the ground frame and add it to the Schur complement."""
    body = p.bodies[i]
    c, s = ws.frame[i, 0], ws.frame[i, 1]
    for k in range(body.port, body.port_end):
        port = p.ports[k]
        for l in range(body.port, k + 1):
            other = p.ports[l]
            if port.kind == AXIS or other.kind == AXIS:
                add_axis_pair(p, ws, body, port, other, l == k, c, s)
                continue
            sign = port.sign * other.sign
            at = body.block + port.local * body.lanes + other.local
            # A 2 x 2 block, of which an angle's row or column is missing.
            b00, b01, b10, b11 = ws.blocks[at], 0.0, 0.0, 0.0
            if other.kind == POINT:
                b01 = ws.blocks[at + 1]
            if port.kind == POINT:
                b10 = ws.blocks[at + body.lanes]
                if other.kind == POINT:
                    b11 = ws.blocks[at + body.lanes + 1]
                b00, b10 = c * b00 - s * b10, s * b00 + c * b10
                b01, b11 = c * b01 - s * b11, s * b01 + c * b11
            if other.kind == POINT:
                b00, b01 = c * b00 - s * b01, s * b00 + c * b01
                b10, b11 = c * b10 - s * b11, s * b10 + c * b11
            for r in range(port.rows):
                for q in range(other.rows if l < k else r + 1):
                    value = (b00 if q == 0 else b01) if r == 0 else (b10 if q == 0 else b11)
                    add_entry(p, ws, port.row + r, other.row + q, sign * value)


@routine
def factor_schur(p, ws, dependent_part):
    """Cholesky factor of the Schur complement in place, row by row within the envelope.

    Returns the number of dependent rows found; each gets multiplier zero, which leaves the accelerations those of
    the pseudo-inverse (Eq. 59) as long as the constraints are consistent.
    """
    dependent = 0
    for i in range(p.rows.size):
        first, start = p.rows[i].first, p.rows[i].start - p.rows[i].first
        for j in range(first, i):
            first_j, start_j = p.rows[j].first, p.rows[j].start - p.rows[j].first
            total = ws.schur[start + j]
            for k in range(max(first, first_j), j):
                total -= ws.schur[start + k] * ws.schur[start_j + k]
            # Diagonals hold reciprocals; that of a dependent row is zero and keeps its column at zero.
            ws.schur[start + j] = total * ws.schur[start_j + j]
        diagonal = ws.schur[start + i]
        pivot = diagonal
        for k in range(first, i):
            pivot -= ws.schur[start + k] * ws.schur[start + k]
        if pivot > dependent_part * diagonal:
            ws.schur[start + i] = 1.0 / sqrt(pivot)
        else:
            ws.schur[start + i] = 0.0
            dependent += 1
    return dependent


@routine
def solve_schur(p, ws, x):
    """Solve with the factored Schur complement, in place."""
    for i in range(p.rows.size):
        first, start = p.rows[i].first, p.rows[i].start - p.rows[i].first
        total = x[i]
        for k in range(first, i):
            total -= ws.schur[start + k] * x[k]
        x[i] = total * ws.schur[start + i]
    for i in range(p.rows.size - 1, -1, -1):
        first, start = p.rows[i].first, p.rows[i].start - p.rows[i].first
        x[i] *= ws.schur[start + i]
        for k in range(first, i):
            x[k] -= ws.schur[start + k] * x[i]


@kernel
def factor_bodies(p, b, q, ws):
    """Factor every body's M + b K at its deformation in q, in its own frame."""
    ws.step[0] = max(b, SMALLEST_B)
    turn_axes(p, q, ws.axes)
    for i in range(p.bodies.size):
        if factor_bent(p, i, b, q, ws, ws.dense):
            body_jacobian(p, i, q, ws)
            respond_bent(p, i, ws, ws.dense, ws.inverse)
        else:
            factor_body(p, i, b, q, ws)
            body_jacobian(p, i, q, ws)
            respond(p, i, ws)
        body_block(p, i, ws)


@inlined
def row_scale(p, r, ws, scale):
    """What makes the iteration matrix symmetric: scale for a constraint, 1/b for a spring, else 1/g."""
    kind = p.rows[r].kind
    if kind == SPRING:
        return 1.0 / ws.step[0]
    return scale if kind == CONSTRAINT else 1.0 / sqrt(ws.step[0])


@kernel
def orient(p, q, ws, dependent_part):
    """Turn the factored bodies to their angles in q and factor the Schur complement; number of dependent rows."""
    fill(ws.schur, 0.0)
    turn_axes(p, q, ws.axes)
    for i in range(p.bodies.size):
        phi = q[p.bodies[i].offset + 2]
        ws.frame[i, 0], ws.frame[i, 1] = cos(phi), sin(phi)
        add_schur(p, i, ws)
    for r in range(p.rows.size):
        if p.rows[r].kind != CONSTRAINT:
            ws.schur[p.rows[r].start + r - p.rows[r].first] += ws.compliance[r] * row_scale(p, r, ws, 1.0)
    return factor_schur(p, ws, dependent_part)


@kernel
def factor_system(p, b, q, ws):
    """Factor the iteration matrix [M + b K, Phi_q^T; Phi_q, 0] at q; returns the number of dependent rows."""
    factor_bodies(p, b, q, ws)
    return orient(p, q, ws, DEPENDENT_ROW)


@inlined
def to_body_frame(p, i, ws, x):
    """Turn the translational part of body i in x from the ground frame to the factor's body frame."""
    o = p.bodies[i].offset
    c, s = ws.frame[i, 0], ws.frame[i, 1]
    x[o], x[o + 1] = c * x[o] + s * x[o + 1], c * x[o + 1] - s * x[o]


@inlined
def to_ground_frame(p, i, ws, x):
    """Turn the translational part of body i in x back to the ground frame."""
    o = p.bodies[i].offset
    c, s = ws.frame[i, 0], ws.frame[i, 1]
    x[o], x[o + 1] = c * x[o] - s * x[o + 1], s * x[o] + c * x[o + 1]


@inlined
def lanes_times(p, i, matrix, x, scratch):
    """Sums of x over the coordinates of body i by the lanes of ws.jac or ws.response, into scratch.lanes."""
    body = p.bodies[i]
    for block in range(0, body.lanes, LANES):
        total = zeros()
        at = body.jac + block
        for j in range(body.offset, body.offset + 3 + body.nf):
            total = add_scaled(total, load(matrix, at), x[j])
            at += body.lanes
        store(scratch.lanes, block, total)


@inlined
def add_lanes(p, i, ws, scale, spring_scale, damper_scale, rows):
    """Add what `lanes_times` found for the parts of body i's constraint rows to rows, times the scale of their kind."""
    body = p.bodies[i]
    c, s, lanes = ws.frame[i, 0], ws.frame[i, 1], ws.scratch.lanes
    for k in range(body.port, body.port_end):
        port = p.ports[k]
        kind, x = p.rows[port.row].kind, port.local
        kind_scale = scale if kind == CONSTRAINT else (spring_scale if kind == SPRING else damper_scale)
        factor = port.sign * kind_scale
        if port.kind == ANGLE:
            rows[port.row] += factor * lanes[x]
        elif port.kind == AXIS:
            for part in range(port.parts):
                rows[port.row] += kind_scale * share(ws, port, 0, part, c, s) * lanes[x + part]
        else:
            rows[port.row] += factor * (c * lanes[x] - s * lanes[x + 1])
            rows[port.row + 1] += factor * (s * lanes[x] + c * lanes[x + 1])


@inlined
def jacobian_times(p, i, ws, x, scale, spring_scale, damper_scale, rows):
    """Add J x of body i to rows, times the scale of their kind; x in the body frame. M_phif x is left in scratch."""
    lanes_times(p, i, ws.jac, x, ws.scratch)
    add_lanes(p, i, ws, scale, spring_scale, damper_scale, rows)


@inlined
def reactions(p, i, ws, mu):
    """What multipliers do to body i along the parts of its rows, less: -J^T mu by lanes, into scratch.lanes."""
    body = p.bodies[i]
    c, s, lanes = ws.frame[i, 0], ws.frame[i, 1], ws.scratch.lanes
    for k in range(body.port, body.port_end):
        port = p.ports[k]
        x = port.local
        if port.kind == ANGLE:
            lanes[x] = -port.sign * mu[port.row]
        elif port.kind == AXIS:
            for part in range(port.parts):
                lanes[x + part] = -mu[port.row] * share(ws, port, 0, part, c, s)
        else:
            fx, fy = port.sign * mu[port.row], port.sign * mu[port.row + 1]
            lanes[x], lanes[x + 1] = -(c * fx + s * fy), s * fx - c * fy
    for x in range(body.parts, body.lanes):
        lanes[x] = 0.0


@inlined
def lanes_of(p, i, j, ws):
    """The sum of scratch.lanes as coordinate j of body i feels them."""
    body = p.bodies[i]
    total, at = zeros(), body.jac + j * body.lanes
    for block in range(0, body.lanes, LANES):
        total = add_product(total, load(ws.response, at + block), load(ws.scratch.lanes, block))
    return summed(total)


@kernel
def solve_system(p, ws, x, mu):
    """Solve [M + b K, Phi_q^T; Phi_q, -C/b] [x; mu] = [x; mu] in place; x in the ground frame.

    C holds the compliance of springs, zero for constraints; for dampers it is -C/g.
    """
    solve_all(p, ws, ws.inverse, x, mu)


@inlined
def solve_all(p, ws, inverse, x, mu):
    """See `solve_system`; `inverse` is ws.inverse, None for linear geometry."""
    lanes = ws.scratch.lanes
    for r in range(mu.size):
        mu[r] = -mu[r]
    for i in range(p.bodies.size):
        body = p.bodies[i]
        o, rigid = body.offset, body.parts
        to_body_frame(p, i, ws, x)
        lanes_times(p, i, ws.response, x, ws.scratch)
        add_lanes(p, i, ws, 1.0, 1.0, 1.0, mu)
        if body.slopes == 0:
            x[o], x[o + 1], x[o + 2] = solve_rigid(ws.frame[i], lanes[rigid], lanes[rigid + 1], lanes[rigid + 2])
    solve_schur(p, ws, mu)
    for i in range(p.bodies.size):
        body = p.bodies[i]
        o = body.offset
        reactions(p, i, ws, mu)
        if body.slopes == 0:
            for r in range(3):
                lanes[body.parts + r] = x[o + r]
            for r in range(3):
                x[o + r] = lanes_of(p, i, r, ws)
            for j in range(3, 3 + body.nf):
                x[o + j] = ws.flex[DINV, body.flex + j - 3] * x[o + j] + lanes_of(p, i, j, ws)
        else:
            inverse_times(p, i, inverse, ws.scratch.rigid, x)
            for j in range(3 + body.nf):
                x[o + j] += lanes_of(p, i, j, ws)
        to_ground_frame(p, i, ws, x)


@routine
def right_hand_side(p, ws, scale):
    """-f and -rows as the right-hand side of `solve_system`; rows times their `row_scale`."""
    for j in range(ws.f.size):
        ws.x[j] = -ws.f[j]
    for r in range(ws.rows.size):
        ws.mu[r] = -ws.rows[r] * row_scale(p, r, ws, scale)


@inlined
def mass_times(p, i, ws, mass, x):
    """M x of body i in place, with the mass matrix of the factor; x in the body frame.

    `mass` is ws.mass, None for linear geometry.
    """
    body = p.bodies[i]
    if mass is not None:
        if body.slopes > 0:
            bent_mass_times(p, i, mass, ws.scratch.rigid, x)
            return
    o, n, k = body.offset, body.nf, body.flex
    e = o + 3
    sx, sy, inertia = ws.frame[i, 2], ws.frame[i, 3], ws.frame[i, 4]
    x0, x1, x2 = x[o], x[o + 1], x[o + 2]
    y0 = body.m * x0 - sy * x2
    y1 = body.m * x1 + sx * x2
    y2 = sx * x1 - sy * x0 + inertia * x2
    for j in range(n):
        z = x[e + j]
        S2x, S2y, mpf = p.modal[S2X, k + j], p.modal[S2Y, k + j], ws.flex[MPF, k + j]
        y0 += S2x * z
        y1 += S2y * z
        y2 += mpf * z
        x[e + j] = z + S2x * x0 + S2y * x1 + mpf * x2
    x[o], x[o + 1], x[o + 2] = y0, y1, y2


@inlined
def mass_square(p, i, ws, mass, x):
    """x^T M x of body i for a ground-frame vector; `mass` as for `mass_times`."""
    body = p.bodies[i]
    o, k = body.offset, body.flex
    c, s = ws.frame[i, 0], ws.frame[i, 1]
    x0, x1, x2 = c * x[o] + s * x[o + 1], c * x[o + 1] - s * x[o], x[o + 2]
    if mass is not None:
        if body.slopes > 0:
            return bent_mass_square(p, i, mass, x, x0, x1)
    sx, sy, inertia = ws.frame[i, 2], ws.frame[i, 3], ws.frame[i, 4]
    fx, fy, fp, ff = 0.0, 0.0, 0.0, 0.0
    for j in range(body.nf):
        z = x[o + 3 + j]
        fx += p.modal[S2X, k + j] * z
        fy += p.modal[S2Y, k + j] * z
        fp += ws.flex[MPF, k + j] * z
        ff += z * z
    square = body.m * (x0 * x0 + x1 * x1) + inertia * x2 * x2 + ff
    return square + 2.0 * (x0 * (fx - sy * x2) + x1 * (fy + sx * x2) + x2 * fp)


@kernel
def mass_norm(p, ws, x):
    """sqrt(x^T M x / m_total) of a ground-frame vector: metres for a displacement, whatever the coordinates."""
    total = 0.0
    for i in range(p.bodies.size):
        total += mass_square(p, i, ws, ws.mass, x)
    return sqrt(max(total, 0.0) / p.total_mass)
