"""Closed loop of a sampled linear plant and controller: poles, sensitivity, and comparison over several models."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array, ArrayLike, Complex
from paraflex.control.laws.discrete import DiscreteModel, check_discrete, is_model, matrices_of
from paraflex.dynamics.state_space import StateSpace
from paraflex.errors import InputError, ResultWarning, warn_user, within
from paraflex.linear.named import places_in_s
from .controllability import frequency_of
from .sampled import SampledPlant, WithPoles, as_sampled, discretise, places

if TYPE_CHECKING:
    import pandas as pd

# Accuracy of poles on the unit circle.
_ON_CIRCLE = 1e-9
# Angles about those of the poles, in units of their distance from the circle; number of further angles; largest phase
# change between neighbouring angles, and least spacing of angles, for poles on the circle.
_ABOUT, _GRID, _TURN, _NARROW = np.array([-8.0, -3.0, -1.0, -0.3, 0.0, 0.3, 1.0, 3.0, 8.0]), 400, 0.5, 1e-12
# Delay margins are sought up to this number of periods, in steps of this fraction of a period.
_LATEST, _STEP = 200, 0.25


@dataclass(frozen=True)
class ClosedLoop(WithPoles):
    """Sampled plant in feedback with a linear controller, u = controller(y).

    Attributes
    ----------
    plant : SampledPlant
        Plant with the controller's motors as inputs and its sensors as outputs, in its order.
    controller : StateSpace
        Discrete controller from readings to torques, signs included.
    model : object
        Continuous model, if the plant was made from one; else None.
    """

    plant: SampledPlant
    controller: StateSpace
    model: Any = None

    def __repr__(self) -> str:
        unstable = "" if self.stable else ", unstable"
        return f"ClosedLoop({len(self.A)} states, spectral radius {_magnitude(self.spectral_radius)}{unstable})"

    @cached_property
    def A(self) -> Array:
        """State matrix (n, n) of the loop: states of the plant, then of the controller."""
        plant, law = self.plant, self.controller
        return np.block([
            [plant.A + plant.B @ law.D @ plant.C, plant.B @ law.C],
            [law.B @ plant.C, law.A],
        ])  # fmt: skip

    @cached_property
    def poles(self) -> Complex:
        """Eigenvalues z (n,), the largest first."""
        found = np.asarray(np.linalg.eigvals(self.A), dtype=complex)
        return found[np.argsort(-np.abs(found), kind="stable")]

    @property
    def stable(self) -> bool:
        """Whether all poles are inside the unit circle."""
        return self.spectral_radius < 1.0 - _ON_CIRCLE

    @property
    def slowest(self) -> tuple[float, float]:
        """Frequency [Hz] and damping ratio, negative outside the unit circle, of the pole of largest magnitude."""
        return damped_frequency(complex(self.poles[0]), self.plant.period)

    @cached_property
    def _at_motors(self) -> StateSpace:
        return _at_motors(self.A, self.plant, self.controller)

    def sensitivity(self, omega: ArrayLike) -> Complex:
        """Return the sensitivity S (k, motors, motors) at the motors, the response to torques that are added there.

        Parameters
        ----------
        omega : (k,) array
            Angular frequencies up to pi / period [rad/s].
        """
        z = np.exp(places_in_s(omega, "omega") * self.plant.period)
        one = np.eye(len(self.plant.inputs))
        return np.array([one + self._at_motors.at(at) for at in z]).reshape(-1, *one.shape)

    def loop(self, omega: ArrayLike) -> Complex:
        """Return the responses L_i (k, motors) of the loop opened at one motor, the others closed: 1 + L_i = 1 / S_ii.

        Parameters
        ----------
        omega : (k,) array
            Angular frequencies up to pi / period [rad/s]; at zero, a loop with integrators or free motions has no
            finite response.
        """
        own = np.diagonal(self.sensitivity(omega), axis1=1, axis2=2)
        return np.asarray(1.0 / np.where(own == 0.0, np.finfo(float).tiny, own) - 1.0, dtype=complex)

    def later(self, delay: float) -> ClosedLoop:
        """Return the loop of the same controller with another delay of the torques [s].

        Raises
        ------
        InputError
            The continuous model is not known.
        """
        if self.model is None:
            raise InputError("was made from a sampled plant", field="delay", value=delay,
                             remedy="make the loop from the continuous model")  # fmt: skip
        plant = discretise(self.model, self.plant.period, delay).select(self.plant.inputs, self.plant.outputs)
        return ClosedLoop(plant, self.controller, self.model)

    def delay_margin(self) -> float:
        """Return the additional delay of all torques at which a pole leaves the unit circle [s].

        It is exact for any delay, as the plant is sampled anew. It is nan, with a warning, if the loop is unstable, and
        inf if the loop stays stable with 200 periods.

        Raises
        ------
        InputError
            The continuous model is not known.
        """
        if not self.stable:
            warn_if_unstable(self)
            return float("nan")
        period, now = self.plant.period, self.plant.delay

        def beyond(delay: float) -> float:
            return self.later(delay).spectral_radius - 1.0

        before = now
        for k in range(1, int(_LATEST / _STEP) + 1):
            after = now + k * _STEP * period
            if beyond(after) > _ON_CIRCLE:
                return scipy.optimize.brentq(beyond, before, after, xtol=1e-12 * period) - now
            before = after
        return float("inf")


@checked_arguments()
def closed_loop(
    model: Any, controller: Any, *, period: float | None = None, delay: float | None = None,
    inputs: Sequence[str] | None = None, outputs: Sequence[str] | None = None,
) -> ClosedLoop:  # fmt: skip
    """Close the loop of a linear model with a sampled linear controller.

    Parameters
    ----------
    model : LinearModel, ReducedModel, state space, (A, B, C, D) or SampledPlant
        Model of the plant.
    controller : LQGDesign, law, SampledController, or state space
        Controller from readings to torques with its sign, u = C x + D y. For a `SampledController` the law is used,
        without limits, filters and resolution.
    period, delay : float, optional
        Sampling period and delay [s]; the controller's own by default. A `SampledPlant` must have this period, and
        keeps its own delay.
    inputs : sequence of str, optional
        Sensors, which are outputs of the model; the controller's own by default, else all.
    outputs : sequence of str, optional
        Motors, which are inputs of the model; the controller's own by default, else all.

    Returns
    -------
    ClosedLoop
        Closed loop.

    Raises
    ------
    InputError
        An object that is not a linear controller, no period, or names or numbers of sensors and motors that do not
        match.
    """
    law = law_of(controller)
    plant = _sampled_for(model, controller, period, delay)
    sensors, motors = (_chosen(controller, attribute, given) for attribute, given in
                       (("inputs", inputs), ("outputs", outputs)))  # fmt: skip
    places(sensors or (), plant.outputs, "inputs", "sensor")
    places(motors or (), plant.inputs, "outputs", "motor")
    plant = plant.select(motors, sensors)
    shape = (len(plant.outputs), len(plant.inputs))
    if law.D.shape[::-1] != shape:
        raise InputError(
            f"has {law.D.shape[1]} inputs and {law.D.shape[0]} outputs", field="controller", value=controller,
            remedy=f"the model has {shape[0]} sensors, {shape[1]} motors: name as many, inputs=[...], outputs=[...]",
        )  # fmt: skip
    return ClosedLoop(plant, law, None if isinstance(model, SampledPlant) else model)


def law_of(controller: Any) -> StateSpace:
    """Return the matrices of a linear controller, from readings to torques.

    Raises
    ------
    InputError
        A controller without matrices, or a continuous one.
    """
    own = _inner(controller)
    own = getattr(own, "state_space", own)
    if not is_model(own) and not all(hasattr(own, name) for name in ("A", "B", "C", "D")):
        raise InputError("is not a linear law", field="controller", value=controller,
                         remedy="give a design of pf.lqg, or a discrete state space")  # fmt: skip
    if hasattr(own, "dt"):
        check_discrete(own.dt, controller, "controller", "controller")
    return matrices_of(own)


def named_law(controller: Any) -> DiscreteModel:
    """Return a linear controller with the names of its sensors and motors: see `law_of`.

    Raises
    ------
    InputError
        A controller without matrices or without names, or a continuous one.
    """
    law = law_of(controller)
    names = [_chosen(controller, attribute, None) or _chosen(controller, labels, None)
             for attribute, labels in (("inputs", "input_labels"), ("outputs", "output_labels"))]  # fmt: skip
    if not (names[0] and names[1]):
        raise InputError("has no names of its sensors and motors", field="controller", value=controller,
                         remedy="give a model with names, or a design of pf.lqg")  # fmt: skip
    period = _own(controller, ("period", "dt"))
    return DiscreteModel(*law, period, names[0], names[1])


@checked_arguments()
def spillover(full: Any, reduced: Any, controller: Any, **settings: Any) -> pd.DataFrame:
    """Compare a controller designed on a reduced model with its effect on the full model: see `closed_loops`.

    Vibrations that are not in the design may become unstable (spillover), which the row "full" shows.

    Parameters
    ----------
    full, reduced : LinearModel, ReducedModel, state space or (A, B, C, D)
        Full model, and reduced model of the design.
    controller : LQGDesign, law, SampledController, or state space
        Controller: see `closed_loop`, with its `settings`.

    Returns
    -------
    DataFrame
        Table with the rows "reduced" and "full", the worse one last.

    Warns
    -----
    ResultWarning
        One of the two loops is unstable.
    """
    return closed_loops({"reduced": reduced, "full": full}, controller, **settings)


@checked_arguments()
def closed_loops(models: Mapping[str, Any], controller: Any, **settings: Any) -> pd.DataFrame:
    """Evaluate one controller on several models: poses along a path, payloads, a reduced model and the full one.

    Parameters
    ----------
    models : mapping of str to model
        Models by name, for example `{f"{s:.3f} m": model for s, model in zip(poses.places, poses.models)}` of
        `poses_along`.
    controller : LQGDesign, law, SampledController, or state space
        Controller: see `closed_loop`, with its `settings`.

    Returns
    -------
    DataFrame
        Table with one row per model, the worst last: `stable`, `spectral_radius`, and for the pole of largest magnitude
        `frequency` [Hz], `damping` and growth `rate` [1/s].

    Raises
    ------
    InputError
        See `closed_loop`; no model.

    Warns
    -----
    ResultWarning
        The loop is unstable with some of the models.
    """
    import pandas as pd

    if not models:
        raise InputError("there is no model", field="models", remedy="name one")
    rows = {}
    for name, model in models.items():
        with within(f"models.{name}"):
            one = closed_loop(model, controller, **settings)
        warn_if_unstable(one, f"with {name}")
        frequency, damping = one.slowest
        rows[name] = {
            "stable": one.stable, "spectral_radius": one.spectral_radius, "frequency": frequency, "damping": damping,
            "rate": float(np.log(max(one.spectral_radius, 1e-300))) / one.plant.period,
        }  # fmt: skip
    return pd.DataFrame.from_dict(rows, orient="index").sort_values("spectral_radius", kind="stable")


def _at_motors(A: Array, plant: SampledPlant, law: StateSpace) -> StateSpace:
    """Return the system from torques that are added at the motors to those of the controller, with a triangular A."""
    added = np.vstack([plant.B, np.zeros((len(law.A), plant.B.shape[1]))])
    return StateSpace(A, added, np.hstack([law.D @ plant.C, law.C]), np.zeros((added.shape[1],) * 2)).triangular()


def poles_beyond(loop: ClosedLoop, later: int, radius: float) -> int:
    """Return the number of poles of larger magnitude than a radius above one, for a loop with an added delay.

    Let G be the open loop without the added delay of `later` samples. F = det(1 - z^-later G) has poles at the poles of
    the open loop, zeros at those of the closed loop, and is one at infinity. The number is that of the open loop less
    the turns of F about zero along the circle.

    Parameters
    ----------
    loop : ClosedLoop
        Closed loop without the added delay.
    later : int
        Added delay in samples.
    radius : float
        Radius of the circle.
    """
    plant, law = loop.plant, loop.controller
    A = np.block([[plant.A, np.zeros((len(plant.A), len(law.A)))], [law.B @ plant.C, law.A]])
    opened = _at_motors(A, plant, law)

    def F(angles: Array) -> Complex:
        z = radius * np.exp(1j * angles)
        G = np.array([opened.at(at) for at in z])
        return np.linalg.det(np.eye(len(opened.C)) - z[:, None, None] ** -later * G)

    poles = np.diag(opened.A)
    near = np.abs(np.angle(poles))[:, None] + np.abs(radius - np.abs(poles))[:, None] * _ABOUT
    angles = np.unique(np.concatenate([np.linspace(0.0, np.pi, _GRID), near[(near > 0.0) & (near < np.pi)]]))
    values = F(angles)
    while True:
        steps, wide = np.angle(values[1:] / values[:-1]), np.diff(angles)
        large = (np.abs(values - 1.0) > 0.5) * float(later)
        turn = np.maximum(np.abs(steps), np.maximum(large[1:], large[:-1]) * wide)
        rough = (turn > _TURN) & (wide > _NARROW)
        if not np.any(rough):
            return round(np.count_nonzero(np.abs(poles) > radius) - float(np.sum(steps)) / np.pi)
        at = np.flatnonzero(rough)
        between = angles[at] + 0.5 * wide[at]
        angles, values = np.insert(angles, at + 1, between), np.insert(values, at + 1, F(between))


def warn_if_unstable(loop: ClosedLoop, where: str = "") -> None:
    """Issue a `ResultWarning` that names the poles outside the unit circle."""
    if not loop.stable:
        warn_user(ResultWarning(f"the sampled loop is unstable{f' {where}' if where else ''}: {unstable_poles(loop)}"))


def unstable_poles(loop: ClosedLoop) -> str:
    """Return a description of the poles outside the unit circle: magnitudes and frequencies of the first four."""
    outside = [z for z in loop.poles if abs(z) >= 1.0 - _ON_CIRCLE and z.imag >= 0.0]
    named = ", ".join(
        f"|z| = {_magnitude(abs(z))} at {frequency_of(complex(z), loop.plant.period):.4g} Hz" for z in outside[:4]
    )
    return named + (f" and {len(outside) - 4} more" if len(outside) > 4 else "")


def _magnitude(size: float) -> str:
    """Return a pole's magnitude as text, with two digits of its distance from one, and at least six digits."""
    return f"{size:.{max(6, 2 - math.floor(math.log10(max(abs(size - 1.0), _ON_CIRCLE))))}g}"


