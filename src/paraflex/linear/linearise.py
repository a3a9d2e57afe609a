"""Linear models of mechanisms about poses, planned motions and runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array
from paraflex.dynamics import State, System, build_system, consistent_state, joint_coordinate, start_state, static_equilibrium
from paraflex.dynamics.joint_coordinates import marker_place
from paraflex.dynamics.sensors import sensor_rows
from paraflex.dynamics.tangents import MotionPoint
from paraflex.errors import InputError
from paraflex.limits import solvable
from paraflex.linear.coordinates import Chosen, Coordinates, Quantity, coordinates_of
from paraflex.linear.minimal import Minimal
from paraflex.linear.model import LinearModel
from paraflex.linear.points import planned_point, resting_point, run_point
from paraflex.mechanism import ActuationMode, Encoder, Mechanism, PointRef, PositionSensor, Sensor, Start, parse_mode
from paraflex.motion import MotionRun
from paraflex.tracking import TrackingRun, TrackingTask

# A time is that of a sample if it is this near, as a part of the distance of samples.
_NEAR = 0.5


@dataclass(frozen=True)
class Ports:
    """What goes into a linear model and what comes out.

    Attributes
    ----------
    mode : ActuationMode
        Its motors are inputs.
    forces : tuple of PointRef
        Points with forces along x and y as inputs.
    prescribed : tuple of str
        Prescribed motions whose accelerations are inputs.
    sensors : tuple of Sensor
    """

    mode: ActuationMode
    forces: tuple[PointRef, ...]
    prescribed: tuple[str, ...]
    sensors: tuple[Sensor, ...]


@checked_arguments()
@solvable("a linear model")
def linearise(
    source: Mechanism | HasMechanism | TrackingTask | TrackingRun | MotionRun,
    *,
    mode: str | ActuationMode | None = None,
    at: float | None = None,
    assembly: str | None = None,
    start: Start | State | None = None,
    balanced: bool = False,
    forces: Sequence[str] = (),
    prescribed: Sequence[str] = (),
) -> LinearModel:
    """A linear model of small changes of a motion, with motors of a mode as inputs and sensors as outputs.

    Of a mechanism (or a model) it is about a pose at rest, of a planned motion (`pf.plan`) about that motion, of a run
    about the run, with velocities, accelerations, constraint forces and torques kept. Outputs are an encoder at every
    motor's joint, the end-effector's coordinates and the mechanism's sensors, by name.

    Parameters
    ----------
    source : Mechanism, Model, TrackingTask, TrackingRun or MotionRun
    mode : str or ActuationMode, optional
        All motors by default; of a run its own. The other motors turn freely.
    at : float, optional
        Time of the planned motion or run [s]: the nearest sample. Its start by default.
    assembly : str, optional
        Of a mechanism: the first by default.
    start : Start or State, optional
        Of a mechanism: the pose; by default the model's, or that of the assembly.
    balanced : bool
        Of a mechanism: about the static equilibrium nearest the pose, the joints of the mode's motors as they are.
    forces : sequence of str
        Points ("link1.C") at which forces along x and y are inputs as well.
    prescribed : sequence of str
        Prescribed motions whose accelerations are inputs as well; all by default where there is neither a motor nor a
        force. Others keep to their laws.

    Raises
    ------
    InputError
        An unknown mode, point or motion, nothing that could be an input, a time that the motion does not have, or a
        mechanism without any freedom.
    AssemblyError
        The loops do not close, or there is no equilibrium.
    SingularPositionError
        A singular position, at which no coordinates describe the motion.
    """
    mechanism = source if isinstance(source, Mechanism) else _mechanism_of(source)
    chosen = _mode(mechanism, mode if mode is not None else (source.mode if isinstance(source, TrackingRun) else None))
    ports = _ports(mechanism, chosen, forces, prescribed)
    unbalanced = 0.0
    if isinstance(source, TrackingTask | TrackingRun | MotionRun):
        system, point, about = _moving(source, chosen, at)
    else:
        given = start if start is not None or isinstance(source, Mechanism) else source.start
        system = build_system(mechanism)
        state = _pose(system, given, assembly)
        if balanced:
            joints = [motor.joint for motor in mechanism.motors if motor.name in chosen.motors]
            state = static_equilibrium(system, state, list(dict.fromkeys(joints)))
        point, unbalanced = resting_point(system, state, chosen)
        about = "static equilibrium" if balanced else "a pose at rest"
    return linear_model(coordinates_of(system, ports.prescribed), point, ports, about, unbalanced=unbalanced)


def linear_model(
    coordinates: Coordinates,
    point: MotionPoint,
    ports: Ports,
    about: str,
    *,
    chosen: Chosen | None = None,
    unbalanced: float = 0.0,
) -> LinearModel:
    """The model about a point of a motion, in coordinates chosen there unless they are given."""
    system = coordinates.system
    mechanism, tangents = system.mechanism, coordinates.at(point)
    chosen = coordinates.choose(tangents) if chosen is None else chosen
    if not chosen.count:
        raise InputError("has no freedom to move", field="mechanism", value=mechanism.name, remedy="free a joint")
    motors = [k for k, motor in enumerate(mechanism.motors) if motor.name in ports.mode.motors]
    minimal = Minimal(
        system, point, tangents, chosen, coordinates.scale, _forces(system, point.q, motors, ports.forces),
        np.array(motors, dtype=int), len(ports.prescribed),
    )  # fmt: skip
    states = coordinates.names(chosen)
    rows = sensor_rows(
        system, point.q, point.v, point.a, point.multipliers, point.torques[: len(mechanism.motors)], ports.sensors
    )
    inputs = _inputs(mechanism, motors, ports)
    return LinearModel(
        mechanism=mechanism.name,
        mode=ports.mode.name,
        about=about,
        unbalanced=unbalanced,
        states=(*states, *(Quantity(f"{one.name}_rate", f"{one.unit}/s") for one in states)),
        inputs=inputs,
        outputs=tuple(Quantity(sensor.name, sensor_unit(mechanism, sensor)) for sensor in ports.sensors),
        minimal=minimal,
        rows=rows,
        wanted=(np.arange(len(inputs)), np.arange(len(ports.sensors))),
    )


class HasMechanism(Protocol):
    """A model, or anything else with a mechanism and a start."""

    @property
    def mechanism(self) -> Mechanism: ...

    @property
    def start(self) -> Start | None: ...
