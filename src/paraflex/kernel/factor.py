"""Iteration matrix of one body at a time: its factor, and the body's response to its constraint rows.

The matrix is an arrow, diag(1 + g d + b omega^2) bordered by three rigid rows, so factoring it costs O(nf). In the body
frame only s, M_phiphi and M_phif depend on the body's coordinates, through its deformation. Bodies are therefore
factored in their frames, and `kernel.linear` rotates them to their current angles at every step, which costs a sixth
and keeps an old factor accurate. In second-order geometry, and if damping couples the modes, the matrix is dense: see
`kernel.bending`.
"""

from math import sqrt

from .arrays import fill
from .axes import add_track, turn_axes
from .bending import factor_dense_body, respond_dense
from .compiling import inlined, kernel, routine
from .joints import marker_shape, marker_shortening, shorten
from .packed import ANGLE, DAMPING, DINV, GJ, MPF, NX, NY, OMEGA2, S2X, S2Y, SLOPE
from .sums import I1_SUM, S2X_SUM, S2Y_SUM, body_products, body_sums
from .vectors import LANES, add_scaled, load, store, zeros

# Rows of springs are divided by b; if it is zero (accelerations at one time), they are divided by this.
SMALLEST_B = 1e-18


@inlined
def factor_body(system, i, b, q, work):
    """Factor M + g D + b K of body i at q, D diagonal, g^2 = b: the arrow with its 3 x 3 rigid block."""
    body = system.bodies[i]
    n, k = body.nf, body.flex
    fr, scratch = work.frame[i], work.scratch
    g = sqrt(b)
    body_sums(system, i, q, q, q, scratch)
    body_products(system, i, q, q, scratch)
    sx, sy = body.S1x + scratch.q[S2X_SUM], body.S1y + scratch.q[S2Y_SUM]
    inertia = body.I0 + 2.0 * scratch.q[I1_SUM]
    a00, a10, a11, a20, a21, a22 = body.m, 0.0, body.m, 0.0, 0.0, 0.0
    for j in range(n):
        inertia += scratch.I2_q[j] * q[body.offset + 3 + j]
        S2x, S2y = system.modal[S2X, k + j], system.modal[S2Y, k + j]
        mpf = system.modal[GJ, k + j] - scratch.G2_q[j]
        d = 1.0 / (1.0 + g * system.modal[DAMPING, k + j] + b * system.modal[OMEGA2, k + j])
        work.flex[MPF, k + j] = mpf
        work.flex[DINV, k + j] = d
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
def respond(system, i, work):
    """Compute the response of body i to its constraint rows, (M + b K)^-1 J^T, and to its rigid coordinates.

    The result is written to work.response.
    """
    body = system.bodies[i]
    n, k, lanes, fr = body.nf, body.flex, body.lanes, work.frame[i]
    for block in range(0, lanes, LANES):
        at = body.jac + block
        r0, r1, r2 = load(work.jac, at), load(work.jac, at + lanes), load(work.jac, at + 2 * lanes)
        for j in range(n):
            row, d = load(work.jac, at + (3 + j) * lanes), work.flex[DINV, k + j]
            r0 = add_scaled(r0, row, -d * system.modal[S2X, k + j])
            r1 = add_scaled(r1, row, -d * system.modal[S2Y, k + j])
            r2 = add_scaled(r2, row, -d * work.flex[MPF, k + j])
        # `solve_rigid` for eight columns at once.
        r0 = add_scaled(zeros(), r0, fr[5])
        r1 = add_scaled(zeros(), add_scaled(r1, r0, -fr[6]), fr[7])
        r2 = add_scaled(zeros(), add_scaled(add_scaled(r2, r0, -fr[8]), r1, -fr[9]), fr[10] * fr[10])
        r1 = add_scaled(zeros(), add_scaled(r1, r2, -fr[9]), fr[7])
        r0 = add_scaled(zeros(), add_scaled(add_scaled(r0, r1, -fr[6]), r2, -fr[8]), fr[5])
        store(work.response, at, r0)
        store(work.response, at + lanes, r1)
        store(work.response, at + 2 * lanes, r2)
        for j in range(n):
            d = work.flex[DINV, k + j]
            x = add_scaled(zeros(), load(work.jac, at + (3 + j) * lanes), d)
            x = add_scaled(add_scaled(x, r0, -d * system.modal[S2X, k + j]), r1, -d * system.modal[S2Y, k + j])
            store(work.response, at + (3 + j) * lanes, add_scaled(x, r2, -d * work.flex[MPF, k + j]))
    rigid = body.jac + body.parts
    for r in range(3):
        for l in range(3):
            work.response[rigid + r * lanes + l] = 1.0 if r == l else 0.0
    for j in range(n):
        d, at = work.flex[DINV, k + j], rigid + (3 + j) * lanes
        work.response[at] = -d * system.modal[S2X, k + j]
        work.response[at + 1] = -d * system.modal[S2Y, k + j]
        work.response[at + 2] = -d * work.flex[MPF, k + j]


