"""Runs of the compiled schemes: the kernel's time loop in slices."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Any

import numpy as np

from paraflex.arrays import Array, Indices
from paraflex.dynamics import System, inputs_of
from paraflex.dynamics.linearise import slowest_deflection
from paraflex.errors import InputError
from paraflex.kernel import indices as at
from paraflex.kernel.linear import factor_system
from paraflex.kernel.march import march, start
from paraflex.kernel.packed import Signals, Workspace
from paraflex.kernel.run_state import (
    BAUMGARTE,
    FINISHED,
    GGL,
    PAUSED,
    POSITION,
    PROJECTION,
    Controls,
    March,
    Samples,
    Tableau,
    make_march,
)
from paraflex.kernel.sampled import SampledLaw, no_law
from .method import NativeMethod, Treatment
from .newmark import NewmarkMethod
from .options import Control, IntegrationOptions, TolerancePer
from .run import DEPENDENT_PART, FIRST_STEP, Figures, Instant, Problem, Run, empty_samples
from .singular_start import BranchPose, begin_on_branch, pose_on_branch

# A row not redundant at the start is dependent, except for rounding, below this relative pivot.
ROUNDING_PART = 1e-13
# A run takes a few steps near each singular position, where shorter ones are not more accurate: together they may have
# an error of about this fraction of the tolerance.
NEAR_ERROR = 0.01
# Least error allowed there, as a part of the mechanism's size: the effect of rounding on multipliers with a pole.
LEAST_NEAR_ERROR = 8e-11
# A singular position is near if it could be reached in this fraction of the time since the start.
_NEAR_AHEAD = 0.2
# Steps are long compared with vibrations from this many radians of the slowest one of the mechanism on; all are long
# without flexible bodies. In such steps deflections follow the loads, and their accelerations and velocities at the
# stages are inaccurate. The slowest vibration depends on the mass that the beams carry.
_FOLLOWS = 20.0
# Smallest step, as a fraction of the run, and in units in the last place of the time: the latter bounds the difference
# between a step and the change of the time.
_LEAST, _DIGITS = 1e-12, 64.0
# Reported error of forces over the sum of the errors of the steps within some cycles. With unresolved vibrations the
# true errors of the library's mechanisms are 0.3 to 1.5 times the sum.
_ERROR_SAFETY = 2.0
# Largest part of a revolution, or of a vibration of the inputs, within a step [rad], by the order of the method (four
# for higher ones): errors of forces and work are then below a thousandth.
_PHASES = {1: 0.15, 2: 0.15, 3: 0.4, 4: 0.7}
# Points closer than this part of the mechanism's size coincide.
_SAME_PLACE = 1e-9
# Automatic Baumgarte coefficients, times the step size: violations decay within some tens of steps.
_BAUMGARTE_GAIN = 0.1
# Number of cycles after which errors of forces have decayed in driven and damped motions.
_FORCE_CYCLES = 3.0
_TREATMENTS = {
    Treatment.BAUMGARTE: BAUMGARTE,
    Treatment.PROJECTION: PROJECTION,
    Treatment.GGL: GGL,
}


@dataclass(frozen=True)
class NativeRun:
    """Run of the kernel's time loop with all its arrays: a `Run`."""

    problem: Problem
    scheme: Tableau
    controls: Controls
    state: March
    workspace: Workspace
    slow: Workspace
    samples: Samples
    # Workspace for first stages after a jump, so that the factor in the other workspace stays.
    aside: Workspace
    law: SampledLaw
    dependent_at_start: int
    branch: BranchPose | None
    # Time at which the run pauses.
    pause: Array = field(default_factory=lambda: np.full(1, np.inf))

    @property
    def dependent_rows(self) -> int:
        """Number of redundant constraint rows, see `Run`."""
        return self.controls.dependent_rows

    @property
    def singular_ahead(self) -> float | None:
        """Time at which an index-3 method is about to reach a singular position [s], see `Run`; None for none."""
        root, slope = self.state.clock[at.ROOT], self.state.clock[at.ROOT_RATE]
        elapsed = self.state.clock[at.TIME] - self.problem.initial.time
        if self.controls.treatment != POSITION or not slope < 0.0 or root > _NEAR_AHEAD * elapsed * -slope:
            return None
        return float(self.state.clock[at.TIME] - root / slope)

    @property
    def attempts(self) -> int:
        """Number of attempted steps, see `Run`."""
        return int(self.state.counts[at.STEPS] + self.state.counts[at.REJECTED])

    @property
    def reached(self) -> int:
        """Number of samples taken, see `Run`."""
        return int(self.state.counts[at.SAMPLE])

    def start(self) -> None:
        """Compute the initial accelerations and multipliers and take the first sample, see `Run`."""
        arguments = (self.problem.system.packed, self.problem.signals, self.controls)
        start(*arguments, self.state, self.workspace, self.samples)
        if self.branch is not None:
            begin_on_branch(self.problem, self.branch, self.state, self.slow)
            self.samples.a[: self.reached] = self.state.stage_a[1, 0]

    def march(self, attempts: int) -> int:
        """Attempt a number of steps and return a code, see `Run`."""
        jumps, now = self.problem.jumps, self.state.clock[at.TIME]
        stops, pause = self.problem.stops, self.pause[0]
        if pause < stops[-1]:
            stops = np.append(stops[: np.searchsorted(stops, pause)], pause)
        if not jumps.size:
            return self._time_loop(*self._arguments(self.problem.signals, stops, attempts))
        # The last call may have ended at a jump, with the values before it.
        if np.any(jumps == now):
            self.resume()
            # Steps grow again as from the start: the error estimate of a long step does not contain the effect of a
            # jump.
            self.state.clock[at.STEP] = min(self.state.clock[at.STEP], FIRST_STEP * self.problem.span)
        ahead = jumps[(jumps > now) & (jumps < stops[-1])]
        if ahead.size:
            stops = stops[stops <= ahead[0]]
        code = march(*self._arguments(self.problem.signals_from(now), stops, attempts))
        return PAUSED if code == FINISHED and ahead.size else code

    def _arguments(self, signals: Signals, stops: Array, attempts: int) -> tuple[Any, ...]:
        given = (self.problem.system.packed, signals, self.scheme, self.controls, stops, attempts)
        return (*given, self.state, self.workspace, self.slow, self.samples, self.law, self.aside)

    @cached_property
    def _time_loop(self) -> Callable[..., int]:
        """Machine code for the types of this run's data: Numba takes 15 us to look at them."""
        given = self._arguments(self.problem.signals, self.problem.stops, 0)
        return march.from_python.compile(tuple(map(march.from_python.typeof_pyval, given)))

    def __getstate__(self) -> dict[str, Any]:
        """Return the fields to be copied or pickled, without the machine code."""
        return {each.name: getattr(self, each.name) for each in fields(self)}

    @property
    def time(self) -> float:
        """Current time [s], see `Run`."""
        return float(self.state.clock[at.TIME])

    def now(self) -> Instant:
        """Return the current state, see `Run`."""
        state = self.state
        return Instant(
            t=float(state.clock[at.TIME]),
            q=state.q.copy(),
            v=state.v.copy(),
            a=state.stage_a[1, 0].copy(),
            multipliers=state.stage_lam[1, 0].copy(),
            work=float(state.clock[at.WORK]),
        )

    def figures(self) -> Figures:
        """Return counts, residuals and errors so far, see `Run`."""
        state, estimated = self.state, self.scheme.error.size and not self.controls.fixed_step
        return Figures(
            steps=int(state.counts[at.STEPS]),
            rejected=int(state.counts[at.REJECTED]),
            newton_iterations=int(state.counts[at.ITERATIONS]),
            factorisations=int(state.counts[at.FACTORS]),
            evaluations=int(state.counts[at.ITERATIONS]),
            constraint_position_max=float(state.clock[at.PHI_MAX]),
            constraint_velocity_max=float(state.clock[at.DPHI_MAX]),
            energy_balance_max=float(state.clock[at.BALANCE]),
            passages=state.passages[:, : state.counts[at.PASSAGES]],
            multiplier_errors=_ERROR_SAFETY * state.forces[at.UNRESOLVED] if estimated else None,
            coordinate_errors=_ERROR_SAFETY * state.errors[at.UNRESOLVED] if estimated else None,
        )

    def until(self, time: float) -> "NativeRun":
        """Return the run, after setting the time up to the end at which a step ends and it pauses next."""
        self.state.counts[at.STOP], self.pause[0] = 0, time
        return self

    def arrays(self) -> tuple[np.ndarray, ...]:
        """Return all arrays of the state of the run, including its samples."""
        return tuple(_arrays((self.state, self.workspace, self.slow, self.samples)))

    def resume(self) -> None:
        """Let the next step begin with a new first stage, after a jump; energies and work continue."""
        self.state.counts[at.JUMPED] = 1


