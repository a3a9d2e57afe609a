"""How does a step grow with the mechanism? Rows of rigid four-bars, and hanging chains with torsional springs.

    python benchmarks/scaling.py [--chain] [n ...]

For each n: time to build mechanism and system, and to close and start it; of a step and of one Newton iteration over
the same number of attempted steps, kernels warm, the fastest of a few repeats; memory of all arrays of a run. The last
column is the growth of a step's time with twice the n. The goal: at most 2.2.
"""

from __future__ import annotations

import sys
import time

import numpy as np

from paraflex.dynamics import State, System, build_system, constant_signals, pack_signals, start_state
from paraflex.integrators import IntegrationOptions, make_problem
from paraflex.integrators.native import NativeRun, prepare
from paraflex.kernel.run_state import ITERATIONS, REJECTED, STEPS
from paraflex.mechanism import Start, chain_of_segments, four_bars_in_a_row

NUMBERS = (10, 20, 50, 100, 200, 500, 1000)
STEPS_TIMED, REPEATS = 200, 5
# Away from the first position in line, at 0.71 s.
DURATION = 0.5
MOVING = Start(angular={"crank0": -1.0})


def main() -> None:
    chain = "--chain" in sys.argv
    numbers = [int(text) for text in sys.argv[1:] if text.isdigit()] or NUMBERS
    make = chain_of_segments if chain else four_bars_in_a_row
    heading = ("n", "rows", "build [s]", "start [s]", "us/step", "us/iter.", "iter./step", "MB", "ratio")
    print("".join(f"{text:>11}" for text in heading))
    before = None
    for n in numbers:
        began = time.perf_counter()
        mechanism = make(n)
        system = build_system(mechanism)
        built = time.perf_counter()
        start = start_state(system, MOVING if not chain else Start(), mechanism.assembly())
        started = time.perf_counter()
        step, iteration, run = fastest(system, start)
        ratio = f"{(step / before[1]) ** (1.0 / np.log2(n / before[0])):11.2f}" if before else ""
        before = (n, step)
        seconds = f"{built - began:11.3f}{started - built:11.3f}{1e6 * step:11.1f}{1e6 * iteration:11.1f}"
        print(f"{n:11d}{system.m:11d}{seconds}{step / iteration:11.2f}{megabytes(run):11.2f}{ratio}", flush=True)


def fastest(system: System, start: State) -> tuple[float, float, NativeRun]:
    """Seconds a step and an iteration, of the fastest repeat."""
    signals, _ = pack_signals(system.mechanism, constant_signals([], DURATION), DURATION)
    best = None
    for _ in range(REPEATS):
        run = prepare(make_problem(system, signals, start, np.array([DURATION])), IntegrationOptions(tolerance=1e-5))
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
