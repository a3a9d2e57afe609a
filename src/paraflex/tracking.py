"""Study of the paper (Fig. 10): desired path, rigid joint motion, torques of a mode, run of the flexible mechanism."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property, partial

import numpy as np

from .actuation import (
    Effort,
    Electrical,
    FeedForward,
    TorquePlan,
    actuation_condition,
    electrical,
    electrical_findings,
    plan_torques,
    planned_profiles,
    required_effort,
)
from .arguments import checked_arguments, named_in_errors
from .arrays import Array, Brief
from .display import Played
from .dynamics import (
    BrakedSystem,
    State,
    System,
    balanced_state,
    brake,
    build_system,
    held_joints,
    joint_motions,
    pack_signals,
    still_signals,
    undeformed_motion,
)
from .dynamics.points import PointMotion, marker_position, point_motion
from .errors import InputError, IntegrationError, ResultWarning, as_enum
from .findings import Finding, warn_of
from .integrators import IntegrationOptions, Method, Solution, check_times, choose
from .integrators.beam_ends import leave_beam
from .integrators.between import SAMPLES
from .mechanism import ActuationMode, Mechanism, Motor, finite_segments, parse_mode, standing, with_clamps
from .mechanism.actuation_modes import followers
from .mechanism.profiles import stops
from .paths import ModelWithPaths, Path, RigidMotion, path_follower
from .validity import Driven, Following, Validity, assess, implausible_results, warn, with_likely_cause

# Times closer than this fraction of the run are merged: a knot beside a sample would force a step of almost zero
# length.
_SAME_TIME = 1e-9


class Ending(Enum):
    """Action of the active motors after the path.

    FREE
        Feed-forward continues: there is no torque where the mechanism at rest needs none, and remaining vibration and
        error move it on.
    HOLD
        Brakes hold the motors at the angles, or travels, that they have when the path ends.
    """

    FREE = "free"
    HOLD = "hold"


@named_in_errors("a task", "the task that plan_tracking makes")
@dataclass(frozen=True)
class TrackingTask(Brief):
    """Mechanism, path, and rigid motion along it: the common part of the runs of all modes.

    Attributes
    ----------
    mechanism : Mechanism
        Mechanism that is driven along the path.
    system : System
        Equations of motion of the mechanism, with its flexible bodies.
    path : Path
        Desired path of the end-effector.
    motion : RigidMotion
        Rigid motion at the sample times.
    effort : Effort
        Required effort of that motion.
    plan : TorquePlan
        Efforts on a fine grid, from which the torques of any mode follow.
    start : State
        Initial state: undeformed, at the start of the path and with its velocity.
    whole : TrackingTask or None
        Task of the uncut mechanism, if this one is of its finite segments.
    after : Ending
        Action of the active motors after the path, or its name.
    """

    mechanism: Mechanism
    system: System
    path: Path
    motion: RigidMotion
    effort: Effort
    plan: TorquePlan
    start: State
    whole: "TrackingTask | None" = None
    after: Ending = Ending.FREE

    def __post_init__(self) -> None:
        object.__setattr__(self, "after", as_enum(Ending, self.after, "after"))

    @property
    def holds(self) -> bool:
        """Whether brakes engage in its runs: they are requested, and the runs continue after the path."""
        return self.after is Ending.HOLD and self.motion.t[-1] > self.path.duration * (1.0 + _SAME_TIME)

    @checked_arguments()
    def mode(self, mode: str | ActuationMode) -> ActuationMode:
        """Return an actuation mode by its name, signs or motor names."""
        return mode if isinstance(mode, ActuationMode) else parse_mode(self.mechanism, mode)

    @checked_arguments()
    def torques(self, mode: str | ActuationMode) -> FeedForward:
        """Return the feed-forward torques of a mode, of minimum norm and smooth in time."""
        return self.plan.feed_forward(self.mode(mode))

    @checked_arguments()
    def driven(self, mode: str, torques: Array, condition: Array, actual: Array | None = None) -> Driven:
        """Return the data of a run driven by torques or forces (k, motors) of a mode, at the first samples of the task.

        Parameters
        ----------
        mode : str
            Name of the mode.
        torques : (k, motors) array
            Torques or forces of the motors [N m, N].
        condition : (k,) array
            Condition number of the actuation matrix.
        actual : (k, 2) array, optional
            Actual positions of the end-effector [m]; the desired ones by default.
        """
        mechanism, desired = self.mechanism, self.motion.desired
        names = [motor.name for motor in mechanism.motors]
        actual = desired.position if actual is None else actual
        return Driven(
            mode=mode,
            desired=desired.position[: len(actual)],
            actual=actual,
            acceleration=float(np.max(np.linalg.norm(desired.acceleration, axis=1))),
            peaks=dict(zip(names, np.max(np.abs(torques), axis=0).tolist(), strict=True)),
            units=dict(zip(names, mechanism.motor_units(), strict=True)),
            condition=float(np.max(condition, initial=1.0)),
        )

    @checked_arguments()
    def remodelled(self, mechanism: Mechanism) -> "TrackingTask":
        """Return the task, motion and torques unchanged, for another model of the bodies: rigid, other mesh, geometry.

        Parameters
        ----------
        mechanism : Mechanism
            Mechanism as returned by `Mechanism.rigid`, `with_beams`, `with_geometry` or `refined`.
        """
        system = build_system(mechanism)
        return replace(self, mechanism=mechanism, system=system, start=_start(system, self.motion))

    @checked_arguments()
    def in_segments(self, segments: int | Mapping[str, int] = 8) -> "TrackingTask":
        """Return the task for the virtual prototype of finite segments, driven by the same torques.

        Parameters
        ----------
        segments : int or mapping of str to int
            Numbers of segments: see `mechanism.finite_segments`.

        Raises
        ------
        InputError
            See `mechanism.finite_segments`; or the task is one of finite segments already.
        """
        if self.whole is not None:
            raise InputError("cut into segments already", field="segments", remedy="cut the task it was made from")
        return replace(self.remodelled(finite_segments(self.mechanism, segments).mechanism), whole=self)

    @checked_arguments()
    def balanced(self, mode: str | ActuationMode) -> "TrackingTask":
        """Return the task with a balanced start, at the path's initial position and velocity of a mode's motors.

        Under weight or loads links sag before they move; started undeformed, they would vibrate about that deflection.
        On a path that starts in motion, inertia forces of that motion deflect them as well: see
        `dynamics.balanced_state`.

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
    ) -> "TrackingRun":
        """Drive the flexible mechanism with the torques of a mode: see the function `simulate`."""
        return simulate(self, mode, method=method, options=options, after=after, warning=warning)


