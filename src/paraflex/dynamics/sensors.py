"""Sensor readings from coordinates over time, and their exact derivatives at a state.

Every sensor reads from the few bodies, constraint rows and motors that it depends on; complex steps in these alone give
its derivatives. Squire, Trapp (1998), Using complex variables to estimate derivatives of real functions.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cache, partial
from typing import NamedTuple

import numpy as np
import scipy

from paraflex.arrays import Array, Numbers
from paraflex.errors import InputError
from paraflex.mechanism import GROUND, AssumedModesBeam, FlexibleBeam, Mechanism, PointRef, Sensor
from paraflex.mechanism.checks import check_sensor
from .contacts import sliding_joints
from .joint_coordinates import axis_angle, joint_coordinate, line_direction, unit_vectors
from .joint_loads import JointParts, joint_parts, load_in
from .points import marker_position, point_motion
from .sections import section_at
from .system import System

_STEP = 1e-30
# Share of the parts of a derivative in a direction by which it may differ from their sum.
_SMOOTH = 1e-9


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


class _Needed:
    """Recorder of the bodies, joints and beams that a sensor reads: a `mechanism.sensors.SensorInputs`.

    It returns numbers that differ from each other and from zero, as a reading may divide by a distance.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        self._mechanism = mechanism
        self.bodies: dict[str, None] = {}
        self.loads: dict[str, None] = {}
        self.beams: dict[str, None] = {}
        self._random = np.random.default_rng(0)

    def _of(self, *bodies: str, columns: tuple[int, ...] = ()) -> Array:
        self.bodies |= {name: None for name in bodies if name != GROUND}
        return 1.0 + self._random.random((1, *columns))

    def coordinate(self, joint: str) -> Array:
        named = self._mechanism.joint(joint)
        return self._of(named.a.body, named.b.body)

    rate = coordinate

    def position(self, point: PointRef) -> Array:
        return self._of(point.body, columns=(2,))

    velocity = acceleration = position

    def displacement(self, point: PointRef) -> Array:
        return self._of(point.body, columns=(3,))

    def origin(self, body: str) -> Array:
        return self._of(body, columns=(2,))

    def angle(self, body: str) -> Array:
        return self._of(body)

    def strain(self, beam: str, at: float | str, distance: float | None) -> Array:
        for joint in sliding_joints(self._mechanism, beam):
            self.coordinate(joint.name)
        self.beams[beam] = None
        return self._of(beam)

    def moment(self, joint: str) -> Array:
        self.loads[joint] = None
        return self.coordinate(joint)

    def axis(self, joint: str) -> Array:
        self.coordinate(joint)
        return self._of(columns=(2,))

    def force(self, joint: str) -> Array:
        self.loads[joint] = None
        return self.axis(joint)


class _Local:
    """Sensor in a reduced system with only the bodies that it depends on.

    Attributes
    ----------
    columns : MotionSamples of (c,) arrays
        Indices of the coordinates, multipliers and motors that it depends on.
    """

    def __init__(self, system: System, sensor: Sensor) -> None:
        needed = _Needed(system.mechanism)
        self._sensor = sensor
        self._checked(sensor.read(needed), 1, complex_step=False)
        bodies, columns, offset = [], [np.zeros(0, int)], 0
        for name in needed.bodies:
            body = system.body(name)
            bodies.append(replace(body, offset=offset))
            columns.append(np.arange(body.all.start, body.all.stop))
            offset += columns[-1].size
        self.system: System = replace(system, bodies=tuple(bodies))
        of_bodies = np.concatenate(columns)
        rows: list[int] = []
        motors: list[int] = []
        # Loads of each joint with its columns of multipliers and motors; columns of the contacts on each beam.
        self.parts: dict[str, tuple[JointParts, slice, slice]] = {}
        for name in needed.loads:
            parts = joint_parts(system, name)
            own = slice(len(rows), len(rows) + len(parts.rows)), slice(len(motors), len(motors) + len(parts.motors))
            self.parts[name] = (parts.alone(), *own)
            rows += parts.rows
            motors += parts.motors
        self.contacts: dict[str, slice] = {}
        for name in needed.beams:
            normal = [system.rows.index(f"{joint.name} normal") for joint in sliding_joints(system.mechanism, name)]
            self.contacts[name] = slice(len(rows), len(rows) + len(normal))
            rows += normal
        self.section_at = cache(partial(section_at, self.system))
        self.columns: MotionSamples = MotionSamples(
            of_bodies, of_bodies, of_bodies, np.array(rows, int), np.array(motors, int)
        )

    def taken(self, given: MotionSamples) -> MotionSamples:
        """Select the sensor's own columns from the samples of a system."""
        return MotionSamples(*(values[:, own] for values, own in zip(given, self.columns, strict=True)))

    def read(self, at: MotionSamples) -> Numbers:
        """Return the readings (k,) from the own columns of samples."""
        return self._checked(self._sensor.read(_LocalInputs(self, at)), len(at.q), complex_step=np.iscomplexobj(at.q))

    def _checked(self, readings: Numbers, samples: int, *, complex_step: bool) -> Numbers:
        """Check what a sensor returns, which may be a user's own class."""
        field, problem = f"sensor.{self._sensor.name}", ""
        if np.shape(readings) != (samples,):
            problem = f"its `read` returns an array of the shape {np.shape(readings)}"
        elif complex_step and not np.iscomplexobj(readings):
            problem = "its `read` returns real numbers for complex ones, so that it has no derivatives"
        if problem:
            remedy = "return readings (k,), and use no abs, norm or real part: np.sqrt(np.sum(x**2, axis=1))"
            raise InputError(problem, field=field, remedy=remedy)
        return readings

    def check_slopes(self, slopes: Array, direction: Array, together: float) -> None:
        """Check that the derivatives by all inputs (c,) give the derivative in a direction, as of a smooth reading."""
        field, remedy = f"sensor.{self._sensor.name}", "linearise where it has one, as a distance that is not zero"
        parts = slopes * direction
        if not (np.isfinite(slopes).all() and math.isfinite(together)):
            raise InputError("its reading is no number here", field=field, remedy=remedy)
        if abs(parts.sum() - together) > _SMOOTH * np.abs(parts).sum():
            raise InputError("its reading has no derivative here", field=field, remedy=remedy)


