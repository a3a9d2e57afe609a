"""Simulation in MuJoCo: finite segments as a tree of hinges, with loops closed by equality constraints.

MuJoCo uses joint angles as coordinates. Joints with springs or gears enter the tree first, then those with motors; the
remaining joints close loops. Springs are explicit, so the step size must resolve the stiffest pair of segments. The
integrator is RK4.
"""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from paraflex.actuation import FeedForward, actuation_condition
from paraflex.arrays import Array
from paraflex.dynamics import System, still_signals
from paraflex.errors import IntegrationError, Moment
from paraflex.integrators import Solution
from paraflex.kernel.bodies import weight_work
from paraflex.kernel.packed import make_scratch
from paraflex.mechanism import GROUND, ActuationMode, Joint, Mechanism, Relation, proportional_segments
from paraflex.mechanism.actuation_modes import check_torques
from paraflex.results.record import Record, record
from paraflex.tracking import TrackingRun, TrackingTask
from .common import check_dwell, check_engine, import_engine, steps_between
from .tree import Tree, body_motion, joint_state, spanning_tree

# Weights of the RK4 stages, for the work of the motors.
_RK4 = (1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0)
# Time constant of MuJoCo's constraints, which are springs, in steps; two is the smallest that it allows.
_TIME_CONSTANT = 2.0
# Impedance of a constraint: 1 enforces it exactly; this is the upper limit of MuJoCo.
_IMPEDANCE = 0.9999
_SOLVER_TOLERANCE = 1e-12
# Callbacks and warnings are global in MuJoCo, so runs are serialised.
_ONE_AT_A_TIME = threading.Lock()


@dataclass(frozen=True)
class MuJoCoOptions:
    """Options of MuJoCo's integration.

    Attributes
    ----------
    step : float
        Largest step size [s], 1/30000 by default; it is reduced to divide the time between samples.
    segments : int
        Number of segments of the longest flexible beam, 8 by default; other beams have a number in proportion to their
        length. It has no effect if the task has finite segments already.
    """

    step: float = 1.0 / 30000.0
    segments: int = 8


def simulate_mujoco(task: TrackingTask, mode: str | ActuationMode, options: MuJoCoOptions | None = None) -> Record:
    """Simulate the mechanism of finite segments in MuJoCo, driven by the feed-forward torques of a mode.

    Parameters
    ----------
    task : TrackingTask
        Tracking task, with or without finite segments.
    mode : str or ActuationMode
        Actuation mode: its name, signs ("+-+-") or motor names ("tau1,tau5").
    options : MuJoCoOptions, optional
        Options of the integration.

    Returns
    -------
    Record
        Results by link of the original mechanism. Joint forces are not available.

    Raises
    ------
    InputError
        MuJoCo is not installed, or does not support a member of the mechanism, such as a prescribed angle.
    IntegrationError
        The run diverges; the error has the Record of the samples computed.
    """
    check_engine("mujoco", task.mechanism)
    check_dwell("mujoco", task)
    mujoco = import_engine("mujoco")
    options = options or MuJoCoOptions()
    began = time.perf_counter()
    task = task if task.whole is not None else task.in_segments(proportional_segments(task.mechanism, options.segments))
    torques = task.torques(mode)
    check_torques(torques.mode, "MuJoCo", task.mechanism.motors)
    tree = spanning_tree(task.mechanism)
    count = steps_between(task.motion.t, options.step)
    model = _model(mujoco, task.system, tree, float(task.motion.t[1] - task.motion.t[0]) / count)
    motion = _march(mujoco, model, task, torques, tree, count)
    q, v, a = body_motion(task.system, tree, motion.joints)
    run = TrackingRun(
        task,
        torques,
        actuation_condition(task.effort, torques.mode),
        _solution(task, q, v, a, motion, count, time.perf_counter() - began),
        method=f"MuJoCo {mujoco.__version__}, RK4",
    )
    if motion.failure:
        reached = task.motion.t[motion.samples - 1]
        moment = Moment(float(reached), (motion.samples - 1) * count)
        raise IntegrationError(motion.failure, moment, record(run), "give it a shorter step")
    return record(run)


