"""Run the tests as on other processors and report the assertions that rounding may fail.

    python tests/any_processor.py [FILE ...] [--setting NAME] [--folder FOLDER] [--table]
    python tests/any_processor.py --by-commit

OPENBLAS_CORETYPE selects the routines that OpenBLAS uses on another processor; NUMBA_CPU_NAME compiles the kernels for
another one. Sums then have another order, products are fused or not, and results differ by rounding. The tests run
under each of `SETTINGS`, with the plugin `margins.py`, which records every assertion. An assertion is reported if

- it is an equality within a tolerance, some setting uses more than a third of the tolerance (`MOST_USED`), and the part
  used differs between settings by more than a hundredth of what is left (`MOVED`): the number depends on rounding. An
  error that hardly does, such as one of discretisation, may use more: it does so on every processor;
- or it is an inequality, its lesser side is more than a third of the greater one under some setting, and the distance
  of the two differs between settings by more than a tenth of its least value (`MOST_SPREAD`). A limit that a theory or
  a requirement states may be close if rounding is small beside the distance. Times and counts are compared as well;
  they need bounds with room for other reasons.

A line in a loop asserts several times. The largest part used counts; inequalities are compared occurrence by
occurrence, as far as all settings reach.

The script prints a Markdown table and exits with 1 if a test fails or an assertion is reported. The whole suite takes
twenty minutes per setting on two cores, and some minutes more where kernels are compiled for another processor (Numba
keeps these apart in its cache). `--folder` keeps the records, and `--table` evaluates those without running
anything. `--by-commit`, for CI, only prints one setting other than the first as variables of the environment. It
depends on the commit, so that all of them are used in turn.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections import defaultdict
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

TESTS = Path(__file__).parent
SETTINGS: dict[str, dict[str, str]] = {
    "as it is": {},
    **{f"BLAS {name}": {"OPENBLAS_CORETYPE": name} for name in ("Haswell", "SkylakeX", "Prescott", "Nehalem")},
    **{f"kernels {name}": {"NUMBA_CPU_NAME": name} for name in ("generic", "haswell")},
}
MOST_USED, MOVED, MOST_SPREAD = 1.0 / 3.0, 0.01, 0.1


@dataclass
class Run:
    """Tests under one setting: how many passed, which failed, and what was recorded, by test and place."""

    passed: int = 0
    failed: list[str] = field(default_factory=list)
    used: dict[tuple[str, str], float] = field(default_factory=dict)
    sides: dict[tuple[str, str], list[tuple[float, float]]] = field(default_factory=dict)


def run_tests(setting: str, tests: list[str], folder: Path, workers: str) -> None:
    """Run tests under a setting; records and results are files of its name in a folder."""
    records, results = files_of(setting, folder)
    records.unlink(missing_ok=True)
    environment = {
        name: value for name, value in os.environ.items() if name not in ("OPENBLAS_CORETYPE", "NUMBA_CPU_NAME")
    }
    environment |= {"OPENBLAS_NUM_THREADS": "1", "MARGINS": str(records), **SETTINGS[setting]}
    environment["PYTHONPATH"] = os.pathsep.join(filter(None, (str(TESTS), os.environ.get("PYTHONPATH"))))
    options = [
        "-p",
        "margins",
        f"--junitxml={results}",
        "--numprocesses",
        workers,
        "--dist",
        "loadfile",
        "--no-loadscope-reorder",
    ]
    for command in (["paraflex.compilation"], ["pytest", *options, *tests]):
        subprocess.run([sys.executable, "-m", *command], cwd=TESTS.parent, env=environment, check=False)


def files_of(setting: str, folder: Path) -> tuple[Path, Path]:
    """Files of a setting: records of the plugin, results of pytest."""
    name = setting.replace(" ", "-")
    return folder / f"{name}.jsonl", folder / f"{name}.xml"


def read_run(setting: str, folder: Path) -> Run:
    """Read what `run_tests` left."""
    records, results = files_of(setting, folder)
    run = Run()
    for case in ElementTree.parse(results).iter("testcase"):
        outcomes = {child.tag for child in case}
        if outcomes & {"failure", "error"}:
            run.failed.append(f"{case.get('classname')}::{case.get('name')}")
        elif "skipped" not in outcomes:
            run.passed += 1
    for line in records.read_text(encoding="utf-8").splitlines():
        record = json.loads(line)
        for kind, found in (("used", run.used), ("sides", run.sides)):
            found.update({(record["test"], place): value for place, value in record[kind].items()})
    return run


def excesses(runs: list[Run]) -> dict[tuple[str, str], float]:
    """Assertions that rounding may fail, by test and place: used part of a tolerance, or spread over distance."""
    found: dict[tuple[str, str], float] = {}
    for key, used in together([run.used for run in runs]).items():
        if max(used) > MOST_USED and max(used) - min(used) > MOVED * (1.0 - max(used)):
            found[key] = max(used)
    for key, several in together([run.sides for run in runs]).items():
        for sides in zip(*several, strict=False):
            distances = [more - less for less, more in sides]
            spread, least = max(distances) - min(distances), min(distances)
            if spread > MOST_SPREAD * least and max(_part(*each) for each in sides) > MOST_USED:
                found[key] = max(found.get(key, 0.0), spread / least if least else float("inf"))
    return found


def _part(less: float, more: float) -> float:
    """How much of the greater side the lesser one is, at most one; sides of different signs count as near."""
    if less * more < 0.0:
        return 1.0
    return min(abs(less), abs(more)) / (max(abs(less), abs(more)) or 1.0)


def together(runs: list[dict[Any, Any]]) -> dict[Any, list[Any]]:
    """Values of all runs by key."""
    found: dict[Any, list[Any]] = defaultdict(list)
    for run in runs:
        for key, value in run.items():
            found[key].append(value)
    return found


def table(runs: dict[str, Run]) -> str:
    """Table of the settings, then the failed tests and the assertions that are reported."""
    found = excesses(list(runs.values()))
    lines = ["| setting | passed | failed | assertions | above a third | largest |", "|---|---|---|---|---|---|"]
    for setting, run in runs.items():
        used = [run.used[key] for key in found if key in run.used]
        counts = f"{run.passed} | {len(run.failed)} | {len(run.used) + len(run.sides)}"
        lines.append(
            f"| {setting} | {counts} | {sum(part > MOST_USED for part in used)} | {max(used, default=0.0):.2f} |"
        )
    lines += [f"\nFailed under {setting}: {test}" for setting, run in runs.items() for test in run.failed]
    lines += [f"\n{len(found)} assertions that rounding may fail (part of the tolerance, or spread over distance):\n"]
    for (test, place), part in sorted(found.items(), key=lambda each: -each[1]):
        kind = "used" if any((test, place) in run.used for run in runs.values()) else "spread"
        lines.append(f"- {part:.3g} {kind}, {place}, {test}")
    return "\n".join(lines)


def setting_of_commit() -> str:
    """One of the settings but the first, another one with each commit."""
    command = ["git", "rev-parse", "HEAD"]
    digest = subprocess.run(command, cwd=TESTS, capture_output=True, text=True, check=True).stdout
    # Instructions of SkylakeX end a process on a processor that lacks them.
    has_them = "avx512f" in Path("/proc/cpuinfo").read_text()
    others = [name for name in list(SETTINGS)[1:] if has_them or "SkylakeX" not in name]
    return others[int(digest, 16) % len(others)]


def main() -> int:
    """The exit code: 1 if a test failed or rounding may fail one."""
    reader = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    reader.add_argument("tests", nargs="*", help="files of tests; all by default")
    reader.add_argument("--setting", action="append", choices=list(SETTINGS), help="one or more; all by default")
    reader.add_argument("--by-commit", action="store_true", help="print one setting, by the commit")
    reader.add_argument(
        "--workers", default="auto", help="processes of each run; as many as there are cores by default"
    )
    reader.add_argument("--folder", type=Path, help="for records and results; a temporary one by default")
    reader.add_argument("--table", action="store_true", help="of what is in the folder; nothing is run")
    given = reader.parse_args()
    if given.by_commit:
        print(*(f"{name}={value}" for name, value in SETTINGS[setting_of_commit()].items()))
        return 0
    settings = given.setting or list(SETTINGS)
    with tempfile.TemporaryDirectory() as temporary:
        folder = (given.folder or Path(temporary)).absolute()
        folder.mkdir(parents=True, exist_ok=True)
        if given.table:
            settings = [setting for setting in settings if files_of(setting, folder)[1].exists()]
        for setting in settings if not given.table else ():
            print(f"--- {setting}", flush=True)
            run_tests(setting, given.tests, folder, given.workers)
        runs = {setting: read_run(setting, folder) for setting in settings}
    print(table(runs))
    return 1 if any(run.failed for run in runs.values()) or excesses(list(runs.values())) else 0


if __name__ == "__main__":
    sys.exit(main())