class _LocalInputs:
    """Quantities of a reduced system in motion: a `mechanism.sensors.SensorInputs`."""

    def __init__(self, local: _Local, at: MotionSamples) -> None:
        self._local, self._system, self._at = local, local.system, at

    def coordinate(self, joint: str) -> Numbers:
        return joint_coordinate(self._system, joint, self._at.q, self._at.v).value

    def rate(self, joint: str) -> Numbers:
        return joint_coordinate(self._system, joint, self._at.q, self._at.v).rate

    def position(self, point: PointRef) -> Numbers:
        return marker_position(self._system, self._system.marker(point), self._at.q)

    def velocity(self, point: PointRef) -> Numbers:
        return point_motion(self._system, point, self._at.q, self._at.v, self._at.a).velocity

    def acceleration(self, point: PointRef) -> Numbers:
        return point_motion(self._system, point, self._at.q, self._at.v, self._at.a).acceleration

    def displacement(self, point: PointRef) -> Numbers:
        marker = self._system.marker(point)
        u = self._at.q[:, self._system.bodies[marker.body].flexible]
        return np.column_stack([marker.relative_to(marker.on_frame).place(u), u @ marker.slope])

    def origin(self, body: str) -> Numbers:
        return self._at.q[:, self._system.body(body).position]

    def angle(self, body: str) -> Numbers:
        return self._at.q[:, self._system.body(body).angle]

    def strain(self, beam: str, at: float | str, distance: float | None) -> Numbers:
        """Return N / E A - distance M / E I, without N if the beam has no axial coordinates."""
        described = self._system.mechanism.body(beam)
        assert isinstance(described, FlexibleBeam | AssumedModesBeam)
        at_place = self._local.section_at(beam, described.points[at] if isinstance(at, str) else at)
        if at_place is None:
            return np.zeros(len(self._at.q), self._at.q.dtype)
        ((section, material),) = at_place.part.bars
        stiffness = material.youngs_modulus
        distance = section.outer_fibre if distance is None else distance
        assert distance is not None
        multipliers = self._at.multipliers[:, self._local.contacts[beam]]
        moment, force = at_place.loads(self._system, self._at.q, self._at.v, self._at.a, multipliers)
        axial = 1.0 / (stiffness * section.area) * force if at_place.part.force is not None else 0.0
        return axial - distance / (stiffness * section.second_moment) * moment

    def force(self, joint: str) -> Numbers:
        return self._load(joint)[0]

    def moment(self, joint: str) -> Numbers:
        return self._load(joint)[1]

    def _load(self, joint: str) -> tuple[Numbers, Numbers]:
        parts, rows, motors = self._local.parts[joint]
        at = self._at
        return load_in(self._system, joint, parts, at.q, at.multipliers[:, rows], at.torques[:, motors])

    def axis(self, joint: str) -> Numbers:
        named = self._system.mechanism.joint(joint)
        if "distance" in named.holds:
            return -line_direction(self._system, named, self._at.q)
        return unit_vectors(axis_angle(self._system, named, self._at.q))


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
        A sensor of what the mechanism does not have.

    Attributes
    ----------
    of_torques : bool
        Whether some readings depend on torques of motors.
    """

    def __init__(self, system: System, sensors: Sequence[Sensor] | None = None) -> None:
        self._locals: list[_Local] = _locals(system, sensors)
        self.of_torques: bool = any(each.columns.torques.size for each in self._locals)

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
    *,
    checked: bool = True,
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
    checked : bool
        Whether a reading that has no derivatives at the state is refused.

    Raises
    ------
    InputError
        A sensor refers to a member that the mechanism does not have, or its reading has no derivatives.
    """
    state = MotionSamples(*(np.asarray(each)[None] for each in (q, v, a, multipliers, torques)))
    found = _locals(system, sensors)
    entries: list[list[tuple[Array, Array]]] = [[] for _ in state]
    for each in found:
        own = each.taken(state)
        sizes = [values.shape[1] for values in own]
        # The last step is in all directions together.
        directions = np.vstack([np.eye(sum(sizes)), np.cos(np.arange(sum(sizes)))])
        steps = np.split(1j * _STEP * directions, np.cumsum(sizes)[:-1], axis=1)
        moved = MotionSamples(*(values + step for values, step in zip(own, steps, strict=True)))
        *slopes, together = np.imag(each.read(moved)) / _STEP
        if checked:
            each.check_slopes(np.array(slopes), directions[-1], together)
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
    return [_Local(system, sensor) for sensor in given]
