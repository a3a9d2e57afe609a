"""Runs of an ESDIRK scheme: the kernel's time loop in slices, between which Python may look, report and stop."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from paraflex.dynamics import State, System, redundant_rows
from paraflex.errors import ConstraintDriftError, InputError, IntegrationError, Moment
from paraflex.integrators.stretches import hidden_from, jump_times
from paraflex.integrators.tableaux import TR_BDF2
from paraflex.integrators.watch import bent_too_far, come_apart, least_norm
from paraflex.kernel.linear import factor_system
from paraflex.kernel.march import march, start
from paraflex.kernel.packed import Signals, Workspace
from paraflex.kernel.run_state import (
    BALANCE,
    DPHI_MAX,
    ENERGY_0,
    ERROR_TEST,
    FACTORS,
    FINISHED,
    ITERATIONS,
    NO_CONVERGENCE,
    NOT_FINITE,
    PASSAGES,
    PAUSED,
    PHI_MAX,
    REJECTED,
    SAMPLE,
    STEP,
    STEPS,
    TIME,
    WEIGHT_0,
    Controls,
    March,
    Samples,
    Tableau,
    make_march,
)

# Attempted steps between two looks: some milliseconds for a dozen bodies.
_SLICE = 200
# Where the first step starts from, as a fraction of the run; error control takes over at once.
_FIRST_STEP = 1e-6
# How long a velocity error that Newton leaves is taken to last, as a fraction of the run: it must count for more
# than its share of one step, since it is of one sign while a factor is in use.
_NEWTON_MEMORY = 0.002
# A velocity error of a step that nothing turns round moves the mechanism for half of the run, on average.
_MEMORY = 0.25
# Rows this close to depending on each other when a run breaks down are the cause.
_NEARLY_DEPENDENT = 1e-4
# Constraint rows with less than this of their squares left depend on the others for the moment and keep their
# multipliers: small enough that this lasts a thousandth of a radian, large enough for good conditioning elsewhere.
_DEPENDENT_PART = 1e-7
_CAUSES = {
    NO_CONVERGENCE: "Newton's iteration does not converge, however small the step",
    NOT_FINITE: "the solution is no longer finite",
    ERROR_TEST: "the error test asks for steps below the smallest one",
}


@dataclass(frozen=True)
class IntegrationOptions:
    """How to integrate.

    Attributes
    ----------
    tolerance : float
        Local errors over the whole run may add up to this much, in metres (root mean square over the mass).
    alpha, beta : float
        Baumgarte coefficients [1/s] (Eq. 57); the paper's range is 0 to 50.
    max_step : float
        Largest step [s].
    max_steps : int
        Attempted steps before the run is given up.
    newton_fraction : float
        The part of the error allowed in a step that Newton's iteration may leave.
    tableau : Tableau
        The scheme.
    """

    tolerance: float = 1e-4
    alpha: float = 20.0
    beta: float = 20.0
    max_step: float = math.inf
    max_steps: int = 10_000_000
    newton_fraction: float = 0.03
    tableau: Tableau = TR_BDF2

    def __post_init__(self) -> None:
        for name in ("tolerance", "max_step", "max_steps", "newton_fraction"):
            value = getattr(self, name)
            if not value > 0:
                raise InputError("must be positive", field=name, value=value, remedy=_REMEDIES[name])
        if not math.isfinite(self.tolerance):
            raise InputError("must be finite", field="tolerance", value=self.tolerance, remedy=_REMEDIES["tolerance"])
        for name in ("alpha", "beta"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise InputError("must not be negative", field=name, value=value, remedy="choose it from 0 to 50 1/s")


_REMEDIES = {
    "tolerance": "give a length in metres, say 1e-5",
    "max_step": "give a time in seconds",
    "max_steps": "give a number of steps",
    "newton_fraction": "give a fraction, say 0.03",
}


@dataclass(frozen=True)
class Solution:
    """What a run computed, at the times asked for and reached.

    Attributes
    ----------
    t : (k,) array
        [s]
    q, v, a : (k, n) arrays
        Coordinates and their derivatives; flexible ones modal.
    multipliers : (k, m) array
        Constraint forces [N, N m], one a constraint row of the system; where rows depend on one another, of all that
        give the same motion those with the least sum of squares.
    kinetic_energy, strain_energy, work : (k,) arrays
        [J]; work is that of motors, prescribed motion, weight and loads, less what dampers take.
    status : str
        "complete", "interrupted" or "failed".
    message : str
        Why it is not complete.
    steps, rejected, newton_iterations, factorisations : int
    wall_time : float
        [s]
    constraint_position_max, constraint_velocity_max : float
        Largest |Phi| [m, rad] and |Phi'| at accepted steps.
    energy_balance_max : float
        Largest |kinetic + strain energy - start - work| at accepted steps [J].
    singular_positions : tuple of float
        Times at which constraints depended on one another for an instant that elsewhere do not [s]. Constraint forces
        have a pole there: multipliers of samples so near are NaN.
    """

    t: NDArray[np.float64]
    q: NDArray[np.float64]
    v: NDArray[np.float64]
    a: NDArray[np.float64]
    multipliers: NDArray[np.float64]
    kinetic_energy: NDArray[np.float64]
    strain_energy: NDArray[np.float64]
    work: NDArray[np.float64]
    status: str
    message: str
    steps: int
    rejected: int
    newton_iterations: int
    factorisations: int
    wall_time: float
    constraint_position_max: float
    constraint_velocity_max: float
    energy_balance_max: float
    singular_positions: tuple[float, ...] = ()


def integrate(
    system: System,
    signals: Signals,
    initial: State,
    times: NDArray[np.float64],
    *,
    knots: NDArray[np.float64] | None = None,
    options: IntegrationOptions | None = None,
    on_progress: Callable[[float], None] | None = None,
) -> Solution:
    """Integrate the index-1 equations of a system from an initial state.

    Parameters
    ----------
    system : System
    signals : Signals
        Motor torques and prescribed angles.
    initial : State
        Consistent: see `dynamics.consistent_state`.
    times : (k,) array
        Where results are wanted [s], ascending, the first not before the start; the last ends the run.
    knots : array, optional
        Times at which the signals are not smooth; steps end there.
    options : IntegrationOptions, optional
    on_progress : callable, optional
        Told the time reached [s] every few milliseconds. A KeyboardInterrupt, in it or elsewhere, ends the run with
        what is there, marked "interrupted".

    Returns
    -------
    Solution

    Raises
    ------
    IntegrationError
        The run cannot go on; it carries the partial solution.
    ConstraintDriftError
        Constraints are left further than errors of integration explain; it carries the partial solution as well.
    InputError
        Times that do not ascend from the start.
    """
    began = time.perf_counter()
    options = options or IntegrationOptions()
    run = prepare(system, signals, initial, times, knots, options)
    status, message, bent, drift, state = "complete", "", "", "", run.state
    run.start()
    code, limits = PAUSED, (run.controls.dependent_rows, options.tolerance)
    try:
        while code == PAUSED:
            attempts = int(state.counts[STEPS] + state.counts[REJECTED])
            if attempts >= options.max_steps:
                break
            code = run.march(min(_SLICE, options.max_steps - attempts))
            bent, drift = (
                bent_too_far(system, state.q),
                come_apart(system, signals, state.clock[TIME], state.q, *limits),
            )
            if bent or drift:
                break
            if on_progress is not None:
                on_progress(float(state.clock[TIME]))
    except KeyboardInterrupt:
        status, message = "interrupted", f"interrupted at t = {state.clock[TIME]:.6g} s"
    solution = _solution(run, time.perf_counter() - began, status, message)
    if (code == FINISHED and not (bent or drift)) or status == "interrupted":
        return solution
    cause = bent or drift or (f"no end after {options.max_steps} steps" if code == PAUSED else _CAUSES[code])
    # Near a singular position it may be Newton or the error test that gives up first.
    lost = redundant_rows(system, state.q, _NEARLY_DEPENDENT) if code != PAUSED and not (bent or drift) else []
    if len(lost) > run.controls.dependent_rows:
        cause = f"the constraints lose rank, a singular position ({', '.join(lost)})"
    moment = Moment(float(state.clock[TIME]), int(state.counts[STEPS]))
    error = ConstraintDriftError if drift and not bent else IntegrationError
    raise error(cause, moment, replace(solution, status="failed", message=f"{cause} at {moment}"))


@dataclass(frozen=True)
class Run:
    """Everything the kernel's time loop works on."""

    system: System
    signals: Signals
    tableau: Tableau
    controls: Controls
    stops: NDArray[np.float64]
    jumps: NDArray[np.float64]
    state: March
    workspace: Workspace
    slow: Workspace
    samples: Samples

    def start(self) -> None:
        """First stage and first sample."""
        arguments = (self.system.packed, self.signals, self.tableau, self.controls)
        start(*arguments, self.state, self.workspace, self.samples)

    def march(self, attempts: int) -> int:
        """So many attempted steps; a code of `kernel.run_state`."""
        ahead = self.jumps[self.jumps > self.state.clock[TIME]]
        signals, stops = self.signals, self.stops
        if ahead.size:
            signals, stops = hidden_from(signals, ahead[0]), stops[stops <= ahead[0]]
        arguments = (self.system.packed, signals, self.tableau, self.controls, stops, attempts)
        code = march(*arguments, self.state, self.workspace, self.slow, self.samples)
        return self.resume() if code == FINISHED and ahead.size else code

    def resume(self) -> int:
        """A first stage with what is given after a jump; energies go on counting from the run's start."""
        kept = self.state.clock[[ENERGY_0, WEIGHT_0]]
        arguments = (self.system.packed, self.signals, self.tableau, self.controls)
        start(*arguments, self.state, self.workspace, _samples(np.zeros(0), self.system))
        self.state.clock[[ENERGY_0, WEIGHT_0]] = kept
        return PAUSED


