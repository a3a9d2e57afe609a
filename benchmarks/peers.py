"""RAParM-I against Exudyn, MuJoCo and SciPy: same torques and start, each at its fastest setting that is close enough.

    python benchmarks/peers.py [--target METRES] [--duration S] [--repeats N] [--out DIR]

Mode ++++ on the square, reference set, all 104 coordinates, 0.7 s, one thread each, kernels warm. Close enough is an
end-effector nowhere further than the target from the path that the same model takes with much finer steps: models
differ (the linear shape, second order, exact beams, rigid segments), and none is charged for being another. Settings
are searched from coarse to fine; what counts is the median wall time of several runs of the first that is within the
target together with the next finer one. Integration alone is timed, making and assembling the model is told beside it.

Exudyn is tried with full and modified Newton, dense and sparse matrices and several numerical dampings; its torques are
set by a function of Python before each step, whose time is told and taken off in a column of its own. MuJoCo is tried
with each of its integrators; it runs without Python, in its own rollout. Takes some minutes.
"""

from __future__ import annotations

import argparse
import itertools
import math
import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from common import Trial, coarsest_within, single_thread, table, write_json
from numpy.typing import NDArray

import paraflex as pf
from paraflex.compilation import compile_kernels
from paraflex.errors import NumericalError
from paraflex.integrators import IntegrationOptions
from paraflex.mechanism import Geometry, proportional_segments
from paraflex.simulate import TrackingTask
from paraflex.studies import tracking_case

MODE, TARGET, DURATION, REPEATS = "++++", 1.2e-5, 0.7, 5
# Leads to reach over Exudyn and MuJoCo, and times [s] of TR-BDF2 and of the best method.
LEADS, GOALS = {"Exudyn": 10.0, "MuJoCo": 40.0}, {"TR-BDF2": 0.10, "the best method": 0.05}
TOLERANCES = tuple(1e-3 * 10.0 ** (-k / 8.0) for k in range(33))
CONVERGED = 1e-7


@dataclass(frozen=True)
class Run:
    """One run of whatever model.

    Attributes
    ----------
    path : (k, 2) array
        Of the end-effector at the samples [m].
    seconds : float
        Of the integration.
    setup : float
        Of making and assembling the model [s].
    python : float
        Part of `seconds` spent in functions of ours that the engine calls [s].
    steps : int
    """

    path: NDArray[np.float64]
    seconds: float
    setup: float
    python: float = 0.0
    steps: int = 0


@dataclass(frozen=True)
class Result:
    """An engine at its fastest setting that is close enough, or why there is none."""

    name: str
    setting: str
    converged: str
    uncertainty: float | None = None
    deviation: float | None = None
    seconds: float | None = None
    without_python: float | None = None
    fastest: float | None = None
    slowest: float | None = None
    setup: float | None = None
    steps: int | None = None
    reason: str = ""
    tried: list[dict[str, Any]] = field(default_factory=list)


