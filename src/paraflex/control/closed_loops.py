"""A sampled linear plant with a linear controller: poles, sensitivity, and the same over several models."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array
from paraflex.control.discrete import DiscreteModel, check_discrete, is_model, matrices_of
from paraflex.control.reach import frequency_of
from paraflex.control.sampled import SampledPlant, as_sampled, discretise, places
from paraflex.errors import InputError, ResultWarning, warn_user, within
from paraflex.linear.named import places_in_s
from paraflex.linear.zeros import StateSpace
from paraflex.mechanism.quantities import positive

if TYPE_CHECKING:
    import pandas as pd

Complex = NDArray[np.complex128]
# Poles on the unit circle are found that near to it.
_ON_CIRCLE = 1e-9
# Angles about those of poles, in distances of these from the circle; others; the largest turn from one to the next, and
# the least distance, of a pole on the circle.
_ABOUT, _GRID, _TURN, _NARROW = np.array([-8.0, -3.0, -1.0, -0.3, 0.0, 0.3, 1.0, 3.0, 8.0]), 400, 0.5, 1e-12
# Delay margins are sought up to so many periods, in steps of this part of one.
_LATEST, _STEP = 200, 0.25


@dataclass(frozen=True)
class ClosedLoop:
    """A sampled plant whose torques follow from its readings, u = controller(y).

    Attributes
    ----------
    plant : SampledPlant
        With the controller's motors as inputs and its sensors as outputs, in its order.
    controller : StateSpace
        Discrete: from readings to torques, signs included.
    model : object
        The continuous model, if the plant was made from one.
    """

    plant: SampledPlant
    controller: StateSpace
    model: Any = None

    def __repr__(self) -> str:
        unstable = "" if self.stable else ", unstable"
        return f"ClosedLoop({len(self.A)} states, spectral radius {_magnitude(self.spectral_radius)}{unstable})"

    @cached_property
    def A(self) -> Array:
        """Of the plant's states, then the controller's (n, n)."""
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
    def spectral_radius(self) -> float:
        """The largest magnitude of the poles: below one, the loop is stable."""
        return float(np.max(np.abs(self.poles), initial=0.0))

    @property
    def stable(self) -> bool:
        """Whether all poles are within the unit circle."""
        return self.spectral_radius < 1.0 - _ON_CIRCLE

    @property
    def slowest(self) -> tuple[float, float]:
        """Frequency [Hz] and damping ratio of the pole nearest to the unit circle; the ratio is negative outside."""
        return damped_frequency(complex(self.poles[0]), self.plant.period)

    @cached_property
    def _triangular(self) -> tuple[Complex, Complex, Complex]:
        return _triangular(self.A, self.plant, self.controller)

    def sensitivity(self, omega: ArrayLike) -> Complex:
        """Sensitivity S (k, motors, motors) at the motors: what torques become that are added there.

        Parameters
        ----------
        omega : (k,) array
            [rad/s], up to pi / period.
        """
        upper, added, follow = self._triangular
        eye, one = np.eye(len(upper)), np.eye(added.shape[1])
        z = np.exp(places_in_s(omega, "omega") * self.plant.period)
        found = [one + follow @ scipy.linalg.solve_triangular(at * eye - upper, added) for at in z]
        return np.array(found).reshape(-1, *one.shape)

    def loop(self, omega: ArrayLike) -> Complex:
        """Responses L_i (k, motors) of the loop opened at one motor, with the others closed: 1 + L_i = 1 / S_ii.

        Parameters
        ----------
        omega : (k,) array
            [rad/s], up to pi / period; at zero a loop with integrals or free motions has none that is finite.
        """
        own = np.diagonal(self.sensitivity(omega), axis1=1, axis2=2)
        return np.asarray(1.0 / np.where(own == 0.0, np.finfo(float).tiny, own) - 1.0, dtype=complex)

    def later(self, delay: float) -> ClosedLoop:
        """The same controller with torques that act so late [s].

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
        """How much later all torques may act before a pole leaves the unit circle [s].

        Exact for any delay, as the plant is sampled anew; nan of a loop that is unstable, with a warning, inf if it
        stays stable with 200 periods.

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
    """A linear model with a linear controller, sampled.

    Parameters
    ----------
    model : LinearModel, ReducedModel, state space, (A, B, C, D) or SampledPlant
    controller : LQGDesign, law, SampledController, or state space
        From readings to torques with its sign, u = C x + D y; of a chain its law, without limits, filters, resolution.
    period, delay : float, optional
        [s]; by default the controller's own. Of a `SampledPlant` its own count.
    inputs : sequence of str, optional
        Sensors, outputs of the model; by default the controller's own, else all.
    outputs : sequence of str, optional
        Motors, inputs of the model; by default the controller's own, else all.

    Raises
    ------
    InputError
        What is no linear law; no period; names or numbers of sensors and motors that do not fit.
    """
    law = law_of(controller)
    plant = _sampled_for(model, controller, period, delay)
    sensors, motors = (_chosen(controller, attribute, given) for attribute, given in
                       (("inputs", inputs), ("outputs", outputs)))  # fmt: skip
    places(sensors or (), plant.outputs, "inputs", "sensor")
    places(motors or (), plant.inputs, "outputs", "motor")
    plant = plant.select(motors, sensors)
    wanted = (len(plant.outputs), len(plant.inputs))
    if law.D.shape[::-1] != wanted:
        raise InputError(
            f"has {law.D.shape[1]} inputs and {law.D.shape[0]} outputs", field="controller", value=controller,
            remedy=f"the model has {wanted[0]} sensors, {wanted[1]} motors: name as many, inputs=[...], outputs=[...]",
        )  # fmt: skip
    return ClosedLoop(plant, law, None if isinstance(model, SampledPlant) else model)


def law_of(controller: Any) -> StateSpace:
    """The matrices of a linear controller, from readings to torques.

    Raises
    ------
    InputError
        One without matrices, or a continuous one.
    """
    inner = getattr(controller, "law", None)
    own = controller if inner is None or callable(inner) else inner
    own = getattr(own, "state_space", own)
    if not is_model(own) and not all(hasattr(own, name) for name in ("A", "B", "C", "D")):
        raise InputError("is no linear law", field="controller", value=controller,
                         remedy="give a design of pf.lqg, or a discrete state space")  # fmt: skip
    if hasattr(own, "dt"):
        check_discrete(own.dt, controller, "controller", "controller")
    return matrices_of(own)


def named_law(controller: Any) -> DiscreteModel:
    """A linear controller with the names of its sensors and motors: see `law_of`.

    Raises
    ------
    InputError
        One without matrices, a continuous one, or one without names.
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
    """A controller that was designed on a reduced model, on that and on the full one: see `closed_loops`.

    The vibrations that the design does not know may become unstable (spillover): the row "full" says which.

    Parameters
    ----------
    full, reduced : LinearModel, ReducedModel, state space or (A, B, C, D)
    controller
        See `closed_loop`, with its `settings`.

    Warns
    -----
    ResultWarning
        One of the two is unstable.
    """
    return closed_loops({"reduced": reduced, "full": full}, controller, **settings)


