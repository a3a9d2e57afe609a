"""Engines that a motion is run by for the benchmarks: paraflex, Exudyn, MuJoCo; integration timed apart from set-up.

Other than in `paraflex.engines`, from where the models come, nothing of Python is left in the time loops that an engine
can do without: Exudyn records the motion by a sensor, MuJoCo runs in its own rollout.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paraflex.dynamics import State, System
from paraflex.mechanism import Mechanism, PointRef
from paraflex.tracking import TrackingTask

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Problem:
    """A motion that engines are to run.

    Attributes
    ----------
    mechanism, system, start
        As in `TrackingTask`.
    times : (k,) array
        Samples, evenly spaced from the start [s].
    point : PointRef
        Whose path is compared.
    torques : callable
        Of all motors (times, motors) [N m].
    """

    mechanism: Mechanism
    system: System
    start: State
    times: Array
    point: PointRef
    torques: Callable[[Array], Array]


def tracking_problem(task: TrackingTask, mode: str) -> Problem:
    """A mode of a task."""
    effector = task.mechanism.end_effector
    assert effector is not None
    torques = task.torques(mode).evaluate
    return Problem(task.mechanism, task.system, task.start, task.motion.t, effector.point, torques)


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

    path: Array
    seconds: float
    setup: float
    python: float = 0.0
    steps: int = 0


def distance(one: Array, other: Array) -> float:
    """Largest between two paths at the same times [m]; infinite for one that ended early or is no longer finite."""
    if one.shape != other.shape or not np.isfinite(one).all():
        return math.inf
    return float(np.max(np.linalg.norm(one - other, axis=-1)))


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


def run_exudyn(problem: Problem, setting: ExudynSetting) -> Run:
    """ANCF cables on the mesh of the beams; the point is recorded by a sensor of the engine."""
    from paraflex.engines import exudyn as adapter
    from paraflex.engines.cables import Cable

    began = time.perf_counter()
    engine = adapter._start_engine()
    exu, mbs = engine.exu, engine.mbs
    with adapter._silent(exu):
        # Of a task it takes what a problem has as well.
        task: Any = problem
        model = adapter._build(engine, task, 1)
        sensor = _sensor(engine, model, problem.point)
        times = problem.times
        grid = np.linspace(times[0], times[-1], setting.substeps * (times.size - 1) + 1)
        driver = _Driver(model.loads, problem.torques(grid))
        options = adapter.ExudynOptions(spectral_radius=setting.spectral_radius)
        reference = mbs.systemData.GetODE2Coordinates(exu.ConfigurationType.Reference)
        rounding = [link.rounding(reference) for link in model.linkage.bodies.values() if isinstance(link, Cable)]
        settings = adapter._settings(exu, grid, options, adapter._FLOOR * max(rounding, default=0.0))
        settings.timeIntegration.newton.useModifiedNewton = setting.modified
        settings.linearSolver.solverType = getattr(exu.LinearSolverType, setting.solver)
        settings.solution.sensors.active = True
        settings.solution.sensors.writePeriod = 1e-12
        if model.loads:
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


def _sensor(engine: Any, model: Any, point: PointRef) -> int:
    place = model.linkage.part(point).place(point.point)
    position = engine.exu.OutputVariableType.Position
    number = engine.mbs.AddSensor(
        engine.items.SensorBody(**place, storeInternal=True, outputVariableType=position, writeToFile=False)
    )
    engine.mbs.Assemble()
    return number


@dataclass
class _Driver:
    """Sets the torques of every step, at its end, and clocks itself."""

    loads: list[list[tuple[int, float]]]
    torques: Array
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


@dataclass(frozen=True)
class MuJoCoSetting:
    """Equal steps between samples, and MuJoCo's integrator."""

    substeps: int
    integrator: str = "RK4"

    def __str__(self) -> str:
        return f"{self.integrator}, {self.substeps} steps a sample"


def run_mujoco(problem: Problem, setting: MuJoCoSetting) -> Run:
    """Rigid bodies; torques of the middle of a step act throughout it, which errs by far less than a step does.

    Raises
    ------
    RuntimeError
        It warned of anything: it starts anew when a motion is no longer finite.
    """
    from paraflex.engines import mujoco as adapter
    from paraflex.engines.common import import_engine
    from paraflex.engines.tree import joint_state, spanning_tree

    mujoco, rollout = import_engine("mujoco"), import_engine("mujoco.rollout")
    times, warnings = problem.times, list[str]()
    began = time.perf_counter()
    tree = spanning_tree(problem.mechanism)
    step = float(times[1] - times[0]) / setting.substeps
    model = adapter._model(mujoco, problem.system, tree, step)
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{setting.integrator}")
    model.opt.enableflags = 0
    data = mujoco.MjData(model)
    order = np.array([model.joint(link.name).dofadr[0] for link in tree.links])
    # Of a task it takes what a problem has as well.
    task: Any = problem
    data.qpos[order], data.qvel[order] = joint_state(task, tree)
    middles = times[0] + step * (np.arange(setting.substeps * (times.size - 1)) + 0.5)
    control = _hinge_torques(problem, tree, order, middles)
    physics = mujoco.mjtState.mjSTATE_FULLPHYSICS
    start = np.zeros(mujoco.mj_stateSize(model, physics))
    mujoco.mj_getState(model, data, start, physics)
    mujoco.set_mju_user_warning(warnings.append)
    setup, began = time.perf_counter() - began, time.perf_counter()
    acting = int(mujoco.mjtState.mjSTATE_QFRC_APPLIED)
    states, _ = rollout.rollout(model, data, start, control, control_spec=acting)
    seconds = time.perf_counter() - began
    mujoco.set_mju_user_warning(None)
    if warnings:
        raise RuntimeError(warnings[0])
    kept = np.vstack([start, states[0, setting.substeps - 1 :: setting.substeps]])[:, 1 : 1 + 2 * model.nq]
    return Run(_path(problem, tree, kept[:, order], kept[:, model.nq + order]), seconds, setup, steps=len(control))


def _hinge_torques(problem: Problem, tree: Any, order: NDArray[np.int64], times: Array) -> Array:
    """Torques of the motors as those of MuJoCo's hinges (times, hinges)."""
    selection = np.zeros((len(order), len(problem.mechanism.motors)))
    for k, motor in enumerate(problem.mechanism.motors):
        selection[order, k] = tree.relative_angle(problem.mechanism.joint(motor.joint))
    return problem.torques(times) @ selection.T


def _path(problem: Problem, tree: Any, angles: Array, rates: Array) -> Array:
    """Of the point, from angles and rates of the hinges (k, hinges)."""
    from paraflex.dynamics.points import point_motion
    from paraflex.engines.tree import body_motion

    motion = body_motion(problem.system, tree, (angles, rates, np.zeros_like(rates)))
    return point_motion(problem.system, problem.point, *motion).position
