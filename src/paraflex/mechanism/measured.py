"""What is measured of a mechanism without asking for it: encoders of motors, the end-effector's place."""

from __future__ import annotations

from collections.abc import Container

from paraflex.mechanism.mechanism import Mechanism
from paraflex.mechanism.sensors import Encoder, PositionSensor, Sensor


def measured_sensors(mechanism: Mechanism) -> tuple[Sensor, ...]:
    """An encoder of every motor's joint, the end-effector's place, then the mechanism's own sensors, each name once."""
    joints = dict.fromkeys(motor.joint for motor in mechanism.motors)
    found: list[Sensor] = [Encoder(joint, joint) for joint in joints]
    effector = mechanism.end_effector
    if effector is not None:
        found += [PositionSensor(axis, effector.point, axis) for axis in ("x", "y") if axis in effector.coordinates]
    taken = {sensor.name for sensor in mechanism.sensors}
    return (*(sensor for sensor in found if sensor.name not in taken), *mechanism.sensors)


def encoders_of(mechanism: Mechanism, motors: Container[str]) -> tuple[str, ...]:
    """Names of the encoders of some motors, those of their joints, each once."""
    return tuple(dict.fromkeys(motor.joint for motor in mechanism.motors if motor.name in motors))
