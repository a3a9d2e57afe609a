"""Traces of a run for metrics, without making a dataset, which takes longer than all metrics."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from paraflex.dynamics import joint_coordinate
from paraflex.dynamics.points import point_motion
from paraflex.results.formulas import length
from paraflex.results.outlines import deflections
from paraflex.results.stress import SectionResult, section_result
from paraflex.results.traces import Trace, Traces
from paraflex.tracking import TrackingRun


@dataclass(frozen=True)
class RunTraces(Traces):
    """Traces of a run.

    Attributes
    ----------
    run : TrackingRun
        It may have a complex step.
    """

    run: TrackingRun

    @cached_property
    def deflection(self) -> Trace:
        """Deflections of the stations of all flexible bodies from their chords (k, stations) [m], signed."""
        return deflections(self.run.task.system, self.run.solution.q)

    @cached_property
    def sections(self) -> SectionResult | None:
        """Section forces of the beams; None where none is flexible."""
        solution = self.run.solution
        return section_result(self.run.task.system, solution.q, solution.v, solution.a, solution.multipliers)

    @property
    def condition(self) -> Trace:
        """Condition number of the actuation matrix (k,)."""
        return self.run.condition

    @cached_property
    def power(self) -> Trace:
        """Power of every motor (k, motors) [W]; zero for passive ones."""
        task, solution = self.run.task, self.run.solution
        power = np.zeros(self.torque.shape, np.result_type(self.torque, solution.q))
        for k, motor in enumerate(task.mechanism.motors):
            if motor.name in self.run.mode.motors:
                rate = joint_coordinate(task.system, motor.joint, solution.q, solution.v).rate
                power[:, k] = self.torque[:, k] * rate
        return power


def run_traces(run: TrackingRun) -> RunTraces:
    """Traces of a run, at the samples it reached."""
    task, solution = run.task, run.solution
    # The state at an event is a sample more than the task's times.
    k = solution.t.size - bool(solution.event)
    effector = task.mechanism.end_effector
    assert effector is not None
    position = point_motion(task.system, effector.point, solution.q[:k], solution.v[:k], solution.a[:k]).position
    distance = length(position - task.motion.desired.position[:k])
    return RunTraces(solution.t[:k], task.path.duration, position, distance, run.applied, run)