@named_in_errors("a run along a path", "a run that simulate returns")
@dataclass(frozen=True)
class TrackingRun(Played):
    """Run of one mode of a task.

    Attributes
    ----------
    task : TrackingTask
        Task of the run.
    torques : FeedForward
        Feed-forward torques of the mode.
    condition : (k,) array
        Condition number of the actuation matrix at the sample times.
    solution : Solution
        Computed motion.
    method : str
        Title of the integration method.
    holding : (k, motors) array, optional
        Torques at all samples of a run in which motors were held, on a motion or by brakes [N m]; None for other runs.
    """

    task: TrackingTask
    torques: FeedForward
    condition: Array
    solution: Solution
    method: str = "TR-BDF2"
    holding: Array | None = None

    @property
    def mode(self) -> ActuationMode:
        """Actuation mode."""
        return self.torques.mode

    @property
    def system(self) -> System:
        """Equations of motion of the mechanism."""
        return self.task.system

    @property
    def samples(self) -> int:
        """Number of the task's sample times that the run reached; the state at an event is one more."""
        return self.solution.samples

    @cached_property
    def end_effector(self) -> PointMotion:
        """Motion of the end-effector at the sample times reached."""
        effector, k, solution = self.task.mechanism.end_effector, self.samples, self.solution
        assert effector is not None
        return point_motion(self.system, effector.point, solution.q[:k], solution.v[:k], solution.a[:k])

    @property
    def applied(self) -> Array:
        """Torques of all motors at the task's sample times, or at the k ones reached if motors were held [N m]."""
        return self.torques.evaluate(self.task.motion.t) if self.holding is None else self.holding

    @property
    def follows(self) -> bool:
        """Whether torques drive the mechanism along the path."""
        return self.holding is None or self.task.holds

    @cached_property
    def validity(self) -> Validity | None:
        """Validity of the model in the run; None for rigid bodies and finite segments."""
        following = None if self.driven is None else Following(self.driven.deviation, self.driven.condition)
        return assess(self.task.system, self.solution, following)

    @cached_property
    def findings(self) -> tuple[Finding, ...]:
        """Findings on events in the run, and on results that are implausible for the mechanism."""
        whole = self.task.whole or self.task
        found = implausible_results(self.task.system, self.solution, self.driven, whole.mechanism)
        # The sufficient number of samples differs from mode to mode.
        of_run = (
            replace(one, place=f"mode {self.mode.name}") if one.place == SAMPLES else one
            for one in self.solution.findings
        )
        described = whole.mechanism
        amplifiers = electrical_findings(described, self.electrical, self.mode) if described.actuators else ()
        return (*of_run, *found, *amplifiers)

    @cached_property
    def electrical(self) -> Electrical:
        """Currents and voltages of the motors, from the mechanism's actuators."""
        return electrical(self.task.system, (self.task.whole or self.task).mechanism, self)

    @cached_property
    def driven(self) -> Driven | None:
        """Path, largest torques and condition number, if torques drive the mechanism along the path; else None."""
        task, solution, k = self.task, self.solution, self.samples
        effector = task.mechanism.end_effector
        if effector is None or not self.follows or not k:
            return None
        actual = marker_position(task.system, task.system.marker(effector.point), solution.q[:k])
        return task.driven(self.mode.name, self.applied, self.condition[:k], actual)

    def warn(self) -> None:
        """Issue a `ValidityWarning` or a `ResultWarning` for each finding."""
        warn(self.validity, f"mode {self.mode.name}")
        warn_of(self.findings, ResultWarning)


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
        Mechanism, or a model that contains it; the model's [study] is ignored.
    path : Path or str
        Path, or for a model the name of one of its paths.
    duration : float, optional
        Duration of the run, dwell included [s]; the path's own by default.
    samples : int
        Number of sample times at which results are kept, evenly spaced, both ends included.
    assembly : str, optional
        Name of the assembly (assembly mode) of the mechanism; the first by default.
    orientation : float
        Angle of the end-effector where it is a task coordinate and the path does not define it [rad].
    after : Ending or str
        Action of the active motors after the path: "free" or "hold".
    warning : bool
        Whether a `ModelWarning` names points that the path moves off their beams, where `SlidingJoint.at_end` is
        "warn".

    Returns
    -------
    TrackingTask
        Task for the runs of all modes.

    Raises
    ------
    InputError, AssemblyError, UnreachablePathError
        See `paths.follow_path`; a path that moves a sliding point off its beam, where `at_end` is "error".
    """
    source, mechanism = mechanism, Mechanism.from_source(mechanism)
    if isinstance(path, str):
        if isinstance(source, Mechanism):
            raise InputError(
                "a mechanism has no paths by name", field="path", value=path,
                remedy="give the model that paraflex.load reads instead of its mechanism, or a path such as Polygon",
            )  # fmt: skip
        path = source.path(path)
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
        Task to be run.
    mode : str or ActuationMode
        Mode, by its name, signs ("+-+-") or motor names ("tau1,tau5").
    method : Method or str, optional
        Integration method, an object of `paraflex.methods` or a name in `paraflex.METHODS`; that of the options by
        default.
    options : IntegrationOptions, optional
        Integration options.
    after : Ending or str, optional
        Action of the active motors after the path, "free" or "hold"; that of the task by default. With "hold" the
        joints of the active motors are locked at their positions when the path ends: see `dynamics.brake`.
    on_progress : callable, optional
        Function called with the time reached [s].
    warning : bool
        Whether a run outside the validity of its model issues a `ValidityWarning`, and one with implausible results a
        `ResultWarning`; its `validity` and `findings` contain the findings in any case.

    Returns
    -------
    TrackingRun
        Run of the mode.

    Raises
    ------
    ActuationError, SingularActuationError
        The mode cannot drive the mechanism along the path.
    IntegrationError
        The run could not be finished; the error carries a TrackingRun with the results so far.
    """
    if after is not None:
        task = replace(task, after=after)
    options = choose(method, options)
    torques = task.torques(mode)
    run_of = partial(
        TrackingRun, task, torques, actuation_condition(task.effort, torques.mode), method=options.method.title
    )
    # Plans are made and checked without the code that integrates.
    from .integrators import integrate

    march = partial(integrate, options=options, samples=task.motion.t.size, on_progress=on_progress)
    try:
        if followers(task.mechanism.motors, torques.mode):
            run = _follow(task, torques, run_of, march)
        elif task.holds:
            run = _drive_and_hold(task, torques, run_of, march)
        else:
            run = run_of(_drive(task, torques, task.motion.t, march))
    except IntegrationError as error:
        if not isinstance(error.partial, TrackingRun):
            error.partial = run_of(error.partial)
        raise
    if warning:
        run.warn()
    return run


