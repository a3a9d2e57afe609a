"""Traces of a run for metrics, computed without a dataset, which would take longer than all metrics."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Generic, TypeVar, overload

import numpy as np

from paraflex.control.laws.joints import internal_torques
from paraflex.control.loop.run_loop import ControllerRecord
from paraflex.control.loop.runs import ControlledMotion, ControlledTracking
from paraflex.dynamics import System, joint_coordinate
from paraflex.dynamics.joint_loads import (
    LoadComponents,
    Loads,
    drive_torques,
    joint_loads,
    load_errors,
    undetermined_loads,
)
from paraflex.dynamics.points import PointMotion, point_motion
from paraflex.dynamics.quasi_static import joint_accelerations
from paraflex.equilibria.conditions import Conditions, Coordinate
from paraflex.equilibria.result import Statics
from paraflex.integrators import Solution
from paraflex.mechanism import PointRef
from paraflex.motion import MotionRun
from paraflex.tracking import TrackingRun
from paraflex.validity import Validity
from .formulas import length
from .numbers import stacked
from .outlines import deflections
from .stress import SectionResult, section_result, stress_errors
from .traces import Trace, Traces

R = TypeVar("R", TrackingRun, MotionRun, Statics)


class SolutionTraces(Generic[R]):
    """Traces from the solution of a run, along a path or not, at its k samples; the run may have a complex step."""

    run: R
    torque: Trace

    @property
    def system(self) -> System:
        """System of the run."""
        return self.run.system

    @property
    def solution(self) -> Solution:
        """Solution of the run."""
        return self.run.solution

    @property
    def validity(self) -> Validity | None:
        """Validity of the model in the run; None if not defined."""
        return self.run.validity

    @cached_property
    def deflection(self) -> Trace:
        """Signed deflections of the stations of all flexible bodies from their chords (k, stations) [m]."""
        return deflections(self.system, self.solution.q)

    @cached_property
    def sections(self) -> SectionResult | None:
        """Section forces of the beams; None if none is flexible."""
        solution = self.solution
        return section_result(self.system, solution.q, solution.v, solution.a, solution.multipliers)

    @cached_property
    def power(self) -> Trace:
        """Power of every motor (k, motors) [W]; zero for passive ones."""
        return self._of_joints([motor.joint for motor in self.system.described.motors]) * self.torque

    @cached_property
    def drive_torque(self) -> Trace:
        """Torque [N m] or force [N] of every prescribed motion (k, drives); NaN if redundant constraints share it."""
        return np.where(self._undetermined.drive, np.nan, drive_torques(self.system, self.solution.multipliers))

    @cached_property
    def drive_power(self) -> Trace:
        """Power of every prescribed motion (k, drives) [W]."""
        return self._of_joints([one.joint for one in self.system.described.prescribed]) * self.drive_torque

    @cached_property
    def joint_force(self) -> Trace:
        """Magnitude of the force in every joint (k, joints) [N].

        Multipliers near singular positions, where they have a pole, are taken as zero. The force is NaN if redundant
        constraints share it.
        """
        return length(self.joint_loads.force)

    @cached_property
    def joint_loads(self) -> Loads:
        """Forces (k, joints, 2) [N] and moments (k, joints) [N m] of all joints, with NaN as in `joint_force`."""
        multipliers = np.where(np.isnan(self.solution.multipliers), 0.0, self.solution.multipliers)
        loads = joint_loads(self.system, self._joints, self.solution.q, multipliers, self.torque)
        unknown = self._undetermined
        force = np.where(unknown.force.any(axis=2, keepdims=True), np.nan, loads.force)
        return Loads(force, np.where(unknown.moment, np.nan, loads.moment))

    def joint_quantity(self, name: str, word: str) -> Trace:
        """Return a quantity of a joint at all samples (k,) in SI units, by its word.

        The words are "angle" or "travel", "rate", "acceleration", "force" (its magnitude), "fx", "fy" and "moment".
        """
        if word in ("force", "fx", "fy", "moment"):
            k, (force, moment) = self._joints.index(name), self.joint_loads
            each = {"force": length(force[:, k]), "fx": force[:, k, 0], "fy": force[:, k, 1], "moment": moment[:, k]}
            return each[word]
        solution = self.solution
        if word == "acceleration":
            return joint_accelerations(self.system, name, solution.q, solution.v, solution.a)[2]
        found = joint_coordinate(self.system, name, solution.q, solution.v)
        return found.rate if word == "rate" else found.value

    def point_motion(self, point: PointRef) -> PointMotion:
        """Return the motion of a point of a body at all samples."""
        return point_motion(self.system, point, self.solution.q, self.solution.v, self.solution.a)

    @property
    def conditions(self) -> Conditions | None:
        """Conditions of equilibria; None for other runs."""
        return None

    @cached_property
    def load_errors(self) -> LoadComponents:
        """Bounds of the integration errors of joint and drive loads; NaN if unknown."""
        errors = self.solution.multiplier_errors
        return load_errors(self.system, self._joints, np.full(self.system.m, np.nan) if errors is None else errors)

    @property
    def stress_error(self) -> float:
        """Bound of the integration errors of stresses [Pa]; NaN if unknown."""
        errors = self.solution.coordinate_errors
        return np.nan if errors is None else float(np.fmax.reduce(stress_errors(self.system, errors), initial=np.nan))

    @cached_property
    def joint_speed(self) -> Trace:
        """Rate of every joint's angle [rad/s], or travel [m/s] (k, joints)."""
        return self._of_joints(self._joints)

    @property
    def controllers(self) -> tuple[ControllerRecord, ...]:
        """Records of the controllers; empty without controllers."""
        return self.run.controllers if isinstance(self.run, ControlledTracking | ControlledMotion) else ()

    @cached_property
    def _undetermined(self) -> LoadComponents:
        return undetermined_loads(self.system, self._joints, self.solution.q.real, self.solution.acting)

    @property
    def _joints(self) -> list[str]:
        return [joint.name for joint in self.system.described.joints]

    def _of_joints(self, names: list[str]) -> Trace:
        """Return the rates (k, joints) of joints by name."""
        solution = self.solution
        rates = [joint_coordinate(self.system, name, solution.q, solution.v).rate for name in names]
        return stacked(rates, len(solution.q))


