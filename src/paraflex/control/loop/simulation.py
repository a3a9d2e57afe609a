"""Simulation that is advanced in steps: torques held from one instant to the next, sensor readings, saved states."""

import hashlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from paraflex.actuation import FeedForward, actuation_condition
from paraflex.arguments import checked_arguments, named_in_errors
from paraflex.arrays import Array, Brief, whole
from paraflex.control.laws.controllers import Controller, Plant
from paraflex.control.laws.described import ControllerDescription
from paraflex.dynamics import State, System
from paraflex.errors import ControllerError, InputError, IntegrationError, Moment, ResultWarning
from paraflex.findings import warn_of
from paraflex.integrators import IntegrationOptions, Method, Solution, Treatment, choose
from paraflex.integrators.integration import Integration, IntegrationState
from paraflex.kernel.sampled import SampledLaw
from paraflex.mechanism import ActuationMode, Mechanism, Start, mode_of_motors, parse_mode
from paraflex.mechanism.actuation_modes import check_torques
from paraflex.mechanism.measured import encoders_of, measured_sensors
from paraflex.mechanism.quantities import finite
from paraflex.motion import motion_start
from paraflex.paths import ModelWithPaths
from paraflex.tracking import Ending, TrackingTask
from paraflex.validity import warn, with_likely_cause
from .held import HeldTorques, Torques
from .inside import sampled_law
from .readings import Readings
from .run_loop import LawFailure, Loop
from .runs import ControlledMotion, ControlledTracking, TorqueLog
from .together import SAME, is_number

# Samples within this fraction of the run after a change of torques show the state just before it.
_ROUNDING = 1e-12


@named_in_errors("a saved simulation", "what Simulation.save returned")
@dataclass(frozen=True)
class Saved(Brief):
    """Complete state of a simulation: see `Simulation.save`.

    Attributes
    ----------
    time : float
        Time at which the state was saved [s].
    """

    time: float
    identity: str
    kept: IntegrationState
    torques: tuple[Array, TorqueLog]
    loop: Loop | None
    controllers: Any


