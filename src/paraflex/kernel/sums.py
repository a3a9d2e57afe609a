"""Sums over the flexible coordinates of a body, computed in one pass, and their transposes.

Column k of `PackedSystem.columns` has the contributions of the body's coordinates to sum k: first S2 u and the like,
then N u and the slope N2' u of every marker on the body. A force conjugate to sum k acts on coordinate j with the
factor columns[j, k]: all forces on a body are first collected as *shares*, one per column, and then distributed to the
coordinates in a second pass.
"""

from math import cos, sin

from .compiling import inlined
from .vectors import LANES, add_product, add_scaled, load, store, summed, zeros

# The first columns of a body; its markers follow with three columns each: x, y and slope.
S2X_SUM, S2Y_SUM, I1_SUM, GJ_SUM = range(4)
FIRST_MARKER = 4


@inlined
def column_sums(matrix, first, width, n, e, q, v, a, out):
    """Compute weighted sums of n coordinates from e on, for q, v and a, into out.

    The weights are the columns of an (n, width) matrix that begins at `first`.
    """
    for block in range(0, width, LANES):
        of_q, of_v, of_a, at = zeros(), zeros(), zeros(), first + block
        for j in range(e, e + n):
            column = load(matrix, at)
            of_q = add_scaled(of_q, column, q[j])
            of_v = add_scaled(of_v, column, v[j])
            of_a = add_scaled(of_a, column, a[j])
            at += width
        store(out.q, block, of_q)
        store(out.v, block, of_v)
        store(out.a, block, of_a)


@inlined
def row_product(matrix, at, width, vector):
    """Return the product of a matrix row, `width` entries from `at` on, and a vector."""
    return part_product(matrix, at, 0, width, vector)


@inlined
def part_product(matrix, at, start, end, vector):
    """Return the product of the entries from start to end of a matrix row, which begins at `at`, and of a vector."""
    total = zeros()
    for block in range(start, end, LANES):
        total = add_product(total, load(matrix, at + block), load(vector, block))
    return summed(total)


@inlined
def body_sums(system, i, q, v, a, scratch):
    """Compute all sums of body i for u, u' and u'' into scratch, with the cosine and sine of its angle."""
    body = system.bodies[i]
    e = body.offset + 3
    scratch.turn[0], scratch.turn[1] = cos(q[e - 1]), sin(q[e - 1])
    column_sums(system.columns, body.columns, body.width, body.nf, e, q, v, a, scratch)


@inlined
def clear_shares(system, i, scratch):
    """Set the shares, the generalised forces on all sums of body i, to zero."""
    for block in range(0, system.bodies[i].width, LANES):
        store(scratch.shares, block, zeros())


@inlined
def body_products(system, i, q, v, scratch):
    """Compute G2 u, G2 u' and I2 u of body i into scratch."""
    body = system.bodies[i]
    e = body.offset + 3
    for block in range(0, body.stride, LANES):
        G2_q, G2_v, I2_q = zeros(), zeros(), zeros()
        at = body.products + block
        for j in range(body.nf):
            G2 = load(system.products, at)
            G2_q = add_scaled(G2_q, G2, q[e + j])
            G2_v = add_scaled(G2_v, G2, v[e + j])
            I2_q = add_scaled(I2_q, load(system.products, at + body.stride), q[e + j])
            at += 2 * body.stride
        store(scratch.G2_q, block, G2_q)
        store(scratch.G2_v, block, G2_v)
        store(scratch.I2_q, block, I2_q)


@inlined
def hand_on(system, i, scratch, f):
    """Add to f the forces on the flexible coordinates of body i that follow from the shares."""
    body = system.bodies[i]
    e, at = body.offset + 3, body.columns
    for j in range(body.nf):
        f[e + j] += row_product(system.columns, at, body.width, scratch.shares)
        at += body.width
