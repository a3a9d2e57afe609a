"""A simulation one can step: torques that stay from one instant to the next, sensors read between, states kept."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from paraflex.actuation import FeedForward
from paraflex.arguments import checked_arguments
from paraflex.arrays import Array
from paraflex.control.readings import Readings
from paraflex.dynamics import State, System, build_system, pack_signals
from paraflex.dynamics.signals import constant_signals
from paraflex.errors import InputError
from paraflex.integrators import IntegrationOptions, Method, Solution, choose
from paraflex.integrators.integrate import Integration
from paraflex.integrators.native import NativeRun
from paraflex.kernel.packed import Signals
from paraflex.kinematics import ModelWithPaths
from paraflex.linear.linearise import measured_sensors
from paraflex.mechanism import ActuationMode, Mechanism, Sensor, Start, mode_of_motors, parse_mode
from paraflex.mechanism.quantities import known
from paraflex.motion import state_at
from paraflex.tracking import TrackingTask, path_stops

Torques = Sequence[float] | Mapping[str, float] | Array


@dataclass(frozen=True)
class Saved:
    """Everything that a simulation goes on from, to the bit: see `Simulation.save`."""

    arrays: tuple[Array, ...]
    held: Array
    more: Any = None


class Simulation:
    """A mechanism under torques that are given from one instant to the next, as a digital controller gives them.

    The same kernels, methods and error control as a run. Steps end at every instant; where torques change nothing
    reaches across: accelerations and multipliers are made consistent with the new ones, while the size of the steps and
    the factor of the iteration matrix are kept.

    Parameters
    ----------
    source : TrackingTask, Mechanism or Model
        A plan, from its start; or a mechanism without a path, from a start.
    mode : str or ActuationMode, optional
        Motors that torques are given for; the others turn freely. All by default.
    feed_forward : bool
        Of a plan, whether its torques act by themselves, smooth in time, beside those that are given.
    duration : float, optional
        Of a mechanism: up to when it is to run [s]; that of a model's study by default. The tolerance is of the whole.
    samples : int
        Of a mechanism: times at which results are kept; of a plan those of the task.
    start : State, Start or str, optional
        Of a mechanism, as for `simulate_motion`.
    balanced : bool
        Whether it starts in equilibrium, or in the deflections of the plan's motion.
    sensors : sequence of Sensor, optional
        Read besides the mechanism's own, the encoders of motors and the end-effector's coordinates.
    method : Method or str, optional
        One of paraflex's own.
    options : IntegrationOptions, optional

    Attributes
    ----------
    mechanism : Mechanism
    system : System
    mode : ActuationMode
    motors : tuple of str
        Those that torques are given for, in the order of the mechanism.
    task : TrackingTask or None
    end : float
        [s]

    Raises
    ------
    InputError
        A mode, motor or sensor that the mechanism does not have, a method by another program, no duration.
    """

    @checked_arguments()
    def __init__(
        self,
        source: TrackingTask | Mechanism | ModelWithPaths,
        *,
        mode: str | ActuationMode | None = None,
        feed_forward: bool = False,
        duration: float | None = None,
        samples: int = 701,
        start: State | Start | str | None = None,
        balanced: bool = False,
        sensors: Sequence[Sensor] = (),
        method: Method | str | None = None,
        options: IntegrationOptions | None = None,
    ) -> None:
        self.task: TrackingTask | None = source if isinstance(source, TrackingTask) else None
        self.mechanism: Mechanism = source.mechanism if isinstance(source, TrackingTask) else Mechanism.made_of(source)
        self.options: IntegrationOptions = choose(method, options)
        self.mode: ActuationMode = _mode(self.mechanism, mode)
        self.motors: tuple[str, ...] = tuple(
            motor.name for motor in self.mechanism.motors if motor.name in self.mode.motors
        )
        if self.task is None and feed_forward:
            raise InputError("there is no plan whose torques could act", field="feed_forward", value=True,
                             remedy="give the task that pf.plan makes, or leave it out")  # fmt: skip
        self.feed_forward: FeedForward | None = (
            self.task.plan.feed_forward(self.mode) if self.task is not None and feed_forward else None
        )
        self._initial, self._times = self._begin(source, duration, samples, start, balanced)
        self.end: float = float(self._times[-1])
        self._signals, self._knots = self._packed()
        self._base = self._signals.coefficients[:, 0].copy()
        given = tuple(sensors)
        self.readings: Readings = Readings(self.system, (*measured_sensors(self.mechanism), *given))
        self._active = [k for k, motor in enumerate(self.mechanism.motors) if motor.name in self.mode.motors]
        self.reset()