def own(run: Run) -> NativeRun:
    """Return the run if it is by an own method, which can be advanced from time to time.

    Raises
    ------
    InputError
        The run is by an external solver, which steps over any time not given at the start.
    """
    if isinstance(run, NativeRun):
        return run
    raise InputError(
        "continues from time to time with paraflex's own methods only", field="method",
        remedy="choose one of paraflex's own, say esdirk5 or tr-bdf2",
    )  # fmt: skip


def _arrays(given: object) -> Iterator[np.ndarray]:
    if isinstance(given, np.ndarray):
        yield given
    elif isinstance(given, tuple):
        for one in given:
            yield from _arrays(one)


def _mark_redundant(system: System, q: Array, workspace: Workspace) -> int:
    """Mark the redundant rows at a pose and return their number."""
    packed = system.packed
    count = int(factor_system(packed, 0.0, q, workspace))
    dependent = workspace.schur[packed.rows["start"] + np.arange(system.m) - packed.rows["first"]] == 0.0
    workspace.redundant[:] = np.where(dependent, DEPENDENT_PART, 0.0)
    return count


def _turning(system: System) -> Indices:
    """Return the indices of the angles of bodies on which forces depend on the orientation.

    A rigid body with all its points and its centre of mass at its origin is not among them.
    """
    least = _SAME_PLACE * system.size
    matters = [
        body.nf > 0
        or np.linalg.norm(np.real(body.integrals.S1)) > least * np.real(body.integrals.m)
        or any(np.linalg.norm(np.real(point.x0)) > least for point in body.shape.points.values())
        for body in system.bodies
    ]
    return np.array([body.angle for body, one in zip(system.bodies, matters, strict=True) if one], dtype=np.int64)