class Simulation:
    """Simulation of a mechanism whose torques are set at discrete instants, as by a digital controller.

    It uses the same kernels, methods and error control as a run. A step of the integration ends at every instant. Where
    torques change, accelerations and multipliers are made consistent with the new ones, and neither error estimate,
    dense output nor starting guess uses values from before; the step size and the factorised iteration matrix are kept.

    Parameters
    ----------
    source : TrackingTask, Mechanism or Model
        Plan, simulated from its start; or a mechanism without a path, simulated from `start`.
    mode : str or ActuationMode, optional
        Motors whose torques are set; the others turn freely. All motors by default.
    feed_forward : bool
        Whether the planned torques act as well, smooth in time, added to the torques that are set. Only with a plan.
    duration : float, optional
        Duration of a run without a path [s], to the whole of which the tolerance refers; that of the model's study by
        default.
    samples : int
        Number of sample times at which results are kept, without a path; with a plan they are those of the task.
    start : State, Start or str, optional
        Start of a run without a path, as for `simulate_motion`.
    balanced : bool
        Whether the run starts in equilibrium, or with the deflections that the planned motion causes.
    method : Method or str, optional
        Integration method, one of paraflex's own.
    options : IntegrationOptions, optional
        Integration options. With a fixed `step`, constraints are enforced by projection where the method can, unless
        `constraints` chooses otherwise: where torques jump, Baumgarte's coefficients correct the constraint drift of
        joints too slowly.

    Attributes
    ----------
    mechanism : Mechanism
        Mechanism as described.
    system : System
        Equations of motion of the mechanism.
    mode : ActuationMode
        Motors whose torques are set.
    motors : tuple of str
        Names of these motors, in the order of the mechanism.
    sensors_read : tuple of str
        Names of all sensors: encoders of motors by the names of their joints, coordinates of the end-effector, and the
        mechanism's own sensors.
    task : TrackingTask or None
        Plan; None without a path.
    end : float
        End time of the run [s].

    Raises
    ------
    InputError
        A mode, motor or sensor that the mechanism does not have, a method of another program, or no duration.
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
        self.mechanism: Mechanism = (
            source.mechanism if isinstance(source, TrackingTask) else Mechanism.from_source(source)
        )
        self.mode: ActuationMode = _mode(self.mechanism, mode)
        names = [motor.name for motor in self.mechanism.motors]
        self.motors: tuple[str, ...] = tuple(name for name in names if name in self.mode.motors)
        planned = FeedForward(self.mode, (), np.zeros(0), np.zeros(0))
        self._fed_forward = feed_forward
        if isinstance(source, TrackingTask):
            for name, value in (("duration", duration), ("start", start)):
                if value is not None:
                    raise InputError("is set by the plan", field=name, value=value, remedy="leave it out")
            # Brakes do not apply to motors under control.
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
                raise InputError("there is no plan with torques to feed forward", field="feed_forward", value=True,
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
        # Lock: the running call takes its element, so that a nested call by a control law or another thread finds none.
        self._turn = [None]
        self._integration.start()
        self._fresh = self.save()

    # --- Stepping ---

    @property
    def time(self) -> float:
        """Time reached [s]."""
        return self._integration.time

    @property
    def state(self) -> State:
        """Coordinates and velocities at the time reached."""
        now = self._integration.run.now()
        return State(now.t, now.q, now.v)

    def sensors(self) -> dict[str, float]:
        """Return the readings of all sensors by name, in their units, before torques change at the time reached."""
        return dict(zip(self.sensors_read, self._read(self._readings).tolist(), strict=True))

    def reset(self) -> dict[str, float]:
        """Return to the start, without torques and controllers, and return the readings there."""
        with self._alone():
            self._restore(self._fresh)
        return self.sensors()

    def step(self, torques: Torques, until: float) -> dict[str, float]:
        """Apply torques from the time reached until a later one, and return the readings then.

        Parameters
        ----------
        torques : (motors,) array or mapping of str to float
            Torques of the mode's motors, in the order of `motors`; or of some of them by name, zero for the others [N
            m, N].
        until : float
            End time of the step [s].

        Raises
        ------
        InputError
            A wrong number of torques, torques that are not finite, unknown motors, or a time that is past or beyond the
            end.
        IntegrationError
            The integration cannot continue, or an event of the options has ended the run; the error carries the run so
            far.
        """
        self._begin_step(torques, until)
        self._move(until)
        return self._end_step()

    def _begin_step(self, torques: Torques, until: float) -> None:
        """Apply the torques of a step; `_move`, which comes next, may run on another thread."""
        held = self._torques.of_motors(torques)
        if not is_number(until) or not self.time < until <= self.end * (1.0 + SAME):
            raise InputError(f"is not within the rest of the run, {self.time:.6g} to {self.end:.6g} s", field="until",
                             value=until, remedy="give a later time in it, or reset the simulation")  # fmt: skip
        with self._alone():
            self._use(None)
            self._apply(held)

    def _move(self, until: float) -> None:
        with self._alone():
            self._march(min(until, self.end))

    def _end_step(self) -> dict[str, float]:
        if self._integration.status == "stopped":
            cause = f"the run has ended: {self._integration.message}"
            raise IntegrationError(cause, None, self.result(), "call result() for what there is, or reset()")
        return self.sensors()

    @property
    def ended(self) -> bool:
        """Whether the run has reached its end or was ended by an event."""
        return self._integration.status == "stopped" or self.time >= self.end

    @property
    def compiled(self) -> bool:
        """Whether the present controllers act within the compiled time loop."""
        return self._loop is not None and self._loop.inside is not None

    def save(self) -> Saved:
        """Return the complete state, controllers included: a run restored from it continues bit for bit."""
        loop = self._loop
        controllers = None if loop is None else loop.saved()
        return Saved(self.time, self._identity, self._integration.saved(), self._torques.saved(), loop, controllers)

    @checked_arguments()
    def restore(self, saved: Saved) -> None:
        """Return to a state that `save` returned, of this simulation or of one made from the same arguments.

        Raises
        ------
        InputError
            A state of another simulation.
        """
        if saved.identity != self._identity:
            raise InputError("the state of another simulation", field="saved",
                             remedy="give what save returned, of the same mechanism, plan and options")  # fmt: skip
        with self._alone():
            self._restore(saved)

    @cached_property
    def _identity(self) -> str:
        """Digest of everything on which the continuation of a saved state depends."""
        signals, start = self._integration.run.problem.signals, self._initial
        found = hashlib.blake2b(whole((self.mechanism, self.mode, self._options, self._fed_forward)).encode())
        for array in (*self.system.packed, *signals, self._times, start.q, start.v):
            found.update(np.ascontiguousarray(array).tobytes())
        return found.hexdigest()

    @contextmanager
    def _alone(self) -> Iterator[None]:
        """Lock the simulation during one call."""
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
        """Run under controllers from the start; without `controllers`, continue under the present ones.

        Parameters
        ----------
        controllers : Controller, ControllerDescription, law or sequence of them, optional
            Controllers: see `Controller` and `SampledController`. Torques of several for one motor add up. An empty
            list restarts the run without controllers.
        until : float, optional
            Time at which to stop [s]; the end by default.
        on_progress : callable, optional
            Function called with the time reached [s]. A KeyboardInterrupt ends the run, which is returned as far as
            computed and marked "interrupted".
        warning : bool
            Whether a doubtful run issues warnings, as `simulate` does.

        Returns
        -------
        ControlledTracking or ControlledMotion
            Run with a plan, or without a path.

        Raises
        ------
        InputError
            A time that is not finite; controllers with unknown sensors or motors, a name given twice, or periods that
            are not multiples of the shortest one; a law that gives the whole torque beside another such law or
            feed-forward.
        ControllerError
            A controller that raised an error, or returned something other than finite torques; the error carries the
            run so far.
        IntegrationError
            The integration cannot continue; the error carries the run so far.
        """
        finite(self.end if until is None else until, "until")
        end = self.end if until is None else min(until, self.end)
        try:
            with self._alone():
                if controllers is not None:
                    self._begin(controllers if isinstance(controllers, list | tuple) else [controllers])
                while self.time < end and not self.ended:
                    self._advance_to_next(end, on_progress)
                    if on_progress is not None:
                        on_progress(self.time)
        except KeyboardInterrupt:
            self._integration.interrupt()
        except LawFailure as failure:
            cause, moment = str(failure), Moment(self.time, self._integration.run.attempts)
            partial = self._as_controlled(
                replace(self._integration.solution(), status="failed", message=f"{cause} at {moment}")
            )
            raise ControllerError(cause, moment, partial, "correct the controller") from failure.__cause__
        controlled = self.result()
        if warning:
            warn(controlled.validity, "" if self.task is None else f"mode {self.mode.name}")
            warn_of(controlled.findings, ResultWarning)
        return controlled

    def _begin(self, controllers: Sequence[Any]) -> None:
        """Restart under controllers, or in open loop if there are none."""
        self._restore(self._fresh)
        several = [each.made(self.mechanism, self.motors) if isinstance(each, ControllerDescription) else each
                   for each in controllers]  # fmt: skip
        start = self._initial.time
        loop = Loop(several, self._plant, self.sensors_read, self.motors, start) if several else None
        if loop is not None and loop.whole and self._fed_forward:
            raise InputError("gives the whole torque, but the planned one also acts", field=loop.whole[0],
                             remedy="leave out feed_forward of the simulation")  # fmt: skip
        if loop is not None and np.any(loop.acting):
            self._torques.begin(self._torques.of_all(loop.acting.sum(axis=0)), self.state)
            self._integration.start()
        self._use(loop)

    def _advance_to_next(self, end: float, on_progress: Callable[[float], None] | None) -> None:
        """Advance to the next instant of the controllers, or to the end."""
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
        """Return the run so far.

        Raises
        ------
        IntegrationError
            The integration cannot continue; the error carries the run so far.
        """
        try:
            solution = self._integration.solution()
        except IntegrationError as error:
            with_likely_cause(error, self.mechanism)
            error.partial = self._as_controlled(error.partial)
            raise
        if solution.status == "complete" and self.time < self.end:
            message = f"as far as t = {self.time:.6g} s"
            solution = replace(solution, status="interrupted", message=message)
        return self._as_controlled(solution)

    # --- Internals ---

    def _as_controlled(self, solution: Solution) -> ControlledTracking | ControlledMotion:
        """Return the run with a solution."""
        k = solution.samples
        slack = _ROUNDING * (self.end - self._initial.time)
        log = self._torques.log
        applied, commanded = log.at(solution.t, slack), log.given(solution.t, slack)
        motors = {motor.name: unit for motor, unit in zip(self.mechanism.motors, self.mechanism.motor_units(),
                                                           strict=True)}  # fmt: skip
        records = () if self._loop is None else self._loop.records(motors.__getitem__)
        if self.task is None:
            times = solution.t if solution.event else self._times
            none = dict.fromkeys(motors, 0.0)
            return ControlledMotion(self.system, times, none, solution, applied, commanded, records)
        planned = self._torques.planned.evaluate(solution.t[:k])
        title = self._options.method.title
        return ControlledTracking(self.task, self._torques.planned, self._condition, solution, title,
                                  acting=applied[:k] + planned, commanded=commanded[:k] + planned,
                                  controllers=records)  # fmt: skip

    def _use(self, loop: Loop | None) -> None:
        """Let the given controllers act from now on."""
        if loop is self._loop:
            return
        if loop is not None:
            self._watched = self._readings.only(loop.read)
            if loop.inside is None:
                loop.inside = self._inside(loop)
        self._loop = loop
        self._integration.under(None if loop is None else loop.inside)

    def _inside(self, loop: Loop) -> SampledLaw | None:
        """Return the sampled law of a loop that runs in the compiled time loop; None if it must run outside."""
        # The compiled time loop does not model amplifiers.
        if len(loop.controllers) > 1 or self._torques.limited.any() or np.any(self._torques.amplifiers.lags):
            return None
        controller, plant = loop.controllers[0], loop.plants[0]
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
        """Return the readings at the time reached."""
        now = self._integration.run.now()
        torques = self._torques.acting(now.t) if readings.of_torques else np.zeros(len(self._torques.held))
        return readings(now, torques)

    def _apply(self, torques: Array) -> None:
        """Apply torques (motors,) of all motors from now on."""
        if not self._torques.hold(torques, self.time, lambda: self.state):
            return
        if self._integration.run.attempts == 0:
            self._integration.start()
        else:
            self._integration.resume()

    def _march(
        self, until: float, slack: float | None = None, on_progress: Callable[[float], None] | None = None
    ) -> None:
        """Integrate up to a time, or to a stop of the run that equals it to rounding."""
        stops = self._integration.run.problem.stops
        near = stops[int(np.argmin(np.abs(stops - until)))]
        if abs(near - until) <= (SAME * (until - self.time) if slack is None else slack):
            until = float(near)
        try:
            self._integration.march(until, on_progress=on_progress)
        finally:
            if self._loop is not None:
                self._loop.note_inside(len(self._torques.log), self._torques.note)
        failure = None if self._loop is None else self._loop.failure
        if failure is not None:
            raise failure
        if not (self._integration.can_continue or self.ended):
            self.result()


def _projecting(options: IntegrationOptions) -> IntegrationOptions:
    """Return options that enforce constraints by projection for a fixed step, which no error control shortens."""
    chosen = options.constraints is not None or options.automatic_gains or options.step is None
    able = Treatment.PROJECTION in options.method.treatments
    return replace(options, constraints=Treatment.PROJECTION) if able and not chosen else options


def _mode(mechanism: Mechanism, mode: str | ActuationMode | None) -> ActuationMode:
    if mode is None:
        mode = mode_of_motors(mechanism, [motor.name for motor in mechanism.motors])
    mode = mode if isinstance(mode, ActuationMode) else parse_mode(mechanism, mode)
    check_torques(mode, "a sampled controller", mechanism.motors)
    return mode
