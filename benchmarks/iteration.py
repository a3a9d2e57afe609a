"""Where does a Newton iteration's time go, and how much of the machine does it use? RAParM-I, ++++, 104 coordinates.

    python benchmarks/iteration.py [--tolerance METRES] [--repeats N] [--write]

Each part of a step is called many times in a row from compiled code, at a state within a run, and multiplied by how
often an iteration of that run calls it. What is left of the run's time is stepping: starting guesses, sampling, and
what Python does between slices. All times are the least of several. Floating-point operations are counted by formula
(`operations.py`) and their rate stands beside that of dense products of 20 x 20 to 100 x 100 on the same machine. The
goal: 5 microseconds an iteration.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import operations
from common import command_line, least_time, single_thread, table, write_json
from numba import njit

import paraflex as pf
from paraflex.compilation import compile_kernels
from paraflex.dynamics import pack_signals
from paraflex.integrators import IntegrationOptions, Solution, make_problem
from paraflex.integrators.native import NativeRun, prepare
from paraflex.kernel.bodies import system_energy
from paraflex.kernel.compiling import FAST_MATH
from paraflex.kernel.constraints import constraint_values
from paraflex.kernel.factor import factor_bodies
from paraflex.kernel.indices import FACTOR_B, TIME
from paraflex.kernel.linear import orient, solve_system
from paraflex.kernel.metric import mass_norm
from paraflex.kernel.stage import equations
from paraflex.mechanism import Geometry
from paraflex.tracking import TrackingTask

MODE, METHOD, TOLERANCE, REPEATS, CALLS, GOAL = "++++", "tr-bdf2", 9e-5, 5, 2000, 5.0
SIZES = (20, 40, 60, 80, 100)
WEIGHTS = (1.0, 40.0, 400.0)


@njit(nogil=True, error_model="numpy")
def call_equations(count, p, signals, t, weights, q, v, a, lam, torques, ws):
    """So many evaluations; below likewise."""
    for _ in range(count):
        equations(p, signals, t, weights, q, v, a, lam, torques, ws)


@njit(nogil=True, error_model="numpy")
def call_solve(count, p, ws, x, mu):
    for _ in range(count):
        for j in range(x.size):
            ws.x[j] = x[j]
        for r in range(mu.size):
            ws.mu[r] = mu[r]
        solve_system(p, ws, ws.x, ws.mu)


@njit(nogil=True, error_model="numpy")
def call_norm(count, p, ws, x):
    # Every entry depends on the last result: else parts of the sum would be done once for all calls.
    for _ in range(count):
        size = 1e-30 * mass_norm(p, ws, x)
        for j in range(x.size):
            x[j] += size


@njit(nogil=True, error_model="numpy")
def call_vectors(count, q, v, a, lam, ws):
    """Placing, right-hand side and changes, as loops over whole vectors."""
    for _ in range(count):
        for j in range(q.size):
            ws.q[j] = q[j] + 1e-8 * a[j]
            ws.v[j] = v[j] + 1e-4 * a[j]
        for j in range(q.size):
            ws.x[j] = -ws.f[j]
        for r in range(lam.size):
            ws.mu[r] = -ws.rows[r]
        for j in range(q.size):
            ws.f[j] += 1e-12 * ws.x[j]
        for r in range(lam.size):
            ws.rows[r] += 1e-12 * ws.mu[r]


@njit(nogil=True, error_model="numpy")
def call_factor(count, p, b, q, ws):
    for _ in range(count):
        factor_bodies(p, b, q, ws)


@njit(nogil=True, error_model="numpy")
def call_orient(count, p, q, ws, part):
    for _ in range(count):
        orient(p, q, ws, part)


@njit(nogil=True, error_model="numpy")
def call_checks(count, p, signals, t, q, v, ws):
    """Energy and constraints of an accepted step."""
    total = 0.0
    for _ in range(count):
        constraint_values(p, signals, t, q, v, ws.scratch, ws.rows, ws.mu)
        kinetic, strain = system_energy(p, q, v, ws.scratch)
        total += kinetic + strain
    return total


@njit(fastmath=FAST_MATH, error_model="numpy")
def matrix_times_vector(count, matrix, x, y):
    """Dense product by plain loops, compiled as the kernels are."""
    for _ in range(count):
        for i in range(y.size):
            total = 0.0
            for j in range(x.size):
                total += matrix[i, j] * x[j]
            y[i] = total
        x[0] += 1e-12 * y[0]


@dataclass(frozen=True)
class Part:
    """A part of a step: microseconds a call, calls an iteration, operations a call where they are counted."""

    name: str
    microseconds: float
    calls: float
    operations: int | None = None

    @property
    def each(self) -> float:
        """Microseconds an iteration."""
        return self.microseconds * self.calls

    @property
    def rate(self) -> float | None:
        """Operations a nanosecond: GFlop/s."""
        return None if self.operations is None else 1e-3 * self.operations / self.microseconds


def plan(duration: float = 0.7) -> TrackingTask:
    """The study of RAParM-I."""
    model = pf.load("raparm_i")
    return pf.plan(model.mechanism, model.path("square"), duration=duration)


def half_way(task: TrackingTask, tolerance: float, attempts: int = 300) -> NativeRun:
    """A run that stands in the middle of things, factored for the step it takes there."""
    torques, times = task.torques(MODE), task.motion.t
    signals, knots = pack_signals(task.mechanism, torques.signals, float(times[-1]))
    stops = np.sort(np.concatenate([torques.knots, knots]))
    problem = make_problem(task.system, signals, task.start, times, stops)
    run = prepare(problem, IntegrationOptions(method=METHOD, tolerance=tolerance))
    run.start()
    run.march(attempts)
    return run


def parts(run: NativeRun, solution: Solution, repeats: int, calls: int = CALLS) -> list[Part]:
    """Times of all parts at the state of a run, and how often they are called in a solution."""
    p, state, ws = run.problem.system.packed, run.state, run.workspace
    counted, signals = operations.iteration(p), run.problem.signals
    t, part = float(state.clock[TIME]), run.controls.dependent_part
    b = abs(float(state.clock[FACTOR_B])) if state.clock[FACTOR_B] > 0.0 else 1e-8
    q, v, a, lam = state.q.copy(), state.v.copy(), state.stage_a[1, 0].copy(), state.stage_lam[1, 0].copy()
    x, mu = np.ones(q.size) * 1e-3, np.ones(lam.size) * 1e-3
    iterations, steps = solution.newton_iterations, solution.steps + solution.rejected
    stages = steps * (run.scheme.c.size - 1)
    # The filter of the error solves twice and takes two norms a step.
    again = 2.0 * steps / iterations

    def timed(call: Callable[..., Any], *arguments: Any) -> float:
        return 1e6 * least_time(lambda: call(calls, *arguments), repeats) / calls

    factor = timed(call_factor, p, b, q, ws)
    orient_time = timed(call_orient, p, q, ws, part)
    return [
        Part(
            "equations", timed(call_equations, p, signals, t, WEIGHTS, q, v, a, lam, state.torques, ws), 1.0,
            counted["equations"],
        ),
        Part("solve", timed(call_solve, p, ws, x, mu), 1.0, counted["solve"]),
        Part("norm", timed(call_norm, p, ws, x), 1.0, counted["norm"]),
        Part("vectors", timed(call_vectors, q, v, a, lam, ws), 1.0 + stages / iterations / 3.0, counted["vectors"]),
        Part("solve and norm of the filter", timed(call_solve, p, ws, x, mu) + timed(call_norm, p, ws, x), again),
        Part("orient", orient_time, steps / iterations),
        Part("factor bodies", factor, solution.factorisations / iterations),
        Part("energy and constraints", timed(call_checks, p, signals, t, q, v, ws), solution.steps / iterations),
    ]  # fmt: skip


def dense_rates(repeats: int) -> list[dict[str, float]]:
    """GFlop/s of dense products by plain loops and by BLAS: matrix times vector, matrix times matrix."""
    rng, out = np.random.default_rng(1), []
    for n in SIZES:
        matrix, other, x, y = rng.random((n, n)), rng.random((n, n)), rng.random(n), np.zeros(n)
        count = max(10, 2_000_000 // n**2)
        loops = least_time(lambda c=count, m=matrix, x=x, y=y: matrix_times_vector(c, m, x, y), repeats) / count
        vector = _blas_time(matrix, x, y, count, repeats)
        product = np.empty((n, n))
        square = _blas_time(matrix, other, product, max(5, count // n), repeats)
        out.append({"n": n, "loops": _rate(2 * n**2, loops), "dgemv": _rate(2 * n**2, vector),
                    "dgemm": _rate(2 * n**3, square)})  # fmt: skip
    return out


def _blas_time(a: np.ndarray, b: np.ndarray, out: np.ndarray, count: int, repeats: int) -> float:
    """Of a product through NumPy, whose call is part of it [s]."""

    def call() -> None:
        for _ in range(count):
            np.dot(a, b, out=out)

    return least_time(call, repeats) / count


def _rate(count: int, seconds: float) -> float:
    return 1e-9 * count / seconds


def report(geometry: Geometry, tolerance: float, repeats: int) -> dict[str, Any]:
    """Measure and print one geometry."""
    task = plan()
    task = task.remodelled(task.mechanism.with_geometry(geometry))
    options = IntegrationOptions(method=METHOD, tolerance=tolerance)
    task.simulate(MODE, options=options)
    runs = [task.simulate(MODE, options=options).solution for _ in range(repeats)]
    solution = min(runs, key=lambda one: one.wall_time)
    seconds = solution.wall_time
    whole = 1e6 * seconds / solution.newton_iterations
    found = parts(half_way(task, tolerance), solution, repeats)
    rest = whole - sum(part.each for part in found)
    rows = [
        [part.name, f"{part.microseconds:.2f}", f"{part.calls:.2f}", f"{part.each:.2f}", f"{part.each / whole:.0%}",
         "" if part.operations is None else str(part.operations), "" if part.rate is None else f"{part.rate:.2f}"]
        for part in found
    ]  # fmt: skip
    rows.append(["the rest", "", "", f"{rest:.2f}", f"{rest / whole:.0%}", "", ""])
    inside = [part for part in found if part.operations is not None]
    count, spent = sum(part.operations or 0 for part in inside), sum(part.microseconds for part in inside)
    rows.append(["one iteration alone", f"{spent:.2f}", "", "", "", str(count), f"{1e-3 * count / spent:.2f}"])
    rows.append(["the run over its iterations", "", "", f"{whole:.2f}", "100%", "", ""])
    print(f"{geometry.value}, tolerance {tolerance:g} m: {seconds:.3f} s, {solution.steps} steps, "
          f"{solution.newton_iterations} iterations, {solution.factorisations} factors")  # fmt: skip
    print(table(["", "us/call", "calls/it.", "us/it.", "share", "operations", "GFlop/s"], rows))
    return {
        "tolerance": tolerance, "seconds": seconds, "steps": solution.steps, "rejected": solution.rejected,
        "iterations": solution.newton_iterations, "factorisations": solution.factorisations,
        "microseconds_per_iteration": whole, "microseconds_of_an_iteration_alone": spent, "operations": count,
        "gflops": 1e-3 * count / spent, "rest": rest,
        "parts": [{"name": part.name, "microseconds": part.microseconds, "calls": part.calls,
                   "operations": part.operations} for part in found],
    }  # fmt: skip


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("--tolerance", type=float, default=TOLERANCE, help="[m]")
    parser.add_argument("--repeats", type=int, default=REPEATS)
    given = parser.parse_args()
    single_thread()
    values: dict[str, Any] = {"mode": MODE, "goal_microseconds": GOAL, "geometry": {}}
    for geometry in Geometry:
        compile_kernels(geometry)
        values["geometry"][geometry.value] = report(geometry, given.tolerance, given.repeats)
    values["dense"] = dense_rates(given.repeats)
    print("dense products on this machine [GFlop/s], BLAS called through NumPy")
    rows = [[f"{row['n']} x {row['n']}", *(f"{row[name]:.2f}" for name in ("loops", "dgemv", "dgemm"))]
            for row in values["dense"]]  # fmt: skip
    print(table(["", "loops, A x", "dgemv, A x", "dgemm, A B"], rows))
    write_json("iteration", values, given.folder)


if __name__ == "__main__":
    main()
