"""Sensor readings from coordinates over time, and their exact derivatives at a state.

Every sensor reads from the few bodies, constraint rows and motors that it depends on; complex steps in these alone give
its derivatives. Squire, Trapp (1998), Using complex variables to estimate derivatives of real functions.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import scipy

from paraflex.arrays import Array, Numbers
from paraflex.dynamics.contacts import sliding_joints
from paraflex.dynamics.joint_coordinates import axis_angle, joint_coordinate, line_direction, marker_position
from paraflex.dynamics.joint_loads import JointParts, joint_parts, load_in
from paraflex.dynamics.points import marker_motion
from paraflex.dynamics.sections import section_at
from paraflex.dynamics.system import System
from paraflex.mechanism import (
    GROUND,
    AssumedModesBeam,
    DeflectionSensor,
    Encoder,
    FlexibleBeam,
    Joint,
    JointForceSensor,
    PointSensor,
    PositionSensor,
    Sensor,
    StrainGauge,
    Tachometer,
    VelocitySensor,
    joints_named,
    points_named,
)
from paraflex.mechanism.checks import check_sensor
from paraflex.mechanism.sensors import unit_vector

_STEP = 1e-30


class MotionSamples(NamedTuple):
    """Inputs of sensors: coordinates (k, n) and their derivatives, multipliers (k, m), torques (k, motors)."""

    q: Numbers
    v: Numbers
    a: Numbers
    multipliers: Numbers
    torques: Numbers


class SensorRows(NamedTuple):
    """Sparse derivatives of readings: (sensors, n) by q, v and a, (sensors, m) and (sensors, motors)."""

    q: scipy.sparse.csr_matrix
    v: scipy.sparse.csr_matrix
    a: scipy.sparse.csr_matrix
    multipliers: scipy.sparse.csr_matrix
    torques: scipy.sparse.csr_matrix


class _Local(NamedTuple):
    """A sensor and the quantities it depends on.

    Attributes
    ----------
    read : callable
        Function from the samples of its own columns to readings (k,).
    columns : MotionSamples of (c,) arrays
        Numbers of the coordinates, multipliers and motors that it depends on.
    """

    read: Callable[[MotionSamples], Numbers]
    columns: MotionSamples

    def taken(self, given: MotionSamples) -> MotionSamples:
        """Select the sensor's own columns from the samples of a system."""
        return MotionSamples(*(values[:, own] for values, own in zip(given, self.columns, strict=True)))


class SensorReader:
    """Readings of sensors of a system, prepared for repeated calls.

    Parameters
    ----------
    system : System
        System of the mechanism.
    sensors : sequence of Sensor, optional
        Sensors to read; those of the mechanism by default.

    Raises
    ------
    InputError
        A sensor refers to a member that the mechanism does not have.
    """

    def __init__(self, system: System, sensors: Sequence[Sensor] | None = None) -> None:
        self._locals: list[_Local] = _locals(system, sensors)

    def __call__(self, q: Numbers, v: Numbers, a: Numbers, multipliers: Numbers, torques: Numbers) -> Numbers:
        """Return the readings: see `sensor_readings`."""
        given = MotionSamples(q, v, a, multipliers, torques)
        readings = [each.read(each.taken(given)) for each in self._locals]
        return np.stack(readings, axis=1) if readings else np.zeros((len(q), 0))


def sensor_readings(
    system: System,
    q: Numbers,
    v: Numbers,
    a: Numbers,
    multipliers: Numbers,
    torques: Numbers,
    sensors: Sequence[Sensor] | None = None,
) -> Numbers:
    """Return readings (k, sensors), each in its unit (`Mechanism.sensor_unit`); complex if any argument is.

    Parameters
    ----------
    system : System
        System of the mechanism.
    q, v, a : (k, n) arrays
        Coordinates, velocities and accelerations.
    multipliers : (k, m) array
        Multipliers.
    torques : (k, motors) array
        Torque or force of every motor.
    sensors : sequence of Sensor, optional
        Sensors to read; those of the mechanism by default.

    Raises
    ------
    InputError
        A sensor refers to a member that the mechanism does not have.
    """
    return SensorReader(system, sensors)(q, v, a, multipliers, torques)


