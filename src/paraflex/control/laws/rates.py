"""Feedback of the rates of readings."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array
from paraflex.control.laws.controllers import Plant
from paraflex.control.laws.discrete import DiscreteModel
from paraflex.control.laws.estimators import BackwardDifference, checked_cutoff
from paraflex.control.laws.linear_law import LinearLaw
from paraflex.errors import InputError
from paraflex.mechanism.quantities import all_known, finite


class RateFeedback:
    """Rate feedback tau = -K y', for example damping by strain rates: a law for `SampledController`.

    The rate of the strain at a beam's root is nearly collocated with the motor there: its feedback removes energy from
    a vibration as long as the delay is short compared with the period of the vibration.

    Parameters
    ----------
    gains : mapping of str to mapping of str to float
        Gains K by motor and sensor: torque per rate of the reading [N m s per unit of the sensor].
    cutoff : float, optional
        Cut-off frequency of the low-pass filter of rates [Hz]; no filter by default.

    Raises
    ------
    InputError
        No gains, or gains that are not finite numbers.
    """

    title = "rate feedback"

    @checked_arguments()
    def __init__(self, gains: Mapping[str, Mapping[str, float]], *, cutoff: float | None = None) -> None:
        self.inputs: tuple[str, ...] = tuple(dict.fromkeys(name for row in gains.values() for name in row))
        self.outputs: tuple[str, ...] = tuple(gains)
        if not self.inputs:
            raise InputError("no gains", field="gains", remedy="give them by motor and sensor")
        for motor, row in gains.items():
            for name, gain in row.items():
                finite(gain, f"gains.{motor}.{name}")
        self._gains = np.array([[row.get(name, 0.0) for name in self.inputs] for row in gains.values()], dtype=float)
        self._cutoff = checked_cutoff(cutoff)

    def start(self, plant: Plant) -> None:
        """Prepare for a run: see `Controller.start`."""
        for names, own, what in ((plant.inputs, self.inputs, "inputs"), (plant.outputs, self.outputs, "outputs")):
            all_known(names, own, what, "name")
        self._K = self._gains[np.ix_([self.outputs.index(name) for name in plant.outputs],
                                     [self.inputs.index(name) for name in plant.inputs])]  # fmt: skip
        self._rates = BackwardDifference(plant.period, self._cutoff)

    @checked_arguments()
    def sampled(self, period: float) -> DiscreteModel:
        """Return the law at a period [s] as a state-space model, for `closed_loop` and `margins`."""
        one = BackwardDifference(period, self._cutoff).linear_law(len(self.inputs))
        K = self._gains
        return DiscreteModel(one.A, one.B, -K @ one.C, -K @ one.D, period, self.inputs, self.outputs)

    def step(self, k: int, t: float, y: Array) -> Array:
        """Compute the torques of a sample: see `Controller.step`."""
        return -self._K @ self._rates.step(y)[1]

    def linear_law(self) -> LinearLaw:
        """Return the law for the compiled time loop; its states are the previous readings and their rates."""
        rates = self._rates.linear_law(self._K.shape[1])
        return LinearLaw(rates.A, rates.B, -self._K @ rates.C, -self._K @ rates.D, first=rates.first)
