"""Fast evaluation of sensor readings at single instants, for controllers that sample at about 1 kHz."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from paraflex.arrays import Array
from paraflex.dynamics import System
from paraflex.dynamics.coordinates import GROUND_INDEX, Marker
from paraflex.dynamics.points import marker_position
from paraflex.dynamics.sensors import SensorReader, sensor_rows
from paraflex.integrators.run import Instant
from paraflex.mechanism import GROUND, Sensor

# A reading is regarded as a product with constant rows if it agrees to this relative accuracy at random states.
_SAME = 1e-9
_TRIALS = 3


class Affine(NamedTuple):
    """Readings y = value + rows_q q + rows_v v + rows_a a + w^2 (turning q), with w the rate of a body's angle.

    Attributes
    ----------
    value : (sensors,) array
        Readings at zero coordinates, velocities and accelerations.
    q, v, a, turning : (sensors, n) arrays
        Rows of coordinates, velocities and accelerations, and rows of the coordinates by w^2.
    angle : (sensors,) array of int
        Index of the angle.
    """

    value: Array
    q: Array
    v: Array
    a: Array
    turning: Array
    angle: np.ndarray

    def at(self, q: Array, v: Array, a: Array) -> Array:
        """Return the readings (sensors,) at a state (n,)."""
        return self.value + self.q @ q + self.v @ v + self.a @ a + v[self.angle] ** 2 * (self.turning @ q)


class Place(NamedTuple):
    """Position of a material point along an axis of the ground.

    Attributes
    ----------
    sensor : int
        Index of the sensor.
    axis : (2,) array
        Direction of the axis.
    marker : Marker
        Material point of a body.
    """

    sensor: int
    axis: Array
    marker: Marker


class Readings:
    """Readings of some sensors of a system at one instant after another.

    Angles, their rates and strains are linear in coordinates, velocities and accelerations, except for the contribution
    of a beam's rotation to its strain. Positions of points are computed directly, and other readings one by one.

    Parameters
    ----------
    system : System
        Equations of motion of the mechanism.
    sensors : sequence of Sensor
        Sensors to be read.
    found : sequence of Affine or None, optional
        Rows of the sensors, None for readings that are not linear; computed by default.

    Attributes
    ----------
    names : tuple of str
        Names of the sensors.
    units : tuple of str
        Units of the readings.
    of_torques : bool
        Whether some readings depend on torques as well.
    """

    def __init__(self, system: System, sensors: Sequence[Sensor], found: Sequence[Affine | None] | None = None) -> None:
        self.system: System = system
        self.sensors: tuple[Sensor, ...] = tuple(sensors)
        self.names: tuple[str, ...] = tuple(sensor.name for sensor in sensors)
        self.units: tuple[str, ...] = tuple(system.mechanism.sensor_unit(sensor) for sensor in sensors)
        found = [_affine(system, sensor) for sensor in sensors] if found is None else found
        self._found = found
        self.linear: list[int] = [k for k, one in enumerate(found) if one is not None]
        none, rows = np.zeros((0, system.n)), [one for one in found if one is not None]
        together = zip(Affine(np.zeros(0), none, none, none, none, np.zeros(0, int)), *rows, strict=True)
        self.affine: Affine = Affine(*map(np.concatenate, together))
        several = [_place(system, sensor, k) for k, sensor in enumerate(sensors)]
        self.places: list[Place] = [place for place in several if place is not None]
        apart = {*self.linear, *(place.sensor for place in self.places)}
        self._others: list[int] = [k for k in range(len(sensors)) if k not in apart]
        self._reader = SensorReader(system, [self.sensors[k] for k in self._others])
        self.of_torques: bool = self._reader.of_torques

    @property
    def simple(self) -> bool:
        """Whether all readings are linear or positions."""
        return not self._others

    def only(self, names: Sequence[str]) -> "Readings":
        """Return the readings of some of the sensors."""
        places = [self.names.index(name) for name in names]
        return Readings(self.system, [self.sensors[k] for k in places], [self._found[k] for k in places])

    def __call__(self, now: Instant, torques: Array) -> Array:
        """Return the readings (sensors,) at an instant, under torques (motors,)."""
        found = np.empty(len(self.sensors))
        if self.linear:
            found[self.linear] = self.affine.at(now.q, now.v, now.a)
        marker, position = None, np.zeros(2)
        for place in self.places:
            if place.marker is not marker:
                marker, position = place.marker, marker_position(self.system, place.marker, now.q)
            found[place.sensor] = place.axis @ position
        if self._others:
            given = (now.q[None], now.v[None], now.a[None], now.multipliers[None], torques[None])
            found[self._others] = self._reader(*given)[0]
        return found


def _place(system: System, sensor: Sensor, number: int) -> Place | None:
    """Return a sensor as a point's position along an axis of the ground; None if it measures something else."""
    if sensor.fixed_point is None:
        return None
    point, axis = sensor.fixed_point
    marker = system.marker(point)
    return None if marker.body == GROUND_INDEX else Place(number, np.array(axis, dtype=float), marker)


@np.errstate(divide="ignore", invalid="ignore")
def _affine(system: System, sensor: Sensor) -> Affine | None:
    """Return the reading as a product with constant rows; None if it is not of that form."""
    if sensor.fixed_point is not None:
        return None
    n, m, motors = system.n, system.m, len(system.mechanism.motors)
    frame = sensor.location.frame
    angle, still = system.body(system.bodies[0].name if frame == GROUND else frame).angle, np.zeros(n)
    turning = np.zeros(n)
    turning[angle] = 1.0
    at_rest = sensor_rows(system, still, still, still, np.zeros(m), np.zeros(motors), [sensor], checked=False)
    turned = sensor_rows(system, still, turning, still, np.zeros(m), np.zeros(motors), [sensor], checked=False)
    reader = SensorReader(system, [sensor])

    def read(q: Array, v: Array, a: Array, multipliers: Array, torques: Array) -> Array:
        return reader(q[None], v[None], a[None], multipliers[None], torques[None])[0]

    rows_q, rows_v, rows_a = (np.asarray(rows.todense()) for rows in (at_rest.q, at_rest.v, at_rest.a))
    extra = np.asarray(turned.q.todense()) - rows_q
    found = Affine(
        read(still, still, still, np.zeros(m), np.zeros(motors)), rows_q, rows_v, rows_a, extra, np.array([angle])
    )
    random = np.random.default_rng(0)
    for _ in range(_TRIALS):
        q, v, a, multipliers, torques = (random.standard_normal(size) for size in (n, n, n, m, motors))
        exact, linear = read(q, v, a, multipliers, torques), found.at(q, v, a)
        # A reading that divides by a distance may be NaN at zero coordinates.
        if not abs(exact[0] - linear[0]) <= _SAME * max(abs(exact[0]), abs(linear[0])):
            return None
    return found
