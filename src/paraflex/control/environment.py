"""Gymnasium environment of a simulation, for reinforcement learning and other agents that act and observe.

Gymnasium is an optional dependency: this module can be imported without it, but makes no environments then. With it the
environment "paraflex/RAParM-I-v0" is registered. Agents observe readings, optionally less the planned readings, and a
preview of the plan.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array, Numbers
from paraflex.dynamics import State
from paraflex.dynamics.points import marker_position
from paraflex.errors import InputError, IntegrationError
from paraflex.integrators import IntegrationOptions, Method
from paraflex.mechanism import ActuationMode, Mechanism, Start
from paraflex.mechanism.measured import encoders_of, measured_sensors
from paraflex.mechanism.quantities import all_known, known, not_negative, positive
from paraflex.paths import ModelWithPaths
from paraflex.tracking import TrackingTask
from .laws.estimators import rounded
from .loop.references import readings_of
from .loop.simulation import Simulation
from .loop.together import by_name, checked_number, periods_in, real_numbers

if TYPE_CHECKING:
    from gymnasium import Env, Space
else:
    try:
        from gymnasium import Env
    except ImportError:
        from .no_gymnasium import Env

# Observations are clipped to this magnitude, as observation spaces must be bounded; readings of a run that has not
# diverged stay far below.
WIDEST = 1e6


class Observer:
    """Observation function of an environment.

    Parameters
    ----------
    mechanism : Mechanism
        Mechanism whose sensors are observed.
    task : TrackingTask or None
        Plan; None without a path.
    names : tuple of str
        Names of the sensors.
    times : (k,) array
        Times of the observations [s].
    errors : bool
        Whether the planned readings are subtracted, for sensors whose readings follow from the plan.
    ahead : sequence of float
        Preview times [s]: the change of the planned readings over each of them is observed as well.
    noise, quantise, scales : mapping of str to float
        Standard deviation of noise, resolution, and reading that is observed as one, by sensor and in its unit.

    Attributes
    ----------
    names : tuple of str
        Names of the observed values: sensors, then the planned readings with their preview time, such as "x+0.01".

    Raises
    ------
    InputError
        A preview without a plan, preview times that are not positive, or values for sensors that are not observed.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        task: TrackingTask | None,
        names: tuple[str, ...],
        times: Array,
        *,
        errors: bool,
        ahead: Sequence[float],
        noise: Mapping[str, float] | None,
        quantise: Mapping[str, float] | None,
        scales: Mapping[str, float] | None,
    ) -> None:
        self._sensors = names
        self._noisy, self._coarse = bool(noise), bool(quantise)
        self._deviations = _by_sensor(noise, names, "noise", 0.0)
        self._resolution = _by_sensor(quantise, names, "quantise", 0.0)
        scale = _by_sensor(scales, names, "scales", 1.0)
        if ahead and task is None:
            raise InputError("there is no plan to look ahead in", field="ahead", value=ahead, remedy="leave it out")
        if not all(np.isfinite(time) and time > 0.0 for time in ahead):
            raise InputError("not positive numbers", field="ahead", value=ahead, remedy="give times in seconds")
        self._planned = np.zeros((times.size, len(names)))
        self._changes = np.zeros((times.size, 0))
        self.names: tuple[str, ...] = names
        if task is not None:
            # After the end of the plan, the readings are those at its end.
            motions = (task.plan.follow(np.minimum(times + time, task.motion.t[-1])) for time in (0.0, *ahead))
            now, *later = (readings_of(motion, mechanism, names) for motion in motions)
            planned = [k for k, name in enumerate(names) if name in now]
            if errors:
                self._planned[:, planned] = np.stack(list(now.values()), axis=1) if now else 0.0
            changes = [each[name] - now[name] for each in later for name in now]
            self._changes = np.stack(changes, axis=1) if changes else self._changes
            scale = np.concatenate([scale, *(scale[planned] for _ in ahead)])
            self.names = (*names, *(f"{name}+{time:g}" for time in ahead for name in now))
        self._scale = scale

    def __call__(self, k: int, readings: Mapping[str, float], random: np.random.Generator) -> Array:
        """Return the observation (names,) at instant k from the readings of all sensors, with noise from `random`."""
        y = np.array([readings[name] for name in self._sensors])
        if self._noisy:
            y += self._deviations * random.standard_normal(y.size)
        if self._coarse:
            y = rounded(y, self._resolution)
        seen = np.concatenate([y - self._planned[k], self._changes[k]]) / self._scale
        return np.minimum(np.maximum(seen, -WIDEST), WIDEST)