def damped_frequency(z: complex, period: float) -> tuple[float, float]:
    """Return natural frequency |s| / (2 pi) [Hz] and damping ratio -Re s / |s| of a sampled pole, s = ln z / T."""
    if z == 0.0:
        return 0.0, 1.0
    s = np.log(complex(z)) / period
    return float(abs(s)) / (2.0 * np.pi), float(-s.real / abs(s)) if s else 0.0


def _sampled_for(model: Any, controller: Any, period: float | None, delay: float | None) -> SampledPlant:
    """Return the plant at the given period and delay, by default the controller's."""
    for source in (controller, _inner(controller)):
        period = _own(source, ("period", "dt")) if period is None else period
        delay = _own(source, ("delay",)) if delay is None else delay
    if isinstance(model, SampledPlant):
        return model if period is None else as_sampled(model, period, model.delay)
    if period is None:
        raise InputError("is missing", field="period", remedy="give it in seconds")
    return discretise(model, period, 0.0 if delay is None else delay)


def _inner(controller: Any) -> Any:
    """Return the law of a `SampledController`, and another controller as it is."""
    law = getattr(controller, "law", None)
    return controller if law is None or callable(law) else law


def _own(source: Any, attributes: Sequence[str]) -> float | None:
    for name in attributes:
        value = getattr(source, name, None)
        if isinstance(value, float | int) and not isinstance(value, bool):
            return float(value)
    return None


def _chosen(controller: Any, attribute: str, given: Sequence[str] | None) -> tuple[str, ...] | None:
    """Return the given names, or a controller's own if it has any that are texts."""
    if given is not None:
        return tuple(given)
    own = getattr(controller, attribute, None)
    # Models of python-control have the number of inputs in this attribute.
    names = tuple(own) if isinstance(own, tuple | list) else ()
    return names if names and all(isinstance(one, str) for one in names) else None
