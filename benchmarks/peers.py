"""RAParM-I against Exudyn, MuJoCo and SciPy: same torques and start, each at its fastest setting that is close enough.

    python benchmarks/peers.py [--skip-scipy] [--write] [--target METRES] [--duration S] [--repeats N] [--out DIR]

Mode ++++ on the square, reference set, 0.7 s, one thread each, kernels warm. Close enough is an end-effector nowhere
further than the target from the path that the same model takes with much finer steps. Like is compared with like:
Exudyn's exact beams and MuJoCo's segments have what our second-order geometry has (pinned reference, separate
curvature, 114 coordinates). The paper's linear beams (cantilever reference, shared curvature, 104 coordinates) leave
the geometric stiffness out; they stand beside, under their own name. Settings are searched from coarse to fine; what
counts is the median wall time of several runs of the first that is within the target together with the next finer
one. Integration alone is timed, making and assembling the model is given beside it.

Ours are tried with error control and with fixed steps, as all others have; with all coordinates, and with as few as an
estimated deviation of the target allows, off the converged path of all. Exudyn is tried with full and modified
Newton, dense and sparse matrices and several numerical dampings; its torques are set by a function of Python before
each step, whose time is taken off in a column of its own. MuJoCo is tried with each of its integrators. What each chose
is timed in turns, so that all see the same moods of the machine. With --write the figures go to benchmarks/measured,
from where the documentation takes them, and into README.md between its two marks. Takes minutes.
"""

from __future__ import annotations

import itertools
import math
import statistics
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from common import Trial, coarsest_within, command_line, single_thread, write_json, write_page
from engines import ExudynSetting, MuJoCoSetting, Run, distance, run_exudyn, run_mujoco, tracking_problem
from models import PAPER, SECOND_ORDER, BeamModel
from numpy.typing import NDArray
from peers_tables import leads, print_results, readme_table

import paraflex as pf
from paraflex.compilation import compile_kernels
from paraflex.errors import NumericalError
from paraflex.integrators import IntegrationOptions
from paraflex.mechanism import Geometry, proportional_segments
from paraflex.studies import tracking_case
from paraflex.tracking import TrackingTask

MODE, TARGET, DURATION, REPEATS = "++++", 1.2e-5, 0.7, 5
README = Path(__file__).parents[1] / "README.md"
TOLERANCES = tuple(1e-3 * 10.0 ** (-k / 10.0) for k in range(36))
# Fixed steps [s], coarse to fine, and what Newton's tolerance is then derived from [m].
STEPS = tuple(3e-3 * 0.93**k for k in range(55))
LEFT_TO_NEWTON = {"tr-bdf2": 2e-3, "esdirk5": 3e-3}
CONVERGED = 1e-7


@dataclass(frozen=True)
class Converged:
    """The path that deviations are taken from, by which setting, and how far another one is off [m]."""

    setting: str
    path: NDArray[np.float64]
    uncertainty: float


@dataclass(frozen=True)
class Choice:
    """The setting that an engine was found close enough with, or why there is none.

    Attributes
    ----------
    name : str
    converged : Converged
    run : callable
        Of a setting.
    setting : object
        None where nothing tried was close enough.
    trial : Trial or None
    tried : list of dict
        All trials.
    """

    name: str
    converged: Converged
    run: Callable[[Any], Run]
    setting: Any = None
    trial: Trial | None = None
    tried: list[dict[str, Any]] = field(default_factory=list)


@dataclass(frozen=True)
class Result:
    """A choice, timed: medians over the repeats, and the range of times [s]; deviations [m]."""

    name: str
    setting: str
    converged: str
    uncertainty: float
    deviation: float
    seconds: float
    without_python: float
    fastest: float
    slowest: float
    setup: float
    steps: int
    tried: list[dict[str, Any]]


def choose(
    name: str, settings: Sequence[Any], run: Callable[[Any], Run], converged: Converged, target: float
) -> Choice:
    """The first of settings, coarse to fine, that is close enough."""
    tried: list[dict[str, Any]] = []

    def attempt(setting: Any) -> Trial:
        try:
            found = run(setting)
        except (NumericalError, RuntimeError) as error:
            tried.append({"setting": str(setting), "reason": str(error)[:200]})
            return Trial(math.inf, math.inf)
        error = distance(found.path, converged.path)
        deviation = error if math.isfinite(error) else None
        tried.append({"setting": str(setting), "deviation": deviation, "seconds": found.seconds})
        return Trial(error, found.seconds)

    chosen = coarsest_within(settings, attempt, target)
    return Choice(name, converged, run, *(chosen or (None, None)), tried)