def sensor_rows(
    system: System,
    q: Array,
    v: Array,
    a: Array,
    multipliers: Array,
    torques: Array,
    sensors: Sequence[Sensor] | None = None,
) -> SensorRows:
    """Return the derivatives of the readings at one state by all their inputs, exact up to rounding.

    Parameters
    ----------
    system, sensors
        System and sensors as for `sensor_readings`.
    q, v, a : (n,) arrays
        Coordinates, velocities and accelerations.
    multipliers : (m,) array
        Multipliers.
    torques : (motors,) array
        Torque or force of every motor.

    Raises
    ------
    InputError
        A sensor refers to a member that the mechanism does not have.
    """
    state = MotionSamples(*(np.asarray(each)[None] for each in (q, v, a, multipliers, torques)))
    found = _locals(system, sensors)
    entries: list[list[tuple[Array, Array]]] = [[] for _ in state]
    for each in found:
        own = each.taken(state)
        sizes = [values.shape[1] for values in own]
        steps = np.split(1j * _STEP * np.eye(sum(sizes)), np.cumsum(sizes)[:-1], axis=1)
        slopes = (
            np.imag(each.read(MotionSamples(*(values + step for values, step in zip(own, steps, strict=True))))) / _STEP
        )
        for kind, columns, values in zip(entries, each.columns, np.split(slopes, np.cumsum(sizes)[:-1]), strict=True):
            kind.append((columns, values))
    return SensorRows(*(_sparse(kind, values.shape[1]) for kind, values in zip(entries, state, strict=True)))


def _sparse(rows: Sequence[tuple[Array, Array]], width: int) -> scipy.sparse.csr_matrix:
    """Return the matrix of rows given by their columns and the values there."""
    counts = [columns.size for columns, _ in rows]
    columns = np.concatenate([np.zeros(0, int), *(columns for columns, _ in rows)])
    values = np.concatenate([np.zeros(0), *(values for _, values in rows)])
    where = (np.repeat(np.arange(len(rows)), counts), columns)
    matrix = scipy.sparse.csr_matrix((values, where), (len(rows), width))
    matrix.eliminate_zeros()
    return matrix


def _locals(system: System, sensors: Sequence[Sensor] | None) -> list[_Local]:
    given = system.mechanism.sensors if sensors is None else sensors
    for sensor in given if sensors is not None else ():
        if sensor not in system.mechanism.sensors:
            check_sensor(system.mechanism, sensor)
    return [_local(system, sensor) for sensor in given]


def _local(system: System, sensor: Sensor) -> _Local:
    """Return a sensor in a system reduced to the bodies that it depends on."""
    names, parts = _bodies(system, sensor), JointParts((), ())
    if isinstance(sensor, JointForceSensor):
        parts = joint_parts(system, sensor.joint)
    bodies, columns, offset = [], [np.zeros(0, int)], 0
    for name in names:
        body = system.body(name)
        bodies.append(replace(body, offset=offset))
        columns.append(np.arange(body.all.start, body.all.stop))
        offset += columns[-1].size
    read = _reader(replace(system, bodies=tuple(bodies)), sensor, parts.alone())
    of_bodies = np.concatenate(columns)
    normal = [system.rows.index(f"{joint.name} normal") for joint in _contacts(system, sensor)]
    rows, motors = (np.array(each, int) for each in (parts.rows + normal, list(parts.motors)))
    return _Local(read, MotionSamples(of_bodies, of_bodies, of_bodies, rows, motors))


def _contacts(system: System, sensor: Sensor) -> list[Joint]:
    """Return the joints that slide along the beam of a strain sensor: their forces bend it locally."""
    return sliding_joints(system.mechanism, sensor.body) if isinstance(sensor, StrainGauge) else []


def _bodies(system: System, sensor: Sensor) -> list[str]:
    """Return the names of the bodies that a reading depends on, each once."""
    joints = [system.mechanism.joint(name) for _, name, _ in joints_named(sensor)] + _contacts(system, sensor)
    points = [*points_named(sensor).values(), *(point for joint in joints for point in (joint.a, joint.b))]
    names = [*(point.body for point in points), getattr(sensor, "body", GROUND)]
    return [name for name in dict.fromkeys(names) if name != GROUND]


