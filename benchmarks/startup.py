"""How long does it take to start? Commands and imports in fresh processes, and the first compilation.

    python benchmarks/startup.py [--compile] [--wheel FILE] [--repeats N] [--write]

Times are of whole processes, the least and the median of several, files in the page cache and kernels compiled, and
beside them processor time, which says more on a machine that is busy. So do an empty Python and Numba alone. With
--compile all kernels are compiled into an empty folder, and found there by a second process. With --wheel the first run
after an installation is timed: of a wheel of `make wheel`, unpacked. The table has the goals.
"""

from __future__ import annotations

import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
import zipfile
from dataclasses import asdict, dataclass

from common import command_line, table, write_json

GOALS = {
    "paraflex --help": 0.15, "paraflex info raparm_i": 0.6, "paraflex draw raparm_i": 0.9, "compile all kernels": 15.0,
    "first run of a wheel": 8.0,
}  # fmt: skip
PROCESSES = {
    "python": ["-c", "pass"],
    "import numba": ["-c", "import numba"],
    "import paraflex": ["-c", "import paraflex"],
    "paraflex --help": ["-m", "paraflex", "--help"],
    "paraflex methods": ["-m", "paraflex", "methods"],
    "paraflex info": ["-m", "paraflex", "info"],
    "paraflex info raparm_i": ["-m", "paraflex", "info", "raparm_i"],
    "paraflex draw raparm_i": ["-m", "paraflex", "draw", "raparm_i"],
}
# All that is compiled beforehand, for both geometries.
COMPILE = ["-m", "paraflex.compilation"]


@dataclass(frozen=True)
class Start:
    """Wall times of a process [s], its least processor time [s], and the goal where there is one."""

    name: str
    least: float
    median: float
    processor: float
    goal: float | None

    @property
    def row(self) -> list[str]:
        """In the table."""
        goal = "" if self.goal is None else f"{self.goal:g}"
        return [self.name, f"{self.least:.2f}", f"{self.median:.2f}", f"{self.processor:.2f}", goal]


def timed(name: str, arguments: list[str], repeats: int, **environment: str) -> Start:
    """Run a Python process so many times."""
    times, processor = [], []
    for _ in range(repeats):
        before, began = _processor_time(), time.perf_counter()
        subprocess.run([sys.executable, *arguments], check=True, stdout=subprocess.DEVNULL, env=_installed(environment))
        times.append(time.perf_counter() - began)
        processor.append(_processor_time() - before)
    return Start(name, min(times), statistics.median(times), min(processor), GOALS.get(name))


def _installed(environment: dict[str, str]) -> dict[str, str]:
    """The environment, in which Python keeps what it compiles of its own, as an installer does."""
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    return {**kept, **environment}


def _processor_time() -> float:
    """Of all processes that this one started and that have ended [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def compilation() -> list[Start]:
    """Into an empty folder, and how long a process then takes to find it done."""
    with tempfile.TemporaryDirectory() as folder:
        first = timed("compile all kernels", COMPILE, 1, NUMBA_CACHE_DIR=folder)
        return [first, timed("find them compiled", COMPILE, 1, NUMBA_CACHE_DIR=folder)]


def first_run(wheel: str) -> Start:
    """Of what the paper studies, without figures, with the kernels that the wheel has and no others."""
    with tempfile.TemporaryDirectory() as folder:
        installed, out = os.path.join(folder, "installed"), os.path.join(folder, "out")
        with zipfile.ZipFile(wheel) as archive:
            archive.extractall(installed)
        command = ["-m", "paraflex", "run", "raparm_i", "--no-figures", "--out", out]
        empty = os.path.join(folder, "empty")
        return timed("first run of a wheel", command, 1, PYTHONPATH=installed, NUMBA_CACHE_DIR=empty)


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("--wheel", help="a wheel with compiled kernels")
    parser.add_argument("--compile", action="store_true", help="measure the first compilation: minutes")
    parser.add_argument("--repeats", type=int, default=7)
    given = parser.parse_args()
    subprocess.run([sys.executable, *COMPILE], check=True)
    found = []
    for name, arguments in PROCESSES.items():
        timed(name, arguments, 1)
        found.append(timed(name, arguments, given.repeats))
    if given.compile:
        found += compilation()
    if given.wheel:
        found.append(first_run(given.wheel))
    print(table(["seconds", "least", "median", "processor", "goal"], [start.row for start in found]))
    write_json("startup", {"repeats": given.repeats, "starts": [asdict(start) for start in found]}, given.folder)


if __name__ == "__main__":
    main()
