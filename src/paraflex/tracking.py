"""The paper's study (Fig. 10): desired path, rigid joint motion, torques of a mode, flexible mechanism."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property

import numpy as np

from paraflex.actuation import (
    Effort,
    Electrical,
    FeedForward,
    TorquePlan,
    actuation_condition,
    electrical,
    electrical_findings,
    plan_torques,
    required_effort,
)
from paraflex.arguments import checked_arguments, given_as
from paraflex.arrays import Array
from paraflex.display import Shown
from paraflex.dynamics import (
    State,
    System,
    balanced_state,
    brake,
    build_system,
    joint_motions,
    pack_signals,
    still_signals,
    undeformed_motion,
)
from paraflex.dynamics.joint_coordinates import marker_place
from paraflex.errors import InputError, IntegrationError, ResultWarning, as_enum
from paraflex.findings import Finding, warn_of
from paraflex.integrators import IntegrationOptions, Method, Solution, check_times, choose, integrate
from paraflex.integrators.beam_ends import leave_beam
from paraflex.integrators.between import SAMPLES
from paraflex.kinematics import ModelWithPaths, Path, RigidMotion, path_follower
from paraflex.mechanism import ActuationMode, Mechanism, finite_segments, parse_mode, standing
from paraflex.mechanism.laws import stops
from paraflex.validity import Driven, Following, Validity, assess, doubtful_results, warn, with_blame

# Two times closer than this fraction of the run are one: a knot beside a sample would make a step of nothing.
_SAME_TIME = 1e-9


class Ending(Enum):
    """Action of the active motors after the path.

    FREE
        Their feed-forward goes on: no torque where nothing pulls at the mechanism at rest, and what then is left of
        vibration and error moves it on.
    HOLD
        Brakes hold them at the angles, or travels, they have when the path ends.
    """

    FREE = "free"
    HOLD = "hold"


@given_as("a task", "the task that plan_tracking makes")
@dataclass(frozen=True)
class TrackingTask:
    """A mechanism, a path, and the rigid motion along it: the common part of the runs of all modes.

    Attributes
    ----------
    mechanism : Mechanism
    system : System
        Of the mechanism, flexible where its bodies are.
    path : Path
    motion : RigidMotion
        At the sample times.
    effort : Effort
        Of that motion.
    plan : TorquePlan
    start : State
        Undeformed, at the start of the path, moving as the path does.
    whole : TrackingTask or None
        The task of the uncut mechanism, where this one is of its finite segments.
    after : Ending
        What the active motors do after the path; a name is taken for it.
    """

    mechanism: Mechanism
    system: System
    path: Path
    motion: RigidMotion
    effort: Effort
    plan: TorquePlan
    start: State
    whole: TrackingTask | None = None
    after: Ending = Ending.FREE

    def __post_init__(self) -> None:
        object.__setattr__(self, "after", as_enum(Ending, self.after, "after"))

    @property
    def holds(self) -> bool:
        """Whether brakes engage in its runs: they are requested, and the runs go on after the path."""
        return self.after is Ending.HOLD and self.motion.t[-1] > self.path.duration * (1.0 + _SAME_TIME)

    @checked_arguments()
    def mode(self, mode: str | ActuationMode) -> ActuationMode:
        """An actuation mode by name, signs or motor names."""
        return mode if isinstance(mode, ActuationMode) else parse_mode(self.mechanism, mode)

    @checked_arguments()
    def torques(self, mode: str | ActuationMode) -> FeedForward:
        """Feed-forward torques of a mode: minimum norm, smooth in time."""
        return self.plan.feed_forward(self.mode(mode))

    @checked_arguments()
    def driven(self, mode: str, torques: Array, condition: Array, actual: Array | None = None) -> Driven:
        """Data of a run driven by torques or forces (k, motors) of a mode, at the first samples of the task.

        Parameters
        ----------
        mode : str
        torques : (k, motors) array
            [N m, N]
        condition : (k,) array
            Of the actuation matrix.
        actual : (k, 2) array, optional
            Of the end-effector [m]; where it is to be by default.
        """
        mechanism, desired = self.mechanism, self.motion.desired
        names = [motor.name for motor in mechanism.motors]
        wanted = desired.position if actual is None else desired.position[: len(actual)]
        return Driven(
            mode=mode,
            desired=wanted,
            actual=wanted if actual is None else actual,
            acceleration=float(np.max(np.linalg.norm(desired.acceleration, axis=1))),
            peaks=dict(zip(names, np.max(np.abs(torques), axis=0).tolist(), strict=True)),
            units=dict(zip(names, mechanism.motor_units(), strict=True)),
            condition=float(np.max(condition, initial=1.0)),
        )

    @checked_arguments()
    def remodelled(self, mechanism: Mechanism) -> TrackingTask:
        """The same motion and torques for another model of the same bodies: rigid ones, another mesh or geometry.

        Parameters
        ----------
        mechanism : Mechanism
            As `Mechanism.rigid`, `with_beams`, `with_geometry` or `refined` return it.
        """
        system = build_system(mechanism)
        return replace(self, mechanism=mechanism, system=system, start=_start(system, self.motion))

    @checked_arguments()
    def in_segments(self, segments: int | Mapping[str, int] = 8) -> TrackingTask:
        """The same task for the virtual prototype of finite segments, driven by the same torques.

        Parameters
        ----------
        segments : int or mapping of str to int
            See `mechanism.finite_segments`.

        Raises
        ------
        InputError
            See there; or the task is of finite segments already.
        """
        if self.whole is not None:
            raise InputError("cut into segments already", field="segments", remedy="cut the task it was made from")
        return replace(self.remodelled(finite_segments(self.mechanism, segments).mechanism), whole=self)

    @checked_arguments()
    def balanced(self, mode: str | ActuationMode) -> TrackingTask:
        """The same task with a balanced start, at the path's initial position and velocity of a mode's motors.

        Under weight or loads links sag before they move; started undeformed they would ring about that. On a path that
        starts in motion inertia forces of that motion deflect them as well: see `dynamics.balanced_state`.

        Raises
        ------
        AssemblyError
            No equilibrium is found.
        """
        joints = [motor.joint for motor in self.mechanism.motors if motor.name in self.mode(mode).motors]
        rigid = self.motion
        driven = joint_motions(rigid.system, rigid.q[0], rigid.v[0], rigid.a[0], joints)
        return replace(self, start=balanced_state(self.system, self.start, driven))

    def simulate(
        self,
        mode: str | ActuationMode,
        *,
        method: Method | str | None = None,
        options: IntegrationOptions | None = None,
        after: Ending | str | None = None,
        warning: bool = True,
    ) -> TrackingRun:
        """Drive the flexible mechanism with the torques of a mode: see the function `simulate`."""
        return simulate(self, mode, method=method, options=options, after=after, warning=warning)


@given_as("a run along a path", "a run that simulate returns")
@dataclass(frozen=True)
class TrackingRun(Shown):
    """A run of one mode of a task.

    Attributes
    ----------
    task : TrackingTask
    torques : FeedForward
    condition : (k,) array
        Condition number of the actuation matrix at the sample times.
    solution : Solution
    method : str
        How it was integrated.
    holding : (k, motors) array, optional
        Torques at the samples of a run in which motors were held, on a motion or by brakes, at all of them [N m].
    """

    task: TrackingTask
    torques: FeedForward
    condition: Array
    solution: Solution
    method: str = "TR-BDF2"
    holding: Array | None = None

    @property
    def mode(self) -> ActuationMode:
        """The actuation mode."""
        return self.torques.mode

    @property
    def applied(self) -> Array:
        """Torques of all motors at the task's sample times, or at the k reached ones if brakes held them [N m]."""
        return self.torques.evaluate(self.task.motion.t) if self.holding is None else self.holding

    @property
    def follows(self) -> bool:
        """Whether torques drive it along the path."""
        return self.holding is None or self.task.holds

    @cached_property
    def validity(self) -> Validity | None:
        """Validity of the model in the run; None for rigid bodies and finite segments."""
        following = None if self.driven is None else Following(self.driven.deviation, self.driven.condition)
        return assess(self.task.system, self.solution, following)

    @cached_property
    def doubts(self) -> tuple[Finding, ...]:
        """Findings on events in the run, and on results that are implausible for the mechanism."""
        whole = self.task.whole or self.task
        found = doubtful_results(self.task.system, self.solution, self.driven, whole.mechanism)
        # How many samples are enough is another number in each mode.
        of_run = (
            replace(one, place=f"mode {self.mode.name}") if one.place == SAMPLES else one
            for one in self.solution.findings
        )
        described = whole.mechanism
        amplifiers = electrical_findings(described, self.electrical, self.mode) if described.actuators else ()
        return (*of_run, *found, *amplifiers)

    @cached_property
    def electrical(self) -> Electrical:
        """Currents and voltages of the motors, by the mechanism's actuators."""
        return electrical(self.task.system, (self.task.whole or self.task).mechanism, self)

    @cached_property
    def driven(self) -> Driven | None:
        """Path, largest torques and condition number, where torques drive the mechanism along the path."""
        task, solution = self.task, self.solution
        # The state at an event is a sample more than the task's times.
        k = solution.t.size - bool(solution.event)
        effector = task.mechanism.end_effector
        if effector is None or not self.follows or not k:
            return None
        actual = marker_place(task.system, task.system.marker(effector.point), solution.q[:k])[0]
        return task.driven(self.mode.name, self.applied, self.condition[:k], actual)

    def warn(self) -> None:
        """Issue a `ValidityWarning` or a `ResultWarning` for each finding."""
        warn(self.validity, f"mode {self.mode.name}")
        warn_of(self.doubts, ResultWarning)


