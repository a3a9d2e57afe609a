"""Mechanism with reduced flexible coordinates, chosen for a planned motion or from runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from paraflex.arguments import checked_arguments
from paraflex.errors import ActuationError, InputError, SingularActuationError
from paraflex.mechanism import ActuationMode, Mechanism, mode_of_motors
from paraflex.motion import MotionRun
from paraflex.reduced_bodies.bases import bases_of, normalised_by_energy
from paraflex.reduced_bodies.deflections import PlannedDeflections
from paraflex.tracking import TrackingRun, TrackingTask


@checked_arguments()
def reduced_mechanism(
    along: TrackingTask | TrackingRun | MotionRun | Sequence[TrackingRun | MotionRun],
    coordinates: int = 16,
    *,
    modes: Sequence[str | ActuationMode] | None = None,
) -> Mechanism:
    """Return the mechanism with few flexible coordinates in total; equations, joints and geometry are unchanged.

    The kept shapes are those with the most strain energy: in static deflections under inertia, loads and torques of a
    planned motion, so that no run is needed; or in runs (proper orthogonal decomposition). Deflections under forces at
    the end-effector have the same weight, as they show what moves it. A body that hardly deflects keeps no shapes. The
    mechanism suits motions like the given one: `TrackingTask.remodelled` applies the plan to it, `simulate_motion`
    accepts it.

    Parameters
    ----------
    along : TrackingTask, or one or several runs
        Planned motion, or runs of one mechanism, for which the reduction is chosen.
    coordinates : int
        Number of flexible coordinates kept, over all bodies together.
    modes : sequence of str or ActuationMode, optional
        Actuation modes of a plan; by default those of the mechanism, or all motors. A mode that cannot drive the
        mechanism along the path is left out, unless no mode can.

    Returns
    -------
    Mechanism
        Reduced mechanism.

    Raises
    ------
    InputError
        All bodies are rigid; the number of coordinates is out of range or above the number of directions in the motion;
        runs are of several mechanisms; or modes are given with runs.
    ActuationError, SingularActuationError
        No mode can drive the mechanism along the path.
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
    groups = [normalised_by_energy(task.system, driven), planned.of_end_effector()]
    return replace(mechanism, bases=bases_of(task.system, groups, count))


def _from_runs(runs: Sequence[TrackingRun | MotionRun], count: int) -> Mechanism:
    """Reduce by proper orthogonal decomposition of the runs, and of forces at the end-effector along a path."""
    systems = [run.task.system if isinstance(run, TrackingRun) else run.system for run in runs]
    if not systems or any(system.mechanism != systems[0].mechanism for system in systems):
        raise InputError("are not of one mechanism", field="along", remedy="give one or several runs of one")
    groups = [normalised_by_energy(systems[0], [run.solution.q for run in runs])]
    groups += [PlannedDeflections(run.task).of_end_effector() for run in runs[:1] if isinstance(run, TrackingRun)]
    return replace(systems[0].described, bases=bases_of(systems[0], groups, count))