def observed_sensors(given: Sequence[str] | None, simulation: Simulation) -> tuple[str, ...]:
    """Return the given names of sensors, by default those of the motors' encoders and of the end-effector's x and y.

    Raises
    ------
    InputError
        Unknown sensors.
    """
    if given is not None:
        all_known(given, simulation.sensors_read, "sensors", "sensor")
        return tuple(given)
    mechanism, effector = simulation.mechanism, simulation.mechanism.end_effector
    joints = encoders_of(mechanism, simulation.motors)
    axes = [] if effector is None else [axis for axis in ("x", "y") if axis in effector.coordinates]
    return tuple(dict.fromkeys([*joints, *axes]))


def _by_sensor(given: Mapping[str, float] | None, names: tuple[str, ...], field: str, otherwise: float) -> Array:
    """Return one positive number for each sensor (names,), with a default for sensors that are not given."""
    for name, value in (given or {}).items():
        known(name, names, field, "observed sensor")
        if not (np.isfinite(value) and value > 0.0):
            raise InputError("not a positive number", field=f"{field}.{name}", value=value,
                             remedy="give one in the unit of the sensor, or leave it out")  # fmt: skip
    return np.array([(given or {}).get(name, otherwise) for name in names], dtype=float)


Reward = Callable[[Simulation, Mapping[str, float], Array], float]
# With feed-forward, actions are corrections: default limits as a fraction of its largest torque.
_CORRECTING = 0.1
# With 0.25 ms steps deviations of RAParM-I are accurate to 1 %.
_STEP = 2.5e-4
# Environments of the library and their settings.
REGISTERED: dict[str, dict[str, Any]] = {
    "paraflex/RAParM-I-v0": {"name": "raparm_i", "options": IntegrationOptions(method="generalised-alpha", step=_STEP)},
}


