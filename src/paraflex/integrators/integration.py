"""Integration of a system by any method in slices of steps, with checks of events, interrupts and limits in between."""

import copy
import time
from collections.abc import Callable, Iterator
from dataclasses import fields, replace
from typing import Any, NamedTuple

import numpy as np

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array, brief
from paraflex.dynamics import State, System, dependence, steep_times
from paraflex.dynamics.change_points import dependent_drives
from paraflex.dynamics.load_values import law_lost
from paraflex.dynamics.system import DENSE_ROWS
from paraflex.errors import ConstraintDriftError, IntegrationError, Moment, SingularPositionError, SliderOffBeamError
from paraflex.findings import Finding
from paraflex.kernel.packed import Signals
from paraflex.kernel.run_state import ERROR_TEST, FINISHED, LAW_FAILED, NO_CONVERGENCE, NOT_FINITE, PAUSED
from paraflex.kernel.sampled import SampledLaw, no_law
from paraflex.mechanism import AtEnd
from .beam_ends import STAY_ON_BEAM, BeamEnds
from .between import samples_too_few, with_between
from .crossing import Crossing, advance, samples_until
from .event_functions import event_functions
from .events import BeamEnd
from .external_run import prepare as prepare_outside
from .limits import elements_too_few
from .method import Family, NativeMethod
from .native import own, prepare as prepare_native
from .options import IntegrationOptions, loose_tolerance, refuse_tolerance
from .pace import Pace, too_slow
from .run import Problem, Run, make_problem
from .solution import LateFindings, Solution
from .watch import Breakdown, excessive_bending, least_norm, open_constraint

# Attempted steps between two checks: some milliseconds for a dozen bodies.
_SLICE = 200
# Window of attempts for the pace: for own methods, and for external solvers, whose steps take ten times as long.
_WINDOW, _WINDOW_OUTSIDE = 50_000, 20_000
# Rows that are this close to dependence when a run breaks down are reported as the cause.
_NEARLY_DEPENDENT = 1e-4
# The same at a drive's limit of reach.
_NEAR = 2e-3
_PASSING_METHODS = "choose an ESDIRK method, say tr-bdf2 or esdirk4, which pass most singular positions"
_AROUND = "start or drive the mechanism so that it does not get there"
_WITHIN_REACH = "prescribe motions that end, or turn back, before it"
_FINITE_LAW = "write a law that has one wherever the mechanism moves, say with max(0, ...) under a root"
_SHORTER = "take a shorter step, or leave it out and choose a tolerance"
_NOT_IN_PARTS = Breakdown("Newton's iteration does not converge in a fixed step, nor in parts of it,", _SHORTER)
_UNITS_REMEDY = "look for masses, stiffnesses, loads and profiles in a wrong unit"
# Causes and remedies by the code with which the kernel ends a run.
CAUSES = {
    NO_CONVERGENCE: Breakdown(
        "Newton's iteration does not converge, however small the step,",
        f"{_UNITS_REMEDY}, or choose another method or a coarser tolerance",
    ),
    NOT_FINITE: Breakdown(
        "positions, velocities or accelerations are no longer finite numbers",
        f"{_UNITS_REMEDY}, or choose a smaller tolerance or a shorter step",
    ),
    ERROR_TEST: Breakdown(
        "the error test asks for steps below the smallest one",
        f"{_UNITS_REMEDY}, for loads and profiles that jump, or choose a coarser tolerance",
    ),
}


@checked_arguments()
def integrate(
    system: System,
    signals: Signals,
    initial: State,
    times: Array,
    *,
    knots: Array | None = None,
    options: IntegrationOptions | None = None,
    begun: Solution | None = None,
    samples: int | None = None,
    on_progress: Callable[[float], None] | None = None,
) -> Solution:
    """Integrate a system from an initial state.

    Parameters
    ----------
    system : System
        System to integrate.
    signals : Signals
        Motor torques, loads and prescribed motions as functions of time.
    initial : State
        Initial state, consistent with the constraints: see `dynamics.consistent_state`.
    times : (k,) array
        Sample times [s], ascending, the first not before the start; the last ends the run.
    knots : array, optional
        Times at which the signals are not smooth [s]; steps end there. None for none.
    options : IntegrationOptions, optional
        Method, tolerance and further options; the default options by default.
    begun : Solution, optional
        Part of the run that this one continues: its steps count towards the limit of the options, and in error
        messages.
    samples : int, optional
        Number of samples of the whole run, if a finding is to report that the largest loads lie between them (own
        methods). By default this is not checked.
    on_progress : callable, optional
        Function called with the current time [s] every few milliseconds. A KeyboardInterrupt, in it or elsewhere, ends
        the run with the solution so far, marked "interrupted".

    Returns
    -------
    Solution
        Solution at the sample times. If an event ends the run, its last sample is the state at the event.

    Raises
    ------
    IntegrationError
        The run cannot go on; the error carries the partial solution.
    SliderOffBeamError
        A point that slides along a beam reached its end: see `SlidingJoint.at_end`. The partial solution ends there.
    ConstraintDriftError
        Constraints are violated by more than errors of integration explain; the error carries the partial solution as
        well.
    SingularPositionError
        The run cannot pass a singular position: the mechanism is driven beyond its reach there, or its method is one of
        the Newmark family.
    InputError
        A tolerance exceeds the size of the mechanism; times do not ascend from the start; the mechanism cannot have the
        events; or the start is beyond an event's limit, or off the end of a beam.
    """
    integration = Integration(
        system, signals, initial, times, knots=knots, options=options, begun=begun, samples=samples
    )
    try:
        integration.start()
        integration.march(on_progress=on_progress)
    except KeyboardInterrupt:
        integration.interrupt()
    return integration.solution()


