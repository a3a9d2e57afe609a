"""Wrong values for every argument of the public functions and classes, one at a time: what do they say?

    python benchmarks/wrong_calls.py [--seed N] [--number K] [--only NAME,NAME]

Every public function, every class that is made by its arguments, and the public methods of what the
functions return are called as they should be, with one argument replaced by something else. A call may work; it may
end in paraflex's own exceptions. Anything else is a finding, as is a call that takes longer than a minute.
"""

from __future__ import annotations

import argparse
import inspect
import random
import signal
import tempfile
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import xarray as xr

import paraflex as pf
from paraflex.dynamics import consistent_state

SECONDS = 60
VALUES: Mapping[str, Callable[[], Any]] = {
    "None": lambda: None, "True": lambda: True, "0": lambda: 0, "-1": lambda: -1, "0.5": lambda: 0.5,
    "10**400": lambda: 10**400, "1e308": lambda: 1e308, "1e-320": lambda: 1e-320, "nan": lambda: float("nan"),
    "inf": lambda: float("inf"), "1j": lambda: 1j, "text": lambda: "no_such", "empty": lambda: "",
    "NUL": lambda: "a\0b", "bytes": lambda: b"x", "[]": list, "[nan]": lambda: [float("nan")],
    "mixed": lambda: [1, "a", None], "nested": lambda: [[1.0], [2.0, 3.0]], "{}": dict,
    "{a: None}": lambda: {"a": None},
    "{1: 2}": lambda: {1: 2.0}, "object": object, "type": lambda: int, "function": lambda: (lambda *a, **k: None),
    "raises": lambda: _raises, "matrix": lambda: np.zeros((3, 3)), "complex array": lambda: np.array([1j, 2.0]),
    "objects": lambda: np.array([None, "a"], dtype=object), "times": lambda: np.array(["2020-01-01"], "datetime64[s]"),
    "float32 nan": lambda: np.float32("nan"), "set": lambda: {"drive", "arm"}, "generator": lambda: (k for k in (1, 2)),
    "path": lambda: Path("no/such/file"), "frame": pd.DataFrame, "dataset": xr.Dataset,
    "exception": lambda: ValueError("x"),
}  # fmt: skip


def _raises(*_: Any, **__: Any) -> None:
    raise RuntimeError("a function of the user")


class Subject(NamedTuple):
    """Something that is called, and the arguments with which that works."""

    name: str
    call: Callable[..., Any]
    arguments: dict[str, Any]


class Wrong(NamedTuple):
    """A call that ended in something else than an exception of paraflex."""

    name: str
    argument: str
    value: str
    error: BaseException


def tries(subjects: list[Subject]) -> Iterator[tuple[Subject, str, str]]:
    """Each argument of each subject with each value."""
    for subject in subjects:
        for argument in inspect.signature(subject.call).parameters:
            if argument not in ("args", "kwargs", "settings", "details", "read", "self", "run"):
                for value in VALUES:
                    # A callback that raises is the user's.
                    if not (argument == "on_progress" and value == "type"):
                        yield subject, argument, value


def attempt(subject: Subject, argument: str, value: str) -> Wrong | None:
    """One call."""
    signal.alarm(SECONDS)
    try:
        subject.call(**(subject.arguments | {argument: VALUES[value]()}))
    except pf.ParaflexError:
        return None
    except RuntimeError as error:
        # What a function of the user raises is the user's.
        return None if str(error) == "a function of the user" else Wrong(subject.name, argument, value, error)
    except Exception as error:
        # Python's own words.
        if isinstance(error, TypeError) and "required positional argument" in str(error):
            return None
        return Wrong(subject.name, argument, value, error)
    finally:
        signal.alarm(0)
    return None


