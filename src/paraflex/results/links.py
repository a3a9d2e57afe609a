"""Motion and loads of bodies, points, joints and motors at the samples of a run."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from paraflex.arrays import Array, Brief, NDArray
from paraflex.dynamics import Marker, System, end_markers, joint_coordinate, material_angle, sensor_readings
from paraflex.dynamics.joint_loads import (
    LoadComponents,
    drive_torques,
    frame_load,
    joint_loads,
    load_errors,
    undetermined_loads,
)
from paraflex.dynamics.load_values import load_values
from paraflex.dynamics.points import PointMotion, marker_motion, point_motion
from paraflex.dynamics.sections import Sections
from paraflex.integrators import Solution
from paraflex.mechanism import FIRST_END, LAST_END, PointRef
from .drawing import drawing_variables, system_drawing
from .numbers import single, stacked
from .outlines import chord_deflections
from .sensors import READING, SENSOR
from .stress import Variables, section_result, section_variables, stress_errors


@dataclass(frozen=True, kw_only=True)
class Links(Brief):
    """Motion and loads of bodies, points, joints and motors at the k sample times that a run reached.

    Bodies, joints and points are those of the mechanism in its order, even if the model divides bodies into parts.
    Points are all named points of all bodies, body after body. Values are NaN where a model has none.

    Attributes
    ----------
    variables : mapping of str to (tuple of str, array)
        Variables of a dataset by name: dimensions besides time, and values (k, ...). Units and signs are those of the
        dataset's attributes (see `labelled`). Every model has angles and their derivatives, of the tangent at a beam's
        first end in a model without body frames; angle and rate of the chord, the line from a beam's first end to its
        last, which does not depend on the choice of frame (of a modal body from its first point to its last, minus the
        angle undeformed; of a rigid body its angle); displacements and slope of a beam's last end (a modal body's last
        point) relative to the tangent at its first end; motion of the points; forces and moments of joints; multipliers
        of the constraint rows of the mechanism's system; speeds of motors; energies and work; deformed shapes. Only
        some models have coordinates of joints, torques and speeds of prescribed motions, loads on the ground, section
        forces and readings of sensors.
    load_errors : LoadComponents, optional
        Bounds of the integration errors of joint and drive loads; None if unknown.
    stress_errors : (bodies,) array, optional
        Bounds of the integration errors of stresses [Pa]; None if unknown, or without section forces.
    sections : Sections, optional
        Sections of the beams; None for models without shape functions, and without flexible beams.
    """

    variables: Variables
    load_errors: LoadComponents | None = None
    stress_errors: Array | None = None
    sections: Sections | None = None

    def __getitem__(self, name: str) -> NDArray[np.floating]:
        """Return the values (k, ...) of a variable."""
        return self.variables[name][1]


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
    multipliers = solution.multipliers[:samples]
    coordinates = {joint.name: joint_coordinate(system, joint.name, q, v) for joint in mechanism.joints}
    joints, errors = [joint.name for joint in mechanism.joints], solution.multiplier_errors
    loads = joint_loads(system, joints, q, multipliers, torques[:samples])
    shared = undetermined_loads(system, joints, q, solution.acting)
    drawn = system_drawing(system, q)
    frame = frame_load(system, drawn.joints, loads, q, v)
    drives, sensors = mechanism.prescribed, [one.name for one in mechanism.sensors]
    found, off = section_result(system, q, v, a, multipliers), solution.coordinate_errors
    variables: Variables = {
        "angle": (("body",), q[:, first]),
        "angular_velocity": (("body",), v[:, first]),
        "angular_acceleration": (("body",), a[:, first]),
        "chord_angle": (("body",), np.stack([angle for angle, _ in chords], axis=1)),
        "chord_velocity": (("body",), np.stack([rate for _, rate in chords], axis=1)),
        **tip_variables([_tip(system, names, q) for names in parts]),
        "deflection": (("body",), chord_deflections(mechanism, drawn.shape)),
        **point_variables([point_motion(system, ref, q, v, a) for ref in named], samples),
        "joint_force": (("joint", "axis"), np.where(shared.force, np.nan, loads.force)),
        "joint_moment": (("joint",), np.where(shared.moment, np.nan, loads.moment)),
        "multiplier": (("row",), _by_name(multipliers, system.rows, system.described_rows)),
        "motor_speed": (("motor",), stacked([coordinates[motor.joint].rate for motor in mechanism.motors], samples)),
        **{name: ((), getattr(solution, name)[:samples]) for name in ("kinetic_energy", "strain_energy", "work")},
        **drawing_variables(drawn, keep=single),
        "joint_coordinate": (("joint",), stacked([each.value for each in coordinates.values()], samples)),
        "joint_speed": (("joint",), stacked([each.rate for each in coordinates.values()], samples)),
    }
    if drives:
        torque = np.where(shared.drive, np.nan, drive_torques(system, multipliers))[:, : len(drives)]
        variables["drive_torque"] = (("drive",), torque)
        variables["drive_speed"] = (("drive",), stacked([coordinates[one.joint].rate for one in drives], samples))
    variables |= {"frame_force": (("axis",), frame.force), "frame_moment": ((), frame.moment)}
    if any(load.laws for load in mechanism.loads):
        acting = load_values(system, solution.t[:samples], q, v)[:, : len(mechanism.loads)]
        variables |= {"load_force": (("load", "axis"), acting[..., :2]), "load_torque": (("load",), acting[..., 2])}
    if sensors:
        readings = sensor_readings(system, q, v, a, multipliers, torques[:samples])
        given = [one.name for one in system.mechanism.sensors]
        variables[READING] = ((SENSOR,), _by_name(readings, given, sensors))
    if found is not None:
        variables |= section_variables(found, [body.name for body in mechanism.bodies])
    return Links(
        variables=variables,
        load_errors=None if errors is None else load_errors(system, joints, errors),
        stress_errors=None if off is None or found is None else stress_errors(system, off),
        sections=None if found is None else found.sections,
    )


def tip_variables(tips: Sequence[Array]) -> Variables:
    """Return the variables of axial and transverse displacements and slopes (k, 3) of the last end of each body."""
    parts = np.stack(tips, axis=-1).swapaxes(0, 1)
    return {
        f"tip_{name}": (("body",), part) for name, part in zip(("axial", "transverse", "slope"), parts, strict=True)
    }


def point_variables(points: Sequence[PointMotion], samples: int) -> Variables:
    """Return the variables of the motions of several points."""
    return {
        f"point_{name}": (("point", "axis"), stacked([getattr(one, name) for one in points], samples, 2))
        for name in PointMotion._fields
    }


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


def tip_deflection(system: System, name: str, q: Array) -> Array:
    """Return axial [m] and transverse [m] displacement and slope [rad] of a beam's last end: (k, 3).

    Displacements count from the position of the end on the straight beam along its tangent at the first end, whatever
    its reference condition. They are zero for a body without flexible coordinates. The axial displacement is the
    stretch, less the shortening by bending for second-order geometry. For a modal body, the columns are displacements
    along x and y and rotation of its last point relative to its first; NaN if it has no two distinct points.
    """
    body = system.body(name)
    if body.nf == 0:
        return np.zeros((q.shape[0], 3))
    ends = end_markers(system.index[name], body)
    if not ends:
        return np.full((q.shape[0], 3), np.nan)
    u, first, last = q[:, body.flexible], ends[0], ends[-1]
    chord = last.relative_to(first)
    apart, root = chord.place(u), u @ first.slope
    cos, sin = np.cos(root), np.sin(root)
    along = np.column_stack([cos * apart[:, 0] + sin * apart[:, 1], cos * apart[:, 1] - sin * apart[:, 0]])
    return np.column_stack([along - chord.x0, u @ last.slope - root])
