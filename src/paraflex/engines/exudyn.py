"""Simulation of a tracking task in Exudyn: beams as geometrically exact planar ANCF cables, with the same torques.

The comparison is with another formulation and another integrator. Bending and stretching of cables are given by the
exact curvature and length of the centre line (cubic in position and slope vector, with the nodes of paraflex). There is
no floating frame and no assumption of small slopes.
"""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from paraflex.actuation import FeedForward, actuation_condition
from paraflex.arrays import Array, Indices
from paraflex.dynamics import System
from paraflex.errors import InputError, IntegrationError, Moment
from paraflex.interrupts import uninterrupted
from paraflex.mechanism import ActuationMode, Body, FlexibleBeam, Joint, Mechanism, PointRef, TorsionalSpring
from paraflex.mechanism.actuation_modes import check_torques
from paraflex.results.drawing import Drawing, drawing, drawing_variables
from paraflex.results.links import Links, point_variables, tip_variables
from paraflex.results.numbers import single
from paraflex.results.outlines import chord_deflections, outlines
from paraflex.results.record import Record
from paraflex.tracking import TrackingTask
from .cables import Cable, Columns, Ground, Link, Linkage, RigidLink, RigidState, Trajectory
from .common import check_dwell, check_engine, import_engine, steps_between, with_rotors

# Newton's residual, a norm over all coordinates, is zero to rounding at this multiple of an internal force's rounding.
_FLOOR = 100.0


@dataclass(frozen=True)
class ExudynOptions:
    """Options of Exudyn: generalised alpha with fixed step size and constraints on positions (index 3).

    Attributes
    ----------
    step : float
        Largest step size [s], 5e-5 by default; it is reduced to divide the spacing of the task's samples.
    refinement : int
        Factor of the number of elements on every span of every beam, 1 by default.
    tolerance : float
        Relative tolerance of Newton's residual, 1e-6 by default.
    spectral_radius : float
        Spectral radius of generalised alpha at high frequency, 0.9 by default: values below 1 give numerical damping, 0
        asymptotic annihilation in one step. 1 selects the trapezoidal rule without numerical damping, with constraints
        on velocities (index 2).
    """

    step: float = 5e-5
    refinement: int = 1
    tolerance: float = 1e-6
    spectral_radius: float = 0.9

    @property
    def method(self) -> str:
        """Name of the integration scheme."""
        return "Exudyn, trapezoidal rule" if self.spectral_radius == 1.0 else "Exudyn, generalised alpha"

    def __post_init__(self) -> None:
        for name, remedy in (("step", "give a time in seconds"), ("tolerance", "give a fraction, say 1e-6")):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise InputError("must be positive", field=name, value=value, remedy=remedy)
        if self.refinement < 1:
            raise InputError("must be at least 1", field="refinement", value=self.refinement, remedy="give 1 or 2")
        if not 0.0 <= self.spectral_radius <= 1.0:
            raise InputError(
                "must be between 0 and 1", field="spectral_radius", value=self.spectral_radius, remedy="say 0.9"
            )


def simulate_exudyn(task: TrackingTask, mode: str | ActuationMode, options: ExudynOptions | None = None) -> Record:
    """Simulate the mechanism in Exudyn, driven by the feed-forward torques of a mode.

    Geometry, reference conditions and kinds of curvature of the mechanism are properties of paraflex's formulation and
    have no effect here.

    Parameters
    ----------
    task : TrackingTask
        Tracking task. The original mechanism of a task in finite segments is simulated, with cables in place of beams.
    mode : str or ActuationMode
        Actuation mode: its name, signs ("+-+-") or motor names ("tau1,tau5").
    options : ExudynOptions, optional
        Options of discretisation and integration.

    Returns
    -------
    Record
        Results by link.

    Raises
    ------
    InputError
        Exudyn is not installed, or does not support a member of the mechanism, such as a prescribed angle.
    ActuationError, SingularActuationError
        The mode cannot drive the mechanism along the path.
    IntegrationError
        Exudyn fails; the error has a Record of the samples computed.
    """
    options = options or ExudynOptions()
    task = task.whole or task
    check_engine("exudyn", task.mechanism)
    check_dwell("exudyn", task)
    torques = task.torques(mode)
    check_torques(torques.mode, "Exudyn", task.mechanism.motors)
    substeps = steps_between(task.motion.t, options.step)
    begin = time.perf_counter()
    engine = _start_engine()
    with _silent(engine.exu):
        model = _build(engine, with_rotors(task), options.refinement)
        history, figures = _run(engine, model, task, torques, substeps, options)
    figures["wall_time"] = time.perf_counter() - begin
    record = _record(model, task, torques, history, substeps, options.method, figures)
    if record.figures["message"]:
        cause = f"Exudyn: {record.figures['message']}"
        raise IntegrationError(cause, _last_moment(record, history), record, "give it a shorter step")
    return record


