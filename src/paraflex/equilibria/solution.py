"""Equilibria as samples of a run at rest, for functions that evaluate runs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from paraflex.arrays import Array
from paraflex.dynamics import System
from paraflex.dynamics.points import point_motion
from paraflex.dynamics.sparse import stiffness_diagonal
from paraflex.integrators import Solution
from paraflex.kernel.packed import SPRING


def resting_solution(
    system: System, q: Array, multipliers: Array, acting: NDArray[np.int64], status: str, message: str
) -> Solution:
    """Return samples at rest with coordinates (k, n) and multipliers (k, m), numbered in place of times.

    `acting` holds the numbers of the rows that act.
    """
    zeros = np.zeros(len(q))
    return Solution(
        t=np.arange(len(q), dtype=float), q=q, v=np.zeros_like(q), a=np.zeros_like(q), multipliers=multipliers,
        kinetic_energy=zeros, strain_energy=strain_energy(system, q, multipliers), work=zeros, status=status,
        message=message, steps=len(q), rejected=0, newton_iterations=0, factorisations=0, wall_time=0.0,
        constraint_position_max=0.0, constraint_velocity_max=0.0, energy_balance_max=0.0, resting=True,
        acting=acting,
    )  # fmt: skip


def strain_energy(system: System, q: Array, multipliers: Array) -> Array:
    """Return the energy (k,) of beams, springs at joints, and springs between points [J]."""
    rows = system.packed.rows
    energy = 0.5 * q**2 @ stiffness_diagonal(system)
    energy += 0.5 * multipliers**2 @ np.where(rows["kind"] == SPRING, rows["compliance"], 0.0)
    still = np.zeros_like(q)
    for spring in system.mechanism.linear_springs:
        ends = (
            np.array(system.mechanism.ground[end.point]) if end.on_ground
            else point_motion(system, end, q, still, still).position for end in (spring.a, spring.b)
        )  # fmt: skip
        distance = np.linalg.norm(np.subtract(*ends), axis=1)
        energy += 0.5 * spring.stiffness * (distance - spring.length) ** 2
    return energy
