"""Motion and loads of bodies, points, joints and motors at the samples of a run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from paraflex.arrays import Array
from paraflex.dynamics import Marker, System, end_markers, joint_coordinate, material_angle, sensor_readings
from paraflex.dynamics.joint_loads import (
    LoadComponents,
    Loads,
    drive_torques,
    frame_load,
    joint_loads,
    load_errors,
    undetermined_loads,
)
from paraflex.dynamics.points import PointMotion, marker_motion, point_motion, tip_deflection
from paraflex.integrators import Solution
from paraflex.mechanism import FIRST_END, LAST_END, PointRef
from paraflex.results.drawing import Drawing, system_drawing
from paraflex.results.numbers import stacked
from paraflex.results.stress import SectionResult, section_result


@dataclass(frozen=True, kw_only=True)
class Links:
    """Motion and loads at the k sample times that a run reached; NaN where a model has no value.

    Bodies, joints and points are those of the mechanism in its order, even if the model divides bodies into parts.
    Points are all named points of all bodies, body after body.

    Attributes
    ----------
    angle, rate, acceleration : (k, bodies) arrays
        Angles of the body frames and their derivatives; in a model without body frames those of the tangent at a beam's
        first end [rad, rad/s, rad/s^2].
    chord, chord_rate : (k, bodies) arrays
        Angle and rate of the line from a beam's first end to its last, which does not depend on the choice of frame; of
        a modal body from its first point to its last, minus the angle undeformed; of a rigid body its angle [rad,
        rad/s].
    tip : (k, bodies, 3) array
        Axial and transverse displacement and slope of a beam's last end (a modal body's last point) relative to the
        tangent at its first end [m, m, rad].
    points, point_velocity, point_acceleration : (k, points, 2) arrays
        Positions [m], velocities [m/s] and accelerations [m/s^2] of the points.
    joint_force : (k, joints, 2) array
        Total force of a joint's first body on its second, at the joint's point of the second, in the ground frame [N].
    joint_moment : (k, joints) array
        Total moment about that point, positive anticlockwise [N m].
    multiplier : (k, rows) array
        Multipliers of the constraint rows of the mechanism's system, NaN for rows that the model does not have; minus
        the multiplier acts on the second body.
    motor_speed : (k, motors) array
        Rate of each motor's joint [rad/s], or speed along its axis [m/s].
    kinetic_energy, strain_energy, work : (k,) arrays
        Energies, and work done on the mechanism [J].
    drawing : Drawing
        Deformed shapes of all bodies.
    joint_coordinate, joint_speed : (k, joints) arrays, optional
        Angle of each joint [rad], or travel along its axis [m], and its rate; None for models without them.
    drive_torque, drive_speed : (k, drives) arrays, optional
        Torque [N m] or force [N] of each prescribed motion on its joint's second body, and the rate of that joint.
    load_errors : LoadComponents, optional
        Bounds of the integration errors of joint and drive loads; None if unknown.
    frame_load : Loads, optional
        Force and moment of the mechanism on the ground.
    sections : SectionResult, optional
        Section forces of beams; None for models without shape functions, and without flexible beams.
    sensors : (k, sensors) array, optional
        Readings of the mechanism's sensors, each in its unit; NaN for sensors without a meaning in the model.
    """

    angle: Array
    rate: Array
    acceleration: Array
    chord: Array
    chord_rate: Array
    tip: Array
    points: Array
    point_velocity: Array
    point_acceleration: Array
    joint_force: Array
    joint_moment: Array
    multiplier: Array
    motor_speed: Array
    kinetic_energy: Array
    strain_energy: Array
    work: Array
    drawing: Drawing
    joint_coordinate: Array | None = None
    joint_speed: Array | None = None
    drive_torque: Array | None = None
    drive_speed: Array | None = None
    load_errors: LoadComponents | None = None
    frame_load: Loads | None = None
    sections: SectionResult | None = None
    sensors: Array | None = None


def system_links(system: System, solution: Solution, torques: Array, samples: int) -> Links:
    """Return motion and loads of the links in a run, as the mechanism was described: parts of a body are joined.

    Parameters
    ----------
    system : System
        System that was integrated.
    solution : Solution
        Solution of the run.
    torques : (samples or more, motors) array
        Torque [N m] or force [N] of every motor.
    samples : int
        Number of samples of the solution to use, from the first on.
    """
    q, v, a = (x[:samples] for x in (solution.q, solution.v, solution.a))
    mechanism = system.described
    parts = [system.parts(body.name) for body in mechanism.bodies]
    first = [system.body(names[0]).angle for names in parts]
    chords = [_chord(system, names, q, v) for names in parts]
    named = [PointRef(body.name, point) for body in mechanism.bodies for point in body.points]
    points = stacked_motions([point_motion(system, ref, q, v, a) for ref in named], samples)
    multipliers = solution.multipliers[:samples]
    coordinates = {joint.name: joint_coordinate(system, joint.name, q, v) for joint in mechanism.joints}
    joints, errors = [joint.name for joint in mechanism.joints], solution.multiplier_errors
    loads = joint_loads(system, joints, q, multipliers, torques[:samples])
    shared = undetermined_loads(system, joints, q, solution.acting)
    drawn = system_drawing(system, q)
    return Links(
        angle=q[:, first],
        rate=v[:, first],
        acceleration=a[:, first],
        chord=np.stack([angle for angle, _ in chords], axis=1),
        chord_rate=np.stack([rate for _, rate in chords], axis=1),
        tip=np.stack([_tip(system, names, q) for names in parts], axis=1),
        points=points.position,
        point_velocity=points.velocity,
        point_acceleration=points.acceleration,
        joint_force=np.where(shared.force, np.nan, loads.force),
        joint_moment=np.where(shared.moment, np.nan, loads.moment),
        multiplier=_by_name(multipliers, system.rows, system.described_rows),
        motor_speed=stacked([coordinates[motor.joint].rate for motor in mechanism.motors], samples),
        kinetic_energy=solution.kinetic_energy[:samples],
        strain_energy=solution.strain_energy[:samples],
        work=solution.work[:samples],
        drawing=drawn,
        joint_coordinate=stacked([each.value for each in coordinates.values()], samples),
        joint_speed=stacked([each.rate for each in coordinates.values()], samples),
        drive_torque=np.where(shared.drive, np.nan, drive_torques(system, multipliers))[:, : len(mechanism.prescribed)],
        drive_speed=stacked([coordinates[one.joint].rate for one in mechanism.prescribed], samples),
        load_errors=None if errors is None else load_errors(system, joints, errors),
        frame_load=frame_load(system, drawn.joints, loads, q, v),
        sections=section_result(system, q, v, a, multipliers),
        sensors=_by_name(
            sensor_readings(system, q, v, a, multipliers, torques[:samples]),
            *([one.name for one in each.sensors] for each in (system.mechanism, mechanism)),
        ),
    )


def stacked_motions(points: Sequence[PointMotion], samples: int) -> PointMotion:
    """Stack the motions of several points to three arrays (samples, points, 2)."""
    return PointMotion(*(stacked([each[k] for each in points], samples, 2) for k in range(3)))


def _by_name(values: Array, names: Sequence[str], order: Sequence[str]) -> Array:
    """Return columns (k, wanted) of values (k, names) in the order of `wanted`; NaN for names that are missing."""
    place = {name: k for k, name in enumerate(names)}
    out = np.full((len(values), len(order)), np.nan)
    for k, name in enumerate(order):
        if name in place:
            out[:, k] = values[:, place[name]]
    return out


def _ends(system: System, names: Sequence[str], q: Array, v: Array) -> list[PointMotion]:
    """Return the motion of the first and last end of a beam, which may be divided into parts."""
    return [marker_motion(system, marker, q, v, np.zeros_like(q)) for marker in _end_markers(system, names)]


def _end_markers(system: System, names: Sequence[str]) -> tuple[Marker, ...]:
    """Return the markers of the first and last end of a body, which may be divided into parts; empty without ends."""
    if len(names) == 1:
        return end_markers(system.index[names[0]], system.body(names[0]))
    return system.marker(PointRef(names[0], FIRST_END)), system.marker(PointRef(names[-1], LAST_END))


def _chord(system: System, names: Sequence[str], q: Array, v: Array) -> tuple[Array, Array]:
    """Return angle and rate of the line from a beam's first end to its last, minus its angle in the undeformed body.

    The angle is zero for a beam. For a rigid body, or if both ends coincide, return those of the body frame.
    """
    angle, ends = system.body(names[0]).angle, _end_markers(system, names)
    x, y = ends[1].x0 - ends[0].x0 if ends else (0.0, 0.0)
    if x == y == 0.0:
        return q[:, angle], v[:, angle]
    first, last = _ends(system, names, q, v)
    offset = np.arctan2(y, x)
    (x, y), (dx, dy) = (last.position - first.position).T, (last.velocity - first.velocity).T
    # Choose the multiple of 2 pi within half a turn of the frame's angle.
    near = q[:, angle] + offset
    chord = near + (np.arctan2(y, x) - near + np.pi) % (2.0 * np.pi) - np.pi
    return chord - offset, (x * dy - y * dx) / (x**2 + y**2)


def _tip(system: System, names: Sequence[str], q: Array) -> Array:
    """Return displacement and slope of a beam's last end relative to the tangent at its first end."""
    if len(names) == 1:
        return tip_deflection(system, names[0], q)
    first, last = _ends(system, names, q, np.zeros_like(q))
    phi, end = (
        material_angle(system, PointRef(name, point), q)
        for name, point in ((names[0], FIRST_END), (names[-1], LAST_END))
    )
    c, s = np.cos(phi), np.sin(phi)
    x, y = (last.position - first.position).T
    length = sum(system.marker(PointRef(name, LAST_END)).x0[0] for name in names)
    return np.column_stack([c * x + s * y - length, c * y - s * x, end - phi])