def _last_moment(record: Record, history: Trajectory) -> Moment:
    """Return the moment of the last completed step, with the end-effector's position at the last sample before it."""
    places = record.end_effector.position
    position = (float(places[-1, 0]), float(places[-1, 1])) if len(places) else None
    return Moment(float(history.t[-1]) if history.t.size else 0.0, record.figures["steps"], position)


# --- The system ----------------------------------------------------------------------------------------------------


@dataclass
class _Engine:
    """Modules of Exudyn and the system under construction; the container must live as long as the system."""

    exu: Any
    items: Any
    container: Any
    mbs: Any
    coordinates: int = 0

    def add(self, kind: str, **settings: Any) -> int:
        return self.mbs.AddObject(getattr(self.items, kind)(**settings))

    def node(self, kind: str, place: list[float], velocity: list[float]) -> tuple[int, Columns]:
        """Add a node and return its number and the indices of its coordinates, which are numbered node by node."""
        node = getattr(self.items, kind)(referenceCoordinates=place, initialVelocities=velocity)
        first, self.coordinates = self.coordinates, self.coordinates + len(place)
        return self.mbs.AddNode(node), np.arange(first, self.coordinates)

    def marker(self, linkage: Linkage, ref: PointRef) -> int:
        """Add a marker for position and rotation of the material at a point."""
        return self.mbs.AddMarker(self.items.MarkerBodyRigid(**linkage.part(ref).place(ref.point)))

    def markers(self, linkage: Linkage, joint: Joint) -> list[int]:
        return [self.marker(linkage, ref) for ref in (joint.a, joint.b)]


def _start_engine() -> _Engine:
    exu, items = import_engine("exudyn"), import_engine("exudyn.itemInterface")
    container = exu.SystemContainer()
    return _Engine(exu, items, container, container.AddSystem())


@contextmanager
def _silent(exu: Any) -> Iterator[None]:
    """Suppress Exudyn's printed errors and warnings; failures are exceptions here."""
    before = exu.config.printToConsole, exu.config.suppressWarnings
    exu.config.printToConsole, exu.config.suppressWarnings = False, True
    try:
        yield
    finally:
        exu.config.printToConsole, exu.config.suppressWarnings = before


class _Model(NamedTuple):
    """Model in Exudyn: links, loads of each motor with their signs, and indices of the multipliers of each joint."""

    linkage: Linkage
    loads: list[list[tuple[int, float]]]
    rows: Indices


def _build(engine: _Engine, task: TrackingTask, refinement: int) -> _Model:
    mechanism = task.mechanism.refined(refinement)
    ground = Ground(engine.add("ObjectGround"), mechanism.ground)
    linkage = Linkage(ground, {body.name: _add_body(engine, task, body) for body in mechanism.bodies})
    joints = [
        engine.add("ObjectJointRevolute2D", markerNumbers=engine.markers(linkage, joint)) for joint in mechanism.joints
    ]
    loads = [_add_motor(engine, linkage, mechanism.joint(motor.joint)) for motor in mechanism.motors]
    for spring in mechanism.springs:
        _add_spring(engine, linkage, mechanism.joint(spring.joint), spring)
    _add_gravity(engine, linkage, mechanism)
    engine.mbs.Assemble()
    rows = [engine.mbs.systemData.GetObjectLTGAE(joint) for joint in joints]
    return _Model(linkage, loads, np.array(rows, dtype=np.int64).reshape(-1, 2))


def _add_gravity(engine: _Engine, linkage: Linkage, mechanism: Mechanism) -> None:
    if not any(mechanism.gravity):
        return
    field = [*mechanism.gravity, 0.0]
    for link in linkage.bodies.values():
        for item in link.items:
            marker = engine.mbs.AddMarker(engine.items.MarkerBodyMass(bodyNumber=item))
            engine.mbs.AddLoad(engine.items.LoadMassProportional(markerNumber=marker, loadVector=field))
        for place, mass in link.lumped:
            marker = engine.mbs.AddMarker(engine.items.MarkerBodyPosition(**place))
            force = [mass * component for component in field]
            engine.mbs.AddLoad(engine.items.LoadForceVector(markerNumber=marker, loadVector=force))