def _model(mujoco: Any, system: System, tree: Tree, step: float) -> Any:
    """Return MuJoCo's model of the tree, with all angles zero in the reference pose."""
    spec = mujoco.MjSpec()
    spec.option.timestep = step
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
    spec.option.gravity = [*system.mechanism.gravity, 0.0]
    spec.option.tolerance = _SOLVER_TOLERANCE
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    spec.option.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
    bodies = {GROUND: spec.worldbody}
    for link in tree.links:
        own = system.marker(link.own).x0
        s = system.body(link.name).integrals
        centre = s.S1 / s.m
        body = bodies[link.parent].add_body(name=link.name, pos=[*(system.marker(link.other).x0 - own), 0.0])
        body.mass, body.ipos = s.m, [*centre, 0.0]
        body.inertia = [s.I0 + s.J - s.m * float(centre @ centre)] * 3
        body.explicitinertial = True
        body.add_joint(name=link.name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0.0, 0.0, 1.0], pos=[*own, 0.0])
        bodies[link.name] = body
    _add_springs(spec, system.mechanism, tree)
    for joint in tree.closing:
        _close(mujoco, spec, system, joint, bodies, step)
    for one in system.mechanism.relations:
        _add_relation(mujoco, spec, one, tree, step)
    return spec.compile()


def _add_springs(spec: Any, mechanism: Mechanism, tree: Tree) -> None:
    hinge = {link.joint.name: link for link in tree.links}
    for spring in mechanism.springs:
        link = hinge[spring.joint]
        joint = spec.joint(link.name)
        # Linear, quadratic and cubic stiffness.
        joint.stiffness = [spring.stiffness, 0.0, 0.0]
        joint.springref = link.sign * spring.rest


def _add_relation(mujoco: Any, spec: Any, one: Relation, tree: Tree, step: float) -> None:
    """Add a relation of two hinges as an equality constraint with a polynomial of degree one."""
    hinge = {link.joint.name: link for link in tree.links}
    first, second = (hinge[name] for name in one.joints)
    of_joints = mujoco.mjtEq.mjEQ_JOINT, mujoco.mjtObj.mjOBJ_JOINT
    equality = _add_equality(spec, one.name, of_joints, [second.name, first.name], step)
    assert one.phase is not None
    equality.data[:2] = second.sign * one.phase, second.sign * one.transmission * first.sign


def _close(mujoco: Any, spec: Any, system: System, joint: Joint, bodies: dict, step: float) -> None:
    sites = []
    for side, ref in (("a", joint.a), ("b", joint.b)):
        name = f"{joint.name} {side}"
        bodies[ref.body].add_site(name=name, pos=[*system.marker(ref).x0, 0.0])
        sites.append(name)
    _add_equality(spec, joint.name, (mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtObj.mjOBJ_SITE), sites, step)


def _add_equality(spec: Any, name: str, kinds: tuple[Any, Any], pair: list[str], step: float) -> Any:
    """Add an equality constraint of two objects of the same type, as stiff as the step size allows."""
    equality = spec.add_equality(name=name, type=kinds[0], objtype=kinds[1], name1=pair[0], name2=pair[1])
    equality.solref = [_TIME_CONSTANT * step, 1.0]
    equality.solimp = [_IMPEDANCE, _IMPEDANCE, 1.0, 0.5, 1.0]
    return equality


@dataclass(frozen=True)
class _JointMotion:
    """Results of MuJoCo at the samples reached: joint angles with two derivatives, energies, work and error message."""

    joints: tuple[Array, Array, Array]
    energy: Array
    work: Array
    failure: str

    @property
    def samples(self) -> int:
        return self.joints[0].shape[0]


