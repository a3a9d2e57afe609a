"""Linear models along motions: matrices that vary with time, in one choice of minimal coordinates.

The coordinates y(q) are the same functions of q all along, so that changes of y and y' obey, to first order,

    x' = A(t) x + B(t) u,    z = C(t) x + D(t) u

with the terms of Z' that `minimal` has at every sample.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple, TypeVar

import numpy as np
from scipy.interpolate import make_interp_spline

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array
from paraflex.dynamics import sensor_readings
from paraflex.dynamics.tangents import MotionPoint
from paraflex.errors import InputError, Moment, SingularPositionError, as_enum
from paraflex.limits import solvable
from paraflex.linear.coordinates import Chosen, Coordinates, FirstCoordinates, Variable, named_axes
from paraflex.linear.discrete import InputHold, Predicted, SampledModel, transitions
from paraflex.linear.linearise import Ports, charted, linear_model, moving, nearest_sample
from paraflex.linear.minimal import Minimal
from paraflex.linear.model import LinearModel
from paraflex.mechanism import ActuationMode
from paraflex.motion import MotionRun
from paraflex.tracking import TrackingRun, TrackingTask

if TYPE_CHECKING:
    import xarray as xr

T = TypeVar("T")

# Cubic splines pass through so many samples at least.
_FEWEST = 4
# Coordinates of a larger condition number anywhere on a motion are chosen anew.
_WELL = 1e6
# So often they are chosen anew beside once for each coordinate of a joint.
_MORE = 3
# A period counts as the motion's duration if it is longer by this part.
_SAME = 1e-9


class Along(NamedTuple):
    """What a motion has of a model's states (k, 2f), inputs (k, inputs) and outputs (k, outputs) at its samples."""

    states: Array
    inputs: Array
    outputs: Array


