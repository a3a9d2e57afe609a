"""Runs by SciPy and SUNDIALS, one step at a time: steppers, and stops, samples, energies and counts around them."""

import contextlib
import io
import math
import time
import warnings
from abc import abstractmethod
from importlib import import_module
from typing import Any

import numpy as np
import scipy

from paraflex.arrays import Array
from paraflex.errors import InputError, StiffnessWarning, optional_package
from paraflex.findings import Finding, warn_of
from paraflex.kernel.bodies import stored_energy
from paraflex.kernel.linear import factor_system
from paraflex.kernel.packed import make_scratch
from paraflex.kernel.run_state import ERROR_TEST, FINISHED, NO_CONVERGENCE, NOT_FINITE, PAUSED, Samples
from .external_methods import IDA, ExternalMethod, SciPyMethod
from .forms import DescriptorForm, OdeForm, StabilisedForm
from .method import Method, Treatment
from .options import IntegrationOptions
from .run import FIRST_STEP, Figures, Instant, Problem, empty_samples
from .stepper import SolverCounts, Stepper, Steps, attempts

# Smallest relative tolerance that SUNDIALS recommends.
_SUNDIALS_RELATIVE = 1e-15
# Return codes of both solvers: too much accuracy requested, error tests failed. Others concern Newton's iteration.
_TOO_ACCURATE, _ERROR_TESTS = -2, -3
# Number of unknowns above which LAPACK's factorisation is faster than SUNDIALS' own.
_LAPACK = 60


class SundialsStepper(Stepper):
    """Common base of CVODE and IDA; an `InputError` if SUNDIALS is not installed."""

    def __init__(self, form: OdeForm, tolerances: Array, steps: Steps) -> None:
        super().__init__(form, tolerances, steps)
        problem, remedy = "needs SUNDIALS, which is not installed", "pip install 'paraflex[sundials]'"
        with optional_package(problem, field="method", remedy=remedy):
            self._cvode, self._ida = import_module("sksundae.cvode"), import_module("sksundae.ida")
        self._counts, self._matrices, self._last = SolverCounts(0, 0, 0, 0), 0, np.zeros(1)

    def begin(self, t: float, y: Array, stop: float) -> None:
        """Restart from y at t towards a stop, see `Stepper`."""
        self.t, self.y, self._stop = t, y, stop
        options = {
            "rtol": _SUNDIALS_RELATIVE,
            "atol": self._tolerances,
            "first_step": min(self._steps.first, stop - t),
            # Zero means no limit.
            "max_step": self._steps.longest if math.isfinite(self._steps.longest) else 0.0,
            "max_order": self._steps.order,
            "linsolver": "lapackdense" if y.size > _LAPACK else "dense",
        }
        self._solver = self._started(t, y, options)

    def step(self, stop: float) -> int:
        """Take one step and return a code, see `Stepper`."""
        self._stop, before = stop, self.t
        self._seen.clear()
        result = self._call(stop, "onestep")
        # After an interpolation the first call only returns to the end of the last step.
        while result.status >= 0 and result.t <= before:
            result = self._call(stop, "onestep")
        tried = attempts(self._seen, before, 1)
        self._counts += SolverCounts(len(self._seen), max(tried - 1, 0), len(self._seen), self._matrices)
        self._matrices = 0
        if not (np.all(np.isfinite(result.y)) and np.all(np.isfinite(self._last))):
            return NOT_FINITE
        if result.status < 0:
            return ERROR_TEST if result.status in (_TOO_ACCURATE, _ERROR_TESTS) else NO_CONVERGENCE
        self.t: float = float(result.t)
        self.y: Array = result.y
        return PAUSED

    def at(self, time: float) -> Array:
        """Return the solution within the last step, by the solver's own interpolation."""
        return self._call(time, "normal").y

    def counts(self) -> SolverCounts:
        """Return the counts. Every evaluation counts as an iteration; a factorisation is one with a new Jacobian."""
        return self._counts

    def _call(self, time: float, method: str) -> Any:
        # The solver prints failures as well as returning them.
        with contextlib.redirect_stdout(io.StringIO()):
            return self._solver.step(time, method=method, tstop=self._stop)

    @abstractmethod
    def _started(self, t: float, y: Array, options: dict[str, Any]) -> Any:
        """Return a solver that has been started from y at t."""


