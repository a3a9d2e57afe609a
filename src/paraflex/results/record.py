"""A run link by link, in a form that every model of a mechanism can provide."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from paraflex.arguments import given_as
from paraflex.arrays import Array
from paraflex.control.loop import ControllerRecord
from paraflex.control.runs import ControlledTracking
from paraflex.dynamics.points import PointMotion, point_motion
from paraflex.findings import Finding
from paraflex.integrators import IntegrationOptions
from paraflex.results.links import Links, system_links
from paraflex.tracking import TrackingRun, TrackingTask
from paraflex.validity import Validity

# How a run went: names of the figures every record has.
RUN_FIGURES = (
    "status",
    "message",
    "steps",
    "rejected",
    "newton_iterations",
    "factorisations",
    "wall_time",
    "constraint_position_max",
    "constraint_velocity_max",
    "energy_balance_max",
    "event",
    "event_time",
)
# Energy absorbed by brakes, if there were any.
BRAKE_ENERGY = "brake_energy"


@given_as("a record", "what results.record makes of a run")
@dataclass(frozen=True, kw_only=True)
class Record(Links):
    """One run of a task, link by link.

    Attributes
    ----------
    task : TrackingTask
    method : str
        How it was integrated.
    mode : str
        Name of the actuation mode.
    torque : (samples, motors) array
        Applied by the motors, at every sample time of the task, or at the k reached where they were held [N m].
    condition : (samples,) array
        Condition number of the actuation matrix.
    end_effector : PointMotion
        Three (k, 2) arrays.
    figures : mapping
        The numbers and words named in RUN_FIGURES.
    validity : Validity, optional
        How far it is within what its model can describe.
    doubts : tuple of Finding
        What of its results is not plausible.
    controllers : tuple of ControllerRecord
        What each did, where torques were those of controllers.
    options : IntegrationOptions, optional
        By which it was integrated; None by another program.
    """

    task: TrackingTask
    method: str
    mode: str
    torque: Array
    condition: Array
    end_effector: PointMotion
    figures: Mapping[str, Any] = field(default_factory=dict)
    validity: Validity | None = None
    doubts: tuple[Finding, ...] = ()
    controllers: tuple[ControllerRecord, ...] = ()
    options: IntegrationOptions | None = None


def record(run: TrackingRun) -> Record:
    """Record of a run; finite segments are reported as the links they were cut from."""
    task, solution, torque = run.task, run.solution, run.applied
    # The state at an event is a sample more than the task's times.
    k = solution.t.size - bool(solution.event)
    whole = task if task.whole is None else task.whole
    effector = task.mechanism.end_effector
    assert effector is not None
    links = system_links(task.system, solution, torque, k)
    return Record(
        **{each.name: getattr(links, each.name) for each in fields(Links)},
        task=whole,
        method=run.method,
        options=solution.options,
        mode=run.mode.name,
        torque=torque,
        condition=run.condition,
        end_effector=point_motion(task.system, effector.point, solution.q[:k], solution.v[:k], solution.a[:k]),
        figures={name: getattr(solution, name) for name in (*RUN_FIGURES, BRAKE_ENERGY)},
        validity=run.validity,
        doubts=run.doubts,
        controllers=run.controllers if isinstance(run, ControlledTracking) else (),
    )
