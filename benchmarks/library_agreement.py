"""Other mechanisms of the library on their paths: both geometries and two reference conditions against exact beams.

    python benchmarks/library_agreement.py [--mechanism NAME ...] [--write]

As `model_agreement.py` does for RAParM-I: "linear, cantilever" is the paper's (shared curvature), the other three have
separate curvature; exact beams are Exudyn's, twice as many elements and steps of 25 us. Written are tracking errors
over the whole run and the largest distances between end-effectors. Takes a few minutes.
"""

from __future__ import annotations

from typing import Any

from common import command_line, table, write_json
from engines import distance
from model_agreement import BEAMS
from models import tracking_errors

import paraflex as pf
from paraflex.engines.exudyn import ExudynOptions, simulate_exudyn
from paraflex.integrators import IntegrationOptions
from paraflex.results.record import record
from paraflex.tracking import TrackingTask

MODES = {
    "raparm_ii": ("+-+-", "-+-+", "+--+", "+++-", "++-+", "++++"),
    "3rrr": ("+++---", "++++--", "++++++"),
    "4rrr": ("++++", "+++-"),
}
OPTIONS, EXACT = IntegrationOptions(method="esdirk5", tolerance=1e-6), ExudynOptions(2.5e-5, 2)


def of_mode(task: TrackingTask, mode: str) -> dict[str, Any]:
    """Tracking error of exact beams [m]; those of our models, and how far their paths are from that one."""
    exact, models = simulate_exudyn(task, mode, EXACT), {}
    for model in BEAMS:
        run = record(model.task(task).simulate(mode, options=OPTIONS))
        apart = distance(run.end_effector.position, exact.end_effector.position)
        models[model.name] = {**tracking_errors(run, task.path.duration), "apart": apart}
    strays = distance(exact.end_effector.position, task.motion.desired.position)
    return {"mode": mode, "exact": tracking_errors(exact, task.path.duration), "strays": strays, "models": models}


def measure(name: str) -> list[dict[str, Any]]:
    """All modes of a mechanism."""
    model = pf.load(name)
    path = model.study.path
    task = pf.plan(model.mechanism, model.path(path), duration=model.study.duration)
    rows = []
    for mode in MODES[name]:
        rows.append({"mechanism": model.mechanism.name, "path": path, **of_mode(task, mode)})
        print(f"{name} {mode}", flush=True)
    return rows


def print_rows(rows: list[dict[str, Any]]) -> None:
    """Errors over the whole run, and how far from exact beams."""
    cells = [
        [f"{row['mechanism']} {row['mode']} {name}", f"{found['run']:.3e}",
         f"{found['run'] / row['exact']['run'] - 1.0:+.2%}", f"{found['apart']:.1e}"]
        for row in rows
        for name, found in row["models"].items()
    ]  # fmt: skip
    print(table(["", "error [m]", "off by", "apart [m]"], cells))


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("--mechanism", action="append", choices=tuple(MODES), help="all by default")
    given = parser.parse_args()
    rows = [row for name in given.mechanism or MODES for row in measure(name)]
    print_rows(rows)
    values = {"tolerance": OPTIONS.tolerance, "exudyn": {"step": EXACT.step, "refinement": EXACT.refinement}}
    write_json("library_agreement", {**values, "rows": rows}, given.folder)


if __name__ == "__main__":
    main()
