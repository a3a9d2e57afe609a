"""Kill or interrupt every command at its changes of files and at any time, let it run out of room, run it again.

    python benchmarks/kills.py [--kills 100] [--full 20] [--signals 0] [--seed 0] [--only sweep ...]

Each kill is in a process of its own: before its nth change of a file in the results folder (opening for writing,
renaming, removing, making and removing folders), or, every second one, at a random time by SIGKILL, also within SQLite.
Every third command is killed over results that are there. Room ends where a file would become larger than a limit, from
nothing to the largest file that the command writes. Signals are SIGINT, SIGTERM and SIGHUP, to the process or, as a
terminal does, to all that it started; every second one at a change of a file, the others at a random time. The command
is to end by itself, with exit code 128 + number or, where it had finished, 0. It counts

- hang: a minute after a signal the command, or a process that it started, still goes on, or its folder is locked,
- silent: a reader takes a file that is not the one its folder's manifest lists, or results of two runs are mixed; a
  file is neither the one that was there nor the new one,
- error: the same command again does not end well, or a raw exception is shown,
- differs: what it leaves is not what a command leaves that nobody killed; wall times aside,
- left: files that nobody lists.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import random
import re
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

CHANGES = {"open", "os.rename", "os.remove", "os.mkdir", "os.rmdir", "sqlite3.connect"}
# What a command says is shorter, and goes to a file too [bytes].
_LOG = 4096
KILLED = -signal.SIGKILL
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
# How long a command may take to end after a signal; what runs longer at all goes on for ever [s].
_BOUND, _FOR_EVER = 60.0, 300.0
STUDY = """
name = "bars"
mechanism = "five_bar"
paths = ["square"]
modes = ["++"]
metrics = ["tracking_rms"]
duration = 0.02
samples = 6
trajectories = {trajectories}
{sampling}
[vary.thickness]
fields = ["section.bar.thickness"]
low = 0.004
high = 0.006
{more}
"""
SOBOL = '[sampling]\nkind = "sobol"\nnumber = 8\n'
FILES = {
    "sweep": STUDY.format(trajectories="true", sampling=SOBOL, more=""),
    "optimise": STUDY.format(
        trajectories="false", sampling="",
        more="[objective]\nminimise = { tracking_rms = 1.0 }\n[search]\nevaluations = 12\n",
    ),
    "identify": STUDY.format(
        trajectories="false", sampling="",
        more='[[target]]\nmetric = "tracking_rms"\nvalue = 1e-6\n[search]\nevaluations = 12\n',
    ),
    "indices": STUDY.format(trajectories="false", sampling="", more=""),
    "sensitivity": STUDY.format(trajectories="false", sampling="", more=""),
}  # fmt: skip
CONTROLLER = """
[controller.pd]
type = "pid"
stiffness = "2 N m/rad"
damping = 0.3
period = "1 ms"
"""
SHORT = ["five_bar", "--duration", "0.02", "--samples", "6"]
# Lines end with where results go, OUT, or have it within: drawings and exports.
LINES = {
    "run": ["run", *SHORT, "--tol", "1e-3"],
    "motion": ["run", "pendulum", "--duration", "0.05", "--samples", "6"],
    "verify": ["verify", *SHORT, "--model", "rigid", "--model", "linear"],
    "compare-methods": ["compare-methods", *SHORT, "--method", "esdirk5", "--tol", "1e-3"],
    "sensitivity": ["sensitivity", "sensitivity.toml"],
    "sweep": ["sweep", "sweep.toml", "--workers", "2"],
    "optimise": ["optimise", "optimise.toml", "--workers", "2"],
    "identify": ["identify", "identify.toml", "--workers", "2"],
    "indices": ["indices", "indices.toml", "--samples", "8", "--workers", "2"],
    "processes": ["sweep", "sweep.toml", "--workers", "2", "--engine", "processes", "--no-report"],
    "statics": ["statics", "leaf_spring_guide", "--move", "stage.T.x=2 mm", "--steps", "2", "--no-report"],
    "linearise": ["linearise", "five_bar", "--mode", "++", "--no-figures", "--no-report"],
    "laws": ["control", "compare", "laws.toml", *SHORT[1:], "--mode", "++", "--tol", "1e-3", "--workers", "1"],
    "draw": ["draw", "four_bar", "--no-open", "--force", "--output", "OUT/drawing.svg"],
    "table": ["export", "results", "--to", "csv", "--force", "--output", "OUT/table.csv"],
    "export": ["export", "OUT", "--to", "mat", "--force"],
}
# What lies in the folders of those that write into one that is there.
BEFORE = {"draw": "drawing.svg", "table": "table.csv", "export": "results"}
MANY = ("sweep", "optimise", "identify", "indices")
# What takes time is not the same twice; figures and the report show it.
NOT_COMPARED = (
    ".lock", "manifest.json", "journal.sqlite", "report.html", "compare-methods.json", "compare-methods.png",
)  # fmt: skip
# Of values that may differ by rounding.
_DIGEST = re.compile(r'"digest": "[0-9a-f]+"')
# Text with the time at the start of a file for MATLAB [bytes].
_MAT_HEAD = 116


def in_child(work: Callable[[], None], log: Path, seconds: float = _FOR_EVER, kill_after: float | None = None) -> int:
    """Do some work in another process; its exit code, a negative signal where one ended it."""
    child = started(work, log)
    code = ended(child, seconds if kill_after is None else kill_after)
    if code is None:
        os.killpg(child, signal.SIGKILL)
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        return code if kill_after is not None else -999
    return code


def started(work: Callable[[], None], log: Path) -> int:
    """The number of a process that does some work, in a session of its own."""
    child = os.fork()
    if child == 0:
        os.setsid()
        opened = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        for stream in (1, 2):
            os.dup2(opened, stream)
        code = 1
        try:
            work()
            code = 0
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else int(bool(end.code))
        except BaseException:
            traceback.print_exc()
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(code)
    return child


def ended(child: int, seconds: float) -> int | None:
    """The exit code of a process; None where it goes on for so long."""
    until = time.monotonic() + seconds
    while True:
        found, status = os.waitpid(child, os.WNOHANG)
        if found:
            return os.waitstatus_to_exitcode(status)
        if time.monotonic() > until:
            return None
        time.sleep(0.002)


def command(
    line: list[str], out: Path, at: int | None = None, count: Path | None = None, number: int = signal.SIGKILL
) -> Callable[[], None]:
    """A command into a folder; killed before its nth change of a file there, or its changes counted into a file.

    In place of the kill it may get another signal.
    """

    def work() -> None:
        from paraflex.__main__ import main

        seen, inside = [0], str(out)

        def hook(event: str, arguments: tuple) -> None:
            if event not in CHANGES or (event == "open" and arguments[1] in ("r", "rb")):
                return
            if inside in str(arguments[0]):
                seen[0] += 1
                if seen[0] == at:
                    os.kill(os.getpid(), number)

        sys.addaudithook(hook)
        within = any("OUT" in word for word in line)
        placed = [word.replace("OUT", str(out)) for word in line]
        sys.argv = ["paraflex", *placed, *([] if within else ["--out", str(out)])]
        try:
            main()
        finally:
            if count is not None:
                count.write_text(str(seen[0]))

    return work


def out_of_room(work: Callable[[], None], limit: int) -> Callable[[], None]:
    """Some work that cannot write files of more bytes than a limit."""

    def limited() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
        work()

    return limited


def silent(folder: Path) -> str:
    """What a reader of a folder takes for right and is not; empty where all is well."""
    from paraflex.errors import InputError
    from paraflex.folders import check_listed, finish_change, read_manifest

    finish_change(folder)
    manifest = read_manifest(folder)
    if manifest is None:
        return ""
    for name in manifest.files:
        if not (folder / name).is_file():
            return f"{name} is listed and missing"
        try:
            check_listed(folder / name, "")
        except InputError as error:
            return str(error)
    listed = {*manifest.files, "manifest.json"}
    stray = [each.name for each in folder.iterdir() if each.is_file() and each.name not in listed]
    numbers = [name for name in stray if name.endswith((".nc", ".parquet", ".json", ".html")) and name != "study.json"]
    return f"not listed: {numbers}" if numbers else ""


class Numbers:
    """Text whose numbers are compared up to rounding, which differs with where some BLAS find arrays in memory."""

    _NUMBER = re.compile(r"(?<!\w)-?\d+(?:\.\d*)?(?:e[-+]?\d+)?(?!\w)")

    def __init__(self, text: str) -> None:
        self._words = self._NUMBER.sub("#", text)
        self._numbers = np.array(self._NUMBER.findall(text), dtype=float)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Numbers) or self._words != other._words:
            return False
        ours, theirs = self._numbers, other._numbers
        return ours.size == theirs.size and np.allclose(ours, theirs, rtol=1e-6, atol=1e-12 * np.max(np.abs(ours)))

    def __hash__(self) -> int:
        return hash(self._words)


def content(folder: Path) -> dict[str, Any]:
    """What a folder of results holds, by file; wall times aside."""
    import xarray as xr

    from paraflex.results import open_results

    found: dict[str, Any] = {}
    for file in sorted(each for each in folder.rglob("*") if each.is_file()):
        name = file.relative_to(folder).as_posix()
        if name.startswith("figures/"):
            found[name] = None
        elif file.suffix == ".nc":
            data: xr.Dataset = open_results(file)
            data = data.drop_vars([each for each in data.variables if "wall" in str(each)])
            found[name] = (
                data.sizes,
                {str(k): v.values.tobytes() for k, v in data.variables.items() if v.dtype != object},
            )
        elif file.name in ("summary.json", "verify.json") and not (folder / "study.json").exists():
            found[name] = without_times(json.loads(file.read_text(encoding="utf-8")))
        elif file.stem == "sensitivity":
            parquet = file.suffix == ".parquet"
            text = pd.read_parquet(file).to_csv() if parquet else file.read_text(encoding="utf-8")
            found[name] = Numbers(_DIGEST.sub("", text))
        elif file.suffix == ".mat":
            found[name] = file.read_bytes()[_MAT_HEAD:]
        elif file.name not in NOT_COMPARED:
            found[name] = file.read_bytes()
    return found


def without_times(value: object) -> object:
    """Plain values without wall times and the digest over them."""
    if isinstance(value, dict):
        return {key: without_times(one) for key, one in value.items() if "wall" not in key and key != "digest"}
    return [without_times(one) for one in value] if isinstance(value, list) else value


def attack(name: str, place: Path, asked: argparse.Namespace) -> Counter[str]:
    """Kill a command many times, send it signals, and let it run out of room; how it went."""
    line, log, counted = LINES[name], place / "log", place / "count"
    kills, chance = asked.kills, random.Random(f"{asked.seed} {name}")
    whole = place / f"{name}-whole"
    prepare(name, whole)
    began = time.perf_counter()
    code = in_child(command(line, whole, count=counted), log)
    seconds = time.perf_counter() - began
    if code != 0:
        sys.exit(f"{name} does not run:\n{log.read_text()}")
    changes, expected = int(counted.read_text()), content(whole)
    counts: Counter[str] = Counter(changes=changes)
    # A command may have ended before it is killed: such a try is not a kill, and another one follows.
    for i in range(3 * kills):
        if counts["killed"] == kills:
            break
        counts["tries"] += 1
        out = place / f"{name}-{i}"
        if i % 3 == 2:
            shutil.copytree(whole, out)
        else:
            prepare(name, out)
        before = content(out)
        if i % 2:
            code = in_child(command(line, out), log, kill_after=chance.uniform(0.0, 1.1 * seconds))
        else:
            code = in_child(command(line, out, at=1 + (i * changes // kills) % changes), log)
        counts["killed"] += code == KILLED
        look(name, f"kill {i}", out, before, expected, counts)
        look_and_repeat(name, f"kill {i}", out, log, expected, counts)
    for i in range(asked.signals):
        out = place / f"{name}-signal-{i}"
        if i % 3 == 2:
            shutil.copytree(whole, out)
        else:
            prepare(name, out)
        before, at = content(out), 1 + chance.randrange(changes) if i % 2 else None
        how = signalled(name, out, log, at, seconds, chance, counts)
        look(name, how, out, before, expected, counts, left=True)
        look_and_repeat(name, how, out, log, expected, counts)
    largest = max(file.stat().st_size for file in whole.rglob("*") if file.is_file())
    for i in range(asked.full):
        out, limit = place / f"{name}-full-{i}", _LOG + int((largest - _LOG) * (i / asked.full) ** 2)
        prepare(name, out)
        code = in_child(out_of_room(command(line, out), limit), log)
        said = log.read_text(errors="replace")
        counts["full"] += code == 2
        if code not in (0, 2) or "Traceback" in said or (code == 2 and "error: " not in said):
            report(counts, "error", f"{name}, no file over {limit} bytes: exit code {code}\n{said}")
        look_and_repeat(name, f"no file over {limit} bytes", out, log, expected, counts)
    return counts


def prepare(name: str, out: Path) -> None:
    """Put into a folder what a command that writes into one finds there."""
    if name == "export":
        shutil.copytree(BEFORE[name], out)
    elif name in BEFORE:
        out.mkdir()
        (out / BEFORE[name]).write_text("before\n", encoding="utf-8")


def signalled(
    name: str, out: Path, log: Path, at: int | None, seconds: float, chance: random.Random, counts: Counter[str]
) -> str:
    """Send a command a signal, at a change of a file or at a random time, and see it end; how it was done."""
    number, delay, all_of_them = chance.choice(SIGNALS), chance.uniform(0.0, 1.1 * seconds), chance.random() < 0.5
    how = f"{number.name} at {f'change {at}' if at else f'{delay:.3f} s'}{' to all' if all_of_them and not at else ''}"
    child = started(command(LINES[name], out, at=at, number=number), log)
    code = ended(child, _FOR_EVER if at else delay)
    if code is None and not at:
        (os.killpg if all_of_them else os.kill)(child, number)
        code = ended(child, _BOUND)
    until = time.monotonic() + _BOUND
    while code is not None and processes_of(child) and time.monotonic() < until:
        time.sleep(0.01)
    if left := processes_of(child):
        report(counts, "hang", f"{name}, {how}: exit code {code}, processes {left}\n{log.read_text(errors='replace')}")
        os.killpg(child, signal.SIGKILL)
        code = code if code is not None else os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    said = log.read_text(errors="replace")
    counts["signals"] += code == 128 + number
    if code not in (0, 128 + number) or "Traceback" in said or "Exception ignored" in said:
        report(counts, "error", f"{name}, {how}: exit code {code}\n{said}")
    return how


def processes_of(group: int) -> list[int]:
    """Living processes of a group."""
    found = []
    for each in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):  # it has ended
            state, _, its = each.read_text().rpartition(")")[2].split()[:3]
            found += [int(each.parent.name)] if int(its) == group and state not in "ZX" else []
    return found


def look(
    name: str, how: str, out: Path, before: dict[str, Any], expected: dict[str, Any], counts: Counter[str],
    *, left: bool = False,
) -> None:  # fmt: skip
    """See whether the folder can be written to, and files that were there are those or the new ones."""
    from paraflex.folders import FolderInUseError, lock_folder

    if not out.exists():
        return
    # A kill may leave such files to the next command, a signal may not.
    unfinished = [each.name for each in out.rglob("*") if each.name == ".new" or each.suffix == ".part"]
    if left and unfinished:
        report(counts, "left", f"{name}, {how}: at once {unfinished}")
    try:
        with lock_folder(out):
            pass
    except FolderInUseError as error:
        report(counts, "hang", f"{name}, {how}: {error}")
    if name in BEFORE:
        shutil.rmtree(out / ".new", ignore_errors=True)
        found = {each: value for each, value in content(out).items() if not each.endswith(".part")}
        torn = [each for each in {*found, *before} if found.get(each) not in (before.get(each), expected.get(each))]
        if torn or before.keys() - found.keys():
            report(counts, "silent", f"{name}, {how}: {sorted(torn)}, missing {sorted(before.keys() - found.keys())}")


def look_and_repeat(name: str, how: str, out: Path, log: Path, expected: dict[str, Any], counts: Counter[str]) -> None:
    """See whether readers are deceived by what a command left, run it again, and compare; the folder is gone then."""
    problem = silent(out) if out.exists() else ""
    if problem:
        report(counts, "silent", f"{name}, {how}: {problem}")
    code = in_child(command(LINES[name], out), log)
    said = log.read_text(errors="replace")
    if code != 0 or "Traceback" in said:
        report(counts, "error", f"{name}, {how}: then exit code {code}\n{said}")
    elif (found := content(out)) != expected:
        files = [each for each in {*found, *expected} if found.get(each, 0) != expected.get(each, 0)]
        report(counts, "differs", f"{name}, {how}: {sorted(files)}")
    left = [each.name for each in out.iterdir() if each.name in (".new", ".ready") or each.suffix == ".part"]
    if left:
        report(counts, "left", f"{name}, {how}: {left}")
    shutil.rmtree(out)


def report(counts: Counter[str], what: str, text: str) -> None:
    """Count a failure and print it."""
    counts[what] += 1
    print(f"{what}: {text}", flush=True)


def main() -> None:
    """Kill all commands, and print a table of what came of it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=100, help="times that each command is killed")
    parser.add_argument("--full", type=int, default=20, help="times without room, of each command")
    parser.add_argument("--signals", type=int, default=0, help="signals that each command gets")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", nargs="*", choices=LINES, default=list(LINES))
    asked = parser.parse_args()
    # Imported once, not in every child.
    import paraflex.cli.app
    import paraflex.library
    import paraflex.plots
    import paraflex.reports
    import paraflex.studies

    failures = ("hang", "silent", "error", "differs", "left")
    heads = ("changes", "tries", "killed", "signals", "full", *failures)
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        for name, text in FILES.items():
            Path(f"{name}.toml").write_text(text, encoding="utf-8")
        Path("laws.toml").write_text(paraflex.library.text("five_bar") + CONTROLLER, encoding="utf-8")
        if {"table", "export"} & set(asked.only):
            _make_results(Path("results"))
        for name in asked.only:
            began = time.perf_counter()
            counts = attack(name, Path(folder), asked)
            rows.append((name, *(counts[head] for head in heads), f"{time.perf_counter() - began:.0f} s"))
            print(*rows[-1], flush=True)
    print("\n" + "".join(f"{head:>16}" for head in ("command", *heads, "took")))
    for row in rows:
        print("".join(f"{cell!s:>16}" for cell in row))
    sys.exit(any(sum(row[1 + heads.index(each)] for each in failures) for row in rows))


def _make_results(out: Path) -> None:
    """Results with an export, of another time than the one that replaces it."""
    for line in ([*LINES["motion"], "--no-figures", "--no-report"], LINES["export"]):
        if in_child(command(line, out), Path("log")) != 0:
            sys.exit(f"{line} does not run:\n{Path('log').read_text()}")


if __name__ == "__main__":
    main()
