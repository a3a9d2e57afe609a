"""Positions, velocities and accelerations of a rigid mechanism over the travel of its drive, and its rigid torques."""

import math
import time
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np

from paraflex.arguments import checked_arguments, named_in_errors
from paraflex.arrays import Array
from paraflex.dynamics import System, build_system, reference_pose, still_signals
from paraflex.dynamics.stiffness import RestingForces
from paraflex.errors import AssemblyError, InputError
from paraflex.findings import Finding
from paraflex.integrators import Solution, check_times
from paraflex.kernel.bodies import stored_energy
from paraflex.kernel.constraints import constraint_values
from paraflex.kernel.packed import make_scratch
from paraflex.limits import solvable
from paraflex.mechanism import Mechanism, standing
from paraflex.mechanism.masses import check_masses, with_any_masses
from paraflex.motion import MotionRun
from paraflex.paths import ModelWithPaths
from paraflex.paths.loops import LoopClosure
from .assemblies import FoundAssembly, assemblies_of
from .exact import NO_TASKS, Drive, ExactMotion
from .features import KinematicFeatures, features_of
from .ranges import chosen_drive, driven_loops, followed, ranged

# Samples between which properties are located: of a drive, and at most for other motions.
_FINE, _FINEST = 361, 1441


@named_in_errors("a driven motion", "the motion that kinematics returns")
@dataclass(frozen=True)
class DrivenMotion(MotionRun):
    """Motion of a rigid mechanism that its drives determine.

    It is a run whose solution comes from the closure of the loops instead of integration: every sample is exact to
    rounding. Datasets, reports, figures and films are made of it as of other runs.

    Attributes
    ----------
    drive : Drive, optional
        Joint that moves at constant speed; None if the mechanism's own prescribed motions act.
    loops : LoopClosure
        Equations that determine the motion.
    """

    drive: Drive | None
    loops: LoopClosure
    open_loop: ClassVar[bool] = False

    @cached_property
    def findings(self) -> tuple[Finding, ...]:
        """Findings of the motion; none, as it is exact to rounding."""
        return ()

    @cached_property
    def exact(self) -> ExactMotion:
        """The motion at any time, exact to rounding: over one turn of the drive, with samples of its own."""
        drive, solution = self.drive, self.solution
        if drive is not None and drive.turns > 1.0:
            drive = replace(drive, end=drive.start + math.copysign(2.0 * math.pi, drive.end - drive.start))
        end = float(solution.t[-1]) if drive is None else drive.duration
        times = np.linspace(0.0, end, _FINE if drive is not None else int(np.clip(solution.t.size, _FINE, _FINEST)))
        if times.size != solution.t.size or times[-1] != solution.t[-1]:
            t, q, v, a = followed(self.loops, times, solution.q[0], drive)
            solution = replace(solution, t=t, q=q, v=v, a=a)
        return ExactMotion(self.system, solution, drive, self.loops)

    @cached_property
    def features(self) -> KinematicFeatures:
        """Transmission angles, dead points, time ratios and coupler curves."""
        return features_of(self.exact)

    def assemblies(self, starts: int = 200) -> list[FoundAssembly]:
        """Return all assemblies found with the drives as at the first sample; see `assemblies_of`."""
        return assemblies_of(self.exact, starts)


@checked_arguments()
@solvable("kinematics")
def kinematics(
    mechanism: Mechanism | ModelWithPaths,
    drive: str | None = None,
    *,
    start: float | None = None,
    end: float | None = None,
    speed: float | None = None,
    duration: float | None = None,
    samples: int = 361,
    assembly: str | None = None,
) -> DrivenMotion:
    """Compute positions, velocities and accelerations of a mechanism over the travel of a joint that drives it.

    All bodies are rigid. Masses have no effect and are not needed.

    Parameters
    ----------
    mechanism : Mechanism or Model
        Mechanism, or a model with one.
    drive : str, optional
        Joint that moves at constant speed. By default the mechanism's prescribed motions act, or, if there are none,
        the joint of its only motor.
    start, end : float, optional
        First and last angle [rad] or travel [m] of the drive. By default a whole turn from the assembly or from
        `start`; if the joint cannot make one, the range between its limits of reach.
    speed : float, optional
        Speed of the drive [rad/s, m/s]; by default that of the prescribed motion at its joint, else 1.
    duration : float, optional
        Duration of prescribed motions that are not of constant speed [s]; that of the model's study by default.
    samples : int
        Number of samples, evenly spaced, both ends included.
    assembly : str, optional
        Assembly in which the mechanism moves; the first by default.

    Returns
    -------
    DrivenMotion
        Motion at the samples. Forces and energies are NaN: see `torques`.

    Raises
    ------
    InputError
        An unknown joint or one that does not move, a range out of order, or drives that do not determine the motion.
    AssemblyError
        The loops do not close.
    UnreachablePathError
        The drive cannot cover the range, because of a limit of reach or a change point; the error names its angle or
        travel.
    """
    began = time.perf_counter()
    check_times(None, samples)
    for name, value in (("start", start), ("end", end), ("speed", speed)):
        if value is not None and not math.isfinite(value):
            raise InputError("not a finite number", field=name, value=value, remedy="give it in SI units and radians")
    light = with_any_masses(Mechanism.from_source(mechanism))
    moved = standing(light.rigid(), assembly)
    begun = LoopClosure(moved, 0.0, None, NO_TASKS)
    near = reference_pose(begun.system, moved.assembly(assembly))
    law = chosen_drive(moved, drive, start, end, speed, begun.system, near)
    if law is None:
        if duration is None:
            duration = getattr(getattr(mechanism, "study", None), "duration", None)
        if duration is None:
            raise InputError("is missing", field="duration", remedy="give it in seconds, or name a drive")
        check_times(duration, None)
        loops, pose = driven_loops(moved, near, duration)
        arrays = followed(loops, np.linspace(0.0, duration, samples), pose)
    else:
        try:
            loops, pose, law = ranged(moved, law, near, fixed=end is not None)
        except AssemblyError:
            if start is not None:
                raise
            # The assembly's angle of the drive is approximate: another joint's may be nearer.
            closed = begun.assembled(moved.assembly(assembly))
            law = chosen_drive(moved, drive, start, end, speed, begun.system, closed)
            assert law is not None
            loops, pose, law = ranged(moved, law, closed, fixed=end is not None)
        moved = loops.mechanism
        arrays = followed(loops, np.linspace(0.0, law.duration, samples), pose, law)
    system = build_system(moved)
    return DrivenMotion(system, arrays[0], {motor.name: 0.0 for motor in moved.motors},
                        _solution(system, arrays, began), law, loops)  # fmt: skip


