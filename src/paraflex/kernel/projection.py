"""Projection onto the constraints: positions, then velocities, by the least change in the metric of the factor.

The metric is M + b K, the mass matrix and the stiffness as seen by a step of g^2 = b (Cuadrado, Cardenal and Bayo
1997). With the mass matrix alone a correction would excite the stiffest modes.
"""

from .arrays import add, fill
from .compiling import routine
from .constraints import constraint_values
from .linear import solve_system

# Smaller violations, in units of their rows, count as zero; the factor is that of the step's start, so each pass
# leaves a small part.
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
    """Return the largest violation of a constraint, or of its rate, relative to the unit of its row."""
    violation = 0.0
    for r in range(rows.size):
        violation = max(violation, abs(rows[r]) / system.rows[r].unit)
    return violation


@routine
def least_change(system, violation, work):
    """Compute the least x with Phi_q x = -violation into work.x."""
    for r in range(violation.size):
        work.mu[r] = -violation[r]
    fill(work.x, 0.0)
    solve_system(system, work, work.x, work.mu)