def prepare(folder: Path) -> list[Subject]:
    """All subjects, with small runs behind them."""
    model = pf.load("raparm_i")
    mechanism = model.mechanism
    task = pf.plan(mechanism, model.path("square"), duration=0.02, samples=5)
    run = pf.simulate(task, "++++", warning=False)
    motion = pf.simulate_motion(mechanism, 0.002, samples=3, warning=False)
    data = pf.tracking_dataset([run])
    linear = pf.linearise(task, mode="++++")
    along = pf.poses_along(task, 2, mode="++++")
    plant = pf.discretise(linear, 1e-3)
    deviations = {output.name: 1e-3 for output in linear.outputs}
    measured = [output.name for output in linear.outputs]
    regulator = pf.lqr(linear, 1e-3, deviations=deviations, effort=1.0)
    design = pf.lqg(linear, 1e-3, measured=measured, deviations=deviations, effort=1.0, noise=1e-4)
    held = ["A1", "D1", "A2", "D2"]
    still = pf.statics(mechanism, held=held, warning=False)
    files = {"output": folder / "out", "file": folder / "film.gif", "path": folder / "data.nc", "folder": folder / "x"}
    given: dict[str, Any] = {
        "model": model, "mechanism": mechanism, "task": task, "mode": "++++", "modes": ["++++"], "source": task,
        "data": data, "first": data, "second": data, "controller": design, "period": 1e-3, "duration": 0.002,
        "models": [linear], "full": linear, "reduced": linear, "case": pf.tracking_case(task, "++++"),
        "methods": ["tr-bdf2"], "runs": [run], "run": motion, "found": still, "along": task, "until": 40.0,
        "name_or_file": "raparm_i", "shaper": pf.shaper("zv", 50.0), "kind": "zv", "frequencies": 50.0, "count": 2,
        "frequency": 20.0, "resolution": 1e-3, "torques": np.zeros((5, len(mechanism.motors))), "start": [0.0, 0.314],
        "end": [0.01, 0.314], "max_acceleration": 40.0, "deviations": deviations, "effort": 1.0, "noise": 1e-4,
        "measured": measured, "to": "csv", "laws": [], "study": folder / "study.toml", **files,
    }  # fmt: skip
    special: dict[str, dict[str, Any]] = {
        "closed_loop": {"model": linear}, "closed_loops": {"models": {"a": linear}}, "margins": {"model": linear},
        "discretise": {"model": linear}, "lqr": {"model": linear}, "lqg": {"model": linear},
        "rate_feedback_gains": {"model": linear}, "statics": {"source": mechanism, "held": held},
        "load_results": {"path": folder / "saved.nc"}, "open_results": {"path": folder / "saved.nc"},
        "linearise": {"mode": "++++"}, "linearise_along": {"mode": "++++"}, "poses_along": {"mode": "++++"},
        "motion_case": {"start": consistent_state(motion.system, None)},
        "internal_torques": {"torques": run.applied}, "simulate_motion": {"samples": 3}, "reduce": {"mode": "++++"},
    }  # fmt: skip
    pf.save_results(data, folder / "saved.nc")
    subjects = []
    for name in sorted(dir(pf)):
        item = getattr(pf, name)
        if inspect.isfunction(item):
            own = given | special.get(name, {})
            needed = [
                one.name for one in inspect.signature(item).parameters.values()
                if one.default is one.empty or one.name in special.get(name, {})
            ]  # fmt: skip
            subjects.append(Subject(name, item, {one: own[one] for one in needed if one in own}))
    for thing in (model, mechanism, task, run, motion, linear, along, plant, regulator, still,
                  design, pf.closed_loop(linear, design), pf.margins(linear, design)):  # fmt: skip
        subjects += methods(thing, given)
    return subjects + classes()


def methods(thing: Any, given: dict[str, Any]) -> list[Subject]:
    """Public methods of a result that take arguments."""
    found = []
    for name, method in inspect.getmembers(thing, callable):
        if name.startswith("_") or not inspect.ismethod(method):
            continue
        parameters = inspect.signature(method).parameters.values()
        needed = {one.name: given[one.name] for one in parameters if one.default is one.empty and one.name in given}
        if parameters:
            found.append(Subject(f"{type(thing).__name__}.{name}", method, needed))
    return found


