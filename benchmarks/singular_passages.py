"""Runs through singular positions, by hundreds: how many fail, and how their errors compare with the tolerance.

    python benchmarks/singular_passages.py [--runs N] [--seed N] [--target CPU ...] [--write] [method ...]

Four-bars in a row (one to three loops), released upright at speeds from 1 to 3 rad/s, pass a position with all links
in line each half turn, some ten in 10 s. Tolerances are log-uniform, each method's in a range of its own that keeps a
run below a few seconds. Compared is where the first crank's pin is at the end with what the equation of one coordinate
says, integrated to 1e-13. Each target is a processor (`NUMBA_CPU_NAME`) that kernels are compiled for, in a cache of
its own; rounding differs between them, and with it where steps fall. By default that of this machine.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from dataclasses import asdict, dataclass
from functools import cache
from typing import Any

import numpy as np
from common import command_line, table, write_json
from scipy.integrate import solve_ivp

from paraflex.dynamics import System, build_system, start_state
from paraflex.errors import NumericalError
from paraflex.integrators import IntegrationOptions
from paraflex.mechanism import Start, four_bars_in_a_row
from paraflex.motion import simulate_motion

DURATION, RUNS, SEED = 10.0, 150, 1
LOOPS, SPEEDS = (1, 2, 3), (1.0, 3.0)
# Powers of ten of the tolerance [m].
RANGES = {
    "tr-bdf2": (-5.5, -2.0),
    "trapezoidal": (-5.0, -2.0),
    "esdirk3": (-6.0, -2.0),
    "esdirk4": (-9.3, -2.0),
    "esdirk5": (-9.3, -2.0),
    "hht-alpha": (-4.0, -2.0),
    "generalised-alpha": (-4.0, -2.0),
}
METHODS = ("tr-bdf2", "trapezoidal", "esdirk3", "esdirk4", "esdirk5")


@dataclass(frozen=True)
class Passage:
    """A run: what it was of, and its error over the tolerance, or why there is none."""

    method: str
    loops: int
    speed: float
    tolerance: float
    ratio: float | None
    steps: int
    failure: str = ""


def crank_angle(loops: int, speed: float, duration: float) -> float:
    """Where the cranks are, from J phi'' = -W cos phi: cranks turn about their pins, couplers move with them."""
    J, W = (loops + 1) / 3 + loops, 9.81 * ((loops + 1) / 2 + loops)
    run = solve_ivp(
        lambda _, y: [y[1], -W * np.cos(y[0]) / J], (0.0, duration), [np.pi / 2, -speed],
        method="DOP853", rtol=1e-13, atol=1e-13,
    )  # fmt: skip
    return float(run.y[0, -1])


@cache
def row(loops: int) -> System:
    """The mechanism."""
    return build_system(four_bars_in_a_row(loops))


def passage(method: str, loops: int, speed: float, tolerance: float, duration: float = DURATION) -> Passage:
    """One run."""
    system = row(loops)
    start = start_state(system, Start(angular={"crank0": -speed}), system.mechanism.assembly())
    options = IntegrationOptions(method=method, tolerance=tolerance)
    try:
        solution = simulate_motion(system.mechanism, duration, samples=2, start=start, options=options).solution
    except NumericalError as error:
        return Passage(method, loops, speed, tolerance, None, 0, str(error))
    turned = solution.q[-1, system.body("crank0").angle] - crank_angle(loops, speed, duration)
    return Passage(method, loops, speed, tolerance, 2.0 * abs(np.sin(0.5 * turned)) / tolerance, solution.steps)


def search(method: str, runs: int, seed: int) -> list[Passage]:
    """Runs of a method; the same for the same seed."""
    rng = np.random.default_rng([seed, list(RANGES).index(method)])
    found = []
    for _ in range(runs):
        loops, speed = int(rng.choice(LOOPS)), float(rng.uniform(*SPEEDS))
        found.append(passage(method, loops, speed, float(10.0 ** rng.uniform(*RANGES[method]))))
    return found


def search_for(target: str, methods: list[str], runs: int, seed: int) -> list[Passage]:
    """The same in a process of its own, by kernels compiled for another processor."""
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "NUMBA_CPU_NAME": target, "NUMBA_CACHE_DIR": folder}
        environment.pop("NUMBA_CPU_FEATURES", None)
        command = [sys.executable, __file__, "--raw", "--runs", str(runs), "--seed", str(seed), *methods]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    return [Passage(**entry) for entry in json.loads(done.stdout)]


def summary(target: str, method: str, runs: list[Passage]) -> dict[str, Any]:
    """What a table tells of a method's runs."""
    ratios = np.array([run.ratio for run in runs if run.ratio is not None])
    failed = sum(run.ratio is None for run in runs)
    spread = {"median": np.median(ratios), "p90": np.quantile(ratios, 0.9), "most": ratios.max()} if ratios.size else {}
    counts = {"target": target, "method": method, "runs": len(runs), "failed": failed}
    return {**counts, "over_10": int(np.sum(ratios > 10.0)), **{key: float(value) for key, value in spread.items()}}


def _cell(value: object) -> str:
    return f"{value:.2g}" if isinstance(value, float) else str(value)


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("method", nargs="*", default=list(METHODS), help=f"of {', '.join(RANGES)}")
    parser.add_argument("--runs", type=int, default=RUNS, help="of each method")
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--target", nargs="*", help="processors, say generic haswell znver4")
    parser.add_argument("--raw", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.raw:
        found = [run for method in given.method for run in search(method, given.runs, given.seed)]
        print(json.dumps([asdict(run) for run in found]))
        return
    summaries, runs = [], []
    for target in given.target or ["this machine"]:
        found = search_for(target, given.method, given.runs, given.seed) if given.target else None
        for method in given.method:
            mine = search(method, given.runs, given.seed) if found is None else [r for r in found if r.method == method]
            summaries.append(summary(target, method, mine))
            runs += mine
    if len(given.target or []) > 1:
        summaries += [summary("all", method, [run for run in runs if run.method == method]) for method in given.method]
    failures = [run for run in runs if run.ratio is None or run.ratio > 10.0]
    heads = ("target", "method", "runs", "failed", "over_10", "median", "p90", "most")
    cells = [[_cell(line.get(key, "")) for key in heads] for line in summaries]
    print(
        table(
            ["kernels for", "method", "runs", "failed", "over 10 x", "median error / tolerance", "9 in 10", "most"],
            cells,
        )
    )
    for run in failures:
        print(run)
    write_json("singular_passages", {"rows": summaries, "failures": [asdict(run) for run in failures]}, given.folder)


if __name__ == "__main__":
    main()
