"""How does a step grow with the mechanism? Rows of rigid four-bars, and hanging chains with torsional springs.

    python benchmarks/scaling.py [--write] [--plans] [n ...]

For each n: time to build mechanism and system, and to close and start it; of a step and of one Newton iteration over
the same number of attempted steps, kernels warm, the fastest of a few repeats; memory of all arrays of a run. The last
column is the growth of a step's time with twice the n. The goal: at most 2.2. By TR-BDF2.

With --plans: processor time of plans of a tenth of a second for rows of n four-bars and chains of n links with gears,
also by the instants at which loops are closed, with the largest memory of all Python and NumPy objects of a plan; and
a row of 5,000 four-bars without a path.
"""

from __future__ import annotations

import resource
import time
import tracemalloc
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from common import command_line, table, write_json

from paraflex.dynamics import State, System, build_system, constant_signals, pack_signals, start_state
from paraflex.integrators import IntegrationOptions, make_problem
from paraflex.integrators.native import NativeRun, prepare
from paraflex.kernel.indices import ITERATIONS, REJECTED, STEPS
from paraflex.linear import linearise
from paraflex.mechanism import (
    Assembly,
    EndEffector,
    Gear,
    Mechanism,
    Motor,
    PointRef,
    Start,
    chain_of_segments,
    four_bars_in_a_row,
)
from paraflex.motion import simulate_motion
from paraflex.paths import path_follower
from paraflex.paths.paths import Line
from paraflex.tracking import plan_tracking

NUMBERS = (10, 20, 50, 100, 200, 500, 1000)
STEPS_TIMED, REPEATS = 200, 5
# Plans: the n, duration [s] and length [m] of the path, and loops of the row without a path.
PLANNED, DURATION_PLANNED, MOVE, LARGE = (10, 100, 1000), 0.1, 0.002, 5000
OPTIONS = IntegrationOptions(method="tr-bdf2", tolerance=1e-5)
# Away from the first position in line, at 0.71 s.
DURATION = 0.5
MOVING = Start(angular={"crank0": -1.0})


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("n", type=int, nargs="*", default=list(NUMBERS))
    parser.add_argument("--plans", action="store_true", help="plans and 10,001 bodies, in place of steps")
    given = parser.parse_args()
    if given.plans:
        write_json("plans", plans([n for n in given.n if n in PLANNED] or given.n), given.folder)
        return
    found = {
        "four_bars": measured(four_bars_in_a_row, MOVING, given.n),
        "chains": measured(chain_of_segments, Start(), given.n),
    }
    for name, rows in found.items():
        print(f"\n{name}")
        cells = [["" if value is None else f"{value:.4g}" for value in row.values()] for row in rows]
        print(table(list(rows[0]), cells))
    write_json("scaling", found, given.folder)


def measured(make: Callable[[int], Mechanism], start: Start, numbers: Sequence[int]) -> list[dict[str, Any]]:
    """Times in seconds of each n, and how much longer a step takes for twice the n."""
    rows: list[dict[str, Any]] = []
    for n in numbers:
        began = time.perf_counter()
        mechanism = make(n)
        system = build_system(mechanism)
        built = time.perf_counter()
        state = start_state(system, start, mechanism.assembly())
        started = time.perf_counter()
        step, iteration, run = fastest(system, state)
        before = rows[-1] if rows else None
        rows.append(
            {
                "n": n, "rows": system.m, "build": built - began, "start": started - built, "step": step,
                "iteration": iteration, "iterations_a_step": step / iteration, "megabytes": megabytes(run),
                "ratio": (step / before["step"]) ** (1.0 / np.log2(n / before["n"])) if before else None,
            }
        )  # fmt: skip
    return rows


