"""Projection onto the constraints: positions, then velocities, by the least change in the metric of the factor.

That metric is M + b K, the mass matrix and the stiffness as a step of g^2 = b feels it (Cuadrado, Cardenal and
Bayo 1997): with the mass alone a correction would ring in the stiffest modes.
"""

from __future__ import annotations

from paraflex.kernel.arrays import add, fill
from paraflex.kernel.compiling import routine
from paraflex.kernel.constraints import constraint_values
from paraflex.kernel.linear import solve_system

# Violations this small count as none, in units of their rows; the factor is of the step's start, so each pass leaves a
# small part.
NO_VIOLATION, PASSES = 4e-14, 4


@routine
def project(system, signals, t, q, v, work):
    """Change q until Phi = 0, then v until Phi' = 0."""
    for _ in range(PASSES):
        constraint_values(system, signals, t, q, v, work.scratch, work.rows, work.mu)
        if largest_violation(system, work.rows) <= NO_VIOLATION:
            break
        least_change(system, work.rows, work)
        add(work.x, q)
    for _ in range(PASSES):
        constraint_values(system, signals, t, q, v, work.scratch, work.mu, work.rows)
        if largest_violation(system, work.rows) <= NO_VIOLATION:
            break
        least_change(system, work.rows, work)
        add(work.x, v)


@routine
def largest_violation(system, rows):
    """The largest violation of a constraint, or of its rate, as a part of the unit of its row."""
    violation = 0.0
    for r in range(rows.size):
        violation = max(violation, abs(rows[r]) / system.rows[r].unit)
    return violation


@routine
def least_change(system, violation, work):
    """The least x with Phi_q x = -violation, into work.x."""
    for r in range(violation.size):
        work.mu[r] = -violation[r]
    fill(work.x, 0.0)
    solve_system(system, work, work.x, work.mu)