class CvodeStepper(SundialsStepper):
    """CVODE for the ODE form."""

    def __init__(self, method: ExternalMethod, form: OdeForm, *arguments: Any) -> None:
        super().__init__(form, *arguments)
        self._method = method.solver

    def _started(self, t: float, y: Array, options: dict[str, Any]) -> Any:
        solver = self._cvode.CVODE(self._rates, method=self._method, jacfn=self._jacobian, **options)
        solver.init_step(t, y)
        return solver

    def _rates(self, t: float, y: Array, dy: Array) -> None:
        self._seen.append(t)
        dy[:] = self._last = self.form.rates(t, y)

    def _jacobian(self, t: float, y: Array, dy: Array, out: Array) -> None:
        self._matrices += 1
        out[:] = self.form.jacobian(t, y)


class IdaStepper(SundialsStepper):
    """IDA for a form with multipliers."""

    def __init__(self, form: DescriptorForm, *arguments: Any) -> None:
        super().__init__(form, *arguments)
        self._implicit = form

    def _started(self, t: float, y: Array, options: dict[str, Any]) -> Any:
        algebraic = self._implicit.algebraic.tolist() or None
        solver = self._ida.IDA(self._residual, algebraic_idx=algebraic, jacfn=self._matrix, **options)
        solver.init_step(t, y, self._implicit.slopes(t, y))
        return solver

    def _residual(self, t: float, y: Array, dy: Array, out: Array) -> None:
        self._seen.append(t)
        self._last = np.empty(y.size)
        self._implicit.residual(t, y, dy, self._last)
        out[:] = self._last

    def _matrix(self, t: float, y: Array, dy: Array, residual: Array, c: float, out: Array) -> None:
        self._matrices += 1
        out[:] = self._implicit.matrix(t, y, dy, c)


# Smallest relative tolerance that SciPy accepts without a warning.
_SCIPY_RELATIVE = 1e-13


class ScipyStepper(Stepper):
    """Steps of one of SciPy's solvers with given absolute tolerances."""

    def __init__(self, method: SciPyMethod, form: OdeForm, tolerances: Array, steps: Steps) -> None:
        super().__init__(form, tolerances, steps)
        # The solver's module is loaded only when one runs.
        self._class = getattr(scipy.integrate, method.solver)
        self._places, self._stages = method.places, 0 if method.explicit else method.places
        self._past, self._rejected, self._dense = SolverCounts(0, 0, 0, 0), 0, None

    def begin(self, t: float, y: Array, stop: float) -> None:
        """Restart from y at t towards a stop, see `Stepper`."""
        self._past = self.counts() if hasattr(self, "_solver") else self._past
        self.t, self.y, self._rejected, self._dense = t, y, 0, None
        options = {"jac": self.form.jacobian} if self._stages else {}
        self._solver = self._class(
            self._evaluate, t, y, stop, rtol=_SCIPY_RELATIVE, atol=self._tolerances, max_step=self._steps.longest,
            first_step=min(self._steps.first, stop - t), **options,
        )  # fmt: skip

    def step(self, stop: float) -> int:
        """Take one step and return a code, see `Stepper`."""
        solver, before = self._solver, self._solver.t
        solver.t_bound, solver.status = stop, "running"
        self._seen.clear()
        self._dense = None
        try:
            # An overflow of the solution is reported by the return code, not by warnings for each number.
            with np.errstate(all="ignore"), warnings.catch_warnings():
                warnings.simplefilter("ignore", scipy.linalg.LinAlgWarning)
                solver.step()
        except (ValueError, np.linalg.LinAlgError):
            # The factorisation raises an error for numbers that are not finite.
            return NOT_FINITE
        tried = attempts(self._seen, before, self._places)
        if solver.status == "failed":
            self._rejected += tried
            return ERROR_TEST if np.all(np.isfinite(self._last)) else NOT_FINITE
        self._rejected += max(tried - 1, 0)
        self.t: float = float(solver.t)
        self.y: Array = solver.y
        return PAUSED if np.all(np.isfinite(solver.y)) else NOT_FINITE

    def at(self, time: float) -> Array:
        """Return the solution within the last step, by the solver's own interpolation."""
        if self._dense is None:
            self._dense = self._solver.dense_output()
        return self._dense(time)

    def counts(self) -> SolverCounts:
        """Return the counts since the run began. SciPy counts evaluations; iterations follow from them."""
        solver = self._solver
        iterations = int(solver.nfev) // self._stages if self._stages else 0
        return self._past + SolverCounts(int(solver.nfev), self._rejected, iterations, int(solver.nlu))

    def _evaluate(self, t: float, y: Array) -> Array:
        self._seen.append(t)
        self._last = self.form.rates(t, y) if math.isfinite(t) else np.full(y.size, np.nan)
        return self._last