def _drive(task: TrackingTask, torques: FeedForward, times: Array, march: Callable[..., Solution]) -> Solution:
    signals, knots = pack_signals(task.mechanism, torques.signals, float(task.motion.t[-1]))
    stops = np.sort(np.concatenate([path_stops(torques.knots, task.mechanism), knots]))
    try:
        return march(task.system, signals, task.start, times, knots=stops)
    except IntegrationError as error:
        with_likely_cause(error, (task.whole or task).mechanism)
        raise


def _follow(
    task: TrackingTask, torques: FeedForward, run_of: Callable[..., TrackingRun], march: Callable[..., Solution]
) -> TrackingRun:
    """Move along the path with the joints of motors held on the planned motion; other active ones give torques."""
    motors = followers(task.mechanism.motors, torques.mode)
    if task.holds and len(motors) < len(torques.mode.motors):
        raise InputError(
            "motors that give torques cannot be locked where others follow the plan", field="study.after",
            value=task.after.value, remedy='write after = "free"',
        )  # fmt: skip
    joints = [motor.joint for motor in motors]
    profiles = planned_profiles(task.plan, torques, joints)
    # Motors that follow the plan clamp the links; finite segments bend up to them then.
    system = task.system if task.whole is None else build_system(with_clamps(task.mechanism, joints))
    held = held_joints(system, task.start, profiles)
    given = torques.without([motor in motors for motor in task.mechanism.motors])
    signals, knots = pack_signals(held.system.mechanism, given.signals, float(task.motion.t[-1]))
    stops = np.unique(np.concatenate([path_stops(torques.knots, task.mechanism), knots]))
    own = [held.system.rows.index(row) for row in task.system.rows]

    def whole(solution: Solution) -> TrackingRun:
        holding = _holding(task, motors, held, solution) + given.evaluate(solution.t)
        errors = solution.multiplier_errors
        solution = replace(
            solution,
            multipliers=solution.multipliers[:, own],
            multiplier_errors=None if errors is None else errors[own],
        )
        return run_of(solution, holding=holding[: solution.samples])

    try:
        return whole(march(held.system, signals, held.state, task.motion.t, knots=stops))
    except IntegrationError as error:
        error.partial = whole(with_likely_cause(error, (task.whole or task).mechanism).partial)
        raise


