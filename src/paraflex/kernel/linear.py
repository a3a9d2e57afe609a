"""Linear system of one iteration: bodies are eliminated first (`kernel.factor`), then the multipliers.

The Schur complement of the multipliers, S = sum J M^-1 J^T, is symmetric, and positive definite if Phi_q has full rank.
It is stored and factored within its envelope; the rows are ordered once, when the system is built. The *relative pivot*
of a row is the part of its diagonal entry that remains when the rows before it are eliminated.
"""

from math import cos, sin, sqrt

from .arrays import fill
from .axes import turn_axes
from .bending import dense_times
from .compiling import inlined, kernel, routine, unoptimised
from .factor import factor_bodies, solve_rigid
from .packed import ANGLE, AXIS, CONSTRAINT, DINV, POINT, SPRING
from .sums import row_product
from .vectors import LANES, add_scaled, load, store, zeros

# A smaller relative pivot marks a constraint row that depends on the rows before it.
DEPENDENT_ROW = 1e-12
# A position is singular if any row has a smaller relative pivot.
SINGULAR_PART = 1e-10
# A row redundant at the start is independent above this relative pivot: the start was a singular position.
INDEPENDENT = 1e-3
# The square of the second row of a point, without the part in common with the first, is at least this part of it:
# smaller values are rounding.
LEAST_SQUARE = 1e-6


@inlined
def share(work, port, r, part, c, s):
    """Return the contribution of one part of a port, in the body frame, to its constraint row r.

    c and s rotate the body frame.
    """
    if port.kind == ANGLE:
        return port.weight
    if port.kind == POINT:
        if r == part:
            return port.weight * c
        return port.weight * s if r == 1 else -port.weight * s
    ex, ey = work.axes[port.axis, 0], work.axes[port.axis, 1]
    if part == 0:
        return port.weight * (c * ex + s * ey)
    if part == 1:
        return port.weight * (c * ey - s * ex)
    # Only the end that carries the axis has more parts; its weight is minus that of the axis.
    return -port.weight * work.axes[port.axis, 2] if part == 2 else port.weight


@inlined
def add_pair_entry(system, work, row, column, same, value):
    """Add the contribution of two ports to an entry in the lower half of the Schur complement.

    Two different ports contribute twice to a diagonal entry.
    """
    high, low = max(row, column), min(row, column)
    twice = 1.0 if same or row != column else 2.0
    work.schur[system.rows[high].start + low - system.rows[high].first] += twice * value


@routine
def add_axis_pair(system, work, body, port, other, same, c, s):
    """Add the entries for two ports of a body, at least one of which is an axis."""
    for r in range(port.rows):
        for q in range(r + 1 if same else other.rows):
            value = 0.0
            for x in range(port.parts):
                for y in range(other.parts):
                    at = body.block + (port.local + x) * body.lanes + other.local + y
                    value += share(work, port, r, x, c, s) * work.blocks[at] * share(work, other, q, y, c, s)
            add_pair_entry(system, work, port.row + r, other.row + q, same, value)


@inlined
def add_schur(system, i, work):
    """Rotate J M^-1 J^T of body i to the ground frame and add it to the Schur complement."""
    body = system.bodies[i]
    c, s = work.frame[i, 0], work.frame[i, 1]
    for k in range(body.port, body.port_end):
        port = system.ports[k]
        for l in range(body.port, k + 1):
            other = system.ports[l]
            if port.kind == AXIS or other.kind == AXIS:
                add_axis_pair(system, work, body, port, other, l == k, c, s)
                continue
            weight = port.weight * other.weight
            at = body.block + port.local * body.lanes + other.local
            # A 2 x 2 block, without the second row or column for an angle.
            b00, b01, b10, b11 = work.blocks[at], 0.0, 0.0, 0.0
            if other.kind == POINT:
                b01 = work.blocks[at + 1]
            if port.kind == POINT:
                b10 = work.blocks[at + body.lanes]
                if other.kind == POINT:
                    b11 = work.blocks[at + body.lanes + 1]
                b00, b10 = c * b00 - s * b10, s * b00 + c * b10
                b01, b11 = c * b01 - s * b11, s * b01 + c * b11
            if other.kind == POINT:
                b00, b01 = c * b00 - s * b01, s * b00 + c * b01
                b10, b11 = c * b10 - s * b11, s * b10 + c * b11
            for r in range(port.rows):
                for q in range(other.rows if l < k else r + 1):
                    value = (b00 if q == 0 else b01) if r == 0 else (b10 if q == 0 else b11)
                    add_pair_entry(system, work, port.row + r, other.row + q, l == k, weight * value)


@inlined
def own_square(square, product, first_square):
    """Return the square of the second of two rows that hold a point, without the part in common with the first.

    With that part, both rows would seem dependent if a body rotates about the point far more easily than it translates.
    """
    if first_square <= 0.0:
        return square
    return max(square - product * product / first_square, LEAST_SQUARE * square)