def timed(choices: Sequence[Choice], repeats: int) -> list[Result]:
    """All choices that there are, run in turns."""
    able = [choice for choice in choices if choice.trial is not None]
    runs: list[list[Run]] = [[] for _ in able]
    for _ in range(repeats):
        for choice, found in zip(able, runs, strict=True):
            found.append(choice.run(choice.setting))
    return [_result(choice, found) for choice, found in zip(able, runs, strict=True)]


def _result(choice: Choice, runs: Sequence[Run]) -> Result:
    times = [one.seconds for one in runs]
    assert choice.trial is not None
    return Result(
        name=choice.name,
        setting=str(choice.setting),
        converged=choice.converged.setting,
        uncertainty=choice.converged.uncertainty,
        deviation=choice.trial.error,
        seconds=statistics.median(times),
        without_python=statistics.median(one.seconds - one.python for one in runs),
        fastest=min(times),
        slowest=max(times),
        setup=statistics.median(one.setup for one in runs),
        steps=runs[0].steps,
        tried=choice.tried,
    )


# --- paraflex, and SciPy on its equations --------------------------------------------------------------------------


@dataclass(frozen=True)
class Tolerance:
    """A method at a tolerance [m], or with fixed steps [s]."""

    method: str
    tolerance: float
    step: float | None = None

    def __str__(self) -> str:
        return f"{self.method}, {self.tolerance:.2g} m" if self.step is None else f"{self.method}, {self.step:.2g} s"


def run_paraflex(task: TrackingTask, model: BeamModel, setting: Tolerance, deviation: float | None = None) -> Run:
    """Our own run; set-up is that of the system, and of coordinates for an estimated deviation [m] if there is one."""
    began = time.perf_counter()
    task = model.task(task)
    if deviation is not None:
        task = task.remodelled(pf.reduced_mechanism(task, modes=[MODE], deviation=deviation))
    case = tracking_case(task, MODE)
    setup = time.perf_counter() - began
    solution = case.solve(IntegrationOptions(**asdict(setting)), None)
    return Run(case.places(solution)[:, 0], solution.wall_time, setup, steps=solution.steps)


def our_choices(task: TrackingTask, target: float, *, with_scipy: bool = True) -> Iterator[Choice]:
    """Second order, the paper's linear beams, and SciPy's Radau on the ordinary differential equations of those."""
    for model in (SECOND_ORDER, PAPER):

        def run(setting: Tolerance, model: BeamModel = model) -> Run:
            return run_paraflex(task, model, setting)

        def few(setting: Tolerance, model: BeamModel = model) -> Run:
            return run_paraflex(task, model, setting, deviation=target)

        fine = Tolerance("esdirk5", CONVERGED)
        path = run(fine).path
        converged = Converged(str(fine), path, distance(path, run(Tolerance("esdirk4", 5.0 * CONVERGED)).path))
        for method in ("tr-bdf2", "esdirk5"):
            name = f"paraflex {method}, {model.name}"
            controlled = [Tolerance(method, tolerance) for tolerance in TOLERANCES]
            fixed = [Tolerance(method, LEFT_TO_NEWTON[method], step) for step in STEPS]
            yield choose(name, controlled, run, converged, target)
            yield choose(f"{name}, fixed steps", fixed, run, converged, target)
            if model is SECOND_ORDER:
                # Off the path of all coordinates.
                yield choose(f"paraflex {method}, few coordinates", controlled, few, converged, target)
                yield choose(f"paraflex {method}, few coordinates, fixed steps", fixed, few, converged, target)
        if model is PAPER and with_scipy:
            settings = [Tolerance("radau", tolerance) for tolerance in TOLERANCES[::2]]
            yield choose("SciPy Radau on the ODE, linear", settings, run, converged, target)


# --- Exudyn and MuJoCo ---------------------------------------------------------------------------------------------


