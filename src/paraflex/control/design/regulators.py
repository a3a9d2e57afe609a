"""Linear-quadratic design of sampled controllers: state feedback (LQR), and feedback of a Kalman filter (LQG)."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import scipy

from paraflex.arguments import checked_arguments, numbers_in
from paraflex.arrays import Array, ArrayLike
from paraflex.control.laws.estimators import kalman_filter, riccati
from paraflex.control.laws.lqg_law import LQGDesign, Regulator
from paraflex.control.loop.together import numbers_by_name
from paraflex.errors import InputError
from paraflex.linear import LinearModel
from paraflex.mechanism.quantities import not_negative
from .coloured import disturbed_plant
from .controllability import check_controllable
from .sampled import SampledPlant, as_sampled, places

# Default standard deviation of random torques, as a fraction of the largest torques.
_OF_EFFORT = 0.1


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
    """Design the state feedback that minimises sum (y / deviation)^2 + (u / effort)^2 over all samples.

    It solves the Riccati equation of the sampled plant with delayed torques as states (Franklin, Powell and Workman,
    Digital Control of Dynamic Systems, section 9.3), so that the delay is part of the design.

    Parameters
    ----------
    model : LinearModel, ReducedModel, state space, (A, B, C, D) or SampledPlant
        Model of the plant.
    period : float
        Sampling period [s].
    deviations : mapping of str to float
        Largest allowed deviations of outputs, in their units: the weight of an output is one over the square (Bryson's
        rule).
    effort : float or mapping of str to float
        Largest torques or forces, of all motors or by input [N m, N]. Inputs that a mapping does not name are not used,
        nor are forces at points, such as "link.tip.x", where one number is given.
    delay : float
        Delay from a sample until its torques act [s].
    integrators : mapping of str to float, optional
        Outputs whose errors are to vanish under constant loads, each with the time constant of that decay [s], valid if
        the rest of the loop is faster: the largest deviation of the integral is that of the output times this. The
        decay is slower where other deviations are tighter.
    state_weights : (n, n) array, optional
        Weights added for the model's own states or for all states; none by default.

    Returns
    -------
    Regulator
        State feedback.

    Raises
    ------
    InputError
        Unknown names, numbers that are not positive, or a free motion or undamped vibration that the motors do not
        reach or the weights do not include.
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
    """Design a regulator as `lqr` does, acting on the states that a Kalman filter estimates from readings.

    Parameters
    ----------
    model, period, deviations, effort, delay, integrators, state_weights
        See `lqr`; outputs of integrators must be among the measured ones.
    measured : sequence of str
        Outputs that the controller reads.
    noise : float or mapping of str to float
        Standard deviations of readings, of all or by sensor, in their units: see `quantisation_noise`.
    disturbance : float or mapping of str to float, optional
        Standard deviations of random efforts at inputs, constant between samples [N m, N], of all motors or by input,
        points of `forces` included. By default a tenth of the `effort` of each motor. Larger values make the filter
        faster and the loop more robust at the motors (loop transfer recovery), and extend its bandwidth to vibrations
        that are not in the model.
    state_noise : (n, n) array, optional
        Covariance added to that of the disturbances, of the model's own states or of all, for one sample.
    coloured : mapping of str to (float, Filter), optional
        Additional coloured disturbances by input: standard deviation [N m, N], and the filter that shapes the noise, a
        cut-off frequency [Hz] or coefficients (numerator, denominator) in descending powers of s. The Kalman filter
        estimates them, and the torques act against them (Anderson and Moore, Optimal Control, section 9.4). The
        filters' states follow the model's.

    Returns
    -------
    LQGDesign
        Regulator and filter.

    Raises
    ------
    InputError
        See `lqr`; a free motion or undamped vibration, named by its frequency, that the readings do not show.
    """
    plant, persistent = disturbed_plant(model, period, delay, coloured or {})
    regulator = _regulator(plant, deviations, effort, integrators or {}, state_weights)
    measured = tuple(measured)
    C = plant.rows(measured, "measured")
    for name in regulator.integrated:
        if name not in measured:
            raise InputError("is not measured", field="integrators", value=name, remedy="name it in measured, too")
    given = numbers_by_name(noise, measured, "noise", "the unit of the reading")
    missing = [name for name in measured if name not in given]
    if missing:
        raise InputError("has no noise", field="noise", value=missing[0], remedy="give its standard deviation, such as "
                         "pf.quantisation_noise(resolution)")  # fmt: skip
    check_controllable(plant, C.T, "measured", "is not seen by the readings", "measure more outputs", transposed=True)
    process = _disturbances(plant, regulator, disturbance, effort) + _padded(state_noise, plant, "state_noise")
    process = process + persistent @ persistent.T
    R = np.diag([given[name] ** 2 for name in measured])
    motors = plant.B[:, places(regulator.motors, plant.inputs, "effort", "input")]
    found = kalman_filter(plant.A, motors, C, process, R)
    start = _first_estimate(plant, C, np.sqrt(R))
    return LQGDesign(regulator, found, measured, start, _holding(model, regulator.motors))


