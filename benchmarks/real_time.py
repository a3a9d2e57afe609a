"""How fast is one run? Mode ++++ of RAParM-I, all 104 coordinates, kernels warm, one core.

    python benchmarks/real_time.py [--write]

By the method that the paper's study states and by the default one, for each tolerance: wall time of the integration,
the real time it covers as a ratio, and the error of the tracking error against a converged run of the same script.
The goal: within 1 % at three times real time or better.
"""

from __future__ import annotations

import statistics

from common import command_line, single_thread, table, write_json

import paraflex as pf
from paraflex.integrators import IntegrationOptions

MODE, DURATION, REPEATS = "++++", 0.7, 5
METHODS, CONVERGED = ("tr-bdf2", "esdirk5"), {"method": "esdirk5", "tolerance": 1e-7}
TOLERANCES = (3e-4, 1e-4, 5e-5, 2e-5, 1e-5)


def main() -> None:
    given = command_line(__doc__).parse_args()
    single_thread()
    model = pf.load("raparm_i")
    task = pf.plan(model.mechanism, model.path("square"), duration=DURATION)

    def run(**options):
        return task.simulate(MODE, options=IntegrationOptions(**options))

    def tracking(result) -> float:
        return float(pf.tracking_dataset([result])["tracking_rms"][0])

    reference = tracking(run(**CONVERGED))
    rows = []
    for method in METHODS:
        for tolerance in TOLERANCES:
            runs = [run(method=method, tolerance=tolerance) for _ in range(REPEATS)]
            wall = statistics.median(r.solution.wall_time for r in runs)
            rows.append(
                {
                    "method": method,
                    "tolerance": tolerance,
                    "relative_error": abs(tracking(runs[0]) / reference - 1.0),
                    "steps": runs[0].solution.steps,
                    "newton_iterations": runs[0].solution.newton_iterations,
                    "wall_time": wall,
                    "times_real_time": DURATION / wall,
                }
            )
    print(f"converged tracking error {reference:.6e} m")
    cells = [
        [row["method"], f"{row['tolerance']:.0e}", f"{row['relative_error']:.2%}", str(row["steps"]),
         str(row["newton_iterations"]), f"{row['wall_time']:.3f}", f"{row['times_real_time']:.1f} x"]
        for row in rows
    ]  # fmt: skip
    heading = f"wall, median of {REPEATS} [s]"
    print(table(["method", "tolerance [m]", "error", "steps", "Newton", heading, "real time"], cells))
    write_json("real_time", {"reference": reference, "rows": rows}, given.folder)


if __name__ == "__main__":
    main()