@checked_arguments()
def plan_tracking(
    mechanism: Mechanism | ModelWithPaths,
    path: Path | str,
    *,
    duration: float | None = None,
    samples: int = 701,
    assembly: str | None = None,
    orientation: float = 0.0,
    after: Ending | str = Ending.FREE,
    warning: bool = True,
) -> TrackingTask:
    """Plan a motion of the end-effector: joint motion of the rigid mechanism, and the required effort.

    Parameters
    ----------
    mechanism : Mechanism or Model
        A model stands for its mechanism; nothing is taken from its [study].
    path : Path or str
        A path, or with a model the name of one of its paths.
    duration : float, optional
        Of the run, dwell included [s]; the path's own by default.
    samples : int
        Times at which results are kept, evenly spaced, both ends among them.
    assembly : str, optional
        Which way the mechanism is put together; the first by default.
    orientation : float
        Angle of the end-effector where it is a task coordinate and the path does not say it [rad].
    after : Ending or str
        What the active motors do after the path: "free" or "hold".
    warning : bool
        Whether a `ModelWarning` names points that the path takes off their beams, where `SlidingJoint.at_end` says
        "warn".

    Raises
    ------
    InputError, AssemblyError, UnreachablePathError
        See `kinematics.follow_path`; a path that takes a sliding point off its beam, where `at_end` says "error".
    """
    mechanism, path = _planned(mechanism, path)
    mechanism = standing(mechanism, assembly)
    end = path.duration if duration is None else duration
    check_times(end, samples)
    times = np.linspace(0.0, end, samples)

    follow = path_follower(mechanism, path, end, assembly=assembly, orientation=orientation)
    motion = follow(times)
    left = leave_beam(motion.system, motion.t, motion.q, motion.v)
    if warning:
        warn_of(left)
    system = build_system(mechanism)
    return TrackingTask(
        mechanism=mechanism,
        system=system,
        path=path,
        motion=motion,
        effort=required_effort(motion),
        plan=plan_torques(follow, path_knots(path, end, mechanism)),
        start=_start(system, motion),
        after=as_enum(Ending, after, "after"),
    )