@checked_arguments()
def closed_loops(models: Mapping[str, Any], controller: Any, **settings: Any) -> pd.DataFrame:
    """One controller on several models: poses along a path, payloads, one of few states and the full one.

    Parameters
    ----------
    models : mapping of str to model
        By name; `{f"{s:.3f} m": model for s, model in zip(poses.places, poses.models)}` of `poses_along`.
    controller
        See `closed_loop`, with its `settings`.

    Returns
    -------
    DataFrame
        A row a model, the worst last: `stable`, `spectral_radius`, of the pole nearest to the unit circle `frequency`
        [Hz], `damping` and the `rate` of its growth [1/s].

    Raises
    ------
    InputError
        See `closed_loop`; no model.

    Warns
    -----
    ResultWarning
        The loop is unstable with some of them.
    """
    import pandas as pd

    if not models:
        raise InputError("there is no model", field="models", remedy="name one")
    loops = {}
    for name, model in models.items():
        with within(f"models.{name}"):
            loops[name] = closed_loop(model, controller, **settings)
    rows = {
        name: {
            "stable": one.stable, "spectral_radius": one.spectral_radius, "frequency": one.slowest[0],
            "damping": one.slowest[1], "rate": float(np.log(max(one.spectral_radius, 1e-300))) / one.plant.period,
        }
        for name, one in loops.items()
    }  # fmt: skip
    for name, one in loops.items():
        warn_if_unstable(one, f"with {name}")
    return pd.DataFrame.from_dict(rows, orient="index").sort_values("spectral_radius", kind="stable")