def _reader(system: System, sensor: Sensor, parts: JointParts) -> Callable[[MotionSamples], Numbers]:
    """Return the function that evaluates a sensor of a system."""
    if isinstance(sensor, Encoder):
        return lambda at: joint_coordinate(system, sensor.joint, at.q, at.v).value
    if isinstance(sensor, Tachometer):
        return lambda at: joint_coordinate(system, sensor.joint, at.q, at.v).rate
    if isinstance(sensor, PointSensor):
        return _of_point(system, sensor)
    if isinstance(sensor, StrainGauge):
        return _of_strain(system, sensor)
    if isinstance(sensor, JointForceSensor):
        return lambda at: _of_load(system, sensor, parts, at)
    if isinstance(sensor, DeflectionSensor):
        return _of_deflection(system, sensor)
    raise TypeError(sensor)


def _of_point(system: System, sensor: PointSensor) -> Callable[[MotionSamples], Numbers]:
    """Return the reader of a component of a point's motion along an axis, which a body may carry."""
    marker, (ex, ey) = system.marker(sensor.point), sensor.direction
    frame = None if sensor.body == GROUND else system.body(sensor.body)

    def read(at: MotionSamples) -> Numbers:
        if isinstance(sensor, PositionSensor):
            vector = marker_position(system, marker, at.q)
            vector = vector if frame is None else vector - at.q[:, frame.position]
        else:
            motion = marker_motion(system, marker, at.q, at.v, at.a)
            vector = motion.velocity if isinstance(sensor, VelocitySensor) else motion.acceleration
        if frame is None:
            return ex * vector[:, 0] + ey * vector[:, 1]
        c, s = np.cos(at.q[:, frame.angle]), np.sin(at.q[:, frame.angle])
        return (c * ex - s * ey) * vector[:, 0] + (s * ex + c * ey) * vector[:, 1]

    return read


def _of_strain(system: System, sensor: StrainGauge) -> Callable[[MotionSamples], Numbers]:
    """Return the reader of a beam's strain, N / E A - distance M / E I; without N if its coordinates do not stretch."""
    described = system.mechanism.body(sensor.body)
    assert isinstance(described, FlexibleBeam | AssumedModesBeam)
    at_place = section_at(system, sensor.body, sensor.place(described.points))
    if at_place is None:
        return lambda at: np.zeros(len(at.q))
    section, stiffness = at_place.section, at_place.material.youngs_modulus
    distance = section.outer_fibre if sensor.distance is None else sensor.distance
    assert distance is not None
    bending, axial = distance / (stiffness * section.second_moment), 1.0 / (stiffness * section.area)

    def read(at: MotionSamples) -> Numbers:
        moment, force = at_place.loads(system, at.q, at.v, at.a, at.multipliers)
        return (axial * force if at_place.part.force is not None else 0.0) - bending * moment

    return read


def _of_load(system: System, sensor: JointForceSensor, parts: JointParts, at: MotionSamples) -> Numbers:
    """Return a component of a joint's force, or its moment."""
    force, moment = load_in(system, sensor.joint, parts, at.q, at.multipliers, at.torques)
    if sensor.axis == "moment":
        return moment
    if sensor.axis == "along":
        joint = system.mechanism.joint(sensor.joint)
        if "distance" in joint.holds:
            return -np.sum(line_direction(system, joint, at.q) * force, axis=1)
        angle = axis_angle(system, joint, at.q)
        return np.cos(angle) * force[:, 0] + np.sin(angle) * force[:, 1]
    ex, ey = unit_vector(sensor.axis)
    return ex * force[:, 0] + ey * force[:, 1]


def _of_deflection(system: System, sensor: DeflectionSensor) -> Callable[[MotionSamples], Numbers]:
    """Return the reader of a point's displacement in its body's frame, or of the rotation of the material there."""
    marker = system.marker(sensor.point)
    body = system.bodies[marker.body]
    if sensor.axis == "angle":
        return lambda at: at.q[:, body.flexible] @ marker.slope
    row = 0 if sensor.axis == "x" else 1

    def read(at: MotionSamples) -> Numbers:
        u = at.q[:, body.flexible]
        moved = u @ marker.N[row]
        if row or marker.bending is None:
            return moved
        return moved - 0.5 * np.sum(u * (u @ marker.bending), axis=1)

    return read