class IntegrationState(NamedTuple):
    """State of an integration: the arrays of its run, and further attributes."""

    arrays: tuple[np.ndarray, ...]
    more: dict[str, Any]
    __repr__ = brief


# Attributes of an integration that are saved beside the arrays of its run.
_KEPT = ("status", "message", "_code", "_drifts", "_broken", "_crossing", "_functions", "_looked")


class Integration:
    """Integration in progress, advanced to one time after another: see `integrate` for its arguments.

    Attributes
    ----------
    run : Run
        Run of the stepper.
    status, message : str
        Status and message so far, see `Solution`.
    """

    def __init__(
        self,
        system: System,
        signals: Signals,
        initial: State,
        times: Array,
        *,
        knots: Array | None = None,
        options: IntegrationOptions | None = None,
        begun: Solution | None = None,
        samples: int | None = None,
    ) -> None:
        self._began, self._begun, self._samples = time.perf_counter(), begun, samples
        options = (options or IntegrationOptions()).for_system(system)
        self._system, self._options, self._tolerance = system, options, options.tolerance_for(system)
        refuse_tolerance(self._tolerance, system.size)
        self._loose = loose_tolerance(self._tolerance, system.size)
        own = isinstance(options.method, NativeMethod)
        problem = make_problem(system, signals, initial, times, knots)
        self._between = with_between(problem.times, system.n, problem.limits) if samples and own else None
        if self._between is not None:
            problem = replace(problem, times=self._between.times, stored=self._between.stored)
        self._ends = BeamEnds(system, initial)
        self._crossing: Crossing | None = None
        self._functions = (*event_functions(system, initial.q, options.events), *self._ends.functions)
        self.run: Run = prepare(problem, options)
        self.status: str = "complete"
        self.message: str = ""
        self._code, self._drifts = FINISHED, False
        self._broken: Breakdown | None = None
        self._looked = 0
        window = _WINDOW if own else _WINDOW_OUTSIDE
        self._pace = Pace(initial.time, float(problem.times[-1]), options.max_steps, window)
        self._most = self._pace.most - (0 if begun is None else begun.steps + begun.rejected)

    @property
    def time(self) -> float:
        """Current time [s]."""
        return self.run.time

    def start(self) -> None:
        """Compute the initial accelerations and multipliers, and take the first sample."""
        self.run.start()

    def resume(self) -> None:
        """Let the next step compute accelerations and multipliers again, as an input changes at the current time."""
        own(self.run).resume()

    def under(self, law: SampledLaw | None) -> None:
        """Set a sampled controller, which acts from now on in the time loop of own methods; None for no controller."""
        run = own(self.run)
        self.run = replace(run, law=no_law() if law is None else law)

    def march(self, until: float | None = None, *, on_progress: Callable[[float], None] | None = None) -> None:
        """Advance to a time [s], at which a step ends, or to the end of the run.

        It stops earlier at an event, or if the run cannot go on. Only own methods advance to a time before the end.
        """
        run = self.run if until is None else own(self.run).until(until)
        self._code = PAUSED
        if self.status == "interrupted":
            self.status, self.message = "complete", ""
        while self._code == PAUSED and run.attempts < self._most:
            self._code, crossing = advance(run, self._functions, min(_SLICE, self._most - run.attempts))
            if self._code == LAW_FAILED:
                # The owner of the controller reports its failure; the run itself could go on.
                self._code = FINISHED
                return
            if crossing is not None:
                self._functions, crossing = self._ends.after_crossing(crossing, self._functions)
            if crossing is not None:
                self.status, self.message, self._crossing = "stopped", crossing.message, crossing
                return
            if self._breaks():
                return
            if on_progress is not None:
                on_progress(run.time)

    def interrupt(self) -> None:
        """Mark the run as interrupted by the user; the solution so far is kept."""
        self.status, self.message = "interrupted", f"interrupted at t = {self.time:.6g} s"

    def saved(self) -> IntegrationState:
        """Return the complete state of the integration, exact to the last bit; for own methods only."""
        more = {name: getattr(self, name) for name in _KEPT}
        arrays = tuple(one.copy() for one in own(self.run).arrays())
        return IntegrationState(arrays, more | {"_ends": copy.copy(self._ends), "_pace": copy.deepcopy(self._pace)})

    def restore(self, kept: IntegrationState) -> None:
        """Restore a state from `saved`, of this integration or of one made with the same arguments."""
        # Copy into the existing arrays: their position in memory must not change, as rounding may depend on it.
        for mine, array in zip(own(self.run).arrays(), kept.arrays, strict=True):
            mine[...] = array
        for name, value in kept.more.items():
            setattr(self, name, value)
        self._ends, self._pace = copy.copy(self._ends), copy.deepcopy(self._pace)

    @property
    def can_continue(self) -> bool:
        """Whether the run has reached the time that it was advanced to, and can go on."""
        return self.status == "complete" and self._code == FINISHED and self._broken is None

    def solution(self) -> Solution:
        """Return the solution so far.

        Raises
        ------
        IntegrationError
            The run cannot go on: see `integrate`.
        """
        run, system, options = self.run, self._system, self._options
        elapsed = time.perf_counter() - self._began
        whole = _solution(run, options, elapsed, self.status, self.message, self._crossing)
        solution = whole if self._between is None else self._between.kept(whole)
        known = (*self._ends.findings(solution.q), *filter(None, [self._loose]))
        mesh, samples, kept = elements_too_few(system, run.problem.limits), self._samples, solution
        known += tuple(_excited_beyond_shapes(run))

        def findings() -> Iterator[Finding]:
            # Loads between samples take as long to compute as a tenth of a run, and studies of many runs rarely ask.
            few = samples_too_few(system, whole, kept, samples) if samples else None
            yield from (*known, *filter(None, [few]), *mesh)

        solution = replace(solution, findings=LateFindings(findings))
        end = None if self._crossing is None else self._crossing.function.event
        if self._crossing is not None and isinstance(end, BeamEnd) and end.at_end is AtEnd.ERROR:
            moment = Moment(self._crossing.t, solution.steps)
            raise _failed(SliderOffBeamError(self._crossing.reached, moment, solution, STAY_ON_BEAM))
        if self.can_continue or self.status in ("interrupted", "stopped"):
            return solution
        raise _failed(self._error(solution))

    def _breaks(self) -> bool:
        """Return whether the run has broken down, or is too slow."""
        run, options, problem = self.run, self._options, self.run.problem
        # A run advanced in short intervals is checked no more often than one advanced at once.
        if self._code == FINISHED and run.attempts < self._looked + _SLICE and run.time < problem.times[-1]:
            return False
        now = run.now()
        self._looked = run.attempts
        largest = run.figures().constraint_position_max
        limits = (run.dependent_rows, self._tolerance, options.treatment, largest)
        bent = excessive_bending(self._system, now.q)
        drift = open_constraint(self._system, problem.signals, now.t, now.q, *limits)
        self._broken, self._drifts = bent or drift, drift is not None and bent is None
        if self._broken is None and self._code == PAUSED and self._pace.look(run.attempts, now.t):
            self._broken = too_slow(self._system, now, problem.initial.q, self._pace, problem.jumps)
            return True
        return self._broken is not None

    def _error(self, solution: Solution) -> IntegrationError:
        """Return the error for a run that cannot go on."""
        run, system, options, code = self.run, self._system, self._options, self._code
        cause, remedy = self._broken or _breakdown(code, options, self._pace.most)
        now = run.now()
        # Near a singular position either Newton's iteration or the error test may fail first.
        stopped = code != PAUSED and self._broken is None
        lost, near = (dependence(system, now.q, part) for part in (_NEARLY_DEPENDENT, _NEAR))
        drives = (
            "" if self._drifts or near.dropped.size <= run.dependent_rows else dependent_drives(system, now.q, near)
        )
        error = ConstraintDriftError if self._drifts else IntegrationError
        if drives:
            error, cause = SingularPositionError, f"the constraints lose rank at the limit of reach, {drives},"
            remedy = _WITHIN_REACH
        elif stopped and lost.dropped.size > run.dependent_rows:
            rows = ", ".join(sorted(system.rows[k] for k in lost.dropped))
            error, cause = SingularPositionError, f"the constraints lose rank, a singular position ({rows}),"
            remedy = _AROUND if options.method.family is Family.ESDIRK else _PASSING_METHODS
        elif run.singular_ahead is not None and code in (NO_CONVERGENCE, ERROR_TEST):
            error, remedy = SingularPositionError, _PASSING_METHODS
            cause = (
                f"a singular position lies ahead, at about t = {run.singular_ahead:.4g} s, which {options.method.name} "
                "on index-3 equations cannot be relied on to pass; stopped"
            )
        elif stopped and (law := law_lost(system, now.t, now.q, now.v, run.problem.times[-1])):
            cause, remedy = f"{law} has no finite value beyond this state,", _FINITE_LAW
        moment = Moment(now.t, solution.steps + (0 if self._begun is None else self._begun.steps))
        return error(cause, moment, solution, remedy)


