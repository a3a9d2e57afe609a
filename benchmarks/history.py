"""How fast each state of paraflex is: adds a line per commit to `benchmarks/measured/history.json`.

    python benchmarks/history.py [REVISION ...] [--designs 48]

Each revision, by default HEAD, is checked out into a temporary folder and measured with this environment's packages by
its own scripts: `startup.py --compile` and `throughput.py`, and the paper's study by `paraflex run`. Several revisions
are measured one after the other on the same machine, so that their lines can be compared; lines of other days can by
`loop_of_python`, the time of a loop of Python in the same run. A line of the same commit and machine is replaced. Takes
three minutes per revision.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from common import MEASURED, conditions, write_json

ROOT, HISTORY = Path(__file__).parents[1], MEASURED / "history.json"
# Titles of the columns by the figures of a line, and how these are written.
COLUMNS = {
    "help": ("`--help` [s]", ".2f"),
    "info": ("`info` [s]", ".2f"),
    "draw": ("`draw` [s]", ".2f"),
    "compile": ("compile [s]", ".0f"),
    "study": ("study [s]", ".1f"),
    "threads_1": ("designs/s, 1 thread", ".1f"),
    "threads_2": ("2 threads", ".1f"),
    "processes_2": ("2 processes", ".1f"),
    "results": ("`results.nc` [MB]", ".1f"),
    "report": ("`report.html` [MB]", ".1f"),
    "loop_of_python": ("loop [ms]", ".0f"),
}
# The same in the records of `startup.py`.
STARTS = {
    "help": "paraflex --help",
    "info": "paraflex info raparm_i",
    "draw": "paraflex draw raparm_i",
    "compile": "compile all kernels",
}


def figures(checkout: Path, designs: int) -> dict[str, float]:
    """Measure a checkout; processor times of commands, wall times of all else, sizes in MB."""
    environment = os.environ | {"PYTHONPATH": str(checkout / "src"), "OPENBLAS_NUM_THREADS": "1"}

    def run(*arguments: str) -> None:
        subprocess.run([sys.executable, *arguments], cwd=checkout, env=environment, check=True, stdout=sys.stderr)

    run("benchmarks/startup.py", "--compile", "--repeats", "5")
    run("benchmarks/throughput.py", "--designs", str(designs))
    starts, throughput = (
        json.loads((checkout / "benchmarks" / "results" / f"{name}.json").read_text(encoding="utf-8"))
        for name in ("startup", "throughput")
    )
    found = {start["name"]: start for start in starts["starts"]}
    out = {name: found[title]["processor"] for name, title in STARTS.items() if title in found}
    out["compile"] = found[STARTS["compile"]]["least"]
    times = []
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(3):
            began = time.perf_counter()
            run("-m", "paraflex", "run", "raparm_i", "--out", folder)
            times.append(time.perf_counter() - began)
        out |= {name: (Path(folder) / file).stat().st_size / 1e6
                for name, file in (("results", "results.nc"), ("report", "report.html"))}  # fmt: skip
    rates = throughput["rates"]
    return out | {
        "study": min(times),
        **{f"{engine}_{workers}": rates[engine][workers] for engine in rates for workers in rates[engine]},
    }


def line(revision: str, designs: int) -> dict[str, Any]:
    """Measure a revision in a checkout of its own."""
    commit, date = _git("log", "-1", "--format=%H %cs", revision).split()
    with tempfile.TemporaryDirectory() as folder:
        checkout = Path(folder) / "checkout"
        _git("worktree", "add", "--detach", str(checkout), commit)
        try:
            measured = figures(checkout, designs)
        finally:
            _git("worktree", "remove", "--force", str(checkout))
    about = conditions()
    return {
        "commit": commit,
        "committed": date,
        **{name: about[name] for name in ("date", "machine", "load")},
        "figures": measured | {"loop_of_python": 1e3 * about["loop_of_python"]},
    }


def _git(*arguments: str) -> str:
    return subprocess.run(["git", *arguments], cwd=ROOT, check=True, capture_output=True, text=True).stdout.strip()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("revisions", nargs="*", default=["HEAD"])
    parser.add_argument("--designs", type=int, default=48)
    given = parser.parse_args()
    lines = json.loads(HISTORY.read_text(encoding="utf-8"))["lines"] if HISTORY.exists() else []
    for revision in given.revisions:
        new = line(revision, given.designs)
        lines = [one for one in lines if (one["commit"], one["machine"]) != (new["commit"], new["machine"])]
        lines = sorted([*lines, new], key=lambda one: (one["committed"], one["date"]))
        print(f"{revision}: {new['figures']}", flush=True)
        write_json("history", {"columns": COLUMNS, "lines": lines}, MEASURED)


if __name__ == "__main__":
    main()
