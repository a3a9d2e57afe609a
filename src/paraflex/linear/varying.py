"""Linear time-varying models along motions, in common minimal coordinates.

The coordinates y(q) are the same functions of q along the motion, so that deviations of y and y' obey, to first order,

    x' = A(t) x + B(t) u,    z = C(t) x + D(t) u

including the terms of Z' that `minimal` has at every sample.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple, TypeVar

import numpy as np
import scipy

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array, Brief, brief
from paraflex.dynamics import System, sensor_readings
from paraflex.dynamics.tangents import MotionPoint
from paraflex.errors import InputError, Moment, SingularPositionError, as_enum
from paraflex.limits import solvable
from paraflex.mechanism import ActuationMode
from paraflex.motion import MotionRun
from paraflex.tracking import TrackingRun, TrackingTask
from .coordinates import CoordinateChoice, Coordinates, FirstCoordinates, Variable
from .discrete import InputHold, Prediction, SampledModel, transitions
from .linearise import ModelVariables, Ports, linear_model, motion_variables, moving, nearest_sample
from .minimal import MinimalEquations
from .model import LinearModel
from .named import labelled, matrices_of

if TYPE_CHECKING:
    import xarray as xr

T = TypeVar("T")

# Least number of samples of a cubic spline.
_FEWEST = 4
# Coordinates with a larger condition number at a point of a motion are replaced by others.
_WELL = 1e6
# Number of attempts to choose coordinates, in addition to one for each joint coordinate.
_MORE = 3
# Relative excess of a period over the motion's duration that is regarded as rounding.
_SAME = 1e-9


class Along(NamedTuple):
    """States (k, 2f), inputs (k, inputs) and outputs (k, outputs) of a motion at its samples."""

    states: Array
    inputs: Array
    outputs: Array
    __repr__ = brief


@dataclass(frozen=True)
class VaryingModel(Brief):
    """Linear time-varying model along a motion: x' = A(t) x + B(t) u, z = C(t) x + D(t) u.

    All variables are deviations from the nominal motion. The states are the same minimal coordinates along the motion,
    then their rates: see `LinearModel`.

    Attributes
    ----------
    mechanism, mode, about : str
        Mechanism, actuation mode and kind of motion, see `LinearModel`.
    states, inputs, outputs : tuple of Variable
        Names and units of states, inputs and outputs.
    times : (k,) array
        Sample times [s].
    A, B, C, D : (k, 2f, 2f), (k, 2f, inputs), (k, outputs, 2f) and (k, outputs, inputs) arrays
        State-space matrices at the samples.
    nominal : Along
        States, inputs and outputs of the nominal motion.
    coordinates : Coordinates
        Candidate coordinates.
    chosen : CoordinateChoice
        Minimal coordinates among them, which are states.
    ports : Ports
        Description of inputs and outputs.
    modal : (array, array)
        Transformation to scaled modal states at the first sample, see `LinearModel.modal_states`.
    """

    mechanism: str
    mode: str
    about: str
    states: tuple[Variable, ...]
    inputs: tuple[Variable, ...]
    outputs: tuple[Variable, ...]
    times: Array
    A: Array
    B: Array
    C: Array
    D: Array
    nominal: Along
    coordinates: Coordinates
    chosen: CoordinateChoice
    ports: Ports
    modal: tuple[Array, Array]

    @checked_arguments()
    def along(self, run: TrackingRun | MotionRun) -> Along:
        """Return states, inputs and outputs of another run, whose differences from `nominal` the model predicts.

        Parameters
        ----------
        run : TrackingRun or MotionRun
            Run of the same mechanism.

        Raises
        ------
        InputError
            The run is of a mechanism with other bodies.
        """
        found = moving(run, self.ports.mode)
        if not same_bodies(found.system, self.coordinates.system):
            raise InputError("belongs to a mechanism with other bodies", field="run", value=found.system.mechanism.name,
                             remedy="give a run of the mechanism of this model")  # fmt: skip
        return _along([found.point(k) for k in range(found.times.size)], self.coordinates, self.chosen, self.ports)

    @checked_arguments()
    @solvable("the sampled model")
    def discretised(self, period: float | None = None, *, hold: InputHold | str = InputHold.ZERO) -> SampledModel:
        """Discretise the model in time, by exponentials of A(t), which is interpolated by splines.

        Parameters
        ----------
        period : float, optional
            Sampling period, from the first sample on [s]; by default the samples are those of the model.
        hold : str
            Hold of the inputs between samples: "zero", constant (default), or "first", linear.

        Returns
        -------
        SampledModel
            Discrete-time model; its `error` includes the errors of splines and exponentials.

        Raises
        ------
        InputError
            The period is not positive, or longer than the motion.
        """
        hold, times = as_enum(InputHold, hold, "hold"), self.times
        if period is not None:
            times = _every(period, times)
        there, back = self.modal
        size = np.linalg.norm(there @ self.B[0], axis=0)
        size = np.where(size > 0.0, size, 1.0)
        found = transitions(self.times, there @ self.A @ back, there @ self.B / size, times, hold)
        C, D = (scipy.interpolate.make_interp_spline(self.times, each, k=3)(times) for each in (self.C, self.D))
        return SampledModel(
            self.states, self.inputs, self.outputs, times, hold, Phi=back @ found.Phi @ there,
            Gamma=back @ found.Gamma * size, Gamma_next=back @ found.Gamma_next * size, C=C, D=D, error=found.error,
        )  # fmt: skip

    def predict(
        self, x0: Mapping[str, float] | Array | None = None, du: Mapping[str, float | Array] | Array | None = None
    ) -> Prediction:
        """Predict the response to small changes of the initial state and of the inputs, which are linear in between.

        Parameters
        ----------
        x0 : (2f,) array or mapping of str to float, optional
            Change of the states at the first sample, of all or by name; zero by default.
        du : (k, inputs) array or mapping of str to float or (k,) array, optional
            Changes of the inputs at the samples, of all or by name; zero by default.
        """
        return self._between_samples.predict(x0, du)

    @cached_property
    def _between_samples(self) -> SampledModel:
        return self.discretised(hold=InputHold.FIRST)

    def to_xarray(self) -> xr.Dataset:
        """Return matrices and nominal values as a dataset labelled by time and names of variables, with units."""
        nominal = {f"nominal_{name}": (("time", name), getattr(self.nominal, f"{name}s"))
                   for name in ("state", "input", "output")}  # fmt: skip
        attrs = {"mechanism": self.mechanism, "mode": self.mode, "about": self.about}
        return labelled(self, matrices_of(self, first=("time",)) | nominal, attrs, time=self.times)


@checked_arguments()
@solvable("a linear model")
def linearise_along(
    source: TrackingTask | TrackingRun | MotionRun,
    *,
    times: Sequence[float] | None = None,
    mode: str | ActuationMode | None = None,
    forces: Sequence[str] = (),
    prescribed: Sequence[str] = (),
    coordinates: FirstCoordinates | str = FirstCoordinates.MOTORS,
) -> VaryingModel:
    """Linearise a mechanism along a planned motion or a run, as a linear time-varying model.

    The states are the same coordinates along the motion. The joint of a motor is not among them if it is nearly at a
    stationary point somewhere, as that of a slider at a dead centre.

    Parameters
    ----------
    source : TrackingTask, TrackingRun or MotionRun
        Planned motion or run.
    times : sequence of float, optional
        Sample times, rounded to the nearest samples of the motion [s]; by default all its samples.
    mode, forces, prescribed, coordinates
        Inputs and states, see `linearise`.

    Returns
    -------
    VaryingModel
        Linear time-varying model.

    Raises
    ------
    InputError
        There are fewer than four samples; or see `linearise`.
    SingularPositionError
        A position is singular, so that no coordinates describe the motion.
    """
    motion, variables = motion_variables(source, mode, forces, prescribed, coordinates)
    given = range(motion.times.size) if times is None else [nearest_sample(motion.times, at) for at in times]
    samples = np.unique(given).tolist()
    if len(samples) < _FEWEST:
        raise InputError("too few samples of the motion", field="times", value=len(samples),
                         remedy=f"give at least {_FEWEST} different ones")  # fmt: skip
    points = [motion.point(k) for k in samples]
    chosen, found = in_common_coordinates(points, variables, lambda model: model.state_space)
    first, (A, B, C, D) = linear_model(variables, points[0], chosen=chosen), zip(*found, strict=True)
    return VaryingModel(
        mechanism=first.mechanism, mode=first.mode, about=first.about, states=first.states, inputs=first.inputs,
        outputs=first.outputs, times=np.array([point.time for point in points]), A=np.array(A), B=np.array(B),
        C=np.array(C), D=np.array(D), nominal=_along(points, variables.coordinates, chosen, variables.ports),
        coordinates=variables.coordinates, chosen=chosen, ports=variables.ports, modal=first.modal_states,
    )  # fmt: skip


def in_common_coordinates(
    points: Sequence[MotionPoint], variables: ModelVariables, take: Callable[[LinearModel], T]
) -> tuple[CoordinateChoice, list[T]]:
    """Linearise at points of a motion in common minimal coordinates, and apply `take` to each linear model.

    The coordinates are those chosen at the first point, unless they are singular at a later one.

    Returns
    -------
    CoordinateChoice
        Minimal coordinates.
    list
        Results of `take`, one per point.

    Raises
    ------
    SingularPositionError
        No coordinates describe the motion at all points.
    """
    coordinates, without = variables.coordinates, list[int]()
    chosen, tries = coordinates.choose(coordinates.at(points[0])), len(coordinates.measured) + _MORE
    while True:
        first, found = None, []
        for point in points:
            model = linear_model(variables, point, chosen=chosen)
            first = first or model
            if not describes(model.minimal, first.minimal):
                break
            found.append(take(model))
        else:
            return chosen, found
        # The model is beyond or near a singular position.
        without += _given_up(model.minimal, coordinates)
        if not tries:
            raise _singular(model.minimal, [one.name for one in coordinates.names(chosen)])
        chosen, tries = coordinates.choose(model.minimal.tangents, without), tries - 1


def same_bodies(system: System, other: System) -> bool:
    """Return whether two systems have the same coordinates of bodies."""
    return [body.all for body in system.bodies] == [body.all for body in other.bodies]


def describes(minimal: MinimalEquations, elsewhere: MinimalEquations) -> bool:
    """Return whether coordinates are well-conditioned at a point, without a singular position before another point."""
    return minimal.condition <= _WELL and minimal.orientation == elsewhere.orientation


def _given_up(minimal: MinimalEquations, coordinates: Coordinates) -> list[int]:
    """Return the coordinate of `measured` to exclude from the states because the coordinates are nearly singular."""
    k = minimal.most_dependent()
    if k is None:
        return []
    number = int(minimal.chosen.joints[k])
    if number < len(coordinates.task) or k >= minimal.chosen.joints.size - minimal.driven:
        raise _singular(minimal, [coordinates.measured[number].name])
    return [number]


def _singular(minimal: MinimalEquations, names: Sequence[str]) -> SingularPositionError:
    return SingularPositionError(
        f"no change of coordinates of the linear model belongs to the motion there: {', '.join(names)}",
        Moment(minimal.point.time, 0), remedy="choose other coordinates, or times away from this singular position",
    )  # fmt: skip


def _along(points: Sequence[MotionPoint], coordinates: Coordinates, chosen: CoordinateChoice, ports: Ports) -> Along:
    """Return states, inputs and outputs at points of a motion."""
    mechanism = coordinates.system.mechanism
    t, q, v, a, multipliers, acting = (np.array(part) for part in zip(*points, strict=True))
    torques = acting[:, : len(mechanism.motors)]
    profiles = {one.name: one.profile for one in mechanism.prescribed}
    inputs = [
        *(torques[:, k] for k, motor in enumerate(mechanism.motors) if motor.name in ports.mode.motors),
        *(np.zeros_like(t) for _ in range(2 * len(ports.forces))),
        *(profiles[name].evaluate(t)[2] for name in ports.prescribed),
    ]
    readings = sensor_readings(coordinates.system, q, v, a, multipliers, torques, ports.sensors)
    return Along(coordinates.values(chosen, q, v), np.stack(inputs, axis=1), readings)


def _every(period: float, times: Array) -> Array:
    """Return sample times with a given period, from the first time on [s]."""
    duration = float(times[-1] - times[0])
    if not 0.0 < period <= duration * (1.0 + _SAME):
        raise InputError("is not a period of this motion", field="period", value=period,
                         remedy=f"give one up to {duration:.6g} s")  # fmt: skip
    periods = math.floor(duration / period + _SAME)
    return np.minimum(times[0] + period * np.arange(periods + 1), times[-1])
