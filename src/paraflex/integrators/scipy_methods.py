"""SciPy's solvers of ordinary differential equations, one step at a time: a `Stepper`."""

import math
import warnings

import numpy as np
import scipy

from paraflex.arrays import Array
from paraflex.kernel.run_state import ERROR_TEST, NOT_FINITE, PAUSED
from .external_methods import SciPyMethod
from .forms import OdeForm
from .stepper import SolverCounts, Stepper, Steps, attempts

# Smallest relative tolerance that SciPy accepts without a warning.
_RELATIVE = 1e-13


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
            self._evaluate, t, y, stop, rtol=_RELATIVE, atol=self._tolerances, max_step=self._steps.longest,
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
