"""How fast is one run? Mode ++++ of RAParM-I, all 104 coordinates, kernels warm, one core.

    python benchmarks/real_time.py

For each tolerance: wall time of the integration, the real time it covers as a ratio, and the error of the tracking
error against a converged run of the same script. The goal: within 1 % at three times real time or better.
"""

from __future__ import annotations

import json
import statistics
import sys

import paraflex as pf
from paraflex.integrators import IntegrationOptions

MODE, CONVERGED, REPEATS = "++++", 2e-6, 5
TOLERANCES = (3e-4, 1e-4, 5e-5, 2e-5, 1e-5)


def main() -> None:
    model = pf.load("raparm_i")
    task = pf.plan_tracking(model.mechanism, model.path("square"), duration=0.7)

    def run(tolerance: float):
        return task.simulate(MODE, options=IntegrationOptions(tolerance=tolerance))

    reference = float(pf.tracking_dataset([run(CONVERGED)])["tracking_rms"][0])
    rows = []
    print(f"converged tracking error {reference:.6e} m (tolerance {CONVERGED:g} m)")
    heading = f"wall, median of {REPEATS}"
    print(f"{'tolerance':>10} {'error':>9} {'steps':>7} {'Newton':>7} {heading:>20} {'real time':>10}")
    for tolerance in TOLERANCES:
        runs = [run(tolerance) for _ in range(REPEATS)]
        wall = statistics.median(r.solution.wall_time for r in runs)
        tracking = float(pf.tracking_dataset(runs[:1])["tracking_rms"][0])
        row = {
            "tolerance": tolerance,
            "relative_error": abs(tracking / reference - 1.0),
            "steps": runs[0].solution.steps,
            "newton_iterations": runs[0].solution.newton_iterations,
            "wall_time": wall,
            "times_real_time": 0.7 / wall,
            "microseconds_per_iteration": 1e6 * wall / runs[0].solution.newton_iterations,
        }
        rows.append(row)
        print(
            f"{tolerance:10.0e} {row['relative_error']:9.2%} {row['steps']:7d} {row['newton_iterations']:7d} "
            f"{wall:18.3f} s {row['times_real_time']:8.1f} x"
        )
    if "--json" in sys.argv:
        print(json.dumps({"reference": reference, "rows": rows}, indent=2))


if __name__ == "__main__":
    main()