def prepare(problem: Problem, options: IntegrationOptions) -> NativeRun:
    """Prepare a run."""
    system, initial, span = problem.system, problem.initial, problem.span
    method = options.method
    assert isinstance(method, NativeMethod)
    scheme = method.scheme
    treatment = POSITION if isinstance(method, NewmarkMethod) else _TREATMENTS[options.treatment]
    state = make_march(system.n, system.m, scheme.c.size, inputs_of(system.mechanism).acting, treatment)
    state.q[:], state.v[:] = initial.q, initial.v
    workspace = system.workspace()
    at_start = permanent = _mark_redundant(system, initial.q, workspace)
    branch = pose_on_branch(problem) if at_start else None
    if branch is not None:
        permanent = _mark_redundant(system, branch.q, workspace)
    # In steps shorter than the second value, rows near dependence are negligible.
    first = FIRST_STEP * span if branch is None else 0.1 * branch.later
    state.clock[at.TIME], state.clock[at.STEP] = initial.time, min(first, options.max_step)
    state.clock[at.CYCLE] = span
    tolerance, phase = options.tolerance_for(system), _PHASES[min(method.order, 4)]
    latest = max(abs(initial.time), abs(float(problem.stops[-1])))
    controls = Controls(
        tolerance=tolerance,
        span=span,
        by_cycle=int(options.step is None and options.per is TolerancePer.CYCLE),
        force_part=options.force_part(system),
        force_control=int(options.control_for(system) is Control.FORCES),
        force_cycles=_FORCE_CYCLES if system.vibrations_die_out else np.inf,
        long_from=_FOLLOWS / slowest_deflection(system, initial.q),
        newton_fraction=options.newton_fraction
        or (method.fixed_newton_fraction if options.step else method.newton_fraction),
        alpha=options.alpha,
        beta=options.beta,
        gain=_BAUMGARTE_GAIN if options.automatic_gains else 0.0,
        treatment=treatment,
        fixed_step=options.step or 0.0,
        least_step=max(_LEAST * span, _DIGITS * float(np.spacing(latest))),
        max_step=options.max_step,
        near_error=max(NEAR_ERROR * tolerance, LEAST_NEAR_ERROR * system.size),
        turning=_turning(system),
        limit_t=problem.limits.times,
        limit_h=phase * problem.limits.steps,
        turn_in_step=phase,
        dependent_part=ROUNDING_PART,
        dependent_rows=permanent,
    )
    return NativeRun(
        problem=problem,
        scheme=scheme,
        controls=controls,
        state=state,
        workspace=workspace,
        slow=system.workspace(),
        samples=empty_samples(problem.times, system, problem.stored),
        aside=system.workspace(),
        law=no_law(),
        dependent_at_start=at_start,
        branch=branch,
    )