def fastest(system: System, start: State) -> tuple[float, float, NativeRun]:
    """Seconds a step and an iteration, of the fastest repeat."""
    signals, _ = pack_signals(system.mechanism, constant_signals([], DURATION), DURATION)
    best = None
    for _ in range(REPEATS):
        run = prepare(make_problem(system, signals, start, np.array([DURATION])), OPTIONS)
        run.start()
        run.march(10)
        counts = run.state.counts
        steps, iterations = counts[STEPS] + counts[REJECTED], counts[ITERATIONS]
        began = time.perf_counter()
        run.march(STEPS_TIMED)
        taken = time.perf_counter() - began
        steps, iterations = counts[STEPS] + counts[REJECTED] - steps, counts[ITERATIONS] - iterations
        if best is None or taken / steps < best[0]:
            best = (taken / steps, taken / iterations, run)
    assert best is not None
    return best


# --- Plans ------------------------------------------------------------------------------------------------------------


def plans(numbers: Sequence[int]) -> dict[str, Any]:
    """Plans of rows and chains of each n, and a row of 10,001 bodies without a path."""
    found: dict[str, Any] = {}
    for name, make in (("four_bars", driven_row), ("chains", geared_chain)):
        planned(make(4))
        found[name] = [{"n": n, **planned(make(n))} for n in numbers]
        print(f"\n{name}")
        cells = [[f"{value:.4g}" for value in row.values()] for row in found[name]]
        print(table(list(found[name][0]), cells))
    found["large"] = without_path(LARGE)
    print(found["large"])
    return found


def planned(mechanism: Mechanism) -> dict[str, float]:
    """Seconds of processor time, and megabytes, of a plan along a line that the end-effector takes DURATION_PLANNED."""
    closure = path_follower(mechanism, Line((0.0, 0.0), (1.0, 0.0), 1.0), 1.0)
    start = np.append(closure.closure.task(closure.assembled), 0.0)[:2]
    line = Line(tuple(start), tuple(start - (MOVE, 0.0)), 4.0 * MOVE / DURATION_PLANNED**2)
    began = time.process_time()
    task = plan_tracking(mechanism, line, samples=11, warning=False)
    taken = time.process_time() - began
    tracemalloc.start()
    plan_tracking(mechanism, line, samples=11, warning=False)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    instants = task.plan.fine.motion.t.size + round(1e3 * DURATION_PLANNED)
    return {
        "bodies": len(mechanism.bodies), "coordinates": task.motion.system.n, "plan": taken,
        "instant": taken / instants, "megabytes": peak / 1e6,
    }  # fmt: skip


def driven_row(n: int) -> Mechanism:
    last = EndEffector(PointRef(f"crank{n}", "B"), ("x",))
    return replace(four_bars_in_a_row(n), motors=(Motor("tau", "A0"),), end_effector=last)


def geared_chain(n: int) -> Mechanism:
    """Equal angles between links, by gears: the first joint and the second have motors."""
    return replace(
        chain_of_segments(n),
        gears=tuple(Gear(f"G{i}", f"J{i - 1}", f"J{i}", 1.0) for i in range(3, n + 1)),
        motors=(Motor("first", "J1"), Motor("second", "J2")),
        assemblies=(Assembly("curved", {f"segment{i}": i / n for i in range(1, n + 1)}),),
        end_effector=EndEffector(PointRef(f"segment{n}", "Q"), ("x", "y")),
    )


def without_path(n: int) -> dict[str, float]:
    """Seconds of processor time to build a row of n four-bars, to run it, and of a linear model; resident megabytes."""
    times = [time.process_time()]
    mechanism = replace(four_bars_in_a_row(n), motors=(Motor("tau", "A0"),))
    build_system(mechanism)
    times.append(time.process_time())
    run = simulate_motion(mechanism, 0.01, samples=3, start=MOVING, options=OPTIONS, warning=False)
    times.append(time.process_time())
    linearise(mechanism)
    times.append(time.process_time())
    built, ran, model = np.diff(times).tolist()
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    return {
        "bodies": len(mechanism.bodies), "build": built, "run": ran, "steps": run.solution.steps, "model": model,
        "megabytes": most,
    }  # fmt: skip


def megabytes(run: NativeRun) -> float:
    """Of all arrays of a run."""
    parts = (run.problem.system.packed, run.workspace, run.slow, run.state, run.samples)
    return sum(array.nbytes for part in parts for array in part if isinstance(array, np.ndarray)) / 1e6


if __name__ == "__main__":
    main()
