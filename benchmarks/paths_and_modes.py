"""Which motors do best, path by path? RAParM-I on its three paths in all nine modes, and the paper's Table 3.

    python benchmarks/paths_and_modes.py [--path NAME ...] [--mode SIGNS ...] [--skip-exudyn] [--write]

Every mode of every path runs with second-order geometry (pinned reference, separate curvature), with the paper's
linear beams (cantilever reference, shared curvature), and as geometrically exact beams in Exudyn: same torques, same
start. Told are the tracking errors during the motion and over the whole run of 0.7 s. After the motion's end the motors
give no torque and the mechanism coasts: where the motion is short the whole run tells mostly how far it drifts. How
converged the models are stands in `model_agreement.py`. Takes ten minutes, most of them Exudyn's.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from common import command_line, table, write_json
from models import PAPER, SECOND_ORDER, tracking_errors

import paraflex as pf
from paraflex.engines.exudyn import ExudynOptions, simulate_exudyn
from paraflex.errors import IntegrationError
from paraflex.integrators import IntegrationOptions
from paraflex.results.record import Record
from paraflex.tracking import TrackingRun, TrackingTask

PATHS = ("square", "line", "circle")
# Of the paper's study; the paths themselves take 0.53, 0.13 and 0.24 s.
DURATION = 0.7
OPTIONS = IntegrationOptions(method="esdirk5", tolerance=2e-5)
EXACT = ExudynOptions(step=2.5e-5, refinement=2)
# The paper's mean-square deviations [m], in its order; its signs are lost in print.
TABLE_3 = {"+-+-": 0.0575, "-+-+": 0.0075, "+--+": 0.0118, "+++-": 3.3624e-4, "++-+": 7.9297e-4, "++++": 6.0885e-4}


def run_models(task: TrackingTask, mode: str, *, exudyn: bool) -> dict[str, dict[str, float] | None]:
    """Tracking errors by model [m]; None where a model does not reach the end."""
    runs: dict[str, Callable[[], TrackingRun | Record]] = {
        "second_order": lambda: SECOND_ORDER.task(task).simulate(mode, options=OPTIONS),
        "linear": lambda: PAPER.task(task).simulate(mode, options=OPTIONS),
    }
    if exudyn:
        runs["exact"] = lambda: simulate_exudyn(task, mode, EXACT)
    found: dict[str, dict[str, float] | None] = {}
    for name, run in runs.items():
        try:
            found[name] = tracking_errors(run(), task.path.duration)
        except IntegrationError as error:
            print(f"{name}: {error}")
            found[name] = None
    return found


def measure(paths: list[str], modes: list[str] | None, *, exudyn: bool) -> list[dict[str, Any]]:
    """A row for every path and mode."""
    model, rows = pf.load("raparm_i"), []
    for path in paths:
        task = pf.plan(model.mechanism, model.path(path), duration=DURATION)
        for mode in model.mechanism.modes:
            if modes and mode.name not in modes:
                continue
            began = time.perf_counter()
            errors = run_models(task, mode.name, exudyn=exudyn)
            peak = float(abs(task.torques(mode).evaluate(task.motion.t)).max())
            rows.append(
                {"path": path, "motion_end": task.path.duration, "mode": mode.name, "motors": len(mode.motors),
                 "peak_torque": peak, **errors}
            )  # fmt: skip
            print(f"{path} {mode.name} {time.perf_counter() - began:.1f} s", flush=True)
    return rows


def print_rows(rows: list[dict[str, Any]]) -> None:
    """The table [mm]."""

    def millimetres(errors: dict[str, float] | None) -> list[str]:
        return ["-", "-"] if errors is None else [f"{1e3 * errors[part]:.3f}" for part in ("motion", "run")]

    models = [name for name in ("second_order", "exact", "linear") if name in rows[0]]
    headings = ["path", "mode", *(f"{name} {part}" for name in models for part in ("motion", "run"))]
    cells = [[row["path"], row["mode"], *(cell for name in models for cell in millimetres(row[name]))] for row in rows]
    print(table(headings, cells))


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("--path", action="append", choices=PATHS, help="all by default")
    parser.add_argument("--mode", action="append", metavar="SIGNS", help="all nine by default")
    parser.add_argument("--skip-exudyn", action="store_true", help="without exact beams")
    given = parser.parse_args()
    rows = measure(given.path or list(PATHS), given.mode, exudyn=not given.skip_exudyn)
    print_rows(rows)
    values = {"duration": DURATION, "tolerance": OPTIONS.tolerance, "exudyn_step": EXACT.step, "table_3": TABLE_3}
    write_json("paths_and_modes", {**values, "rows": rows}, given.folder)


if __name__ == "__main__":
    main()