@dataclass(frozen=True)
class VaryingModel:
    """Small changes along a motion: x' = A(t) x + B(t) u, z = C(t) x + D(t) u, all changes from the nominal values.

    States are the same minimal coordinates all along, then their rates: see `LinearModel`.

    Attributes
    ----------
    mechanism, mode, about : str
        See `LinearModel`.
    states, inputs, outputs : tuple of Variable
        Names and units.
    times : (k,) array
        Of the samples [s].
    A, B, C, D : (k, 2f, 2f), (k, 2f, inputs), (k, outputs, 2f) and (k, outputs, inputs) arrays
    nominal : Along
        States, inputs and outputs of the motion itself.
    coordinates : Coordinates
    chosen : Chosen
        Which of them are states.
    ports : Ports
    modal : (array, array)
        See `LinearModel.modal_states`, at the first sample.
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
    chosen: Chosen
    ports: Ports
    modal: tuple[Array, Array]

    @checked_arguments()
    def along(self, run: TrackingRun | MotionRun) -> Along:
        """States, inputs and outputs of another run of the mechanism: less `nominal`, they are what a model predicts.

        Parameters
        ----------
        run : TrackingRun or MotionRun

        Raises
        ------
        InputError
            A run of a mechanism with other bodies.
        """
        found = moving(run, self.ports.mode)
        if [body.all for body in found.system.bodies] != [body.all for body in self.coordinates.system.bodies]:
            raise InputError("is of a mechanism with other bodies", field="run", value=found.system.mechanism.name,
                             remedy="give a run of the mechanism of this model")  # fmt: skip
        return _along([found.point(k) for k in range(found.times.size)], self.coordinates, self.chosen, self.ports)

    @checked_arguments()
    @solvable("the sampled model")
    def discretised(self, period: float | None = None, *, hold: InputHold | str = InputHold.ZERO) -> SampledModel:
        """The model at samples, each period's matrices by exponentials of A(t), which splines give between samples.

        Parameters
        ----------
        period : float, optional
            Time between samples, from the first on [s]; those of the model by default.
        hold : str
            Inputs between samples: "zero", constant, or "first", straight lines.

        Returns
        -------
        SampledModel
            Its `error` has what splines and exponentials miss.

        Raises
        ------
        InputError
            A period that is not positive, or longer than the motion.
        """
        hold, times = as_enum(InputHold, hold, "hold"), self.times
        if period is not None:
            times = _every(period, times)
        there, back = self.modal
        size = np.linalg.norm(there @ self.B[0], axis=0)
        size = np.where(size > 0.0, size, 1.0)
        found = transitions(self.times, there @ self.A @ back, there @ self.B / size, times, hold)
        C, D = (make_interp_spline(self.times, each, k=3)(times) for each in (self.C, self.D))
        return SampledModel(
            self.states, self.inputs, self.outputs, times, hold, Phi=back @ found.Phi @ there,
            Gamma=back @ found.Gamma * size, Gamma_next=back @ found.Gamma_next * size, C=C, D=D, error=found.error,
        )  # fmt: skip

    def predict(
        self, x0: Mapping[str, float] | Array | None = None, du: Mapping[str, float | Array] | Array | None = None
    ) -> Predicted:
        """What a small change of the start and of the inputs leads to, straight lines between the samples' inputs.

        Parameters
        ----------
        x0 : (2f,) array or mapping of str to float, optional
            Change of the states at the first sample; of some by name.
        du : (k, inputs) array or mapping of str to float or (k,) array, optional
            Changes of the inputs at the samples; of some by name.
        """
        return self._between_samples.predict(x0, du)

    @cached_property
    def _between_samples(self) -> SampledModel:
        return self.discretised(hold=InputHold.FIRST)

    def to_xarray(self) -> xr.Dataset:
        """Matrices and nominal values by time and by names of states, inputs and outputs, with units."""
        import xarray as xr

        data = {
            "A": (("time", "state", "state_of"), self.A), "B": (("time", "state", "input"), self.B),
            "C": (("time", "output", "state_of"), self.C), "D": (("time", "output", "input"), self.D),
            **{f"nominal_{name}": (("time", name), getattr(self.nominal, f"{name}s"))
               for name in ("state", "input", "output")},
        }  # fmt: skip
        attrs = {"mechanism": self.mechanism, "mode": self.mode, "about": self.about}
        axes = named_axes(self.states, self.inputs, self.outputs)
        return xr.Dataset(data, coords={**axes, "time": self.times}, attrs=attrs)


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
    """A linear model of small changes along a planned motion or a run, which varies with time.

    Its states are the same coordinates all along. A motor's joint that hardly moves with the mechanism somewhere, as
    that of a slider at a dead centre, is not among them.

    Parameters
    ----------
    source : TrackingTask, TrackingRun or MotionRun
    times : sequence of float, optional
        Times of the samples [s], the nearest of the motion's; all of them by default.
    mode, forces, prescribed, coordinates
        See `linearise`.

    Raises
    ------
    InputError
        See `linearise`; or fewer than four samples.
    SingularPositionError
        A singular position, at which no coordinates describe the motion.
    """
    motion, ports, choice = charted(source, mode, forces, prescribed, coordinates)
    given = range(motion.times.size) if times is None else [nearest_sample(motion.times, at) for at in times]
    samples = np.unique(given).tolist()
    if len(samples) < _FEWEST:
        raise InputError("too few samples of the motion", field="times", value=len(samples),
                         remedy=f"give at least {_FEWEST} different ones")  # fmt: skip
    points = [motion.point(k) for k in samples]
    chosen, found = in_one_chart(points, choice, ports, motion.about, lambda model: model.state_space)
    first, (A, B, C, D) = linear_model(choice, points[0], ports, motion.about, chosen=chosen), zip(*found, strict=True)
    return VaryingModel(
        mechanism=first.mechanism, mode=first.mode, about=first.about, states=first.states, inputs=first.inputs,
        outputs=first.outputs, times=np.array([point.time for point in points]), A=np.array(A), B=np.array(B),
        C=np.array(C), D=np.array(D), nominal=_along(points, choice, chosen, ports), coordinates=choice,
        chosen=chosen, ports=ports, modal=first.modal_states,
    )  # fmt: skip


def in_one_chart(
    points: Sequence[MotionPoint], coordinates: Coordinates, ports: Ports, about: str, take: Callable[[LinearModel], T]
) -> tuple[Chosen, list[T]]:
    """What is taken of the linear models at points of a motion, in coordinates that are well chosen at all of them.

    They are those chosen at the first, unless they are singular later.

    Raises
    ------
    SingularPositionError
        No coordinates describe the motion at all points.
    """
    without: list[int] = []
    chosen, tries = coordinates.choose(coordinates.at(points[0])), len(coordinates.measured) + _MORE
    while True:
        found = _taken((linear_model(coordinates, point, ports, about, chosen=chosen) for point in points), take)
        if not isinstance(found, LinearModel):
            return chosen, found
        without += _given_up(found.minimal, coordinates)
        if not tries:
            raise _singular(found.minimal, [one.name for one in coordinates.names(chosen)])
        chosen, tries = coordinates.choose(found.minimal.tangents, without), tries - 1


def _taken(models: Iterable[LinearModel], take: Callable[[LinearModel], T]) -> list[T] | LinearModel:
    """What is taken of all models; or only the first of them beyond or near a singular position."""
    first, found = None, []
    for model in models:
        first = first or model
        if not describes(model.minimal, first.minimal):
            return model
        found.append(take(model))
    return found


def describes(minimal: Minimal, elsewhere: Minimal) -> bool:
    """Whether coordinates describe the motion well at one point, and no singular position lies before another."""
    return minimal.condition <= _WELL and minimal.orientation == elsewhere.orientation


def _given_up(minimal: Minimal, coordinates: Coordinates) -> list[int]:
    """Which coordinate of `measured` is to be a state no more where coordinates are nearly singular."""
    k = minimal.most_dependent()
    if k is None:
        return []
    number = int(minimal.chosen.joints[k])
    if number < len(coordinates.task) or k >= minimal.chosen.joints.size - minimal.driven:
        raise _singular(minimal, [coordinates.measured[number].name])
    return [number]


def _singular(minimal: Minimal, names: Sequence[str]) -> SingularPositionError:
    return SingularPositionError(
        f"no change of coordinates of the linear model belongs to the motion there: {', '.join(names)}",
        Moment(minimal.point.time, 0), remedy="choose other coordinates, or times away from this singular position",
    )  # fmt: skip


def _along(points: Sequence[MotionPoint], coordinates: Coordinates, chosen: Chosen, ports: Ports) -> Along:
    """States, inputs and outputs at points of a motion."""
    mechanism = coordinates.system.mechanism
    t, q, v, a, multipliers, acting = (np.array(part) for part in zip(*points, strict=True))
    torques = acting[:, : len(mechanism.motors)]
    laws = {one.name: one.law for one in mechanism.prescribed}
    inputs = [
        *(torques[:, k] for k, motor in enumerate(mechanism.motors) if motor.name in ports.mode.motors),
        *(np.zeros_like(t) for _ in range(2 * len(ports.forces))),
        *(laws[name].evaluate(t)[2] for name in ports.prescribed),
    ]
    readings = sensor_readings(coordinates.system, q, v, a, multipliers, torques, ports.sensors)
    return Along(coordinates.values(chosen, q, v), np.stack(inputs, axis=1), readings)


def _every(period: float, times: Array) -> Array:
    """Times that are a period apart, from the first on."""
    duration = float(times[-1] - times[0])
    if not 0.0 < period <= duration * (1.0 + _SAME):
        raise InputError("is no period of this motion", field="period", value=period,
                         remedy=f"give one up to {duration:.6g} s")  # fmt: skip
    periods = math.floor(duration / period + _SAME)
    return np.minimum(times[0] + period * np.arange(periods + 1), times[-1])