# With order p errors add up to h^p, while that of a step is h^(p + 1). The tolerance of multistep methods is used as it
# is at this value [m], and is raised to the power (p + 1) / p elsewhere.
_REFERENCE = 1e-4
# Longest wall time of a slice of steps between two checks [s].
_SLICE_TIME = 0.1
# Number of steps above which a warning is issued.
MANY_STEPS = 20_000
# Number of unknowns up to which all eigenvalues are computed; beyond, the largest one by Arnoldi's method.
_MOST_DENSE = 600


class ExternalRun:
    """Run by an external solver: a `Run`."""

    def __init__(self, problem: Problem, options: IntegrationOptions, stepper: Stepper) -> None:
        self.problem = problem
        self.samples: Samples = empty_samples(problem.times, problem.system)
        self._stepper, self._options, self._scratch = stepper, options, make_scratch(problem.system.packed)
        system, initial = problem.system, problem.initial
        self.dependent_at_start: int = int(factor_system(system.packed, 0.0, initial.q, system.workspace()))
        self.dependent_rows: int = self.dependent_at_start
        self.reached: int = 0
        self._steps, self._balance, self._violation, self._energy = 0, 0.0, np.zeros(2), np.zeros(3)
        self._passages: list[tuple[float, float]] = []
        self._instant = Instant(initial.time, initial.q, initial.v, np.zeros(system.n), np.zeros(system.m), 0.0)

    @property
    def singular_ahead(self) -> float | None:
        """Always None, as no external solver integrates index-3 equations; see `Run`."""
        return None

    @property
    def attempts(self) -> int:
        """Number of attempted steps, see `Run`."""
        return self._steps + self._stepper.counts().rejected if self._steps else 0

    def start(self) -> None:
        """Compute the initial accelerations and multipliers and take the first sample, see `Run`."""
        initial = self.problem.initial
        self._begin(initial.time, initial.q, initial.v, 0.0)
        self._energy = self._energies(self._instant)
        self._note(self._instant)
        if self.samples.times[0] <= initial.time:
            self._sample(initial.time, initial.q, initial.v, 0.0)
        warn_if_stiff(self._stepper.form, self.problem, self._options.method)

    def march(self, attempts: int) -> int:
        """Attempt a number of steps and return a code, see `Run`; fewer steps if they take long."""
        until, began = self.attempts + attempts, time.perf_counter()
        while self.attempts < until and time.perf_counter() - began < _SLICE_TIME:
            code = self._advance()
            if code != PAUSED:
                return code
        return PAUSED

    @property
    def time(self) -> float:
        """Current time [s], see `Run`."""
        return self._instant.t

    def now(self) -> Instant:
        """Return the current state, see `Run`."""
        return self._instant

    def figures(self) -> Figures:
        """Return counts and residuals so far, see `Run`."""
        counts = self._stepper.counts()
        return Figures(
            steps=self._steps,
            rejected=counts.rejected,
            newton_iterations=counts.iterations,
            factorisations=counts.factorisations,
            evaluations=counts.evaluations,
            constraint_position_max=float(self._violation[0]),
            constraint_velocity_max=float(self._violation[1]),
            energy_balance_max=float(self._balance),
            passages=np.array(self._passages).reshape(-1, 2).T,
        )

    def _begin(self, t: float, q: Array, v: Array, work: float) -> None:
        """Restart the solver, with the signals from t up to the next jump."""
        problem, form = self.problem, self._stepper.form
        form.signals = problem.signals_from(t)
        solved = form.solve(t, q, v)
        self._instant = Instant(t, q.copy(), v.copy(), solved.a, solved.multipliers, work)
        self._stepper.begin(t, form.pack(t, q, v, work), float(problem.stops[problem.stops > t][0]))

    def _advance(self) -> int:
        """Take one accepted step."""
        problem, stepper, before = self.problem, self._stepper, self._instant.t
        ahead = problem.stops[problem.stops > before]
        if ahead.size == 0:
            return FINISHED
        code = stepper.step(float(ahead[0]))
        if code != PAUSED:
            return code
        self._steps += 1
        q, v, work = stepper.form.unpack(stepper.y)
        solved = stepper.form.solve(stepper.t, q, v)
        if solved.dependent > self.dependent_rows:
            # Adjacent steps form one interval of a singular position.
            can_continue = self._passages and before <= self._passages[-1][1]
            self._passages.append((self._passages.pop()[0] if can_continue else before, stepper.t))
        self._instant = Instant(stepper.t, q, v, solved.a, solved.multipliers, work)
        self._note(self._instant)
        times = self.samples.times
        while self.reached < times.size and times[self.reached] <= stepper.t:
            at = float(times[self.reached])
            self._sample(at, *stepper.form.unpack(stepper.at(at) if at < stepper.t else stepper.y))
        if stepper.t in problem.jumps:
            self._begin(stepper.t, q, v, work)
        return PAUSED

    def _energies(self, instant: Instant) -> Array:
        packed = self.problem.system.packed
        return np.array(stored_energy(packed, instant.q, instant.v, instant.multipliers, self._scratch))

    def _note(self, instant: Instant) -> None:
        """Record the largest violations of constraints and of the energy balance."""
        values = self.problem.system.constraints(self._stepper.form.signals, instant.t, instant.q, instant.v)
        largest = [np.max(np.abs(x), initial=0.0) for x in values]
        self._violation = np.maximum(self._violation, largest)
        change = self._energies(instant) - self._energy
        self._balance = max(self._balance, abs(change[0] + change[1] - change[2] - instant.work))

    def _sample(self, t: float, q: Array, v: Array, work: float) -> None:
        out, i, solved = self.samples, self.reached, self._stepper.form.solve(t, q, v)
        out.q[i], out.v[i], out.a[i], out.lam[i] = q, v, solved.a, solved.multipliers
        energies = self._energies(Instant(t, q, v, solved.a, solved.multipliers, work))
        out.energy[i] = energies[0], energies[1], work + energies[2] - self._energy[2]
        self.reached = i + 1


