"""A thousand designs: RAParM-I with links of other stiffness, every design planned and run, on all processors.

    python benchmarks/batch.py [--designs N] [--sample N] [--processes N] [--target METRES] [--write]

Young's modulus of every link varies by a fifth from design to design, so that torques stay and motions differ. Each
engine runs a design from the mechanism on: planning, building the model, integrating ++++ for 0.7 s, at settings that
`peers.py` finds; the largest deviation from the design's own converged path, over some designs, is told beside the time
and has to be within the target. paraflex runs all designs; the others a sample of them, whose time is multiplied. Like
with like are second order and the other engines; the paper's linear beams stand beside.
"""

from __future__ import annotations

import multiprocessing
import os
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from common import command_line, single_thread, table, write_json
from engines import ExudynSetting, MuJoCoSetting, distance, run_exudyn, run_mujoco, tracking_problem
from models import PAPER, SECOND_ORDER
from numpy.typing import NDArray
from peers import MODE, TARGET, Tolerance, plan, run_paraflex

from paraflex.compilation import compile_kernels
from paraflex.mechanism import FlexibleBeam, Geometry, Material, Mechanism, proportional_segments
from paraflex.tracking import TrackingTask

DESIGNS, SAMPLE, CHECKED, SPREAD = 1000, 16, 3, 0.2
# The golden section spreads any number of values evenly.
GOLDEN = 0.5 * (5.0**0.5 - 1.0)


OURS = {model.name: model for model in (SECOND_ORDER, PAPER)}


@dataclass(frozen=True)
class Way:
    """An engine, or a model of paraflex's beams, with its setting and a converged one."""

    engine: str
    setting: Any
    converged: Any

    @property
    def name(self) -> str:
        """In the table."""
        ours = "paraflex, " if self.engine in OURS else ""
        return f"{ours}{self.engine}: {self.setting}"


WAYS = (
    Way(SECOND_ORDER.name, Tolerance("esdirk5", 1e-3, 1.2e-3), Tolerance("esdirk5", 1e-7)),
    Way(SECOND_ORDER.name, Tolerance("esdirk5", 1e-4), Tolerance("esdirk5", 1e-7)),
    Way("Exudyn", ExudynSetting(14, 0.9), ExudynSetting(60)),
    Way("MuJoCo", MuJoCoSetting(19), MuJoCoSetting(40)),
    Way(PAPER.name, Tolerance("esdirk5", 1e-3, 1.2e-3), Tolerance("esdirk5", 1e-7)),
    Way(PAPER.name, Tolerance("esdirk5", 2e-4), Tolerance("esdirk5", 1e-7)),
    Way(PAPER.name, Tolerance("tr-bdf2", 6e-5), Tolerance("esdirk5", 1e-7)),
)


def design(mechanism: Mechanism, number: int) -> Mechanism:
    """The mechanism with the stiffness of one design."""
    factor = 1.0 + SPREAD * (2.0 * (number * GOLDEN % 1.0) - 1.0)
    return replace(mechanism, bodies=tuple(_stiffened(body, factor) for body in mechanism.bodies))


def _stiffened(body: Any, factor: float) -> Any:
    if not isinstance(body, FlexibleBeam):
        return body
    assert isinstance(body.material, Material)
    return replace(body, material=replace(body.material, youngs_modulus=factor * body.material.youngs_modulus))


def path_of(way: Way, number: int, setting: Any) -> NDArray[np.float64]:
    """A design from its mechanism to the path of its end-effector."""
    task = plan(0.7)
    changed = task.remodelled(design(task.mechanism, number))
    return _runner(way.engine)(changed, setting)


def _runner(engine: str) -> Callable[[TrackingTask, Any], NDArray[np.float64]]:
    if engine == "Exudyn":
        return lambda task, setting: run_exudyn(tracking_problem(task, MODE), setting).path
    if engine == "MuJoCo":
        return lambda task, setting: (
            run_mujoco(tracking_problem(task.in_segments(proportional_segments(task.mechanism, 8)), MODE), setting).path
        )
    return lambda task, setting: run_paraflex(task, OURS[engine], setting).path


def _run(order: tuple[Way, int]) -> int:
    way, number = order
    path_of(way, number, way.setting)
    return number


def _start_worker() -> None:
    # Exudyn's build without checks.
    setattr(sys, "exudynFast", True)  # noqa: B010


def deviation(way: Way, checked: int) -> float:
    """The largest over the first designs [m]."""
    return max(distance(path_of(way, k, way.setting), path_of(way, k, way.converged)) for k in range(checked))


def measure(way: Way, designs: int, run: int, checked: int, pool: Any, processes: int) -> dict[str, Any]:
    """Time of a batch, of so many designs that are run."""
    # Every worker loads what it needs before the clock starts.
    pool.map(_run, [(way, k) for k in range(processes)], chunksize=1)
    began = time.perf_counter()
    pool.map(_run, [(way, k) for k in range(run)], chunksize=1)
    seconds = time.perf_counter() - began
    off = deviation(way, checked)
    return {
        "way": way.name, "converged": str(way.converged), "deviation": off, "run": run,
        "seconds_a_design": seconds / run, "seconds_of_all": seconds * designs / run,
    }  # fmt: skip


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("--designs", type=int, default=DESIGNS)
    parser.add_argument("--sample", type=int, default=SAMPLE, help="designs that other engines run")
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--target", type=float, default=TARGET, help="deviation from converged paths [m]")
    given = parser.parse_args()
    single_thread()
    _start_worker()
    for geometry in Geometry:
        compile_kernels(geometry)
    found = []
    with multiprocessing.get_context("spawn").Pool(given.processes, _start_worker) as pool:
        for way in WAYS:
            run = given.designs if way.engine in OURS else min(given.sample, given.designs)
            found.append(measure(way, given.designs, run, CHECKED, pool, given.processes))
            print(f"{way.name}: {found[-1]['seconds_of_all']:.0f} s", flush=True)
    fastest = min(row["seconds_of_all"] for row in found if row["deviation"] <= given.target)
    rows = [
        [row["way"], f"{row['deviation']:.1e}", "" if row["deviation"] <= given.target else "too far off",
         str(row["run"]), f"{row['seconds_of_all']:.1f}", f"{row['seconds_of_all'] / fastest:.1f}"]
        for row in found
    ]  # fmt: skip
    heading = f"{given.designs} designs, {given.processes} processes"
    print(table([heading, "off by [m]", "", "run", "time [s]", "ratio"], rows))
    write_json("batch", {"designs": given.designs, "processes": given.processes, "target": given.target,
                         "rows": found}, given.folder)  # fmt: skip


if __name__ == "__main__":
    main()