def _add_body(engine: _Engine, task: TrackingTask, body: Body) -> Link:
    frame = slice(first := task.system.body(body.name).offset, first + 3)
    pose = RigidState(*task.start.q[frame].tolist(), *task.start.v[frame].tolist())
    if isinstance(body, FlexibleBeam) and body.flexible:
        return _add_cable(engine, body, pose)
    return _add_rigid(engine, task.system, body, pose)


def _add_rigid(engine: _Engine, system: System, body: Body, pose: RigidState) -> RigidLink:
    s = system.body(body.name).integrals
    centre = s.S1 / s.m
    inertia = s.I0 + s.J - s.m * float(centre @ centre)
    position, velocity = pose.point(*centre.tolist())
    node, columns = engine.node("NodeRigidBody2D", [*position, pose.phi], [*velocity, pose.w])
    item = engine.add("ObjectRigidBody2D", mass=s.m, inertia=inertia, nodeNumber=node)
    points = {point: system.marker(PointRef(body.name, point)).x0 - centre for point in body.points}
    return RigidLink((item,), columns, points, s.m, inertia, pose.phi)


def _add_cable(engine: _Engine, beam: FlexibleBeam, pose: RigidState) -> Cable:
    mesh, of_span = beam.mesh, beam.spans
    spans = tuple(of_span[span] for span in mesh.spans)
    slope, turning = pose.direction(1.0, 0.0)
    ends = [pose.point(x, 0.0) for x in mesh.nodes.tolist()]
    added = [engine.node("NodePoint2DSlope1", [*place, *slope], [*velocity, *turning]) for place, velocity in ends]
    nodes, columns = map(list, zip(*added, strict=True))
    items = [
        engine.add(
            "ObjectANCFCable2D",
            length=length,
            massPerLength=span.mass_per_length,
            bendingStiffness=span.bending_stiffness,
            axialStiffness=span.axial_stiffness,
            nodeNumbers=nodes[i : i + 2],
        )
        for i, (span, length) in enumerate(zip(spans, np.diff(mesh.nodes).tolist(), strict=True))
    ]
    lumps = np.zeros((len(nodes), 2))
    for lump in beam.lumps:
        lumps[mesh.points[lump.point]] += lump.mass, lump.inertia
    for node in np.flatnonzero(lumps.any(axis=1)):
        # Kinetic energy J/2 |r'_t|^2 is that of the rotating cross-section for |r'| = 1, with an error of the strain.
        engine.add("ObjectGenericODE2", nodeNumbers=[nodes[node]], massMatrix=np.diag(np.repeat(lumps[node], 2)))
    return Cable(mesh, spans, tuple(items), np.reshape(columns, (-1, 2)), lumps, pose.phi)


def _add_motor(engine: _Engine, linkage: Linkage, joint: Joint) -> list[tuple[int, float]]:
    """Add torque loads on the material at both sides of a joint, and return their numbers with signs."""
    return [
        (engine.mbs.AddLoad(engine.items.LoadTorqueVector(markerNumber=engine.marker(linkage, ref))), sign)
        for ref, sign in ((joint.a, -1.0), (joint.b, 1.0))
        if not ref.on_ground
    ]


def _add_spring(engine: _Engine, linkage: Linkage, joint: Joint, spring: TorsionalSpring) -> None:
    """Add a spring between the material at both sides of a joint."""
    # Exudyn's angle is continuous and starts within half a turn of zero.
    turns = 2.0 * np.pi * np.round((linkage.part(joint.b).start - linkage.part(joint.a).start) / (2.0 * np.pi))
    state = engine.items.NodeGenericData(initialCoordinates=[0.0], numberOfDataCoordinates=1)
    engine.add(
        "ObjectConnectorTorsionalSpringDamper",
        markerNumbers=engine.markers(linkage, joint),
        nodeNumber=engine.mbs.AddNode(state),
        stiffness=spring.stiffness,
        offset=spring.rest - turns,
    )


# --- The run -------------------------------------------------------------------------------------------------------