class Environment(Env[Array, Numbers]):
    """Gymnasium environment of a mechanism, with motor torques as actions.

    An action a (motors,) applies the torques a x `limits` for one period, in addition to those of the plan if there is
    feed-forward. The observation is read at the end of the period. The reward of a period is

        - min((d / accuracy)^2 + effort_weight sum(a^2), penalty),

    with d the deviation of the end-effector from the plan at the end of the period. An episode is truncated at the end
    of the run. It is terminated, with the cause in `info["error"]`, if an event of the options ends it, or if it has
    diverged and cannot continue. The last observation is then returned again, and each remaining period costs
    `penalty`, so that termination never pays.

    Torques that jump from one period to the next make the steps of an adaptive method short. With
    `IntegrationOptions(method="generalised-alpha", step=2.5e-4)` runs are about ten times as fast, and less accurate.

    Parameters
    ----------
    source : TrackingTask, Mechanism or Model
        Plan; or a mechanism without a path, for which `reward` is required.
    mode : str or ActuationMode, optional
        Motors of the actions; all by default.
    period : float
        Time from one action to the next [s].
    limits : float or mapping of str to float, optional
        Torque of an action of one, for all motors of the mode or by motor [N m, N]. By default the largest torque that
        the plan needs of any of them, or a tenth of it with feed-forward.
    sensors : sequence of str, optional
        Observed sensors: see `Simulation.sensors_read`. By default the encoders of the motors and the position of the
        end-effector.
    errors : bool
        Whether planned readings are subtracted from the readings.
    ahead : sequence of float
        Preview times of the plan [s]: the change of the planned readings over each of them is observed as well.
    scales : mapping of str to float, optional
        Reading that is observed as one, by sensor and in its unit; one by default.
    noise, quantise : mapping of str to float, optional
        Standard deviation of white noise, and resolution, by sensor and in its unit; zero by default.
    feed_forward : bool, optional
        Whether the planned torques act as well; by default if there is a plan.
    accuracy : float
        Deviation that costs one in a period [m].
    effort_weight : float
        Cost of a motor at its limit in a period.
    penalty : float
        Largest cost of a period, and cost of each remaining period when an episode is terminated.
    reward : callable, optional
        Function reward(simulation, readings, action) that is called after a period and replaces the formula; `readings`
        are those of all sensors by name, without noise.
    vary : callable, optional
        Function vary(random) -> Mechanism that returns the mechanism of an episode, from the environment's random
        number generator; its members keep their names. The plan stays that of the mechanism for which it was made.
    duration, start, balanced, method, options
        See `Simulation`.

    Attributes
    ----------
    simulation : Simulation
        Simulation of the episode: `simulation.result()` returns its run so far, for figures and data.
    motors : tuple of str
        Motors, in the order of the actions.
    limits : (motors,) array
        Torques of an action of one [N m, N].
    observed : tuple of str
        Names of the observed values, in order: sensors, then previews such as "x+0.01".
    action_space : Box
        Actions (motors,) in [-1, 1], float32; numbers outside are clipped, float64 is not rounded.
    observation_space : Box
        Observations (observed,) in [-1e6, 1e6], float64.

    Raises
    ------
    InputError
        Gymnasium is not installed; unknown motors or sensors; numbers that are not positive; no reward or no limits
        where there is no plan; or arguments that `Simulation` rejects.
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
        self._task, self._vary, self._reward = task, vary, reward
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
        # Whether an episode is running, its period, and the action of a period that was simulated before `step`.
        self.running: bool = False
        self._step = 0
        self.begun: Array | None = None
        self._failure: IntegrationError | None = None
        self._seen: Array = np.zeros(len(self.observed))
        self.action_space: Space[Any] = Box(-1.0, 1.0, (len(self.motors),), np.float32)
        self.observation_space: Space[Any] = Box(-WIDEST, WIDEST, (len(self.observed),), np.float64)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """Begin an episode, and return the first observation and `info`.

        Parameters
        ----------
        seed : int, optional
            Seed of the noise and of `vary`: equal seeds and actions give bit-identical episodes.
        options : dict, optional
            Must be empty: there are no options.

        Raises
        ------
        InputError
            Options, or a mechanism of `vary` with other members.
        """
        super().reset(seed=seed)
        self.running, self.begun = False, None
        if options:
            raise InputError("there are none", field="options", value=options, remedy="leave them out")
        if self._vary is not None:
            self.simulation = self._varied(self._vary(self.np_random))
        readings = self.simulation.reset()
        self._step, self.running = 0, True
        self._seen = self._observe(0, readings, self.np_random)
        return self._seen.copy(), self._info(np.zeros(len(self.motors)))

    def step(self, action: Numbers) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Apply torques for one period; return observation, reward, terminated, truncated and `info`.

        `info` contains the "time" reached [s], the "torques" of the action [N m, N], with a plan the "deviation" of the
        end-effector [m], and after termination the "error".

        Parameters
        ----------
        action : (motors,) array
            Torques as fractions of the limits.

        Raises
        ------
        InputError
            An action of another shape, or one that is not finite.
        gymnasium.error.ResetNeeded
            The episode has ended, or none has begun.
        """
        if not self.running:
            from gymnasium.error import ResetNeeded

            raise ResetNeeded("the episode has ended, or none has begun; call reset()")
        applied, self.begun = self.begun, None
        if applied is None:
            applied = within(action, self.limits.shape, self.motors, "action")
            self.begin_period(applied)
            self.simulate_period()
        try:
            if self._failure is not None:
                raise self._failure
            readings = self.simulation._end_step()
        except IntegrationError as error:
            return self._terminated(error, applied)
        self._seen = self._observe(self._step, readings, self.np_random)
        info = self._info(applied)
        reward = self._reward_of(readings, applied, info)
        truncated = self._step == self._times.size - 1
        self.running = not truncated
        return self._seen.copy(), reward, False, truncated, info

    def begin_period(self, action: Array) -> None:
        """Apply an action (motors,) from -1 to 1, for `simulate_period`."""
        if self.begun is not None:
            raise InputError("is running: a reward may not step it", field="environment", remedy="make another")
        self._step, self._failure = self._step + 1, None
        self.simulation._begin_step(action * self.limits, float(self._times[self._step]))

    def simulate_period(self) -> None:
        """Simulate the period that has begun, on any thread: kernels release the interpreter lock."""
        try:
            self.simulation._move(float(self._times[self._step]))
        except IntegrationError as error:
            self._failure = error

    def _terminated(self, error: IntegrationError, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Return the result of `step` where the run cannot continue."""
        left = self._times.size - self._step
        info = {"time": self.simulation.time, "torques": action * self.limits, "error": str(error)}
        self.running = False
        return self._seen.copy(), -self._penalty * left, True, False, info

    def _reward_of(self, readings: Mapping[str, float], action: Array, info: Mapping[str, Any]) -> float:
        if self._reward is not None:
            return float(self._reward(self.simulation, readings, action))
        cost = (info["deviation"] / self._accuracy) ** 2 + self._effort_weight * (action @ action)
        return -min(float(cost), self._penalty)

    def _info(self, action: Array) -> dict[str, Any]:
        info: dict[str, Any] = {"time": self.simulation.time, "torques": action * self.limits}
        effector = self.simulation.system.mechanism.end_effector
        if self._desired is not None and effector is not None:
            system = self.simulation.system
            place = marker_position(system, system.marker(effector.point), self.simulation.state.q)
            info["deviation"] = float(np.sqrt((away := place - self._desired[self._step]) @ away))
        return info

    def _varied(self, mechanism: Mechanism) -> Simulation:
        """Return the simulation of another mechanism with the same members."""
        if _members(mechanism) != self._members:
            raise InputError("makes a mechanism with other members", field="vary", value=mechanism.name,
                             remedy="change numbers only: members keep their names")  # fmt: skip
        if self._task is not None:
            return Simulation(self._task.remodelled(mechanism), **self._settings)
        settings: dict[str, Any] = self._settings | {"duration": self._duration}
        return Simulation(mechanism, **settings)


def within(given: Any, shape: tuple[int, ...], motors: Sequence[str], field: str) -> Array:
    """Return actions of a shape (..., motors), clipped to -1 and 1; raise an `InputError` if they are not finite."""
    actions = real_numbers(given)
    if actions is None or actions.shape != shape or not np.isfinite(actions).all():
        raise InputError(f"not {' x '.join(map(str, shape))} finite numbers", field=field, value=given,
                         remedy=f"give one from -1 to 1 for each of {', '.join(motors)}")  # fmt: skip
    return np.minimum(np.maximum(actions, -1.0), 1.0)


def _members(mechanism: Mechanism) -> tuple[tuple[str, ...], ...]:
    """Return the names of bodies, joints, motors and sensors."""
    groups = (mechanism.bodies, mechanism.joints, mechanism.motors, measured_sensors(mechanism))
    return tuple(tuple(each.name for each in group) for group in groups)


def _instants(start: float, end: float, period: float) -> Array:
    """Return the times (k,) of observations [s]: the start, then the ends of periods, the last one being shorter."""
    count = periods_in(end - start, period)
    times = start + period * np.arange(count + 1, dtype=np.float64)
    times[-1] = end
    return times


def _limits(given: Any, task: TrackingTask | None, simulation: Simulation, part: float) -> Array:
    """Return the torques (motors,) of an action of one; by default a fraction of the plan's largest torque."""
    motors = simulation.motors
    if given is None:
        if task is None:
            raise InputError("are missing", field="limits", remedy="give the torque for an action of 1 in N m")
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
    """Register the environments of the library with Gymnasium unless they are registered already."""
    import gymnasium

    one, several = "paraflex.library:environment", "paraflex.library:environments"
    for name, settings in REGISTERED.items():
        if name not in gymnasium.registry:
            gymnasium.register(name, entry_point=one, vector_entry_point=several, kwargs=settings)


if Env.__module__.startswith("gymnasium"):
    register()