def distance(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    """Largest between two paths at the same times [m]; infinite for one that ended early or is no longer finite."""
    if one.shape != other.shape or not np.isfinite(one).all():
        return math.inf
    return float(np.max(np.linalg.norm(one - other, axis=-1)))


def measure(
    name: str,
    settings: Sequence[Any],
    run: Callable[[Any], Run],
    converged: tuple[str, NDArray[np.float64], float],
    target: float,
    repeats: int,
) -> Result:
    """The fastest setting of a family, coarse to fine, and its median time."""
    words, path, uncertainty = converged
    tried: list[dict[str, Any]] = []

    def attempt(setting: Any) -> Trial:
        try:
            found = run(setting)
        except (NumericalError, RuntimeError) as error:
            tried.append({"setting": str(setting), "reason": str(error)[:200]})
            return Trial(math.inf, math.inf)
        error = distance(found.path, path)
        tried.append({"setting": str(setting), "deviation": _plain(error), "seconds": found.seconds})
        return Trial(error, found.seconds)

    chosen = coarsest_within(settings, attempt, target)
    if chosen is None:
        return Result(name, "", words, uncertainty, reason=f"nothing tried is within {target:.1e} m", tried=tried)
    setting, trial = chosen
    runs = [run(setting) for _ in range(repeats)]
    times = [one.seconds for one in runs]
    return Result(
        name=name,
        setting=str(setting),
        converged=words,
        uncertainty=uncertainty,
        deviation=trial.error,
        seconds=statistics.median(times),
        without_python=statistics.median(one.seconds - one.python for one in runs),
        fastest=min(times),
        slowest=max(times),
        setup=statistics.median(one.setup for one in runs),
        steps=runs[0].steps,
        tried=tried,
    )


def _plain(value: float) -> float | None:
    return value if math.isfinite(value) else None


# --- paraflex, and SciPy on its equations --------------------------------------------------------------------------


@dataclass(frozen=True)
class Tolerance:
    """A method at a tolerance [m]."""

    method: str
    tolerance: float

    def __str__(self) -> str:
        return f"{self.method}, {self.tolerance:.2g} m"


def run_paraflex(task: TrackingTask, geometry: Geometry, setting: Tolerance) -> Run:
    """Our own run; set-up is that of the system from the mechanism."""
    began = time.perf_counter()
    case = tracking_case(task.remodelled(task.mechanism.with_geometry(geometry)), MODE)
    setup = time.perf_counter() - began
    solution = case.solve(IntegrationOptions(method=setting.method, tolerance=setting.tolerance), None)
    return Run(case.places(solution)[:, 0], solution.wall_time, setup, steps=solution.steps)


def our_results(task: TrackingTask, target: float, repeats: int, *, with_scipy: bool = True) -> Iterator[Result]:
    """Both geometries, and SciPy's Radau on the ordinary differential equations of the linear one."""
    for geometry, methods in (
        (Geometry.LINEAR, ("tr-bdf2", "esdirk5")),
        (Geometry.SECOND_ORDER, ("tr-bdf2", "esdirk5")),
    ):

        def run(setting: Tolerance, geometry: Geometry = geometry) -> Run:
            return run_paraflex(task, geometry, setting)

        path = run(Tolerance("esdirk5", CONVERGED)).path
        uncertainty = distance(path, run(Tolerance("esdirk4", 5.0 * CONVERGED)).path)
        converged = (f"esdirk5, {CONVERGED:g} m", path, uncertainty)
        for method in methods:
            settings = [Tolerance(method, tolerance) for tolerance in TOLERANCES]
            yield measure(f"paraflex {method}, {geometry.value}", settings, run, converged, target, repeats)
        if geometry is Geometry.LINEAR and with_scipy:
            settings = [Tolerance("radau", tolerance) for tolerance in TOLERANCES[::2]]
            yield measure("SciPy Radau on the ODE, linear", settings, run, converged, target, 1)


# --- Exudyn --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class ExudynSetting:
    """Equal steps between samples, and how Exudyn solves them."""

    substeps: int
    spectral_radius: float = 0.9
    modified: bool = True
    solver: str = "EigenSparse"

    def __str__(self) -> str:
        newton = "modified" if self.modified else "full"
        return f"{self.substeps} steps a sample, radius {self.spectral_radius:g}, {newton} Newton, {self.solver}"


def run_exudyn(task: TrackingTask, setting: ExudynSetting) -> Run:
    """ANCF cables on the mesh of the beams; the end-effector is recorded by a sensor of the engine."""
    from paraflex.engines import exudyn as adapter
    from paraflex.engines.cables import Cable

    times, torques = task.motion.t, task.torques(MODE)
    began = time.perf_counter()
    engine = adapter._start_engine()
    exu, mbs = engine.exu, engine.mbs
    with adapter._silent(exu):
        model = adapter._build(engine, task, 1)
        sensor = _end_effector_sensor(engine, model, task)
        grid = np.linspace(times[0], times[-1], setting.substeps * (times.size - 1) + 1)
        driver = _Driver(model.loads, torques.evaluate(grid))
        options = adapter.ExudynOptions(spectral_radius=setting.spectral_radius)
        reference = mbs.systemData.GetODE2Coordinates(exu.ConfigurationType.Reference)
        rounding = [link.rounding(reference) for link in model.linkage.bodies.values() if isinstance(link, Cable)]
        settings = adapter._settings(exu, grid, options, adapter._FLOOR * max(rounding, default=0.0))
        settings.timeIntegration.newton.useModifiedNewton = setting.modified
        settings.linearSolver.solverType = getattr(exu.LinearSolverType, setting.solver)
        settings.solution.sensors.active = True
        settings.solution.sensors.writePeriod = 1e-12
        driver.before(mbs, grid[0])
        mbs.SetPreStepUserFunction(driver.before)
        solver = exu.MainSolverImplicitSecondOrder()
        setup = time.perf_counter() - began
        driver.seconds, began = 0.0, time.perf_counter()
        try:
            if solver.InitializeSolver(mbs, settings):
                solver.SolveSteps(mbs, settings)
            solver.FinalizeSolver(mbs, settings)
        except exu.ExudynError as error:
            raise RuntimeError(str(error)) from None
        seconds = time.perf_counter() - began
        mbs.SetPreStepUserFunction(0)
        path = np.array(mbs.GetSensorStoredData(sensor))[:: setting.substeps, 1:3]
    return Run(path, seconds, setup, driver.seconds, grid.size - 1)


def _end_effector_sensor(engine: Any, model: Any, task: TrackingTask) -> int:
    effector = task.mechanism.end_effector
    assert effector is not None
    place = model.linkage.part(effector.point).place(effector.point.point)
    position = engine.exu.OutputVariableType.Position
    sensor = engine.items.SensorBody(**place, storeInternal=True, outputVariableType=position)
    number = engine.mbs.AddSensor(sensor)
    engine.mbs.Assemble()
    return number


@dataclass
class _Driver:
    """Sets the torques of every step, at its end, and clocks itself."""

    loads: list[list[tuple[int, float]]]
    torques: NDArray[np.float64]
    steps: int = 0
    seconds: float = 0.0

    def before(self, mbs: Any, _: float) -> bool:
        began = time.perf_counter()
        for torque, sides in zip(self.torques[self.steps].tolist(), self.loads, strict=True):
            for load, sign in sides:
                mbs.SetLoadParameter(load, "loadVector", [0.0, 0.0, sign * torque])
        self.steps = min(self.steps + 1, len(self.torques) - 1)
        self.seconds += time.perf_counter() - began
        return True


def exudyn_results(task: TrackingTask, target: float, repeats: int) -> Iterator[Result]:
    """Its fastest way to solve, then its coarsest step for each damping; the fastest of those counts."""
    fine = ExudynSetting(80)
    path = run_exudyn(task, fine).path
    uncertainty = distance(path, run_exudyn(task, ExudynSetting(40)).path) / 3.0
    ways = [
        ExudynSetting(10, 0.9, modified, solver)
        for modified, solver in itertools.product((True, False), ("EigenSparse", "EXUdense", "EigenDense"))
    ]
    seconds = {way: min(_seconds_or_never(task, way) for _ in range(2)) for way in ways}
    best = min(seconds, key=lambda way: seconds[way])
    counts = (2, 3, 4, 5, 6, 7, 8, 10, 12, 14, 16, 18, 20, 23, 26, 30)
    found = []
    for radius in (1.0, 0.95, 0.9, 0.8, 0.6):
        settings = [ExudynSetting(count, radius, best.modified, best.solver) for count in counts]
        result = measure(
            f"Exudyn, radius {radius:g}", settings, lambda setting: run_exudyn(task, setting),
            (str(fine), path, uncertainty), target, repeats,
        )  # fmt: skip
        found.append(result)
    yield fastest_of("Exudyn, ANCF cables", found)


def _seconds_or_never(task: TrackingTask, setting: ExudynSetting) -> float:
    try:
        return run_exudyn(task, setting).seconds
    except RuntimeError:
        return math.inf


def fastest_of(name: str, results: Sequence[Result]) -> Result:
    """The fastest of several results under one name, with all that was tried."""
    tried = [trial for result in results for trial in result.tried]
    timed = [result for result in results if result.seconds is not None]
    if not timed:
        return Result(name, "", results[0].converged, results[0].uncertainty, reason=results[0].reason, tried=tried)
    best = min(timed, key=lambda result: result.seconds or math.inf)
    return Result(**{**asdict(best), "name": name, "tried": tried})


# --- MuJoCo --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class MuJoCoSetting:
    """Equal steps between samples, and MuJoCo's integrator."""

    substeps: int
    integrator: str = "RK4"

    def __str__(self) -> str:
        return f"{self.integrator}, {self.substeps} steps a sample"


def run_mujoco(task: TrackingTask, setting: MuJoCoSetting) -> Run:
    """Finite segments; torques of the middle of a step act throughout it, which errs by far less than a step does."""
    import mujoco
    from mujoco import rollout

    from paraflex.engines import mujoco as adapter
    from paraflex.engines.tree import body_motion, joint_state, spanning_tree
    from paraflex.results.motion import point_motion

    times, torques = task.motion.t, task.torques(MODE)
    began = time.perf_counter()
    tree = spanning_tree(task.mechanism)
    step = float(times[1] - times[0]) / setting.substeps
    model = adapter._model(mujoco, task.system, tree, step)
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{setting.integrator}")
    model.opt.enableflags = 0
    data = mujoco.MjData(model)
    order = np.array([model.joint(link.name).dofadr[0] for link in tree.links])
    data.qpos[order], data.qvel[order] = joint_state(task, tree)
    selection = np.zeros((model.nv, len(task.mechanism.motors)))
    for k, motor in enumerate(task.mechanism.motors):
        selection[order, k] = tree.relative_angle(task.mechanism.joint(motor.joint))
    middles = times[0] + step * (np.arange(setting.substeps * (times.size - 1)) + 0.5)
    control = torques.evaluate(middles) @ selection.T
    physics = mujoco.mjtState.mjSTATE_FULLPHYSICS
    start = np.zeros(mujoco.mj_stateSize(model, physics))
    mujoco.mj_getState(model, data, start, physics)
    setup, began = time.perf_counter() - began, time.perf_counter()
    states, _ = rollout.rollout(model, data, start, control, control_spec=int(mujoco.mjtState.mjSTATE_QFRC_APPLIED))
    seconds = time.perf_counter() - began
    kept = np.vstack([start, states[0, setting.substeps - 1 :: setting.substeps]])
    position, velocity = kept[:, 1 : 1 + model.nq], kept[:, 1 + model.nq : 1 + 2 * model.nq]
    joints = (position[:, order], velocity[:, order], np.zeros_like(velocity))
    effector = task.mechanism.end_effector
    assert effector is not None
    path = point_motion(task.system, effector.point, *body_motion(task.system, tree, joints)).position
    return Run(path, seconds, setup, steps=control.shape[0])


def mujoco_results(task: TrackingTask, target: float, repeats: int, segments: int = 8) -> Iterator[Result]:
    """Each integrator on the segments of the paper's virtual prototype."""
    cut = task.in_segments(proportional_segments(task.mechanism, segments))
    fine = MuJoCoSetting(60)
    path = run_mujoco(cut, fine).path
    converged = (str(fine), path, distance(path, run_mujoco(cut, MuJoCoSetting(45)).path))
    counts = {"RK4": (14, 16, 18, 20, 22, 24, 26, 28, 30, 33, 36, 40)}
    other = (30, 45, 60, 90, 120, 180, 240)
    for integrator in ("RK4", "EULER", "IMPLICIT", "IMPLICITFAST", "DISCRETE"):
        settings = [MuJoCoSetting(count, integrator) for count in counts.get(integrator, other)]
        yield measure(
            f"MuJoCo {integrator}, {len(cut.system.bodies)} segments", settings,
            lambda setting: run_mujoco(cut, setting), converged, target, repeats if integrator == "RK4" else 1,
        )  # fmt: skip


# --- The comparison ------------------------------------------------------------------------------------------------


def plan(duration: float) -> TrackingTask:
    """The study of RAParM-I on its square, a sample each millisecond."""
    model = pf.load("raparm_i")
    return pf.plan_tracking(model.mechanism, model.path("square"), duration=duration, samples=round(1e3 * duration) + 1)


def leads(results: Sequence[Result]) -> dict[str, Any]:
    """How many times faster paraflex's methods are than the best of every other engine, and whether goals are met."""
    times = {result.name: result.seconds for result in results if result.seconds is not None}
    ours = {name: seconds for name, seconds in times.items() if name.startswith("paraflex")}
    out: dict[str, Any] = {}
    for engine, goal in LEADS.items():
        theirs = [seconds for name, seconds in times.items() if name.startswith(engine)]
        if theirs and ours:
            out[engine] = {
                "goal": goal,
                "seconds": min(theirs),
                "ratios": {name: min(theirs) / seconds for name, seconds in ours.items()},
            }
    return out


def print_results(results: Sequence[Result]) -> None:
    """The table."""
    default = next((r.seconds for r in results if r.name == "paraflex tr-bdf2, linear"), None)
    rows = []
    for r in results:
        if r.seconds is None or r.deviation is None or r.setup is None or r.without_python is None:
            rows.append([r.name, r.reason, "", "", "", "", "", ""])
            continue
        times = [f"{r.seconds:.3f}", f"{r.without_python:.3f}", f"{r.fastest:.3f}-{r.slowest:.3f}", f"{r.setup:.3f}"]
        ratio = "" if default is None else f"{r.seconds / default:.1f}"
        rows.append([r.name, r.setting, f"{r.deviation:.1e}", *times, ratio])
    print(table(["", "setting", "off by [m]", "time [s]", "less Python", "from-to", "set-up", "ratio"], rows))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--target", type=float, default=TARGET, help="deviation from the converged path [m]")
    parser.add_argument("--duration", type=float, default=DURATION, help="[s]")
    parser.add_argument("--repeats", type=int, default=REPEATS)
    parser.add_argument("--skip-scipy", action="store_true", help="it takes minutes")
    parser.add_argument("--out", help="folder for peers.json")
    given = parser.parse_args()
    single_thread()
    import sys

    # Exudyn's build without checks.
    sys.exudynFast = True  # type: ignore[attr-defined]
    for geometry in Geometry:
        compile_kernels(geometry)
    task, results = plan(given.duration), []
    sources = (
        our_results(task, given.target, given.repeats, with_scipy=not given.skip_scipy),
        exudyn_results(task, given.target, given.repeats),
        mujoco_results(task, given.target, given.repeats),
    )
    for result in itertools.chain(*sources):
        results.append(result)
        print(f"{result.name}: {result.reason or f'{result.seconds:.3f} s'}", flush=True)
    print_results(results)
    found = leads(results)
    for engine, lead in found.items():
        for name, ratio in lead["ratios"].items():
            print(f"{name}: {ratio:.1f} times {engine} (goal of the linear model: {lead['goal']:.0f})")
    write_json(
        "peers",
        {
            "mode": MODE, "target": given.target, "duration": given.duration, "repeats": given.repeats,
            "goals": {"seconds": GOALS, "leads": LEADS}, "leads": found,
            "results": [asdict(result) for result in results],
        },
        given.out,
    )  # fmt: skip


if __name__ == "__main__":
    main()