@dataclass
class _Recorder:
    """Callbacks of Exudyn before and after each step, which apply the torques and record the state.

    The torques are those at the end of the step, at which generalised alpha evaluates forces.
    """

    loads: list[list[tuple[int, float]]]
    torques: Array
    states: list[tuple[Array, Array, Array]] = field(default_factory=list)
    multipliers: list[Array] = field(default_factory=list)
    interrupts: list[int] = field(default_factory=list)
    finite: bool = True

    def before(self, mbs: Any, _: float) -> bool:
        """Set the torques of the next step."""
        for torque, sides in zip(self.torques[len(self.states)], self.loads, strict=True):
            for load, sign in sides:
                mbs.SetLoadParameter(load, "loadVector", [0.0, 0.0, sign * torque])
        return True

    def after(self, mbs: Any, _: float) -> bool:
        """Record the state, including the initial one; return False to end the run."""
        data = mbs.systemData
        state = data.GetODE2Coordinates(), data.GetODE2Coordinates_t(), data.GetODE2Coordinates_tt()
        self.finite = bool(np.isfinite(state).all())
        if self.finite:
            self.states.append(state)
            self.multipliers.append(data.GetAECoordinates())
        return self.finite and not self.interrupts

    def verdict(self) -> str:
        """Return why a run without an exception ended early; empty if it is complete."""
        if not self.finite:
            return "the solution is no longer finite"
        if len(self.states) == len(self.torques):
            return ""
        return "Newton's iteration does not converge" if self.states else "no accelerations satisfy the constraints"


def _run(
    engine: _Engine, model: _Model, task: TrackingTask, torques: FeedForward, substeps: int, options: ExudynOptions
) -> tuple[Trajectory, dict[str, Any]]:
    """Integrate, and return the trajectory and the statistics, with the reason of an early end as `message`."""
    times = task.motion.t
    grid = np.linspace(times[0], times[-1], substeps * (times.size - 1) + 1)
    recorder = _Recorder(model.loads, torques.evaluate(grid))
    solver, mbs, cause = engine.exu.MainSolverImplicitSecondOrder(), engine.mbs, ""
    reference = mbs.systemData.GetODE2Coordinates(engine.exu.ConfigurationType.Reference)
    # The residual cannot become smaller than the rounding error of the force in the stiffest element.
    rounding = [link.rounding(reference) for link in model.linkage.bodies.values() if isinstance(link, Cable)]
    settings = _settings(engine.exu, grid, options, _FLOOR * max(rounding, default=0.0))
    recorder.before(mbs, grid[0])
    mbs.SetPreStepUserFunction(recorder.before)
    mbs.SetPostStepUserFunction(recorder.after)
    try:
        # A KeyboardInterrupt raised within a callback would be reported as a failure of the callback.
        with uninterrupted() as recorder.interrupts:
            if solver.InitializeSolver(mbs, settings):
                solver.SolveSteps(mbs, settings)
            solver.FinalizeSolver(mbs, settings)
    except engine.exu.ExudynError as error:
        cause = next((line.strip() for line in str(error).splitlines() if line.strip()), "ExudynError")
    finally:
        mbs.SetPreStepUserFunction(0)
        mbs.SetPostStepUserFunction(0)
    cause, k = cause or recorder.verdict(), len(recorder.states)
    states = np.reshape(recorder.states, (k, 3, reference.size)).swapaxes(0, 1)
    # GetODE2CoordinatesTotal of Exudyn 1.13 returns this sum but corrupts memory.
    states[0] += reference
    figures = {
        "status": "failed" if cause else "complete",
        "message": cause,
        "steps": max(0, k - 1),
        "rejected": 0,
        "newton_iterations": int(solver.it.newtonStepsCount),
        "factorisations": int(solver.it.newtonJacobiCount),
    }
    return Trajectory(grid[:k], states, np.reshape(recorder.multipliers, (k, model.rows.size))), figures


def _settings(exu: Any, grid: Array, options: ExudynOptions, floor: float) -> Any:
    settings = exu.SimulationSettings()
    settings.solution.file.write = False
    settings.solution.sensors.active = False
    settings.linearSolver.showCausingItems = False
    settings.linearSolver.solverType = exu.LinearSolverType.EigenSparse
    integration = settings.timeIntegration
    integration.startTime, integration.endTime = float(grid[0]), float(grid[-1])
    integration.numberOfSteps = grid.size - 1
    integration.adaptiveStep = integration.automaticStepSize = False
    integration.newton.relativeTolerance = options.tolerance
    integration.newton.absoluteTolerance = max(integration.newton.absoluteTolerance, floor)
    undamped = options.spectral_radius == 1.0
    integration.generalizedAlpha.spectralRadius = options.spectral_radius
    # Constraints on positions are unstable without damping; Exudyn has those on velocities for Newmark's method only.
    integration.generalizedAlpha.useNewmark = integration.generalizedAlpha.useIndex2Constraints = undamped
    return settings


# --- The record ----------------------------------------------------------------------------------------------------