def _triangular(A: Array, plant: SampledPlant, law: StateSpace) -> tuple[Complex, Complex, Complex]:
    """Schur form of A, and what torques added at the motors lead to, and which torques follow, in its basis."""
    upper, basis = scipy.linalg.schur(A.astype(complex), output="complex")
    added = np.vstack([plant.B, np.zeros((len(law.A), plant.B.shape[1]))])
    return upper, basis.conj().T @ added, np.hstack([law.D @ plant.C, law.C]) @ basis


def poles_beyond(loop: ClosedLoop, later: int, radius: float) -> int:
    """Number of poles with larger magnitudes than a radius above one, of a loop with torques so many samples later.

    With G the open loop without that delay, F = det(1 - z^-later G) has poles where that has, zeros at the poles of the
    closed loop, and is one at infinity: the number is that of the open loop less the turns of F along the circle.
    """
    plant, law = loop.plant, loop.controller
    A = np.block([[plant.A, np.zeros((len(plant.A), len(law.A)))], [law.B @ plant.C, law.A]])
    upper, added, follow = _triangular(A, plant, law)

    def F(angles: Array) -> Complex:
        z = radius * np.exp(1j * angles)
        G = [follow @ scipy.linalg.solve_triangular(at * np.eye(len(A)) - upper, added) for at in z]
        return np.linalg.det(np.eye(len(follow)) - z[:, None, None] ** -later * np.array(G))

    poles = np.diag(upper)
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
    """The poles outside the unit circle in words: magnitudes and frequencies of the first four."""
    outside = [z for z in loop.poles if abs(z) >= 1.0 - _ON_CIRCLE and z.imag >= 0.0]
    named = ", ".join(
        f"|z| = {_magnitude(abs(z))} at {frequency_of(complex(z), loop.plant.period):.4g} Hz" for z in outside[:4]
    )
    return named + (f" and {len(outside) - 4} more" if len(outside) > 4 else "")


def _magnitude(size: float) -> str:
    """A pole's magnitude, with two digits of its distance from one, and at least six."""
    return f"{size:.{max(6, 2 - math.floor(math.log10(max(abs(size - 1.0), _ON_CIRCLE))))}g}"


def damped_frequency(z: complex, period: float) -> tuple[float, float]:
    """Natural frequency |s| / (2 pi) [Hz] and damping ratio -Re s / |s| of a sampled pole, s = ln z / T."""
    if z == 0.0:
        return 0.0, 1.0
    s = np.log(complex(z)) / period
    return float(abs(s)) / (2.0 * np.pi), float(-s.real / abs(s)) if s else 0.0


def _sampled_for(model: Any, controller: Any, period: float | None, delay: float | None) -> SampledPlant:
    """The plant at the controller's period and delay, or at those given."""
    inner = getattr(controller, "law", None)
    sources = [controller, *([inner] if inner is not None and not callable(inner) else [])]
    for source in sources:
        period = _own(source, ("period", "dt")) if period is None else period
        delay = _own(source, ("delay",)) if delay is None else delay
    if isinstance(model, SampledPlant):
        return model if period is None else as_sampled(model, period, model.delay)
    if period is None:
        raise InputError("is missing", field="period", remedy="give it in seconds")
    positive(period, "period", "s")
    return discretise(model, period, 0.0 if delay is None else delay)


def _own(source: Any, attributes: Sequence[str]) -> float | None:
    for name in attributes:
        value = getattr(source, name, None)
        if isinstance(value, float | int) and not isinstance(value, bool):
            return float(value)
    return None


def _chosen(controller: Any, attribute: str, given: Sequence[str] | None) -> tuple[str, ...] | None:
    """Names that are given, or a controller's own, if it has any that are names."""
    if given is not None:
        return tuple(given)
    own = getattr(controller, attribute, None)
    # Models of python-control have a number of inputs.
    names = tuple(own) if isinstance(own, tuple | list) else ()
    return names if names and all(isinstance(one, str) for one in names) else None