def _holding(task: TrackingTask, motors: Sequence[Motor], held: BrakedSystem, solution: Solution) -> Array:
    """Return the torques (k, motors) of all motors in a run in which some hold their joints."""
    holding = np.zeros((solution.t.size, len(task.mechanism.motors)))
    holding[:, [task.mechanism.motors.index(motor) for motor in motors]] = held.holding(solution.multipliers)
    return holding


def _drive_and_hold(
    task: TrackingTask, torques: FeedForward, run_of: Callable[..., TrackingRun], march: Callable[..., Solution]
) -> TrackingRun:
    """Drive along the path, then continue with the joints of the active motors locked."""
    times, end = task.motion.t, task.path.duration
    count = int(np.searchsorted(times, end * (1.0 + _SAME_TIME), side="right"))
    until = times[:count]
    if count == 0 or until[-1] < end * (1.0 - _SAME_TIME):
        until = np.append(until, end)
    driven = _drive(task, torques, until, march)
    if driven.status != "complete":
        return run_of(driven)
    motors = [motor for motor in task.mechanism.motors if motor.name in torques.mode.motors]
    braked = brake(task.system, State(float(until[-1]), driven.q[-1], driven.v[-1]), [motor.joint for motor in motors])
    signals, knots = still_signals(braked.system.mechanism, float(times[-1]))
    own = [braked.system.rows.index(row) for row in task.system.rows]

    def whole(held: Solution) -> TrackingRun:
        solution = _joined(driven, held, count, held.multipliers[:, own], braked.energy)
        holding = _holding(task, motors, braked, held)
        holding = np.concatenate([torques.evaluate(driven.t[:count]), holding[: held.samples]])
        return run_of(solution, holding=holding)

    try:
        held = march(braked.system, signals, braked.state, times[count:], knots=np.array(knots), begun=driven)
    except IntegrationError as error:
        error.partial = whole(with_likely_cause(error, (task.whole or task).mechanism).partial)
        raise
    return whole(held)


