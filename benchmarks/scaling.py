"""How does a step grow with the mechanism? Rows of rigid four-bars, and hanging chains with torsional springs.

    python benchmarks/scaling.py [--write] [n ...]

For each n: time to build mechanism and system, and to close and start it; of a step and of one Newton iteration over
the same number of attempted steps, kernels warm, the fastest of a few repeats; memory of all arrays of a run. The last
column is the growth of a step's time with twice the n. The goal: at most 2.2. By TR-BDF2.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from common import command_line, table, write_json

from paraflex.dynamics import State, System, build_system, constant_signals, pack_signals, start_state
from paraflex.integrators import IntegrationOptions, make_problem
from paraflex.integrators.native import NativeRun, prepare
from paraflex.kernel.indices import ITERATIONS, REJECTED, STEPS
from paraflex.mechanism import Mechanism, Start, chain_of_segments, four_bars_in_a_row

NUMBERS = (10, 20, 50, 100, 200, 500, 1000)
STEPS_TIMED, REPEATS = 200, 5
OPTIONS = IntegrationOptions(method="tr-bdf2", tolerance=1e-5)
# Away from the first position in line, at 0.71 s.
DURATION = 0.5
MOVING = Start(angular={"crank0": -1.0})


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("n", type=int, nargs="*", default=list(NUMBERS))
    given = parser.parse_args()
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


def megabytes(run: NativeRun) -> float:
    """Of all arrays of a run."""
    parts = (run.problem.system.packed, run.workspace, run.slow, run.state, run.samples)
    return sum(array.nbytes for part in parts for array in part if isinstance(array, np.ndarray)) / 1e6


if __name__ == "__main__":
    main()
