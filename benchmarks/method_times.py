"""Time, work and error of every method on RAParM-I, ++++: what `paraflex compare-methods` tells, for the documentation.

    python benchmarks/method_times.py [--limit S] [--write] [METHOD ...]

Runs beyond the limit are stopped, tighter ones of that method not begun. Takes ten minutes.
"""

from __future__ import annotations

from common import command_line, single_thread, table, write_json

import paraflex as pf
from paraflex.compilation import compile_kernels
from paraflex.integrators import METHODS
from paraflex.studies import compare_methods, tracking_case
from paraflex.studies.compare import ComparisonOptions

TOLERANCES = (1e-3, 5e-4, 3e-4, 1e-4, 3e-5, 1e-5)


def main() -> None:
    parser = command_line(__doc__)
    # What runs at 1 / frequency of the fastest mode takes minutes.
    implicit = [name for name, method in METHODS.items() if not method.explicit]
    parser.add_argument("method", nargs="*", default=implicit)
    parser.add_argument("--limit", type=float, default=15.0, help="of a run [s]")
    given = parser.parse_args()
    single_thread()
    compile_kernels()
    model = pf.load("raparm_i")
    case = tracking_case(pf.plan(model.mechanism, model.path("square"), duration=0.7), "++++")
    options = ComparisonOptions(tolerances=TOLERANCES, limit=given.limit, repetitions=3)
    comparison = compare_methods(case, given.method, options=options)
    rows = [
        [run.method, f"{run.tolerance:g}", run.status, *(("", "") if run.error is None else
         (f"{run.error:.1e}", f"{run.wall_time:.3f}"))]
        for run in comparison.measurements
    ]  # fmt: skip
    print(table(["method", "tolerance [m]", "status", "error [m]", "time [s]"], rows))
    values = comparison.to_dict()
    del values["machine"], values["versions"]
    write_json("method_times", {"limit": given.limit, **values}, given.folder)


if __name__ == "__main__":
    main()