def _excited_beyond_shapes(run: Run) -> Iterator[Finding]:
    """Yield a finding if inputs jumped in a run, which also excites the shapes that reduced bodies lack."""
    mechanism = run.problem.system.mechanism
    if not mechanism.bases:
        return
    jumps = np.sort([*run.problem.jumps[run.problem.jumps < run.time], *steep_times(mechanism, run.time)])
    if jumps.size:
        yield Finding(
            "reduced-jumps",
            "study.reduced",
            f"torques, loads or prescribed motions jump or rise steeply, first at t = {jumps[0]:.4g} s: of the "
            "vibrations that follow, the shapes kept hold those that move the end-effector, and joint forces and "
            "stresses need more",
            "keep all flexible coordinates for these, or let jumps rise over some milliseconds",
        )


def _failed(error: IntegrationError) -> IntegrationError:
    """Return the error with its partial solution, whose message is set to that of the error."""
    error.partial = replace(error.partial, status="failed", message=str(error))
    return error


def prepare(problem: Problem, options: IntegrationOptions) -> Run:
    """Prepare a run of a problem by the method of the options, without starting it."""
    prepare_run = prepare_native if isinstance(options.method, NativeMethod) else prepare_outside
    return prepare_run(problem, options)


def _breakdown(code: int, options: IntegrationOptions, most: int) -> Breakdown:
    """Return cause and remedy for a run that ended with an error code of the kernel, or with too many steps."""
    if code == PAUSED:
        remedy = "allow more steps (max_steps), or choose a coarser tolerance or a shorter duration"
        return Breakdown(f"the run has not ended after {most} steps,", remedy)
    return _NOT_IN_PARTS if code == NO_CONVERGENCE and options.step is not None else CAUSES[code]


