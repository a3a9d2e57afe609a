"""Results of a linear-quadratic design: state feedback, and the control law that acts on a filter's estimate."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from paraflex.arrays import Array, Brief, Complex
from paraflex.control.design.sampled import SampledPlant, WithPoles
from paraflex.control.loop.together import SAME
from paraflex.dynamics.state_space import StateSpace
from paraflex.errors import InputError
from .controllers import Plant
from .estimators import KalmanFilter
from .linear_law import LinearLaw, LinearState


@dataclass(frozen=True)
class Regulator(WithPoles, Brief):
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


@dataclass(frozen=True)
class LQGDesign(WithPoles, Brief):
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
        rows = self.period * np.eye(len(self.measured))[[self.measured.index(one) for one in self.regulator.integrated]]
        K, K_i = np.split(self.K, [n], axis=1)
        rest = np.eye(n) - L @ one.C
        C, D = np.hstack([-K @ rest, -K_i]), -K @ L
        A = np.vstack([np.hstack([one.A @ rest, np.zeros((n, len(rows)))]) + one.B @ C,
                       np.eye(len(rows), n + len(rows), n)])  # fmt: skip
        return StateSpace(A, np.vstack([one.A @ L + one.B @ D, rows]), C, D)

    def law(self) -> "LQGLaw":
        """Return the control law in its initial state, for `SampledController`."""
        return LQGLaw(self)

    def in_run(self, plant: Plant | None = None) -> "LQGInRun":
        """Return the control law with the states of `state_space`, for a run or, without a plant, for steps by hand.

        The estimate is propagated with the limited torques, and the integrals stay constant while any torque is
        limited. Where planned torques act as well, they hold the equilibrium in place of the law.

        Raises
        ------
        InputError
            Sensors, motors, a period or a delay other than those of the design.
        """
        for what in ("inputs", "outputs") if plant else ():
            wanted, have = getattr(self, what), tuple(getattr(plant, what))
            if have != wanted:
                raise InputError("differ from those of the design in name or order", field=what, value=", ".join(have),
                                 remedy=f"leave them out, or give {', '.join(wanted)}")  # fmt: skip
        for what in ("period", "delay") if plant else ():
            wanted, have = getattr(self, what), getattr(plant, what)
            if abs(have - wanted) > SAME * self.period:
                raise InputError(f"the design is for {wanted:g} s", field=what, value=have,
                                 remedy=f"leave it out, or design for that {what}")  # fmt: skip
        n, rows = len(self.filter.A), len(self.regulator.integrated)
        return LQGInRun(
            *self.state_space,
            E=np.vstack([-self.filter.B, np.zeros((rows, len(self.outputs)))]),
            first=np.vstack([self.start, np.zeros((rows, len(self.inputs)))]),
            holding=0.0 * self.holding_torques if plant and plant.feed_forward else self.holding_torques,
            waiting=(np.arange(n + rows) >= n).astype(float),
            design=self,
        )


@dataclass(frozen=True)
class LQGInRun(LinearLaw):
    """Linear law of an `LQGDesign`."""

    design: LQGDesign = field(kw_only=True)

    @property
    def title(self) -> str:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Short description of the law, with the number of states of the model."""
        return f"LQG of {self.design.regulator.plant.own} states"


class LQGLaw:
    """Control law of an `LQGDesign` with its state, for `SampledController` or to be stepped by hand.

    Attributes
    ----------
    design : LQGDesign
        Design of the law.
    period, delay, inputs, outputs, state_space
        Sampling, readings, torques and matrices of the design.
    holding_torques : (motors,) array
        Holding torques of the design, part of its torques; zero where planned torques act as well [N m, N].
    """

    def __init__(self, design: LQGDesign) -> None:
        self.design = design
        self.period: float = design.period
        self.delay: float = design.delay
        self.inputs: tuple[str, ...] = design.inputs
        self.outputs: tuple[str, ...] = design.outputs
        self.state_space: StateSpace = design.state_space
        self._law = design.in_run()
        self._state: LinearState | None = None

    @property
    def holding_torques(self) -> Array:
        """Holding torques that are part of those of the law."""
        return self._law.holding

    @property
    def x(self) -> Array | None:
        """Estimate (n,) after the last reading; None before the first one."""
        state = self._state
        return None if state is None else self.design.filter.corrected(state.x[: len(self.design.start)], state.errors)

    @property
    def integrals(self) -> Array:
        """Integrals of outputs (integrated,)."""
        integrated = len(self.design.regulator.integrated)
        return np.zeros(integrated) if self._state is None else self._state.x[len(self.design.start) :]

    def start(self, plant: Plant) -> LQGInRun | None:
        """Reset the state, and return the law in a run: see `LQGDesign.in_run`; None if a subclass may step itself."""
        self._law, self._state = self.design.in_run(plant), None
        return self._law if type(self) is LQGLaw else None

    def step(self, k: int, t: float, y: Array) -> Array:
        """Return torques (motors,) from errors y (measured,) of the readings at sample k."""
        torques, self._state = self._law.step(self._state, k, t, np.array(y, dtype=float))
        return torques.copy()

    def limited(self, torques: Array) -> None:
        """Record the torques (motors,) that act in place of those that the law returned."""
        if self._state is not None:
            self._state = self._law.limited(self._state, np.array(torques, dtype=float))