def _holding(model: Any, motors: Sequence[str]) -> Array:
    """Return the torques (motors,) of the equilibrium about which a model is linearised; zero for other models."""
    full = getattr(model, "full", model)
    if not isinstance(full, LinearModel) or not full.at_rest:
        return np.zeros(len(motors))
    point, own = full.minimal.point, [motor.name for motor in full.minimal.system.mechanism.motors]
    return np.array([point.torques[own.index(name)] if name in own else 0.0 for name in motors])


def _regulator(
    plant: SampledPlant, deviations: Mapping[str, float], effort: Any, integrators: Mapping[str, float], extra: Any
) -> Regulator:
    # Forces at points of a linear model are named like "link.point.x", unlike motors.
    motors = [name for name in plant.inputs if name.count(".") < 2 or not name.endswith((".x", ".y"))]
    usable = plant.inputs if isinstance(effort, Mapping) else motors
    efforts = numbers_by_name(effort, usable, "effort", "N m or N")
    largest = numbers_by_name(deviations, plant.outputs, "deviations", "the unit of the output")
    times = numbers_by_name(integrators, plant.outputs, "integrators", "s")
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
    check_controllable(used, used.B, "effort", "is not reached by the motors", "choose other motors")
    try:
        P = riccati(A, B, Q, R)
    except (np.linalg.LinAlgError, ValueError):
        raise InputError(
            "there is no optimal feedback", field="deviations",
            remedy="choose deviations that show all free and undamped motion, and integrate no more outputs than "
            "there are motors, each independent of the others",
        ) from None  # fmt: skip
    gain = scipy.linalg.solve(R + B.T @ P @ B, B.T @ P @ A, assume_a="pos")
    poles = np.linalg.eigvals(A - B @ gain)
    return Regulator(plant, motors, _of_all(gain, plant, used), tuple(times), poles)


def _of_all(gain: Array, plant: SampledPlant, used: SampledPlant) -> Array:
    """Return a gain for all states of a plant, with zeros for the delayed torques of inputs that are not used."""
    found = np.zeros((len(gain), len(plant.states) + gain.shape[1] - len(used.states)))
    kept = [plant.states.index(name) for name in used.states]
    found[:, kept] = gain[:, : len(used.states)]
    found[:, len(plant.states) :] = gain[:, len(used.states) :]
    return found


def _with_integrals(plant: SampledPlant, names: Sequence[str]) -> tuple[Array, Array]:
    """Return A and B of a plant augmented by integrals of outputs, sums times the period."""
    rows = plant.period * plant.rows(names)
    n, more = len(plant.states), len(names)
    A = np.block([[plant.A, np.zeros((n, more))], [rows, np.eye(more)]])
    return A, np.vstack([plant.B, np.zeros((more, plant.B.shape[1]))])


def _disturbances(plant: SampledPlant, regulator: Regulator, given: Any, effort: Any) -> Array:
    """Return the covariance (n, n) of the disturbances of the states from sample to sample."""
    if given is None:
        efforts = numbers_by_name(effort, regulator.motors, "effort", "N m or N")
        given = {name: _OF_EFFORT * value for name, value in efforts.items()}
    # A mapping may name forces at points as well; one number applies to the motors.
    names = plant.inputs if isinstance(given, Mapping) else regulator.motors
    sizes = numbers_by_name(given, names, "disturbance", "N m or N", not_negative)
    G = plant.G[:, [plant.inputs.index(name) for name in sizes]] * np.array(list(sizes.values()))
    return G @ G.T


def _first_estimate(plant: SampledPlant, C: Array, spread: Array) -> Array:
    """Return the matrix (n, measured) from the first readings to the first estimate, by weighted least squares.

    The estimate is at rest without torques, displaced in the free motions.
    """
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
    """Return a positive semidefinite matrix (n, n) for all states, from one for all or for the model's own."""
    size = len(plant.states)
    whole = np.zeros((size, size))
    if given is None:
        return whole
    matrix = np.asarray(numbers_in(given, field), dtype=float)
    if matrix.shape not in ((plant.own, plant.own), (size, size)) or not np.all(np.isfinite(matrix)):
        raise InputError("has the wrong shape, or is not finite", field=field, value=matrix.shape,
                         remedy=f"give {plant.own} x {plant.own} finite numbers")  # fmt: skip
    largest = float(np.max(np.abs(matrix), initial=0.0))
    least = float(np.min(np.linalg.eigvalsh(matrix), initial=0.0))
    if np.max(np.abs(matrix - matrix.T), initial=0.0) > 1e-12 * largest or least < -1e-9 * largest:
        raise InputError("is not symmetric and positive semidefinite", field=field, value=matrix,
                         remedy="give such a matrix, for example X.T @ X")  # fmt: skip
    whole[: len(matrix), : len(matrix)] = matrix
    return whole
