"""A simulation as an environment of Gymnasium, for reinforcement learning and for anything else that acts and observes.

Gymnasium is an extra: this module is imported without it, but makes no environments then. With it the environment
"paraflex/RAParM-I-v0" is registered.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array
from paraflex.control.observations import WIDEST, Observer, observed_sensors
from paraflex.control.simulation import Simulation
from paraflex.control.together import by_name, checked_number, periods_in
from paraflex.dynamics import State
from paraflex.dynamics.joint_coordinates import marker_position
from paraflex.errors import InputError, IntegrationError
from paraflex.integrators import IntegrationOptions, Method
from paraflex.kinematics import ModelWithPaths
from paraflex.mechanism import ActuationMode, Mechanism, Start
from paraflex.mechanism.measured import measured_sensors
from paraflex.mechanism.quantities import not_negative, positive
from paraflex.tracking import TrackingTask

if TYPE_CHECKING:
    from gymnasium import Env, Space
else:
    try:
        from gymnasium import Env
    except ImportError:
        from paraflex.control.no_gymnasium import Env

Reward = Callable[[Simulation, Mapping[str, float], Array], float]
# Beside the feed-forward actions are corrections, of this part of its torques.
_CORRECTING = 0.1
# With 0.25 ms deviations of RAParM-I are exact to a hundredth.
_STEP = 2.5e-4
# Environments of the library: what makes them, and its settings.
REGISTERED: dict[str, tuple[str, dict[str, Any]]] = {
    "paraflex/RAParM-I-v0": (
        "paraflex.library:environment",
        {"name": "raparm_i", "options": IntegrationOptions(method="generalised-alpha", step=_STEP)},
    )
}


class Environment(Env[Array, NDArray[Any]]):
    """A mechanism as an environment of Gymnasium, its actions the torques of motors.

    An action a (motors,) lets the torques a x `limits` act for one period, beside those of the plan where it has a
    feed-forward. The observation is read at the end of the period. The reward of a period is

        - min((d / accuracy)^2 + effort_weight sum(a^2), penalty),

    d the deviation of the end-effector from the plan at its end. An episode is truncated at the end of the run. It is
    terminated, with the cause in `info["error"]`, where an event of the options ends it, or where it has diverged and
    cannot go on; its last observation is shown again, and each period left costs `penalty`, so that it never pays.

    Torques that jump from one period to the next make the steps of an adaptive method short. With
    `IntegrationOptions(method="generalised-alpha", step=2.5e-4)` runs are some ten times as fast, and coarser.

    Parameters
    ----------
    source : TrackingTask, Mechanism or Model
        A plan; or a mechanism without a path, whose reward must be given.
    mode : str or ActuationMode, optional
        Motors of the actions; all by default.
    period : float
        From one action to the next [s].
    limits : float or mapping of str to float, optional
        Torque of an action of one, of all motors of the mode or each [N m, N]. By default the largest that a plan needs
        of any of them, or a tenth of it beside the feed-forward.
    sensors : sequence of str, optional
        Observed ones: see `Simulation.sensors_read`. By default encoders of the motors and the end-effector's place.
    errors : bool
        Whether what the plan says of a sensor is taken off its reading.
    ahead : sequence of float
        By how much the plan is seen ahead [s]: for each, the change of planned readings from now until then.
    scales : mapping of str to float, optional
        By sensor, the reading that is observed as one, in its unit.
    noise, quantise : mapping of str to float, optional
        By sensor, in its unit: standard deviation of white noise, resolution.
    feed_forward : bool, optional
        Whether the plan's torques act by themselves; by default where there is a plan.
    accuracy : float
        Deviation that costs one in a period [m].
    effort_weight : float
        What a motor at its limit costs in a period.
    penalty : float
        The most that a period costs, and what each costs that is left when an episode is terminated.
    reward : callable, optional
        reward(simulation, readings, action) after a period, in place of the formula: readings of all sensors by name,
        without noise.
    vary : callable, optional
        vary(random) -> Mechanism: that of an episode, from the environment's generator of random numbers, of members
        with the same names. A plan stays that of the mechanism it was made for.
    duration, start, balanced, method, options
        See `Simulation`.

    Attributes
    ----------
    simulation : Simulation
        Of the episode: `simulation.result()` is its run so far, for figures and data.
    motors : tuple of str
        In the order of actions.
    limits : (motors,) array
        [N m, N]
    observed : tuple of str
        Names of what is observed, in order: sensors, then those seen ahead, "x+0.01".
    action_space : Box
        (motors,) in [-1, 1], of float32; numbers beyond are cut off, float64 is not rounded.
    observation_space : Box
        (observed,) of float64, in [-1e6, 1e6].

    Raises
    ------
    InputError
        Gymnasium is not installed; unknown motors or sensors; numbers that are not positive; no reward or no limits
        where there is no plan; what `Simulation` refuses.
    ActuationError
        The mode cannot drive the mechanism along the plan's path.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 as Gymnasium has it

    @checked_arguments()
    def __init__(
        self,
        source: TrackingTask | Mechanism | ModelWithPaths,
        *,
        mode: str | ActuationMode | None = None,
        period: float = 1e-3,
        limits: float | Mapping[str, float] | None = None,
        sensors: Sequence[str] | None = None,
        errors: bool = True,
        ahead: Sequence[float] = (),
        scales: Mapping[str, float] | None = None,
        noise: Mapping[str, float] | None = None,
        quantise: Mapping[str, float] | None = None,
        feed_forward: bool | None = None,
        accuracy: float = 1e-3,
        effort_weight: float = 0.01,
        penalty: float = 100.0,
        reward: Reward | None = None,
        vary: Callable[[np.random.Generator], Mechanism] | None = None,
        duration: float | None = None,
        start: State | Start | str | None = None,
        balanced: bool = False,
        method: Method | str | None = None,
        options: IntegrationOptions | None = None,
    ) -> None:
        from gymnasium.spaces import Box

        task = source if isinstance(source, TrackingTask) else None
        if task is None and reward is None:
            raise InputError("there is no plan to follow", field="reward",
                             remedy="give a function of (simulation, readings, action)")  # fmt: skip
        positive(period, "period", "s")
        positive(accuracy, "accuracy", "m")
        not_negative(effort_weight, "effort_weight", "units of reward")
        not_negative(penalty, "penalty", "units of reward")
        self._settings: dict[str, Any] = {
            "mode": mode, "feed_forward": task is not None if feed_forward is None else feed_forward,
            "duration": duration, "start": start, "balanced": balanced, "method": method, "options": options,
        }  # fmt: skip
        self._source, self._task, self._vary, self._reward = source, task, vary, reward
        self._accuracy, self._effort_weight, self._penalty = accuracy, effort_weight, penalty
        self.simulation: Simulation = Simulation(source, **self._settings)
        if task is None and start is None and not isinstance(source, Mechanism):
            self._settings["start"] = source.start
        self.motors: tuple[str, ...] = self.simulation.motors
        self.limits: Array = _limits(
            limits, task, self.simulation, _CORRECTING if self._settings["feed_forward"] else 1.0
        )
        self._members = _members(self.simulation.mechanism)
        self._duration = self.simulation.end - self.simulation.time
        self._times = _instants(self.simulation.time, self.simulation.end, period)
        self._observe = Observer(
            self.simulation.mechanism, task, observed_sensors(sensors, self.simulation), self._times,
            errors=errors, ahead=ahead, noise=noise, quantise=quantise, scales=scales,
        )  # fmt: skip
        self.observed: tuple[str, ...] = self._observe.names
        self._desired = None if task is None else task.plan.follow(self._times).desired.position
        self._step: int | None = None
        self._seen: Array = np.zeros(len(self.observed))
        self.action_space: Space[Any] = Box(-1.0, 1.0, (len(self.motors),), np.float32)
        self.observation_space: Space[Any] = Box(-WIDEST, WIDEST, (len(self.observed),), np.float64)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """Begin an episode; the first observation, and `info`.

        Parameters
        ----------
        seed : int, optional
            Of noise and `vary`: the same seed and actions give the same bits.
        options : dict, optional
            There are none.

        Raises
        ------
        InputError
            Options; a mechanism of `vary` that has other members.
        """
        super().reset(seed=seed)
        if options:
            raise InputError("there are none", field="options", value=options, remedy="leave them out")
        if self._vary is not None:
            self.simulation = self._varied(self._vary(self.np_random))
        readings = self.simulation.reset()
        self._step = 0
        self._seen = self._observe(0, readings, self.np_random)
        return self._seen.copy(), self._info(np.zeros(len(self.motors)))

    def step(self, action: NDArray[Any]) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Let torques act for one period; observation, reward, whether terminated, whether truncated, `info`.

        `info` has the "time" reached [s], the "torques" of the action [N m, N], with a plan the end-effector's
        "deviation" [m], and the "error" that has terminated the episode.

        Parameters
        ----------
        action : (motors,) array
            As parts of the limits.

        Raises
        ------
        InputError
            An action of another shape, or that is not finite.
        gymnasium.error.ResetNeeded
            The episode has ended, or none has begun.
        """
        if self._step is None:
            from gymnasium.error import ResetNeeded

            raise ResetNeeded("the episode has ended, or none has begun; call reset()")
        action = self._cut(action)
        self._step += 1
        try:
            readings = self.simulation.step(action * self.limits, float(self._times[self._step]))
        except IntegrationError as error:
            return self._terminated(error, action)
        self._seen = self._observe(self._step, readings, self.np_random)
        info = self._info(action)
        reward = self._rewarded(readings, action, info)
        truncated = self._step == self._times.size - 1
        if truncated:
            self._step = None
        return self._seen.copy(), reward, False, truncated, info

    def _terminated(self, error: IntegrationError, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """What `step` returns where the run cannot go on."""
        assert self._step is not None
        left = self._times.size - self._step
        info = {"time": self.simulation.time, "torques": action * self.limits, "error": str(error)}
        self._step = None
        return self._seen.copy(), -self._penalty * left, True, False, info

    def _rewarded(self, readings: Mapping[str, float], action: Array, info: Mapping[str, Any]) -> float:
        if self._reward is not None:
            return float(self._reward(self.simulation, readings, action))
        cost = (info["deviation"] / self._accuracy) ** 2 + self._effort_weight * (action @ action)
        return -min(float(cost), self._penalty)

    def _info(self, action: Array) -> dict[str, Any]:
        info: dict[str, Any] = {"time": self.simulation.time, "torques": action * self.limits}
        effector = self.simulation.system.mechanism.end_effector
        if self._desired is not None and effector is not None:
            system = self.simulation.system
            place = marker_position(system, system.marker(effector.point), self.simulation.state.q[None])[0]
            info["deviation"] = float(np.linalg.norm(place - self._desired[self._step]))
        return info

    def _cut(self, action: Any) -> Array:
        """An action within the limits."""
        try:
            given = np.asarray(action, dtype=float)
        except (TypeError, ValueError):
            given = np.full(0, np.nan)
        if given.shape != (len(self.motors),) or not np.all(np.isfinite(given)):
            raise InputError(f"not {len(self.motors)} finite numbers", field="action", value=action,
                             remedy=f"give one from -1 to 1 for each of {', '.join(self.motors)}")  # fmt: skip
        return np.clip(given, -1.0, 1.0)

    def _varied(self, mechanism: Mechanism) -> Simulation:
        """The simulation of another mechanism, of the same members."""
        if _members(mechanism) != self._members:
            raise InputError("makes a mechanism of other members", field="vary", value=mechanism.name,
                             remedy="change numbers only: members keep their names")  # fmt: skip
        if self._task is not None:
            return Simulation(self._task.remodelled(mechanism), **self._settings)
        settings: dict[str, Any] = self._settings | {"duration": self._duration}
        return Simulation(mechanism, **settings)


def _members(mechanism: Mechanism) -> tuple[tuple[str, ...], ...]:
    """Names of bodies, joints, motors and sensors."""
    groups = (mechanism.bodies, mechanism.joints, mechanism.motors, measured_sensors(mechanism))
    return tuple(tuple(each.name for each in group) for group in groups)


def _instants(start: float, end: float, period: float) -> Array:
    """Instants (k,) of observations [s]: the start, then ends of periods, the last one shorter."""
    count = periods_in(end - start, period)
    times = start + period * np.arange(count + 1, dtype=np.float64)
    times[-1] = end
    return times


def _limits(given: Any, task: TrackingTask | None, simulation: Simulation, part: float) -> Array:
    """Torques (motors,) of an action of one; by default this part of the largest that a plan needs."""
    motors = simulation.motors
    if given is None:
        if task is None:
            raise InputError("are missing", field="limits", remedy="give the torque of an action of one in N m")
        peak = float(np.max(np.abs(task.torques(simulation.mode).evaluate(task.motion.t))))
        if not peak:
            raise InputError("are missing", field="limits", remedy="give them in N m: the plan needs no torques")
        return np.full(len(motors), part * peak)
    by_motor = given if isinstance(given, Mapping) else dict.fromkeys(motors, given)
    found = by_name(by_motor, motors, "limits", "motor", partial(checked_number, unit="N m or N"))
    missing = [name for name in motors if name not in found]
    if missing:
        raise InputError(f"{', '.join(missing)} missing", field="limits", value=given, remedy="give one for each motor")
    return np.array([found[name] for name in motors])


def register() -> None:
    """Register the environments of the library with Gymnasium, where they are not yet."""
    import gymnasium

    for name, (entry_point, settings) in REGISTERED.items():
        if name not in gymnasium.registry:
            gymnasium.register(name, entry_point=entry_point, kwargs=settings)


if Env.__module__.startswith("gymnasium"):
    register()
