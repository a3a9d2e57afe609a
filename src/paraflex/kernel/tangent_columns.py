"""Columns of the tangent matrices of the equations of motion, computed together for bodies that are not connected."""

from .arrays import copy, fill
from .compiling import kernel
from .tangent import residual_tangent

# Part of the motion that changes: accelerations, velocities or coordinates.
ACCELERATION, VELOCITY, COORDINATE = range(3)


@kernel
def tangent_columns(system, weights, part, colours, q, v, a, lam, torques, compliance, direction, forces, rows):
    """Compute changes of the residuals by the coordinates of bodies, into forces (columns, n) and rows (columns, m).

    Parameters
    ----------
    part : int
        Part of the motion that changes, in steps of one: ACCELERATION, VELOCITY or COORDINATE.
    colours : (bodies,) array of int
        Colours of bodies; bodies of one colour are moved together. The columns are those of the first coordinate of all
        bodies of the first colour, of their second, and so on.
    weights, q, v, a, lam, torques, compliance, direction
        Arguments of `residual_tangent`; direction.friction holds the slopes of the rows of friction.

    Returns
    -------
    int
        Number of columns.
    """
    one = direction.q if part == COORDINATE else (direction.v if part == VELOCITY else direction.a)
    column, colour, found = 0, 0, True
    while found:
        found = False
        local, moved = 0, True
        while moved:
            fill(one, 0.0)
            moved = False
            for i in range(system.bodies.size):
                if colours[i] == colour:
                    found = True
                    if local < 3 + system.bodies[i].nf:
                        one[system.bodies[i].offset + local] = 1.0
                        moved = True
            if moved:
                residual_tangent(system, weights, q, v, a, lam, torques, compliance, 0, system.bodies.size, direction)
                copy(direction.f, forces[column])
                copy(direction.rows, rows[column])
                column += 1
            local += 1
        colour += 1
    fill(one, 0.0)
    return column
