"""How fast is a simulation that stands beside a controller? RAParM-I, second-order geometry, steps of 1 ms.

    python benchmarks/closed_loop.py [--write]

The square of 0.7 s in ++++ at 1 kHz, over and over until a minute is simulated, with torques that change at every step:
times of `Simulation.step`, readings of all sensors included, their median and 99.9th percentile; and of a whole run of
0.7 s under a law in Python, under the same one in the compiled time loop, and in open loop, by the same method.
"""

from __future__ import annotations

import time

import numpy as np
from common import command_line, least_time, single_thread, table, write_json

import paraflex as pf

PERIOD, SIMULATED, REPEATS = 1e-3, 60.0, 5
METHODS = ("esdirk5", "esdirk4", "tr-bdf2")


def main() -> None:
    single_thread()
    given = command_line(__doc__).parse_args()
    robot = pf.load("raparm_i")
    task = pf.plan(robot.mechanism.with_geometry("second-order"), robot.paths["square"], duration=0.7)
    rows = {method: measured(task, method) for method in METHODS}
    heads = ["method", "step, median [ms]", "99.9 % [ms]", "law in Python [s]", "compiled [s]", "open loop [s]"]
    print(table(heads, [
        [method, f"{1e3 * one['median']:.3f}", f"{1e3 * one['slowest']:.3f}", f"{one['law']:.3f}",
         f"{one['compiled']:.3f}", f"{one['open']:.3f}"]
        for method, one in rows.items()
    ]))  # fmt: skip
    write_json("closed_loop", {"methods": rows}, given.folder)


def measured(task: pf.tracking.TrackingTask, method: str) -> dict[str, float]:
    """Times of steps and of runs [s], and the error that steps of 1 ms leave [m]."""
    options = pf.IntegrationOptions(method=method, step=PERIOD)
    simulation = pf.Simulation(task, mode="++++", feed_forward=True, options=options)
    chain = {"period": PERIOD, "delay": PERIOD, "quantise": 1e-4, "reference": "plan"}
    law = pf.SampledController(lambda k, t, y: -1e-3 * y, **chain)
    compiled = pf.SampledController(pf.JointPID(1e-3, project=False), **chain)
    for each in (law, compiled):
        simulation.run(each, warning=False)
    random, laps = np.random.default_rng(0), []
    while len(laps) * PERIOD < SIMULATED:
        simulation.reset()
        while simulation.time < simulation.end:
            torques, until = 0.01 * random.standard_normal(4), min(simulation.time + PERIOD, simulation.end)
            began = time.perf_counter()
            simulation.step(torques, until)
            laps.append(time.perf_counter() - began)
    return {
        "median": float(np.median(laps)),
        "slowest": float(np.quantile(laps, 0.999)),
        "law": least_time(lambda: simulation.run(law, warning=False), REPEATS),
        "compiled": least_time(lambda: simulation.run(compiled, warning=False), REPEATS),
        "open": least_time(lambda: task.simulate("++++", options=options, warning=False), REPEATS),
    }


if __name__ == "__main__":
    main()
