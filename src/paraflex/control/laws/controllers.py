"""Interface of a controller, and the plant description that it receives when it starts."""

from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

from paraflex.arrays import Array
from paraflex.dynamics import State
from paraflex.mechanism import ActuationMode, Mechanism
from paraflex.tracking import TrackingTask


@dataclass(frozen=True)
class Plant:
    """Description of the plant that a controller receives when it starts.

    Attributes
    ----------
    mechanism : Mechanism
        Mechanism to be controlled.
    mode : ActuationMode
        Motors that take torques.
    task : TrackingTask or None
        Plan whose path is to be followed: rigid motion, feed-forward torques. None without a path.
    state : State
        State at the start.
    inputs : tuple of str
        Sensors, in the order of the readings that the controller receives.
    input_units : tuple of str
        Units of the readings.
    outputs : tuple of str
        Motors, in the order of the torques that the controller returns.
    period, delay : float
        Sampling period, and delay from a sample until its torques act [s].
    resolution : tuple of float
        Resolution of each reading, to whose multiples it is rounded; zero if it is not rounded. Empty if no reading is.
    feed_forward : bool
        Whether planned torques act as well.
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
    """Sampled controller: at t_k = k `period` it reads its sensors, and its torques act from t_k + `delay` on.

    The state of a controller consists of all its attributes: a saved simulation holds copies of them.

    Attributes
    ----------
    period : float
        Sampling period [s].
    delay : float
        Delay from a sample until its torques act [s].
    inputs : tuple of str
        Names of sensors. Encoders have the names of motors' joints; the end-effector's coordinates are "x" and "y". If
        empty, the encoders of its motors.
    outputs : tuple of str
        Names of motors; if empty, all motors of the mode.
    """

    period: float
    delay: float
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    def start(self, plant: Plant) -> None:
        """Prepare for a run, and reset the state."""
        ...

    def step(self, k: int, t: float, y: Array) -> Any:
        """Return the torques (outputs,) from the readings y (inputs,) of sample k at time t [N m, N]."""
        ...