@inlined
def body_jacobian(system, i, q, work):
    """Compute parts of body i's constraint rows in its frame, [1, E s, N] and [0, 1, N2'], into lanes of work.jac."""
    body = system.bodies[i]
    n, lanes, scratch = body.nf, body.lanes, work.scratch
    at = body.jac
    for j in range((3 + n) * lanes):
        work.jac[at + j] = 0.0
    for k in range(body.port, body.port_end):
        port = system.ports[k]
        marker = system.markers[port.marker]
        x, h = at + port.local, marker.shape
        if port.kind == ANGLE:
            work.jac[x + 2 * lanes] = 1.0
            for j in range(n):
                work.jac[x + (3 + j) * lanes] = system.shape[SLOPE, h + j]
            continue
        ux, uy = marker_shape(system, marker, q)
        ux -= marker_shortening(system, system.bending, marker, q, q, q)[0]
        work.jac[x], work.jac[x + 2 * lanes] = 1.0, -(marker.y + uy)
        work.jac[x + 1 + lanes], work.jac[x + 1 + 2 * lanes] = 1.0, marker.x + ux
        fill(scratch.rigid, 0.0)
        shorten(system, system.bending, marker, q, -1.0, scratch.rigid, 0)
        for j in range(n):
            work.jac[x + (3 + j) * lanes] = system.shape[NX, h + j] + scratch.rigid[j]
            work.jac[x + 1 + (3 + j) * lanes] = system.shape[NY, h + j]
        if port.parts > 2:
            work.jac[x + 2 + 2 * lanes] = 1.0
            for j in range(n):
                work.jac[x + 2 + (3 + j) * lanes] = system.shape[SLOPE, h + j]
        if port.parts > 3:
            fill(scratch.rigid, 0.0)
            add_track(system, port.axis, work.axes[port.axis, 3], 1.0, scratch.rigid, 0)
            for j in range(n):
                work.jac[x + 3 + (3 + j) * lanes] = scratch.rigid[j]


@inlined
def body_block(system, i, work):
    """Compute J M^-1 J^T of body i in its frame into work.blocks."""
    body = system.bodies[i]
    lanes = body.lanes
    for r in range(body.parts):
        for block in range(0, lanes, LANES):
            total = zeros()
            for x in range(body.jac, body.jac + (3 + body.nf) * lanes, lanes):
                total = add_scaled(total, load(work.jac, x + block), work.response[x + r])
            store(work.blocks, body.block + r * lanes + block, total)


@kernel
def factor_bodies(system, b, q, work):
    """Factor M + b K of every body at its deformation in q, in the body frame."""
    work.step[0] = max(b, SMALLEST_B)
    turn_axes(system, q, work.axes)
    for i in range(system.bodies.size):
        if system.bodies[i].slopes == 0:
            factor_body(system, i, b, q, work)
        body_jacobian(system, i, q, work)
        if factor_dense_body(system, i, b, q, work, work.dense):
            respond_dense(system, i, work, work.dense, work.inverse)
        else:
            respond(system, i, work)
        body_block(system, i, work)