def exudyn_choice(task: TrackingTask, target: float) -> Choice:
    """Its fastest way to solve, then its coarsest step for each damping; the fastest of those."""
    problem = tracking_problem(task, MODE)

    def run(setting: ExudynSetting) -> Run:
        return run_exudyn(problem, setting)

    def seconds(way: ExudynSetting) -> float:
        try:
            return min(run(way).seconds for _ in range(3))
        except RuntimeError:
            return math.inf

    fine = ExudynSetting(80)
    path = run(fine).path
    # Of second order: half the step errs by a quarter.
    converged = Converged(str(fine), path, distance(path, run(ExudynSetting(40)).path) / 3.0)
    solvers = ("EigenSparse", "EXUdense", "EigenDense")
    ways = [ExudynSetting(10, 0.9, newton, solver) for newton, solver in itertools.product((True, False), solvers)]
    best = min(ways, key=seconds)
    counts = (2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 16, 18, 20, 23, 26, 30)
    found = []
    for radius in (1.0, 0.95, 0.9, 0.8, 0.6):
        settings = [ExudynSetting(count, radius, best.modified, best.solver) for count in counts]
        found.append(choose("Exudyn, ANCF cables", settings, run, converged, target))
    return fastest_of(found)


def fastest_of(choices: Sequence[Choice]) -> Choice:
    """The fastest of several choices of one engine by their trials, with all that was tried."""
    best = min(choices, key=lambda choice: math.inf if choice.trial is None else choice.trial.seconds)
    tried = [trial for choice in choices for trial in choice.tried]
    return Choice(best.name, best.converged, best.run, best.setting, best.trial, tried)


def mujoco_choices(task: TrackingTask, target: float, segments: int = 8) -> Iterator[Choice]:
    """Each integrator on the segments of the paper's virtual prototype."""
    cut = task.in_segments(proportional_segments(task.mechanism, segments))
    problem = tracking_problem(cut, MODE)

    def run(setting: MuJoCoSetting) -> Run:
        return run_mujoco(problem, setting)

    fine = MuJoCoSetting(60)
    path = run(fine).path
    converged = Converged(str(fine), path, distance(path, run(MuJoCoSetting(45)).path))
    counts = {"RK4": (12, 14, 16, 17, 18, 19, 20, 22, 24, 26, 28, 30, 33, 36, 40)}
    others = (20, 25, 30, 35, 40, 45, 50, 60, 70, 80, 90, 100, 120, 150, 180, 240)
    for integrator in ("RK4", "EULER", "IMPLICIT", "IMPLICITFAST", "DISCRETE"):
        settings = [MuJoCoSetting(count, integrator) for count in counts.get(integrator, others)]
        yield choose(f"MuJoCo {integrator}, {len(cut.system.bodies)} segments", settings, run, converged, target)


# --- The comparison ------------------------------------------------------------------------------------------------


def plan(duration: float) -> TrackingTask:
    """The study of RAParM-I on its square, a sample each millisecond."""
    model = pf.load("raparm_i")
    return pf.plan(model.mechanism, model.path("square"), duration=duration, samples=round(1e3 * duration) + 1)


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("--target", type=float, default=TARGET, help="deviation from the converged path [m]")
    parser.add_argument("--duration", type=float, default=DURATION, help="[s]")
    parser.add_argument("--repeats", type=int, default=REPEATS)
    parser.add_argument("--skip-scipy", action="store_true", help="it takes as long as all others")
    given = parser.parse_args()
    if given.folder and given.duration != DURATION:
        parser.error(f"--write is for the whole study: --duration {DURATION}")
    single_thread()
    # Exudyn's build without checks.
    setattr(sys, "exudynFast", True)  # noqa: B010
    for geometry in Geometry:
        compile_kernels(geometry)
    task, choices = plan(given.duration), []
    sources = (
        our_choices(task, given.target, with_scipy=not given.skip_scipy),
        (exudyn_choice(task, given.target) for _ in range(1)),
        mujoco_choices(task, given.target),
    )
    for choice in itertools.chain(*sources):
        choices.append(choice)
        found = f"nothing tried is within {given.target:g} m" if choice.setting is None else choice.setting
        print(f"{choice.name}: {found}", flush=True)
    results = [asdict(result) for result in timed(choices, given.repeats)]
    print_results(results)
    write_json(
        "peers",
        {
            "mode": MODE, "target": given.target, "duration": given.duration, "repeats": given.repeats,
            "leads": leads(results),
            "results": results,
            "not_close_enough": {choice.name: choice.tried for choice in choices if choice.setting is None},
        },
        given.folder,
    )  # fmt: skip
    if given.folder:
        write_page(readme_table(results, given.duration), README)


if __name__ == "__main__":
    main()
