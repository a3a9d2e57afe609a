"""Linear models of mechanisms about poses, planned motions and runs."""

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
from paraflex.dynamics import State, System, pose_at_rest, standing_system, static_equilibrium
from paraflex.dynamics.joint_coordinates import marker_place
from paraflex.dynamics.sensors import sensor_rows
from paraflex.dynamics.tangents import MotionPoint
from paraflex.errors import InputError, as_enum
from paraflex.kinematics import ModelWithPaths
from paraflex.limits import solvable
from paraflex.linear.coordinates import Chosen, Coordinates, FirstCoordinates, Variable, coordinates_of
from paraflex.linear.minimal import Minimal
from paraflex.linear.model import LinearModel
from paraflex.linear.points import planned_point, resting_point, run_point
from paraflex.mechanism import (
    ActuationMode,
    Mechanism,
    PointRef,
    Sensor,
    Start,
    in_frames,
    parse_mode,
)
from paraflex.mechanism.checks import known_point
from paraflex.mechanism.measured import measured_sensors
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
    coordinates : str
        First states: "motors", the coordinates of the motors' joints, or "task", those of the end-effector.

    Raises
    ------
    InputError
        An unknown mode, point or motion, nothing that could be an input, a time that the motion does not have, a time
        for a mechanism or a pose for a motion, a mechanism without any freedom, or coordinates of the end-effector that
        do not describe its motion.
    AssemblyError
        The loops do not close, or there is no equilibrium.
    SingularPositionError
        A singular position, at which no coordinates describe the motion.
    """
    return linear_model(
        *sought_motion(
            source, mode=mode, at=at, assembly=assembly, start=start, balanced=balanced, forces=forces,
            prescribed=prescribed, coordinates=coordinates,
        )
    )  # fmt: skip


class Sought(NamedTuple):
    """What a linear model is made from, but for the choice of its coordinates: see `linear_model`."""

    coordinates: Coordinates
    point: MotionPoint
    ports: Ports
    about: str
    unbalanced: float = 0.0


def sought_motion(
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
) -> Sought:
    """The point of a motion that is linearised about: see `linearise`."""
    moves = isinstance(source, TrackingTask | TrackingRun | MotionRun)
    others = {"assembly": assembly, "start": start, "balanced": balanced or None} if moves else {"at": at}
    for name, value in others.items():
        if value is not None:
            raise InputError(
                f"means nothing for a {'motion' if moves else 'pose at rest'}", field=name, value=value,
                remedy="leave it out, or give the mechanism" if moves else "leave it out, or give a plan or a run",
            )  # fmt: skip
    if moves:
        motion, ports, chart = charted(source, mode, forces, prescribed, coordinates)
        point = motion.point(0 if at is None else nearest_sample(motion.times, at))
        return Sought(chart, point, ports, motion.about)
    mechanism = Mechanism.made_of(source)
    chosen = mode_of(source, mechanism, mode)
    ports = ports_of(mechanism, chosen, forces, prescribed)
    given = start if start is not None or isinstance(source, Mechanism) else source.start
    system = standing_system(mechanism, given, assembly)
    state = pose_at_rest(system, given, assembly)
    if balanced:
        joints = [motor.joint for motor in mechanism.motors if motor.name in chosen.motors]
        state = static_equilibrium(system, state, list(dict.fromkeys(joints)))
    chart = coordinates_of(system, ports.prescribed, as_enum(FirstCoordinates, coordinates, "coordinates"))
    point, unbalanced = resting_point(chart, state, chosen)
    return Sought(chart, point, ports, "static equilibrium" if balanced else "a pose at rest", unbalanced)


def linear_model(
    coordinates: Coordinates,
    point: MotionPoint,
    ports: Ports,
    about: str,
    unbalanced: float = 0.0,
    *,
    chosen: Chosen | None = None,
) -> LinearModel:
    """The model about a point of a motion, in coordinates chosen there or before."""
    system = coordinates.system
    mechanism, tangents = system.mechanism, coordinates.at(point)
    chosen = coordinates.choose(tangents) if chosen is None else chosen
    if not chosen.freedoms:
        raise InputError("has no freedom to move", field="mechanism", value=mechanism.name, remedy="free a joint")
    motors = [k for k, motor in enumerate(mechanism.motors) if motor.name in ports.mode.motors]
    forces = _forces(system, point.q, tangents.motors[motors], ports.forces)
    minimal = Minimal(
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
        wanted=(np.arange(len(inputs)), np.arange(len(ports.sensors))),
    )


def charted(
    source: TrackingTask | TrackingRun | MotionRun, mode: str | ActuationMode | None, forces: Sequence[str],
    prescribed: Sequence[str], coordinates: FirstCoordinates | str,
) -> tuple[Moving, Ports, Coordinates]:  # fmt: skip
    """A motion, what goes into linear models along it and comes out, and the coordinates that they choose from."""
    task = source.task if isinstance(source, TrackingRun) else source
    mechanism = task.system.mechanism if isinstance(task, MotionRun) else task.mechanism
    ports = ports_of(mechanism, mode_of(source, mechanism, mode), forces, prescribed)
    motion = moving(source, ports.mode)
    first = as_enum(FirstCoordinates, coordinates, "coordinates")
    return motion, ports, coordinates_of(motion.system, ports.prescribed, first)


def mode_of(source: object, mechanism: Mechanism, mode: str | ActuationMode | None) -> ActuationMode:
    """A mode, by default that of a run, else all motors."""
    if mode is None and isinstance(source, TrackingRun):
        mode = source.mode
    if mode is None:
        return ActuationMode("all motors", tuple(motor.name for motor in mechanism.motors))
    return mode if isinstance(mode, ActuationMode) else parse_mode(mechanism, mode)


def ports_of(mechanism: Mechanism, mode: ActuationMode, forces: Sequence[str], prescribed: Sequence[str]) -> Ports:
    """Inputs and outputs from the names of points and of prescribed motions."""
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
    # Of beams in several frames the sensors are on the parts.
    return Ports(mode, points, tuple(prescribed), measured_sensors(in_frames(mechanism)))


class Moving(NamedTuple):
    """A planned motion or a run: what it is, its system, the times (k,) of its samples, and their points by number."""

    about: str
    system: System
    times: Array
    point: Callable[[int], MotionPoint]


def moving(source: TrackingTask | TrackingRun | MotionRun, mode: ActuationMode) -> Moving:
    """What linear models along a planned motion or a run are made from."""
    if isinstance(source, TrackingTask):
        return Moving("a planned motion", source.system, source.motion.t, partial(planned_point, source, mode))
    system = source.system if isinstance(source, MotionRun) else source.task.system
    # The state at an event is a sample more than a run along a path has torques for.
    return Moving("a run", system, source.solution.t[: len(source.applied)], partial(run_point, source))


def nearest_sample(times: Array, at: float) -> int:
    """Number of the sample nearest to a time [s].

    Raises
    ------
    InputError
        It is outside the motion.
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
    """Generalised forces (n, inputs) of unit torques of motors, by rows (motors, n), and along x and y at points."""
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