@checked_arguments()
def simulate(
    task: TrackingTask,
    mode: str | ActuationMode,
    *,
    method: Method | str | None = None,
    options: IntegrationOptions | None = None,
    after: Ending | str | None = None,
    on_progress: Callable[[float], None] | None = None,
    warning: bool = True,
) -> TrackingRun:
    """Drive the flexible mechanism with the torques of a mode.

    Parameters
    ----------
    task : TrackingTask
    mode : str or ActuationMode
        Its name, signs ("+-+-") or motor names ("tau1,tau5").
    method : Method or str, optional
        Of integration: that of the options by default; an object of `paraflex.methods` or a name in `paraflex.METHODS`.
    options : IntegrationOptions, optional
    after : Ending or str, optional
        What the active motors do after the path, "free" or "hold": as the task says by default. Held, the joints of the
        active motors are locked where they are when the path ends: see `dynamics.brake`.
    on_progress : callable, optional
        Called with the time reached [s].
    warning : bool
        Whether a run beyond what its model can describe issues a `ValidityWarning`, and one of implausible results a
        `ResultWarning`; its `validity` and `doubts` hold them either way.

    Returns
    -------
    TrackingRun

    Raises
    ------
    ActuationError, SingularActuationError
        The mode cannot drive the mechanism along the path.
    IntegrationError
        The run could not be finished; it carries a TrackingRun with what was computed.
    """
    if after is not None:
        task = replace(task, after=after)
    options = choose(method, options)
    title = options.method.title
    torques = task.torques(mode)
    condition = actuation_condition(task.effort, torques.mode)
    try:
        if task.holds:
            run = _drive_and_hold(task, torques, condition, options, on_progress)
        else:
            solution = _drive(task, torques, task.motion.t, options, on_progress)
            run = TrackingRun(task, torques, condition, solution, title)
    except IntegrationError as error:
        if not isinstance(error.partial, TrackingRun):
            error.partial = TrackingRun(task, torques, condition, error.partial, title)
        raise
    if warning:
        run.warn()
    return run


