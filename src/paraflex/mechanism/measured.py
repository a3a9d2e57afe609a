"""Default measurements of a mechanism: encoders of the motors and the position of the end-effector."""

from collections.abc import Container

from .mechanism import Mechanism
from .sensors import Encoder, PositionSensor, Sensor


def measured_sensors(mechanism: Mechanism) -> tuple[Sensor, ...]:
    """Return an encoder at every motor's joint, position sensors of the end-effector, and the mechanism's own sensors.

    A default sensor whose name is that of one of the mechanism's own sensors is omitted.
    """
    joints = dict.fromkeys(motor.joint for motor in mechanism.motors)
    found: list[Sensor] = [Encoder(joint, joint) for joint in joints]
    effector = mechanism.end_effector
    if effector is not None:
        found += [PositionSensor(axis, effector.point, axis) for axis in ("x", "y") if axis in effector.coordinates]
    taken = {sensor.name for sensor in mechanism.sensors}
    return (*(sensor for sensor in found if sensor.name not in taken), *mechanism.sensors)


def encoders_of(mechanism: Mechanism, motors: Container[str]) -> tuple[str, ...]:
    """Return the names of the encoders of the given motors, which are those of their joints, without duplicates."""
    return tuple(dict.fromkeys(motor.joint for motor in mechanism.motors if motor.name in motors))
