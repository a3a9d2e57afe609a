"""Linearisation of mechanisms at poses, along planned motions and along runs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
import scipy
from scipy.sparse import csr_matrix

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array
from paraflex.dynamics import State, System, pose_at_rest, sensor_rows, standing_system, static_equilibrium
from paraflex.dynamics.points import marker_place
from paraflex.dynamics.tangents import MotionPoint
from paraflex.errors import InputError, as_enum
from paraflex.limits import solvable
from paraflex.mechanism import ActuationMode, Mechanism, PointRef, Sensor, Start, in_frames, parse_mode
from paraflex.mechanism.actuation_modes import check_torques
from paraflex.mechanism.checks import known_point
from paraflex.mechanism.measured import measured_sensors
from paraflex.motion import MotionRun
from paraflex.paths import ModelWithPaths
from paraflex.tracking import TrackingRun, TrackingTask
from .coordinates import CoordinateChoice, Coordinates, FirstCoordinates, Variable, coordinates_of
from .minimal import MinimalEquations
from .model import LinearModel
from .points import planned_point, resting_point, run_point

# Largest distance of a time from the nearest sample, relative to the largest spacing of samples.
_NEAR = 0.5


@dataclass(frozen=True)
class Ports:
    """Inputs and outputs of a linear model.

    Attributes
    ----------
    mode : ActuationMode
        Actuation mode, whose motors are inputs.
    forces : tuple of PointRef
        Points with forces along x and y as inputs.
    prescribed : tuple of str
        Prescribed motions whose accelerations are inputs.
    sensors : tuple of Sensor
        Sensors that are outputs.
    """

    mode: ActuationMode
    forces: tuple[PointRef, ...]
    prescribed: tuple[str, ...]
    sensors: tuple[Sensor, ...]


class ModelVariables(NamedTuple):
    """Coordinates, inputs and outputs that linear models along a motion share.

    Attributes
    ----------
    coordinates : Coordinates
        Candidate coordinates.
    ports : Ports
        Inputs and outputs.
    about : str
        Kind of operating point, see `LinearModel.about`.
    """

    coordinates: Coordinates
    ports: Ports
    about: str


@checked_arguments()
@solvable("a linear model")
def linearise(
    source: Mechanism | ModelWithPaths | TrackingTask | TrackingRun | MotionRun,
    *,
    mode: str | ActuationMode | None = None,
    at: float | None = None,
    assembly: str | None = None,
    start: Start | State | None = None,
    balanced: bool = False,
    forces: Sequence[str] = (),
    prescribed: Sequence[str] = (),
    coordinates: FirstCoordinates | str = FirstCoordinates.MOTORS,
) -> LinearModel:
    """Linearise a mechanism at an operating point, with motors as inputs and sensors as outputs.

    The operating point is a pose at rest of a mechanism (or a model), a sample of a planned motion (`pf.plan`), or a
    sample of a run, with its velocities, accelerations, constraint forces and torques. The outputs are an encoder at
    every motor's joint, the end-effector's coordinates x and y, and the mechanism's sensors, by name.

    Parameters
    ----------
    source : Mechanism, Model, TrackingTask, TrackingRun or MotionRun
        Mechanism, planned motion or run to linearise.
    mode : str or ActuationMode, optional
        Actuation mode; by default that of a run, else all motors. The other motors are passive.
    at : float, optional
        Time of the planned motion or run, of which the nearest sample is used [s]; by default its start.
    assembly : str, optional
        Assembly of a mechanism; by default the first.
    start : Start or State, optional
        Pose of a mechanism; by default that of the model or of the assembly.
    balanced : bool
        True linearises a mechanism at the static equilibrium nearest to the pose, with the joints of the mode's motors
        held. False by default.
    forces : sequence of str
        Points ("link1.C") at which forces along x and y are additional inputs; none by default.
    prescribed : sequence of str
        Prescribed motions whose accelerations are additional inputs; by default all if there is neither a motor nor a
        force. Other prescribed motions follow their profiles.
    coordinates : str
        First states: "motors", the coordinates of the motors' joints (default), or "task", those of the end-effector.

    Returns
    -------
    LinearModel
        Linear model at the operating point.

    Raises
    ------
    InputError
        A mode, point or prescribed motion is unknown, there are no inputs, the time is outside the motion, a time is
        given for a mechanism or a pose for a motion, the mechanism has no degree of freedom, or the coordinates of the
        end-effector do not describe its motion.
    AssemblyError
        The loops do not close, or there is no equilibrium.
    SingularPositionError
        The position is singular, so that no coordinates describe the motion.
    """
    return linear_model(*operating_point(
        source, mode, forces, prescribed, coordinates, at=at, assembly=assembly, start=start, balanced=balanced
    ))  # fmt: skip


def operating_point(
    source: Mechanism | ModelWithPaths | TrackingTask | TrackingRun | MotionRun,
    mode: str | ActuationMode | None = None,
    forces: Sequence[str] = (),
    prescribed: Sequence[str] = (),
    coordinates: FirstCoordinates | str = FirstCoordinates.MOTORS,
    *,
    at: float | None = None,
    assembly: str | None = None,
    start: Start | State | None = None,
    balanced: bool | None = None,
) -> tuple[ModelVariables, MotionPoint, float]:
    """Return the first arguments of `linear_model` for those of `linearise`."""
    moves = isinstance(source, TrackingTask | TrackingRun | MotionRun)
    without_meaning = {"assembly": assembly, "start": start, "balanced": balanced or None} if moves else {"at": at}
    for name, value in without_meaning.items():
        if value is not None:
            raise InputError(
                f"has no meaning for a {'motion' if moves else 'pose at rest'}", field=name, value=value,
                remedy="leave it out, or give the mechanism" if moves else "leave it out, or give a plan or a run",
            )  # fmt: skip
    if moves:
        motion, variables = motion_variables(source, mode, forces, prescribed, coordinates)
        return variables, motion.point(0 if at is None else nearest_sample(motion.times, at)), 0.0
    mechanism = Mechanism.from_source(source)
    chosen = mode_of(source, mechanism, mode)
    ports = ports_of(mechanism, chosen, forces, prescribed)
    given = start if start is not None or isinstance(source, Mechanism) else source.start
    system = standing_system(mechanism, given, assembly)
    state = pose_at_rest(system, given, assembly)
    if balanced:
        joints = [motor.joint for motor in mechanism.motors if motor.name in chosen.motors]
        state = static_equilibrium(system, state, list(dict.fromkeys(joints)))
    own = coordinates_of(system, ports.prescribed, as_enum(FirstCoordinates, coordinates, "coordinates"))
    about = "static equilibrium" if balanced else "a pose at rest"
    return ModelVariables(own, ports, about), *resting_point(own, state, chosen)


def linear_model(
    variables: ModelVariables, point: MotionPoint, unbalanced: float = 0.0, *, chosen: CoordinateChoice | None = None
) -> LinearModel:
    """Linearise at an operating point, in the given minimal coordinates or, by default, in those chosen there."""
    coordinates, ports, about = variables
    system = coordinates.system
    mechanism, tangents = system.mechanism, coordinates.at(point)
    chosen = coordinates.choose(tangents) if chosen is None else chosen
    if not chosen.freedoms:
        raise InputError("has no freedom to move", field="mechanism", value=mechanism.name, remedy="free a joint")
    motors = [k for k, motor in enumerate(mechanism.motors) if motor.name in ports.mode.motors]
    forces = _forces(system, point.q, tangents.motors[motors], ports.forces)
    minimal = MinimalEquations(
        system, point, tangents, chosen, coordinates.scale, forces,
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
        states=(*states, *(Variable(f"{one.name}_rate", f"{one.unit}/s") for one in states)),
        inputs=inputs,
        outputs=tuple(Variable(sensor.name, mechanism.sensor_unit(sensor)) for sensor in ports.sensors),
        minimal=minimal,
        rows=rows,
        selected=np.arange(len(inputs)),
    )


def motion_variables(
    source: TrackingTask | TrackingRun | MotionRun, mode: str | ActuationMode | None, forces: Sequence[str],
    prescribed: Sequence[str], coordinates: FirstCoordinates | str,
) -> tuple[OperatingPoints, ModelVariables]:  # fmt: skip
    """Return a motion, and the variables of linear models along it."""
    task = source.task if isinstance(source, TrackingRun) else source
    mechanism = task.system.mechanism if isinstance(task, MotionRun) else task.mechanism
    ports = ports_of(mechanism, mode_of(source, mechanism, mode), forces, prescribed)
    motion = moving(source, ports.mode)
    first = as_enum(FirstCoordinates, coordinates, "coordinates")
    return motion, ModelVariables(coordinates_of(motion.system, ports.prescribed, first), ports, motion.about)


def mode_of(source: object, mechanism: Mechanism, mode: str | ActuationMode | None) -> ActuationMode:
    """Return an actuation mode, by default that of a run, else the mode of all motors."""
    if mode is None and isinstance(source, TrackingRun):
        mode = source.mode
    if mode is None:
        return ActuationMode("all motors", tuple(motor.name for motor in mechanism.motors))
    mode = mode if isinstance(mode, ActuationMode) else parse_mode(mechanism, mode)
    check_torques(mode, "a linear model")
    return mode


def ports_of(mechanism: Mechanism, mode: ActuationMode, forces: Sequence[str], prescribed: Sequence[str]) -> Ports:
    """Return the inputs and outputs for the names of points and of prescribed motions."""
    if not (mode.motors or forces or prescribed):
        prescribed = [one.name for one in mechanism.prescribed]
        if not prescribed:
            raise InputError(
                "has neither motors nor prescribed motions, so that a linear model of it has no inputs",
                field="mechanism", value=mechanism.name, remedy="name points at which forces act: forces=[...]",
            )  # fmt: skip
    points = tuple(PointRef.parse(text, "forces") for text in forces)
    for point in points:
        known_point(mechanism, point, "forces")
    # Sensors on a beam in several frames belong to its parts.
    return Ports(mode, points, tuple(prescribed), measured_sensors(in_frames(mechanism)))


class OperatingPoints(NamedTuple):
    """Planned motion or run: description, system, sample times (k,) [s], and the operating point of each sample."""

    about: str
    system: System
    times: Array
    point: Callable[[int], MotionPoint]


def moving(source: TrackingTask | TrackingRun | MotionRun, mode: ActuationMode) -> OperatingPoints:
    """Return the operating points along a planned motion or a run."""
    if isinstance(source, TrackingTask):
        return OperatingPoints("a planned motion", source.system, source.motion.t, partial(planned_point, source, mode))
    system = source.system if isinstance(source, MotionRun) else source.task.system
    # A run along a path that ends at an event has one more state than torques.
    return OperatingPoints("a run", system, source.solution.t[: len(source.applied)], partial(run_point, source))


def nearest_sample(times: Array, at: float) -> int:
    """Return the number of the sample nearest to a time [s].

    Raises
    ------
    InputError
        The time is outside the motion.
    """
    sample = int(np.argmin(np.abs(times - at)))
    apart = float(np.max(np.diff(times), initial=0.0))
    if not abs(times[sample] - at) <= _NEAR * apart * (1.0 + 1e-9):
        raise InputError(
            "is not a time of the motion", field="at", value=at,
            remedy=f"choose one from {times[0]:.6g} to {times[-1]:.6g} s",
        )  # fmt: skip
    return sample


def _forces(system: System, q: Array, motors: csr_matrix, points: Sequence[PointRef]) -> csr_matrix:
    """Return the generalised forces (n, inputs) of unit motor torques and of unit forces along x and y at points.

    `motors` (motors, n) are the derivatives of the motors' coordinates.
    """
    places = [csr_matrix(marker_place(system, system.marker(point), q[None])[1][0]) for point in points]
    return csr_matrix(scipy.sparse.vstack([motors, *places]).T)


def _inputs(mechanism: Mechanism, motors: Sequence[int], ports: Ports) -> tuple[Variable, ...]:
    units = mechanism.motor_units()
    prescribed = {one.name: mechanism.joint(one.joint).slides for one in mechanism.prescribed}
    return (
        *(Variable(mechanism.motors[k].name, units[k]) for k in motors),
        *(Variable(f"{point}.{axis}", "N") for point in ports.forces for axis in ("x", "y")),
        *(Variable(f"{name}_acceleration", "m/s^2" if prescribed[name] else "rad/s^2") for name in ports.prescribed),
    )
