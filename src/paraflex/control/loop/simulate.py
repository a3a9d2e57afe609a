"""Runs under the controllers of a model file."""

from collections.abc import Callable, Sequence
from typing import Any

from paraflex.control.laws.described import TABLE, ControllerDescription
from paraflex.dynamics import State
from paraflex.errors import InputError
from paraflex.integrators import IntegrationOptions
from paraflex.mechanism import ActuationMode, Mechanism
from paraflex.tracking import TrackingTask
from .runs import ControlledMotion, ControlledTracking
from .simulation import Simulation

OnTime = Callable[[float], None]


def simulate_controlled(
    task: TrackingTask,
    mode: str | ActuationMode,
    controllers: Sequence[ControllerDescription],
    *,
    options: IntegrationOptions | None = None,
    balanced: bool = False,
    on_progress: OnTime | None = None,
) -> ControlledTracking:
    """Run a mode of a task under controllers and the torques planned for it, without issuing warnings.

    If a control law gives the whole torque, the planned torques do not act.

    Parameters
    ----------
    task : TrackingTask
        Task to be run.
    mode : str or ActuationMode
        Mode to be run.
    controllers : sequence of ControllerDescription
        Controllers.
    options : IntegrationOptions, optional
        Integration options.
    balanced : bool
        Whether the run starts with the deflections that the planned motion causes.
    on_progress : callable, optional
        Function called with the time reached [s].

    Raises
    ------
    InputError
        Brakes after the motion, a method of another program, or controllers that do not fit the mode.
    ControllerError, IntegrationError
        See `Simulation.run`.
    """
    if task.holds:
        raise InputError("brakes are not for motors under control", field="after", value=task.after.value,
                         remedy='write "free": controllers act after the path as well')  # fmt: skip
    planned = not any(getattr(one, "whole_torque", False) for one in controllers)
    sim = Simulation(task, mode=mode, feed_forward=planned, balanced=balanced, options=options)
    return _run(sim, controllers, on_progress)


def simulate_controlled_motion(
    mechanism: Mechanism,
    duration: float,
    controllers: Sequence[ControllerDescription],
    *,
    samples: int,
    start: State | str | None = None,
    options: IntegrationOptions | None = None,
    on_progress: OnTime | None = None,
) -> ControlledMotion:
    """Run a mechanism without a path under controllers, without issuing warnings.

    Parameters
    ----------
    mechanism : Mechanism
        Mechanism to be run.
    duration : float
        Duration of the run [s].
    controllers : sequence of ControllerDescription
        Controllers.
    samples : int
        Number of sample times at which results are kept.
    start : State or str, optional
        Start, as for `simulate_motion`.
    options : IntegrationOptions, optional
        Integration options.
    on_progress : callable, optional
        Function called with the time reached [s].

    Raises
    ------
    InputError, ControllerError, IntegrationError
        See `simulate_controlled`.
    """
    sim = Simulation(mechanism, duration=duration, samples=samples, start=start, options=options)
    return _run(sim, controllers, on_progress)


def _run(sim: Simulation, controllers: Sequence[ControllerDescription], on_progress: OnTime | None) -> Any:
    """Return the run; errors name the controller as in its file."""
    names = [one.name for one in controllers]
    try:
        return sim.run(list(controllers), on_progress=on_progress, warning=False)
    except InputError as error:
        raise (error.within(TABLE) if error.field.partition(".")[0] in names else error) from None