def _record(
    model: _Model,
    task: TrackingTask,
    torques: FeedForward,
    steps: Trajectory,
    substeps: int,
    method: str,
    figures: dict[str, Any],
) -> Record:
    mechanism, linkage, links = task.mechanism, model.linkage, model.linkage.bodies.values()
    samples = steps.thinned(substeps)
    effector = mechanism.end_effector
    assert effector is not None
    count, drawn = len(samples.t), _drawing(mechanism, linkage, samples)
    angle, rate, acceleration = np.stack([link.frame(samples) for link in links], axis=-1)
    chord, chord_rate, _ = np.stack([link.chord(samples) for link in links], axis=-1)
    kinetic = np.sum([link.kinetic_energy(samples) for link in links], axis=0)
    strain = np.sum([link.strain_energy(samples) for link in links], axis=0)
    strain += _spring_energy(linkage, mechanism, samples)
    work = _work(linkage, mechanism, torques, steps)[::substeps]
    gaps = np.array([linkage.gap(joint, samples) for joint in mechanism.joints])
    work += np.sum([link.weighted(samples) - link.weighted(samples)[:1] for link in links], axis=0) @ mechanism.gravity
    balance = kinetic + strain - work
    return Record(
        task=task,
        method=method,
        mode=torques.mode.name,
        torque=torques.evaluate(task.motion.t),
        condition=actuation_condition(task.effort, torques.mode),
        end_effector=linkage.motion(effector.point, samples),
        links=Links(
            variables={
                "angle": (("body",), angle),
                "angular_velocity": (("body",), rate),
                "angular_acceleration": (("body",), acceleration),
                "chord_angle": (("body",), chord),
                "chord_velocity": (("body",), chord_rate),
                **tip_variables([link.tip(samples) for link in links]),
                "deflection": (("body",), chord_deflections(mechanism, drawn.shape)),
                **point_variables([link.motion(point, samples) for link in links for point in link.points], count),
                # Sign: Exudyn's multipliers are on the left-hand side of the equations, with the constraint p_b - p_a.
                "joint_force": (("joint", "axis"), -samples.multipliers[:, model.rows]),
                "joint_moment": (("joint",), np.full((count, len(mechanism.joints)), np.nan)),
                "multiplier": (("row",), np.full((count, task.system.m), np.nan)),
                "motor_speed": (("motor",), _motor_speeds(linkage, mechanism, samples)),
                "kinetic_energy": ((), kinetic),
                "strain_energy": ((), strain),
                "work": ((), work),
                **drawing_variables(drawn, keep=single),
            }
        ),
        figures={
            **figures,
            "constraint_position_max": _largest(gaps[:, 0]),
            "constraint_velocity_max": _largest(gaps[:, 1]),
            "energy_balance_max": _largest(balance - balance[:1]),
            "event": "",
            "event_time": np.nan,
        },
    )


def _drawing(mechanism: Mechanism, linkage: Linkage, history: Trajectory) -> Drawing:
    """Return the drawing of the bodies, evaluated with the engine's own shape functions."""
    bodies = linkage.bodies
    shapes = {one.body: bodies[one.body].curve(one, history) for one in outlines(mechanism)}

    def frame(name: str) -> tuple[Array, Array]:
        # Joints that slide along beams would need more than an angle, but they are not supported.
        return shapes[name][:, 0], bodies[name].frame(history).angle

    return drawing(mechanism, shapes, lambda ref: linkage.part(ref).turn(ref.point, history).angle, frame)


def _largest(values: Array) -> float:
    return float(np.abs(values).max(initial=0.0))


def _work(linkage: Linkage, mechanism: Mechanism, torques: FeedForward, history: Trajectory) -> Array:
    """Compute the work of the motors by the trapezoidal rule over the steps [J]."""
    power = np.sum(torques.evaluate(history.t) * _motor_speeds(linkage, mechanism, history), axis=1)
    return np.concatenate([[0.0], np.cumsum(0.5 * (power[1:] + power[:-1]) * np.diff(history.t))])[: power.size]


def _motor_speeds(linkage: Linkage, mechanism: Mechanism, history: Trajectory) -> Array:
    """Return the speeds of all motors (k, motors) [rad/s]."""
    joints = [mechanism.joint(motor.joint) for motor in mechanism.motors]
    return np.array([linkage.joint_turn(joint, history).rate for joint in joints]).reshape(-1, history.t.size).T


def _spring_energy(linkage: Linkage, mechanism: Mechanism, history: Trajectory) -> Array:
    energy = np.zeros(history.t.size)
    for spring in mechanism.springs:
        angle = linkage.joint_turn(mechanism.joint(spring.joint), history).angle
        energy += 0.5 * spring.stiffness * (angle - spring.rest) ** 2
    return energy