@routine
def factor_schur(system, work, dependent_part):
    """Compute the Cholesky factor of the Schur complement in place, row by row within the envelope.

    Returns the number of dependent rows. Each gets a zero multiplier; the accelerations are then those of the
    pseudo-inverse (Eq. 59) as long as the constraints are consistent.
    """
    dependent, before = 0, 0.0
    work.least[0] = 1.0
    for i in range(system.rows.size):
        first, start = system.rows[i].first, system.rows[i].start - system.rows[i].first
        own = work.schur[start + i]
        if system.rows[i].second:
            own = own_square(own, work.schur[start + i - 1], before)
        before = work.schur[start + i]
        for j in range(first, i):
            first_j, start_j = system.rows[j].first, system.rows[j].start - system.rows[j].first
            total = work.schur[start + j]
            for k in range(max(first, first_j), j):
                total -= work.schur[start + k] * work.schur[start_j + k]
            # Diagonals hold reciprocals; the diagonal of a dependent row is zero, which keeps its column zero.
            work.schur[start + j] = total * work.schur[start_j + j]
        diagonal = work.schur[start + i]
        pivot = diagonal
        for k in range(first, i):
            pivot -= work.schur[start + k] * work.schur[start + k]
        if work.redundant[i] > 0.0 and pivot > INDEPENDENT * diagonal:
            work.redundant[i] = 0.0
        # Rows of springs are compliant and never depend on others.
        counts = system.rows[i].kind == CONSTRAINT and work.redundant[i] == 0.0
        if counts and pivot < work.least[0] * own:
            work.least[0], work.least[1] = pivot / own, i
        if pivot > max(dependent_part, work.redundant[i]) * diagonal:
            work.schur[start + i] = 1.0 / sqrt(pivot)
        else:
            work.schur[start + i] = 0.0
            dependent += 1
    return dependent


@routine
def solve_schur(system, work, x):
    """Solve with the factored Schur complement, in place."""
    for i in range(system.rows.size):
        first, start = system.rows[i].first, system.rows[i].start - system.rows[i].first
        total = x[i]
        for k in range(first, i):
            total -= work.schur[start + k] * x[k]
        x[i] = total * work.schur[start + i]
    for i in range(system.rows.size - 1, -1, -1):
        first, start = system.rows[i].first, system.rows[i].start - system.rows[i].first
        x[i] *= work.schur[start + i]
        for k in range(first, i):
            x[k] -= work.schur[start + k] * x[i]


@inlined
def row_scale(system, r, work, scale):
    """Return the factor that makes the iteration matrix symmetric.

    It is scale for a constraint, 1/b for a spring, else 1/g.
    """
    kind = system.rows[r].kind
    if kind == SPRING:
        return 1.0 / work.step[0]
    return scale if kind == CONSTRAINT else 1.0 / sqrt(work.step[0])


@kernel
def orient(system, q, work, dependent_part):
    """Rotate the factored bodies to their angles in q and factor the Schur complement.

    Returns the number of dependent rows.
    """
    fill(work.schur, 0.0)
    turn_axes(system, q, work.axes)
    for i in range(system.bodies.size):
        phi = q[system.bodies[i].offset + 2]
        work.frame[i, 0], work.frame[i, 1] = cos(phi), sin(phi)
        add_schur(system, i, work)
    for r in range(system.rows.size):
        if system.rows[r].kind != CONSTRAINT:
            work.schur[system.rows[r].start + r - system.rows[r].first] += work.compliance[r] * row_scale(
                system, r, work, 1.0
            )
    return factor_schur(system, work, dependent_part)


@unoptimised
def factor_system(system, b, q, work):
    """Factor the iteration matrix [M + b K, Phi_q^T; Phi_q, 0] at q; return the number of dependent rows."""
    factor_bodies(system, b, q, work)
    return orient(system, q, work, DEPENDENT_ROW)


@inlined
def to_body_frame(system, i, work, x):
    """Rotate the translational part of body i in x from the ground frame to the factor's body frame."""
    o = system.bodies[i].offset
    c, s = work.frame[i, 0], work.frame[i, 1]
    x[o], x[o + 1] = c * x[o] + s * x[o + 1], c * x[o + 1] - s * x[o]


@inlined
def to_ground_frame(system, i, work, x):
    """Rotate the translational part of body i in x back to the ground frame."""
    o = system.bodies[i].offset
    c, s = work.frame[i, 0], work.frame[i, 1]
    x[o], x[o + 1] = c * x[o] - s * x[o + 1], s * x[o] + c * x[o + 1]


@inlined
def lanes_times(system, i, matrix, x, scratch):
    """Sum x over the coordinates of body i by the lanes of work.jac or work.response, into scratch.lanes."""
    body = system.bodies[i]
    for block in range(0, body.lanes, LANES):
        total = zeros()
        at = body.jac + block
        for j in range(body.offset, body.offset + 3 + body.nf):
            total = add_scaled(total, load(matrix, at), x[j])
            at += body.lanes
        store(scratch.lanes, block, total)


