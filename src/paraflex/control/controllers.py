"""What a controller is, and what it is told as it starts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

from paraflex.arrays import Array
from paraflex.dynamics import State
from paraflex.mechanism import ActuationMode, Mechanism
from paraflex.tracking import TrackingTask


@dataclass(frozen=True)
class Plant:
    """What a controller acts on, as it is told when it starts.

    Attributes
    ----------
    mechanism : Mechanism
    mode : ActuationMode
        Motors that take torques.
    task : TrackingTask or None
        The plan whose path it is to follow: rigid motion, feed-forward torques.
    state : State
        At the start.
    inputs : tuple of str
        Sensors, in the order of the readings that the controller is given.
    input_units : tuple of str
    outputs : tuple of str
        Motors, in the order of the torques that it returns.
    period, delay : float
        [s]
    resolution : tuple of float
        Of the readings, to whose multiples they are rounded, zero of those that are not; none if none is.
    feed_forward : bool
        Whether planned torques act besides.
    """

    mechanism: Mechanism
    mode: ActuationMode
    task: TrackingTask | None
    state: State
    inputs: tuple[str, ...]
    input_units: tuple[str, ...]
    outputs: tuple[str, ...]
    period: float
    delay: float
    resolution: tuple[float, ...] = ()
    feed_forward: bool = False


@runtime_checkable
class Controller(Protocol):
    """A sampled controller: at t_k = k `period` it reads its sensors, and its torques act from t_k + `delay` on.

    Attributes
    ----------
    period : float
        Between samples [s].
    delay : float
        From a sample until its torques act [s].
    inputs : tuple of str
        Names of sensors: encoders have those of motors' joints, the end-effector's coordinates are "x" and "y". None
        stands for the encoders of its motors.
    outputs : tuple of str
        Names of motors; none for all of the mode.

    Its state is all that its attributes hold: a saved simulation has copies of them.
    """

    period: float
    delay: float
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    def start(self, plant: Plant) -> None:
        """Prepare for a run, and forget an earlier one."""
        ...

    def step(self, k: int, t: float, y: Array) -> Any:
        """Torques (outputs,) that follow from the readings y (inputs,) of sample k at time t [N m, N]."""
        ...
