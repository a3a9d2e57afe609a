"""A mechanism without a path, under loads, prescribed motions and given motor torques."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np

from paraflex.actuation import Electrical, electrical, electrical_findings
from paraflex.arguments import checked_arguments, given_as
from paraflex.arrays import Array
from paraflex.display import Shown
from paraflex.dynamics import (
    JointMotion,
    State,
    System,
    balanced_state,
    consistent_state,
    constant_signals,
    dependence,
    law_signal,
    pack_signals,
    standing_system,
    start_state,
)
from paraflex.errors import AssemblyError, InputError, IntegrationError, ResultWarning
from paraflex.findings import Finding, warn_of
from paraflex.integrators import IntegrationOptions, Method, Solution, check_times, choose, integrate
from paraflex.kernel.packed import Signals
from paraflex.kinematics import ModelWithPaths
from paraflex.mechanism import AngleLaw, Mechanism, Start
from paraflex.mechanism.loads import InTime
from paraflex.mechanism.quantities import known
from paraflex.validity import Validity, assess, doubtful_results, moved_far, warn, with_blame

# Remedy of a balanced start that is not found.
UNBALANCED = "make links and springs stiff enough for weight and loads, or leave it out"
# Errors of a free motion are looked for with a tolerance so many times as large, which multiplies them by as much at
# most. They are found above the second part of a radian and of the mechanism's size, or of what a coordinate moves by
# where that is less, but not less than the third part of these.
_COARSER, _GROWN, _SMALL = 100.0, 1e-3, 0.01


@given_as("a run without a path", "the run that simulate_motion returns")
@dataclass(frozen=True)
class MotionRun(Shown):
    """A run of a mechanism without a path.

    Attributes
    ----------
    system : System
    times : (k,) array
        At which results are kept [s]; where an event ends the run, those until then and its own.
    torques : mapping of str to float or AngleLaw
        Of each motor, constant or in time [N m].
    solution : Solution
    """

    system: System
    times: Array
    torques: Mapping[str, InTime]
    solution: Solution
    # Whether nothing but these acts on it.
    open_loop: ClassVar[bool] = True

    @property
    def in_time(self) -> bool:
        """Whether torques change in time."""
        return any(isinstance(law, AngleLaw) for law in self.torques.values())

    @property
    def applied(self) -> Array:
        """Torques (k, motors) at the times of the solution [N m]."""
        t = self.solution.t
        each = [
            law.evaluate(t)[0] if isinstance(law, AngleLaw) else np.full(t.size, law) for law in self.torques.values()
        ]
        return np.stack(each, axis=1) if each else np.zeros((t.size, 0))

    @cached_property
    def validity(self) -> Validity | None:
        """Validity of the model in the run; None for rigid bodies."""
        return assess(self.system, self.solution)

    @cached_property
    def electrical(self) -> Electrical:
        """Currents and voltages of the motors, by the mechanism's actuators."""
        return electrical(self.system, self.system.described, self)

    @cached_property
    def doubts(self) -> tuple[Finding, ...]:
        """Findings on events in the run, on implausible results and limits of amplifiers."""
        results = doubtful_results(self.system, self.solution)
        described = self.system.described
        amplifiers = electrical_findings(described, self.electrical) if described.actuators else ()
        grown = _grown_errors(self) if self.open_loop else ()
        return (*self.solution.findings, *grown, *results, *amplifiers)


