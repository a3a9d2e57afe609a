"""Floating-point operations of the parts of a Newton iteration, by formula from the packed system.

A multiplication, addition, division, root, sine or cosine counts one; what is done with integers counts nothing. The
sums are those of the equations as `docs/theory.md` has them, each done once: what a kernel does besides, or saves, does
not change the count, so that rates of different kernels can be compared. Bodies with revolute joints, motors and
second-order geometry are counted; springs, dampers, loads and axes are not.
"""

from __future__ import annotations

import numpy as np

from paraflex.kernel.packed import ANGLE, GAUSS, PackedSystem
from paraflex.kernel.vectors import LANES


def equations(p: PackedSystem) -> int:
    """Residuals of motion and constraints at given q, v, a, lambda."""
    total = 0
    for body in p.bodies:
        n = int(body["nf"])
        total += _bent_terms(p, body) if p.bending is not None and body["slopes"] else _linear_terms(n)
        # Each motor: its torque along [1, N2'].
        total += int(body["motor_end"] - body["motor"]) * (2 + 2 * n)
        for port in p.ports[body["port"] : body["port_end"]]:
            total += _port(p, port, n)
    return total


def _linear_terms(n: int) -> int:
    """M a + h + K u of a body: I2 u, G2 u and G2 u', eight sums over modes, the flexible rows, the rigid rows."""
    return 6 * n**2 + 16 * n + 22 * n + 60


def _bent_terms(p: PackedSystem, body: np.void) -> int:
    """The same by mass points: slopes at Gauss points, a point's s, s', s'' and its force, which goes back to all."""
    n, total = int(body["nf"]), 40
    total += int(body["slopes"]) * (6 * n + 2 * n + 1) + 4 * n
    pitch = int(body["pitch"])
    mass, inertia = p.inertias[body["inertias"] :][pitch : 3 * pitch].reshape(2, pitch)
    weights = p.spans[body["spans"] :][: LANES * pitch].reshape(-1, LANES, LANES)
    for k in np.flatnonzero(mass + inertia).tolist():
        # A point is shortened by the Gauss points of its element, and by the sum over those of the elements before.
        total += 12 * n + 11 * (1 + int(np.count_nonzero(weights[k // LANES, :GAUSS, k % LANES]))) + 32 + 4 * n
        if inertia[k] > 0.0:
            total += 4 * n + 1
    return total


def _port(p: PackedSystem, port: np.void, n: int) -> int:
    """A joint's side: motion of its point from q, v, a, its part of the rows, the joint's force on the body."""
    if port["kind"] == ANGLE:
        return 8 * n + 6
    second_order = 0
    if p.bending is not None and p.markers[port["marker"]]["bending"] >= 0:
        # f, f' and f'' from B u and B u'; the force works on B u.
        second_order = 4 * n**2 + 9 * n + 2 * n
    return 12 * n + 46 + 12 + 4 * n + 12 + second_order


def solution(p: PackedSystem) -> int:
    """One solution with a factored iteration matrix: bodies forwards, multipliers, bodies backwards."""
    total = 4 * int(p.rows.size)
    for body in p.bodies:
        n = int(body["nf"])
        second_order = p.bending is not None and body["slopes"]
        total += 12 + (2 * (3 + n) ** 2 if second_order else 13 * n + 24)
        for port in p.ports[body["port"] : body["port_end"]]:
            parts = 1 if port["kind"] == ANGLE else 2
            total += parts * (4 * (3 + n) + 8)
    return total + 4 * envelope(p)


def envelope(p: PackedSystem) -> int:
    """Entries of the Schur complement's envelope left of the diagonal."""
    return int(sum(row - int(record["first"]) for row, record in enumerate(p.rows)))


def norm(p: PackedSystem) -> int:
    """x^T M x of all bodies."""
    total = 0
    for body in p.bodies:
        n = int(body["nf"])
        second_order = p.bending is not None and body["slopes"]
        total += 6 + (2 * (3 + n) ** 2 if second_order else 8 * n + 22)
    return total


def vectors(p: PackedSystem) -> int:
    """Q and v of the stage from a, signs of the right-hand side, and the sums that change a and lambda."""
    n = int(sum(3 + body["nf"] for body in p.bodies))
    return 4 * n + (n + 2 * int(p.rows.size)) + (n + int(p.rows.size))


def iteration(p: PackedSystem) -> dict[str, int]:
    """Parts of one iteration of Newton's method."""
    return {"equations": equations(p), "solve": solution(p), "norm": norm(p), "vectors": vectors(p)}
