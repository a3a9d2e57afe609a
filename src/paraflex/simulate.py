"""The paper's study (Fig. 10), joined: desired path, rigid joint motion, torques of a mode, flexible mechanism."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from paraflex.actuation import Effort, FeedForward, TorquePlan, actuation_condition, plan_torques, required_effort
from paraflex.display import shown
from paraflex.dynamics import State, System, build_system, pack_signals, static_equilibrium
from paraflex.dynamics.joint_coordinates import marker_place
from paraflex.errors import InputError, IntegrationError
from paraflex.integrators import IntegrationOptions, Solution, choose, integrate
from paraflex.kinematics import Path, RigidMotion, path_follower
from paraflex.mechanism import ActuationMode, Mechanism, finite_segments, parse_mode
from paraflex.validity import Following, Validity, assess, warn

# Two times closer than this fraction of the run are one: a knot beside a sample would make a step of nothing.
_SAME_TIME = 1e-9


@dataclass(frozen=True)
class TrackingTask:
    """A mechanism, a path, and the rigid motion along it: what the runs of all modes share.

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
    carriers : mapping
        For each finite segment the beam it was cut from, and how far along that it starts [m]; empty where nothing
        was cut.
    """

    mechanism: Mechanism
    system: System
    path: Path
    motion: RigidMotion
    effort: Effort
    plan: TorquePlan
    start: State
    whole: TrackingTask | None = None
    carriers: Mapping[str, tuple[str, float]] = field(default_factory=dict)

    def mode(self, mode: str | ActuationMode) -> ActuationMode:
        """An actuation mode by name, signs or motor names."""
        return mode if isinstance(mode, ActuationMode) else parse_mode(self.mechanism, mode)

    def torques(self, mode: str | ActuationMode) -> FeedForward:
        """Feed-forward torques of a mode: minimum norm, smooth in time."""
        return self.plan.feed_forward(self.mode(mode))

    def remodelled(self, mechanism: Mechanism) -> TrackingTask:
        """The same motion and torques for another model of the same bodies: rigid ones, another mesh or geometry.

        Parameters
        ----------
        mechanism : Mechanism
            As `Mechanism.rigid`, `with_beams`, `with_geometry` or `refined` return it.
        """
        system = build_system(mechanism)
        return replace(
            self,
            mechanism=mechanism,
            system=system,
            start=_start(system, self.motion, self.carriers or _in_place(system)),
        )

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
        segmented = finite_segments(self.mechanism, segments)
        system = build_system(segmented.mechanism)
        return replace(
            self,
            mechanism=segmented.mechanism,
            system=system,
            start=_start(system, self.motion, segmented.carriers),
            whole=self,
            carriers=segmented.carriers,
        )

    def balanced(self, mode: str | ActuationMode) -> TrackingTask:
        """The same task, starting from static equilibrium with the active motors of a mode held where the path begins.

        Under weight or loads links sag before they move; started undeformed they would ring about that.

        Raises
        ------
        InputError
            The path does not start at rest.
        AssemblyError
            No equilibrium is found.
        """
        if np.any(self.motion.v[0]):
            raise InputError("the path does not start at rest", field="path", remedy="start undeformed")
        joints = [motor.joint for motor in self.mechanism.motors if motor.name in self.mode(mode).motors]
        return replace(self, start=static_equilibrium(self.system, self.start, joints))

    def simulate(
        self,
        mode: str | ActuationMode,
        *,
        method: str | None = None,
        options: IntegrationOptions | None = None,
        warning: bool = True,
    ) -> TrackingRun:
        """Drive the flexible mechanism with the torques of a mode: see the function `simulate`."""
        return simulate(self, mode, method=method, options=options, warning=warning)


@dataclass(frozen=True)
class TrackingRun:
    """One mode of a task, simulated.

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
        Torques at the samples where motors were held on a motion instead of driven by `torques` [N m].
    """

    task: TrackingTask
    torques: FeedForward
    condition: NDArray[np.float64]
    solution: Solution
    method: str = "TR-BDF2"
    holding: NDArray[np.float64] | None = None

    @property
    def mode(self) -> ActuationMode:
        """The actuation mode."""
        return self.torques.mode

    @cached_property
    def validity(self) -> Validity | None:
        """How far the run is within what its model can describe; None of rigid bodies and finite segments."""
        return assess(self.task.system, self.solution, self._following())

    def _following(self) -> Following | None:
        """Deviation from the path and condition number, where torques drive the mechanism along it."""
        task, solution = self.task, self.solution
        # The state at an event is a sample more than the task's times.
        k = solution.t.size - bool(solution.event)
        effector = task.mechanism.end_effector
        if effector is None or self.holding is not None or not k:
            return None
        place = marker_place(task.system, task.system.marker(effector.point), solution.q[:k])[0]
        squares = np.sum((place - task.motion.desired.position[:k]) ** 2, axis=1)
        return Following(float(np.sqrt(np.mean(squares))), float(np.max(self.condition[:k])))

    def _repr_html_(self) -> str:
        """In notebooks."""
        return shown(self)


def plan_tracking(
    mechanism: Mechanism,
    path: Path,
    *,
    duration: float | None = None,
    samples: int = 701,
    assembly: str | None = None,
    orientation: float = 0.0,
) -> TrackingTask:
    """Plan a motion of the end-effector: joint motion of the rigid mechanism and what it asks of the motors.

    Parameters
    ----------
    mechanism : Mechanism
    path : Path
    duration : float, optional
        Of the run, dwell included [s]; the path's own by default.
    samples : int
        Times at which results are kept, evenly spaced, both ends among them.
    assembly : str, optional
        Which way the mechanism is put together; the first by default.
    orientation : float
        Angle of the end-effector where it is a task coordinate and the path does not say it [rad].

    Raises
    ------
    InputError, AssemblyError, UnreachablePathError
        See `kinematics.follow_path`.
    """
    end = path.duration if duration is None else duration
    if not (np.isfinite(end) and end > 0.0):
        raise InputError("must be positive", field="duration", value=duration, remedy="give it in seconds")
    if samples < 2:
        raise InputError("too few samples", field="samples", value=samples, remedy="ask for at least 2")
    times = np.linspace(0.0, end, samples)

    follow = path_follower(mechanism, path, end, assembly=assembly, orientation=orientation)
    motion = follow(times)
    system = build_system(mechanism)
    return TrackingTask(
        mechanism=mechanism,
        system=system,
        path=path,
        motion=motion,
        effort=required_effort(motion),
        plan=plan_torques(follow, path_knots(path, end)),
        start=_start(system, motion, _in_place(system)),
    )


def simulate(
    task: TrackingTask,
    mode: str | ActuationMode,
    *,
    method: str | None = None,
    options: IntegrationOptions | None = None,
    on_progress: Callable[[float], None] | None = None,
    warning: bool = True,
) -> TrackingRun:
    """Drive the flexible mechanism with the torques of a mode.

    Parameters
    ----------
    task : TrackingTask
    mode : str or ActuationMode
        Its name, signs ("+-+-") or motor names ("tau1,tau5").
    method : str, optional
        Of integration: that of the options by default; see `paraflex.METHODS`.
    options : IntegrationOptions, optional
    on_progress : callable, optional
        Told the time reached [s].
    warning : bool
        Whether a run beyond what its model can describe issues a `ValidityWarning`; its `validity` says so either way.

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
    options = choose(method, options)
    title = options.description.title
    torques = task.torques(mode)
    condition = actuation_condition(task.effort, torques.mode)
    times = task.motion.t
    signals, knots = pack_signals(task.mechanism, torques.signals, float(times[-1]))
    stops = np.sort(np.concatenate([torques.knots, knots]))
    try:
        solution = integrate(
            task.system, signals, task.start, times, knots=stops, options=options, on_progress=on_progress
        )
    except IntegrationError as error:
        error.partial = TrackingRun(task, torques, condition, error.partial, title)
        raise
    run = TrackingRun(task, torques, condition, solution, title)
    if warning:
        warn(run.validity, f"mode {torques.mode.name}: ")
    return run


def _in_place(system: System) -> dict[str, tuple[str, float]]:
    return {body.name: (body.name, 0.0) for body in system.bodies}


def _start(system: System, motion: RigidMotion, carriers: Mapping[str, tuple[str, float]]) -> State:
    """Bodies where the planned motion has them at its start; each at its distance along its carrier."""
    q, v = np.zeros(system.n), np.zeros(system.n)
    for body in system.bodies:
        name, along = carriers[body.name]
        rigid = motion.system.body(name)
        x, y, phi = motion.q[0, rigid.all]
        vx, vy, w = motion.v[0, rigid.all]
        c, s = along * np.cos(phi), along * np.sin(phi)
        q[body.offset : body.offset + 3] = x + c, y + s, phi
        v[body.offset : body.offset + 3] = vx - w * s, vy + w * c, w
    return State(float(motion.t[0]), q, v)


def path_knots(path: Path, end: float) -> NDArray[np.float64]:
    """Times of a run to an end between which the motion along a path is smooth, both ends among them [s]."""
    knots = np.unique(np.concatenate([[0.0, end], [knot for knot in path.knots if 0.0 < knot < end]]))
    return knots[np.concatenate([[True], np.diff(knots) > _SAME_TIME * end])]
