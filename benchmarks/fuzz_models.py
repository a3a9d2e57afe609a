"""Wrong model and study files by the thousand: does anything end otherwise than in a result or in one line of ours?

    python benchmarks/fuzz_models.py --cases 12000 --through info
    python benchmarks/fuzz_models.py --case 4711 --through run       # one of them, with what it says

`load` reads a model, `info` is the command, `run` integrates a short motion, `study` reads a study file for one of the
commands that take it and begins a sweep. Processes of their own do the work, with a limit on time and memory: what
hangs is noticed and ended. Every failure is named by where it was raised, with a case that gives it again.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import math
import os
import random
import resource
import select
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).parent))

from common import single_thread
from mutations import MODELS, STUDIES, Case, mutated, originals

# What a case may take [s] on a busy machine, and a process [bytes of addresses]: the largest of the library takes 1 s.
LIMIT = 60.0
MEMORY = 8 * 2**30
# Steps of a run: what is tried is whether it ends well, not whether it comes far.
STEPS = 300
# Motions along paths are planned every millisecond: longer ones [s] take as long as was asked for, as do more samples.
LONGEST, MOST_SAMPLES = 60.0, 5000
# Ends that are no failures.
GOOD = ("fine", "refused", "stopped")


@dataclass
class Outcomes:
    """How cases ended.

    Attributes
    ----------
    counts : Counter
        By kind: those of `GOOD`, "traceback", "hang", "warning" and "silent".
    failures : mapping
        Of those that are not good, the cases, by kind and place.
    """

    counts: Counter[str] = field(default_factory=Counter)
    failures: dict[str, list[int]] = field(default_factory=lambda: defaultdict(list))

    def add(self, number: int, kind: str, what: str) -> None:
        """Count a case."""
        self.counts[kind] += 1
        if kind not in GOOD:
            self.failures[f"{kind}: {what}"].append(number)


def fuzz(cases: range, through: str, *, workers: int = 1, seconds: float = math.inf, limit: float = LIMIT) -> Outcomes:
    """Put cases through a part of the program, in processes of their own."""
    found, until, left = Outcomes(), time.monotonic() + seconds, iter(cases)

    def work(_: int) -> None:
        with contextlib.closing(_Worker(through, limit)) as worker:
            for number in left:
                if time.monotonic() > until:
                    return
                kind, what = worker.answer(number)
                found.add(number, kind, what)

    with ThreadPoolExecutor(workers) as pool:
        list(pool.map(work, range(workers)))
    return found


class _Worker:
    """A process that tries cases one after the other; one that hangs or dies is replaced."""

    def __init__(self, through: str, limit: float) -> None:
        self.through, self.limit = through, limit
        self.process = self._started()

    def _started(self) -> subprocess.Popen[bytes]:
        process = subprocess.Popen(
            [sys.executable, __file__, "--worker", "--through", self.through],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        # It says so when kernels are compiled: that is no case's time.
        assert process.stdout is not None
        process.stdout.readline()
        return process

    def answer(self, number: int) -> tuple[str, str]:
        """How a case ended, and where it failed."""
        stdin, stdout = self.process.stdin, self.process.stdout
        assert stdin is not None
        assert stdout is not None
        stdin.write(b"%d\n" % number)
        stdin.flush()
        ready, _, _ = select.select([stdout], [], [], self.limit)
        line = stdout.readline() if ready else b""
        if line:
            kind, what = json.loads(line)
            return kind, what
        self.close()
        died = self.process.returncode if ready else None
        self.process = self._started()
        return ("hang", f"beyond {self.limit:g} s") if died is None else ("traceback", f"the process died ({died})")

    def close(self) -> None:
        """End the process."""
        self.process.kill()
        with self.process:
            pass


def case_of(number: int, through: str) -> Case:
    """The case of a number."""
    kind = STUDIES if through == "study" else MODELS
    return mutated(number, originals(kind), prepare=_shortened if through == "run" else None)


def _shortened(data: dict[str, Any]) -> None:
    data["study"] = {**data.get("study", {}), "duration": 0.02, "samples": 11}


def tried(case: Case, through: str, folder: Path) -> tuple[str, str]:
    """How a case ends, and where it failed if it did."""
    from paraflex.errors import InputError, ParaflexError

    file = folder / "case.toml"
    file.write_bytes(case.content)
    foreign: list[str] = []
    with _noting_warnings(foreign):
        try:
            silent = _THROUGH[through](case, file)
        except InputError as error:
            kind, what = "refused", _complaint(error)
        except ParaflexError as error:
            kind, what = "stopped", _complaint(error)
        except (Exception, SystemExit) as error:
            kind, what = "traceback", _place(error)
        else:
            kind, what = ("silent", silent) if silent else ("fine", "")
    if what and kind in ("refused", "stopped"):
        return "traceback", what
    return ("warning", foreign[0]) if foreign and kind in GOOD else (kind, what)


def _complaint(error: Exception) -> str:
    """What is wrong with a message of ours: it is to be one line, and not long."""
    text = str(error)
    if not text.isprintable():
        return f"a message with control characters: {text[:60]!r}"
    return f"a message of {len(text)} letters" if len(text) > 2000 else ""


@contextlib.contextmanager
def _noting_warnings(foreign: list[str]) -> Iterator[None]:
    from paraflex.errors import ParaflexWarning

    def note(message, category, filename, lineno, file=None, line=None) -> None:
        if not isinstance(message, ParaflexWarning):
            foreign.append(f"{category.__name__} at {_short(filename)}:{lineno}: {str(message)[:60]}")

    with warnings.catch_warnings():
        warnings.simplefilter("always")
        warnings.showwarning = note
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            yield


def _load(case: Case, file: Path) -> str:
    import paraflex as pf

    pf.load(file)
    return ""


def _info(case: Case, file: Path) -> str:
    from paraflex.cli.app import app

    as_json = case.seed % 2
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        app(["info", str(file), *(["--json"] if as_json else [])], standalone_mode=False)
    if "\x1b" in out.getvalue() or "\u202e" in out.getvalue():
        return "control characters of the file are printed"
    return _not_finite(json.loads(out.getvalue())) if as_json else ""


def _run(case: Case, file: Path) -> str:
    """The run of a model, short; its first two modes where it has a path."""
    import paraflex as pf
    from paraflex.campaign import Workers
    from paraflex.checks import check
    from paraflex.studies.tracking import TrackingStudy

    model = pf.load(file)
    study = model.study
    options = study.integration({"max_steps": STEPS})
    if _asks_for_much(model):
        return ""
    if model.paths:
        task = model.plan(warning=False)
        runs = TrackingStudy(task, model.modes()[:2], options, {}, error=study.error)
        result = runs.run(workers=Workers(number=1))
        if result.data is None:
            return ""
        data, numbers = result.data, result.to_dict()
    else:
        start = model.start or study.assembly
        run = pf.simulate_motion(
            model.mechanism, study.duration or 0.02, samples=study.samples, torques=study.torques, start=start,
            options=options,
        )  # fmt: skip
        data = pf.motion_dataset(run, options=options, parameters={}, findings=check(model))
        numbers = pf.summary(data)
    json.dumps(numbers)
    done = data["status"].values == "complete"
    if not done.all():
        return ""
    for name in ("q", "point_position", "torque", "joint_force", "energy", "tracking_error"):
        if name in data and not _finite(data[name].values):
            return f"{name} of a complete run is not finite"
    return ""


def _asks_for_much(model: Any) -> bool:
    """Whether a run is so long, or keeps so many samples, that it may take minutes: that is no hang."""
    duration = model.duration(model.path()) if model.paths else 0.0
    return LONGEST < duration < math.inf or model.study.samples > MOST_SAMPLES


def _study(case: Case, file: Path) -> str:
    """A study file, read by one of the commands that take it; a sweep is begun."""
    import paraflex as pf

    chance = random.Random(case.seed)
    loaders: dict[str, list[Callable[[Path], Any]]] = {
        "sweep": [pf.load_sweep], "thickness_study": [pf.load_sweep, pf.load_indices],
        "search": [pf.load_optimisation, pf.load_indices], "optimisation": [pf.load_optimisation],
        "identification": [pf.load_identification], "sensitivity_study": [pf.load_sensitivities],
    }  # fmt: skip
    # Now and then by a command that it is not meant for.
    known = loaders[case.origin] if chance.random() < 0.9 else [one for each in loaders.values() for one in each]
    loader = chance.choice(known)
    study = loader(file)
    if loader is pf.load_sweep and study.setting.duration is not None and study.setting.duration < 0.1:
        with tempfile.TemporaryDirectory() as folder:
            study.run(Path(folder) / "sweep", limit=1, workers=pf.Workers(number=1, engine="threads"))
    return ""


_THROUGH: Mapping[str, Callable[[Case, Path], str]] = {"load": _load, "info": _info, "run": _run, "study": _study}


def _finite(values: Any) -> bool:
    import numpy as np

    return values.dtype.kind != "f" or bool(np.isfinite(values).all())


def _not_finite(facts: Any, where: str = "") -> str:
    """A number of JSON that is none."""
    if isinstance(facts, float) and not math.isfinite(facts):
        return f"{where} is {facts}"
    parts = facts.items() if isinstance(facts, dict) else enumerate(facts) if isinstance(facts, list) else ()
    inner = (_not_finite(each, f"{where}.{key}" if isinstance(key, str) else where) for key, each in parts)
    return next(filter(None, inner), "")


def _place(error: BaseException) -> str:
    """Type, message and the innermost line of ours."""
    frames = traceback.extract_tb(error.__traceback__)
    ours = [one for one in frames if "paraflex" in one.filename and "site-packages" not in one.filename]
    last = [one for one in ours if f"{os.sep}benchmarks{os.sep}" not in one.filename] or ours or list(frames)
    return f"{type(error).__name__} at {_short(last[-1].filename)}:{last[-1].lineno}: {str(error)[:60]!r}"


def _short(file: str) -> str:
    return file.rpartition(f"paraflex{os.sep}")[2].rpartition("site-packages/")[2]


def _work(through: str) -> None:
    """Answer the numbers of cases that come in, a line each."""
    from paraflex.compilation import compile_kernels
    from paraflex.mechanism import Geometry

    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    with tempfile.TemporaryDirectory() as folder:
        for geometry in Geometry:
            compile_kernels(geometry)
        for name in ("five_bar", "pendulum"):
            original = Case(0, name, (), originals(MODELS)[name].encode())
            tried(original, through if through != "study" else "run", Path(folder))
        print("ready", file=answers, flush=True)
        for line in sys.stdin:
            print(json.dumps(tried(case_of(int(line), through), through, Path(folder))), file=answers, flush=True)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=2000, help="how many")
    parser.add_argument("--seed", type=int, default=0, help="the first one's number")
    parser.add_argument("--seconds", type=float, default=math.inf, help="no new case is begun after these")
    parser.add_argument("--through", choices=list(_THROUGH), default="info", help="what they go through")
    parser.add_argument("--workers", type=int, default=1, help="processes")
    parser.add_argument("--case", type=int, help="one case alone, in this process: its file and what becomes of it")
    parser.add_argument("--worker", action="store_true", help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.worker:
        _work(asked.through)
        return 0
    if asked.case is not None:
        return _show(case_of(asked.case, asked.through), asked.through)
    began = time.monotonic()
    found = fuzz(
        range(asked.seed, asked.seed + asked.cases), asked.through, workers=asked.workers, seconds=asked.seconds
    )
    print(f"{sum(found.counts.values())} cases through {asked.through} in {time.monotonic() - began:.0f} s:")
    for kind, count in found.counts.most_common():
        print(f"  {count:7d} {kind}")
    for what, numbers in sorted(found.failures.items(), key=lambda one: -len(one[1])):
        print(f"  {len(numbers):5d} x {what}\n          --through {asked.through} --case {min(numbers)}")
    return int(bool(found.failures))


def _show(case: Case, through: str) -> int:
    """One case, with its traceback."""
    file = Path(tempfile.mkdtemp()) / "case.toml"
    file.write_bytes(case.content)
    print(f"case {case.seed} of {case.origin}: {', '.join(case.changes)}\n{file}")
    try:
        print(_THROUGH[through](case, file) or "fine")
    except Exception:
        traceback.print_exc()
    return 0


if __name__ == "__main__":
    single_thread()
    sys.exit(main())
