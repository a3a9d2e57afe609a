"""Does a sweep on Dask workers lose time, rows or bits, also if workers are killed at random?

    python benchmarks/cluster.py [--designs 100000] [--every 16] [--workers 2] [--write]

Short runs of a flexible pendulum that differ in the thickness of its beam. First some thousand of them are swept by a
single process, and by as many Dask workers of this machine as asked for: the rates, from the first row to the last, are
compared. Then all designs are swept while a random worker is killed every so many seconds on average. Every row must be
complete, and the first of them must be those of the single process to the last bit.
"""

from __future__ import annotations

import random
import threading

import pandas as pd
import psutil
from common import command_line, single_thread, write_json
from sweeps import swept

COMPARED = 8192
STUDY = """
mechanism = "pendulum"
metrics = ["stress_max"]
duration = 0.05
samples = 6
[sampling]
kind = "sobol"
number = {designs}
seed = 1
[integration]
tolerance = 1e-3
[vary.thickness]
fields = ["section.strip.thickness"]
low = 0.0012
high = 0.0018
"""


def rows_of(designs: int, engine: str, workers: int) -> tuple[pd.DataFrame, float]:
    """The table of a sweep, and its rows a second from the first to the last."""
    found = swept(STUDY.format(designs=designs), engine, workers)
    return found.table, (len(found.moments) - 1) / (found.moments[-1] - found.moments[0])


def kill_workers(every: float, ended: threading.Event, killed: list[int]) -> None:
    """Kill a random process that this one has spawned, again and again."""
    chance = random.Random(1)
    while not ended.wait(chance.uniform(0.5 * every, 1.5 * every)):
        spawned = [each for each in psutil.Process().children() if "spawn_main" in " ".join(each.cmdline())]
        if spawned:
            victim = chance.choice(spawned)
            victim.kill()
            killed.append(victim.pid)


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("--designs", type=int, default=100_000)
    parser.add_argument("--every", type=float, default=16.0, help="mean time between two kills [s]")
    parser.add_argument("--workers", type=int, default=2)
    asked = parser.parse_args()
    single_thread()
    alone, rate = rows_of(COMPARED, "processes", 1)
    together, rate_together = rows_of(COMPARED, "dask", asked.workers)
    share = rate_together / asked.workers / rate
    print(f"one process {rate:.1f} rows/s; {asked.workers} Dask workers {rate_together:.1f} rows/s, {share:.0%} each")
    ended, killed = threading.Event(), []
    killer = threading.Thread(target=kill_workers, args=[asked.every, ended, killed], daemon=True)
    killer.start()
    table, rate_killed = rows_of(asked.designs, "dask", asked.workers)
    ended.set()
    complete = table["status"].tolist().count("complete")
    columns = ["run", "thickness", "stress_max", "status"]
    first = [pd.DataFrame(each[columns]).head(COMPARED) for each in (alone, together, table)]
    same = first[0].equals(first[1]) and first[0].head(asked.designs).equals(first[2])
    print(f"{len(killed)} kills: {complete} of {asked.designs} complete, {rate_killed:.1f} rows/s; same bits: {same}")
    out = {
        "designs": asked.designs, "workers": asked.workers, "alone": rate, "together": rate_together, "share": share,
        "kills": len(killed), "complete": complete, "killed_rate": rate_killed, "same_bits": same,
    }  # fmt: skip
    write_json("cluster", out, asked.folder)


if __name__ == "__main__":
    main()