def prepare(
    system: System,
    signals: Signals,
    initial: State,
    times: NDArray[np.float64],
    knots: NDArray[np.float64] | None,
    options: IntegrationOptions,
) -> Run:
    """Set up a run: see `integrate`."""
    times = np.ascontiguousarray(times, dtype=float)
    if times.size == 0 or np.any(np.diff(times) <= 0.0) or times[0] < initial.time or times[-1] <= initial.time:
        raise InputError("times must ascend from the start", field="times", remedy="give at least one later time")
    span = times[-1] - initial.time
    inner = np.array([] if knots is None else knots, dtype=float)
    state = make_march(system.n, system.m, options.tableau.c.size, len(system.mechanism.motors))
    state.q[:], state.v[:] = initial.q, initial.v
    state.clock[TIME], state.clock[STEP] = initial.time, min(_FIRST_STEP * span, options.max_step)
    workspace = system.workspace()
    controls = Controls(
        rate=options.tolerance / span,
        newton_fraction=options.newton_fraction,
        newton_memory=_NEWTON_MEMORY * span,
        memory=_MEMORY * span,
        alpha=options.alpha,
        beta=options.beta,
        max_step=options.max_step,
        dependent_part=_DEPENDENT_PART,
        dependent_rows=int(factor_system(system.packed, 0.0, initial.q, workspace)),
    )
    inner = np.unique(inner[(inner > initial.time) & (inner < times[-1])])
    return Run(
        system=system,
        signals=signals,
        tableau=options.tableau,
        controls=controls,
        stops=np.append(inner, times[-1]),
        jumps=jump_times(signals, len(system.mechanism.motors), inner),
        state=state,
        workspace=workspace,
        slow=system.workspace(),
        samples=_samples(times, system),
    )


def _samples(times: NDArray[np.float64], system: System) -> Samples:
    k = times.size
    return Samples(
        times=times,
        q=np.full((k, system.n), np.nan),
        v=np.full((k, system.n), np.nan),
        a=np.full((k, system.n), np.nan),
        lam=np.full((k, system.m), np.nan),
        energy=np.full((k, 3), np.nan),
    )


def _solution(run: Run, wall_time: float, status: str, message: str) -> Solution:
    samples, state = run.samples, run.state
    reached = slice(0, int(state.counts[SAMPLE]))
    passages = state.passages[:, : state.counts[PASSAGES]]
    multipliers = least_norm(run.system, samples.q[reached], samples.lam[reached], run.controls.dependent_rows)
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
        steps=int(state.counts[STEPS]),
        rejected=int(state.counts[REJECTED]),
        newton_iterations=int(state.counts[ITERATIONS]),
        factorisations=int(state.counts[FACTORS]),
        wall_time=wall_time,
        constraint_position_max=float(state.clock[PHI_MAX]),
        constraint_velocity_max=float(state.clock[DPHI_MAX]),
        energy_balance_max=float(state.clock[BALANCE]),
        singular_positions=tuple(passages.mean(axis=0).tolist()),
    )