@checked_arguments()
def simulate_motion(
    mechanism: Mechanism | ModelWithPaths,
    duration: float | None = None,
    *,
    samples: int = 701,
    torques: Mapping[str, InTime] | None = None,
    start: State | Start | str | None = None,
    balanced: bool = False,
    method: Method | str | None = None,
    options: IntegrationOptions | None = None,
    on_progress: Callable[[float], None] | None = None,
    warning: bool = True,
) -> MotionRun:
    """Integrate a mechanism without a path under its loads.

    Parameters
    ----------
    mechanism : Mechanism or Model
        A model stands for its mechanism, its [start], and the duration and torques of its [study]; nothing else is
        taken from that.
    duration : float, optional
        [s]; by default that of the model's study.
    samples : int
        Times at which results are kept, evenly spaced, both ends among them.
    torques : mapping of str to float or AngleLaw, optional
        Torque of each motor by name [N m], constant or a law in time, which may jump; zero for the others. By default
        those of the model's study.
    start : State, Start or str, optional
        Where it starts: the name of an assembly, at rest and undeformed; a `mechanism.Start` near the first assembly
        (near another, see `dynamics.start_state`); or a `dynamics.consistent_state`. The first assembly by default.
    balanced : bool
        Whether the pose is that of equilibrium, motors held, or of steady running as prescribed motions start; see
        `dynamics.balanced_state`.
    method : Method or str, optional
        Of integration: that of the options by default; an object of `paraflex.methods` or a name in `paraflex.METHODS`.
    options : IntegrationOptions, optional
    on_progress : callable, optional
        Called with the time reached [s].
    warning : bool
        Whether a run that is doubtful issues warnings; its `validity` and `doubts` hold them either way.

    Warns
    -----
    ValidityWarning, ResultWarning
        The run is beyond what its model can describe, or its results are implausible; `validity` and `doubts` say why.

    Raises
    ------
    InputError
        A duration or number of samples that makes no sense, an unknown motor, a law that does not cover the run, or
        neither an assembly nor a start; a balanced start of given coordinates, or one that is not found.
    AssemblyError
        The loops do not close.
    IntegrationError
        The run could not be finished; it carries a MotionRun with what was computed.
    """
    given, mechanism = mechanism, Mechanism.made_of(mechanism)
    options = choose(method, options)
    names = [motor.name for motor in mechanism.motors]
    if torques is None:
        torques = dict(getattr(getattr(given, "study", None), "torques", {}))
    for name, torque in torques.items():
        known(name, names, "torques", "motor")
        if not isinstance(torque, AngleLaw) and not np.isfinite(torque):
            raise InputError("not a finite number", field=f"torques.{name}", value=torque, remedy="give it in N m")
    values = {name: torques.get(name, 0.0) for name in names}
    system, state, times = motion_start(given, duration, samples, start, balanced=balanced, warning=warning)
    signals, knots = _signals(system, values, float(times[-1]))
    try:
        solution = integrate(
            system, signals, state, times, knots=knots, options=options, samples=samples, on_progress=on_progress
        )
    except IntegrationError as error:
        error.partial = _run(system, times, values, with_blame(error, mechanism).partial)
        raise
    run = _run(system, times, values, solution)
    if warning:
        warn(run.validity)
        warn_of(run.doubts, ResultWarning)
    return run


def motion_start(
    given: Mechanism | ModelWithPaths,
    duration: float | None,
    samples: int,
    start: State | Start | str | None,
    *,
    balanced: bool,
    warning: bool = True,
) -> tuple[System, State, Array]:
    """System, start and times (samples,) of a run without a path: see `simulate_motion` for the arguments.

    Raises
    ------
    InputError, AssemblyError
        See there.
    """
    if start is None and not isinstance(given, Mechanism):
        start = given.start
    if duration is None:
        duration = getattr(getattr(given, "study", None), "duration", None)
    if duration is None:
        raise InputError("is missing", field="duration", remedy="give it in seconds, or in the model's [study]")
    check_times(duration, samples)
    if isinstance(start, State) and balanced:
        raise InputError("a state is as it is", field="balanced", value=balanced, remedy="leave one of the two out")
    system = standing_system(Mechanism.made_of(given), start)
    if isinstance(start, State):
        state = start
    else:
        near, assembly = (start, None) if isinstance(start, Start) else (None, start)
        state = state_at(system, near, assembly, balanced=balanced)
    placed = isinstance(start, State) or (isinstance(start, Start) and start.places)
    if warning and not placed and system.mechanism.assemblies:
        assembly = system.mechanism.assembly(start if isinstance(start, str) else None)
        warn_of(moved_far(system, assembly, state.q), ResultWarning)
    return system, state, np.linspace(state.time, state.time + duration, samples)


