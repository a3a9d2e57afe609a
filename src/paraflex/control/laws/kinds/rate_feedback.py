"""Feedback of the rates of readings."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from paraflex.arguments import checked_arguments
from paraflex.control.laws.controllers import Plant
from paraflex.control.laws.discrete import DiscreteModel
from paraflex.control.laws.estimators import CUTOFF, BackwardDifference
from paraflex.control.laws.law import Law, given
from paraflex.control.laws.linear_law import LinearLaw
from paraflex.errors import InputError
from paraflex.mechanism import Mechanism
from paraflex.mechanism.measured import measured_sensors
from paraflex.mechanism.quantities import all_known, finite


@dataclass(frozen=True)
class RateFeedback(Law, kind="rate-feedback", title="rate feedback"):
    """Feedback of the rates of readings, such as strains: tau = -K y'.

    The rate of the strain at a beam's root is nearly collocated with the motor there: its feedback removes energy from
    a vibration as long as the delay is short compared with the period of the vibration.

    Attributes
    ----------
    gains : mapping of str to mapping of str to float
        Gains K by motor and sensor: torque per rate of the reading [N m s per unit of the sensor]. A mode uses those of
        its motors.
    cutoff : float, optional
        Cut-off frequency of the low-pass filter of rates [Hz]; no filter by default.

    Raises
    ------
    InputError
        No gains, or gains that are not finite numbers.
    """

    gains: Mapping[str, Mapping[str, float]] = given(
        "by motor and sensor the torque or force over the rate of the reading, in N m s or N s by the unit of the "
        "sensor",
        finite,
        by="outputs",
    )
    cutoff: float | None = given(*CUTOFF, default=None)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.inputs:
            raise InputError("no gains", field="gains", remedy="give them by motor and sensor")

    @property
    def inputs(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Sensors that the gains name."""
        return tuple(dict.fromkeys(name for row in self.gains.values() for name in row))

    @property
    def outputs(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Motors that the gains name."""
        return tuple(self.gains)

    def check(self, mechanism: Mechanism, inputs: Sequence[str], outputs: Sequence[str]) -> None:
        """Check the names of motors and sensors: see `Law.check`."""
        super().check(mechanism, inputs, outputs)
        sensors = [sensor.name for sensor in measured_sensors(mechanism)]
        for motor, row in self.gains.items():
            all_known(row, sensors, f"gains.{motor}", "sensor")
        for field_name, own in (("inputs", inputs), ("outputs", outputs)):
            if own and set(own) != set(getattr(self, field_name)):
                raise InputError("differ from those of the gains", field=field_name, value=", ".join(own),
                                 remedy="leave it out")  # fmt: skip

    def start(self, plant: Plant) -> LinearLaw:
        """Return the law in a run: see `Law.start`. Its states are the previous readings and their rates."""
        for names, own, what in ((plant.inputs, self.inputs, "inputs"), (plant.outputs, self.outputs, "outputs")):
            all_known(names, own, what, "name")
        return self._linear(plant.inputs, plant.outputs, plant.period)

    @checked_arguments()
    def sampled(self, period: float) -> DiscreteModel:
        """Return the law at a period [s] as a state-space model, for `closed_loop` and `margins`."""
        law = self._linear(self.inputs, self.outputs, period)
        return DiscreteModel(law.A, law.B, law.C, law.D, period, self.inputs, self.outputs)

    def _linear(self, inputs: Sequence[str], outputs: Sequence[str], period: float) -> LinearLaw:
        K = np.array([[self.gains[motor].get(name, 0.0) for name in inputs] for motor in outputs], dtype=float)
        rates = BackwardDifference(period, self.cutoff).linear_law(len(inputs))
        return LinearLaw(rates.A, rates.B, -K @ rates.C, -K @ rates.D, first=rates.first)
