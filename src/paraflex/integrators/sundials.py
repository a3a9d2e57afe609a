"""CVODE and IDA of SUNDIALS through scikit-sundae, one step at a time: each a `Stepper`."""

import contextlib
import io
import math
from abc import abstractmethod
from importlib import import_module
from typing import Any

import numpy as np

from paraflex.arrays import Array
from paraflex.errors import optional_package
from paraflex.kernel.run_state import ERROR_TEST, NO_CONVERGENCE, NOT_FINITE, PAUSED
from .external_methods import ExternalMethod
from .forms import DescriptorForm, OdeForm
from .stepper import SolverCounts, Stepper, Steps, attempts

# Smallest relative tolerance that SUNDIALS recommends.
_RELATIVE = 1e-15
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
            "rtol": _RELATIVE,
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