@inlined
def add_lanes(system, i, work, scale, spring_scale, damper_scale, rows):
    """Add the result of `lanes_times` for body i's constraint rows to rows, times the scale of their kind."""
    body = system.bodies[i]
    c, s, lanes = work.frame[i, 0], work.frame[i, 1], work.scratch.lanes
    for k in range(body.port, body.port_end):
        port = system.ports[k]
        kind, x = system.rows[port.row].kind, port.local
        kind_scale = scale if kind == CONSTRAINT else (spring_scale if kind == SPRING else damper_scale)
        factor = port.weight * kind_scale
        if port.kind == ANGLE:
            rows[port.row] += factor * lanes[x]
        elif port.kind == AXIS:
            for part in range(port.parts):
                rows[port.row] += kind_scale * share(work, port, 0, part, c, s) * lanes[x + part]
        else:
            rows[port.row] += factor * (c * lanes[x] - s * lanes[x + 1])
            rows[port.row + 1] += factor * (s * lanes[x] + c * lanes[x + 1])


@inlined
def jacobian_times(system, i, work, x, scale, spring_scale, damper_scale, rows):
    """Add J x of body i to rows, times the scale of their kind; x in the body frame."""
    lanes_times(system, i, work.jac, x, work.scratch)
    add_lanes(system, i, work, scale, spring_scale, damper_scale, rows)


@inlined
def reactions(system, i, work, mu):
    """Compute minus the forces of the multipliers on body i, -J^T mu by lanes, into scratch.lanes."""
    body = system.bodies[i]
    c, s, lanes = work.frame[i, 0], work.frame[i, 1], work.scratch.lanes
    for k in range(body.port, body.port_end):
        port = system.ports[k]
        x = port.local
        if port.kind == ANGLE:
            lanes[x] = -port.weight * mu[port.row]
        elif port.kind == AXIS:
            for part in range(port.parts):
                lanes[x + part] = -mu[port.row] * share(work, port, 0, part, c, s)
        else:
            fx, fy = port.weight * mu[port.row], port.weight * mu[port.row + 1]
            lanes[x], lanes[x + 1] = -(c * fx + s * fy), s * fx - c * fy
    for x in range(body.parts, body.lanes):
        lanes[x] = 0.0


@inlined
def lanes_of(system, i, j, work):
    """Return the sum of scratch.lanes for coordinate j of body i."""
    body = system.bodies[i]
    return row_product(work.response, body.jac + j * body.lanes, body.lanes, work.scratch.lanes)


@kernel
def solve_system(system, work, x, mu):
    """Solve [M + b K, Phi_q^T; Phi_q, -C/b] [x; mu] = [x; mu] in place; x in the ground frame.

    C holds the compliance of springs, zero for constraints; the block is -C/g for dampers.
    """
    solve_all(system, work, work.inverse, x, mu)


@inlined
def solve_all(system, work, inverse, x, mu):
    """Solve as `solve_system`; `inverse` is work.inverse, None if no body has a dense matrix."""
    lanes = work.scratch.lanes
    for r in range(mu.size):
        mu[r] = -mu[r]
    for i in range(system.bodies.size):
        body = system.bodies[i]
        o, rigid = body.offset, body.parts
        to_body_frame(system, i, work, x)
        lanes_times(system, i, work.response, x, work.scratch)
        add_lanes(system, i, work, 1.0, 1.0, 1.0, mu)
        if body.full == 0:
            x[o], x[o + 1], x[o + 2] = solve_rigid(work.frame[i], lanes[rigid], lanes[rigid + 1], lanes[rigid + 2])
    solve_schur(system, work, mu)
    for i in range(system.bodies.size):
        body = system.bodies[i]
        o = body.offset
        reactions(system, i, work, mu)
        if body.full == 0:
            for r in range(3):
                lanes[body.parts + r] = x[o + r]
            for r in range(3):
                x[o + r] = lanes_of(system, i, r, work)
            for j in range(3, 3 + body.nf):
                x[o + j] = work.flex[DINV, body.flex + j - 3] * x[o + j] + lanes_of(system, i, j, work)
        else:
            dense_times(system, i, inverse, work.scratch.rigid, x)
            for j in range(3 + body.nf):
                x[o + j] += lanes_of(system, i, j, work)
        to_ground_frame(system, i, work, x)


@routine
def right_hand_side(system, work, scale):
    """Set the right-hand side of `solve_system` to -f and -rows, with rows times their `row_scale`."""
    for j in range(work.f.size):
        work.x[j] = -work.f[j]
    for r in range(work.rows.size):
        work.mu[r] = -work.rows[r] * row_scale(system, r, work, scale)


@inlined
def solve_residuals(system, work, scale):
    """Compute the correction for the residuals in work.f and work.rows into work.x and work.mu."""
    right_hand_side(system, work, scale)
    solve_system(system, work, work.x, work.mu)