def prepare(problem: Problem, options: IntegrationOptions) -> ExternalRun:
    """Prepare a run.

    Raises
    ------
    InputError
        SUNDIALS is not installed, or the options have automatic gains, which only own methods support.
    """
    if options.automatic_gains:
        raise InputError(
            f"automatic gains need the step sizes, which {options.method} does not show",
            field="automatic_gains", value=True,
            remedy="give alpha and beta, or choose another method",
        )  # fmt: skip
    return ExternalRun(problem, options, _stepper(problem, options))


def _stepper(problem: Problem, options: IntegrationOptions) -> Stepper:
    method = options.method
    assert isinstance(method, ExternalMethod)
    tolerance = options.tolerance_for(problem.system)
    error = method.error_factor * tolerance
    if method.multistep:
        error *= (tolerance / _REFERENCE) ** (1.0 / method.highest_order)
    steps = Steps(min(FIRST_STEP * problem.span, options.max_step), options.max_step, method.highest_order)
    if isinstance(method, IDA):
        kind = StabilisedForm if options.treatment == Treatment.GGL else DescriptorForm
        form = kind(problem, options)
        return IdaStepper(form, form.tolerances(error, problem.span), steps)
    form = OdeForm(problem, options)
    given = (form, form.tolerances(error, problem.span), steps)
    return ScipyStepper(method, *given) if isinstance(method, SciPyMethod) else CvodeStepper(method, *given)


def largest_rate(form: OdeForm, problem: Problem) -> float:
    """Return the largest eigenvalue of the ODE form's Jacobian at the start, in magnitude [1/s].

    The Jacobian is that of the constrained mechanism, with springs, damping and Baumgarte's terms.
    """
    initial = problem.initial
    jacobian = form.jacobian(initial.time, form.pack(initial.time, initial.q, initial.v, 0.0))
    if not np.all(np.isfinite(jacobian)):
        # The run itself reports values that are not finite.
        return 0.0
    if jacobian.shape[0] <= _MOST_DENSE:
        return float(np.max(np.abs(np.linalg.eigvals(jacobian))))
    start = np.ones(jacobian.shape[0])
    values = scipy.sparse.linalg.eigs(jacobian, k=1, which="LM", v0=start, return_eigenvectors=False)
    return float(np.max(np.abs(values)))


def warn_if_stiff(form: OdeForm, problem: Problem, method: Method) -> None:
    """Warn once of the number of steps that stability requires, if it is large."""
    if not method.explicit or method.stability_limit is None:
        return
    rate = largest_rate(form, problem)
    step = method.stability_limit / rate if rate > 0.0 else math.inf
    steps = problem.span / step
    if steps > MANY_STEPS:
        text = (
            f"{method} is explicit and this mechanism stiff: no step can be longer than about {step:.2g} s, "
            f"{steps:,.0f} steps for this run"
        )
        remedy = "choose an implicit method, such as tr-bdf2, whose steps only accuracy limits"
        warn_of([Finding("stability", "method", text, remedy)], StiffnessWarning)
