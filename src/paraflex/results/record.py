"""A run link by link: what every model of a mechanism can say, whoever computed it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paraflex.arguments import given_as
from paraflex.dynamics import Marker, System, end_markers, material_angle
from paraflex.dynamics.points import PointMotion, marker_motion, point_motion, tip_deflection
from paraflex.findings import Finding
from paraflex.mechanism import FIRST_END, LAST_END, PointRef
from paraflex.results.drawing import Drawing, drawing, system_drawing
from paraflex.results.joint_loads import joint_loads
from paraflex.results.outlines import outline_motion, outlines, segment_motion
from paraflex.simulate import TrackingRun, TrackingTask
from paraflex.validity import Validity

# How a run went: names of the figures every record has.
FIGURES = (
    "status",
    "message",
    "steps",
    "rejected",
    "newton_iterations",
    "factorisations",
    "wall_time",
    "constraint_position_max",
    "constraint_velocity_max",
    "energy_balance_max",
    "event",
    "event_time",
)
# What brakes took, where there were any.
BRAKE_ENERGY = "brake_energy"


@given_as("a record", "what results.record makes of a run")
@dataclass(frozen=True)
class Record:
    """One run of a task, at the k sample times it reached; NaN for what a model does not tell.

    Bodies, joints and points are those of the task's mechanism in its order, whatever the model cut them into. Points
    are all the named points of all bodies, body after body.

    Attributes
    ----------
    task : TrackingTask
    method : str
        How it was integrated.
    mode : str
        Name of the actuation mode.
    torque : (samples, motors) array
        Applied by the motors, at every sample time of the task, or at the k reached where they were held [N m].
    condition : (samples,) array
        Condition number of the actuation matrix.
    end_effector : PointMotion
        Three (k, 2) arrays.
    angle, rate, acceleration : (k, bodies) arrays
        Of the body frames; in a model without them the tangent at a beam's first end [rad, rad/s, rad/s^2].
    chord, chord_rate : (k, bodies) arrays
        Of the line from a beam's first end to its last, which no choice of frame touches; of a modal body's first
        point to its last, less its angle undeformed; a rigid body's angle [rad, rad/s].
    tip : (k, bodies, 3) array
        Axial, transverse displacement and slope of a beam's last end (a modal body's last point) from the tangent at
        its first end [m, m, rad].
    points : (k, points, 2) array
        Positions [m].
    joint_force : (k, joints, 2) array
        All that a joint's first body does to its second: at the joint's point of that, in the ground frame [N].
    joint_moment : (k, joints) array
        And about that point, positive anticlockwise [N m].
    multiplier : (k, rows) array
        Of the rows of the task's system; NaN of those that the model does not have. Minus it acts on the second body.
    kinetic_energy, strain_energy, work : (k,) arrays
        [J]
    drawing : Drawing
        Deformed shapes of all bodies.
    figures : mapping
        The numbers and words named in FIGURES.
    validity : Validity, optional
        How far it is within what its model can describe.
    doubts : tuple of Finding
        What of its results is not plausible.
    """

    task: TrackingTask
    method: str
    mode: str
    torque: NDArray[np.float64]
    condition: NDArray[np.float64]
    end_effector: PointMotion
    angle: NDArray[np.float64]
    rate: NDArray[np.float64]
    acceleration: NDArray[np.float64]
    chord: NDArray[np.float64]
    chord_rate: NDArray[np.float64]
    tip: NDArray[np.float64]
    points: NDArray[np.float64]
    joint_force: NDArray[np.float64]
    joint_moment: NDArray[np.float64]
    multiplier: NDArray[np.float64]
    kinetic_energy: NDArray[np.float64]
    strain_energy: NDArray[np.float64]
    work: NDArray[np.float64]
    drawing: Drawing
    figures: Mapping[str, Any] = field(default_factory=dict)
    validity: Validity | None = None
    doubts: tuple[Finding, ...] = ()


def record(run: TrackingRun) -> Record:
    """What a run of our own says of the links; finite segments are reported as the links they were cut from."""
    task, solution = run.task, run.solution
    # The state at an event is a sample more than the task's times.
    k = solution.t.size - bool(solution.event)
    system, q, v, a = task.system, solution.q[:k], solution.v[:k], solution.a[:k]
    whole = task if task.whole is None else task.whole
    effector = task.mechanism.end_effector
    assert effector is not None
    parts = _parts(task)
    first = [system.body(names[0]).angle for names in parts]
    chords = [_chord(system, names, q, v) for names in parts]
    points = [
        point_motion(system, PointRef(_owner(task, names, point), point), q, v, a).position
        for body, names in zip(whole.mechanism.bodies, parts, strict=True)
        for point in body.points
    ]
    torque = run.applied
    joints = [joint.name for joint in whole.mechanism.joints]
    loads = joint_loads(system, joints, q, solution.multipliers[:k], torque[:k])
    return Record(
        task=whole,
        method=run.method,
        mode=run.mode.name,
        torque=torque,
        condition=run.condition,
        end_effector=point_motion(system, effector.point, q, v, a),
        angle=q[:, first],
        rate=v[:, first],
        acceleration=a[:, first],
        chord=np.stack([angle for angle, _ in chords], axis=1),
        chord_rate=np.stack([rate for _, rate in chords], axis=1),
        tip=np.stack([_tip(system, names, q) for names in parts], axis=1),
        points=np.stack(points, axis=1) if points else np.zeros((q.shape[0], 0, 2)),
        joint_force=loads.force,
        joint_moment=loads.moment,
        multiplier=_multipliers(system, whole.system, solution.multipliers[:k]),
        kinetic_energy=solution.kinetic_energy[:k],
        strain_energy=solution.strain_energy[:k],
        work=solution.work[:k],
        drawing=_drawing(task, parts, q),
        figures={name: getattr(solution, name) for name in (*FIGURES, BRAKE_ENERGY)},
        validity=run.validity,
        doubts=run.doubts,
    )


def _multipliers(system: System, whole: System, multipliers: NDArray[np.float64]) -> NDArray[np.float64]:
    """Multipliers by the rows of the whole mechanism; NaN of those that it does not share with what it was cut into."""
    if system is whole:
        return multipliers
    out = np.full((len(multipliers), whole.m), np.nan)
    for i, row in enumerate(whole.rows):
        if row in system.rows:
            out[:, i] = multipliers[:, system.rows.index(row)]
    return out


def _parts(task: TrackingTask) -> list[list[str]]:
    """For each body of the uncut mechanism the names of what it was cut into, first end first: itself if it was not."""
    if task.whole is None:
        return [[body.name] for body in task.system.bodies]
    parts: dict[str, list[str]] = {body.name: [] for body in task.whole.system.bodies}
    for name, (carrier, _) in task.carriers.items():
        parts[carrier].append(name)
    return list(parts.values())


def _drawing(task: TrackingTask, parts: list[list[str]], q: NDArray[np.float64]) -> Drawing:
    """Bodies as their own shape functions have them; cut ones where their segments lie."""
    system = task.system
    if task.whole is None:
        return system_drawing(system, q)
    mechanism = task.whole.mechanism
    names = dict(zip([body.name for body in mechanism.bodies], parts, strict=True))
    shapes = {}
    for one in outlines(mechanism):
        pieces = names[one.body]
        if pieces == [one.body]:
            shapes[one.body] = outline_motion(system, one, q)
        else:
            shapes[one.body] = segment_motion(system, pieces, [task.carriers[piece][1] for piece in pieces], one, q)

    def angle(ref: PointRef) -> NDArray[np.float64]:
        return material_angle(system, PointRef(_owner(task, names[ref.body], ref.point), ref.point), q)

    def frame(body: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        first = system.body(names[body][0])
        return q[:, first.position], q[:, first.angle]

    return drawing(mechanism, shapes, angle, frame)


def _owner(task: TrackingTask, names: list[str], point: str) -> str:
    return next(name for name in names if point in task.mechanism.body(name).points)


def _ends(system: System, names: list[str], q: NDArray[np.float64], v: NDArray[np.float64]) -> list[PointMotion]:
    """Motion of the first and last end of a beam, or of what it was cut into."""
    return [marker_motion(system, marker, q, v, np.zeros_like(q)) for marker in _end_markers(system, names)]


def _end_markers(system: System, names: list[str]) -> tuple[Marker, ...]:
    """First and last end of a body, or of what it was cut into; none of what has no ends."""
    if len(names) == 1:
        return end_markers(system.index[names[0]], system.body(names[0]))
    return system.marker(PointRef(names[0], FIRST_END)), system.marker(PointRef(names[-1], LAST_END))


def _chord(
    system: System, names: list[str], q: NDArray[np.float64], v: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Angle and rate of the line from a beam's first end to its last; a rigid body's own.

    Less the line's angle in the undeformed body, which is zero of a beam.
    """
    angle, ends = system.body(names[0]).angle, _end_markers(system, names)
    if not ends:
        return q[:, angle], v[:, angle]
    first, last = _ends(system, names, q, v)
    x, y = ends[1].x0 - ends[0].x0
    offset = np.arctan2(y, x)
    line, rate = last.position - first.position, last.velocity - first.velocity
    chord, chord_rate = line_angle(line, rate, q[:, angle] + offset)
    return chord - offset, chord_rate


def line_angle(
    line: NDArray[np.float64], rate: NDArray[np.float64], near: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Angle (k,) of a line (k, 2) within a half turn of another angle (k,), and its rate."""
    x, y = line[:, 0], line[:, 1]
    turned = np.arctan2(y, x) - near
    angle = near + (turned + np.pi) % (2.0 * np.pi) - np.pi
    return angle, (x * rate[:, 1] - y * rate[:, 0]) / (x**2 + y**2)


def _tip(system: System, names: list[str], q: NDArray[np.float64]) -> NDArray[np.float64]:
    """Displacement and slope of a beam's last end in its frame: of segments, in that of the first one."""
    if len(names) == 1:
        return tip_deflection(system, names[0], q)
    first, last = _ends(system, names, q, np.zeros_like(q))
    phi, end = q[:, system.body(names[0]).angle], q[:, system.body(names[-1]).angle]
    c, s = np.cos(phi), np.sin(phi)
    x, y = (last.position - first.position).T
    length = sum(system.marker(PointRef(name, LAST_END)).x0[0] for name in names)
    return np.column_stack([c * x + s * y - length, c * y - s * x, end - phi])
