"""Runs of a mechanism without a path, under loads, prescribed motions and given motor torques."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np

from .actuation import Electrical, electrical, electrical_findings
from .arguments import checked_arguments, named_in_errors
from .arrays import Array
from .display import Played
from .dynamics import (
    JointMotion,
    State,
    System,
    balanced_state,
    consistent_state,
    constant_signals,
    dependence,
    pack_signals,
    profile_signal,
    standing_system,
    start_state,
)
from .errors import AssemblyError, InputError, IntegrationError, ResultWarning
from .findings import Finding, warn_of
from .integrators import IntegrationOptions, Method, Solution, check_times, choose, integrate
from .kernel.packed import Signals
from .mechanism import Mechanism, Start, TimeProfile
from .mechanism.actuation_modes import check_torques, mode_of_motors
from .mechanism.loads import InTime, value_in_time
from .mechanism.quantities import known
from .paths import ModelWithPaths
from .validity import Validity, assess, implausible_results, large_rotations, warn, with_likely_cause

# Remedy for a balanced start that is not found.
UNBALANCED = "make links and springs stiff enough for weight and loads, or leave it out"
# Errors of a free motion are estimated by a run with the tolerance multiplied by the first number, which multiplies
# them by at most as much. They are reported above the second number, relative to the range of each coordinate in
# radians or sizes of the mechanism, where that range is clipped to between the third number and one.
_COARSER, _GROWN, _SMALL = 100.0, 1e-3, 0.01


@named_in_errors("a run without a path", "the run that simulate_motion returns")
@dataclass(frozen=True)
class MotionRun(Played):
    """Run of a mechanism without a path.

    Attributes
    ----------
    system : System
        Equations of motion of the mechanism.
    times : (k,) array
        Times at which results are kept [s]; if an event ends the run, those until then and that of the event.
    torques : mapping of str to float or TimeProfile
        Torque of each motor, constant or a function of time [N m].
    solution : Solution
        Computed motion.
    """

    system: System
    times: Array
    torques: Mapping[str, InTime]
    solution: Solution
    # Whether no other torques act, as those of controllers would.
    open_loop: ClassVar[bool] = True

    @property
    def in_time(self) -> bool:
        """Whether torques change in time."""
        return any(isinstance(profile, TimeProfile) for profile in self.torques.values())

    @property
    def applied(self) -> Array:
        """Torques (k, motors) at the times of the solution [N m]."""
        t = self.solution.t
        each = [value_in_time(torque, t) for torque in self.torques.values()]
        return np.stack(each, axis=1) if each else np.zeros((t.size, 0))

    @cached_property
    def validity(self) -> Validity | None:
        """Validity of the model in the run; None for rigid bodies."""
        return assess(self.system, self.solution)

    @cached_property
    def electrical(self) -> Electrical:
        """Currents and voltages of the motors, from the mechanism's actuators."""
        return electrical(self.system, self.system.described, self)

    @cached_property
    def findings(self) -> tuple[Finding, ...]:
        """Findings on events in the run, on implausible results and on limits of amplifiers."""
        results = implausible_results(self.system, self.solution)
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
        Mechanism; or a model, of which the mechanism, the [start], and duration and torques of the [study] are used.
    duration : float, optional
        Duration of the run [s]; that of the model's study by default.
    samples : int
        Number of sample times at which results are kept, evenly spaced, both ends included.
    torques : mapping of str to float or TimeProfile, optional
        Torques by motor [N m], constant or functions of time, which may jump; zero for the others. Those of the model's
        study by default.
    start : State, Start or str, optional
        Initial state: the name of an assembly, at rest and undeformed; a `mechanism.Start` near the first assembly (for
        others see `dynamics.start_state`); or a `dynamics.consistent_state`. The first assembly by default.
    balanced : bool
        Whether the initial pose is the equilibrium with motors held, or that of steady running as prescribed motions
        start; see `dynamics.balanced_state`.
    method : Method or str, optional
        Integration method, an object of `paraflex.methods` or a name in `paraflex.METHODS`; that of the options by
        default.
    options : IntegrationOptions, optional
        Integration options.
    on_progress : callable, optional
        Function called with the time reached [s].
    warning : bool
        Whether a doubtful run issues warnings; its `validity` and `findings` contain the findings in any case.

    Returns
    -------
    MotionRun
        Run of the mechanism.

    Warns
    -----
    ValidityWarning, ResultWarning
        The run is outside the validity of its model, or its results are implausible; `validity` and `findings` give the
        reasons.

    Raises
    ------
    InputError
        A duration or number of samples out of range, an unknown motor, a torque that does not cover the run, or neither
        an assembly nor a start; a balanced start with given coordinates, or one that is not found.
    AssemblyError
        The loops do not close.
    IntegrationError
        The run could not be finished; the error carries a MotionRun with the results so far.
    """
    given, mechanism = mechanism, Mechanism.from_source(mechanism)
    options = choose(method, options)
    names = [motor.name for motor in mechanism.motors]
    if torques is None:
        torques = dict(getattr(getattr(given, "study", None), "torques", {}))
    for name, torque in torques.items():
        known(name, names, "torques", "motor")
        if not isinstance(torque, TimeProfile) and not np.isfinite(torque):
            raise InputError("not a finite number", field=f"torques.{name}", value=torque, remedy="give it in N m")
    values = {name: torques.get(name, 0.0) for name in names}
    check_torques(mode_of_motors(mechanism, names), "a motion without a path", mechanism.motors)
    system, state, times = motion_start(given, duration, samples, start, balanced=balanced, warning=warning)
    signals, knots = _signals(system, values, float(times[-1]))
    try:
        solution = integrate(
            system, signals, state, times, knots=knots, options=options, samples=samples, on_progress=on_progress
        )
    except IntegrationError as error:
        error.partial = _run(system, times, values, with_likely_cause(error, mechanism).partial)
        raise
    run = _run(system, times, values, solution)
    if warning:
        warn(run.validity)
        warn_of(run.findings, ResultWarning)
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
    """Return system, start and times (samples,) of a run without a path: see `simulate_motion` for the arguments.

    Raises
    ------
    InputError, AssemblyError
        See `simulate_motion`.
    """
    if start is None and not isinstance(given, Mechanism):
        start = given.start
    if duration is None:
        duration = getattr(getattr(given, "study", None), "duration", None)
    if duration is None:
        raise InputError("is missing", field="duration", remedy="give it in seconds, or in the model's [study]")
    check_times(duration, samples)
    if isinstance(start, State) and balanced:
        raise InputError(
            "a given state cannot be balanced", field="balanced", value=balanced, remedy="leave one of the two out"
        )
    system = standing_system(Mechanism.from_source(given), start)
    if isinstance(start, State):
        state = start
    else:
        near, assembly = (start, None) if isinstance(start, Start) else (None, start)
        state = state_at(system, near, assembly, balanced=balanced)
    placed = isinstance(start, State) or (isinstance(start, Start) and start.places)
    if warning and not placed and system.mechanism.assemblies:
        assembly = system.mechanism.assembly(start if isinstance(start, str) else None)
        warn_of(large_rotations(system, assembly, state.q), ResultWarning)
    return system, state, np.linspace(state.time, state.time + duration, samples)


def _run(system: System, times: Array, torques: Mapping[str, InTime], solution: Solution) -> MotionRun:
    return MotionRun(system, solution.t if solution.event else times, torques, solution)


def _signals(system: System, torques: Mapping[str, InTime], end: float) -> tuple[Signals, Array]:
    """Return torques and prescribed motions as signals, and the times between which they are smooth [s]."""
    motors, own = [], []
    for name, profile in torques.items():
        if isinstance(profile, TimeProfile):
            signal, inner = profile_signal(f"torques.{name}", profile, end)
            own += inner
        else:
            (signal,) = constant_signals([float(profile)], end)
        motors.append(signal)
    signals, knots = pack_signals(system.mechanism, motors, end)
    return signals, np.array([*own, *knots])


def _grown_errors(run: MotionRun) -> Iterator[Finding]:
    """Yield a finding if small errors grow in a free motion of rigid bodies, as a run with a larger tolerance shows."""
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
        # Other limits on the steps may have left them almost unchanged; near singular positions the full ratio is kept.
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
        yield Finding("errors-grow", "", "interrupted before the growth of errors was checked", "run it again")


def state_at(system: System, start: Start | None, assembly: str | None, *, balanced: bool) -> State:
    """Return the initial state for a start near an assembly, the first by default.

    Without a start the mechanism is at rest, or moves with its drives.

    Raises
    ------
    InputError
        A balanced start with given coordinates, or one that is not found.
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