def _joined(driven: Solution, held: Solution, samples: int, multipliers: Array, energy: float) -> Solution:
    """Join a run and its continuation from its last state, after brakes have absorbed energy.

    Parameters
    ----------
    driven, held : Solution
        Run and its continuation, with the same coordinates.
    samples : int
        Number of samples of the run that are kept.
    multipliers : (k, m) array
        Multipliers of the continuation, one per row of the run's system [N, N m].
    energy : float
        Energy absorbed by the brakes [J].
    """
    gained = driven.kinetic_energy[-1] + driven.strain_energy[-1] - driven.kinetic_energy[0] - driven.strain_energy[0]
    before, known = driven.work[-1], {one.place for one in driven.findings}
    first, then = driven.coordinate_errors, held.coordinate_errors
    arrays = {
        name: np.concatenate([getattr(driven, name)[:samples], getattr(held, name)])
        for name in ("t", "q", "v", "a", "kinetic_energy", "strain_energy")
    }
    counts = ("steps", "rejected", "newton_iterations", "factorisations", "evaluations", "wall_time")
    maxima = ("constraint_position_max", "constraint_velocity_max")
    return replace(
        held,
        **arrays,
        multipliers=np.concatenate([driven.multipliers[:samples], multipliers]),
        work=np.concatenate([driven.work[:samples], held.work + before - energy]),
        **{name: getattr(driven, name) + getattr(held, name) for name in counts},
        **{name: max(getattr(driven, name), getattr(held, name)) for name in maxima},
        # The imbalance of the continuation is relative to its start.
        energy_balance_max=max(driven.energy_balance_max, abs(gained - before) + held.energy_balance_max),
        singular_positions=driven.singular_positions + held.singular_positions,
        brake_energy=energy,
        # Locked joints have rows that the run does not have.
        multiplier_errors=driven.multiplier_errors,
        coordinate_errors=None if first is None or then is None else first + then,
        findings=(*driven.findings, *(one for one in held.findings if one.place not in known)),
    )


def _start(system: System, motion: RigidMotion) -> State:
    """Return the initial state of a rigid motion, undeformed."""
    q, v, _ = undeformed_at(system, motion, 0)
    return State(float(motion.t[0]), q, v)


def undeformed_at(system: System, motion: RigidMotion, sample: int | list[int]) -> tuple[Array, Array, Array]:
    """Return coordinates (n,), or (k, n), and two derivatives at samples of a rigid motion, bodies undeformed."""
    return undeformed_motion(system, motion.system, motion.q[sample], motion.v[sample], motion.a[sample])


def path_knots(path: Path, end: float, mechanism: Mechanism | None = None) -> Array:
    """Return the times of a run between which the motion along a path is smooth, start and end included [s].

    With a mechanism, the times between which its loads are smooth are included as well.
    """
    knots = np.unique(np.concatenate([[0.0, end], [knot for knot in path.knots if 0.0 < knot < end]]))
    knots = knots[np.concatenate([[True], np.diff(knots) > _SAME_TIME * end])]
    profiles = [profile for load in mechanism.loads for profile in load.profiles] if mechanism else []
    given = np.unique(
        [knot for profile in profiles for knot in profile.knots if _SAME_TIME * end < knot < end * (1.0 - _SAME_TIME)]
    )
    # Where two knots coincide, that of the load is kept, as steps end there.
    apart = np.abs(knots[:, None] - given) > _SAME_TIME * end
    return np.unique(np.concatenate([knots[apart.all(axis=1)], given]))


def path_stops(knots: Array, mechanism: Mechanism) -> Array:
    """Return the knots of planned torques at which steps must end, omitting most rows of long load tables."""
    profiles = [profile for load in mechanism.loads for profile in load.profiles]
    return knots[~np.isin(knots, [knot for profile in profiles for knot in set(profile.knots) - set(stops(profile))])]
