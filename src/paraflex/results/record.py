"""Record of a run link by link, in a form that every model of a mechanism can provide."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from paraflex.arguments import named_in_errors
from paraflex.arrays import Array, Brief
from paraflex.control.loop.run_loop import ControllerRecord
from paraflex.control.loop.runs import ControlledTracking
from paraflex.dynamics.points import PointMotion
from paraflex.findings import Finding
from paraflex.integrators import IntegrationOptions
from paraflex.tracking import TrackingRun, TrackingTask
from paraflex.validity import Validity
from .kinds import BRAKE_ENERGY, RUN_FIGURES
from .links import Links, system_links


@named_in_errors("a record", "what results.record makes of a run")
@dataclass(frozen=True, kw_only=True)
class Record(Brief):
    """Run of a task, link by link.

    Attributes
    ----------
    task : TrackingTask
        Task of the mechanism as described.
    method : str
        Name of the integration method.
    mode : str
        Name of the actuation mode.
    torque : (samples, motors) array
        Torques applied by the motors [N m], or forces [N], at every sample time of the task, or only at the k reached
        if brakes or controllers determined them.
    condition : (samples,) array
        Condition number of the actuation matrix.
    end_effector : PointMotion
        Position, velocity and acceleration of the end-effector, three (k, 2) arrays.
    links : Links
        Motion and loads of bodies, points, joints and motors.
    figures : mapping
        Values of the figures named in RUN_FIGURES.
    validity : Validity, optional
        Validity of the model in this run; None if not defined.
    findings : tuple of Finding
        Findings on implausible results.
    controllers : tuple of ControllerRecord
        Records of the sampled controllers; empty without controllers.
    options : IntegrationOptions, optional
        Integration options; None for runs of another program.
    """

    task: TrackingTask
    method: str
    mode: str
    torque: Array
    condition: Array
    end_effector: PointMotion
    links: Links
    figures: Mapping[str, Any] = field(default_factory=dict)
    validity: Validity | None = None
    findings: tuple[Finding, ...] = ()
    controllers: tuple[ControllerRecord, ...] = ()
    options: IntegrationOptions | None = None


def record(run: TrackingRun) -> Record:
    """Return the record of a run; finite segments are reported as the links they divide."""
    solution, torque = run.solution, run.applied
    return Record(
        task=run.task.whole or run.task,
        method=run.method,
        options=solution.options,
        mode=run.mode.name,
        torque=torque,
        condition=run.condition,
        end_effector=run.end_effector,
        links=system_links(run.system, solution, torque, run.samples),
        figures={name: getattr(solution, name) for name in (*RUN_FIGURES, BRAKE_ENERGY)},
        validity=run.validity,
        findings=run.findings,
        controllers=run.controllers if isinstance(run, ControlledTracking) else (),
    )
