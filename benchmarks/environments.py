"""How many steps a second do environments make, one by one and as a vector environment on threads?

    python benchmarks/environments.py [--number 16] [--threads 1,2] [--write]

Periods of 1 ms of RAParM-I in mode ++++ along the square, feed-forward and random actions up to 0.1, by the default
method and by generalised-alpha in steps of 0.25 ms. All cases take turns within each period, so that what else the
machine does affects all of them alike; the rates are those of the median period, and the ratios are to Gymnasium's
SyncVectorEnv of the same environments. Observations must agree to the bit.
"""

from __future__ import annotations

import os
import time
from typing import Any

import numpy as np
from common import command_line, single_thread, table, write_json

import paraflex as pf

OPTIONS = {"esdirk5, 1e-5 m": None, "generalised-alpha": pf.IntegrationOptions(method="generalised-alpha", step=2.5e-4)}
PERIODS, LARGEST = 200, 0.1


def main() -> None:
    from gymnasium.vector import SyncVectorEnv

    parser = command_line(__doc__)
    parser.add_argument("--number", type=int, default=16, help="environments")
    parser.add_argument("--threads", default=f"1,{os.cpu_count()}", help="numbers of threads")
    asked = parser.parse_args()
    single_thread()
    task = pf.plan("raparm_i")
    rows: list[dict[str, Any]] = []
    for name, options in OPTIONS.items():
        given: dict[str, Any] = {"mode": "++++", "options": options}
        cases: dict[str, Any] = {"SyncVectorEnv": SyncVectorEnv([lambda: pf.Environment(task, **given)] * asked.number)}  # noqa: B023
        for threads in dict.fromkeys(map(int, asked.threads.split(","))):
            cases[f"threads: {threads}"] = pf.VectorEnvironment(task, asked.number, threads=threads, **given)
        times = measured(cases)
        alone = times["SyncVectorEnv"]
        rows += [
            {"options": name, "environments": case, "steps_per_second": asked.number / t, "ratio": alone / t}
            for case, t in times.items()
        ]
    cells = [[r["options"], r["environments"], f"{r['steps_per_second']:.0f}", f"{r['ratio']:.2f}"] for r in rows]
    print(table(["options", "environments", "steps/s", "ratio"], cells))
    write_json("environments", {"number": asked.number, "rows": rows}, asked.folder)


def measured(cases: dict[str, Any]) -> dict[str, float]:
    """Median wall time of a period of all environments [s], by case."""
    first, *others = cases.values()
    for envs in cases.values():
        envs.reset(seed=0)
    times: dict[str, list[float]] = {name: [] for name in cases}
    random = np.random.default_rng(0)
    for _ in range(PERIODS):
        actions = random.uniform(-LARGEST, LARGEST, first.action_space.shape)
        seen = []
        for name, envs in cases.items():
            began = time.perf_counter()
            seen.append(envs.step(actions)[0])
            times[name].append(time.perf_counter() - began)
        assert all(np.array_equal(seen[0], each) for each in seen[1:]), "observations differ"
    for envs in others:
        envs.close()
    return {name: float(np.median(each)) for name, each in times.items()}


if __name__ == "__main__":
    main()
