"""How many runs of RAParM-I a second does a sweep do, and how much do two workers gain over one?

    python benchmarks/throughput.py [--designs 64] [--modes 1] [--engine threads,processes] [--write]

Designs differ in the thickness of the links by up to 2 %, so that each is planned anew; each is run along the square
for 0.7 s in so many of the study's six modes, ++++ first, by esdirk5 in second-order geometry. The setting is the
coarsest of a few steps and tolerances with which the end-effector of the reference set stays within 1.2e-5 m of a
converged run in each of these modes: near singular positions, where three of the six modes pass, fixed steps do not
serve. Runs a second are the best of three sweeps, start of the workers left out: timed from the first design of each
worker to the last. The goals: 100 runs a second in ++++ with two workers, and 1.9 times what one does.
"""

from __future__ import annotations

import argparse
import json
from typing import Any

import numpy as np
from common import command_line, write_json
from models import SECOND_ORDER
from sweeps import swept

from paraflex.compilation import compile_kernels
from paraflex.dynamics.points import point_motion
from paraflex.errors import IntegrationError
from paraflex.files import load
from paraflex.integrators import IntegrationOptions
from paraflex.tracking import TrackingTask, plan_tracking

DEVIATION, CONVERGED = 1.2e-5, 1e-7
SETTINGS = (
    *({"step": step, "tolerance": 1e-3} for step in (2e-3, 1.5e-3, 1.2e-3, 1e-3)),
    *({"tolerance": tolerance} for tolerance in (1e-3, 7e-4, 5e-4, 3e-4, 2e-4, 1e-4)),
)
REPEATS = 3
METHOD = "esdirk5"
STUDY = """
mechanism = "raparm_i"
set = {{geometry = "second-order", reference = "pinned", curvature = "separate"}}
modes = {modes}
[sampling]
kind = "sobol"
number = {designs}
[integration]
method = "{method}"
{setting}
[vary.thickness]
fields = ["section.bar.thickness"]
low = 0.0050
high = 0.0051
"""


def main() -> None:
    asked = arguments()
    compile_kernels()
    modes = load("raparm_i").study.modes[-asked.modes :]
    setting, deviations = coarsest(list(modes))
    for mode, deviation in deviations.items():
        print(f"{mode}: largest deviation {deviation:.2e} m with {METHOD}, {told(setting, ', ')}")
    print(f"\n{'engine':>10}{'workers':>9}{'runs':>7}{'runs/s':>9}{'gain':>7}")
    rates: dict[str, dict[str, float]] = {}
    for engine in asked.engine.split(","):
        alone = None
        for workers in (1, 2):
            rate = max(runs_a_second(engine, workers, list(modes), asked.designs, setting) for _ in range(REPEATS))
            alone = alone or rate
            print(
                f"{engine:>10}{workers:>9}{asked.designs * len(modes):>7}{rate:>9.1f}{rate / alone:>7.2f}", flush=True
            )
            rates.setdefault(engine, {})[str(workers)] = rate
    out = {
        "designs": asked.designs, "setting": setting, "modes": list(modes), "within": DEVIATION,
        "deviation": deviations, "rates": rates,
    }  # fmt: skip
    write_json("throughput", out, asked.folder)


def arguments() -> argparse.Namespace:
    parser = command_line(__doc__)
    parser.add_argument("--designs", type=int, default=64)
    parser.add_argument("--modes", type=int, default=1, choices=range(1, 7), help="the last of the study's six")
    parser.add_argument("--engine", default="threads,processes")
    return parser.parse_args()


def coarsest(modes: list[str]) -> tuple[dict[str, Any], dict[str, float]]:
    """The coarsest setting that serves in every mode, and the deviations with it."""
    model = load("raparm_i")
    task = SECOND_ORDER.task(plan_tracking(model.mechanism, model.path(), duration=model.study.duration))
    exact = {mode: places(task, mode, {"tolerance": CONVERGED}) for mode in modes}
    found: dict[str, Any] = {}
    for setting in SETTINGS:
        found = {mode: deviation(task, mode, setting, exact[mode]) for mode in modes}
        if max(found.values()) <= DEVIATION:
            return setting, found
    raise SystemExit(f"no setting keeps to {DEVIATION:g} m: {found}")


def deviation(task: TrackingTask, mode: str, setting: dict[str, Any], exact: np.ndarray) -> float:
    """Largest distance from the converged run; infinite where this one fails."""
    try:
        away = places(task, mode, setting) - exact
    except IntegrationError:
        return np.inf
    return float(np.max(np.hypot(away[:, 0], away[:, 1])))


def places(task: TrackingTask, mode: str, setting: dict[str, Any]) -> np.ndarray:
    """Of the end-effector at the samples."""
    solution = task.simulate(mode, options=IntegrationOptions(method=METHOD, **setting)).solution
    effector = task.mechanism.end_effector
    assert effector is not None
    return point_motion(task.system, effector.point, solution.q, solution.v, solution.a).position


def told(setting: dict[str, Any], between: str) -> str:
    """A setting as a study file says it."""
    return between.join(f"{name} = {value:g}" for name, value in setting.items())


def runs_a_second(engine: str, workers: int, modes: list[str], designs: int, setting: dict[str, Any]) -> float:
    """Between the first design that is done and the last."""
    said = STUDY.format(modes=json.dumps(modes), designs=designs, method=METHOD, setting=told(setting, "\n"))
    moments = swept(said, engine, workers).moments
    # Two designs that end at once would make too much of a short sweep: the first of each worker is not counted.
    return (designs - workers) * len(modes) / (moments[-1] - moments[workers - 1])


if __name__ == "__main__":
    main()
