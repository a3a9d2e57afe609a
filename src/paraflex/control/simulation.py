"""A simulation one can step: torques that stay from one instant to the next, sensors read between, states kept."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from paraflex.actuation import FeedForward, actuation_condition
from paraflex.arguments import checked_arguments, given_as
from paraflex.arrays import Array
from paraflex.control.controllers import Controller, Plant
from paraflex.control.described import ControllerDescription
from paraflex.control.held import HeldTorques, Torques
from paraflex.control.inside import sampled_law
from paraflex.control.loop import LawFailure, Loop
from paraflex.control.readings import Readings
from paraflex.control.runs import ControlledMotion, ControlledTracking, TorqueLog
from paraflex.control.together import SAME, is_number
from paraflex.dynamics import State, System
from paraflex.errors import ControllerError, InputError, IntegrationError, Moment, ResultWarning
from paraflex.findings import warn_of
from paraflex.integrators import IntegrationOptions, Method, Solution, Treatment, choose
from paraflex.integrators.integrate import Integration, Kept
from paraflex.kernel.sampled import SampledLaw
from paraflex.kinematics import ModelWithPaths
from paraflex.mechanism import ActuationMode, Mechanism, Start, mode_of_motors, parse_mode
from paraflex.mechanism.measured import encoders_of, measured_sensors
from paraflex.mechanism.quantities import finite
from paraflex.motion import motion_start
from paraflex.tracking import Ending, TrackingTask
from paraflex.validity import warn, with_blame

# Samples this much later than a change of torques, as a part of the run, are those just before it.
_ROUNDING = 1e-12


@given_as("a saved simulation", "what Simulation.save returned")
@dataclass(frozen=True)
class Saved:
    """The whole state of a simulation: see `Simulation.save`.

    Attributes
    ----------
    time : float
        [s]
    """

    time: float
    identity: str
    kept: Kept
    torques: tuple[Array, TorqueLog]
    loop: Loop | None
    controllers: Any


class Simulation:
    """A mechanism under torques that are given from one instant to the next, as a digital controller gives them.

    The same kernels, methods and error control as a run. Steps end at every instant; where torques change nothing
    reaches across: accelerations and multipliers are made consistent with the new ones, while the size of steps and the
    factor of the iteration matrix are kept.

    Parameters
    ----------
    source : TrackingTask, Mechanism or Model
        A plan, from its start; or a mechanism without a path, from a start.
    mode : str or ActuationMode, optional
        Motors that torques are given for; the others turn freely. All by default.
    feed_forward : bool
        Of a plan, whether its torques act by themselves, smooth in time, beside those that are given.
    duration : float, optional
        Of a mechanism: up to when it runs [s]; that of a model's study by default. The tolerance is of the whole.
    samples : int
        Of a mechanism: times at which results are kept; of a plan they are those of the task.
    start : State, Start or str, optional
        Of a mechanism, as for `simulate_motion`.
    balanced : bool
        Whether it starts in equilibrium, or in the deflections of the plan's motion.
    method : Method or str, optional
        One of paraflex's own.
    options : IntegrationOptions, optional
        With a fixed `step` constraints are kept by projection, where the method can, unless `constraints` says
        otherwise: torques that jump let joints come apart faster than Baumgarte's coefficients bring them together.

    Attributes
    ----------
    mechanism : Mechanism
    system : System
    mode : ActuationMode
    motors : tuple of str
        Those that torques are given for, in the order of the mechanism.
    sensors_read : tuple of str
        Encoders of motors by the names of their joints, coordinates of the end-effector, the mechanism's own sensors.
    task : TrackingTask or None
    end : float
        [s]

    Raises
    ------
    InputError
        A mode, motor or sensor that the mechanism does not have, a method by another program, no duration.
    ActuationError
        The mode cannot drive the mechanism along the plan's path.
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
        method: Method | str | None = None,
        options: IntegrationOptions | None = None,
    ) -> None:
        self._options = _projecting(choose(method, options))
        self.task: TrackingTask | None = source if isinstance(source, TrackingTask) else None
        self.mechanism: Mechanism = source.mechanism if isinstance(source, TrackingTask) else Mechanism.made_of(source)
        self.mode: ActuationMode = _mode(self.mechanism, mode)
        names = [motor.name for motor in self.mechanism.motors]
        self.motors: tuple[str, ...] = tuple(name for name in names if name in self.mode.motors)
        planned = FeedForward(self.mode, (), np.zeros(0), np.zeros(0))
        self._fed_forward = feed_forward
        if isinstance(source, TrackingTask):
            for name, value in (("duration", duration), ("start", start)):
                if value is not None:
                    raise InputError("a plan says it itself", field=name, value=value, remedy="leave it out")
            # Brakes are not for motors under control.
            task = replace(source, after=Ending.FREE)
            self.task = task.balanced(self.mode) if balanced else task
            self.system: System = task.system
            self._initial: State = self.task.start
            self._times: Array = task.motion.t
            self._condition = actuation_condition(task.effort, self.mode)
            if feed_forward:
                planned = task.torques(self.mode)
        else:
            if feed_forward:
                raise InputError("there is no plan whose torques could act", field="feed_forward", value=True,
                                 remedy="give the task that pf.plan makes, or leave it out")  # fmt: skip
            begun = motion_start(source, duration, samples, start, balanced=balanced)
            self.system, self._initial, self._times = begun
        self.end: float = float(self._times[-1])
        began = self._initial.time
        self._torques = HeldTorques(self.system, self.mechanism, self.motors, planned, began, self.end)
        self._readings = Readings(self.system, measured_sensors(self.system.mechanism))
        self._watched = self._readings
        self.sensors_read: tuple[str, ...] = self._readings.names
        self._integration = Integration(
            self.system, self._torques.signals, self._initial, self._times, knots=self._torques.knots,
            options=self._options, samples=self._times.size,
        )  # fmt: skip
        self._loop: Loop | None = None
        # Taken by the call that runs it: a law, or another thread, finds none.
        self._turn = [None]
        self._integration.start()
        self._fresh = self.save()

    # --- Step by step ---

    @property
    def time(self) -> float:
        """The time reached [s]."""
        return self._integration.time

    @property
    def state(self) -> State:
        """Coordinates and velocities at the time reached."""
        now = self._integration.run.now()
        return State(now.t, now.q, now.v)

    def sensors(self) -> dict[str, float]:
        """Readings of all sensors at the time reached, by name and in their units, before torques change there."""
        return dict(zip(self.sensors_read, self._read(self._readings).tolist(), strict=True))

    def reset(self) -> dict[str, float]:
        """Go back to the start, without torques and controllers; the readings there."""
        with self._alone():
            self._restore(self._fresh)
        return self.sensors()

    def step(self, torques: Torques, until: float) -> dict[str, float]:
        """Let torques act from now until a time; the readings then.

        Parameters
        ----------
        torques : (motors,) array or mapping of str to float
            Of the motors of the mode, in the order of `motors`, or of some by name; zero for others [N m, N].
        until : float
            [s]

        Raises
        ------
        InputError
            Other numbers of torques, none that are finite, unknown motors, a time that is past or beyond the end.
        IntegrationError
            It cannot go on; it carries the run so far. An event of the options that ends it does as well.
        """
        given = self._torques.given(torques)
        if not is_number(until) or not self.time < until <= self.end * (1.0 + SAME):
            raise InputError(f"is not within the rest of the run, {self.time:.6g} to {self.end:.6g} s", field="until",
                             value=until, remedy="give a later time in it, or reset the simulation")  # fmt: skip
        with self._alone():
            self._use(None)
            self._apply(given)
            self._march(min(until, self.end))
        if self._integration.status == "stopped":
            cause = f"the run has ended: {self._integration.message}"
            raise IntegrationError(cause, None, self.result(), "call result() for what there is, or reset()")
        return self.sensors()

    @property
    def ended(self) -> bool:
        """Whether it has come to its end, or to an event that ends it."""
        return self._integration.status == "stopped" or self.time >= self.end

    def save(self) -> Saved:
        """The whole state, controllers included: a run restored from it continues bit for bit."""
        loop = self._loop
        controllers = None if loop is None else loop.saved()
        return Saved(self.time, self._identity, self._integration.saved(), self._torques.saved(), loop, controllers)

    @checked_arguments()
    def restore(self, saved: Saved) -> None:
        """Go back to what `save` gave, of this simulation or one that was made of the same.

        Raises
        ------
        InputError
            It is of another simulation.
        """
        if saved.identity != self._identity:
            raise InputError("the state of another simulation", field="saved",
                             remedy="give what save returned, of the same mechanism, plan and options")  # fmt: skip
        with self._alone():
            self._restore(saved)

    @cached_property
    def _identity(self) -> str:
        """A digest of all that a state goes on with."""
        signals, start = self._integration.run.problem.signals, self._initial
        found = hashlib.blake2b(repr((self.mechanism, self.mode, self._options, self._fed_forward)).encode())
        for array in (*self.system.packed, *signals, self._times, start.q, start.v):
            found.update(np.ascontiguousarray(array).tobytes())
        return found.hexdigest()

    @contextmanager
    def _alone(self) -> Iterator[None]:
        """Let one call at a time run it."""
        try:
            self._turn.pop()
        except IndexError:
            raise InputError("is running: a law, or another thread, may not run it as well", field="simulation",
                             remedy="make another simulation") from None  # fmt: skip
        try:
            yield
        finally:
            self._turn.append(None)

    def _restore(self, saved: Saved) -> None:
        self._integration.restore(saved.kept)
        self._torques.restore(saved.torques)
        self._use(saved.loop)
        if saved.loop is not None:
            saved.loop.restore(saved.controllers)

    # --- Under controllers ---

    @checked_arguments()
    def run(
        self,
        controllers: Any = None,
        *,
        until: float | None = None,
        on_progress: Callable[[float], None] | None = None,
        warning: bool = True,
    ) -> ControlledTracking | ControlledMotion:
        """Run under controllers from the start; without any go on under those there are.

        Parameters
        ----------
        controllers : Controller, ControllerDescription, law or sequence of them, optional
            See `Controller` and `SampledController`; torques of several for one motor add up. An empty list starts
            anew without any.
        until : float, optional
            Up to when [s]; to the end by default.
        on_progress : callable, optional
            Called with the time reached [s]. A KeyboardInterrupt ends the run with what is there, marked "interrupted".
        warning : bool
            Whether a run that is doubtful issues warnings, as of `simulate`.

        Returns
        -------
        ControlledTracking or ControlledMotion

        Raises
        ------
        InputError
            A time that is not finite; controllers with unknown sensors or motors, one named twice, or with periods that
            are no multiples of the shortest; a law that gives the whole torque beside another or feed-forward.
        ControllerError
            One raised an error, or returned what cannot be torques; it carries the run so far.
        IntegrationError
            It cannot go on; it carries the run so far.
        """
        finite(self.end if until is None else until, "until")
        end = self.end if until is None else min(until, self.end)
        try:
            with self._alone():
                if controllers is not None:
                    self._begin(controllers if isinstance(controllers, list | tuple) else [controllers])
                while self.time < end and not self.ended:
                    self._go_on(end, on_progress)
                    if on_progress is not None:
                        on_progress(self.time)
        except KeyboardInterrupt:
            self._integration.interrupt()
        except LawFailure as failure:
            cause, moment = str(failure), Moment(self.time, self._integration.run.attempts)
            partial = self._made(replace(self._integration.solution(), status="failed", message=f"{cause} at {moment}"))
            raise ControllerError(cause, moment, partial, "mend the controller") from failure.__cause__
        made = self.result()
        if warning:
            warn(made.validity, "" if self.task is None else f"mode {self.mode.name}")
            warn_of(made.doubts, ResultWarning)
        return made

    def _begin(self, controllers: Sequence[Any]) -> None:
        """Start anew under controllers; in open loop under none."""
        self._restore(self._fresh)
        several = [each.made(self.mechanism, self.motors) if isinstance(each, ControllerDescription) else each
                   for each in controllers]  # fmt: skip
        start = self._initial.time
        loop = Loop(several, self._plant, self.sensors_read, self.motors, start) if several else None
        if loop is not None and loop.whole and self._fed_forward:
            raise InputError("gives the whole torque, and the planned one acts besides", field=loop.whole[0],
                             remedy="leave feed_forward of the simulation out")  # fmt: skip
        if loop is not None and np.any(loop.acting):
            self._torques.begin(self._torques.of_all(loop.acting.sum(axis=0)), self.state)
            self._integration.start()
        self._use(loop)

    def _go_on(self, end: float, on_progress: Callable[[float], None] | None) -> None:
        """To the next instant of the controllers, or to the end."""
        loop = self._loop
        if loop is None or loop.inside is not None:
            self._march(end, on_progress=on_progress)
            return
        slack = SAME * loop.period
        if loop.next <= self.time + slack:
            changed = loop.act(lambda: self._read(self._watched))
            if changed is not None:
                self._apply(self._torques.of_all(changed))
        until = min(end, loop.next)
        if until > self.time + slack:
            self._march(until, slack)

    def result(self) -> ControlledTracking | ControlledMotion:
        """The run so far.

        Raises
        ------
        IntegrationError
            It cannot go on; it carries the run so far.
        """
        try:
            solution = self._integration.solution()
        except IntegrationError as error:
            with_blame(error, self.mechanism)
            error.partial = self._made(error.partial)
            raise
        if solution.status == "complete" and self.time < self.end:
            message = f"as far as t = {self.time:.6g} s"
            solution = replace(solution, status="interrupted", message=message)
        return self._made(solution)

    # --- Within ---

    def _made(self, solution: Solution) -> ControlledTracking | ControlledMotion:
        """The run with a solution."""
        k = solution.t.size - bool(solution.event)
        slack = _ROUNDING * (self.end - self._initial.time)
        log = self._torques.log
        given, commanded = log.at(solution.t, slack), log.given(solution.t, slack)
        motors = {motor.name: unit for motor, unit in zip(self.mechanism.motors, self.mechanism.motor_units(),
                                                           strict=True)}  # fmt: skip
        records = () if self._loop is None else self._loop.records(motors.__getitem__)
        if self.task is None:
            times = solution.t if solution.event else self._times
            none = dict.fromkeys(motors, 0.0)
            return ControlledMotion(self.system, times, none, solution, given, commanded, records)
        planned = self._torques.planned.evaluate(solution.t[:k])
        title = self._options.method.title
        return ControlledTracking(self.task, self._torques.planned, self._condition, solution, title,
                                  acting=given[:k] + planned, commanded=commanded[:k] + planned,
                                  controllers=records)  # fmt: skip

    def _use(self, loop: Loop | None) -> None:
        """Let these controllers act."""
        if loop is self._loop:
            return
        if loop is not None:
            self._watched = self._readings.only(loop.read)
            if loop.inside is None:
                loop.inside = self._inside(loop)
        self._loop = loop
        self._integration.under(None if loop is None else loop.inside)

    def _inside(self, loop: Loop) -> SampledLaw | None:
        """A loop for the compiled time loop; None where it stays outside."""
        # What amplifiers do to torques is not known there.
        if loop.alone is None or self._torques.limited.any() or np.any(self._torques.amplifiers.lags):
            return None
        controller, plant = loop.alone
        own = [motor.name for motor in self.mechanism.motors]
        outputs = [own.index(name) for name in plant.outputs]
        return sampled_law(controller, plant, self._watched, outputs, self._torques.base, self._torques.held, self.end)

    def _plant(self, controller: Controller) -> Plant:
        outputs = tuple(controller.outputs) or self.motors
        inputs = tuple(controller.inputs) or encoders_of(self.mechanism, outputs)
        units = dict(zip(self.sensors_read, self._readings.units, strict=True))
        return Plant(
            self.mechanism, self.mode, self.task, self.state, inputs, tuple(units[name] for name in inputs), outputs,
            controller.period, controller.delay, feed_forward=self._fed_forward,
        )  # fmt: skip

    def _read(self, readings: Readings) -> Array:
        """Readings now."""
        now = self._integration.run.now()
        torques = self._torques.acting(now.t) if readings.of_torques else np.zeros(len(self._torques.held))
        return readings(now, torques)

    def _apply(self, torques: Array) -> None:
        """Let torques (motors,) of all motors act from now on."""
        if not self._torques.hold(torques, self.time, lambda: self.state):
            return
        if self._integration.run.attempts == 0:
            self._integration.start()
        else:
            self._integration.resume()

    def _march(
        self, until: float, slack: float | None = None, on_progress: Callable[[float], None] | None = None
    ) -> None:
        """March to a time, or to a stop of the run that is the same but for rounding."""
        stops = self._integration.run.problem.stops
        near = stops[int(np.argmin(np.abs(stops - until)))]
        if abs(near - until) <= (SAME * (until - self.time) if slack is None else slack):
            until = float(near)
        try:
            self._integration.march(until, on_progress=on_progress)
        finally:
            # Note which torques acted in the compiled time loop.
            if self._loop is not None:
                self._loop.keep_last()
                for t, torques in self._loop.torques_acted(len(self._torques.log)):
                    self._torques.note(t, torques)
        failure = None if self._loop is None else self._loop.failure
        if failure is not None:
            raise failure
        if not (self._integration.goes_on or self.ended):
            self.result()


def _projecting(options: IntegrationOptions) -> IntegrationOptions:
    """Options of which constraints are kept by projection with fixed steps, which no error control shortens."""
    chosen = options.constraints is not None or options.automatic_gains or options.step is None
    able = Treatment.PROJECTION in options.method.treatments
    return replace(options, constraints=Treatment.PROJECTION) if able and not chosen else options


def _mode(mechanism: Mechanism, mode: str | ActuationMode | None) -> ActuationMode:
    if mode is None:
        return mode_of_motors(mechanism, [motor.name for motor in mechanism.motors])
    return mode if isinstance(mode, ActuationMode) else parse_mode(mechanism, mode)