def _planned(given: Mechanism | ModelWithPaths, path: Path | str) -> tuple[Mechanism, Path]:
    """The mechanism, and the path, which may be given by its name in a model."""
    mechanism = Mechanism.made_of(given)
    if not isinstance(path, str):
        return mechanism, path
    if isinstance(given, Mechanism):
        raise InputError(
            "a mechanism has no paths by name", field="path", value=path,
            remedy="give the model that paraflex.load reads instead of its mechanism, or a path such as Polygon",
        )  # fmt: skip
    return mechanism, given.path(path)


def _drive(
    task: TrackingTask,
    torques: FeedForward,
    times: Array,
    options: IntegrationOptions,
    on_progress: Callable[[float], None] | None,
) -> Solution:
    signals, knots = pack_signals(task.mechanism, torques.signals, float(task.motion.t[-1]))
    stops = np.sort(np.concatenate([path_stops(torques.knots, task.mechanism), knots]))
    try:
        return integrate(
            task.system, signals, task.start, times, knots=stops, options=options, samples=task.motion.t.size,
            on_progress=on_progress,
        )  # fmt: skip
    except IntegrationError as error:
        with_blame(error, (task.whole or task).mechanism)
        raise


def _drive_and_hold(
    task: TrackingTask,
    torques: FeedForward,
    condition: Array,
    options: IntegrationOptions,
    on_progress: Callable[[float], None] | None,
) -> TrackingRun:
    """Drive along the path, then with the joints of the active motors locked."""
    times, end = task.motion.t, task.path.duration
    count = int(np.searchsorted(times, end * (1.0 + _SAME_TIME), side="right"))
    until = times[:count]
    if count == 0 or until[-1] < end * (1.0 - _SAME_TIME):
        until = np.append(until, end)
    driven = _drive(task, torques, until, options, on_progress)
    title = options.method.title
    if driven.status != "complete":
        return TrackingRun(task, torques, condition, driven, title)
    motors = [motor for motor in task.mechanism.motors if motor.name in torques.mode.motors]
    braked = brake(task.system, State(float(until[-1]), driven.q[-1], driven.v[-1]), [motor.joint for motor in motors])
    signals, knots = still_signals(braked.system.mechanism, float(times[-1]))
    own = [braked.system.rows.index(row) for row in task.system.rows]
    columns = [task.mechanism.motors.index(motor) for motor in motors]

    def whole(held: Solution) -> TrackingRun:
        solution = driven.followed_by(held, count, held.multipliers[:, own], braked.energy)
        holding = np.zeros((held.t.size, len(task.mechanism.motors)))
        holding[:, columns] = braked.holding(held.multipliers)
        # The state at an event is a sample more than the task's times.
        holding = np.concatenate([torques.evaluate(driven.t[:count]), holding[: held.t.size - bool(held.event)]])
        return TrackingRun(task, torques, condition, solution, title, holding=holding)

    try:
        held = integrate(
            braked.system, signals, braked.state, times[count:], knots=np.array(knots), options=options,
            begun=driven, samples=times.size, on_progress=on_progress,
        )  # fmt: skip
    except IntegrationError as error:
        error.partial = whole(with_blame(error, (task.whole or task).mechanism).partial)
        raise
    return whole(held)


def _start(system: System, motion: RigidMotion) -> State:
    """The state at the start of a rigid motion, undeformed."""
    q, v, _ = undeformed_at(system, motion, 0)
    return State(float(motion.t[0]), q, v)


def undeformed_at(system: System, motion: RigidMotion, sample: int) -> tuple[Array, Array, Array]:
    """Coordinates (n,) and their derivatives at a sample of a rigid motion, bodies undeformed."""
    return undeformed_motion(system, motion.system, motion.q[sample], motion.v[sample], motion.a[sample])


def path_knots(path: Path, end: float, mechanism: Mechanism | None = None) -> Array:
    """Times of a run between which the motion along a path is smooth, start and end included [s].

    With a mechanism those between which its loads are smooth as well.
    """
    knots = np.unique(np.concatenate([[0.0, end], [knot for knot in path.knots if 0.0 < knot < end]]))
    knots = knots[np.concatenate([[True], np.diff(knots) > _SAME_TIME * end])]
    laws = [law for load in mechanism.loads for law in load.laws] if mechanism else []
    given = np.unique(
        [knot for law in laws for knot in law.knots if _SAME_TIME * end < knot < end * (1.0 - _SAME_TIME)]
    )
    # Of two that are one, that of the load is kept: steps end there.
    apart = np.abs(knots[:, None] - given) > _SAME_TIME * end
    return np.unique(np.concatenate([knots[apart.all(axis=1)], given]))


def path_stops(knots: Array, mechanism: Mechanism) -> Array:
    """Those of the knots of planned torques at which steps end: not all rows of a long table of a load."""
    laws = [law for load in mechanism.loads for law in load.laws]
    return knots[~np.isin(knots, [knot for law in laws for knot in set(law.knots) - set(stops(law))])]
