"""Exact derivative of the residuals of `kernel.stage.equations` along a direction, term by term, derived by hand.

Along (dq, dv, da, dlambda) the residual F of the equations of motion changes by F_q dq + F_v dv + M da + J^T dlambda,
and the rows Phi'' + 2 alpha Phi' + beta^2 Phi by G_q dq + G_v dv + J da. The product rule is applied to the parts of
the residuals: points of bodies, forces at them, axes, lines. The prefix `d` of a name denotes a change along the
direction.
"""

from math import cosh
from typing import Annotated, NamedTuple

from paraflex.arrays import Array
from .arrays import Floats, allocated, apart, fill
from .compiling import by_reference, inlined, kernel, routine
from .constraints import joint_rates
from .joints import apply_torque, marker_angles, marker_motion, row_part
from .loads import lines_tangent, loads_tangent
from .packed import ANGLE, AXIS, CONSTRAINT, FRICTION, PackedSystem, sizes_of
from .tangent_axes import axes_tangent
from .tangent_bodies import body_terms_tangent
from .tangent_points import force_tangent, marker_tangent


@by_reference
class Tangent(NamedTuple):
    """Direction, and the changes along it."""

    q: Annotated[Floats, "n"]  # direction
    v: Annotated[Floats, "n"]
    a: Annotated[Floats, "n"]
    lam: Annotated[Floats, "m"]
    f: Annotated[Floats, "n"]  # change of the residual of the equations of motion
    rows: Annotated[Floats, "m"]  # change of the residual of the rows
    friction: Annotated[Floats, "m"]  # slope of the rows of friction against the rate, at the last `note_slopes`
    registers: Annotated[Floats, 2, "registers"]  # values of the operations of a law, and their changes
    points: Array | None  # (8, most lanes of mass points of a body) scratch of second-order geometry


def make_tangent(system: PackedSystem) -> Tangent:
    """Allocate a direction, set to zero, and the changes along it."""
    points = None if system.bending is None else apart((8, int(system.bodies["pitch"].max(initial=0))))
    return allocated(Tangent, sizes_of(system), points=points)


@inlined
def joints_tangent(system, i, weights, q, v, a, lam, direction):
    """Add the change of body i's part of the rows to direction.rows, and that of Phi_q^T lambda to direction.f."""
    body = system.bodies[i]
    for k in range(body.port, body.port_end):
        port = system.ports[k]
        marker = system.markers[port.marker]
        r, weight = port.row, port.weight
        if port.kind == ANGLE:
            angles = marker_angles(system, marker, direction.q, direction.v, direction.a)
            direction.rows[r] += weight * row_part(system.rows[r].kind, weights, angles)
            apply_torque(system, marker, weight * direction.lam[r], direction.f)
        elif port.kind != AXIS:
            _, _, _, _, _, _, rx, ry = marker_motion(system, marker, q, v, a)
            px, py, vx, vy, ax, ay, d_rx, d_ry = marker_tangent(system, marker, q, v, a, direction)
            direction.rows[r] += weight * (weights[0] * ax + weights[1] * vx + weights[2] * px)
            direction.rows[r + 1] += weight * (weights[0] * ay + weights[1] * vy + weights[2] * py)
            force = (weight * lam[r], weight * lam[r + 1])
            change = (weight * direction.lam[r], weight * direction.lam[r + 1])
            force_tangent(system, marker, q, force, change, (rx, ry), (d_rx, d_ry), direction)


@kernel
def note_slopes(system, q, v, rates, compliance, direction):
    """Compute the slopes of the rows of friction by the rate into direction.friction; `rates` is scratch (m,).

    `compliance` is the factor of their residuals: see `joints.finish_friction`.
    """
    if not joint_rates(system, q, v, rates):
        return
    for r in range(system.rows.size):
        row = system.rows[r]
        if row.kind == FRICTION:
            c = cosh(min(abs(rates[r]) / (row.compliance * row.limit), 300.0))
            direction.friction[r] = compliance[r] / (row.compliance * c * c)


@routine
def finish_rows(system, compliance, direction):
    """Add the compliance and the friction slope to the changes of rows that are not constraints."""
    for r in range(system.rows.size):
        kind = system.rows[r].kind
        if kind == FRICTION:
            direction.rows[r] = direction.friction[r] * direction.rows[r] - compliance[r] * direction.lam[r]
        elif kind != CONSTRAINT:
            direction.rows[r] -= system.rows[r].compliance * direction.lam[r]


@kernel
def residual_tangent(system, weights, q, v, a, lam, torques, compliance, first, last, direction):
    """Compute the change of the residuals along a direction, into direction.f and direction.rows.

    Parameters
    ----------
    weights : tuple of 3 float
        Weights of Phi'', Phi' and Phi in the rows of constraints, such as (1, 2 alpha, beta^2).
    torques : (acting,) array
        Torques left by `equations`.
    compliance : (m,) array
        Compliance in the workspace with which the residuals were computed.
    first, last : int
        Range of bodies, from first to before last. The direction must be zero in the coordinates of all other bodies,
        and in direction.lam unless the range has all bodies.
    direction : Tangent
        Direction, which is read; direction.f and direction.rows are written. `note_slopes` has been called at (q, v).
    """
    fill(direction.f, 0.0)
    fill(direction.rows, 0.0)
    for i in range(first, last):
        body_terms_tangent(system, i, q, v, a, direction, direction.points)
        joints_tangent(system, i, weights, q, v, a, lam, direction)
    axes_tangent(system, weights, q, v, a, lam, torques, direction)
    finish_rows(system, compliance, direction)
    loads_tangent(system, q, v, torques, direction)
    lines_tangent(system, q, v, torques, direction)


@kernel
def reaction_tangent(system, weights, q, v, a, lam, idle, first, last, direction):
    """Compute the change of Phi_q^T lambda into direction.f, and of the rows into direction.rows, without other forces.

    Along dlambda alone direction.f is Phi_q^T dlambda. `idle` (motors,) is zero; other arguments as for
    `residual_tangent`.
    """
    fill(direction.f, 0.0)
    fill(direction.rows, 0.0)
    for i in range(first, last):
        joints_tangent(system, i, weights, q, v, a, lam, direction)
    axes_tangent(system, weights, q, v, a, lam, idle, direction)
