"""Results of a linear-quadratic design: state feedback, and the control law that acts on a filter's estimate."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from paraflex.arrays import Array
from paraflex.control.design.sampled import SampledPlant
from paraflex.control.laws.controllers import Plant
from paraflex.control.laws.estimators import KalmanFilter
from paraflex.control.laws.linear_law import LinearLaw
from paraflex.control.loop.together import SAME
from paraflex.errors import InputError
from paraflex.linear.zeros import StateSpace

Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class Regulator:
    """State feedback u = -`gain` [x; integrals] of a sampled plant.

    Attributes
    ----------
    plant : SampledPlant
        Plant, with delayed torques among its states.
    motors : tuple of str
        Inputs on which it acts.
    gain : (motors, n + integrated) array
        Feedback gain K.
    integrated : tuple of str
        Outputs whose integrals are fed back as well.
    poles : (n + integrated,) array
        Poles z of the plant with this feedback.
    """

    plant: SampledPlant
    motors: tuple[str, ...]
    gain: Array
    integrated: tuple[str, ...]
    poles: Complex

    @property
    def spectral_radius(self) -> float:
        """Largest magnitude of the poles."""
        return float(np.max(np.abs(self.poles), initial=0.0))


@dataclass(frozen=True)
class LQGDesign:
    """Regulator that acts on the estimate of a Kalman filter.

    Attributes
    ----------
    regulator : Regulator
        State feedback.
    filter : KalmanFilter
        Steady-state Kalman filter.
    measured : tuple of str
        Outputs that the filter reads, in this order.
    start : (n, measured) array
        Matrix from the first readings to the first estimate: at rest, displaced in the free motions.
    holding_torques : (motors,) array
        Torques that hold the equilibrium about which the model is linearised [N m, N]; zero for a model about a motion.
    """

    regulator: Regulator
    filter: KalmanFilter
    measured: tuple[str, ...]
    start: Array
    holding_torques: Array

    @property
    def K(self) -> Array:
        """Feedback gain (motors, n + integrated), u = -K [x; integrals]."""
        return self.regulator.gain

    @property
    def L(self) -> Array:
        """Filter gain (n, measured)."""
        return self.filter.gain

    @property
    def poles(self) -> Complex:
        """Poles z of the closed loop on the plant of the design: those of the regulator and of the filter."""
        return np.concatenate([self.regulator.poles, self.filter.poles])

    @property
    def spectral_radius(self) -> float:
        """Largest magnitude of the poles."""
        return float(np.max(np.abs(self.poles), initial=0.0))

    @property
    def period(self) -> float:
        """Sampling period [s]."""
        return self.regulator.plant.period

    @property
    def delay(self) -> float:
        """Delay that the design accounts for [s]."""
        return self.regulator.plant.delay

    @property
    def inputs(self) -> tuple[str, ...]:
        """Sensors: `measured`."""
        return self.measured

    @property
    def outputs(self) -> tuple[str, ...]:
        """Motors of the regulator."""
        return self.regulator.motors

    @cached_property
    def state_space(self) -> StateSpace:
        """Controller without limits, from readings to torques: x_k+1 = A x_k + B y_k, u_k = C x_k + D y_k.

        The states are the estimate before the reading, and the integrals.
        """
        one, L, n = self.filter, self.L, len(self.filter.A)
        rows = self._integrals
        K, K_i = np.split(self.K, [n], axis=1)
        rest = np.eye(n) - L @ one.C
        C, D = np.hstack([-K @ rest, -K_i]), -K @ L
        A = np.vstack([np.hstack([one.A @ rest, np.zeros((n, len(rows)))]) + one.B @ C,
                       np.eye(len(rows), n + len(rows), n)])  # fmt: skip
        return StateSpace(A, np.vstack([one.A @ L + one.B @ D, rows]), C, D)

    @property
    def _integrals(self) -> Array:
        """Contribution of a reading to the integrals (integrated, measured)."""
        return self.period * np.eye(len(self.measured))[[self.measured.index(one) for one in self.regulator.integrated]]

    def law(self) -> LQGLaw:
        """Return the control law in its initial state, for `SampledController`."""
        return LQGLaw(self)


class LQGLaw:
    """Control law of an `LQGDesign`: torques from errors of readings, with the estimate as its state.

    `limited` accounts for limits: the estimate is propagated with the limited torques, and the integrals stay constant
    while any torque is limited.

    Attributes
    ----------
    design : LQGDesign
        Design of the law.
    period, delay : float
        Sampling period, and delay from a sample until its torques act [s].
    inputs, outputs : tuple of str
        Sensors and motors.
    x : (n,) array
        Estimate after the last reading; None before the first one.
    integrals : (integrated,) array
        Integrals of outputs.
    holding_torques : (motors,) array
        Holding torques of the design, part of its torques; zero where planned torques act as well [N m, N].
    """

    def __init__(self, design: LQGDesign) -> None:
        self.design = design
        self.period: float = design.period
        self.delay: float = design.delay
        self.inputs: tuple[str, ...] = design.inputs
        self.outputs: tuple[str, ...] = design.outputs
        self._reset(design.holding_torques)

    def _reset(self, holding: Array) -> None:
        self.holding_torques: Array = holding
        self.x: Array | None = None
        self.integrals: Array = np.zeros(len(self.design.regulator.integrated))
        self._wanted: Array = np.zeros(len(self.outputs))
        self._given: Array = self._wanted
        self._read: Array = np.zeros(len(self.inputs))

    @property
    def state_space(self) -> StateSpace:
        """Controller without limits: see `LQGDesign.state_space`."""
        return self.design.state_space

    def start(self, plant: Plant) -> None:
        """Reset the states for a new run.

        Raises
        ------
        InputError
            Sensors, motors, a period or a delay other than those of the design.
        """
        pairs = (("inputs", self.inputs, plant.inputs), ("outputs", self.outputs, plant.outputs))
        for field, wanted, have in pairs:
            if tuple(have) != wanted:
                raise InputError("differ from those of the design in name or order", field=field, value=", ".join(have),
                                 remedy=f"leave them out, or give {', '.join(wanted)}")  # fmt: skip
        for field, wanted, have in (("period", self.period, plant.period), ("delay", self.delay, plant.delay)):
            if abs(have - wanted) > SAME * self.period:
                raise InputError(f"the design is for {wanted:g} s", field=field, value=have,
                                 remedy=f"leave it out, or design for that {field}")  # fmt: skip
        self._reset(np.zeros_like(self.holding_torques) if plant.feed_forward else self.design.holding_torques)

    def step(self, k: int, t: float, y: Array) -> Array:
        """Return torques (motors,) from errors y (measured,) of the readings at sample k."""
        design = self.design
        if self.x is None:
            before = design.start @ y
        else:
            before = design.filter.carried_on(self.x, self._given - self.holding_torques)
            if np.array_equal(self._given, self._wanted):
                self.integrals = self.integrals + design._integrals @ self._read
        self.x = design.filter.corrected(before, y)
        self._read = np.array(y, dtype=float)
        self._wanted = self.holding_torques - design.K @ np.concatenate([self.x, self.integrals])
        self._given = self._wanted
        return self._wanted.copy()

    def linear_law(self) -> LinearLaw:
        """Return the law for the compiled time loop, with the states of `LQGDesign.state_space`."""
        design, states = self.design, self.state_space
        n, more = len(design.filter.A), len(self.integrals)
        return LinearLaw(
            *states,
            E=np.vstack([-design.filter.B, np.zeros((more, len(self.outputs)))]),
            holding=self.holding_torques,
            first=np.vstack([design.start, np.zeros((more, len(self.inputs)))]),
            waiting=(np.arange(n + more) >= n).astype(float),
        )

    def limited(self, torques: Array) -> None:
        """Record the torques (motors,) that act in place of those that the law returned."""
        self._given = np.array(torques, dtype=float)