@checked_arguments()
@solvable("rigid torques")
def torques(
    mechanism: Mechanism | ModelWithPaths,
    drive: str | None = None,
    *,
    start: float | None = None,
    end: float | None = None,
    speed: float | None = None,
    duration: float | None = None,
    samples: int = 361,
    assembly: str | None = None,
) -> DrivenMotion:
    """Compute the motion as `kinematics` does, with the torque of the drive, joint forces and shaking forces.

    The inverse dynamics of the rigid mechanism includes weight, loads, springs, dampers and friction.

    Parameters
    ----------
    mechanism, drive, start, end, speed, duration, samples, assembly
        See `kinematics`.

    Returns
    -------
    DrivenMotion
        Motion with multipliers and energies; the work is NaN.

    Raises
    ------
    InputError, AssemblyError, UnreachablePathError
        See `kinematics`; also InputError for a body without mass.
    """
    check_masses(Mechanism.from_source(mechanism))
    motion = kinematics(
        mechanism, drive, start=start, end=end, speed=speed, duration=duration, samples=samples, assembly=assembly
    )
    return replace(motion, solution=with_loads(motion.system, motion.solution))


def _solution(system: System, arrays: tuple[Array, ...], began: float) -> Solution:
    """Return the solution of exact positions, velocities and accelerations, without forces and energies."""
    t, q, v, a = arrays
    none = np.full(t.size, np.nan)
    signals = still_signals(system.mechanism, float(t[-1]))[0]
    scratch, gaps = make_scratch(system.packed), np.zeros((2, t.size, system.m))
    for k, at in enumerate(t.tolist()):
        constraint_values(system.packed, signals, at, q[k], v[k], scratch, gaps[0, k], gaps[1, k])
    return Solution(
        t=t, q=q, v=v, a=a, multipliers=np.full((t.size, system.m), np.nan), kinetic_energy=none, strain_energy=none,
        work=none, status="complete", message="", steps=t.size, energy_balance_max=math.nan, method="closure of loops",
        constraint_position_max=float(np.max(np.abs(gaps[0]))), constraint_velocity_max=float(np.max(np.abs(gaps[1]))),
        wall_time=time.perf_counter() - began,
    )  # fmt: skip


def with_loads(system: System, solution: Solution) -> Solution:
    """Return a solution with the multipliers that its motion requires, and energies.

    Phi_q^T lambda = -(M a + h - loads), with the multipliers of springs, dampers and friction from their laws.
    """
    forces, held = RestingForces(system, 0.0, beams=True), system.constrained
    forces.signals = still_signals(system.mechanism, float(solution.t[-1]))[0]
    scratch = make_scratch(system.packed)
    multipliers, energies = np.zeros(solution.multipliers.shape), np.zeros((solution.t.size, 2))
    for k, (t, q, v, a) in enumerate(zip(solution.t, solution.q, solution.v, solution.a, strict=True)):
        forces.time, forces.v, forces.a = float(t), v, a
        lam = forces.compliant(q)
        rows = system.dimensionless_jacobian(q)[held]
        left = forces(q, lam)[0] * system.units
        lam[held] = -np.linalg.solve(rows.T, left) / system.row_units[held]
        multipliers[k] = lam
        energies[k] = stored_energy(system.packed, q, v, lam, scratch)[:2]
    return replace(solution, multipliers=multipliers, kinetic_energy=energies[:, 0], strain_energy=energies[:, 1])