def _march(mujoco: Any, model: Any, task: TrackingTask, torques: FeedForward, tree: Tree, count: int) -> _JointMotion:
    times, step = task.motion.t, model.opt.timestep
    data = mujoco.MjData(model)
    # MuJoCo has its own order of joints.
    order = np.array([model.joint(link.name).dofadr[0] for link in tree.links])
    data.qpos[order], data.qvel[order] = joint_state(task, tree)
    halves = times[0] + 0.5 * step * np.arange(2 * count * (times.size - 1) + 1)
    selection = np.zeros((model.nv, len(task.mechanism.motors)))
    for k, motor in enumerate(task.mechanism.motors):
        selection[order, k] = tree.relative_angle(task.mechanism.joint(motor.joint))
    table = torques.evaluate(np.minimum(halves, times[-1])) @ selection.T
    work, stage = 0.0, -1

    def control(_: Any, now: Any) -> None:
        nonlocal work, stage
        force = table[min(round(2.0 * now.time / step), table.shape[0] - 1)]
        now.qfrc_applied[:] = force
        if stage >= 0:
            work += _RK4[stage % 4] * step * float(force @ now.qvel)
            stage += 1

    kept: list[list[Any]] = [[], [], [], [], []]
    trouble = ""
    with _control_of(mujoco, control) as warnings:
        for sample in range(times.size):
            if sample:
                stage = 0
                mujoco.mj_step(model, data, count)
                stage = -1
            mujoco.mj_forward(model, data)
            if warnings or not (np.isfinite(data.qacc).all() and np.isfinite(data.qpos).all()):
                trouble = f"MuJoCo diverges with steps of {step:.3g} s"
                break
            values = (data.qpos[order], data.qvel[order], data.qacc[order], data.energy, work)
            for rows, value in zip(kept, values, strict=True):
                rows.append(np.array(value))
    position, velocity, acceleration, energy, done = (np.array(rows) for rows in kept)
    return _JointMotion((position, velocity, acceleration), energy, done, trouble)


@contextmanager
def _control_of(mujoco: Any, control: Any) -> Iterator[list[str]]:
    """Set MuJoCo's global callbacks for one run: torques at every stage, and a list of warnings, such as resets."""
    warnings: list[str] = []
    with _ONE_AT_A_TIME:
        mujoco.set_mjcb_control(control)
        mujoco.set_mju_user_warning(warnings.append)
        try:
            yield warnings
        finally:
            mujoco.set_mjcb_control(None)
            mujoco.set_mju_user_warning(None)


def _solution(
    task: TrackingTask, q: Array, v: Array, a: Array, motion: _JointMotion, count: int, wall_time: float
) -> Solution:
    system, times = task.system, task.motion.t
    signals, _ = still_signals(task.mechanism, float(times[-1]))
    gaps = [system.constraints(signals, t, *state) for t, *state in zip(times, q, v, strict=False)]
    # MuJoCo includes gravity in the potential energy; here it is part of the work.
    scratch = make_scratch(system.packed)
    weight = np.array([weight_work(system.packed, state, scratch) for state in q])
    kinetic, strain = motion.energy[:, 1], motion.energy[:, 0] + weight
    work = motion.work + weight - weight[:1]
    balance = kinetic + strain - kinetic[:1] - strain[:1] - work
    reached = times[: motion.samples]
    return Solution(
        t=reached,
        q=q,
        v=v,
        a=a,
        multipliers=np.full((q.shape[0], system.m), np.nan),
        kinetic_energy=kinetic,
        strain_energy=strain,
        work=work,
        status="failed" if motion.failure else "complete",
        message=motion.failure,
        steps=count * (motion.samples - 1),
        factorisations=4 * count * (motion.samples - 1),
        wall_time=wall_time,
        constraint_position_max=float(max((np.abs(phi).max(initial=0.0) for phi, _ in gaps), default=0.0)),
        constraint_velocity_max=float(max((np.abs(rate).max(initial=0.0) for _, rate in gaps), default=0.0)),
        energy_balance_max=float(np.abs(balance).max(initial=0.0)),
    )
