"""Runs under the controllers of a model file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from paraflex.control.described import TABLE, ControllerDescription
from paraflex.control.runs import ControlledMotion, ControlledTracking
from paraflex.control.simulation import Simulation
from paraflex.dynamics import State
from paraflex.errors import InputError
from paraflex.integrators import IntegrationOptions
from paraflex.mechanism import ActuationMode, Mechanism
from paraflex.tracking import TrackingTask

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
    """Run a mode of a task under controllers, beside the torques planned for it; without warnings.

    Where a law gives the whole torque the planned ones do not act.

    Raises
    ------
    InputError
        Brakes after the motion, a method by another program, controllers that do not fit the mode.
    ControllerError, IntegrationError
        See `Simulation.run`.
    """
    if task.holds:
        raise InputError("brakes are not for motors under control", field="after", value=task.after.value,
                         remedy='say "free": controllers act after the path as well')  # fmt: skip
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
    """Run a mechanism without a path under controllers; without warnings.

    Raises
    ------
    InputError, ControllerError, IntegrationError
        See `simulate_controlled`.
    """
    sim = Simulation(mechanism, duration=duration, samples=samples, start=start, options=options)
    return _run(sim, controllers, on_progress)


def _run(sim: Simulation, controllers: Sequence[ControllerDescription], on_progress: OnTime | None) -> Any:
    """The run; errors name the controller in its file."""
    names = [one.name for one in controllers]
    try:
        return sim.run(list(controllers), on_progress=on_progress, warning=False)
    except InputError as error:
        raise (error.within(TABLE) if error.field.partition(".")[0] in names else error) from None
