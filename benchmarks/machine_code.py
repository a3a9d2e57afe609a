"""What do kernels for a level of processors cost, against kernels for the processor at hand?

    python benchmarks/machine_code.py [--repeats N] [--write]

Both run RAParM-I along its square, in turns, each in processes of its own: in fixed steps of esdirk5 and with error
control. Times are processor times of a run, the least of all. The first call compiles the kernels for this processor.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys

from common import command_line, table, write_json
from llvmlite import binding

from paraflex.kernel.processor import processor

RUNS = {"fixed steps": {"step": 2e-3}, "error control": {"tolerance": 1e-5}}
SCRIPT = """
import json, time
import paraflex as pf
model = pf.load("raparm_i")
task = pf.plan(model.mechanism.with_geometry("second-order"), model.paths["square"])
found = {{}}
for name, options in {runs}.items():
    options, times = pf.IntegrationOptions(method="esdirk5", **options), []
    for _ in range(6):
        began = time.process_time()
        task.simulate("++++", options=options, warning=False)
        times.append(time.process_time() - began)
    found[name] = min(times)
print(json.dumps(found))
"""


def run(**environment: str) -> dict[str, float]:
    """Processor time of each run [s]."""
    line = [sys.executable, "-c", SCRIPT.format(runs=RUNS)]
    done = subprocess.run(line, check=True, stdout=subprocess.PIPE, env={**os.environ, **environment})
    return json.loads(done.stdout)


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("--repeats", type=int, default=5)
    given = parser.parse_args()
    settings = {processor()[1]: {}, binding.get_host_cpu_name(): {"NUMBA_CPU_NAME": binding.get_host_cpu_name()}}
    for environment in settings.values():
        run(**environment)
    turns = [{name: run(**environment) for name, environment in settings.items()} for _ in range(given.repeats)]
    least = {name: {kind: min(turn[name][kind] for turn in turns) for kind in RUNS} for name in settings}
    rows = [[name, *(f"{1e3 * times[kind]:.1f}" for kind in RUNS)] for name, times in least.items()]
    print(table(["kernels for", *(f"{kind} [ms]" for kind in RUNS)], rows))
    write_json("machine_code", {"repeats": given.repeats, "least": least}, given.folder)


if __name__ == "__main__":
    main()