def _run(system: System, times: Array, torques: Mapping[str, InTime], solution: Solution) -> MotionRun:
    return MotionRun(system, solution.t if solution.event else times, torques, solution)


def _signals(system: System, torques: Mapping[str, InTime], end: float) -> tuple[Signals, Array]:
    """Torques and prescribed motions as signals, and the times between which they are smooth [s]."""
    motors, own = [], []
    for name, law in torques.items():
        if isinstance(law, AngleLaw):
            signal, inner = law_signal(f"torques.{name}", law, end)
            own += inner
        else:
            (signal,) = constant_signals([float(law)], end)
        motors.append(signal)
    signals, knots = pack_signals(system.mechanism, motors, end)
    return signals, np.array([*own, *knots])


def _grown_errors(run: MotionRun) -> Iterator[Finding]:
    """Free motions of rigid bodies that make much of small errors: with a coarser tolerance they are elsewhere."""
    system, first, options = run.system, run.solution, run.solution.options
    if options is None or options.tolerance is None or options.step is not None or first.t.size < 2:
        return
    if system.n_flexible or dependence(system, first.q[0]).rank == system.n:
        return
    signals, knots = _signals(system, run.torques, float(first.t[-1]))
    coarse = replace(options, tolerance=min(_COARSER * options.tolerance, system.size), events=())
    start = State(float(first.t[0]), first.q[0], first.v[0])
    try:
        second = integrate(system, signals, start, first.t, knots=knots, options=coarse)
    except IntegrationError as error:
        second = error.partial
    ratio = _COARSER
    if options.controls_errors and not first.singular_positions:
        # Other limits of steps may have left them nearly as they were; near singular positions they are kept.
        saved = first.steps * second.t.size / (max(second.steps, 1) * first.t.size)
        ratio = min(ratio, saved**options.method.order)
    q = first.q[: second.t.size] / system.units
    errors = np.abs(second.q / system.units - q) / np.clip(np.ptp(q, axis=0), _SMALL, 1.0) / max(ratio - 1.0, 0.1)
    grown = np.max(errors, axis=1) > _GROWN
    if np.any(grown):
        yield Finding(
            "errors-grow", "",
            f"small errors grow in this motion, as a run with {_COARSER:g} times the tolerance shows: positions and "
            f"forces may be off at {first.instant(int(np.argmax(grown)), 4)} and later",
            "give a smaller tolerance and compare, or end the run before",
        )  # fmt: skip
    elif second.status == "interrupted":
        yield Finding("errors-grow", "", "interrupted before it was seen whether errors grow", "run it again")


def state_at(system: System, start: Start | None, assembly: str | None, *, balanced: bool) -> State:
    """The state at a start near an assembly, the first by default; without a start at rest, or moving with its drives.

    Raises
    ------
    InputError
        A balanced start of given coordinates, or one that is not found.
    AssemblyError
        The loops do not close.
    """
    mechanism = system.mechanism
    if not balanced and start is not None:
        named = assembly is not None or mechanism.assemblies
        return start_state(system, start, mechanism.assembly(assembly) if named else None)
    undeformed = mechanism.assembly(assembly)
    if not balanced:
        return consistent_state(system, undeformed)
    if start is not None and start.places:
        raise InputError(
            "the [start] gives coordinates, which a balanced start would change", field="balanced",
            remedy="leave it out, or give [start.velocity] only",
        )  # fmt: skip
    held = {motor.joint: JointMotion() for motor in mechanism.motors}
    begun = consistent_state(system, undeformed)
    try:
        found = balanced_state(system, begun, held)
    except AssemblyError as error:
        raise InputError(error.cause, field="balanced", remedy=UNBALANCED) from error
    return found if start is None else start_state(system, start, q=found.q)
