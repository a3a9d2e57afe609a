"""A mechanism whose bodies keep few flexible coordinates, chosen for a planned motion or from runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from paraflex.arguments import checked_arguments
from paraflex.errors import ActuationError, InputError, SingularActuationError
from paraflex.mechanism import ActuationMode, Mechanism, mode_of_motors
from paraflex.motion import MotionRun
from paraflex.reduction.bases import bases_of, of_one_energy
from paraflex.reduction.deflections import PlannedDeflections
from paraflex.tracking import TrackingRun, TrackingTask


@checked_arguments()
def reduced_mechanism(
    along: TrackingTask | TrackingRun | MotionRun | Sequence[TrackingRun | MotionRun],
    coordinates: int = 16,
    *,
    modes: Sequence[str | ActuationMode] | None = None,
) -> Mechanism:
    """The mechanism with few flexible coordinates, all bodies together; equations, joints and geometry stay.

    Kept are the shapes that hold most of the strain energy: of static deflections under inertia, loads and torques of a
    planned motion, so that no run is needed; or of runs (proper orthogonal decomposition). Those of forces at the
    end-effector count as much, as they tell what moves it. A body that hardly bends keeps none. The mechanism is for
    motions like that one: `TrackingTask.remodelled` applies the plan to it, `simulate_motion` takes it.

    Parameters
    ----------
    along : TrackingTask, or one or several runs
        What it is to be good for; runs of one mechanism.
    coordinates : int
        How many are kept.
    modes : sequence of str or ActuationMode, optional
        Of a plan: by default those of the mechanism, or all motors. One that cannot drive the mechanism along the path
        does not count, unless none can.

    Raises
    ------
    InputError
        Rigid bodies only; no such number of coordinates; more than the motion tells apart; runs of several mechanisms;
        modes beside runs.
    ActuationError, SingularActuationError
        None of the modes can drive the mechanism along the path.
    """
    if isinstance(along, TrackingTask):
        return _along_plan(along, coordinates, modes)
    if modes is not None:
        raise InputError("are those of the runs", field="modes", value=modes, remedy="leave them out")
    return _from_runs([along] if isinstance(along, TrackingRun | MotionRun) else list(along), coordinates)


def _along_plan(task: TrackingTask, count: int, modes: Sequence[str | ActuationMode] | None) -> Mechanism:
    mechanism, planned = task.mechanism, PlannedDeflections(task)
    chosen = modes or mechanism.modes or [mode_of_motors(mechanism, [motor.name for motor in mechanism.motors])]
    driven, refused = [], None
    for mode in chosen:
        try:
            driven.append(planned.of_mode(task.mode(mode)))
        except (ActuationError, SingularActuationError) as error:
            refused = error
    if refused is not None and not driven:
        raise refused
    groups = [of_one_energy(task.system, driven), planned.of_end_effector()]
    return replace(mechanism, bases=bases_of(task.system, groups, count))


def _from_runs(runs: Sequence[TrackingRun | MotionRun], count: int) -> Mechanism:
    """By proper orthogonal decomposition of their coordinates; along a path with forces at the end-effector."""
    systems = [run.task.system if isinstance(run, TrackingRun) else run.system for run in runs]
    if not systems or any(system.mechanism != systems[0].mechanism for system in systems):
        raise InputError("are not of one mechanism", field="along", remedy="give one or several runs of one")
    groups = [of_one_energy(systems[0], [run.solution.q for run in runs])]
    groups += [PlannedDeflections(run.task).of_end_effector() for run in runs[:1] if isinstance(run, TrackingRun)]
    return replace(systems[0].described, bases=bases_of(systems[0], groups, count))
