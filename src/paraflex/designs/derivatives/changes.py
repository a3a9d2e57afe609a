"""Derivatives of the inputs of a run with respect to one parameter: system, planned motion, torques, times."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from paraflex.actuation import Effort, FeedForward, required_effort
from paraflex.actuation.allocation import add_springs_and_dampers, motor_rows
from paraflex.actuation.feed_forward import splines
from paraflex.arguments import with_fields
from paraflex.arrays import Array, Numbers
from paraflex.control.shaping.shaped import ShapedPath
from paraflex.designs.run import Task
from paraflex.designs.setting import Setting
from paraflex.dynamics import (
    System,
    acting_loads,
    build_system,
    numbers_of,
    pack_signals,
    same_layout,
    still_signals,
    with_numbers,
)
from paraflex.errors import InputError, ParaflexError
from paraflex.integrators.run import make_problem
from paraflex.integrators.sensitivity import Direction
from paraflex.kernel.arrays import apart
from paraflex.kernel.bodies import motion_forces
from paraflex.kernel.packed import Signals, make_scratch
from paraflex.mechanism import ActuationMode, FlexibleBeam, Mechanism, RigidBody, with_actuators
from paraflex.paths import Circle, PathMotion, Polygon, RigidMotion
from paraflex.paths.closure import PathClosure
from paraflex.paths.loops import with_marker
from paraflex.paths.paths import KnownPath
from paraflex.paths.sensitivity import DisplacedClosure, MotionChange, motion_sensitivity
from paraflex.tracking import TrackingTask, path_knots
from .plans import RunInputs
from .stencil import STENCILS, Difference, Stencil
from .steps import Stepped, another_layout, complex_step, part, stepped


class DescribedInputs(NamedTuple):
    """Inputs of a design's runs as its file describes them, which determine all other numbers.

    They are the mechanism, the path, the end of the run [s], the orientation of the end-effector and Baumgarte's
    coefficients alpha and beta [1/s].
    """

    mechanism: Mechanism
    path: Any
    end: float
    orientation: float
    gains: tuple[float, float]


@dataclass(frozen=True)
class ModeChange:
    """Derivatives of the inputs of the run of one mode.

    Attributes
    ----------
    direction : Direction
        Derivatives of the numbers that determine the run.
    task : TrackingTask
        Task with a complex step in the parts that metrics use; the packed system is that of the design.
    torques : FeedForward
        Feed-forward torques with a complex step.
    condition : (k,) array
        Condition number of the actuation matrix with a complex step.
    error : float
        Largest relative error of a derivative by differences.
    """

    direction: Direction
    task: TrackingTask
    torques: FeedForward
    condition: Numbers
    error: float


def refuse_frames(mechanism: Mechanism) -> None:
    """Raise an InputError for beams in several frames, for whose parts derivatives are not implemented."""
    for body in mechanism.bodies:
        if isinstance(body, FlexibleBeam) and body.flexible and body.frames > 1:
            raise InputError(
                "a beam in several frames has no derivatives yet", field=f"body.{body.name}.frames", value=body.frames,
                remedy="give it one frame and more elements, or take differences by a sweep",
            )  # fmt: skip


class Change:
    """Derivatives of a design with respect to one parameter, relative to its size.

    Parameters
    ----------
    setting, task
        Common settings of the study, and design and path; see `designs.run.run_task`.
    planned : TrackingTask
        Planned motion of the design.
    k : int
        Index of the parameter.
    size : float
        Size of the parameter: see `plans.size_of`.

    Raises
    ------
    InputError
        The design is not differentiable by the parameter.
    """

    stencil: Stencil
    near: list[DescribedInputs]

    def __init__(self, setting: Setting, task: Task, planned: TrackingTask, k: int, size: float) -> None:
        self.name: str = setting.names[k]
        self.size = size
        self.planned = planned
        refuse_frames(planned.mechanism)
        here = _described(setting, task, planned.mechanism)
        self.stencil, self.near = self._near(setting, task, k)
        try:
            self.stepped: Stepped[DescribedInputs] = complex_step(here, self.near, self.stencil)
            self.there: DescribedInputs = self.stepped.value
            self.system: System = build_system(self.there.mechanism, planned.system)
            if not all(same_layout(each.packed, planned.system.packed) for each in self.beside):
                raise another_layout()
        except InputError as error:
            raise error.at(f"vary.{self.name}") from None
        self.closure: PathClosure = PathClosure(planned.mechanism.rigid(), here.orientation, here.end)
        self.end: float = here.end

    def _near(self, setting: Setting, task: Task, k: int) -> tuple[Stencil, list[DescribedInputs]]:
        """Return a stencil and the designs at its points: on both sides, or on one side if the other is invalid."""
        failure: ParaflexError | None = None
        for stencil in STENCILS:
            try:
                near = [_described(setting, _moved(task, k, place * self.size)) for place in stencil.places]
                # Building the systems raises errors for invalid meshes.
                ends, like = (near[0], near[-1]), self.planned.system
                self.beside: list[System] = [build_system(each.mechanism, like) for each in ends]
                return stencil, near
            except ParaflexError as error:
                failure = failure or error
        raise InputError(
            f"has no derivative: a nearby value fails, {failure}", field=f"vary.{self.name}", value=task.values[k],
            remedy="vary with it what has to change too, such as the point at a beam's end, or leave it out",
        )  # fmt: skip

    @cached_property
    def packed(self) -> Array:
        """Derivatives of the numbers of the packed system."""
        return part(numbers_of(self.system.packed))

    @cached_property
    def rigid(self) -> System:
        """Rigid system of the planned motion, with a complex step."""
        bodies = tuple(
            body if isinstance(body, RigidBody) else with_fields(body, flexible=False)
            for body in self.there.mechanism.bodies
        )
        mechanism = with_actuators(with_fields(self.there.mechanism, bodies=bodies))
        return build_system(with_fields(mechanism, springs=(), dampers=(), frictions=()), self.closure.system)

    @cached_property
    def sampled(self) -> "_Planned":
        """Planned motion at the sample times."""
        t = self.planned.motion.t
        return self.plan(self.planned.motion, self.planned.effort, t * (part(self.there.end) / self.end))

    @cached_property
    def knots(self) -> Numbers:
        """Knots of the path, with a complex step."""
        profiles = [profile for load in self.planned.mechanism.loads for profile in load.profiles]
        if any(profile.knots for profile in profiles):
            raise InputError(
                "loads whose profile has pieces or a linear table: no derivative of the torques that a path takes",
                field="load",
                remedy='give their profiles as one expression or a table of interpolation = "spline"',
            )
        knots = path_knots(self.there.path, self.there.end)
        if knots.size != self.planned.plan.knots.size:
            raise another_layout(f"vary.{self.name}")
        return knots

    def plan(self, motion: RigidMotion, effort: Effort, d_times: Array) -> "_Planned":
        """Return a planned motion and its derivatives, at times with the derivatives `d_times`."""
        path = self.known_path(stepped(motion.t, d_times))
        change = motion_sensitivity(self.closure, motion, self._nearby(motion, d_times, path))
        return _Planned(self, motion, effort, path, stepped(motion.t, d_times), change)

    def known_path(self, times: Numbers) -> KnownPath:
        """Return the path at times with a complex step."""
        path, here = self.there.path, self.planned.path
        duration = self.planned.path.duration
        turning = getattr(here, "turning", None)
        if isinstance(here.path if isinstance(here, ShapedPath) else here, Polygon | Circle):
            return KnownPath(path.evaluate(times), None, duration)
        t, d_times = np.real(times), part(times)
        moved = [(near.path, t + place * d_times) for near, place in zip(self.near, self.stencil.places, strict=True)]
        motions = [np.stack(near.evaluate(at)) for near, at in moved]
        whole = stepped(np.stack(here.evaluate(t)), self.stencil.derivative(motions).value)
        angles = None if turning is None else turning(t)
        if angles is not None:
            angles = stepped(angles, self.stencil.derivative([near.turning(at) for near, at in moved]).value)
        return KnownPath(PathMotion(*whole), angles, duration)

    def _nearby(self, motion: RigidMotion, d_times: Array, path: KnownPath) -> list[DisplacedClosure]:
        closure, stencil = self.closure, self.stencil
        effector = closure.mechanism.end_effector
        assert effector is not None
        packed, _ = with_marker(self.rigid, effector.point)
        numbers, change = numbers_of(closure.packed), part(numbers_of(packed))
        # The closure has the orientation of the design itself; the derivative of the orientation is added below.
        orientation = self.there.orientation
        target = closure.target(path, motion.t)
        if path.angles is None and "angle" in effector.coordinates:
            target = target + 1j * np.imag(orientation) * np.eye(3)[0][:, None] * (closure.coordinates == 2)
        return [
            DisplacedClosure(
                place, weight, with_numbers(closure.packed, numbers + place * change), self._prescribed_signals(near),
                motion.t + place * d_times, target.real + place * part(target),
            )
            for place, weight, near in zip(stencil.places, stencil.weights, self.near, strict=True)
        ]  # fmt: skip

    def _prescribed_signals(self, near: DescribedInputs) -> Any:
        mechanism = near.mechanism
        if not mechanism.prescribed:
            return self.closure.signals
        return still_signals(mechanism, near.end)[0]

    def of_mode(self, nominal: RunInputs) -> ModeChange:
        """Return the derivatives of the inputs of the run of a mode."""
        torques = self._torques(nominal.torques)
        signals, stops = self._signals(nominal, torques)
        sampled, problem = self.sampled, nominal.problem
        start = self._start(sampled.change)
        gains = part(np.array(self.there.gains))
        direction = Direction(
            packed=self.packed, signals=signals.value, q=start[0], v=start[1], stops=stops,
            times=part(sampled.times), gains=gains,
        )  # fmt: skip
        system = replace(self.system, packed=problem.system.packed)
        task = replace(self.planned, mechanism=self.planned.mechanism, system=system, motion=sampled.with_step())
        error = max(self.stepped.error, _relative(signals, numbers_of(problem.signals), _sizes(problem.signals)))
        condition = _condition(nominal.condition, sampled, nominal.torques)
        return ModeChange(direction, task, torques, condition, error)

    def _start(self, change: MotionChange) -> tuple[Array, Array]:
        system = self.planned.system
        q, v = np.zeros(system.n), np.zeros(system.n)
        for body in system.bodies:
            rigid = self.closure.system.body(body.name).all
            frame = slice(body.offset, body.offset + 3)
            q[frame], v[frame] = change.q[0, rigid], change.v[0, rigid]
        return q, v

    def _torques(self, nominal: FeedForward) -> FeedForward:
        """Return the torques with a complex step, at equally many instants, which move in proportion between knots."""
        d_times = np.interp(nominal.times, nominal.knots, part(self.knots))
        motion = self.planned.plan.follow(nominal.times)
        effort = required_effort(motion)
        planned = self.plan(motion, effort, d_times)
        torques, change = planned.torques(nominal.mode)
        knots, d_knots = nominal.knots, part(self.knots)
        if np.any(d_times):
            places = STENCILS[0]
            found = [
                splines(nominal.times + place * d_times, torques + place * change, knots + place * d_knots)
                for place in places.places
            ]
            changes = [places.derivative([numbers_of(one) for one in each]).value for each in zip(*found, strict=True)]
        else:
            found = splines(nominal.times, change, knots)
            changes = [numbers_of(one._replace(breaks=0.0 * one.breaks)) for one in found]
        signals = tuple(
            with_numbers(one, stepped(numbers_of(one), each))
            for one, each in zip(nominal.signals, changes, strict=True)
        )
        return replace(nominal, signals=signals, knots=stepped(knots, d_knots), times=stepped(nominal.times, d_times))

    def _signals(self, nominal: RunInputs, torques: FeedForward) -> tuple[Difference, Array]:
        """Return the derivatives of the signals and of the stops."""
        problem, found, stops = nominal.problem, [], []
        d_knots, d_times = part(torques.knots), part(self.sampled.times)
        for place, near in zip(self.stencil.places, self.near, strict=True):
            moved = [
                with_numbers(one, np.real(numbers) + place * part(numbers))
                for one, numbers in zip(nominal.torques.signals, map(numbers_of, torques.signals), strict=True)
            ]
            signals, knots = pack_signals(near.mechanism, moved, near.end)
            times = problem.times + place * d_times
            inner = np.sort(np.concatenate([torques.knots.real + place * d_knots, knots]))
            at = make_problem(problem.system, signals, problem.initial, times, inner).stops
            if at.size != problem.stops.size or not same_layout(signals, problem.signals):
                raise another_layout(f"vary.{self.name}")
            found.append(numbers_of(signals))
            stops.append(at)
        return self.stencil.derivative(found), self.stencil.derivative(stops).value


@dataclass(frozen=True)
class _Planned:
    """Planned motion and its derivatives, at instants `times` with a complex step."""

    owner: Change
    motion: RigidMotion
    effort: Effort
    path: KnownPath
    times: Numbers
    change: MotionChange

    def with_step(self) -> RigidMotion:
        """Return the motion with a complex step; end-effector coordinates outside the task are desired as they are."""
        changes = {name: stepped(getattr(self.motion, name), getattr(self.change, name)) for name in ("q", "v", "a")}
        return replace(self.motion, system=self.owner.rigid, path=self.path, t=self.times, **changes)

    @cached_property
    def d_effort(self) -> tuple[Array, Array]:
        """Derivatives of the required effort (k, tasks) and of the actuation matrix (k, tasks, motors)."""
        motion, change = self.motion, self.change
        q, v, basis = (stepped(getattr(motion, name), getattr(change, name)) for name in ("q", "v", "basis"))
        moved = replace(motion, mechanism=self.owner.there.mechanism, system=self.owner.rigid, q=q, v=v, basis=basis)
        forces = self._forces()
        add_springs_and_dampers(moved, forces)
        transposed = np.swapaxes(basis, 1, 2)
        required = np.einsum("kij,kj->ki", transposed, forces)
        return part(required), part(transposed @ motor_rows(moved))

    def _forces(self) -> Numbers:
        """Return the forces of inertia, weight and loads with a complex step."""
        motion, change, here = self.motion, self.change, self.motion.system.packed
        numbers, d_numbers = numbers_of(here), part(numbers_of(self.owner.rigid.packed))
        acting, d_acting = self._loads()

        def at(place: float) -> Array:
            forces = apart(motion.q.shape)
            packed = with_numbers(here, numbers + place * d_numbers)
            moved = (x + place * dx for x, dx in zip((motion.q, motion.v, motion.a), change, strict=False))
            motion_forces(packed, *moved, acting + place * d_acting, forces, make_scratch(packed))
            return forces

        stencil = STENCILS[0]
        return stepped(at(0.0), stencil.derivative([at(place) for place in stencil.places]).value)

    def _loads(self) -> tuple[Array, Array]:
        """Return time-dependent loads (k, acting) and their derivative, at instants that move with the parameter."""
        owner, t, d_times = self.owner, np.real(self.times), part(self.times)
        moved = [
            acting_loads(near.mechanism, np.maximum(t + place * d_times, 0.0))
            for near, place in zip(owner.near, owner.stencil.places, strict=True)
        ]
        return acting_loads(owner.planned.mechanism, t), owner.stencil.derivative(moved).value

    def torques(self, mode: ActuationMode) -> tuple[Array, Array]:
        """Return the minimum-norm torques (k, motors) and their derivative.

        With tau = B^T y and B B^T y = Q, d tau = B^+ (dQ - dB tau) + (1 - B^+ B) dB^T y.
        """
        d_required, d_matrix = self.d_effort
        active = self.effort.active(mode)
        B, dB = self.effort.matrix[:, :, active], d_matrix[:, :, active]
        inverse = np.linalg.pinv(B)
        tau = np.einsum("kij,kj->ki", inverse, self.effort.required)
        y = np.einsum("kji,kj->ki", inverse, tau)
        across = np.einsum("kji,kj->ki", dB, y)
        change = np.einsum("kij,kj->ki", inverse, d_required - np.einsum("kij,kj->ki", dB, tau))
        change += across - np.einsum("kij,kj->ki", inverse, np.einsum("kij,kj->ki", B, across))
        torques, changes = (np.zeros((len(tau), active.size)) for _ in range(2))
        torques[:, active], changes[:, active] = tau, change
        return torques, changes


def _condition(values: Array, planned: _Planned, torques: FeedForward) -> Numbers:
    """Return condition numbers of the actuation matrix with a complex step; singular values change by u^T dB v."""
    active = planned.effort.active(torques.mode)
    if not active.any():
        return values
    B, dB = planned.effort.matrix[:, :, active], planned.d_effort[1][:, :, active]
    u, singular, vt = np.linalg.svd(B, full_matrices=False)
    d_singular = np.einsum("kji,kjl,kil->ki", u, dB, vt)
    return stepped(values, (d_singular[:, 0] - values * d_singular[:, -1]) / singular[:, -1])


def _described(setting: Setting, task: Task, mechanism: Mechanism | None = None) -> DescribedInputs:
    model, options = setting.design(task.values)
    path = model.path(task.path)
    end = model.duration(path, setting.duration)
    gains = (options.alpha, options.beta)
    return DescribedInputs(mechanism or model.mechanism, path, end, model.study.orientation, gains)


def _moved(task: Task, k: int, by: float) -> Task:
    values = task.values
    return task._replace(values=(*values[:k], values[k] + by, *values[k + 1 :]))


def _sizes(signals: Signals) -> Array:
    """Return the factor of each number of signals in their values: for a coefficient a power of its piece's length."""
    # A signal has no piece after its last break, and the coefficients there are zero.
    lengths = np.abs(np.append(np.diff(signals.breaks), 0.0))
    powers = np.arange(signals.coefficients.shape[1])
    return numbers_of(signals._replace(breaks=np.ones(lengths.size), coefficients=lengths[:, None] ** powers))


def _relative(difference: Difference, numbers: Array, sizes: Array) -> float:
    """Return the largest error of differences relative to the largest number or derivative, each times its size."""
    size = max(np.max(np.abs(sizes * difference.value), initial=0.0), np.max(np.abs(sizes * numbers), initial=0.0))
    return float(np.max(sizes * difference.error, initial=0.0) / size) if size > 0.0 else 0.0
