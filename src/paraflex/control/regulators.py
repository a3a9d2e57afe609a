"""Linear-quadratic design of sampled controllers: state feedback (LQR), and from readings by a filter (LQG)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array
from paraflex.control.coloured import DisturbedPlant, disturbed_plant
from paraflex.control.controllers import Plant
from paraflex.control.estimators import KalmanFilter, kalman_filter, riccati
from paraflex.control.linear_law import LinearLaw
from paraflex.control.reach import check_reach
from paraflex.control.sampled import SampledPlant, as_sampled, places
from paraflex.errors import InputError
from paraflex.linear.zeros import StateSpace
from paraflex.mechanism.quantities import known, not_negative, positive

Complex = NDArray[np.complex128]
# Random torques by default, as a part of the largest ones.
_OF_EFFORT = 0.1


@dataclass(frozen=True)
class Regulator:
    """State feedback u = -`gain` [x; integrals] of a sampled plant.

    Attributes
    ----------
    plant : SampledPlant
        With torques under way among its states.
    motors : tuple of str
        Inputs that it acts on.
    gain : (motors, n + integrated) array
        K.
    integrated : tuple of str
        Outputs whose sums over time are fed back, too.
    poles : (n + integrated,) array
        Of the plant with this feedback, z.
    """

    plant: SampledPlant
    motors: tuple[str, ...]
    gain: Array
    integrated: tuple[str, ...]
    poles: Complex

    @property
    def spectral_radius(self) -> float:
        """The largest magnitude of the poles."""
        return float(np.max(np.abs(self.poles), initial=0.0))


@dataclass(frozen=True)
class LQGDesign:
    """A regulator that acts on the estimate of a Kalman filter.

    Attributes
    ----------
    regulator : Regulator
    filter : KalmanFilter
    measured : tuple of str
        Outputs that the filter is given, in this order.
    start : (n, measured) array
        The first estimate from the first readings: at rest, displaced in what moves freely.
    """

    regulator: Regulator
    filter: KalmanFilter
    measured: tuple[str, ...]
    start: Array

    @property
    def K(self) -> Array:
        """Gain (motors, n + integrated) of the feedback, u = -K [x; integrals]."""
        return self.regulator.gain

    @property
    def L(self) -> Array:
        """Gain (n, measured) of the filter."""
        return self.filter.gain

    @property
    def poles(self) -> Complex:
        """Of the closed loop on the plant of the design: those of the regulator and of the filter, z."""
        return np.concatenate([self.regulator.poles, self.filter.poles])

    @property
    def spectral_radius(self) -> float:
        """The largest magnitude of the poles."""
        return float(np.max(np.abs(self.poles), initial=0.0))

    @property
    def period(self) -> float:
        """Of sampling [s]."""
        return self.regulator.plant.period

    @property
    def delay(self) -> float:
        """That the design accounts for [s]."""
        return self.regulator.plant.delay

    @property
    def inputs(self) -> tuple[str, ...]:
        """Sensors: `measured`."""
        return self.measured

    @property
    def outputs(self) -> tuple[str, ...]:
        """Motors, those of the regulator."""
        return self.regulator.motors

    @cached_property
    def state_space(self) -> StateSpace:
        """The law without limits, from readings to torques: x_k+1 = A x_k + B y_k, u_k = C x_k + D y_k.

        States are the estimate before the reading, and integrals.
        """
        one, L, n = self.filter, self.L, len(self.filter.A)
        rows, _ = self._integrals
        K, K_i = np.split(self.K, [n], axis=1)
        rest = np.eye(n) - L @ one.C
        C, D = np.hstack([-K @ rest, -K_i]), -K @ L
        A = np.vstack([np.hstack([one.A @ rest, np.zeros((n, len(rows)))]) + one.B @ C,
                       np.eye(len(rows), n + len(rows), n)])  # fmt: skip
        return StateSpace(A, np.vstack([one.A @ L + one.B @ D, rows]), C, D)

    @property
    def _integrals(self) -> tuple[Array, list[int]]:
        """What a reading adds to integrals (integrated, measured), and which readings these are."""
        columns = [self.measured.index(name) for name in self.regulator.integrated]
        return self.period * np.eye(len(self.measured))[columns], columns

    def law(self) -> LQGLaw:
        """The law, at the beginning of a run, for `SampledController`."""
        return LQGLaw(self)


class LQGLaw:
    """A `LQGDesign` as a law: torques from errors of readings, with its estimate as its state.

    Limits are told by `limited`: the estimate goes on with the torques that were given, and integrals stay while any
    torque is limited.

    Attributes
    ----------
    design : LQGDesign
    period, delay : float
        [s]
    inputs, outputs : tuple of str
        Sensors and motors.
    x : (n,) array
        The estimate after the last reading.
    integrals : (integrated,) array
    """

    def __init__(self, design: LQGDesign) -> None:
        self.design = design
        self.period: float = design.period
        self.delay: float = design.delay
        self.inputs: tuple[str, ...] = design.inputs
        self.outputs: tuple[str, ...] = design.outputs
        self._reset()

    def _reset(self) -> None:
        self.x: Array | None = None
        self.integrals: Array = np.zeros(len(self.design.regulator.integrated))
        self._wanted: Array = np.zeros(len(self.outputs))
        self._given: Array = self._wanted
        self._read: Array = np.zeros(len(self.inputs))

    @property
    def state_space(self) -> StateSpace:
        """See `LQGDesign.state_space`."""
        return self.design.state_space

    def start(self, plant: Plant) -> None:
        """Forget an earlier run.

        Raises
        ------
        InputError
            Sensors, motors or a period other than those of the design.
        """
        pairs = (("inputs", self.inputs, plant.inputs), ("outputs", self.outputs, plant.outputs))
        for field, wanted, have in pairs:
            if tuple(have) != wanted:
                raise InputError("are not those of the design, in its order", field=field, value=", ".join(have),
                                 remedy=f"leave them out, or say {', '.join(wanted)}")  # fmt: skip
        if abs(plant.period - self.period) > 1e-9 * self.period:
            raise InputError(f"the design is for {self.period:g} s", field="period", value=plant.period,
                             remedy="leave it out, or design for that period")  # fmt: skip
        self._reset()

    def step(self, k: int, t: float, y: Array) -> Array:
        """Torques (motors,) that follow from errors y (measured,) at sample k."""
        design = self.design
        if self.x is None:
            before = design.start @ y
        else:
            before = design.filter.carried_on(self.x, self._given)
            if np.array_equal(self._given, self._wanted):
                self.integrals = self.integrals + design._integrals[0] @ self._read
        self.x = design.filter.corrected(before, y)
        self._read = np.array(y, dtype=float)
        self._wanted = -design.K @ np.concatenate([self.x, self.integrals])
        self._given = self._wanted
        return self._wanted.copy()

    def linear_law(self) -> LinearLaw:
        """For the compiled time loop: states are the estimate before the reading, and integrals."""
        design, states = self.design, self.state_space
        n, more = len(design.filter.A), len(self.integrals)
        return LinearLaw(
            *states,
            E=np.vstack([-design.filter.B, np.zeros((more, len(self.outputs)))]),
            first=np.vstack([design.start, np.zeros((more, len(self.inputs)))]),
            waiting=(np.arange(n + more) >= n).astype(float),
        )

    def limited(self, torques: Array) -> None:
        """Take note of the torques (motors,) that are given in place of those that were wanted."""
        self._given = np.array(torques, dtype=float)


@checked_arguments()
def lqr(
    model: Any,
    period: float,
    *,
    deviations: Mapping[str, float],
    effort: Mapping[str, float] | float,
    delay: float = 0.0,
    integrators: Mapping[str, float] | None = None,
    state_weights: ArrayLike | None = None,
) -> Regulator:
    """State feedback that minimises sum (y / deviation)^2 + (u / effort)^2 over all samples.

    The Riccati equation of the sampled plant with torques under way as states (Franklin, Powell and Workman, Digital
    Control of Dynamic Systems, section 9.3), so that the delay is part of the design.

    Parameters
    ----------
    model : LinearModel, ReducedModel, state space, (A, B, C, D) or SampledPlant
    period : float
        [s]
    deviations : mapping of str to float
        Largest that are allowed of outputs, in their units: an output's weight is one over its square (Bryson's rule).
    effort : float or mapping of str to float
        Largest torques or forces, of all inputs or by motor [N m, N]. Inputs that are not named are not used.
    delay : float
        From a sample until its torques act [s].
    integrators : mapping of str to float, optional
        Outputs whose errors are to vanish under constant loads, with the time that may take [s]: the integral's largest
        deviation is that of the output times this.
    state_weights : (n, n) array, optional
        Added to the weights, of the model's own states or of all.

    Raises
    ------
    InputError
        Unknown names, numbers that are not positive, a free motion or undamped vibration that the motors do not reach
        or the weights do not see.
    """
    plant = as_sampled(model, period, delay)
    return _regulator(plant, deviations, effort, integrators or {}, state_weights)


@checked_arguments()
def lqg(
    model: Any,
    period: float,
    *,
    measured: Sequence[str],
    deviations: Mapping[str, float],
    effort: Mapping[str, float] | float,
    noise: Mapping[str, float] | float,
    disturbance: Mapping[str, float] | float | None = None,
    delay: float = 0.0,
    integrators: Mapping[str, float] | None = None,
    state_weights: ArrayLike | None = None,
    state_noise: ArrayLike | None = None,
    coloured: Mapping[str, Any] | None = None,
) -> LQGDesign:
    """A regulator as `lqr` makes it, acting on what a Kalman filter estimates from readings.

    Parameters
    ----------
    model, period, deviations, effort, delay, integrators, state_weights
        See `lqr`; outputs of integrators are among the measured ones.
    measured : sequence of str
        Outputs that the controller reads.
    noise : float or mapping of str to float
        Standard deviations of readings, of all or by sensor, in their units: see `quantisation_noise`.
    disturbance : float or mapping of str to float, optional
        Standard deviations of random efforts at inputs, constant from sample to sample [N m, N], of all motors or by
        input, points of `forces` among them. By default a tenth of the `effort` of each motor. More makes the filter
        faster and the loop more robust at the motors (loop transfer recovery), and lets it reach vibrations that the
        model does not have.
    state_noise : (n, n) array, optional
        Covariance added to that of the disturbances, of the model's own states or of all, for one sample.
    coloured : mapping of str to (float, Filter), optional
        Disturbances that last, besides, by input: their standard deviation [N m, N], and a cut-off frequency [Hz] or
        coefficients (numerator, denominator) in descending powers of s of the filter that noise comes through. The
        Kalman filter estimates them, and the torques act against them (Anderson and Moore, Optimal Control, section
        9.4). The filters' states follow the model's.

    Raises
    ------
    InputError
        See `lqr`; readings that do not show a motion without friction or a vibration, which it names.
    """
    plant, lasting = _disturbed(model, period, delay, coloured)
    regulator = _regulator(plant, deviations, effort, integrators or {}, state_weights)
    measured = tuple(measured)
    C = plant.rows(measured, "measured")
    for name in regulator.integrated:
        if name not in measured:
            raise InputError("is not measured", field="integrators", value=name, remedy="name it in measured, too")
    given = _by_name(noise, measured, "noise", "the unit of the reading")
    missing = [name for name in measured if name not in given]
    if missing:
        raise InputError("has no noise", field="noise", value=missing[0], remedy="give its standard deviation, say "
                         "pf.quantisation_noise(resolution)")  # fmt: skip
    check_reach(plant, C.T, "measured", "is not seen by the readings", "measure more outputs", transposed=True)
    process = _disturbances(plant, regulator, disturbance, effort) + _padded(state_noise, plant, "state_noise")
    process = process + lasting @ lasting.T
    R = np.diag([given[name] ** 2 for name in measured])
    motors = plant.B[:, places(regulator.motors, plant.inputs, "effort", "input")]
    found = kalman_filter(plant.A, motors, C, process, R)
    return LQGDesign(regulator, found, measured, _first_estimate(plant, C, np.sqrt(R)))


def _disturbed(model: Any, period: float, delay: float, coloured: Mapping[str, Any] | None) -> DisturbedPlant:
    if coloured:
        return disturbed_plant(model, period, delay, coloured)
    plant = as_sampled(model, period, delay)
    return DisturbedPlant(plant, np.zeros((len(plant.states), 0)))


class _Cost(NamedTuple):
    """Weights Q (n, n) and R (motors, motors) of states with integrals."""

    Q: Array
    R: Array


def _regulator(
    plant: SampledPlant, deviations: Mapping[str, float], effort: Any, integrators: Mapping[str, float], extra: Any
) -> Regulator:
    efforts = _by_name(effort, plant.inputs, "effort", "N m or N")
    largest = _by_name(deviations, plant.outputs, "deviations", "the unit of the output")
    times = _by_name(integrators, plant.outputs, "integrators", "s")
    for name in times:
        if name not in largest:
            raise InputError("has no deviation", field="integrators", value=name, remedy="name it in deviations, too")
    if not efforts:
        raise InputError("there is no motor", field="effort", remedy="name one with its largest torque")
    motors = tuple(name for name in plant.inputs if name in efforts)
    used = plant.select(motors)
    A, B = _with_integrals(used, tuple(times))
    rows = used.rows(tuple(largest)) / np.array(list(largest.values()))[:, None]
    Q = np.zeros_like(A)
    n = len(used.states)
    Q[:n, :n] = rows.T @ rows + _padded(extra, used, "state_weights")
    Q[n:, n:] = np.diag([1.0 / (largest[name] * time) ** 2 for name, time in times.items()])
    R = np.diag([1.0 / efforts[name] ** 2 for name in motors])
    check_reach(used, used.B, "effort", "is not reached by the motors", "choose other motors")
    P = _riccati(A, B, _Cost(Q, R))
    gain = scipy.linalg.solve(R + B.T @ P @ B, B.T @ P @ A, assume_a="pos")
    poles = np.linalg.eigvals(A - B @ gain)
    return Regulator(plant, motors, _of_all(gain, plant, used), tuple(times), poles)


def _of_all(gain: Array, plant: SampledPlant, used: SampledPlant) -> Array:
    """A gain for the states of a plant, of which those of inputs that are not used count for nothing."""
    found = np.zeros((len(gain), len(plant.states) + gain.shape[1] - len(used.states)))
    kept = [plant.states.index(name) for name in used.states]
    found[:, kept] = gain[:, : len(used.states)]
    found[:, len(plant.states) :] = gain[:, len(used.states) :]
    return found


def _with_integrals(plant: SampledPlant, names: Sequence[str]) -> tuple[Array, Array]:
    """A and B of a plant with sums of outputs times the period."""
    rows = plant.period * plant.rows(names)
    n, more = len(plant.states), len(names)
    A = np.block([[plant.A, np.zeros((n, more))], [rows, np.eye(more)]])
    return A, np.vstack([plant.B, np.zeros((more, plant.B.shape[1]))])


def _riccati(A: Array, B: Array, cost: _Cost) -> Array:
    try:
        return riccati(A, B, *cost)
    except (np.linalg.LinAlgError, ValueError):
        raise InputError(
            "no feedback is the best one", field="deviations",
            remedy="let deviations see all that moves freely or vibrates undamped, and integrate no more outputs than "
            "there are motors, none of which follows from others",
        ) from None  # fmt: skip


def _disturbances(plant: SampledPlant, regulator: Regulator, given: Any, effort: Any) -> Array:
    """Covariance (n, n) of what disturbs the states from sample to sample."""
    if given is None:
        efforts = _by_name(effort, regulator.motors, "effort", "N m or N")
        given = {name: _OF_EFFORT * value for name, value in efforts.items()}
    if isinstance(given, Mapping):
        sizes = _by_name(given, plant.inputs, "disturbance", "N m or N", not_negative)
    else:
        sizes = _by_name(given, regulator.motors, "disturbance", "N m or N", not_negative)
    G = plant.G[:, [plant.inputs.index(name) for name in sizes]] * np.array(list(sizes.values()))
    return G @ G.T


def _first_estimate(plant: SampledPlant, C: Array, spread: Array) -> Array:
    """States (n, measured) from first readings, least squares: at rest without torques, displaced in free motions."""
    n = plant.own
    own = plant.A[:n, :n]
    balanced, (size, _) = scipy.linalg.matrix_balance(own, permute=False, separate=True)
    free = scipy.linalg.null_space(balanced - np.eye(n), rcond=1e-9) if n else np.zeros((0, 0))
    free = free * size[:, None]
    weights = 1.0 / np.diag(spread)
    found = np.zeros((len(plant.states), len(C)))
    found[:n] = free @ np.linalg.pinv(weights[:, None] * (C[:, :n] @ free)) * weights
    return found


def _padded(given: ArrayLike | None, plant: SampledPlant, field: str) -> Array:
    """A symmetric matrix (n, n) of all states from one of all, or of the model's own.

    Raises
    ------
    InputError
        Another size, numbers that are not finite, a matrix that is not symmetric and positive semidefinite.
    """
    size = len(plant.states)
    whole = np.zeros((size, size))
    if given is None:
        return whole
    matrix = np.asarray(given, dtype=float)
    if matrix.shape not in ((plant.own, plant.own), (size, size)) or not np.all(np.isfinite(matrix)):
        raise InputError("has not the numbers it should have", field=field, value=matrix.shape,
                         remedy=f"give {plant.own} x {plant.own} finite numbers")  # fmt: skip
    largest = float(np.max(np.abs(matrix), initial=0.0))
    least = float(np.min(np.linalg.eigvalsh(matrix), initial=0.0))
    if np.max(np.abs(matrix - matrix.T), initial=0.0) > 1e-12 * largest or least < -1e-9 * largest:
        raise InputError("is not symmetric and positive semidefinite", field=field, value=matrix,
                         remedy="give such a matrix, say X.T @ X")  # fmt: skip
    whole[: len(matrix), : len(matrix)] = matrix
    return whole


def _by_name(given: Any, names: Sequence[str], field: str, unit: str, check: Any = positive) -> dict[str, float]:
    """Numbers by name, of all names where one number is given."""
    table: Mapping[str, float] = given if isinstance(given, Mapping) else dict.fromkeys(names, float(given))
    for name, value in table.items():
        known(name, names, field, "name")
        check(value, f"{field}.{name}" if isinstance(given, Mapping) else field, unit)
    return {name: float(value) for name, value in table.items()}