def classes() -> list[Subject]:
    """Classes of the library's models and a few more, made by the arguments of one that is there."""
    found: dict[type, Any] = {}
    for name in pf.library.names():
        collect(pf.load(name), found)
    point = pf.PointRef("link1", "A1")
    for one in (
        pf.IntegrationOptions(), pf.FilmOptions(), pf.Workers(), pf.Start(), pf.Encoder("e", "A1"),
        pf.JointLimit("A1", 0.0, 1.0),
        pf.Tachometer("s", "A1"), pf.SingularDistance(0.1), pf.DeflectionLimit("link1", 1e-3), pf.Actuator("A1"),
        pf.AppliedTorque("a", point, 1.0), pf.PointForce("a", point, (1.0, 0.0)), pf.ConstantSpeed(0.0, 1.0),
        pf.PiecewiseProfile((pf.ConstantSpeed(0.0, 1.0),), ()), pf.TabulatedProfile((0.0, 1.0), (0.0, 1.0)),
        pf.Payload(1.0), pf.StrainGauge("g", "link1", 0.5), pf.DeflectionSensor("d", point, "x"),
        pf.AccelerationSensor("a", point, "x"), pf.JointForceSensor("f", "A1", "x"), pf.LossFactor(0.01, 100.0),
        pf.SlotJoint("s", point, point), pf.SumRelation("s", {"A1": 1.0, "D1": 1.0}),
    ):  # fmt: skip
        collect(one, found)
    made = [
        (pf.JointPID, {"stiffness": 1.0}), (pf.ComputedTorque, {"frequency": 10.0}),
        (pf.CompiledLaw, {"function": _raises}),
        (pf.RateFeedback, {"gains": {"g": {"A1": 1.0}}}), (pf.SampledController, {"law": _raises, "period": 1e-3}),
        (pf.BackwardDifference, {"period": 1e-3}), (pf.Environment, {"source": "five_bar"}),
        (pf.Differentiator, {"period": 1e-3, "resolution": 1e-3, "acceleration": 10.0}),
        (pf.Simulation, {"source": pf.load("four_bar").mechanism, "duration": 0.01}),
    ]  # fmt: skip
    return [
        Subject(kind.__name__, kind, {each.name: getattr(one, each.name) for each in fields(one) if each.init})
        for kind, one in sorted(found.items(), key=lambda pair: pair[0].__name__)
    ] + [Subject(kind.__name__, kind, arguments) for kind, arguments in made]


def collect(value: Any, found: dict[type, Any]) -> None:
    """The public classes in a value, with an instance of each."""
    if is_dataclass(value) and not isinstance(value, type):
        if getattr(pf, type(value).__name__, None) is type(value):
            found.setdefault(type(value), value)
        for each in fields(value):
            collect(getattr(value, each.name, None), found)
    elif isinstance(value, Mapping):
        collect(list(value.values()), found)
    elif isinstance(value, list | tuple):
        for each in value:
            collect(each, found)


def late(*_: Any) -> None:
    raise TimeoutError(f"longer than {SECONDS} s")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, help="a random part of the calls, in this order")
    parser.add_argument("--number", type=int, default=500, help="of calls, with --seed")
    parser.add_argument("--only", default="", help="names, with commas between")
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    signal.signal(signal.SIGALRM, late)
    with tempfile.TemporaryDirectory() as folder:
        calls = list(tries(prepare(Path(folder))))
        if given.only:
            calls = [one for one in calls if one[0].name in given.only.split(",")]
        if given.seed is not None:
            calls = random.Random(given.seed).sample(calls, min(given.number, len(calls)))
        found = Counter[str]()
        for one in calls:
            wrong = attempt(*one)
            if wrong is not None:
                found[wrong.name] += 1
                where = traceback.extract_tb(wrong.error.__traceback__)[-1]
                error = f"{type(wrong.error).__name__}: {str(wrong.error)[:90]!r}"
                place = f"{Path(where.filename).name}:{where.lineno}"
                print(f"{wrong.name}({wrong.argument}={wrong.value}): {error} [{place}]", flush=True)
    print(f"{len(calls)} calls, {found.total()} end in other exceptions: {dict(found)}")


if __name__ == "__main__":
    main()
