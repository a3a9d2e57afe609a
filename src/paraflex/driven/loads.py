"""Multipliers that the motion of a rigid mechanism requires, and their limits at change points."""

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import scipy

from paraflex.arrays import Array, Mask
from paraflex.dynamics import System, dependence, joint_coordinate, still_signals
from paraflex.dynamics.rank import NO_PART, joint_of_row
from paraflex.dynamics.stiffness import RestingForces
from paraflex.findings import Finding
from paraflex.integrators import Solution
from paraflex.kernel.bodies import stored_energy
from paraflex.kernel.packed import make_scratch
from .exact import AT, ExactMotion, placed

# Share of the largest load within which loads agree with other programs in the tests, and limits with closed forms.
RIGHT_TO, LIMITS_RIGHT_TO = 1e-9, 1e-6
# Singular values below this part of the largest leave forces undetermined.
_SINGULAR = 1e-9
# The same at a change point, whose place has an error, and work of the required forces on the free motion there below
# which they have a limit, as a part of the largest.
_FOLDED, _NO_WORK = 1e-6, 1e-6
# Distance of times whose forces give the limit at a change point, over the width in which the motion is interpolated.
_BEYOND = 1.25


class _Balance(NamedTuple):
    """Multipliers of laws of forces (m,), and the equations of the others, rows (n, held) x = left (n,), in units."""

    lam: Array
    rows: Array
    left: Array


def _balances(system: System, solution: Solution, effort: Array) -> Iterator[_Balance]:
    forces, held = RestingForces(system, 0.0, beams=True), np.flatnonzero(system.constrained)
    forces.signals = still_signals(system.mechanism, float(np.max(solution.t)))[0]
    motors = [motor.joint for motor in system.mechanism.motors]
    pushed = [joint_coordinate(system, joint, solution.q).rows for joint in motors]
    for k, (t, q, v, a) in enumerate(zip(solution.t, solution.q, solution.v, solution.a, strict=True)):
        forces.time, forces.v, forces.a = float(t), v, a
        lam = forces.compliant(q)
        left = forces(q, lam)[0] - sum(torque * rows[k] for torque, rows in zip(effort[k], pushed, strict=True))
        yield _Balance(lam, system.dimensionless_jacobian(q)[held].T, left * system.units)


def with_loads(system: System, solution: Solution, effort: Array) -> Solution:
    """Return a solution with the multipliers that its motion requires under torques of motors, and energies.

    Phi_q^T lambda = -(M a + h - loads), with the multipliers of springs, dampers and friction from their laws, of least
    norm where constraints depend on one another. At change points, where they are not determined, all are NaN.
    """
    held = np.flatnonzero(system.constrained)
    scratch, ranks = make_scratch(system.packed), np.zeros(solution.t.size)
    multipliers, energies = np.zeros((solution.t.size, system.m)), np.zeros((solution.t.size, 2))
    for k, (lam, rows, left) in enumerate(_balances(system, solution, effort)):
        found, _, ranks[k], _ = np.linalg.lstsq(rows, left, rcond=_SINGULAR)
        lam[held] = -found / system.row_units[held]
        q = solution.q[k]
        multipliers[k] = lam if ranks[k] == held.size else dependence(system, q).least_norm(lam)
        energies[k] = stored_energy(system.packed, q, solution.v[k], lam, scratch)[:2]
    multipliers[ranks < np.max(ranks)] = np.nan
    return replace(solution, multipliers=multipliers, kinetic_energy=energies[:, 0], strain_energy=energies[:, 1])


def load_errors(system: System, multipliers: Array, share: float) -> Array:
    """Return bounds (m,) of the errors of multipliers (k, m): a share of the largest, moments over the size."""
    return share * np.nanmax(np.abs(multipliers * system.row_units), initial=0.0) / system.row_units


def with_limits(motion: ExactMotion, solution: Solution) -> tuple[Solution, Mask, list[Finding]]:
    """Return a solution with loads that has their limits at change points; rows (m,) without, and findings on them.

    At a change point the mechanism can move with its drives held. Forces have a limit if those that the motion
    requires do no work on this free motion; otherwise they grow without bound in the rows that take part in it. The
    limit is that of the cubic polynomial through forces on both sides or, near the end of a motion, on one.
    """
    system, multipliers = motion.system, solution.multipliers.copy()
    grows = np.zeros(system.m, dtype=bool)
    last, without = float(solution.t[-1]), dict[tuple[str, ...], list[float]]()
    width = _BEYOND * motion.beside
    for passed in motion.passed:
        near, far = sorted((passed, last - passed))
        steps = min(width, 0.5 * near) * np.array([-2.0, -1.0, 1.0, 2.0])
        if near < 0.2 * width:
            steps = math.copysign(min(width, 0.25 * far), 0.5 * last - passed) * np.arange(1.0, 5.0)
        t = passed + np.append(0.0, steps)
        q, v, a = (np.concatenate(each) for each in zip(*map(motion.at, t.tolist()), strict=True))
        about, idle = replace(solution, t=t, q=q, v=v, a=a), np.zeros((t.size, len(system.mechanism.motors)))
        unbounded = _unbounded(system, next(_balances(system, about, idle)))
        grows |= unbounded
        names = tuple(dict.fromkeys(joint_of_row(system.rows[row]) for row in np.flatnonzero(unbounded)))
        without.setdefault(names, []).append(passed)
        at = np.flatnonzero(np.abs(solution.t - passed) <= AT * width)
        if at.size:
            beside = with_loads(system, replace(about, t=t[1:], q=q[1:], v=v[1:], a=a[1:]), idle).multipliers
            limits = scipy.interpolate.BarycentricInterpolator(t[1:], beside)(solution.t[at])
            multipliers[at] = np.where(unbounded, multipliers[at], limits)
    found = [_growing(motion, names, times) for names, times in without.items() if names]
    return replace(solution, multipliers=multipliers), grows, found


def _unbounded(system: System, balance: _Balance) -> Mask:
    """Return the rows (m,) whose multipliers grow without bound towards a change point."""
    out, held = np.zeros(system.m, dtype=bool), np.flatnonzero(system.constrained)
    motions, sizes, stresses = np.linalg.svd(balance.rows, full_matrices=False)
    for work, size, stress in zip(balance.left @ motions, sizes, stresses, strict=True):
        if size < _FOLDED * sizes[0] and abs(work) > _NO_WORK * np.linalg.norm(balance.left):
            out[held] |= np.abs(stress) > NO_PART
    return out


def _growing(motion: ExactMotion, names: tuple[str, ...], times: list[float]) -> Finding:
    place, where = placed(motion.drive, times)
    return Finding(
        "loads-unbounded", place,
        f"forces in {', '.join(names)} grow without bound towards {where}, where assemblies meet",
        "add a link or a spring that carries the load past it, or keep away from it",
    )  # fmt: skip