def _singular_start(run: Run, times: Array, q: Array) -> Array:
    """Return the start as a passage (2, 1) if more rows are dependent there than at the next sample, else (2, 0)."""
    initial, system = run.problem.initial.time, run.problem.system
    if run.dependent_at_start and times.size > 1 and times[0] == initial and system.m <= DENSE_ROWS:
        permanent = dependence(system, q[1]).dropped.size
        return np.full((2, int(permanent < run.dependent_at_start)), initial)
    return np.zeros((2, 0))


def _solution(
    run: Run, options: IntegrationOptions, wall_time: float, status: str, message: str, crossing: Crossing | None
) -> Solution:
    samples = run.samples if crossing is None else samples_until(run, crossing)
    figures, system = run.figures(), run.problem.system
    reached = slice(0, run.reached if crossing is None else samples.times.size)
    multipliers = least_norm(system, samples.q[reached], samples.lam[reached], run.dependent_rows)
    passages = np.hstack([_singular_start(run, samples.times[reached], samples.q[reached]), figures.passages])
    for first, last in passages.T:
        multipliers[(samples.times[reached] >= first) & (samples.times[reached] <= last)] = np.nan
    return Solution(
        t=samples.times[reached],
        q=samples.q[reached],
        v=samples.v[reached],
        a=samples.a[reached],
        multipliers=multipliers,
        kinetic_energy=samples.energy[reached, 0],
        strain_energy=samples.energy[reached, 1],
        work=samples.energy[reached, 2],
        status=status,
        message=message,
        wall_time=wall_time,
        singular_positions=tuple(passages.mean(axis=0).tolist()),
        method=options.method.name,
        **{one.name: getattr(figures, one.name) for one in fields(figures) if one.name != "passages"},
        event="" if crossing is None else str(crossing.function.event),
        options=options,
    )