@dataclass(frozen=True)
class RunTraces(Traces, SolutionTraces[TrackingRun]):
    """Traces of a run along a path.

    Attributes
    ----------
    run : TrackingRun
        Run, which may have a complex step.
    """

    run: TrackingRun

    @property
    def condition(self) -> Trace:
        """Condition number of the actuation matrix (k,)."""
        return self.run.condition

    @property
    def desired(self) -> Trace:
        """Desired positions of the end-effector (k, 2) [m]."""
        return self.run.task.motion.desired.position[: len(self.t)]

    @cached_property
    def internal_torque(self) -> Trace:
        """Part of the torques (samples, motors) that only strains links [N m], for sliding motors [N]."""
        return internal_torques(self.run.task, self.run.mode, self.torque)


@dataclass(frozen=True)
class MotionTraces(SolutionTraces[MotionRun]):
    """Traces of a run without a path.

    Attributes
    ----------
    t : (k,) array
        Sample times [s].
    torque : (k, motors) array
        Motor torques [N m], for sliding motors forces [N].
    run : MotionRun
        Run, which may have a complex step.
    """

    t: Trace
    torque: Trace
    run: MotionRun


@dataclass(frozen=True)
class StaticsTraces(SolutionTraces[Statics]):
    """Traces of equilibria, at their k steps and limit points.

    Attributes
    ----------
    run : Statics
        Branch of equilibria.
    """

    run: Statics

    @property
    def system(self) -> System:
        """System with the additional constraint rows of held, moved and loaded coordinates."""
        return self.run.equations.extended

    @property
    def conditions(self) -> Conditions:
        """Conditions of the equilibria."""
        return self.run.equations.conditions

    def joint_quantity(self, name: str, word: str) -> Trace:
        """Return a load of a joint, or the change (k,) of its coordinate since the start; see the runs' method."""
        found = super().joint_quantity(name, word)
        start = self.run.equations.start.q[None]
        return found - joint_coordinate(self.system, name, start).value if word in ("angle", "travel") else found

    def point_motion(self, point: PointRef) -> PointMotion:
        """Return the change of a point's position since the start as its position, at rest."""
        found, start = super().point_motion(point), self.run.equations.start.q[None]
        at_start = point_motion(self.system, point, start, 0.0 * start, 0.0 * start)
        return found._replace(position=found.position - at_start.position)

    @property
    def torque(self) -> Trace:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Zeros (k, motors): in statics motor torques are efforts at named coordinates."""
        return np.zeros((len(self.run.equilibria), len(self.system.described.motors)))

    @cached_property
    def travel(self) -> Trace:
        """Change (k, coordinates) of every named coordinate since the start [m, rad]."""
        return self._columns(self.run.travel, self.run.coordinates)

    @cached_property
    def effort(self) -> Trace:
        """Force or torque (k, coordinates) at every named coordinate [N, N m]."""
        return self._columns(self.run.known_effort, self.run.coordinates)

    @cached_property
    def stiffness(self) -> Trace:
        """Stiffness (k, directions) of the coordinates for which it was requested [N/m, N m/rad]."""
        return self._columns(self.run.stiffness, self.run.directions)

    @property
    def compliance(self) -> Trace:
        """Compliance (k, directions) [m/N, rad/(N m)]; infinite without stiffness and for unstable equilibria."""
        with np.errstate(divide="ignore"):
            return np.where((self.stiffness <= 0.0) | ~self.run.stable[:, None], np.inf, 1.0 / self.stiffness)

    @property
    def frequency(self) -> Trace:
        """Lowest natural frequency (k,) [Hz]; NaN if the mechanism cannot move."""
        return self._lowest(self.run.frequencies)

    @property
    def free_frequency(self) -> Trace:
        """Lowest natural frequency (k,) with the moved coordinates released [Hz]."""
        return self._lowest(self.run.free_frequencies)

    @staticmethod
    def _lowest(found: Trace) -> Trace:
        return found[:, 0] / (2.0 * np.pi) if found.shape[1] else np.full(len(found), np.nan)

    @property
    def buckling_factor(self) -> float:
        """Lowest buckling factor as seen from the start; NaN if there is none."""
        return float(self.run.buckling[0, 0]) if self.run.buckling.size else float("nan")

    @property
    def limit_load(self) -> float:
        """Fraction of the given loads and travels at the first limit point; NaN if there is none."""
        return float(next(iter(self.run.fraction[self.run.limit]), np.nan))

    @property
    def unstable_steps(self) -> int:
        """Number of unstable steps (limit points are not counted)."""
        return int(np.sum(~self.run.stable & ~self.run.limit))

    def _columns(self, quantity: Callable[[str], Trace], of: Sequence[Coordinate]) -> Trace:
        return stacked([quantity(one.name) for one in of], len(self.run.equilibria))


@overload
def run_traces(run: TrackingRun) -> RunTraces: ...
@overload
def run_traces(run: MotionRun) -> MotionTraces: ...
@overload
def run_traces(run: Statics) -> StaticsTraces: ...
def run_traces(run: TrackingRun | MotionRun | Statics) -> RunTraces | MotionTraces | StaticsTraces:
    """Return the traces of a run at the samples that it reached."""
    if isinstance(run, Statics):
        return StaticsTraces(run)
    if isinstance(run, MotionRun):
        return MotionTraces(run.solution.t, run.applied, run)
    task, k, position = run.task, run.samples, run.end_effector.position
    distance = length(position - task.motion.desired.position[:k])
    return RunTraces(run.solution.t[:k], task.path.duration, position, distance, run.applied, run)
